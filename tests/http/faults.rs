//! Bad input: refused with a clear problem, and the service lives on.

use reqwest::Method;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};

use crate::station::{Station, jpeg, read};

fn poses(change: impl FnOnce(&mut Value)) -> Value {
    let mut request = json!({
        "camera": {"width": 640, "height": 480, "fx": 600, "fy": 600, "cx": 320, "cy": 240},
        "object_points_m": [[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]],
        "image_points_px": [[260, 180], [380, 180], [380, 300], [260, 300]],
    });
    change(&mut request);
    request
}

#[tokio::test]
async fn bad_frames_are_refused() {
    let station = Station::equipped().await;
    let estimates = "/v1/estimates?camera=demo&target=wing-six";
    let raw = "/v1/detections?width=64&height=48&format=rgb8";
    let whole = jpeg();
    let half = whole[..whole.len() / 2].to_vec();
    let mut huge = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
    huge.extend(60_000_u32.to_be_bytes());
    huge.extend(60_000_u32.to_be_bytes());
    huge.extend(b"\x08\x02\0\0\0\0\0\0\0");
    let cases: Vec<(&str, &str, Vec<u8>, u16, &str)> = vec![
        ("/v1/detections", "image/jpeg", Vec::new(), 400, "empty"),
        ("/v1/detections", "image/jpeg", half, 415, "cut off"),
        ("/v1/detections", "image/png", huge, 413, "60000 x 60000"),
        ("/v1/detections", "image/jpeg", b"I am a text called .jpg".to_vec(), 415, "not a picture"),
        ("/v1/detections", "image/gif", b"GIF89a\x01\0\x01\0\0\0\0".to_vec(), 415, "not a picture"),
        (raw, "application/octet-stream", vec![0; 100], 422, "9216 bytes, not 100"),
        (
            "/v1/detections?width=64&height=48",
            "application/octet-stream",
            vec![0; 100],
            422,
            "format, width and height",
        ),
        ("/v1/detections?width=0&height=48&format=rgb8", "application/octet-stream", vec![0; 9], 422, "no pixels"),
        ("/v1/detections?region_px=10,10,0,5", "image/jpeg", whole.clone(), 422, "no pixels"),
        ("/v1/detections?region_px=1270,10,20,5", "image/jpeg", whole.clone(), 422, "does not lie"),
        ("/v1/detections?region_px=1,2,3", "image/jpeg", whole.clone(), 422, "invalid length"),
        ("/v1/detections?regoin_px=1,2,3,4", "image/jpeg", whole.clone(), 422, "regoin_px"),
        ("/v1/detections?method=magic", "image/jpeg", whole.clone(), 422, "magic"),
        ("/v1/detections?color=mauve", "image/jpeg", whole.clone(), 422, "mauve"),
        ("/v1/detections?sample_px=1270,10,20,5", "image/jpeg", whole.clone(), 422, "does not lie"),
        ("/v1/detections?sample_px=0,0,1280,720", "image/jpeg", whole.clone(), 422, "921600 px, more than 16384"),
        ("/v1/detections?sample_px=5,5,2,2&color=red", "image/jpeg", whole.clone(), 422, "only one of them"),
        ("/v1/detections?method=edge&sample_px=5,5,2,2", "image/jpeg", whole.clone(), 422, "no option sample_px"),
        ("/v1/detections?method=beacon&preset=thesis", "image/jpeg", whole.clone(), 422, "no method for beacons"),
        ("/v1/detections?preset=thesis&min_contrast=3", "image/jpeg", whole.clone(), 422, "no options"),
        ("/v1/detections?method=edge&color=red", "image/jpeg", whole.clone(), 422, "edge has no option color"),
        ("/v1/detections?threshold=0.3", "image/jpeg", whole.clone(), 422, "color has no option threshold"),
        ("/v1/detections?method=edge&preset=thesis&median_px=0,3", "image/jpeg", whole.clone(), 422, "from 1 to 255"),
        ("/v1/detections?method=edge&preset=thesis&median_px=3", "image/jpeg", whole.clone(), 422, "invalid length 1"),
        ("/v1/detections?method=edge&preset=thesis&threshold=1", "image/jpeg", whole.clone(), 422, "less than 1"),
        ("/v1/detections?method=edge&preset=thesis&threshold=-0.1", "image/jpeg", whole.clone(), 422, "from 0 to 1"),
        ("/v1/detections?method=edge&gray=grey", "image/jpeg", whole.clone(), 422, "grey"),
        ("/v1/detections?min_fill=7", "image/jpeg", whole.clone(), 422, "min_fill"),
        ("/v1/estimates", "image/jpeg", whole.clone(), 422, "needs a camera"),
        ("/v1/estimates?camera=demo", "image/jpeg", whole.clone(), 422, "needs at least one target"),
        ("/v1/estimates?camera=nobody&target=wing-six", "image/jpeg", whole.clone(), 404, "nobody"),
        ("/v1/estimates?camera=demo&target=nothing", "image/jpeg", whole.clone(), 404, "nothing"),
        (estimates, "text/plain", whole.clone(), 415, "text/plain"),
        (estimates, "application/x-www-form-urlencoded", whole.clone(), 415, "image/jpeg"),
        (
            estimates,
            "image/x-portable-pixmap",
            b"P5 2 2 255\n\0\0\0\0".to_vec(),
            422,
            "2 x 2 px but its camera is calibrated for 1280 x 720",
        ),
        ("/v1/estimates", "multipart/form-data; boundary=x", b"--y\r\n".to_vec(), 400, "form"),
        ("/v1/estimates", "multipart/form-data", b"--y\r\n".to_vec(), 400, "form"),
    ];
    for (path, content_type, body, status, word) in cases {
        let reply = station.post_bytes(path, content_type, body).await;
        assert!(
            reply.assert_problem(status).detail().contains(word),
            "{path}: {word:?} is not in {:?}",
            reply.detail()
        );
        assert_eq!(station.get("/readyz").await.status, 200, "after {path}");
    }
}

/// A prior with a predicted pose.
fn predicted(quaternion: &[f64; 4], variance: f64) -> Value {
    let row = |i: usize| (0..6).map(|j| if i == j { variance } else { 0.0 }).collect::<Vec<_>>();
    json!({"pose": {
        "rotation": {"quaternion_xyzw": quaternion},
        "translation_m": [0, 0, 5],
        "covariance": (0..6).map(row).collect::<Vec<_>>(),
    }})
}

#[tokio::test]
async fn bad_numbers_are_refused_with_their_place() {
    let station = Station::start().await;
    let cases: [(Value, &str); 21] = [
        (poses(|r| r["camera"]["fx"] = json!(-600)), "/camera/fx"),
        (poses(|r| r["camera"]["fy"] = json!(0)), "/camera/fy"),
        (poses(|r| r["camera"]["cx"] = json!(null)), "/camera/cx"),
        (poses(|r| r["camera"]["width"] = json!(-1)), "/camera/width"),
        (poses(|r| r["camera"]["distortion"] = json!({"model": "magic"})), "/camera/distortion/model"),
        (
            poses(|r| r["camera"]["distortion"] = json!({"model": "plumb_bob", "coefficients": [1]})),
            "/camera/distortion/coefficients",
        ),
        (poses(|r| r["camera"] = json!(7)), "/camera"),
        (poses(|r| r["object_points_m"] = json!([[0, 0, 0], [1, 0, 0], [0, 1, 0]])), "/object_points_m"),
        (poses(|r| r["object_points_m"][1][2] = json!("far")), "/object_points_m/1/2"),
        (poses(|r| r["object_points_m"][1] = json!([1, 2])), "/object_points_m/1"),
        (poses(|r| r["object_points_m"][3][0] = json!(1e300)), "/object_points_m/3/0"),
        (poses(|r| r["image_points_px"] = json!([[0, 0], [1, 0], [0, 1], [3, 3], [9, 9]])), "/image_points_px"),
        (poses(|r| r["pixel_sigma"] = json!(0)), "/pixel_sigma"),
        (poses(|r| r["pixel_sigma"] = json!(-1)), "/pixel_sigma"),
        (poses(|r| r["solver"] = json!("magic")), "/solver"),
        (poses(|r| r["correspondence"] = json!("maybe")), "/correspondence"),
        (poses(|r| r["prior"] = json!({"visible_side": [0, 0, 0]})), "/prior/visible_side"),
        (poses(|r| r["prior"] = json!({"roll_rad": [1, -1]})), "/prior/roll_rad"),
        (poses(|r| r["prior"] = json!({"side": [0, 0, 1]})), "/prior/side"),
        (poses(|r| r["prior"] = predicted(&[0.0, 0.0, 0.0, 2.0], 1.0)), "/prior/pose/rotation/quaternion_xyzw"),
        (poses(|r| r["prior"] = predicted(&[0.0, 0.0, 0.0, 1.0], -1.0)), "/prior/pose/covariance"),
    ];
    for (request, pointer) in cases {
        let reply = station.post("/v1/poses", &request).await;
        assert_eq!(reply.assert_problem(422).pointer(), pointer, "{reply:?}");
    }
    assert_eq!(station.get("/healthz").await.status, 200);
}

#[tokio::test]
async fn a_member_that_nobody_knows_is_named() {
    let station = Station::start().await;
    let misspelt = poses(|r| r["dectector"] = json!({}));
    let right = poses(|_| {});
    let refused = station.post("/v1/poses", &misspelt).await;
    assert!(refused.assert_problem(422).detail().contains("`dectector`"), "{refused:?}");
    let batch = station.post("/v1/poses", &json!({"requests": [right, misspelt]})).await;
    assert!(batch.json["replies"][0]["pose"].is_object(), "{batch:?}");
    assert!(batch.json["replies"][1]["error"]["detail"].to_string().contains("`dectector`"), "{batch:?}");
    let refused = station.post("/v1/poses", &json!({"requests": [right], "solver": "p3p"})).await;
    assert!(refused.assert_problem(422).detail().contains("`solver`"), "{refused:?}");
    for path in ["/v1/detections", "/v1/estimates"] {
        let picture = Part::bytes(b"P5 1 1 255\n\0".to_vec()).file_name("frame.pgm");
        let form = Form::new().text("request", json!({"dectector": {}}).to_string()).part("frame", picture);
        let refused = read(station.request(Method::POST, path).multipart(form)).await;
        assert!(refused.assert_problem(422).detail().contains("`dectector`"), "{path}: {refused:?}");
    }
}

#[tokio::test]
async fn what_is_no_json_or_too_much_of_it_is_refused() {
    let station = Station::start().await;
    let post = async |content_type: &str, body: Vec<u8>| station.post_bytes("/v1/poses", content_type, body).await;
    post("application/json", Vec::new()).await.assert_problem(400);
    post("application/json", b"{\"camera\": NaN}".to_vec()).await.assert_problem(400);
    post("application/json", b"{\"pixel_sigma\": 1e999}".to_vec()).await.assert_problem(400);
    post("application/json", vec![b'['; 100_000]).await.assert_problem(400);
    post("application/json", vec![0xFF; 64]).await.assert_problem(400);
    post("text/plain", b"{}".to_vec()).await.assert_problem(415);
    let ten_megabytes = format!("{{\"requests\": [{}1]}}", "1,".repeat(5_000_000));
    post("application/json", ten_megabytes.into_bytes()).await.assert_problem(413);
    let many = json!({"requests": vec![0; 10_001]});
    assert!(station.post("/v1/poses", &many).await.assert_problem(413).detail().contains("10001"));
    assert_eq!(station.get("/healthz").await.status, 200);
}

#[tokio::test]
async fn targets_that_are_none_are_refused() {
    let station = Station::start().await;
    let marker = |id: &str, x: f64, y: f64| json!({"id": id, "position_m": [x, y, 0]});
    let square = || vec![marker("a", 0.0, 0.0), marker("b", 1.0, 0.0), marker("c", 1.0, 1.0), marker("d", 0.0, 1.0)];
    let with = |change: &dyn Fn(&mut Vec<Value>)| {
        let mut markers = square();
        change(&mut markers);
        json!({"markers": markers})
    };
    let cases = [
        (with(&|m| m.truncate(3)), "/markers", "3 markers"),
        (with(&|m| m[2] = marker("c", 2.0, 0.0)), "", ""),
        (with(&|m| m[1]["id"] = json!("a")), "/markers/1/id", "\"a\""),
        (with(&|m| m[1]["radius_m"] = json!(-1)), "/markers/1/radius_m", "-1"),
        (with(&|m| m[1]["normal"] = json!([0, 0, 0])), "/markers/1/normal", "normal"),
        (with(&|m| m[3]["position_m"] = json!([1, 1, 0])), "/markers/3/position_m", "apart"),
        (with(&|m| m[3]["position_m"] = json!([1, 1])), "/markers/3/position_m", "length"),
        (
            json!({"markers": [marker("a", 0.0, 0.0), marker("b", 1.0, 1.0), marker("c", 2.0, 2.0), marker("d", 3.0, 3.0)]}),
            "/markers",
            "collinear",
        ),
    ];
    for (target, pointer, word) in cases {
        let reply = station.put("/v1/targets/t", &target).await;
        if pointer.is_empty() {
            assert!(reply.status.is_success(), "{reply:?}");
            continue;
        }
        assert_eq!(reply.assert_problem(422).pointer(), pointer);
        assert!(reply.detail().contains(word), "{word:?} is not in {:?}", reply.detail());
    }
}

#[tokio::test]
async fn unknown_paths_and_methods_are_problems_too() {
    let station = Station::start().await;
    station.get("/").await.assert_problem(404);
    station.get("/v2/poses").await.assert_problem(404);
    station.get("/v1/poses").await.assert_problem(405);
    station.post("/healthz", &json!({})).await.assert_problem(405);
    station.get("/v1/cameras/none").await.assert_problem(404);
    station.get("/v1/cameras/a%2Fb").await.assert_problem(422);
    station.put("/v1/cameras/..%2F..", &json!({})).await.assert_problem(422);
}
