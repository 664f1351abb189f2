//! The import law: who may know whom, and who may touch the world.
//!
//! Words know only words; flow rooms know words and the flow rooms before them; workshops know words and flow; the shell
//! knows all. Clocks, files, sockets and the libraries that stand for them are the shell's alone.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms from the inside out; a room knows itself, the rooms above it in its own group as far as `GROUPS` says, and all
/// groups before.
const WORDS: [&str; 7] = ["geometry", "camera", "target", "board", "frame", "random", "statistics"];
const FLOW: [&str; 8] = ["detect", "solve", "refine", "pose", "identify", "track", "swarm", "pipeline"];
const WORKSHOPS: [&str; 7] = ["scene", "annotate", "assess", "plot", "encounter", "calibrate", "evaluate"];
/// Workshops that are built on others.
const BUILT_ON: [(&str, &[&str]); 2] = [("evaluate", &["scene", "plot"]), ("encounter", &["assess", "plot"])];
const SHELL: [&str; 1] = ["shell"];

/// What only the shell may name.
const WORLD: [&str; 19] = [
    "std::fs",
    "std::net",
    "std::io::stdout",
    "std::io::stderr",
    "std::time::Instant",
    "std::time::SystemTime",
    "std::thread",
    "std::process",
    "std::env",
    "tokio",
    "axum",
    "sqlx",
    "zenoh",
    "reqwest",
    "serde",
    "tracing",
    "metrics",
    "clap",
    "println!",
];

/// Exceptions, each with its reason.
const EXCEPTIONS: [(&str, &str, &str); 12] = [
    ("annotate/tests.rs", "scene", "drawings are held against rendered frames"),
    ("calibrate/estimate/tests.rs", "scene", "cameras are held against simulated sets"),
    ("calibrate/find/chessboard/tests.rs", "scene", "corners are held against rendered frames"),
    ("calibrate/find/views.rs", "scene", "what is found of boards is held against rendered frames, in tests only"),
    ("swarm/tests/drawn.rs", "println!", "a test shows its figures"),
    ("swarm/tests/flights.rs", "scene", "fused poses are held against simulated flights"),
    ("swarm/tests/flights.rs", "println!", "a test shows its figures"),
    ("swarm/tests/moments.rs", "scene", "fused poses are held against simulated flights"),
    ("swarm/tests/moments.rs", "println!", "a test shows its figures"),
    ("track/tests/flights.rs", "scene", "tracks are held against simulated flights"),
    ("track/tests/consistency.rs", "scene", "tracks are held against simulated flights"),
    ("track/tests/consistency.rs", "println!", "a test shows its figures"),
];

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// Room of a file: its first part under `src`.
fn room_of(path: &Path) -> String {
    let inside = path.strip_prefix(source()).expect("under src");
    let first = inside.components().next().expect("a name").as_os_str().to_string_lossy();
    first.trim_end_matches(".rs").to_owned()
}

fn known_to(room: &str) -> Option<Vec<&'static str>> {
    let mut known: Vec<&str> = WORDS.to_vec();
    if WORDS.contains(&room) {
        return Some(known);
    }
    if let Some(place) = FLOW.iter().position(|flow| *flow == room) {
        known.extend(&FLOW[..=place]);
        return Some(known);
    }
    known.extend(FLOW);
    if let Some(workshop) = WORKSHOPS.iter().find(|workshop| **workshop == room) {
        known.push(workshop);
        known.extend(BUILT_ON.iter().filter(|(of, _)| *of == room).flat_map(|(_, tools)| *tools));
        return Some(known);
    }
    known.extend(WORKSHOPS);
    known.extend(SHELL);
    SHELL.contains(&room).then_some(known)
}

/// The lines of a file without comments, up to its unit tests, which may use a door to make their truth.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let tests_at = text.find("#[cfg(test)]").unwrap_or(text.len());
    text[..tests_at].lines().enumerate().filter_map(|(number, line)| {
        let line = line.split("//").next().unwrap_or_default();
        (!line.trim().is_empty()).then_some((number + 1, line))
    })
}

/// Every `crate::room` in a line.
fn rooms_named(line: &str) -> Vec<String> {
    line.match_indices("crate::")
        .filter(|(at, _)| !line[..*at].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == '$'))
        .flat_map(|(at, word)| {
            let rest = &line[at + word.len()..];
            let list = rest.strip_prefix('{').map_or(rest, |list| list.split('}').next().unwrap_or_default());
            let parts: Vec<&str> = if rest.starts_with('{') { list.split(',').collect() } else { vec![list] };
            parts
                .into_iter()
                .map(|part| {
                    part.trim()
                        .split(|c: char| !(c.is_alphanumeric() || c == '_'))
                        .next()
                        .unwrap_or_default()
                        .to_owned()
                })
                .collect::<Vec<_>>()
        })
        .filter(|room| !room.is_empty())
        .collect()
}

fn broken_laws(path: &Path, text: &str) -> Vec<String> {
    let room = room_of(path);
    if room == "lib" || room == "main" {
        return Vec::new();
    }
    let shown = path.strip_prefix(source()).expect("under src").display().to_string();
    let Some(known) = known_to(&room) else {
        return vec![format!("{shown}: the room {room} stands in no group of tests/house.rs")];
    };
    let excused = |what: &str| EXCEPTIONS.iter().any(|(file, word, _)| *file == shown && *word == what);
    let mut broken = Vec::new();
    for (number, line) in code(text) {
        for named in rooms_named(line) {
            if !known.contains(&named.as_str()) && !excused(&named) {
                broken.push(format!("{shown}:{number}: {room} must not know {named}"));
            }
        }
        if room != "shell" {
            for word in WORLD.iter().filter(|word| names_world(line, word)) {
                if !excused(word) {
                    broken.push(format!("{shown}:{number}: only the shell touches {word}"));
                }
            }
        }
        // The doors never know each other.
        if shown.starts_with("shell/http") && line.contains("shell::bus")
            || shown.starts_with("shell/bus") && line.contains("shell::http")
        {
            broken.push(format!("{shown}:{number}: http and bus never know each other"));
        }
    }
    broken
}

fn names_world(line: &str, word: &str) -> bool {
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        let is_part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
        // A crate is named at the start of a path.
        !is_part(before)
            && !is_part(after)
            && (word.contains("::") || word.ends_with('!') || line[at + word.len()..].starts_with("::"))
    })
}

#[test]
fn every_file_keeps_the_import_law() {
    let mut files = Vec::new();
    rust_files(&source(), &mut files);
    assert!(files.len() > 40, "the source was found");
    let broken: Vec<String> =
        files.iter().flat_map(|path| broken_laws(path, &fs::read_to_string(path).expect("a text"))).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_law_bites() {
    let at = |file: &str| source().join(file);
    let breaks = |file: &str, line: &str| !broken_laws(&at(file), line).is_empty();
    assert!(breaks("geometry/point.rs", "use crate::detect::Centroid;"));
    assert!(breaks("detect/color.rs", "use crate::pose::PoseOptions;"));
    assert!(breaks("solve/p3p.rs", "use crate::{geometry::Point, identify::Blob};"));
    assert!(breaks("scene/render.rs", "let now = std::time::Instant::now();"));
    assert!(breaks("refine.rs", "use serde::Serialize;"));
    assert!(breaks("cupboard.rs", "fn nothing() {}"));
    assert!(breaks("shell/bus/frames.rs", "use crate::shell::http::App;"));
    assert!(!breaks("pipeline.rs", "use crate::identify::Blob;"));
    assert!(!breaks("shell/http.rs", "use crate::pipeline::Options; use tokio::sync::Semaphore;"));
    assert!(!breaks("pose.rs", "// as std::fs does\n#[cfg(test)]\nmod tests { use crate::scene::cases; }"));
}

#[test]
fn there_are_no_cupboards() {
    let mut files = Vec::new();
    rust_files(&source(), &mut files);
    for path in files {
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        assert!(
            !["utils", "util", "common", "helpers", "helper", "manager", "misc", "mod"].contains(&name.as_str()),
            "{} says nothing about what is in it",
            path.display()
        );
    }
}
