//! Frames of a sequence, posted one by one.

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::station::{Reply, Station};

/// A dark dot in a gray sky, as PGM.
fn dot(x: i32) -> Vec<u8> {
    let sample = |u: i32, v: i32| if (u - x).abs() <= 2 && (v - 60).abs() <= 1 { 60 } else { 180 };
    let samples = (0..128).flat_map(|v| (0..160).map(move |u| sample(u, v)));
    [b"P5\n160 128\n255\n".to_vec(), samples.collect()].concat()
}

async fn post(station: &Station, query: &str, x: i32) -> Reply {
    let path = format!("/v1/detections?method=edge&{query}");
    station.post_bytes(&path, "image/x-portable-pixmap", dot(x)).await
}

fn track(reply: &Reply) -> &Value {
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    &reply.json["centroids"][0]["track_id"]
}

#[tokio::test]
async fn a_thing_keeps_its_number_until_a_gap() {
    let station = Station::start().await;
    let first = post(&station, "sequence=front&frame_index=0", 40).await;
    assert_eq!(first.json["sequence"], json!({"name": "front", "beginning": "first"}));
    assert!(track(&first).is_u64(), "{first:?}");
    for index in 1..5 {
        let next = post(&station, &format!("sequence=front&frame_index={index}"), 40 + 3 * index).await;
        assert_eq!(next.json["sequence"]["beginning"], Value::Null);
        assert_eq!(track(&next), track(&first));
        let score = |reply: &Reply| reply.json["centroids"][0]["score"].as_f64().expect("a score");
        assert!((0.0..=1.0).contains(&score(&next)), "{next:?}");
    }
    let other = post(&station, "sequence=rear&frame_index=5", 55).await;
    assert_eq!(other.json["sequence"]["beginning"], "first");
    let late = post(&station, "sequence=front&frame_index=40", 58).await;
    assert_eq!(late.json["sequence"]["beginning"], "gap");
    assert_ne!(track(&late), track(&first));
}

#[tokio::test]
async fn a_single_frame_has_no_numbers() {
    let station = Station::start().await;
    let reply = post(&station, "min_score=0", 40).await;
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    assert!(reply.json.get("sequence").is_none() && reply.json["centroids"][0].get("track_id").is_none(), "{reply:?}");
}

#[tokio::test]
async fn one_too_many_is_refused_as_long_as_the_others_are_in_use() {
    let station = Station::with(|settings| settings.sequences.most = 1).await;
    let first = post(&station, "sequence=a&frame_index=0", 40).await;
    let refused = post(&station, "sequence=b&frame_index=0", 40).await;
    assert_eq!(refused.assert_problem(503).pointer(), "/sequence");
    assert!(refused.detail().contains("sequences.most"), "{refused:?}");
    assert!(refused.headers.contains_key("retry-after"), "{refused:?}");
    let next = post(&station, "sequence=a&frame_index=1", 43).await;
    assert_eq!((&next.json["sequence"]["beginning"], track(&next)), (&Value::Null, track(&first)));
}

#[tokio::test]
async fn of_those_that_are_not_in_use_the_one_not_used_for_longest_makes_room() {
    let station = Station::with(|settings| (settings.sequences.most, settings.sequences.in_use_ms) = (1, 0)).await;
    post(&station, "sequence=a", 40).await;
    post(&station, "sequence=b", 40).await;
    assert_eq!(post(&station, "sequence=a", 43).await.json["sequence"]["beginning"], "first");
}

#[tokio::test]
async fn what_makes_no_sense_is_told_where() {
    let station = Station::start().await;
    for (query, pointer) in [
        ("sequence=", "/sequence"),
        ("sequence=a&preset=thesis", "/sequence"),
        ("threshold=0.1", "/detector/threshold"),
        ("min_score=2", "/detector/min_score"),
        ("preset=thesis&min_score=0.5", "/detector/min_score"),
    ] {
        let reply = post(&station, query, 40).await;
        assert_eq!(reply.assert_problem(422).pointer(), pointer, "{query}");
    }
    let long = format!("sequence={}", "a".repeat(129));
    assert_eq!(post(&station, &long, 40).await.assert_problem(422).pointer(), "/sequence");
}
