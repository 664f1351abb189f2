//! The committed API document is the one that the code generates.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::path::Path;

#[test]
fn the_committed_document_is_the_generated_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/openapi.json");
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let generated = skypose::shell::http::openapi().to_pretty_json().expect("JSON");
    assert!(
        committed.trim() == generated.trim(),
        "api/openapi.json has drifted from the code: cargo run -- openapi > api/openapi.json, and look at the difference"
    );
}

/// What a document refers to.
#[cfg(feature = "zenoh")]
fn references<'a>(value: &'a serde_json::Value, found: &mut Vec<&'a str>) {
    match value {
        serde_json::Value::Object(map) => {
            found.extend(map.get("$ref").and_then(serde_json::Value::as_str));
            map.values().for_each(|inside| references(inside, found));
        }
        serde_json::Value::Array(list) => list.iter().for_each(|inside| references(inside, found)),
        _ => {}
    }
}

#[cfg(feature = "zenoh")]
#[test]
fn the_committed_document_of_the_network_is_the_generated_one_and_refers_to_what_there_is() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("api/asyncapi.yaml");
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let generated = skypose::shell::bus::asyncapi::document();
    assert!(
        committed.trim() == generated.trim(),
        "api/asyncapi.yaml has drifted from the code: cargo run -- asyncapi > api/asyncapi.yaml, and look at the difference"
    );
    let own = skypose::shell::bus::asyncapi::value();
    let http = serde_json::to_value(skypose::shell::http::openapi()).expect("JSON");
    let mut found = Vec::new();
    references(&own, &mut found);
    assert!(found.len() > 30, "{found:?}");
    for reference in found {
        let (document, pointer) = match reference.strip_prefix("./openapi.json#") {
            Some(pointer) => (&http, pointer),
            None => (&own, reference.trim_start_matches('#')),
        };
        assert!(document.pointer(pointer).is_some(), "{reference} is nowhere");
    }
}
