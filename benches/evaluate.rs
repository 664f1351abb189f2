//! What a study costs, by the program as it is built.
//!
//! - `thesis-2012`: computing time of 3 solvers on 100 cases, the median of several runs, figures and their intervals included.
//! - threads: wall time of EPnP with refinement on many cases (a million, or the number given), one thread against two.
//! - memory: the largest resident size over the number of cases, tenfold twice.
//!
//!     cargo bench --bench evaluate [-- CASES]

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark that does not come out as planned must stop, and shows its figures"
)]

use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

const RUNS: usize = 15;

/// Wall time, largest resident size in MB, and the figures.
fn evaluate(arguments: &[&str]) -> (f64, f64, Value) {
    let file = std::env::temp_dir().join(format!("skypose-bench-{}.json", std::process::id()));
    let start = Instant::now();
    let mut child = Command::new(env!("CARGO_BIN_EXE_skypose"))
        .arg("evaluate")
        .args(arguments)
        .arg("--json")
        .arg(&file)
        .stdout(Stdio::null())
        .spawn()
        .expect("starts");
    let mut largest_mb = 0.0_f64;
    let status = format!("/proc/{}/status", child.id());
    while child.try_wait().expect("is ours").is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kb: Option<f64> = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
        largest_mb = largest_mb.max(kb.unwrap_or(0.0) / 1024.0);
        std::thread::sleep(Duration::from_millis(2));
    }
    let taken_s = start.elapsed().as_secs_f64();
    let figures = serde_json::from_slice(&std::fs::read(&file).expect("was written")).expect("JSON");
    let _ = std::fs::remove_file(&file);
    (taken_s, largest_mb, figures)
}

fn main() {
    let cases = std::env::args().skip(1).find_map(|text| text.parse::<u64>().ok()).unwrap_or(1_000_000);
    let mut computing_ms: Vec<f64> = (0..RUNS)
        .map(|_| {
            let (_, _, figures) = evaluate(&["thesis-2012", "--threads", "1"]);
            figures["timing"]["computing_s"].as_f64().expect("a number") * 1e3
        })
        .collect();
    computing_ms.sort_by(f64::total_cmp);
    println!("thesis-2012, 3 solvers x 100 runs: {:.1} ms of computing (median of {RUNS})", computing_ms[RUNS / 2]);
    let study = |cases: u64, threads: &str| {
        evaluate(&["thesis-2012", "--solvers", "epnp+refine", "--runs", &cases.to_string(), "--threads", threads])
    };
    println!("\n{:>10} cases {:>9} {:>10} {:>12}", "EPnP+refine", "threads", "s", "largest MB");
    for count in [cases / 100, cases / 10] {
        let (taken_s, largest_mb, _) = study(count, "2");
        println!("{count:>16} {:>9} {taken_s:>10.2} {largest_mb:>12.1}", 2);
    }
    let (one_s, one_mb, one) = study(cases, "1");
    println!("{cases:>16} {:>9} {one_s:>10.2} {one_mb:>12.1}", 1);
    let (two_s, two_mb, two) = study(cases, "2");
    println!("{cases:>16} {:>9} {two_s:>10.2} {two_mb:>12.1}", 2);
    assert_eq!(one["solvers"], two["solvers"], "the figures depend on the number of threads");
    println!("\ntwo threads are {:.2} times as fast as one; the figures are the same to the last digit", one_s / two_s);
}
