//! An assessment for people: tables in degrees, then sentences.

use std::fmt::Write;

use crate::assess::{Assessment, Cell, Reach};
use crate::camera::Camera;
use crate::target::Target;

/// Tables stand side by side within this many letters.
const WIDTH: usize = 110;

/// Letters for the range and the extent left of each line.
const LEFT: usize = 16;

/// A quantity over range and aspect.
struct Block {
    title: &'static str,
    /// Letters for each aspect.
    column: usize,
    entry: fn(&Cell) -> String,
}

const BLOCKS: [Block; 5] = [
    Block { title: "range error, m", column: 8, entry: |cell| number(cell.range_sigma_m) },
    Block {
        title: "attitude error, deg",
        column: 7,
        entry: |cell| number(cell.attitude_error_rad.map(f64::to_degrees)),
    },
    Block { title: "bearing error, deg", column: 9, entry: |cell| number(cell.bearing_sigma_rad.map(f64::to_degrees)) },
    Block { title: "flips, %", column: 5, entry: |cell| percent(cell.flip_rate) },
    Block { title: "identified, %", column: 5, entry: |cell| percent(cell.identified_rate) },
];

/// The whole report, without a line break at its end.
pub(super) fn of(target: &Target, camera: &Camera, pixel_sigma: f64, found: &Assessment) -> String {
    let mut text = String::new();
    // Writing into a string does not fail.
    let _ = head(&mut text, target, camera, pixel_sigma, found);
    let _ = tables(&mut text, found);
    let _ = reach(&mut text, found);
    let _ = sentences(&mut text, found);
    text.trim_end().to_owned()
}

fn head(text: &mut String, target: &Target, camera: &Camera, pixel_sigma: f64, found: &Assessment) -> std::fmt::Result {
    let [x, y, z] = found.front.map(|c| if c.abs() < 5e-3 { 0.0 } else { c }).into();
    writeln!(
        text,
        "{}: {} markers before a camera of {} x {} px, centroids to {pixel_sigma} px.",
        target.name(),
        target.markers().len(),
        camera.width(),
        camera.height()
    )?;
    writeln!(
        text,
        "Aspect is the angle between the line of sight and the front, ({x:.2}, {y:.2}, {z:.2}) in the target frame."
    )?;
    let errors = format!(
        "Errors are root mean square. In range and bearing they are the least that is possible (Cramer-Rao); attitude and \
         rates are of {} simulated noises, attitude of the right one of two poses.",
        found.draws
    );
    text.push_str(&wrapped("", &errors));
    Ok(())
}

/// Blocks side by side as far as they fit, then below.
fn tables(text: &mut String, found: &Assessment) -> std::fmt::Result {
    let width = |block: &Block| block.column * found.aspects_rad.len() + 2;
    let mut rest = &BLOCKS[..];
    while !rest.is_empty() {
        let mut used = LEFT;
        let fitting = rest.iter().take_while(|block| {
            used += width(block);
            used <= WIDTH
        });
        let (row, below) = rest.split_at(fitting.count().max(1));
        table(text, found, row, &width)?;
        rest = below;
    }
    Ok(())
}

fn table(text: &mut String, found: &Assessment, blocks: &[Block], width: &dyn Fn(&Block) -> usize) -> std::fmt::Result {
    let mut titles = format!("\n{:LEFT$}", "");
    let mut aspects = format!("{:>7} m{:>4} px", "range", "");
    for block in blocks {
        let _ = write!(titles, "  {:^1$}", block.title, width(block) - 2);
        aspects.push_str("  ");
        for aspect in &found.aspects_rad {
            let _ = write!(aspects, "{:>1$}", format!("{:.0}°", aspect.to_degrees()), block.column);
        }
    }
    writeln!(text, "{}", titles.trim_end())?;
    writeln!(text, "{aspects}")?;
    for (index, range_m) in found.ranges_m.iter().enumerate() {
        let face_on = found.cells.first().and_then(|row| row.get(index));
        let extent_px = face_on.map_or(0.0, |cell| cell.extent_px);
        write!(text, "{:>9}{extent_px:>7.0}", number(Some(*range_m)))?;
        for block in blocks {
            text.push_str("  ");
            for row in &found.cells {
                let entry = row.get(index).map_or_else(String::new, block.entry);
                write!(text, "{entry:>0$}", block.column)?;
            }
        }
        text.push('\n');
    }
    Ok(())
}

/// The range to which a target serves for something.
type RangeOf = fn(&Reach) -> Option<f64>;

fn reach(text: &mut String, found: &Assessment) -> std::fmt::Result {
    writeln!(text, "\nIt serves up to a range of")?;
    write!(text, "{:>38}", "")?;
    for aspect in &found.aspects_rad {
        write!(text, "{:>8}", format!("{:.0}°", aspect.to_degrees()))?;
    }
    writeln!(text, "{:>8}", "mean")?;
    let lines: [(&str, RangeOf); 4] = [
        ("markers found by colour, m", |reach| reach.detected_m),
        ("markers told apart (9 of 10), m", |reach| reach.identified_m),
        ("not the wrong pose (19 of 20), m", |reach| reach.unambiguous_m),
        ("attitude error within 5 deg, m", |reach| reach.attitude_m),
    ];
    for (title, of) in lines {
        write!(text, "    {title:<34}")?;
        for reach in found.reach.iter().chain([&found.mean_reach]) {
            write!(text, "{:>8}", number(of(reach)))?;
        }
        text.push('\n');
    }
    Ok(())
}

fn sentences(text: &mut String, found: &Assessment) -> std::fmt::Result {
    let mut warnings: Vec<String> = found.warnings.iter().map(ToString::to_string).collect();
    if found.identified_draws == 0 {
        warnings.push("there are too many markers to simulate within a second how they are told apart".into());
    }
    writeln!(text, "\nWarnings")?;
    if warnings.is_empty() {
        writeln!(text, "    none")?;
    }
    for warning in &warnings {
        text.push_str(&wrapped("    - ", warning));
    }
    writeln!(text, "\nAdvice (at {} m, mean of all aspects)", number(Some(found.advice_range_m)))?;
    if found.advice.is_empty() {
        writeln!(text, "    no move of a single marker that was tried betters it")?;
    }
    for (number, advice) in found.advice.iter().enumerate() {
        text.push_str(&wrapped(&format!("    {}. ", number + 1), &advice.to_string()));
    }
    Ok(())
}

/// Lines within the width; those after the first are set in below the text of the first.
fn wrapped(head: &str, sentence: &str) -> String {
    let indent = " ".repeat(head.len());
    let mut text = String::new();
    let mut line = head.to_owned();
    let mut is_fresh = true;
    for word in sentence.split(' ') {
        if !is_fresh && line.chars().count() + 1 + word.chars().count() > WIDTH {
            text.push_str(&line);
            text.push('\n');
            line.clone_from(&indent);
            is_fresh = true;
        }
        if !is_fresh {
            line.push(' ');
        }
        line.push_str(word);
        is_fresh = false;
    }
    text + &line + "\n"
}

/// Three digits that count.
fn number(value: Option<f64>) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else { return "-".into() };
    match value.abs() {
        size if size >= 99.95 => format!("{value:.0}"),
        size if size >= 9.995 => format!("{value:.1}"),
        size if size >= 0.9995 => format!("{value:.2}"),
        size if size >= 0.09995 => format!("{value:.3}"),
        _ => format!("{value:.4}"),
    }
}

fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| "-".into(), |share| format!("{:.0}", share * 100.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sentences_are_broken_between_words_and_nowhere_else() {
        let long = "word ".repeat(60) + &"x".repeat(200);
        let text = wrapped("  - ", &long);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH || line.trim() == "x".repeat(200)), "{text}");
        assert!(text.starts_with("  - word") && text.lines().skip(1).all(|line| line.starts_with("    ")), "{text}");
        assert_eq!(text.replace("  - ", "").split_whitespace().collect::<Vec<_>>().join(" "), long);
    }

    #[test]
    fn numbers_have_the_digits_that_count() {
        let shown = [1234.5, 99.96, 12.34, 1.234, 0.1234, 0.001_234, f64::INFINITY].map(|value| number(Some(value)));
        assert_eq!(shown, ["1234", "100", "12.3", "1.23", "0.123", "0.0012", "-"]);
        assert_eq!((number(None), percent(Some(0.914)), percent(None)), ("-".into(), "91".into(), "-".into()));
    }
}
