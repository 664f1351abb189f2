//! Overload, deadlines, and the end.

use std::time::{Duration, Instant};

use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::station::{Station, client, jpeg};

const QUERY: &str = "/v1/estimates?camera=demo&target=wing-six";

async fn equip(station: &Station) {
    use skypose::scene::models::{demo_camera, wing};
    use skypose::shell::wire::{CameraWire, TargetWire};
    let camera = serde_json::to_value(CameraWire::from(&demo_camera())).expect("JSON");
    let target = serde_json::to_value(TargetWire::from(&wing().target)).expect("JSON");
    station.put("/v1/cameras/demo", &camera).await;
    station.put("/v1/targets/wing-six", &target).await;
}

#[tokio::test]
async fn more_than_it_can_do_is_shed_and_what_was_accepted_is_answered() {
    let station = Station::with(|settings| {
        settings.workers.threads = 1;
        settings.workers.queue = 2;
    })
    .await;
    equip(&station).await;
    let posts: Vec<_> = (0..40).map(|_| station.post_bytes(QUERY, "image/jpeg", jpeg())).collect();
    let replies = futures_util::future::join_all(posts).await;
    let (mut answered, mut shed) = (0, 0);
    for reply in replies {
        if reply.status.as_u16() == 200 {
            assert_ne!(reply.json["targets"][0]["pose"], Value::Null);
            answered += 1;
        } else {
            reply.assert_problem(503);
            assert!(reply.headers.contains_key("retry-after"));
            shed += 1;
        }
    }
    // The queue holds two; a third only if the worker has begun before all have come.
    assert!(answered >= 2 && shed >= 1, "{answered} answered, {shed} shed");
    assert_eq!(station.post_bytes(QUERY, "image/jpeg", jpeg()).await.status, 200, "and then it is well again");
}

#[tokio::test]
async fn a_body_that_dribbles_in_meets_the_deadline() {
    let station = Station::with(|settings| settings.http.deadline_ms = 300).await;
    let address = station.base.trim_start_matches("http://").to_owned();
    let mut slow = TcpStream::connect(&address).await.expect("connects");
    let head = "POST /v1/poses HTTP/1.1\r\nhost: x\r\ncontent-type: application/json\r\ncontent-length: 1000\r\n\r\n{";
    slow.write_all(head.as_bytes()).await.expect("writes");
    let start = Instant::now();
    let mut reply = vec![0; 4096];
    let count = slow.read(&mut reply).await.expect("an answer");
    let reply = String::from_utf8_lossy(&reply[..count]).into_owned();
    assert!(reply.starts_with("HTTP/1.1 503") && reply.contains("deadline-exceeded"), "{reply}");
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[tokio::test]
async fn a_head_that_never_ends_is_cut_off() {
    let station = Station::with(|settings| settings.http.header_timeout_ms = 200).await;
    let address = station.base.trim_start_matches("http://").to_owned();
    let mut slow = TcpStream::connect(&address).await.expect("connects");
    slow.write_all(b"GET /healthz HTTP/1.1\r\nhost: x\r\n").await.expect("writes");
    let mut rest = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(5), slow.read_to_end(&mut rest)).await;
    assert!(read.is_ok(), "the connection is still open");
}

#[tokio::test]
async fn told_to_stop_it_answers_what_is_under_way_and_ends() {
    let station = Station::with(|settings| settings.workers.threads = 1).await;
    equip(&station).await;
    let posts: Vec<_> = (0..6).map(|_| station.post_bytes(QUERY, "image/jpeg", jpeg())).collect();
    let stop = async {
        tokio::time::sleep(Duration::from_millis(60)).await;
        station.stopper.stop();
    };
    let (replies, ()) = tokio::join!(futures_util::future::join_all(posts), stop);
    for reply in replies {
        assert_eq!(reply.status, 200, "{reply:?}");
    }
    let base = station.base.clone();
    let ended = tokio::time::timeout(Duration::from_secs(10), station.serving).await;
    ended.expect("it ends").expect("no panic").expect("no fault");
    assert!(client().get(format!("{base}/healthz")).send().await.is_err(), "the door is shut");
}

#[tokio::test]
async fn clients_that_go_away_leave_no_trace() {
    let station = Station::equipped().await;
    for _ in 0..20 {
        let post = station.post_bytes(QUERY, "image/jpeg", jpeg());
        let _ = tokio::time::timeout(Duration::from_millis(1), post).await;
    }
    assert_eq!(station.post_bytes(QUERY, "image/jpeg", jpeg()).await.status, 200);
    // The gauge is that of all stations in this process, so it may take a while until none is under way.
    let under_way = async || {
        let metrics = station.http.get(format!("{}/metrics", station.base)).send().await.expect("an answer");
        let text = metrics.text().await.expect("a text");
        text.lines().find_map(|line| line.strip_prefix("skypose_in_flight ")?.parse::<f64>().ok())
    };
    for _ in 0..500 {
        if under_way().await == Some(0.0) {
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("requests of clients that have gone are counted as under way: {:?}", under_way().await);
}
