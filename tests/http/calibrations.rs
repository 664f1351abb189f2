//! Calibrations as jobs: posted, watched, cancelled, removed.

use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;

use reqwest::multipart::{Form, Part};
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use skypose::board::Board;
use skypose::frame::{Coding, Frame, Pixels};
use skypose::random::named;
use skypose::scene::boards::{STUDY_LENSES, pose_in_view, study_camera};
use skypose::scene::encode;
use skypose::scene::render::{Optics, Rays, Sheet, render_sheet};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::station::{Reply, Station, read};

const PLACE: &str = "/v1/calibrations";

pub fn request() -> Value {
    json!({"pattern": "chessboard:9x6:0.025"})
}

/// A gray wall, as PNG: a small file, and some work for who looks for a board on it.
pub fn wall(width: u32, height: u32) -> Vec<u8> {
    let samples = vec![128; (width * height) as usize];
    let frame = Frame::checked(width, height, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
    encode::png(&frame).expect("encodes")
}

/// Twelve million pixels.
pub fn large() -> Vec<u8> {
    static LARGE: LazyLock<Vec<u8>> = LazyLock::new(|| wall(4000, 3000));
    LARGE.clone()
}

pub fn form(request: &Value, pictures: impl IntoIterator<Item = (String, Vec<u8>)>) -> Form {
    let form = Form::new().text("request", request.to_string());
    pictures.into_iter().fold(form, |form, (name, bytes)| form.part("image", Part::bytes(bytes).file_name(name)))
}

fn walls(count: usize) -> Vec<(String, Vec<u8>)> {
    (0..count).map(|number| (format!("left{number:02}.png"), wall(64, 64))).collect()
}

fn post(station: &Station, form: Form) -> RequestBuilder {
    station.request(Method::POST, PLACE).multipart(form)
}

fn place_of(reply: &Reply) -> String {
    assert_eq!(reply.status, StatusCode::ACCEPTED, "{reply:?}");
    let place = reply.headers["location"].to_str().expect("a text").to_owned();
    assert_eq!(place, format!("{PLACE}/{}", reply.json["id"].as_str().expect("an id")));
    place
}

async fn ended(station: &Station, place: &str) -> Value {
    for _ in 0..3_000 {
        let job = station.get(place).await.json;
        if ["succeeded", "failed", "cancelled"].iter().any(|status| job["status"] == *status) {
            return job;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("it does not end: {:?}", station.get(place).await);
}

/// Waits until nothing is there any more: what came with a job is removed once its end has been told.
pub async fn gone(path: &Path) {
    for _ in 0..1_000 {
        if !path.exists() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    panic!("{} stays", path.display());
}

/// Files and folders of jobs.
fn left(data: &Path) -> Vec<std::path::PathBuf> {
    std::fs::read_dir(data.join("jobs")).expect("a folder").map(|entry| entry.expect("an entry").path()).collect()
}

async fn assert_nothing_left(station: &Station) {
    for _ in 0..500 {
        if left(&station.data()).is_empty() {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("left over: {:?}", left(&station.data()));
}

#[tokio::test]
async fn pictures_of_one_name_are_told_apart() {
    let station = Station::start().await;
    let pictures = ["left.png", "left.png", "right.png"].map(|name| (name.to_owned(), wall(64, 64)));
    let accepted = read(post(&station, form(&request(), pictures))).await;
    assert_eq!(accepted.status, StatusCode::ACCEPTED, "{accepted:?}");
    let names = [0, 1, 2].map(|number| &accepted.json["files"][number]["name"]);
    assert_eq!(names, ["left.png", "left-2.png", "right.png"]);
}

#[tokio::test]
async fn each_picture_that_shows_no_board_is_named_with_its_reason() {
    let station = Station::start().await;
    let mut pictures = walls(3);
    pictures.push(("notes.txt".into(), b"I am a text".to_vec()));
    pictures.push(("../../dot.pgm".into(), b"P5 1 1 255\n\0".to_vec()));
    pictures.push(("empty.jpg".into(), Vec::new()));
    let accepted = read(post(&station, form(&request(), pictures))).await;
    let place = place_of(&accepted);
    assert_eq!(accepted.json["kind"], "calibration");
    assert_eq!(accepted.json["request"]["model"], "plumb_bob", "what was not said stands there as it is taken");
    assert_eq!(accepted.json["files"][4], json!({"name": "dot.pgm", "bytes": 12}));
    let job = ended(&station, &place).await;
    assert_eq!((&job["status"], &job["shards"], &job["shards_done"]), (&json!("failed"), &json!(6), &json!(6)));
    assert_eq!(job["error"]["status"], 422);
    assert!(job["error"]["detail"].as_str().expect("words").contains("none of 6 pictures"), "{job}");
    let views = job["result"]["views"].as_array().expect("views");
    let names: Vec<&str> = views.iter().map(|view| view["name"].as_str().expect("a name")).collect();
    assert_eq!(names, ["left00.png", "left01.png", "left02.png", "notes.txt", "dot.pgm", "empty.jpg"]);
    for (view, words) in views.iter().zip(["chessboard", "chessboard", "chessboard", "not a picture", "1 x 1", "empty"])
    {
        assert!(view["reason"].as_str().expect("a reason").contains(words), "{view}");
    }
    assert!(job["created_us"].as_i64() <= job["started_us"].as_i64());
    assert!(job["started_us"].as_i64() <= job["finished_us"].as_i64());
    assert_eq!(station.get(&format!("{place}/report")).await.assert_problem(404).json["status"], 404);
    let list = station.get(PLACE).await.json;
    assert_eq!(list["calibrations"].as_array().map(Vec::len), Some(1));
    assert_eq!((&list["calibrations"][0]["id"], list["calibrations"][0].get("result")), (&job["id"], None));
    // Its pictures are gone with its end, it itself when it is told to go.
    let folder = station.data().join("jobs").join(job["id"].as_str().expect("an id"));
    gone(&folder.join("uploads")).await;
    assert_eq!(read(station.request(Method::DELETE, &place)).await.status, StatusCode::NO_CONTENT);
    assert!(!folder.exists());
    station.get(&place).await.assert_problem(404);
}

/// Pictures of a chessboard through a bent lens.
pub fn boards(count: usize) -> Vec<(String, Vec<u8>)> {
    let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
    let camera = study_camera(STUDY_LENSES[1]);
    let (rays, mut rng) = (Rays::of(&camera), named("a calibration over HTTP"));
    (0..count)
        .map(|number| {
            let pose = pose_in_view(&camera, &board, &mut rng);
            let frame = render_sheet(&rays, &pose, &Sheet::of(&board), &Optics::default(), &mut rng);
            (format!("left{number:02}.jpg"), encode::jpeg(&frame, 92).expect("encodes"))
        })
        .collect()
}

/// The board always turned alike, only moved a little.
fn alike(count: u32) -> Vec<(String, Vec<u8>)> {
    let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
    let camera = study_camera(STUDY_LENSES[1]);
    let (rays, mut rng) = (Rays::of(&camera), named("the same again"));
    let first = pose_in_view(&camera, &board, &mut rng);
    let picture = |number: u32| {
        let mut pose = first;
        pose.translation.x += 2e-3 * f64::from(number);
        let frame = render_sheet(&rays, &pose, &Sheet::of(&board), &Optics::default(), &mut rng);
        (format!("{number}.jpg"), encode::jpeg(&frame, 92).expect("encodes"))
    };
    (0..count).map(picture).collect()
}

#[tokio::test]
async fn a_picture_that_comes_twice_counts_once() {
    let station = Station::start().await;
    let mut pictures = boards(5);
    let (again, bytes) = ("again.jpg".to_owned(), pictures[1].1.clone());
    pictures.push((again, bytes));
    let mut asked = request();
    asked["fixed"] = json!(["k3"]);
    asked["force"] = json!(true);
    let job = ended(&station, &place_of(&read(post(&station, form(&asked, pictures))).await)).await;
    assert_eq!(job["status"], "succeeded", "{}", job["error"]);
    let view = &job["result"]["views"][5];
    assert_eq!((&view["name"], &view["counts"]), (&json!("again.jpg"), &json!(false)));
    assert!(view["reason"].as_str().expect("words").contains("earlier picture"), "{view}");
}

#[tokio::test]
async fn pictures_become_a_stored_camera_with_a_report() {
    let station = Station::start().await;
    let mut pictures = boards(7);
    pictures.insert(2, ("wall.png".into(), wall(640, 480)));
    let mut asked = request();
    asked["name"] = json!("front");
    asked["fixed"] = json!(["k3"]);
    let place = place_of(&read(post(&station, form(&asked, pictures))).await);
    let job = ended(&station, &place).await;
    assert_eq!(job["status"], "succeeded", "{}", job["error"]);
    let result = &job["result"];
    let truth = study_camera(STUDY_LENSES[1]);
    let sigma = result["standard_deviations"]["fx"].as_f64().expect("a deviation");
    let off = result["camera"]["fx"].as_f64().expect("fx") - truth.focal_lengths()[0];
    assert!(off.abs() < 4.0 * sigma && sigma < 5.0, "{off} +- {sigma}");
    assert!(result["reprojection_rms_px"].as_f64().expect("an error") < 0.3, "{result}");
    assert_eq!((&result["views"][2]["name"], &result["views"][2]["counts"]), (&json!("wall.png"), &json!(false)));
    assert!(result["views"][2]["reason"].as_str().expect("a reason").contains("chessboard"));
    let stored = station.get("/v1/cameras/front").await.json;
    assert_eq!(stored["fx"], result["camera"]["fx"]);
    assert_eq!(stored["parameter_covariance"].as_array().map(Vec::len), Some(9));
    let page = station.request(Method::GET, &format!("{place}/report")).send().await.expect("a reply");
    assert_eq!(page.headers()["content-type"], "text/html; charset=utf-8");
    let page = page.text().await.expect("a page");
    assert!(page.contains("<svg") && page.contains("wall.png"));
    // Nothing is loaded from elsewhere.
    assert!(!page.contains("src=\"http") && !page.contains("<script") && !page.contains("href=\"http"));
}

#[tokio::test]
async fn every_picture_that_is_left_out_is_named_and_the_others_are_used() {
    let station = Station::start().await;
    let spoiled = crate::spoiled::pictures();
    let pictures: Vec<(String, Vec<u8>)> =
        spoiled.iter().map(|(name, bytes, _)| ((*name).to_owned(), bytes.clone())).collect();
    let mut asked = request();
    asked["fixed"] = json!(["k3"]);
    let job = ended(&station, &place_of(&read(post(&station, form(&asked, pictures))).await)).await;
    assert_eq!(job["status"], "succeeded", "{}", job["error"]);
    let views = job["result"]["views"].as_array().expect("views");
    assert_eq!(views.len(), spoiled.len());
    for (view, (name, _, reason)) in views.iter().zip(&spoiled) {
        assert_eq!((&view["name"], &view["counts"]), (&json!(name), &json!(reason.is_empty())), "{view}");
        assert!(view["reason"].as_str().unwrap_or_default().contains(reason), "{view}");
    }
}

#[tokio::test]
async fn a_weak_set_is_refused_with_what_is_missing_unless_forced() {
    let station = Station::start().await;
    let alike = alike(4);
    let job = ended(&station, &place_of(&read(post(&station, form(&request(), alike.clone()))).await)).await;
    assert_eq!((&job["status"], &job["result"]["reason"]), (&json!("failed"), &json!("weak_geometry")), "{job}");
    assert!(job["result"]["missing"][0].as_str().expect("words").contains("tilt"), "{job}");
    let mut forced = request();
    forced["force"] = json!(true);
    forced["fixed"] = json!(["k1", "k2", "k3", "p1", "p2", "principal_point", "aspect_ratio"]);
    let job = ended(&station, &place_of(&read(post(&station, form(&forced, alike))).await)).await;
    assert_eq!(job["status"], "succeeded", "{}", job["error"]);
    assert_ne!(job["result"]["weaknesses"], json!([]));
}

#[tokio::test]
async fn none_of_that_id_is_404_everywhere() {
    let station = Station::start().await;
    for path in ["", "/events", "/report"] {
        let place = format!("{PLACE}/01JZZZZZZZZZZZZZZZZZZZZZZZ{path}");
        assert!(station.get(&place).await.assert_problem(404).detail().contains("no calibration"), "{place}");
    }
    read(station.request(Method::DELETE, &format!("{PLACE}/nothing"))).await.assert_problem(404);
    station.get(&format!("{PLACE}/..%2F..%2Fetc/report")).await.assert_problem(404);
    assert_eq!(station.get(PLACE).await.json, json!({"calibrations": []}));
}

#[tokio::test]
async fn what_makes_no_sense_is_refused_and_leaves_nothing() {
    let station = Station::start().await;
    let with = |change: &dyn Fn(&mut Value)| {
        let mut ask = request();
        change(&mut ask);
        form(&ask, walls(2))
    };
    let cases = [
        (with(&|r| r["pattern"] = json!("chess")), 422, "/pattern"),
        (with(&|r| r["pattern"] = json!("chessboard:2x6:0.025")), 422, "/pattern"),
        (with(&|r| r["model"] = json!("pinhole")), 422, "/model"),
        (with(&|r| r["fixed"] = json!(["k3", "k4"])), 422, "/fixed/1"),
        (with(&|r| r["name"] = json!("a/b")), 422, "/name"),
        (with(&|r| r["square"] = json!(1)), 422, "/square"),
        (form(&request(), []), 400, ""),
        (Form::new().part("image", Part::bytes(wall(64, 64)).file_name("a.png")), 400, ""),
        (form(&request(), walls(1)).text("request", "{}"), 400, ""),
        (form(&request(), walls(1)).text("board", "{}"), 400, ""),
        (Form::new().text("request", "{").part("image", Part::bytes(wall(64, 64))), 400, ""),
    ];
    for (number, (form, status, pointer)) in cases.into_iter().enumerate() {
        let reply = read(post(&station, form)).await;
        assert_eq!(reply.assert_problem(status).pointer(), pointer, "case {number}");
    }
    station.post(PLACE, &request()).await.assert_problem(415);
    station.post_bytes(PLACE, "multipart/form-data; boundary=x", b"--y\r\n".to_vec()).await.assert_problem(400);
    let no_key = post(&station, form(&request(), walls(1))).header("idempotency-key", "");
    read(no_key).await.assert_problem(400);
    assert_eq!(station.get(PLACE).await.json, json!({"calibrations": []}));
    assert_nothing_left(&station).await;
}

#[tokio::test]
async fn too_much_is_refused_with_the_limit_and_leaves_nothing() {
    let station = Station::with(|settings| {
        settings.jobs.max_picture_bytes = 100_000;
        settings.jobs.max_upload_bytes = 250_000;
        settings.jobs.max_pictures = 4;
    })
    .await;
    let pictures = |count: usize, bytes: usize| (0..count).map(move |n| (format!("{n}.bin"), vec![0; bytes]));
    for (pictures, words) in [
        (pictures(1, 100_001), "\"0.bin\" is larger than the 100000 bytes"),
        (pictures(1, 1_500_000), "\"0.bin\" is larger than the 100000 bytes"),
        (pictures(3, 90_000), "together are larger than the 250000 bytes"),
        (pictures(5, 10), "more pictures than the 4 that"),
    ] {
        let reply = read(post(&station, form(&request(), pictures))).await;
        assert!(reply.assert_problem(413).detail().contains(words), "{reply:?}");
    }
    assert_nothing_left(&station).await;
    place_of(&read(post(&station, form(&request(), pictures(4, 60_000)))).await);
}

#[tokio::test]
async fn a_client_that_goes_in_the_middle_of_its_upload_leaves_nothing() {
    let station = Station::with(|settings| settings.jobs.max_uploads = 1).await;
    let address = station.base.trim_start_matches("http://").to_owned();
    let head = format!(
        "POST {PLACE} HTTP/1.1\r\nhost: x\r\ncontent-type: multipart/form-data; boundary=b\r\ncontent-length: 9000000\r\n\r\n\
         --b\r\ncontent-disposition: form-data; name=\"image\"; filename=\"a.jpg\"\r\n\r\n"
    );
    let mut client = TcpStream::connect(&address).await.expect("connects");
    client.write_all(head.as_bytes()).await.expect("writes");
    client.write_all(&vec![7; 300_000]).await.expect("writes");
    let mut written = 0;
    for _ in 0..500 {
        let folders = left(&station.data());
        written = folders
            .first()
            .map_or(0, |folder| std::fs::metadata(folder.join("uploads/000000")).map_or(0, |file| file.len()));
        if written > 0 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    assert!(written > 0, "it is written as it comes");
    // The only place for uploads is taken.
    let refused = read(post(&station, form(&request(), walls(1)))).await;
    assert!(refused.assert_problem(503).headers.contains_key("retry-after"));
    drop(client);
    assert_nothing_left(&station).await;
    place_of(&read(post(&station, form(&request(), walls(1)))).await);
}

#[tokio::test]
async fn an_upload_that_stands_still_is_cut_off() {
    let station = Station::with(|settings| settings.http.deadline_ms = 200).await;
    let address = station.base.trim_start_matches("http://").to_owned();
    let head = format!(
        "POST {PLACE} HTTP/1.1\r\nhost: x\r\ncontent-type: multipart/form-data; boundary=b\r\ncontent-length: 9000\r\n\r\n\
         --b\r\ncontent-disposition: form-data; name=\"image\"; filename=\"a.jpg\"\r\n\r\n"
    );
    let mut client = TcpStream::connect(&address).await.expect("connects");
    client.write_all(head.as_bytes()).await.expect("writes");
    let mut reply = vec![0; 4096];
    let count = client.read(&mut reply).await.expect("an answer");
    let reply = String::from_utf8_lossy(&reply[..count]).into_owned();
    assert!(reply.starts_with("HTTP/1.1 400"), "{reply}");
    assert_nothing_left(&station).await;
}

#[tokio::test]
async fn a_key_names_one_job_also_when_two_come_at_once() {
    let station = Station::start().await;
    let keyed = |pictures| post(&station, form(&request(), pictures)).header("idempotency-key", "one");
    let (first, second) = tokio::join!(read(keyed(walls(4))), read(keyed(walls(4))));
    assert_eq!(place_of(&first), place_of(&second));
    ended(&station, &place_of(&first)).await;
    let late = read(keyed(walls(4))).await;
    assert_eq!((place_of(&late), &late.json["status"]), (place_of(&first), &json!("failed")));
    let reply = read(keyed(walls(3))).await;
    assert!(reply.assert_problem(409).detail().contains("another request"), "{reply:?}");
    let mut other = request();
    other["force"] = json!(true);
    read(post(&station, form(&other, walls(4))).header("idempotency-key", "one")).await.assert_problem(409);
    let unnamed = read(post(&station, form(&request(), walls(4)))).await;
    assert_ne!(place_of(&unnamed), place_of(&first));
    assert_eq!(station.get(PLACE).await.json["calibrations"].as_array().map(Vec::len), Some(2));
    assert!(left(&station.data()).len() <= 2, "{:?}", left(&station.data()));
}

/// The events of a stream: id, name, data.
async fn events(station: &Station, place: &str, last: Option<&str>) -> Vec<(String, String, Value)> {
    let request = station.request(Method::GET, &format!("{place}/events"));
    let response = match last {
        Some(last) => request.header("last-event-id", last),
        None => request,
    };
    let response = response.send().await.expect("an answer");
    assert_eq!(
        (response.status().as_u16(), &response.headers()["content-type"]),
        (200, &"text/event-stream".parse().expect("a value"))
    );
    let text = response.text().await.expect("it ends");
    let field = |event: &str, name: &str| {
        let line = event.lines().find_map(|line| line.strip_prefix(&format!("{name}: ")));
        line.map(str::to_owned).unwrap_or_default()
    };
    text.split("\n\n")
        .filter(|event| event.contains("data: "))
        .map(|event| {
            let data = serde_json::from_str(&field(event, "data")).expect("JSON");
            (field(event, "id"), field(event, "event"), data)
        })
        .collect()
}

#[tokio::test]
async fn events_tell_of_each_picture_and_are_resumed() {
    let station = Station::with(|settings| settings.jobs.threads = 1).await;
    let place = place_of(&read(post(&station, form(&request(), walls(5)))).await);
    let told = events(&station, &place, None).await;
    let ids: Vec<i64> = told.iter().map(|(id, ..)| id.parse().expect("a number")).collect();
    assert_eq!(ids, (1..=8).collect::<Vec<i64>>(), "queued, running, five pictures, the end: {told:?}");
    assert_eq!((told[0].2["status"].as_str(), told[1].2["status"].as_str()), (Some("queued"), Some("running")));
    for (number, (_, name, data)) in told[2..7].iter().enumerate() {
        assert_eq!((name.as_str(), &data["shards"], &data["shards_done"]), ("progress", &json!(5), &json!(number + 1)));
        let message = data["message"].as_str().expect("words");
        assert!(message.starts_with(&format!("left{number:02}.png: no chessboard")), "{message}");
    }
    let (_, name, data) = &told[7];
    assert_eq!(name, "finished");
    assert_eq!(data, &station.get(&place).await.json);
    assert_eq!(events(&station, &place, Some("6")).await, told[6..]);
    assert_eq!(events(&station, &place, Some("nonsense")).await, told);
    let seen = station.request(Method::GET, &format!("{place}/events")).header("last-event-id", "8");
    assert_eq!(read(seen).await.status, StatusCode::NO_CONTENT);
}

#[tokio::test]
async fn a_running_calibration_is_cancelled_and_those_who_watch_are_told() {
    let station = Station::with(|settings| settings.jobs.threads = 1).await;
    let pictures = (0..200).map(|number| (format!("{number}.png"), large()));
    let place = place_of(&read(post(&station, form(&request(), pictures))).await);
    let cancel = async {
        loop {
            let job = station.get(&place).await.json;
            if job["shards_done"].as_u64() > Some(0) {
                return read(station.request(Method::DELETE, &place)).await;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    let (told, cancelled) = tokio::join!(events(&station, &place, None), cancel);
    assert_eq!((cancelled.status, &cancelled.json["status"]), (StatusCode::ACCEPTED, &json!("cancelled")));
    let (_, name, data) = told.last().expect("events");
    assert_eq!((name.as_str(), &data["status"]), ("finished", &json!("cancelled")));
    let folder = station.data().join("jobs").join(data["id"].as_str().expect("an id"));
    gone(&folder.join("uploads")).await;
    assert!(data["progress"].as_f64() < Some(1.0) && data["finished_us"].is_i64());
    assert_eq!(read(station.request(Method::DELETE, &place)).await.status, StatusCode::NO_CONTENT);
    read(station.request(Method::DELETE, &place)).await.assert_problem(404);
    // The thread is free for the next.
    ended(&station, &place_of(&read(post(&station, form(&request(), walls(1)))).await)).await;
}

#[tokio::test]
async fn more_jobs_than_may_wait_are_refused() {
    let station = Station::with(|settings| {
        settings.jobs.threads = 1;
        settings.jobs.queue = 1;
    })
    .await;
    let pictures = (0..200).map(|number| (format!("{number}.png"), large()));
    let place = place_of(&read(post(&station, form(&request(), pictures))).await);
    let refused = read(post(&station, form(&request(), walls(1)))).await;
    assert!(refused.assert_problem(503).headers.contains_key("retry-after"));
    // Frames are answered all the while.
    let frame = station.post_bytes("/v1/detections", "image/png", wall(64, 64)).await;
    assert_eq!(frame.status, StatusCode::OK);
    read(station.request(Method::DELETE, &place)).await;
    place_of(&read(post(&station, form(&request(), walls(1)))).await);
    let metrics = station.http.get(format!("{}/metrics", station.base)).send().await.expect("an answer");
    let metrics = metrics.text().await.expect("a text");
    assert!(metrics.contains("skypose_jobs{kind=\"calibration\",status=\"cancelled\"}"), "{metrics}");
}

#[tokio::test]
async fn a_service_that_stops_lets_those_go_who_watch_and_keeps_the_job() {
    let station = Station::with(|settings| {
        settings.jobs.threads = 1;
        settings.http.drain_ms = 5_000;
    })
    .await;
    let pictures = (0..200).map(|number| (format!("{number}.png"), large()));
    let place = place_of(&read(post(&station, form(&request(), pictures))).await);
    let stop = async {
        tokio::time::sleep(Duration::from_millis(300)).await;
        station.stopper.stop();
    };
    let (told, ()) = tokio::join!(events(&station, &place, None), stop);
    assert!(told.iter().all(|(_, name, _)| name == "progress"), "{told:?}");
    let data = station.data();
    tokio::time::timeout(Duration::from_secs(20), station.serving)
        .await
        .expect("it ends")
        .expect("no panic")
        .expect("no fault");
    let store = skypose::shell::store::Store::open(&data).await.expect("opens");
    let job = store.jobs().get(place.rsplit('/').next().expect("an id")).await.expect("reads").expect("is there");
    assert!(!job.status.is_final() && data.join("jobs").join(&job.id).join("uploads").exists(), "{job:?}");
}
