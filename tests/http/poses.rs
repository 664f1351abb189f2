//! Points to pose, one and many.

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::station::Station;

fn camera() -> Value {
    json!({"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240})
}

/// A square of a metre a side, five metres ahead, face on.
fn square() -> Value {
    json!({
        "camera": camera(),
        "object_points_m": [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]],
        "image_points_px": [[260, 180], [380, 180], [380, 300], [260, 300]],
    })
}

#[tokio::test]
async fn a_fronto_parallel_square_has_an_exact_pose_by_every_method() {
    let station = Station::start().await;
    for solver in ["auto", "homography", "epnp", "posit", "ippe", "p3p", "sqpnp"] {
        for refine in [true, false] {
            let mut request = square();
            request["solver"] = json!(solver);
            request["refine"] = json!(refine);
            let reply = station.post("/v1/poses", &request).await;
            assert_eq!(reply.status, StatusCode::OK);
            let pose = &reply.json["pose"];
            let z = pose["translation_m"][2].as_f64().unwrap_or_else(|| panic!("{solver} {refine}: {reply:?}"));
            assert!((z - 5.0).abs() < 1e-6, "{solver} {refine}: {z}");
            assert!((pose["range_m"].as_f64().expect("range") - 5.0).abs() < 1e-6);
            assert!(pose["rotation"]["quaternion_xyzw"][3].as_f64().expect("w") > 0.999_999);
            assert!(reply.json["elapsed_us"].as_f64().expect("time") > 0.0);
        }
    }
}

#[tokio::test]
async fn what_is_known_beforehand_enters_and_a_contradiction_is_told() {
    let station = Station::start().await;
    let mut request = square();
    request["prior"] = json!({"visible_side": [0, 0, -1], "yaw_rad": [-1, 1]});
    let reply = station.post("/v1/poses", &request).await;
    let last = reply.json["pose"].clone();
    assert!(last.is_object(), "{reply:?}");
    // The pose of a reply is a prediction as it stands; two of equal weight have half the variance.
    request["prior"] = json!({"pose": last});
    let fused = station.post("/v1/poses", &request).await.json["pose"].clone();
    let variance = |pose: &Value| pose["covariance"][2][2].as_f64().expect("a number");
    assert!((variance(&fused) / variance(&last) - 0.5).abs() < 1e-3, "{fused}");
    request["prior"] = json!({"visible_side": [0, 0, 1]});
    let reply = station.post("/v1/poses", &request).await;
    assert_eq!((&reply.json["pose"], &reply.json["reason"]), (&Value::Null, &json!("high_residual")));
    assert!(reply.json["detail"].as_str().expect("words").contains("prior"), "{reply:?}");
}

#[tokio::test]
async fn many_requests_are_answered_in_order_and_a_bad_one_harms_no_other() {
    let station = Station::start().await;
    let mut named = square();
    named["id"] = json!({"any": ["thing", 1]});
    let mut negative = square();
    negative["camera"]["fx"] = json!(-1);
    negative["id"] = json!(2);
    let reply = station.post("/v1/poses", &json!({"requests": [named, negative, 17, square()]})).await;
    assert_eq!(reply.status, StatusCode::OK);
    let replies = reply.json["replies"].as_array().expect("replies");
    assert_eq!(replies.len(), 4);
    assert_eq!(replies[0]["id"], json!({"any": ["thing", 1]}));
    assert!(replies[0]["pose"].is_object() && replies[3]["pose"].is_object());
    assert_eq!(replies[1]["error"]["pointer"], "/camera/fx");
    assert_eq!((&replies[1]["id"], &replies[1]["error"]["status"]), (&json!(2), &json!(422)));
    assert_eq!(replies[2]["error"]["status"], 422);
    assert_eq!(station.post("/v1/poses", &json!({"requests": []})).await.json, json!({"replies": []}));
}

#[tokio::test]
async fn that_there_is_no_pose_is_an_answer_with_a_reason() {
    let station = Station::start().await;
    let reason = async |change: Value| {
        let mut request = square();
        for (key, value) in change.as_object().expect("an object") {
            request[key] = value.clone();
        }
        let reply = station.post("/v1/poses", &request).await;
        assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
        assert_eq!(reply.json["pose"], Value::Null, "{reply:?}");
        assert!(reply.json["detail"].as_str().is_some_and(|text| !text.is_empty()));
        reply.json["reason"].as_str().expect("a reason").to_owned()
    };
    let line = json!([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]);
    assert_eq!(reason(json!({"object_points_m": line})).await, "degenerate_geometry");
    let box_points = json!([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]);
    assert_eq!(reason(json!({"object_points_m": box_points, "solver": "homography"})).await, "degenerate_geometry");
    let torn = json!([[260, 180], [380, 180], [80, 30], [260, 300]]);
    assert_eq!(reason(json!({"image_points_px": torn, "pixel_sigma": 0.1})).await, "high_residual");
    let one_place = json!([[260, 180], [260, 180], [260, 180], [260, 180]]);
    assert_ne!(reason(json!({"image_points_px": one_place})).await, "");
    let scattered = json!([[1, 1], [600, 20], [30, 400], [333, 111]]);
    let unknown = json!({"image_points_px": scattered, "correspondence": "unknown", "pixel_sigma": 0.3});
    assert_eq!(reason(unknown).await, "not_identified");
    let few = json!({"image_points_px": [[1, 1], [2, 9]], "correspondence": "unknown"});
    assert_eq!(reason(few).await, "too_few_points");
}

/// Seven points in space and their images at a known pose, shuffled.
fn shuffled() -> (Value, Vec<Option<usize>>) {
    use skypose::geometry::{CameraFromTarget, Point, rotation};
    let points = [
        [0.31, 0.02, 0.0],
        [-0.12, -0.36, 0.11],
        [-0.20, 0.33, 0.0],
        [-0.38, -0.06, -0.1],
        [0.05, 0.11, 0.2],
        [0.14, -0.27, 0.0],
        [0.25, 0.30, -0.15],
    ];
    let turn = rotation::exp(&nalgebra::Vector3::new(0.3, -0.2, 0.5));
    let pose = CameraFromTarget::new(turn, nalgebra::Vector3::new(0.1, 0.05, 3.0));
    let order = [Some(4), None, Some(0), Some(6), Some(2), None, Some(5), Some(1), Some(3)];
    let image: Vec<[f64; 2]> = order
        .iter()
        .enumerate()
        .map(|(place, point)| match point {
            None => [40.0 + 60.0 * f64::from(u8::try_from(place).expect("small")), 77.0],
            Some(point) => {
                let p = (pose * Point::from(points[*point])).coords;
                [600.0 * p.x / p.z + 320.0, 600.0 * p.y / p.z + 240.0]
            }
        })
        .collect();
    let request = json!({
        "camera": camera(), "object_points_m": points, "image_points_px": image, "pixel_sigma": 0.2,
        "correspondence": "unknown"
    });
    (request, order.to_vec())
}

#[tokio::test]
async fn points_in_no_order_with_clutter_among_them_are_assigned() {
    let station = Station::start().await;
    let (request, order) = shuffled();
    let reply = station.post("/v1/poses", &request).await;
    assert_eq!(reply.json["assignment"], json!(order), "{reply:?}");
    assert!(reply.json["assignment_probability"].as_f64().expect("a probability") > 0.999);
    assert!((reply.json["pose"]["translation_m"][2].as_f64().expect("z") - 3.0).abs() < 1e-6);
}

#[tokio::test]
async fn the_four_turns_of_a_square_share_the_probability() {
    let station = Station::start().await;
    let mut request = square();
    request["correspondence"] = json!("unknown");
    request["pixel_sigma"] = json!(0.2);
    // A fifth point off the plane's middle keeps the square from being mistaken for clutter, and turns with it.
    request["object_points_m"].as_array_mut().expect("points").push(json!([0, 0, 0]));
    request["image_points_px"].as_array_mut().expect("points").push(json!([320, 240]));
    let reply = station.post("/v1/poses", &request).await;
    assert_eq!(reply.json["ambiguous"], true, "{reply:?}");
    assert!(reply.json["pose"]["probability"].as_f64().expect("a probability") < 0.3, "{reply:?}");
    assert!(reply.json["alternatives"].as_array().expect("alternatives").len() >= 3);
}

#[tokio::test]
async fn wrong_pairs_are_found_out() {
    let station = Station::start().await;
    let (mut request, order) = shuffled();
    let image = request["image_points_px"].clone();
    let mut pixels = vec![Value::Null; 7];
    for (place, point) in order.iter().enumerate() {
        if let Some(point) = point {
            pixels[*point] = image[place].clone();
        }
    }
    pixels[2] = json!([11, 470]);
    request["image_points_px"] = json!(pixels);
    request["correspondence"] = json!("known");
    request["outliers"] = json!(true);
    let reply = station.post("/v1/poses", &request).await;
    assert_eq!(reply.json["inliers"], json!([true, true, false, true, true, true, true]), "{reply:?}");
}

#[tokio::test]
async fn how_well_points_and_camera_are_known_decides_how_well_the_pose_is() {
    let station = Station::start().await;
    let variance_of_range = |reply: &Value| reply["pose"]["covariance"][2][2].as_f64().expect("a number");
    let plain = station.post("/v1/poses", &square()).await.json;
    assert!((plain["noise_scale"].as_f64().expect("a number") - 1.0).abs() < 1e-12);

    let mut each = square();
    each["pixel_sigmas"] = json!([2, 2, 2, 2]);
    let reply = station.post("/v1/poses", &each).await.json;
    let variance_of_spin = |reply: &Value| reply["pose"]["covariance"][5][5].as_f64().expect("a number");
    assert!((variance_of_spin(&reply) / variance_of_spin(&plain) - 4.0).abs() < 1e-3, "{reply}");

    let mut uncertain = square();
    uncertain["camera"]["parameter_covariance"] = json!([[36, 36, 0, 0], [36, 36, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]);
    let reply = station.post("/v1/poses", &uncertain).await.json;
    // A hundredth of the focal length is a hundredth of five metres.
    let added = variance_of_range(&reply) - variance_of_range(&plain);
    assert!((added.sqrt() - 0.05).abs() < 1e-3, "{}", added.sqrt());
    uncertain["camera"]["parameter_covariance"] = json!([[1, 2], [2, 1]]);
    let refused = station.post("/v1/poses", &uncertain).await;
    assert_eq!(
        (refused.status, &refused.json["pointer"]),
        (422.try_into().expect("a status"), &json!("/camera/parameter_covariance"))
    );

    let mut short = square();
    short["pixel_sigmas"] = json!([1, 1, 1]);
    assert_eq!(station.post("/v1/poses", &short).await.json["pointer"], "/pixel_sigmas");
    short["pixel_sigmas"] = json!([1, 1, 0, 1]);
    assert_eq!(station.post("/v1/poses", &short).await.json["pointer"], "/pixel_sigmas/2");
}

#[tokio::test]
async fn noise_may_be_read_from_the_residuals() {
    let station = Station::start().await;
    let mut request = square();
    request["noise"] = json!("estimated");
    let reply = station.post("/v1/poses", &request).await.json;
    assert_eq!((&reply["pose"], &reply["reason"]), (&Value::Null, &json!("too_few_points")), "four leave nothing over");
    request["object_points_m"].as_array_mut().expect("points").extend([
        json!([0, 0.5, 0]),
        json!([0, -0.5, 0]),
        json!([0.5, 0, 0]),
    ]);
    request["image_points_px"].as_array_mut().expect("points").extend([
        json!([322, 300]),
        json!([318, 180]),
        json!([381, 240]),
    ]);
    let reply = station.post("/v1/poses", &request).await.json;
    let scale = reply["noise_scale"].as_f64().expect("a number");
    assert!((0.4..1.5).contains(&scale), "{reply}");
    assert_eq!(reply["pose"]["covariance_reliable"], false, "from eight degrees of freedom");
}
