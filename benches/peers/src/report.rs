//! The tables.

use skypose::scene::verdict::{
    Figures, MAX_GOOD_ROTATION_DEG, MAX_GOOD_TRANSLATION_RATIO, MAX_SHARP_RANGE_RATIO, MAX_SHARP_ROTATION_DEG, Verdict,
};

use crate::method::{All, Results};
use crate::study::{COUNTS, Layout, Purpose, Study};

/// Ours, and theirs for the same job.
const RIVALS: [(&str, &str); 17] = [
    ("Skypose ippe", "OpenCV IPPE"),
    ("Skypose epnp", "OpenCV EPNP"),
    ("Skypose epnp", "kornia EPnP"),
    ("Skypose sqpnp", "OpenCV SQPNP"),
    ("Skypose p3p", "PoseLib p3p"),
    ("Skypose p3p", "kornia AP3P"),
    ("Skypose p3p, others choose", "OpenCV AP3P"),
    ("Skypose refine", "OpenCV RefineLM"),
    ("Skypose refine", "PoseLib refine"),
    ("Skypose refine", "kornia LM"),
    ("Skypose estimate_pose", "OpenCV ITERATIVE"),
    ("Skypose estimate_pose", "OpenCV IPPE + LM"),
    ("Skypose estimate_pose", "OpenCV SQPNP + LM"),
    ("Skypose estimate_pose", "PoseLib estimate"),
    ("Skypose estimate_pose_robustly", "OpenCV Ransac AP3P + LM"),
    ("Skypose estimate_pose_robustly", "PoseLib estimate"),
    ("Skypose estimate_pose_robustly", "kornia RANSAC + LM"),
];

/// The rest of a title, and what stands in the column of a layout's study.
type Cell<'a> = dyn Fn(&str) -> Option<f64> + 'a;

/// All tables, as Markdown.
pub fn print(studies: &[Study], all: &All, versions: &[String], rounds: usize) {
    let unit = all["plane 6"].get("OpenCV IPPE").map(|results| results.time_us);
    let with =
        if versions.is_empty() { "kornia-3d alone".to_owned() } else { format!("kornia-3d, {}", versions.join(", ")) };
    println!("Against {with}; {rounds} rounds.\n");

    println!("### Time\n");
    match unit {
        Some(us) => println!("In units of OpenCV's IPPE of six points, here {us:.1} us.\n"),
        None => println!("In us.\n"),
    }
    layout_header("method");
    for method in names(all) {
        layout_row(&method, 3, &|study| Some(all.get(study)?.get(&method)?.time_us / unit.unwrap_or(1.0)));
    }

    println!("\n### Our time over theirs\n");
    layout_header("ours / theirs");
    for (ours, theirs) in RIVALS {
        let of = |study: &str, method: &str| Some(all.get(study)?.get(method)?.time_us);
        layout_row(&format!("{ours} / {theirs}"), 2, &|study| Some(of(study, ours)? / of(study, theirs)?));
    }

    println!("\n### Accuracy\n");
    println!(
        "Good: within {MAX_GOOD_ROTATION_DEG} degrees and {:.0} % of the range. Flip: more than {MAX_GOOD_ROTATION_DEG} degrees.\n\
         Over the bound: sqrt(mean(e' C^-1 e) / 6) with the Cramer-Rao bound C of the right pairs at the truth, over answers\n\
         that are no flips, where the bound is sharp (rotation below {MAX_SHARP_ROTATION_DEG} degrees, range below {:.0} %).\n",
        100.0 * MAX_GOOD_TRANSLATION_RATIO,
        100.0 * MAX_SHARP_RANGE_RATIO
    );
    for study in studies {
        if let Purpose::Accuracy(protocol) = study.purpose {
            let sharp = study.tasks.iter().filter(|task| task.bound.is_some()).count();
            println!(
                "`{}`: {}; {} trials, the bound sharp in {sharp}.\n",
                study.name,
                protocol.definition(),
                study.tasks.len()
            );
            accuracy(study, all, unit);
        }
    }
}

/// Every method by name; the makers' names put ours last.
fn names(all: &All) -> Vec<String> {
    let mut names: Vec<String> = all.values().flat_map(|methods| methods.keys().cloned()).collect();
    names.sort();
    names.dedup();
    names
}

fn layout_header(first: &str) {
    let columns = || Layout::ALL.into_iter().flat_map(|layout| COUNTS.map(|count| (layout, count)));
    let titles: Vec<String> = columns().map(|(layout, count)| format!(" {} {count} |", layout.name())).collect();
    println!("| {first} |{}", titles.concat());
    println!("| --- |{}", columns().map(|_| " ---: |").collect::<String>());
}

/// Nothing for a method that takes none of the layouts.
fn layout_row(name: &str, digits: usize, cell: &Cell<'_>) {
    let columns = Layout::ALL.into_iter().flat_map(|layout| COUNTS.map(|count| format!("{} {count}", layout.name())));
    let cells: Vec<Option<f64>> = columns.map(|study| cell(&study)).collect();
    if cells.iter().any(Option::is_some) {
        let text = |cell: &Option<f64>| cell.map_or_else(|| " |".to_owned(), |value| format!(" {value:.digits$} |"));
        println!("| {name} |{}", cells.iter().map(text).collect::<String>());
    }
}

fn accuracy(study: &Study, all: &All, unit: Option<f64>) {
    let time = if unit.is_some() { "time / IPPE" } else { "time, us" };
    println!("| method | {time} | good % | flip % | rotation, deg | range, % | over the bound |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: |");
    for (method, results) in &all[&study.name] {
        let figures = figures(study, results);
        println!(
            "| {method} | {:.2} | {:.1} | {:.1} | {:.2} | {:.2} | {} |",
            results.time_us / unit.unwrap_or(1.0),
            100.0 * figures.good_ratio,
            100.0 * figures.flip_ratio,
            figures.median_rotation_deg,
            100.0 * figures.median_range_ratio,
            over_bound(figures.over_bound_ratio),
        );
    }
    println!();
}

/// A single answer that is wrong altogether, though turned the right way, decides the larger ones; their size says nothing.
fn over_bound(ratio: f64) -> String {
    if ratio > 100.0 { "> 100".to_owned() } else { format!("{ratio:.2}") }
}

fn figures(study: &Study, results: &Results) -> Figures {
    let answers = study.tasks.iter().zip(&results.answers);
    let verdicts: Vec<Option<Verdict>> = answers
        .map(|(task, answer)| answer.as_ref().map(|answer| Verdict::of(&task.trial, task.bound.as_ref(), answer)))
        .collect();
    Figures::of(&verdicts)
}
