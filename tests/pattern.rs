//! Calibration boards on paper, as people print them.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

#[path = "program/said.rs"]
mod said;

use std::fs;
use std::process::Command;

use said::Said;
use serde_json::{Value, json};
use skypose::board::Board;
use skypose::shell::wire::PatternWire;

fn pattern(arguments: &[&str]) -> Said {
    Said::of(Command::new(env!("CARGO_BIN_EXE_skypose")).arg("pattern").args(arguments).output().expect("starts"))
}

/// The first value of an attribute after a mark.
fn attribute<'a>(svg: &'a str, mark: &str, name: &str) -> &'a str {
    let after = &svg[svg.find(mark).unwrap_or_else(|| panic!("{mark} in {svg}"))..];
    let start = after.find(&format!("{name}=\"")).expect("the attribute") + name.len() + 2;
    after[start..].split('"').next().expect("its end")
}

#[test]
fn a_sheet_is_of_true_scale() {
    let said = pattern(&["chessboard:9x6:0.02"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    let svg = &said.out;
    assert_eq!(attribute(svg, "<svg", "width"), "297mm");
    assert_eq!(attribute(svg, "<svg", "height"), "210mm");
    assert_eq!(attribute(svg, "<svg", "viewBox"), "0 0 297 210", "a unit is a millimetre");
    assert_eq!(attribute(svg, "id=\"scale\"", "width"), "100");
    assert!(svg.contains(">100 mm</text>") && svg.contains(">chessboard:9x6:0.02</text>"), "{svg}");
    // 200 x 140 mm of squares in the middle of the page's width.
    assert!(attribute(svg, "<path", "d").starts_with("M48.5 "), "{svg}");
    assert!(attribute(svg, "<path", "d").contains("H68.5V"), "{svg}");
    assert_eq!(attribute(svg, "<path", "d").matches('Z').count(), 35);
}

#[test]
fn files_are_written_by_their_endings_and_always_the_same() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let said = pattern(&["aprilgrid:6x6:0.024", "--out", &path("a.svg"), "--out", &path("a.PDF"), "--paper", "letter"]);
    assert_eq!((said.code, said.out.as_str(), said.err.as_str()), (Some(0), "", ""), "{said:?}");
    let svg = fs::read_to_string(path("a.svg")).expect("written");
    assert_eq!(attribute(&svg, "<svg", "width"), "215.9mm");
    let pdf = fs::read(path("a.PDF")).expect("written");
    assert!(String::from_utf8_lossy(&pdf).contains("/MediaBox [0 0 612 792]"), "a letter is 8.5 x 11 inches");
    pattern(&["aprilgrid:6x6:0.024", "--out", &path("b.pdf"), "--paper", "letter"]);
    assert_eq!(fs::read(path("b.pdf")).expect("written"), pdf);
}

#[test]
fn what_does_not_fit_is_told_the_numbers() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("board.pdf").display().to_string();
    pattern(&["chessboard:9x6:0.025", "--paper", "a4", "--out", &out])
        .assert_complains(2, &["300.0 x 238.0 mm", "210 x 297 mm"]);
    pattern(&["chessboard:9x6:1", "--out", &out]).assert_complains(2, &["12000 x 9013 mm", "5080 mm"]);
    pattern(&["chessboard:9x6:0.02", "--out", "board.png"]).assert_complains(2, &["board.png", ".svg or .pdf"]);
    pattern(&["chessboard:9:0.02"]).assert_complains(2, &["chessboard:COLUMNSxROWS:SQUARE"]);
    pattern(&["nowhere.json"]).assert_complains(2, &["nowhere.json"]);
    assert!(!folder.path().join("board.pdf").exists(), "nothing is written where something is wrong");
}

#[test]
fn a_description_is_read_where_a_pattern_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    for text in
        ["chessboard:9x6:0.02", "asymmetric-circles:4x11:0.01", "dots:60:0.2x0.15:0.003:7", "aprilgrid:5x4:0.03"]
    {
        let drawn = pattern(&[text, "--description", &path("board.json")]).out;
        let json: Value = serde_json::from_slice(&fs::read(path("board.json")).expect("written")).expect("JSON");
        let wire: PatternWire = serde_json::from_value(json).expect("a pattern");
        assert_eq!(Board::try_from(&wire), Ok(text.parse().expect("a board")), "{text}");
        let again = pattern(&[&path("board.json")]).out;
        let pattern_of =
            |svg: &str| attribute(svg, "id=\"pattern\"", if svg.contains("<path") { "d" } else { "cx" }).to_owned();
        assert_eq!(pattern_of(&again), pattern_of(&drawn), "{text}");
    }
    // Dots that somebody else placed.
    let dots: Vec<[f64; 2]> = (0..30).map(|i| [0.01 * f64::from(i % 6), 0.011 * f64::from(i / 6)]).collect();
    let own = json!({"type": "dots", "dots_m": dots, "radius_m": 0.002});
    fs::write(path("own.json"), own.to_string()).expect("writes");
    let said = pattern(&[&path("own.json")]);
    assert_eq!((said.code, said.out.matches("<circle").count()), (Some(0), 30), "{said:?}");
    fs::write(path("bad.json"), json!({"type": "dots", "dots_m": dots, "radius_m": 0.02}).to_string()).expect("writes");
    pattern(&[&path("bad.json")]).assert_complains(2, &["bad.json", "/dots_m/1", "0.0100 m apart"]);
}
