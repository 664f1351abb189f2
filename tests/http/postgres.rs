//! Several servers on one PostgreSQL: what one is told all know, and a job is the work of all, whoever dies.

mod cluster;

use std::sync::LazyLock;
use std::time::{Duration, Instant};

use reqwest::{RequestBuilder, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::calibrations::{boards, form, request, wall};
use crate::killed::{Program, is_final};
use crate::station::client;
use cluster::Cluster;

const CALIBRATIONS: &str = "/v1/calibrations";

/// A job of many shards: what is posted where, and how often each shard is told of.
struct Work {
    place: &'static str,
    /// As the metrics have it.
    kind: &'static str,
    body: fn(RequestBuilder) -> RequestBuilder,
    shards: u64,
    told: fn(u64) -> String,
    /// Words that its report holds.
    reported: &'static str,
}

/// Pictures of a board, so that a camera is found, and almost as many that take their time and show none.
const CALIBRATION: Work = Work {
    place: CALIBRATIONS,
    kind: "calibration",
    body: |post| {
        static BOARDS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| boards(7).into_iter().map(|board| board.1).collect());
        static WALL: LazyLock<Vec<u8>> = LazyLock::new(|| wall(1600, 1200));
        let mut asked = request();
        asked["name"] = json!("found");
        asked["fixed"] = json!(["k3"]);
        let pictures = (0..16).map(|number| match number {
            1..=13 if number % 2 == 1 => (format!("left{number:02}.png"), WALL.clone()),
            _ => (format!("left{number:02}.jpg"), BOARDS[number / 2 % 7].clone()),
        });
        post.multipart(form(&asked, pictures))
    },
    shards: 16,
    told: |number| match number {
        1..=13 if number % 2 == 1 => format!("\"message\":\"left{number:02}.png: "),
        _ => format!("\"message\":\"left{number:02}.jpg: "),
    },
    reported: "left02.jpg",
};

/// Cases that take their time.
const EVALUATION: Work = Work {
    place: "/v1/evaluations",
    kind: "evaluation",
    body: |post| post.json(&json!({"study": "thesis-2012", "runs": 28_000, "solvers": ["epnp+refine", "auto"]})),
    shards: 14,
    told: |number| format!("\"message\":\"runs {} to {}\"", number * 2_000 + 1, (number + 1) * 2_000),
    reported: "epnp+refine",
};

/// A few pictures that take their time and show no board.
const WALLS: Work = Work {
    place: CALIBRATIONS,
    kind: "calibration",
    body: |post| {
        let wall = wall(2000, 1500);
        post.multipart(form(&request(), (0..8).map(|number| (format!("wall{number:02}.png"), wall.clone()))))
    },
    shards: 8,
    told: |number| format!("\"message\":\"wall{number:02}.png: "),
    reported: "wall02.png",
};

/// A server with a folder of its own, as on a machine of its own.
struct Server {
    program: Program,
    _data: TempDir,
}

impl Server {
    fn start(storage: Option<&str>) -> Self {
        let data = tempfile::tempdir().expect("a folder");
        let options: Vec<&str> = storage.into_iter().flat_map(|address| ["--storage", address]).collect();
        Self { program: Program::with(data.path(), &options), _data: data }
    }

    /// Shards that it has computed.
    async fn computed(&self, work: &Work) -> u64 {
        let text = self.text("/metrics").await;
        let head = format!("skypose_shard_seconds_count{{kind=\"{}\"}} ", work.kind);
        let line = text.lines().find_map(|line| line.strip_prefix(&head));
        line.map_or(0, |number| number.parse().expect("a number"))
    }

    async fn text(&self, place: &str) -> String {
        let reply = client().get(format!("{}{place}", self.program.base)).send().await.expect("an answer");
        reply.text().await.expect("a text")
    }

    async fn status(&self, place: &str) -> StatusCode {
        client().get(format!("{}{place}", self.program.base)).send().await.expect("an answer").status()
    }

    async fn becomes(&self, place: &str, wanted: StatusCode) {
        for _ in 0..600 {
            if self.status(place).await == wanted {
                return;
            }
            tokio::time::sleep(Duration::from_millis(50)).await;
        }
        panic!("{place} never becomes {wanted}");
    }
}

/// Each shard is told of once, and the numbers of the events have no gap.
fn assert_told_once(work: &Work, events: &str) {
    for number in 0..work.shards {
        assert_eq!(events.matches(&(work.told)(number)).count(), 1, "shard {number}: {events}");
    }
    let numbers: Vec<u64> = events
        .lines()
        .filter_map(|line| line.strip_prefix("id: ").or(line.strip_prefix("id:"))?.parse().ok())
        .collect();
    // Between the shards and the end it is told how far the result of them is.
    let finishing = events.matches(" % of the result of all parts").count() as u64;
    let all = work.shards + 3 + finishing;
    assert!(
        numbers.iter().copied().eq(1..=all),
        "queued, running, the shards, {finishing} of the result, the end: {numbers:?}"
    );
}

/// Times are never the same again.
fn assert_same(found: &Value, alone: &Value) {
    let timeless = |job: &Value| {
        let mut job = job.clone();
        job["result"].as_object_mut().map(|result| result.remove("timing"));
        job
    };
    let (found, alone) = (timeless(found), timeless(alone));
    for member in ["status", "shards", "shards_done", "progress", "request", "files", "result", "error"] {
        assert_eq!(found[member], alone[member], "{member}");
    }
}

#[tokio::test]
async fn three_servers_of_which_one_is_killed_come_to_the_camera_of_one_alone() {
    three_servers(&CALIBRATION).await;
}

#[tokio::test]
async fn three_servers_of_which_one_is_killed_come_to_the_figures_of_one_alone() {
    three_servers(&EVALUATION).await;
}

async fn three_servers(work: &Work) {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let Some(cluster) = Cluster::start().await else { return };
    let database = cluster.database().await;
    // All at once: one of them makes the tables.
    let starts = [(); 3].map(|()| {
        let database = database.clone();
        tokio::task::spawn_blocking(move || Server::start(Some(&database)))
    });
    let mut servers = Vec::new();
    for start in starts {
        servers.push(start.await.expect("starts"));
    }
    let place = servers[0].program.make(work.place, work.body).await;
    loop {
        let job = servers[1].program.get(&place).await;
        assert!(!is_final(&job), "more shards are needed to be killed at work: {job}");
        let computed =
            [servers[0].computed(work).await, servers[1].computed(work).await, servers[2].computed(work).await];
        if computed.iter().all(|computed| *computed > 0) && job["shards_done"].as_u64() > Some(3) {
            println!("killed at {} of {} shards, computed by each: {computed:?}", job["shards_done"], work.shards);
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let killed = servers.remove(1);
    let computed_by_killed = killed.computed(work).await;
    killed.program.kill();
    let start = Instant::now();
    let job = servers[0].program.when(&place, is_final).await;
    println!("ended {:.1} s after one was killed", start.elapsed().as_secs_f64());
    assert_eq!(job["status"], "succeeded", "{job}");
    let computed = computed_by_killed + servers[0].computed(work).await + servers[1].computed(work).await;
    assert!((work.shards - 2..=work.shards + 2).contains(&computed), "{computed} shards were computed");

    let alone = Server::start(None);
    let place_alone = alone.program.make(work.place, work.body).await;
    assert_same(&job, &alone.program.when(&place_alone, is_final).await);
    if work.kind == "calibration" {
        // Times stand in reports of evaluations.
        assert_eq!(
            servers[0].text(&format!("{place}/report")).await,
            alone.text(&format!("{place_alone}/report")).await
        );
        let camera = alone.program.get("/v1/cameras/found").await;
        assert_eq!(
            (&camera["width"], servers[0].program.get("/v1/cameras/found").await),
            (&json!(640), camera.clone())
        );
    }
    servers.push(Server::start(Some(&database)));
    let attachment = format!("{place}/report");
    let report = servers[0].text(&attachment).await;
    assert!(report.contains(work.reported));
    for server in &servers {
        assert_eq!(server.program.get(&place).await, job);
        assert_eq!(server.text(&attachment).await, report);
        assert_told_once(work, &server.text(&format!("{place}/events")).await);
    }
    let http = client();
    let removed = http.delete(format!("{}{place}", servers[2].program.base)).send().await.expect("an answer");
    assert_eq!(removed.status(), StatusCode::NO_CONTENT);
    assert_eq!(servers[0].status(&attachment).await, StatusCode::NOT_FOUND);
    for server in servers {
        server.program.terminate();
    }
}

#[tokio::test]
async fn what_one_server_is_told_the_others_do() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let Some(cluster) = Cluster::start().await else { return };
    let database = cluster.database().await;
    let servers = [(); 3].map(|()| Server::start(Some(&database)));
    let http = client();
    let camera = |fx: f64| json!({"width": 640, "height": 480, "fx": fx, "fy": 600, "cx": 320, "cy": 240});
    let pose = json!({"camera": "front", "object_points_m": [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
                      "image_points_px": [[320, 240], [440, 240], [440, 360], [320, 360]]});
    let posed = async |server: &Server| {
        http.post(format!("{}/v1/poses", server.program.base)).json(&pose).send().await.expect("an answer").status()
    };
    assert_eq!(posed(&servers[1]).await, StatusCode::NOT_FOUND);
    for fx in [600.0, 700.0] {
        let put = http.put(format!("{}/v1/cameras/front", servers[0].program.base)).json(&camera(fx));
        assert!(put.send().await.expect("an answer").status().is_success());
        for server in &servers {
            assert_eq!(server.program.get("/v1/cameras/front").await["fx"], fx);
            assert_eq!(posed(server).await, StatusCode::OK);
        }
    }

    let work = &CALIBRATION;
    let place = servers[0].program.make(work.place, work.body).await;
    servers[1].program.when(&place, |job| job["shards_done"].as_u64() > Some(3)).await;
    let cancelled = http.delete(format!("{}{place}", servers[2].program.base)).send().await.expect("an answer");
    assert_eq!(cancelled.status(), StatusCode::ACCEPTED);
    let job = servers[0].program.get(&place).await;
    assert_eq!(job["status"], "cancelled");
    // Who is at a shard looks twice a second.
    tokio::time::sleep(Duration::from_secs(1)).await;
    let computed = async || {
        let mut all = 0;
        for server in &servers {
            all += server.computed(work).await;
        }
        all
    };
    let before = computed().await;
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(computed().await, before, "somebody goes on");
    assert!(before < work.shards);
    assert_eq!(servers[1].program.get(&place).await, job);
}

#[tokio::test]
async fn a_database_that_goes_away_and_comes_back_is_waited_for() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let Some(mut cluster) = Cluster::start().await else { return };
    let database = cluster.database().await;
    let server = Server::start(Some(&database));
    let work = &WALLS;
    let place = server.program.make(work.place, work.body).await;
    server.program.when(&place, |job| job["shards_done"].as_u64() > Some(3)).await;
    cluster.stop();
    server.becomes("/readyz", StatusCode::SERVICE_UNAVAILABLE).await;
    let start = Instant::now();
    let reply = client().get(format!("{}/v1/cameras", server.program.base)).send().await.expect("an answer");
    assert_eq!(reply.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(reply.headers()["content-type"], "application/problem+json");
    assert!(start.elapsed() < Duration::from_secs(8), "it took {:?}", start.elapsed());
    assert_eq!(server.status("/healthz").await, StatusCode::OK);
    cluster.run().await;
    server.becomes("/readyz", StatusCode::OK).await;
    let start = Instant::now();
    let job = server.program.when(&place, is_final).await;
    println!("ended {:.1} s after the database came back", start.elapsed().as_secs_f64());
    // Walls are no boards: the job says so, of all of them.
    assert_eq!((&job["error"]["status"], &job["shards_done"]), (&json!(422), &json!(work.shards)), "{job}");
    assert_told_once(work, &server.text(&format!("{place}/events")).await);
    server.program.terminate();
}

#[tokio::test]
async fn a_database_that_is_not_there_is_told_without_the_password() {
    let data = tempfile::tempdir().expect("a folder");
    for (address, code) in [
        ("postgres://sky:s3cret@127.0.0.1:9/poses", 1),
        ("mysql://sky:s3cret@db/poses", 2),
        ("postgres://sky:s3cret@db", 2),
    ] {
        let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_skypose"));
        command.args(["serve", "--listen", "127.0.0.1:0", "--storage", address, "--data"]).arg(data.path());
        let ended = command.output().expect("runs");
        let told = String::from_utf8_lossy(&ended.stderr);
        assert_eq!(ended.status.code(), Some(code), "{told}");
        assert!(
            !told.contains("s3cret") && told.contains(if code == 1 { "refused" } else { "store.storage" }),
            "{told}"
        );
    }
}
