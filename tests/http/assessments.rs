//! What a constellation is good for, asked over HTTP.

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::station::Station;

/// Named, as stored, on a small grid.
fn request() -> Value {
    json!({"camera": "demo", "target": "wing-six", "ranges_m": [4.0, 20.0], "aspects_rad": [0.5, 1.0]})
}

#[tokio::test]
async fn a_stored_target_is_assessed_over_range_and_aspect() {
    let station = Station::equipped().await;
    let reply = station.post("/v1/targets/assessment", &request()).await;
    assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
    let reply = reply.json;
    assert_eq!((&reply["ranges_m"], &reply["aspects_rad"]), (&json!([4.0, 20.0]), &json!([0.5, 1.0])));
    assert_eq!(reply["front"], json!([0.0, 0.0, -1.0]), "its markers face there");
    let cells = reply["cells"].as_array().expect("cells");
    let places: Vec<Value> = cells.iter().map(|cell| json!([cell["aspect_rad"], cell["range_m"]])).collect();
    assert_eq!(json!(places), json!([[0.5, 4.0], [0.5, 20.0], [1.0, 4.0], [1.0, 20.0]]));
    let number = |value: &Value| value.as_f64().expect("a number");
    // Five times as far: the range is a quarter of a hundred times less well known, less what perspective adds near by.
    let growth = number(&cells[1]["range_sigma_m"]) / number(&cells[0]["range_sigma_m"]);
    assert!((24.0..26.5).contains(&growth), "{growth}");
    assert!(number(&cells[1]["attitude_sigma_rad"]) > 2.0 * number(&cells[0]["attitude_sigma_rad"]));
    assert!(number(&cells[0]["flip_rate"]) <= number(&cells[1]["flip_rate"]));
    assert!(number(&cells[0]["identified_rate"]) > 0.9);
    assert_eq!(reply["reach"].as_array().expect("one for each aspect").len(), 2);
    assert_eq!(reply["warnings"][0]["kind"], "flat");
    let advice = &reply["advice"][0];
    assert!(number(&advice["after"]["flip_rate"]) < number(&advice["before"]["flip_rate"]), "{advice}");
    assert!(advice["outward_m"].as_f64() > Some(0.05), "out of the plane: {advice}");
    assert!(reply.get("plot_svg").is_none());
}

#[tokio::test]
async fn the_whole_default_grid_is_answered_with_a_plot_and_the_same_each_time() {
    let station = Station::equipped().await;
    let ask = json!({"id": 7, "camera": "demo", "target": "wing-six", "plot": true});
    let mut first = station.post("/v1/targets/assessment", &ask).await.json;
    let mut second = station.post("/v1/targets/assessment", &ask).await.json;
    assert_eq!(first["id"], 7);
    assert_eq!(first["cells"].as_array().expect("cells").len(), 60);
    let svg = first["plot_svg"].as_str().expect("a plot").to_owned();
    assert!(svg.starts_with("<svg") && svg.contains("aspect 75 deg") && svg.contains("wing-six"), "{svg}");
    for reply in [&mut first, &mut second] {
        reply.as_object_mut().expect("an object").remove("elapsed_us");
    }
    assert_eq!(first, second);
}

#[tokio::test]
async fn symmetries_and_others_in_the_same_sky_are_warned_of() {
    let station = Station::equipped().await;
    let marker = |id: &str, x: f64, y: f64| json!({"id": id, "position_m": [x, y, 0], "normal": [0, 0, -1]});
    let square = json!({"name": "square", "markers": [
        marker("a", 0.3, 0.3), marker("b", -0.3, 0.3), marker("c", -0.3, -0.3), marker("d", 0.3, -0.3)]});
    let mut ask = request();
    ask["target"] = square.clone();
    ask["others"] = json!(["wing-six", square]);
    ask["flat"] = json!(true);
    let reply = station.post("/v1/targets/assessment", &ask).await.json;
    let kinds: Vec<&Value> =
        reply["warnings"].as_array().expect("warnings").iter().map(|warning| &warning["kind"]).collect();
    assert_eq!(kinds, ["symmetric", "same_as_other", "flat", "radius_unknown", "none_to_spare"], "{reply}");
    let detail = reply["warnings"][0]["detail"].as_str().expect("words");
    assert!(detail.contains("90 degrees") && detail.contains("3 such turns"), "{detail}");
    assert!(reply["cells"].as_array().expect("cells").iter().all(|cell| cell["identified_rate"] == 0.0), "{reply}");
    for advice in reply["advice"].as_array().expect("advice") {
        assert!(advice["outward_m"].as_f64().expect("a number").abs() < 1e-9, "{advice}");
    }
}

#[tokio::test]
async fn what_makes_no_sense_is_refused_with_its_place() {
    let station = Station::equipped().await;
    let with = |change: &dyn Fn(&mut Value)| {
        let mut ask = request();
        change(&mut ask);
        ask
    };
    let cases = [
        (with(&|r| r["camera"] = json!("nobody")), 404, "/camera"),
        (with(&|r| r["target"] = json!("nothing")), 404, "/target"),
        (with(&|r| r["others"] = json!(["wing-six", "nothing"])), 404, "/others/1"),
        (with(&|r| r["others"] = json!(vec!["wing-six"; 17])), 422, "/others"),
        (with(&|r| r["target"] = json!({"markers": []})), 422, "/target/markers"),
        (with(&|r| r["pixel_sigma"] = json!(0)), 422, "/pixel_sigma"),
        (with(&|r| r["pixel_sigma"] = json!(-0.3)), 422, "/pixel_sigma"),
        (with(&|r| r["pixel_sigma"] = json!("fine")), 422, "/pixel_sigma"),
        (with(&|r| r["ranges_m"] = json!([])), 422, "/ranges_m"),
        (with(&|r| r["ranges_m"] = json!(vec![1.0; 25])), 422, "/ranges_m"),
        (with(&|r| r["ranges_m"] = json!([3, 0])), 422, "/ranges_m/1"),
        (with(&|r| r["ranges_m"] = json!([3, -1])), 422, "/ranges_m/1"),
        (with(&|r| r["ranges_m"] = json!([null])), 422, "/ranges_m/0"),
        (with(&|r| r["ranges_m"] = json!([1e300])), 422, "/ranges_m/0"),
        (with(&|r| r["aspects_rad"] = json!(vec![0.1; 13])), 422, "/aspects_rad"),
        (with(&|r| r["aspects_rad"] = json!([0.1, 90])), 422, "/aspects_rad/1"),
        (with(&|r| r["aspects_rad"] = json!([-0.1])), 422, "/aspects_rad/0"),
        (with(&|r| r["plot"] = json!("yes")), 422, "/plot"),
        (with(&|r| r["pixel_sigmas"] = json!(1)), 422, "/pixel_sigmas"),
    ];
    for (ask, status, pointer) in cases {
        let reply = station.post("/v1/targets/assessment", &ask).await;
        assert_eq!(reply.assert_problem(status).pointer(), pointer, "{ask}");
    }
    let not_a_number = br#"{"camera": "demo", "target": "wing-six", "pixel_sigma": NaN}"#.to_vec();
    station.post_bytes("/v1/targets/assessment", "application/json", not_a_number).await.assert_problem(400);
    // The path is taken: no target of that name.
    station.get("/v1/targets/assessment").await.assert_problem(405);
    assert_eq!(station.get("/healthz").await.status, 200);
}
