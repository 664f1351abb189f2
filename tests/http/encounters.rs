//! How early another aircraft must be seen, asked over HTTP.

use std::f64::consts::FRAC_PI_2;

use reqwest::StatusCode;
use serde_json::{Value, json};

use crate::station::Station;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

#[tokio::test]
async fn the_thesis_scenarios_are_answered() {
    let station = Station::start().await;
    for (bank_deg, arc_s, parabola_s) in
        [(20.0_f64, 9.57, 9.24), (30.0, 7.75, 7.34), (45.0, 6.25, 5.58), (60.0, 5.38, 4.24)]
    {
        for (turn, expected_s) in [("arc", arc_s), ("parabolic", parabola_s)] {
            let ask = json!({"scenario": "head-on", "own_speed_mps": 25.7222, "intruder_speed_mps": 25.7222,
                             "bank_rad": bank_deg.to_radians(), "miss_distance_m": 152.4, "turn": turn});
            let reply = station.post("/v1/encounters", &ask).await;
            assert_eq!(reply.status, StatusCode::OK, "{reply:?}");
            let reply = reply.json;
            assert!((number(&reply["time_to_avoid_s"]) - expected_s).abs() < 0.02, "{ask}: {reply}");
            assert!((number(&reply["closing_speed_mps"]) - 51.444).abs() < 1e-3);
            let distance_m = number(&reply["distance_to_avoid_m"]);
            assert!((distance_m - 51.4444 * number(&reply["time_to_avoid_s"])).abs() < 0.01);
            let width_rad = 2.0 * (0.7 / distance_m).atan();
            assert!((number(&reply["arc_width_rad"]) / width_rad - 1.0).abs() < 1e-9);
            assert_eq!(
                (&reply["turn"], &reply["reason"], &reply["in_time"]),
                (&json!(turn), &Value::Null, &json!(true))
            );
        }
    }
    let crossing = station.post("/v1/encounters", &json!({"scenario": "crossing", "id": "c"})).await.json;
    assert!((number(&crossing["closing_speed_mps"]) - 36.4).abs() < 0.03 && crossing["id"] == "c");
    assert!((number(&crossing["azimuth_rad"]) - std::f64::consts::FRAC_PI_4).abs() < 1e-9);
    let default = station.post("/v1/encounters", &json!({})).await.json;
    assert!((number(&default["time_to_avoid_s"]) - 6.25).abs() < 0.02, "{default}");
    assert!(default.get("figures").is_none() && default["view"].is_null());
}

#[tokio::test]
async fn a_stored_camera_and_target_say_what_can_be_seen() {
    let station = Station::equipped().await;
    let ask = json!({"scenario": "head-on", "camera": "demo", "target": "wing-six", "target_width_m": 3.0, "figures": true,
                     "delays": {"detection_s": 0.2, "track_s": 0.5, "link_s": 0.1, "decision_s": 1.2}});
    let reply = station.post("/v1/encounters", &ask).await.json;
    assert!((number(&reply["time_to_detect_s"]) - number(&reply["time_to_avoid_s"]) - 2.0).abs() < 1e-9);
    assert!((number(&reply["delays_s"]) - 2.0).abs() < 1e-12);
    let view = &reply["view"];
    assert_eq!(view["in_picture"], true);
    assert!((number(&view["distance_m"]) - number(&reply["distance_to_detect_m"])).abs() < 1e-6);
    let tasks: Vec<&str> =
        view["tasks"].as_array().expect("tasks").iter().filter_map(|task| task["task"].as_str()).collect();
    assert_eq!(tasks, ["detection", "classification", "marker_detection", "identification", "pose"]);
    for task in view["tasks"].as_array().expect("tasks") {
        assert_eq!(task["feasible"].as_bool(), Some(false), "at 400 m: {task}");
        assert!(number(&task["needed"]) > 0.0);
    }
    let guidance = view["field_of_regard"]["guidance"].as_array().expect("three");
    assert_eq!(guidance.len(), 3);
    assert!(guidance.iter().all(|one| (0.0..=1.0).contains(&number(&one["covered_ratio"]))), "{guidance:?}");
    let drawn = reply["figures"].as_object().expect("pictures");
    assert_eq!(drawn.keys().collect::<Vec<_>>(), ["bank", "coverage", "pixels", "speed"]);
    assert!(drawn.values().all(|svg| svg.as_str().is_some_and(|svg| svg.starts_with("<svg"))));
    // Near by its pose is known, with its covariance.
    let near = json!({"relative": {"position_m": [5, 0, 0], "velocity_mps": [0, 0, 0]}, "camera": "demo", "target": "wing-six"});
    let near = station.post("/v1/encounters", &near).await.json;
    assert_eq!(near["reason"], "inside_miss_distance");
    let feasible = |task: &Value| task["feasible"] == true;
    assert!(near["view"]["tasks"].as_array().expect("tasks").iter().all(feasible), "{near}");
    assert_eq!(near["view"]["expected"]["covariance"].as_array().expect("six rows").len(), 6);
}

#[tokio::test]
async fn where_there_is_no_turn_the_reply_says_why_and_has_no_number() {
    let station = Station::start().await;
    let cases = [
        (json!({"intruder_course_rad": 0}), "never_closing"),
        (json!({"relative": {"position_m": [500, 0, 0], "velocity_mps": [10, 0, 0]}}), "never_closing"),
        (json!({"range_m": 152.4}), "inside_miss_distance"),
        (json!({"scenario": "crossing", "range_m": 20}), "inside_miss_distance"),
        (json!({"relative": {"position_m": [900, 200, 0], "velocity_mps": [-50, 0, 0]}}), "not_needed"),
        (
            json!({"own_speed_mps": 30, "intruder_speed_mps": 47.434_164_902_525_69,
                   "intruder_course_rad": -1.892_546_881_191_539, "side": "left"}),
            "miss_distance_unreachable",
        ),
    ];
    for (ask, reason) in cases {
        let reply = station.post("/v1/encounters", &ask).await;
        assert_eq!(reply.status, StatusCode::OK, "{ask}: {reply:?}");
        let reply = reply.json;
        assert_eq!(reply["reason"], reason, "{ask}: {reply}");
        assert!(reply["detail"].as_str().is_some_and(|detail| !detail.is_empty()));
        for name in
            ["time_to_avoid_s", "distance_to_avoid_m", "time_to_detect_s", "arc_width_rad", "time_left_s", "in_time"]
        {
            assert!(reply[name].is_null(), "{ask}: {name} in {reply}");
        }
        assert!(number(&reply["closing_speed_mps"]).is_finite());
    }
    // Too late is no lack of an answer.
    let late = station.post("/v1/encounters", &json!({"range_m": 200})).await.json;
    assert!(late["in_time"] == false && number(&late["time_left_s"]) < 0.0, "{late}");
}

#[tokio::test]
async fn what_makes_no_sense_is_refused_with_its_place() {
    let station = Station::equipped().await;
    let lens = json!({"width": 640, "height": 480, "fx": -600, "fy": 600, "cx": 320, "cy": 240});
    let mut cases = vec![
        (json!({"bank_rad": FRAC_PI_2}), 422, "/bank_rad"),
        (json!({"bank_rad": 2}), 422, "/bank_rad"),
        (json!({"bank_rad": 0}), 422, "/bank_rad"),
        (json!({"bank_rad": -0.5}), 422, "/bank_rad"),
        (json!({"max_turn_rad": 0}), 422, "/max_turn_rad"),
        (json!({"max_turn_rad": 4}), 422, "/max_turn_rad"),
        (json!({"intruder_course_rad": 100}), 422, "/intruder_course_rad"),
        (json!({"scenario": "head-on", "intruder_course_rad": 1}), 422, "/intruder_course_rad"),
        (json!({"scenario": "sideways"}), 422, "/scenario"),
        (json!({"turn": "square"}), 422, "/turn"),
        (json!({"side": "up"}), 422, "/side"),
        (json!({"roll_rate_radps": 1, "roll_in_s": 1}), 422, "/roll_in_s"),
        (json!({"roll_in_s": -1}), 422, "/roll_in_s"),
        (json!({"delays": {"link_s": -0.1}}), 422, "/delays/link_s"),
        (json!({"delays": {"lunch_s": 1}}), 422, "/delays/lunch_s"),
        (json!({"airspace": {"width_m": 0}}), 422, "/airspace/width_m"),
        (json!({"camera": "nobody"}), 404, "/camera"),
        (json!({"camera": lens}), 422, "/camera/fx"),
        (json!({"camera": "demo", "camera_azimuth_rad": 4}), 422, "/camera_azimuth_rad"),
        (json!({"camera_elevation_rad": 0.1}), 422, "/camera_elevation_rad"),
        (json!({"target": "wing-six"}), 422, "/target"),
        (json!({"camera": "demo", "target": "nothing"}), 404, "/target"),
        (json!({"aspect_rad": 4}), 422, "/aspect_rad"),
        (json!({"pixel_sigma": 0}), 422, "/pixel_sigma"),
        (json!({"relative": {"position_m": [0, 0, 0], "velocity_mps": [1, 0, 0]}}), 422, "/relative/position_m"),
        (json!({"relative": {"position_m": [1, 0, 1e300], "velocity_mps": [1, 0, 0]}}), 422, "/relative/position_m/2"),
        (json!({"relative": {"position_m": [9, 0, 0], "velocity_mps": [1, 0, 0]}, "range_m": 5}), 422, "/range_m"),
        (
            json!({"relative": {"position_m": [9, 0, 0], "velocity_mps": [1, 0, 0]}, "scenario": "crossing"}),
            422,
            "/scenario",
        ),
    ];
    for field in [
        "own_speed_mps",
        "intruder_speed_mps",
        "range_m",
        "miss_distance_m",
        "roll_rate_radps",
        "target_width_m",
        "target_height_m",
    ] {
        for value in [json!(0), json!(-3.5), json!(1e300), json!("fast")] {
            cases.push((json!({field: value}), 422, Box::leak(format!("/{field}").into_boxed_str())));
        }
    }
    for (ask, status, pointer) in cases {
        let reply = station.post("/v1/encounters", &ask).await;
        assert_eq!(reply.assert_problem(status).pointer(), pointer, "{ask}");
    }
    let not_a_number = br#"{"own_speed_mps": NaN}"#.to_vec();
    station.post_bytes("/v1/encounters", "application/json", not_a_number).await.assert_problem(400);
    station.get("/v1/encounters").await.assert_problem(405);
}

#[tokio::test]
async fn extremes_have_finite_answers() {
    let station = Station::start().await;
    for ask in [
        json!({"own_speed_mps": 1e-6, "miss_distance_m": 1e6}),
        json!({"own_speed_mps": 1e6, "intruder_speed_mps": 1e-6}),
        json!({"bank_rad": 1e-12}),
        json!({"bank_rad": FRAC_PI_2 - 1e-5}),
        json!({"max_turn_rad": 1e-9, "range_m": 1e6}),
        json!({"roll_rate_radps": 1e-6}),
        json!({"target_width_m": 1e6, "range_m": 153}),
        json!({"miss_distance_m": 1e-6, "range_m": 1e-3}),
    ] {
        let reply = station.post("/v1/encounters", &ask).await;
        assert_eq!(reply.status, StatusCode::OK, "{ask}: {reply:?}");
        let reply = reply.json;
        // A number that JSON cannot write would be null; with no reason there must be none.
        for name in ["time_to_avoid_s", "distance_to_avoid_m", "arc_width_rad", "time_left_s"] {
            assert_eq!(reply[name].is_null(), !reply["reason"].is_null(), "{ask}: {name} in {reply}");
        }
    }
}
