//! Frames in every form in which they may come.

use reqwest::multipart::{Form, Part};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use skypose::scene::encode;
use skypose::scene::models::{demo_camera, wing};
use skypose::shell::wire::{CameraWire, TargetWire};

use crate::station::{Station, assert_true_pose, frame, jpeg, read};

const QUERY: &str = "/v1/estimates?camera=demo&target=wing-six";

fn names(reply: &Value) -> Vec<String> {
    let mut names: Vec<String> = reply["centroids"]
        .as_array()
        .expect("centroids")
        .iter()
        .filter_map(|c| Some(c["marker"].as_str()?.to_owned()))
        .collect();
    names.sort();
    names
}

#[tokio::test]
async fn a_jpeg_body_with_stored_names_gives_the_pose() {
    let station = Station::equipped().await;
    let reply = station.post_bytes(&format!("{QUERY}&timestamp_us=1700000000000000&id=7"), "image/jpeg", jpeg()).await;
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    assert_eq!(reply.json["frame"], json!({"width": 1280, "height": 720, "timestamp_us": 1_700_000_000_000_000_i64}));
    assert_eq!(reply.json["id"], "7");
    let target = &reply.json["targets"][0];
    assert_eq!(
        (&target["name"], &target["detected"], &target["reason"]),
        (&json!("wing-six"), &json!(true), &Value::Null)
    );
    assert_true_pose(&target["pose"]);
    assert_eq!(names(&reply.json), ["left", "mid", "nose", "right", "tail", "tip"]);
    for stage in ["decode", "detect", "identify", "solve", "total"] {
        assert!(reply.json["timing_us"][stage].is_u64(), "{stage}");
    }
}

#[tokio::test]
async fn a_form_with_objects_gives_the_same() {
    let station = Station::start().await;
    let request = json!({
        "camera": CameraWire::from(&demo_camera()), "targets": [TargetWire::from(&wing().target)],
        "detector": {"method": "color"}, "solver": "auto", "timestamp_us": 12
    });
    let form = Form::new()
        .part("frame", Part::bytes(jpeg()).file_name("frame.jpg").mime_str("image/jpeg").expect("a type"))
        .part("request", Part::text(request.to_string()).mime_str("application/json").expect("a type"));
    let reply = read(station.request(Method::POST, "/v1/estimates").multipart(form)).await;
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    assert_true_pose(&reply.json["targets"][0]["pose"]);
}

#[tokio::test]
async fn lossless_and_raw_frames_give_the_pose_too() {
    let station = Station::equipped().await;
    let rgb = frame().rgb().into_owned();
    let bgr: Vec<u8> = rgb.chunks_exact(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
    let ppm = [b"P6\n1280 720\n255\n".as_slice(), &rgb].concat();
    let raw = |format: &str| format!("{QUERY}&width=1280&height=720&format={format}");
    for (path, content_type, body) in [
        (QUERY.to_owned(), "image/png", encode::png(frame()).expect("encodes")),
        (QUERY.to_owned(), "image/x-portable-pixmap", ppm),
        (raw("rgb8"), "application/octet-stream", rgb),
        (raw("bgr8"), "application/octet-stream", bgr),
    ] {
        let reply = station.post_bytes(&path, content_type, body).await;
        assert_eq!(reply.status, StatusCode::OK, "{content_type}: {reply:?}");
        assert_true_pose(&reply.json["targets"][0]["pose"]);
    }
}

#[tokio::test]
async fn a_named_method_is_used() {
    let station = Station::equipped().await;
    for solver in ["homography", "epnp", "ippe", "p3p"] {
        let reply = station.post_bytes(&format!("{QUERY}&solver={solver}&refine=false"), "image/jpeg", jpeg()).await;
        assert_eq!(reply.json["targets"][0]["solver"], solver, "{reply:?}");
    }
}

#[tokio::test]
async fn a_region_finds_what_is_in_it_on_the_whole_frames_coordinates() {
    let station = Station::equipped().await;
    let whole = station.post_bytes("/v1/detections", "image/jpeg", jpeg()).await;
    let one = &whole.json["centroids"][0];
    let (u, v) = (one["u_px"].as_f64().expect("u"), one["v_px"].as_f64().expect("v"));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
    let (x, y) = (u as u32 - 30, v as u32 - 30);
    let part = station.post_bytes(&format!("/v1/detections?region_px={x},{y},60,60"), "image/jpeg", jpeg()).await;
    let found = &part.json["centroids"][0];
    assert!((found["u_px"].as_f64().expect("u") - u).abs() < 0.1, "{part:?}");
    assert!((found["v_px"].as_f64().expect("v") - v).abs() < 0.1, "{part:?}");
}

#[tokio::test]
async fn a_region_of_a_raw_frame_is_that_of_a_picture() {
    let station = Station::equipped().await;
    let (raw, png) = (frame().rgb().into_owned(), encode::png(frame()).expect("encodes"));
    let whole = station.post_bytes("/v1/detections", "image/png", png.clone()).await;
    let one = &whole.json["centroids"][0];
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
    let [x, y] = ["u_px", "v_px"].map(|name| one[name].as_f64().expect("a place") as u32);
    let rest = "width=1280&height=720&format=rgb8";
    // The second learns the hue far from the region.
    for query in [
        format!("region_px={},{},60,60", x - 30, y - 30),
        format!("region_px=0,0,640,360&sample_px={},{},3,3", x - 1, y - 1),
        format!("region_px={},{},50,50&method=edge", x - 20, y - 20),
    ] {
        let of_raw = station
            .post_bytes(&format!("/v1/detections?{query}&{rest}"), "application/octet-stream", raw.clone())
            .await;
        let of_png = station.post_bytes(&format!("/v1/detections?{query}"), "image/png", png.clone()).await;
        assert_eq!(of_raw.status, StatusCode::OK, "{of_raw:?}");
        for word in ["centroids", "refused", "hue_range_deg"] {
            assert_eq!(of_raw.json.get(word), of_png.json.get(word), "{query}: {word}");
        }
    }
    let outside = format!("/v1/detections?region_px=1270,0,11,5&{rest}");
    let refused = station.post_bytes(&outside, "application/octet-stream", raw).await;
    assert!(refused.assert_problem(422).detail().contains("does not lie"), "{refused:?}");
}

#[tokio::test]
async fn a_click_on_a_marker_finds_all_of_its_colour_and_tells_the_hues_for_later() {
    let station = Station::equipped().await;
    let by_name = station.post_bytes("/v1/detections?color=red", "image/jpeg", jpeg()).await;
    let one = &by_name.json["centroids"][0];
    assert_eq!(by_name.json.get("hue_range_deg"), None, "nothing was learned");
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels")]
    let [x, y] = ["u_px", "v_px"].map(|name| one[name].as_f64().expect("a place") as u32 - 1);
    let learned = station.post_bytes(&format!("/v1/detections?sample_px={x},{y},3,3"), "image/jpeg", jpeg()).await;
    let markers = |reply: &Value| reply["centroids"].as_array().map(Vec::len);
    assert_eq!(markers(&learned.json), markers(&by_name.json), "{learned:?}");
    let ends = learned.json["hue_range_deg"].as_array().expect("hues were learned");
    let query = format!("/v1/detections?hue_range_deg={},{}", ends[0], ends[1]);
    let later = station.post_bytes(&query, "image/jpeg", jpeg()).await;
    assert_eq!(later.json["centroids"], learned.json["centroids"]);
    let request = json!({"camera": "demo", "targets": ["wing-six"], "detector": {"sample_px": [x, y, 3, 3]}});
    let form = Form::new()
        .part("frame", Part::bytes(jpeg()).mime_str("image/jpeg").expect("a type"))
        .text("request", request.to_string());
    let posed = read(station.request(Method::POST, "/v1/estimates").multipart(form)).await;
    assert_true_pose(&posed.json["targets"][0]["pose"]);
    assert_eq!(posed.json["hue_range_deg"], learned.json["hue_range_deg"]);
}

#[tokio::test]
async fn an_empty_sky_is_an_answer() {
    let station = Station::equipped().await;
    let sky = skypose::scene::render::Sky::fair(5, [0.0; 2]);
    let behind = skypose::geometry::CameraFromTarget::new(
        nalgebra::Rotation3::identity(),
        nalgebra::Vector3::new(0.0, 0.0, -5.0),
    );
    let optics = skypose::scene::render::Optics::default();
    let mut rng = skypose::random::named("empty sky");
    let frame = skypose::scene::render::render(&demo_camera(), &behind, &wing(), &sky, &optics, &mut rng);
    let reply = station.post_bytes(QUERY, "image/jpeg", encode::jpeg(&frame, 90).expect("encodes")).await;
    assert_eq!(reply.status, StatusCode::OK);
    let target = &reply.json["targets"][0];
    assert_eq!((&target["detected"], &target["pose"]), (&json!(false), &Value::Null));
    assert_eq!(target["reason"], "too_few_points");
}

#[tokio::test]
async fn the_thesis_preset_and_refused_blobs_are_served() {
    let station = Station::start().await;
    let reply = station.post_bytes("/v1/detections?method=color&preset=thesis", "image/jpeg", jpeg()).await;
    assert!(reply.json["centroids"].as_array().expect("centroids").len() >= 6, "{reply:?}");
    let reply = station.post_bytes("/v1/detections?max_area_ratio=0.00001", "image/jpeg", jpeg()).await;
    let refused = reply.json["refused"].as_array().expect("refused");
    assert!(refused.iter().any(|blob| blob["reason"] == "too_large"), "{reply:?}");
}

/// A dark cross in a bright sky, and a speck.
fn cross() -> Vec<u8> {
    let is_dark = |x: i32, y: i32| {
        let (x, y) = (x - 200, y - 90);
        (x.abs() < 60 && y.abs() < 8) || (x.abs() < 8 && y.abs() < 40) || (x == 50 && y == 40)
    };
    let samples = (0..240).flat_map(|y| (0..320).map(move |x| if is_dark(x, y) { 40 } else { 190 }));
    [b"P5\n320 240\n255\n".to_vec(), samples.collect()].concat()
}

#[tokio::test]
async fn edges_are_found_by_the_seeds_numbers_and_by_others() {
    let station = Station::equipped().await;
    let content_type = "image/x-portable-pixmap";
    for options in ["", "&preset=thesis", "&preset=thesis&gray=average&median_px=5,5&threshold=0.3&min_area_px=100"] {
        let reply = station.post_bytes(&format!("/v1/detections?method=edge{options}"), content_type, cross()).await;
        assert_eq!(reply.status, StatusCode::OK, "{options}: {reply:?}");
        let mut centroids = reply.json["centroids"].as_array().expect("centroids").clone();
        if options == "&preset=thesis" {
            // The right border of a bright picture is the seed's false alarm.
            centroids.retain(|centroid| centroid["u_px"].as_f64().expect("u") < 300.0);
        }
        assert_eq!(centroids.len(), 1, "{options}: {reply:?}");
        let at = |name: &str| centroids[0][name].as_f64().expect(name);
        // The default places what is large by squares of four pixels.
        let tolerance_px = if options.is_empty() { 2.5 } else { 1.0 };
        assert!((at("u_px") - 200.0).hypot(at("v_px") - 90.0) < tolerance_px, "{options}: {reply:?}");
        assert_eq!(centroids[0]["marker"], Value::Null);
    }
    let reply =
        station.post_bytes("/v1/detections?method=edge&preset=thesis&min_area_px=100000", content_type, cross()).await;
    assert_eq!((&reply.json["centroids"], &reply.json["refused"][0]["reason"]), (&json!([]), &json!("too_small")));
}

#[tokio::test]
async fn edges_alone_give_no_pose() {
    let station = Station::equipped().await;
    let reply = station.post_bytes(&format!("{QUERY}&method=edge&preset=thesis"), "image/jpeg", jpeg()).await;
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    let target = &reply.json["targets"][0];
    assert_eq!((&target["pose"], &target["detected"]), (&Value::Null, &json!(false)), "{reply:?}");
    assert!(target["reason"].is_string(), "{reply:?}");
}

#[tokio::test]
async fn two_targets_are_told_apart() {
    let station = Station::equipped().await;
    let mut other = json!(TargetWire::from(&wing().target));
    other["name"] = json!("other");
    for (index, shift) in [0.11, -0.07, 0.05, -0.13, 0.09, -0.05].into_iter().enumerate() {
        let x = other["markers"][index]["position_m"][0].as_f64().expect("x");
        other["markers"][index]["position_m"][0] = json!(x + shift);
    }
    station.put("/v1/targets/other", &other).await;
    let reply = station.post_bytes("/v1/estimates?camera=demo&target=other,wing-six", "image/jpeg", jpeg()).await;
    assert_eq!(reply.json["targets"][0]["pose"], Value::Null, "{reply:?}");
    assert_true_pose(&reply.json["targets"][1]["pose"]);
    assert!(reply.json["centroids"].as_array().expect("list").iter().all(|c| c["target"] != "other"));
}

/// Two wings in one frame, the left and the right half of two pictures.
fn two_wings() -> Vec<u8> {
    let half = |side: f64| {
        let turn = skypose::geometry::rotation::exp(&nalgebra::Vector3::new(0.4, 0.3, 0.7 * side));
        let pose = skypose::geometry::CameraFromTarget::new(turn, nalgebra::Vector3::new(side, 0.1, 4.0));
        let (sky, optics) = (skypose::scene::render::Sky::fair(5, [0.0; 2]), skypose::scene::render::Optics::default());
        let mut rng = skypose::random::named("two wings");
        skypose::scene::render::render(&demo_camera(), &pose, &wing(), &sky, &optics, &mut rng).rgb().into_owned()
    };
    let (left, right) = (half(-1.0), half(1.0));
    let rows = left.chunks_exact(3 * 1280).zip(right.chunks_exact(3 * 1280));
    let pixels: Vec<u8> = rows.flat_map(|(l, r)| [&l[..3 * 640], &r[3 * 640..]].concat()).collect();
    [b"P6\n1280 720\n255\n".as_slice(), &pixels].concat()
}

#[tokio::test]
async fn several_of_one_target_are_several_entries() {
    let station = Station::equipped().await;
    let ask = async |query: String| station.post_bytes(&query, "image/x-portable-pixmap", two_wings()).await;
    let one = ask(QUERY.into()).await;
    assert_eq!(one.json["targets"].as_array().expect("targets").len(), 1, "{one:?}");
    assert_eq!(one.json["targets"][0].get("instance"), None);
    let all = ask(format!("{QUERY}&max_instances=3")).await;
    let found = all.json["targets"].as_array().expect("targets");
    assert_eq!(found.len(), 2, "{all:?}");
    let mut sides: Vec<f64> = Vec::new();
    for (index, target) in found.iter().enumerate() {
        assert_eq!((&target["name"], &target["instance"]), (&json!("wing-six"), &json!(index)));
        sides.push(target["pose"]["translation_m"][0].as_f64().expect("metres"));
        let of_it = |c: &&Value| c["instance"] == json!(index) && c["marker"].is_string();
        assert_eq!(all.json["centroids"].as_array().expect("centroids").iter().filter(of_it).count(), 6, "{all:?}");
    }
    sides.sort_by(f64::total_cmp);
    assert!((sides[0] + 1.0).abs() < 0.02 && (sides[1] - 1.0).abs() < 0.02, "{sides:?}");
    let none = ask(format!("{QUERY}&max_instances=0")).await;
    assert_eq!((none.assert_problem(422).pointer()), "/max_instances");
}
