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
