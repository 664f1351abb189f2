//! Cameras that send frame after frame, and the ground stations that watch them.

use std::time::Duration;

use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use skypose::shell::config::Settings;

use crate::station::{Station, assert_true_pose, corpus, frame, jpeg, read, without_timing};

/// Longer than anything here takes.
const SOON: Duration = Duration::from_secs(20);
const FRAMES: &str = "/v1/cameras/front/frames";
const ESTIMATES: &str = "/v1/cameras/front/estimates";

/// A station with the stream `front`, for which no frame is too old.
async fn streaming(change: impl FnOnce(&mut Settings)) -> Station {
    let station = Station::equipped_with(|settings| {
        settings.streams.max_age_ms = 20_000;
        change(settings);
    })
    .await;
    let stream = json!({"camera": "demo", "targets": ["wing-six"]});
    assert_eq!(station.put("/v1/streams/front", &stream).await.status, StatusCode::CREATED);
    station
}

/// Posts a frame; its reply as it came.
async fn post(station: &Station, query: &str) -> (StatusCode, Vec<u8>) {
    let request = station.request(Method::POST, &format!("{FRAMES}?{query}")).header("content-type", "image/jpeg");
    let response = request.body(jpeg()).send().await.expect("an answer");
    (response.status(), response.bytes().await.expect("a whole answer").into())
}

async fn post_well(station: &Station, query: &str) -> Vec<u8> {
    let (status, reply) = post(station, query).await;
    assert_eq!(status, StatusCode::OK, "{}", String::from_utf8_lossy(&reply));
    reply
}

/// An event as it came.
#[derive(Debug)]
struct Told {
    id: Option<u64>,
    kind: String,
    data: String,
}

impl Told {
    fn json(&self) -> Value {
        serde_json::from_str(&self.data).expect("JSON")
    }
}

/// A ground station.
struct Ground {
    response: Response,
    text: String,
}

impl Ground {
    async fn listen(station: &Station, last: Option<&str>) -> Self {
        let mut request = station.request(Method::GET, ESTIMATES);
        if let Some(last) = last {
            request = request.header("last-event-id", last);
        }
        let response = request.send().await.expect("an answer");
        assert_eq!(response.status(), StatusCode::OK);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        Self { response, text: String::new() }
    }

    /// The next event; nothing once the stream has ended.
    async fn next(&mut self) -> Option<Told> {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let field = |name: &str| event.lines().find_map(|line| line.strip_prefix(&format!("{name}: ")));
                let told = field("data").map(|data| Told {
                    id: field("id").map(|id| id.parse().expect("a number")),
                    kind: field("event").unwrap_or_default().into(),
                    data: data.into(),
                });
                self.text = String::from(rest);
                if told.is_some() {
                    return told;
                }
                continue;
            }
            let chunk = tokio::time::timeout(SOON, self.response.chunk()).await.expect("in time");
            self.text += std::str::from_utf8(&chunk.expect("a whole stream")?).expect("text");
        }
    }

    /// The next that has a number.
    async fn numbered(&mut self) -> Told {
        loop {
            let told = self.next().await.expect("another one");
            if told.id.is_some() {
                return told;
            }
            assert_eq!(told.kind, "status");
        }
    }

    /// The first status that is so.
    async fn until(&mut self, is_so: impl Fn(&Value) -> bool) -> Value {
        loop {
            let told = self.next().await.expect("another one");
            if told.kind == "status" && is_so(&told.json()) {
                return told.json();
            }
        }
    }
}

#[tokio::test]
async fn a_frame_of_a_stream_is_answered_as_any_frame_byte_for_byte_but_for_the_times() {
    let station = streaming(|_| {}).await;
    for case in corpus() {
        let detector = json!({"method": case.method});
        for (path, body) in [
            ("/v1/cameras/recorded", &case.camera),
            ("/v1/targets/recorded", &case.target),
            ("/v1/streams/front", &json!({"camera": "recorded", "targets": ["recorded"], "detector": detector})),
        ] {
            assert!(station.put(path, body).await.status.is_success());
        }
        let post = async |path: &str| {
            let request = station.request(Method::POST, path).header("content-type", "image/jpeg");
            let response = request.body(case.frame.clone()).send().await.expect("an answer");
            assert_eq!(response.headers()["content-type"], "application/json");
            response.bytes().await.expect("a whole answer")
        };
        let single = post(&format!("/v1/estimates?camera=recorded&target=recorded&method={}", case.method)).await;
        let streamed = post(FRAMES).await;
        assert_eq!(
            String::from_utf8_lossy(without_timing(&streamed)),
            String::from_utf8_lossy(without_timing(&single))
        );
    }
}

#[tokio::test]
async fn raw_frames_and_forms_say_what_they_are() {
    let station = streaming(|_| {}).await;
    let frame = frame();
    let path = format!("{FRAMES}?width={}&height={}&format=rgb8&sequence=1", frame.width(), frame.height());
    let reply = station.post_bytes(&path, "application/octet-stream", frame.rgb().into_owned()).await;
    assert_true_pose(&reply.json["targets"][0]["pose"]);
    let taken = now_us();
    let note = json!({"sequence": 2, "timestamp_us": taken}).to_string();
    let form = reqwest::multipart::Form::new()
        .part("frame", reqwest::multipart::Part::bytes(jpeg()))
        .part("request", reqwest::multipart::Part::text(note));
    let reply = read(station.request(Method::POST, FRAMES).multipart(form)).await;
    assert_true_pose(&reply.json["targets"][0]["pose"]);
    assert_eq!(reply.json["frame"]["timestamp_us"], taken);
    let status = Ground::listen(&station, None).await.until(|_| true).await;
    assert_eq!((&status["published"], &status["last_sequence"]), (&json!(2), &json!(2)), "{status}");
}

fn now_us() -> i64 {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).expect("after 1970");
    i64::try_from(since.as_micros()).expect("this century")
}

#[tokio::test]
async fn ground_stations_are_told_and_go_on_where_they_were() {
    let station = streaming(|_| {}).await;
    let mut ground = Ground::listen(&station, None).await;
    let first = ground.next().await.expect("a status");
    assert_eq!((first.kind.as_str(), first.id), ("status", None));
    assert_eq!((&first.json()["camera"], &first.json()["has_stream"]), (&json!("front"), &json!(true)));
    let mut seen = Vec::new();
    for sequence in 0..4 {
        let taken = now_us();
        let reply = post_well(&station, &format!("sequence={sequence}&timestamp_us={taken}")).await;
        let (estimate, track) = (ground.numbered().await, ground.numbered().await);
        assert_eq!((estimate.kind.as_str(), track.kind.as_str()), ("estimate", "track"));
        assert_eq!(estimate.data.as_bytes(), reply, "the same bytes, times and all");
        assert_eq!(track.json()["timestamp_us"], taken);
        seen.extend([estimate.id.expect("a number"), track.id.expect("a number")]);
    }
    assert!(seen.windows(2).all(|pair| pair[1] == pair[0] + 1), "{seen:?}");
    drop(ground);
    // While nobody listens.
    let missed = post_well(&station, &format!("sequence=4&timestamp_us={}", now_us())).await;
    // The tracks of the last estimate that was seen come first, if they were not.
    let mut again = Ground::listen(&station, Some(&seen[6].to_string())).await;
    let told = [again.numbered().await, again.numbered().await, again.numbered().await];
    assert_eq!(told.each_ref().map(|told| told.kind.as_str()), ["track", "estimate", "track"]);
    assert_eq!(told.each_ref().map(|told| told.id), [seen[7], seen[7] + 1, seen[7] + 2].map(Some));
    assert_eq!(told[1].data.as_bytes(), missed);
    let track = &told[2].json()["tracks"][0];
    assert_eq!((&track["life"], &track["seen_count"]), (&json!("confirmed"), &json!(5)), "{track}");
}

#[tokio::test]
async fn what_is_not_kept_any_more_is_told() {
    // Room for nothing: only the last is kept.
    let station = streaming(|settings| settings.streams.kept_bytes = 0).await;
    let mut ground = Ground::listen(&station, None).await;
    post_well(&station, "").await;
    let first = ground.numbered().await.id.expect("a number");
    drop(ground);
    for _ in 0..3 {
        post_well(&station, "").await;
    }
    // Each of the four has an estimate and tracks.
    for (last, missed) in [(first.to_string(), json!(5)), ("0".into(), Value::Null), ("nonsense".into(), Value::Null)] {
        let mut again = Ground::listen(&station, Some(&last)).await;
        let gap = again.numbered().await;
        assert_eq!((gap.kind.as_str(), gap.id), ("gap", Some(first + 5)), "after {last}");
        assert_eq!(gap.json(), json!({"missed_count": missed, "next_id": first + 6}), "after {last}");
        assert_eq!(again.numbered().await.id, Some(first + 6));
        // And who comes again after the gap is told of none.
        let mut after = Ground::listen(&station, Some(&(first + 5).to_string())).await;
        assert_eq!(after.numbered().await.kind, "estimate");
    }
    // A number that is yet to come is of another service.
    let mut foreign = Ground::listen(&station, Some(&u64::MAX.to_string())).await;
    assert_eq!(foreign.numbered().await.json()["missed_count"], Value::Null);
    assert_eq!(foreign.numbered().await.id, Some(first + 6));
}

#[tokio::test]
async fn every_frame_of_a_flood_gets_its_answer_and_is_counted() {
    let station = streaming(|settings| settings.workers.threads = 1).await;
    let count = 30;
    let queries: Vec<String> = (0..count).map(|sequence| format!("sequence={sequence}")).collect();
    let posts = queries.iter().map(|query| post(&station, query));
    let replies = futures_util::future::join_all(posts).await;
    let (mut answered, mut replaced) = (0, 0);
    for (status, reply) in replies {
        let reply: Value = serde_json::from_slice(&reply).expect("JSON");
        if status == StatusCode::OK {
            assert_true_pose(&reply["targets"][0]["pose"]);
            answered += 1;
        } else {
            assert_eq!((status.as_u16(), &reply["type"]), (409, &json!("urn:skypose:problem:replaced")), "{reply}");
            replaced += 1;
        }
    }
    assert!(answered > 0 && replaced > 0, "a flood is faster than one worker: {answered}, {replaced}");
    let status = Ground::listen(&station, None).await.until(|_| true).await;
    assert_eq!((&status["received"], &status["published"]), (&json!(count), &json!(answered)), "{status}");
    assert_eq!(status["replaced"], replaced, "{status}");
}

#[tokio::test]
async fn what_is_too_old_is_told_so() {
    let station = streaming(|settings| settings.streams.max_age_ms = 1000).await;
    let old = format!("{FRAMES}?timestamp_us={}", now_us() - 5_000_000);
    let reply = station.post_bytes(&old, "image/jpeg", jpeg()).await;
    assert_eq!(reply.assert_problem(409).json["type"], "urn:skypose:problem:too-old");
    assert_eq!(reply.pointer(), "/timestamp_us");
    // One that becomes too old while it is looked at.
    let station = streaming(|settings| settings.streams.max_age_ms = 1).await;
    let reply = station.post_bytes(FRAMES, "image/jpeg", jpeg()).await;
    assert_eq!(reply.assert_problem(503).json["type"], "urn:skypose:problem:deadline-exceeded");
    let status = Ground::listen(&station, None).await.until(|_| true).await;
    assert_eq!((&status["received"], &status["late"], &status["published"]), (&json!(1), &json!(1), &json!(0)));
}

#[tokio::test]
async fn what_is_no_frame_is_refused_and_counted_and_harms_nothing() {
    let station = streaming(|settings| settings.http.max_frame_bytes = 4 << 20).await;
    let mut ground = Ground::listen(&station, None).await;
    for (refused, (query, content_type, body, status)) in (1..).zip([
        ("", "image/jpeg", Vec::new(), 400),
        ("", "image/jpeg", b"no frame at all".to_vec(), 415),
        ("", "text/plain", jpeg(), 415),
        ("", "image/jpeg", vec![0; 5 << 20], 413),
        ("?sequence=-1", "image/jpeg", jpeg(), 422),
        ("?camera=demo", "image/jpeg", jpeg(), 422),
        ("?width=640", "application/octet-stream", jpeg(), 422),
    ]) {
        let reply = station.post_bytes(&format!("{FRAMES}{query}"), content_type, body).await;
        reply.assert_problem(status);
        let told = ground.until(|told| told["refused"] == refused).await;
        assert_eq!(told["problem"], reply.json, "{query}");
    }
    post_well(&station, "").await;
    ground.until(|told| told["published"] == 1 && told.get("problem").is_none()).await;
}

#[tokio::test]
async fn a_camera_for_which_nothing_is_stored_is_not_found() {
    let station = streaming(|_| {}).await;
    let post = station.post_bytes("/v1/cameras/demo/frames", "image/jpeg", jpeg()).await;
    assert!(post.assert_problem(404).detail().contains("stream"), "{post:?}");
    station.get("/v1/cameras/demo/estimates").await.assert_problem(404);
    station.get("/v1/cameras/-/estimates").await.assert_problem(422);
    // It is stored later, and taken away again.
    let stream = json!({"camera": "demo", "targets": ["wing-six"]});
    station.put("/v1/streams/demo", &stream).await;
    assert_eq!(station.post_bytes("/v1/cameras/demo/frames", "image/jpeg", jpeg()).await.status, 200);
    read(station.request(Method::DELETE, "/v1/streams/demo")).await;
    station.post_bytes("/v1/cameras/demo/frames", "image/jpeg", jpeg()).await.assert_problem(404);
}

#[tokio::test]
async fn so_many_are_told_and_no_more_until_one_goes() {
    let station = streaming(|settings| {
        settings.streams.max_readers = 1;
        settings.streams.status_ms = 100;
    })
    .await;
    let ground = Ground::listen(&station, None).await;
    let refused = station.get(ESTIMATES).await;
    refused.assert_problem(503);
    assert!(refused.headers.contains_key("retry-after"));
    drop(ground);
    // That it has gone is noticed with the next status.
    for _ in 0..200 {
        let response = station.request(Method::GET, ESTIMATES).send().await.expect("an answer");
        if response.status() == StatusCode::OK {
            return;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    panic!("the place of one that has gone is not free");
}

#[tokio::test]
async fn told_to_stop_it_lets_ground_stations_go() {
    let station = streaming(|_| {}).await;
    let mut ground = Ground::listen(&station, None).await;
    let reply = post_well(&station, "").await;
    station.stopper.stop();
    let mut told = Vec::new();
    while let Some(next) = ground.next().await {
        told.extend(next.id.map(|_| next.data.into_bytes()));
    }
    assert_eq!((told.len(), &told[0]), (2, &reply), "what was answered is told before the end");
    tokio::time::timeout(SOON, station.serving).await.expect("it ends").expect("no panic").expect("no fault");
}
