//! Stored cameras and targets.

use reqwest::Method;
use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::station::{Station, read};

fn camera(fx: f64) -> Value {
    json!({
        "width": 640, "height": 480, "fx": fx, "fy": 600.0, "cx": 320.0, "cy": 240.0,
        "distortion": {"model": "plumb_bob", "coefficients": [0.1, -0.2, 0.0, 0.0, 0.05]}
    })
}

#[tokio::test]
async fn a_camera_is_stored_replaced_listed_and_removed() {
    let station = Station::start().await;
    let created = station.put("/v1/cameras/front", &camera(600.0)).await;
    assert_eq!((created.status, &created.json), (StatusCode::CREATED, &camera(600.0)));
    let replaced = station.put("/v1/cameras/front", &camera(601.0)).await;
    assert_eq!(replaced.status, StatusCode::OK);
    assert_ne!(created.headers["etag"], replaced.headers["etag"]);
    let read_back = station.get("/v1/cameras/front").await;
    assert_eq!((&read_back.json, &read_back.headers["etag"]), (&camera(601.0), &replaced.headers["etag"]));
    station.put("/v1/cameras/aft", &camera(500.0)).await;
    let list = station.get("/v1/cameras").await.json;
    assert_eq!((&list["cameras"][0]["name"], &list["cameras"][1]["name"]), (&json!("aft"), &json!("front")));
    assert_eq!(list["cameras"][1]["fx"], 601.0);
    let removed = read(station.request(Method::DELETE, "/v1/cameras/front")).await;
    assert_eq!(removed.status, StatusCode::NO_CONTENT);
    station.get("/v1/cameras/front").await.assert_problem(404);
    read(station.request(Method::DELETE, "/v1/cameras/front")).await.assert_problem(404);
}

#[tokio::test]
async fn of_two_who_replace_the_same_the_second_is_told() {
    let station = Station::start().await;
    let tag = station.put("/v1/cameras/front", &camera(600.0)).await.headers["etag"].clone();
    let replace =
        |fx| read(station.request(Method::PUT, "/v1/cameras/front").header("if-match", tag.clone()).json(&camera(fx)));
    assert_eq!(replace(601.0).await.status, StatusCode::OK);
    replace(602.0).await.assert_problem(412);
    let only_new = station.request(Method::PUT, "/v1/cameras/front").header("if-none-match", "*").json(&camera(603.0));
    read(only_new).await.assert_problem(412);
    let stale = station.request(Method::DELETE, "/v1/cameras/front").header("if-match", tag);
    read(stale).await.assert_problem(412);
    assert_eq!(station.get("/v1/cameras/front").await.json["fx"], 601.0);
}

#[tokio::test]
async fn who_has_it_need_not_load_it_again() {
    let station = Station::start().await;
    let tag = station.put("/v1/cameras/front", &camera(600.0)).await.headers["etag"].clone();
    let again = read(station.request(Method::GET, "/v1/cameras/front").header("if-none-match", tag)).await;
    assert_eq!(again.status, StatusCode::NOT_MODIFIED);
}

#[tokio::test]
async fn a_target_takes_the_name_under_which_it_is_stored() {
    let station = Station::start().await;
    let target = json!({"markers": [
        {"id": "a", "position_m": [0, 0, 0]}, {"id": "b", "position_m": [1, 0, 0]},
        {"id": "c", "position_m": [1, 1, 0], "radius_m": 0.03, "normal": [0, 0, -2]}, {"id": "d", "position_m": [0, 1, 0]},
    ]});
    let stored = station.put("/v1/targets/wing", &target).await;
    assert_eq!(stored.json["name"], "wing");
    assert_eq!(stored.json["markers"][2]["normal"], json!([0.0, 0.0, -1.0]), "normals are brought to unit length");
    let mut other = target;
    other["name"] = json!("tail");
    assert_eq!(station.put("/v1/targets/wing", &other).await.assert_problem(409).pointer(), "/name");
    assert_eq!(station.get("/v1/targets").await.json["targets"][0]["name"], "wing");
}
