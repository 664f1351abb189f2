//! The document, its page, and its examples.

use serde_json::Value;

use crate::station::Station;

#[tokio::test]
async fn the_document_and_its_page_are_served_without_the_internet() {
    let station = Station::start().await;
    let document = station.get("/openapi.json").await.json;
    for path in [
        "/v1/poses",
        "/v1/detections",
        "/v1/estimates",
        "/v1/cameras/{name}",
        "/v1/targets",
        "/v1/targets/assessment",
        "/v1/encounters",
        "/v1/calibrations",
        "/v1/calibrations/{id}/events",
        "/healthz",
        "/metrics",
    ] {
        assert!(document["paths"][path].is_object(), "{path} is missing");
    }
    let page = |path: &str| station.http.get(format!("{}{path}", station.base)).send();
    let text = page("/docs").await.expect("an answer").text().await.expect("a text");
    assert!(text.contains("swagger-ui"));
    // Everything that the page loads comes from here.
    for part in text.split(['"', '\'']).filter(|part| [".js", ".css"].iter().any(|ending| part.ends_with(ending))) {
        assert!(!part.contains("//"), "{part} is loaded from elsewhere");
        let loaded = page(&format!("/docs/{}", part.trim_start_matches("./"))).await.expect("an answer");
        assert_eq!(loaded.status(), 200, "{part}");
    }
}

#[tokio::test]
async fn the_examples_are_what_the_service_replies() {
    let station = Station::start().await;
    for (name, text) in skypose::shell::http::docs::EXAMPLES {
        let example: Value = serde_json::from_str(text).unwrap_or_else(|error| panic!("{name}: {error}"));
        let path = example["path"].as_str().expect("a path");
        let reply = station.post(path, &example["request"]).await;
        assert_eq!(reply.status, 200, "{name}");
        assert_same(&reply.json, &example["reply"], name);
    }
}

/// Equal but for times, and for the last digits of numbers.
fn assert_same(found: &Value, expected: &Value, place: &str) {
    match (found, expected) {
        (Value::Object(found), Value::Object(expected)) => {
            let keys = |map: &serde_json::Map<String, Value>| map.keys().cloned().collect::<Vec<_>>();
            assert_eq!(keys(found), keys(expected), "{place}");
            for (key, value) in found.iter().filter(|(key, _)| *key != "elapsed_us") {
                assert_same(value, &expected[key], &format!("{place}/{key}"));
            }
        }
        (Value::Array(found), Value::Array(expected)) => {
            assert_eq!(found.len(), expected.len(), "{place}");
            for (index, (a, b)) in found.iter().zip(expected).enumerate() {
                assert_same(a, b, &format!("{place}/{index}"));
            }
        }
        (Value::Number(a), Value::Number(b)) => {
            let (a, b) = (a.as_f64().expect("a number"), b.as_f64().expect("a number"));
            assert!((a - b).abs() <= 1e-6 * (1.0 + b.abs()), "{place}: {a} is not {b}");
        }
        (found, expected) => assert_eq!(found, expected, "{place}"),
    }
}
