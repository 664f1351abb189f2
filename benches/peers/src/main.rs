//! Skypose's solvers against those of others: the same cases, one run, round by round in turn.
//!
//!     cargo run --release --manifest-path benches/peers/Cargo.toml [-- TRIALS ROUNDS]
//!
//! kornia-3d is compiled in. OpenCV and PoseLib run beside, as their wheels of `PyPI`, if `python3` has them. What it prints is
//! Markdown.

mod kornia;
mod method;
mod ours;
mod python;
mod report;
mod stopwatch;
mod study;

use method::{All, Method};
use python::Python;
use skypose::scene::protocols::Protocol;
use stopwatch::Times;
use study::{COUNTS, Layout, Study};

/// Trials of a protocol, unless told otherwise: shares are then good to a point or so, their differences to less.
const TRIALS: u64 = 1000;

/// Rounds, unless told otherwise.
const ROUNDS: usize = 3;

/// Trials of a layout.
const LAYOUT_TRIALS: u64 = 50;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse().expect("TRIALS and ROUNDS are numbers"));
    let trials = arguments.next().unwrap_or(TRIALS);
    let rounds = arguments.next().map_or(ROUNDS, |rounds| usize::try_from(rounds).expect("a small number"));

    let layouts = Layout::ALL.into_iter().flat_map(|layout| COUNTS.map(|count| (layout, count)));
    let studies: Vec<Study> = (Protocol::ALL.into_iter().map(|protocol| Study::of_protocol(protocol, trials)))
        .chain(layouts.map(|(layout, count)| Study::of_layout(layout, count, LAYOUT_TRIALS)))
        .collect();
    let methods: Vec<&Method> = ours::METHODS.iter().chain(&kornia::METHODS).collect();

    let mut python = Python::start(&studies).map_err(|missing| eprintln!("{missing}")).ok();
    let versions = python.as_ref().map(|python| {
        let name = |package: &str, version: &Option<String>| version.as_ref().map(|v| format!("{package} {v}"));
        [name("OpenCV", &python.versions.opencv), name("PoseLib", &python.versions.poselib)]
    });
    let mut times = Times::default();
    for round in 1..=rounds {
        eprintln!("round {round} of {rounds}");
        for study in &studies {
            times.round(study, &methods);
            if let Some(python) = &mut python {
                python.round(study).expect("peers.py answers");
            }
        }
    }

    let mut all: All = python.map(|python| python.results().expect("peers.py gives its results")).unwrap_or_default();
    for study in &studies {
        let results = methods.iter().filter_map(|m| times.results(study, m).map(|r| (m.name.to_owned(), r)));
        all.entry(study.name.clone()).or_default().extend(results);
    }
    let versions: Vec<String> = versions.into_iter().flatten().flatten().collect();
    report::print(&studies, &all, &versions, rounds);
}
