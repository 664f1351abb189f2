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

const ROS: &str = include_str!("../data/cameras/ros.yaml");
const XML: &str = include_str!("../data/cameras/opencv_fisheye.xml");

#[tokio::test]
async fn a_camera_is_stored_from_files_of_ros_and_opencv_and_returned_as_such() {
    let station = Station::start().await;
    let put = |name: &str, kind: &'static str, body: &'static str| {
        let request = station.request(Method::PUT, &format!("/v1/cameras/{name}"));
        read(request.header("content-type", kind).body(body))
    };
    let stored = put("front", "application/yaml", ROS).await;
    assert_eq!((stored.status, &stored.json["fx"]), (StatusCode::CREATED, &json!(608.7)));
    assert_eq!(put("aft", "application/xml", XML).await.json["distortion"]["model"], "equidistant");
    put("aft", "text/plain", XML).await.assert_problem(415);
    put("aft", "application/yaml", "a: [").await.assert_problem(400);
    assert_eq!(put("aft", "application/yaml", "a: 1").await.assert_problem(422).pointer(), "/image_width");
    let get = async |query: &str, accept: &str| {
        let request = station.request(Method::GET, &format!("/v1/cameras/front{query}")).header("accept", accept);
        let reply = request.send().await.expect("an answer");
        let header = |name: &str| reply.headers().get(name).expect("a header").to_str().expect("text").to_owned();
        let (kind, tag) = (header("content-type"), header("etag"));
        assert_eq!(header("vary"), "accept");
        (kind, tag, reply.text().await.expect("a text"))
    };
    let (kind, json_tag, _) = get("", "application/json, application/yaml").await;
    assert_eq!(kind, "application/json", "the first of equals");
    let (kind, tag, text) = get("", "application/json;q=0.5, application/yaml").await;
    assert_eq!((kind.as_str(), tag), ("application/yaml", format!("W/{json_tag}")));
    assert!(text.contains("camera_name: \"front\"") && text.contains("distortion_model: plumb_bob"), "{text}");
    for (format, words) in [
        ("ros", "projection_matrix"),
        ("opencv-yaml", "!!opencv-matrix"),
        ("opencv-xml", "<opencv_storage>"),
        ("json", "\"fx\":608.7"),
    ] {
        let (_, _, text) = get(&format!("?format={format}"), "*/*").await;
        assert!(text.contains(words), "{format}: {text}");
    }
    station.get("/v1/cameras/front?format=toml").await.assert_problem(422);
    station.get("/v1/cameras/front?fromat=ros").await.assert_problem(422);
    station.get("/v1/cameras/none?format=ros").await.assert_problem(404);
}

#[tokio::test]
async fn a_camera_is_derived_from_a_stored_one_and_keeps_its_origin() {
    let station = Station::start().await;
    let mut front = camera(600.0);
    front["pixel_sigma_px"] = json!(0.1);
    front["parameter_covariance"] =
        json!([[4.0, 0.0, 0.0, 0.0], [0.0, 4.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]);
    assert_eq!(station.put("/v1/cameras/front", &front).await.json, front, "all of it is kept");
    let half = station.put("/v1/cameras/half", &json!({"derived_from": "front", "width": 320, "height": 240})).await;
    assert_eq!(half.status, StatusCode::CREATED);
    let half = station.get("/v1/cameras/half").await.json;
    assert_eq!([&half["fx"], &half["cx"], &half["cy"]], [&json!(300.0), &json!(159.75), &json!(119.75)]);
    assert_eq!(half["parameter_covariance"][0][0], 1.0);
    assert_eq!(half["derived_from"], json!({"name": "front", "width": 640, "height": 480}));
    assert_eq!(station.put("/v1/cameras/half", &half).await.json, half, "as it is read it can be put");
    let part = json!({"derived_from": "front", "crop_px": [100, 50, 320, 240], "width": 160, "height": 240});
    let part = station.put("/v1/cameras/part", &part).await.json;
    assert_eq!(
        [&part["fx"], &part["fy"], &part["cx"], &part["cy"]],
        [&json!(300.0), &json!(600.0), &json!(109.75), &json!(190.0)]
    );
    assert_eq!(part["derived_from"]["crop_px"], json!([100, 50, 320, 240]));
    let nobody = json!({"derived_from": "nobody", "width": 320, "height": 240});
    assert_eq!(station.put("/v1/cameras/x", &nobody).await.assert_problem(404).pointer(), "/derived_from");
    let beyond = json!({"derived_from": "front", "crop_px": [400, 50, 320, 240]});
    assert_eq!(station.put("/v1/cameras/x", &beyond).await.assert_problem(422).pointer(), "/crop_px");
}

#[tokio::test]
async fn a_stream_names_what_is_stored() {
    let station = Station::equipped().await;
    let stream =
        json!({"camera": "demo", "targets": ["wing-six"], "detector": {"method": "beacon"}, "solver": "sqpnp"});
    let created = station.put("/v1/streams/front", &stream).await;
    assert_eq!(created.status, StatusCode::CREATED, "{created:?}");
    let kept = station.get("/v1/streams/front").await;
    for word in ["camera", "targets", "detector", "solver"] {
        assert_eq!(kept.json[word], stream[word], "{word}");
    }
    assert_eq!(station.put("/v1/streams/front", &kept.json).await.headers["etag"], created.headers["etag"]);
    assert_eq!(station.get("/v1/streams").await.json["streams"][0]["name"], "front");
    let only_new = station.request(Method::PUT, "/v1/streams/front").header("if-none-match", "*").json(&stream);
    read(only_new).await.assert_problem(412);
    for (wrong, status, pointer) in [
        (json!({"camera": "nobody", "targets": ["wing-six"]}), 404, "/camera"),
        (json!({"camera": "demo", "targets": ["wing-six", "nobody"]}), 404, "/targets/1"),
        (json!({"camera": "demo", "targets": []}), 422, "/targets"),
        (json!({"camera": "demo", "targets": ["wing-six"], "max_instances": 0}), 422, "/max_instances"),
        (json!({"camera": "demo", "targets": ["wing-six"], "detector": {"min_fill": -1}}), 422, "/detector/min_fill"),
        (json!({"camera": "demo", "targets": ["wing-six"], "solvr": "auto"}), 422, "/solvr"),
    ] {
        let refused = station.put("/v1/streams/aft", &wrong).await;
        assert_eq!(refused.assert_problem(status).pointer(), pointer, "{wrong}");
    }
    station.put("/v1/streams/@aft", &stream).await.assert_problem(422);
    let removed = read(station.request(Method::DELETE, "/v1/streams/front")).await;
    assert_eq!(removed.status, StatusCode::NO_CONTENT);
    station.get("/v1/streams/front").await.assert_problem(404);
}
