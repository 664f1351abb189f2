//! Pictures of a study: run by run, as shares, along a sweep, and of what answers say of themselves.

use super::figures::{Figures, MethodFigures, StepFigures};
use super::row::{ERRORS, ROTATION, TRANSLATION};
use super::shard::Shard;
use super::study::Study;
use super::tally::Tally;
use crate::plot::{Axis, Figure, Panel, Picture, Series};

/// Most runs that are drawn one by one.
const MAX_DRAWN: u64 = 500;
/// Points of a curve of shares.
const SHARES: u32 = 60;
/// A sweep over more than this ratio is drawn on a logarithmic axis.
const WIDE_RATIO: f64 = 20.0;

/// All pictures that a study has.
#[must_use]
pub fn pictures(study: &Study, sums: &Shard, figures: &Figures) -> Vec<Picture> {
    let mut found: Vec<Picture> = Vec::new();
    if study.sweep.is_some() {
        found.extend(sweep(study, figures));
    } else if let Some((step, first)) = sums.steps.first().zip(figures.steps.first()) {
        found.extend((0..study.methods.len()).filter_map(|method| runs(sums, first, method)));
        found.push(shares(study, &step.tallies));
    }
    found.extend(probability(figures));
    found
}

/// Errors and time of one method, run by run, with mean and standard deviation: the seed's figures 4.9 to 4.17.
fn runs(sums: &Shard, step: &StepFigures, method: usize) -> Option<Picture> {
    let figures = step.methods.get(method)?;
    let rows: Vec<_> =
        sums.rows.iter().filter(|row| row.method == method as u64 && row.step == 0 && row.run < MAX_DRAWN).collect();
    let last = rows.last()?.run as f64 + 1.0;
    let panel = |title: String, y: Axis, points: Vec<(f64, f64)>, mean: Option<f64>, deviation: Option<f64>| {
        let mut series = vec![scattered("one run", points)];
        if let Some(mean) = mean {
            series.push(Series::of("mean", [(1.0, mean), (last, mean)]));
            if let Some(deviation) = deviation {
                let (low, high) = (mean - deviation, mean + deviation);
                let points = vec![Some([1.0, low]), Some([last, low]), None, Some([1.0, high]), Some([last, high])];
                series.push(Series { name: "mean +- standard deviation".into(), points });
            }
        }
        Panel { title, x: Axis::linear("run"), y, series }
    };
    let mut panels: Vec<Panel> = ERRORS[..6]
        .iter()
        .enumerate()
        .map(|(which, name)| {
            let (what, unit) = name.split_once('_').unwrap_or((name, ""));
            let points = rows.iter().filter_map(|row| Some((row.run as f64 + 1.0, row.error(which)?))).collect();
            let error = &figures.errors[which];
            panel(what.into(), Axis::linear(format!("error ({unit})")), points, error.mean, error.deviation)
        })
        .collect();
    let times: Vec<(f64, f64)> =
        rows.iter().filter_map(|row| Some((row.run as f64 + 1.0, row.time_s()? * 1e6))).collect();
    let mut moments = super::moments::Moments::default();
    for (_, time) in &times {
        moments.add(*time);
    }
    panels.push(panel("time".into(), Axis::logarithmic("time (us)"), times, Some(moments.mean), moments.deviation()));
    let name = &figures.method;
    Some(Picture {
        name: format!("runs-{name}"),
        caption: format!(
            "Errors of {name} about each axis and along each, estimate minus truth, and its time, run by run."
        ),
        figure: Figure { title: name.clone(), panels },
    })
}

/// Marks without a line.
fn scattered(name: &str, points: Vec<(f64, f64)>) -> Series {
    Series { name: name.into(), points: points.into_iter().flat_map(|(x, y)| [Some([x, y]), None]).collect() }
}

/// Which share of the cases has at most which error.
fn shares(study: &Study, tallies: &[Tally]) -> Picture {
    let shares: Vec<f64> = (0..=SHARES).map(|place| f64::from(place) / f64::from(SHARES)).collect();
    let panel = |which: usize, title: &str, label: &str| {
        let series = study.methods.iter().zip(tallies).map(|(method, tally)| {
            let sizes = tally.sizes[which].at(&shares, tally.cases());
            let points = sizes.into_iter().zip(&shares).filter_map(|(size, share)| Some((size?, *share)));
            Series::of(method.to_string(), points)
        });
        let (x, y) = (Axis::logarithmic(label), Axis::share("share of all cases"));
        Panel { title: title.into(), x, y, series: series.collect() }
    };
    let panels = vec![
        panel(ROTATION, "rotation", "at most this error (deg)"),
        panel(TRANSLATION, "translation", "at most this error (m)"),
    ];
    Picture {
        name: "shares".into(),
        caption: "The share of all cases whose error is at most so large. A curve that ends below 1 stands for a method that \
            has no pose for the rest."
            .into(),
        figure: Figure { title: "Errors".into(), panels },
    }
}

/// Figures over the values of the sweep.
fn sweep(study: &Study, figures: &Figures) -> Option<Picture> {
    let sweep = study.sweep.as_ref()?;
    let (low, high) = sweep.values.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(*v), high.max(*v)));
    let label = sweep.parameter.label();
    let across = || if low > 0.0 && high / low > WIDE_RATIO { Axis::logarithmic(label) } else { Axis::linear(label) };
    let panel = |title: &str, y: Axis, of: &dyn Fn(&MethodFigures) -> Option<f64>| {
        let series = study.methods.iter().enumerate().map(|(place, method)| {
            let points = figures.steps.iter().map(|step| Some([step.value?, of(step.methods.get(place)?)?]));
            Series { name: method.to_string(), points: points.collect() }
        });
        Panel { title: title.into(), x: across(), y, series: series.collect() }
    };
    let median = |which: usize| move |method: &MethodFigures| method.errors[which].median.map(|median| median.value);
    let mut panels = vec![
        panel("median rotation error", Axis::logarithmic("deg"), &median(ROTATION)),
        panel("median translation error", Axis::logarithmic("m"), &median(TRANSLATION)),
        panel("error over the Cramer-Rao bound", Axis::logarithmic("ratio of root mean squares"), &|method| {
            method.over_bound.map(|bound| bound.value)
        }),
        panel("flips", Axis::share("share of all cases"), &|method| method.flips.ratio()),
        panel("cases with a pose", Axis::share("share of all cases"), &|method| method.posed.ratio()),
    ];
    let has_claims = |method: &MethodFigures| method.consistency.is_some();
    if figures.steps.iter().flat_map(|step| &step.methods).any(has_claims) {
        panels.push(panel("errors within the stated 95 %", Axis::share("share"), &|method| {
            method.consistency.and_then(|consistency| consistency.inside_95.ratio())
        }));
    }
    Some(Picture {
        name: "sweep".into(),
        caption: format!("The figures against {label}; the same cases at each value."),
        figure: Figure { title: String::new(), panels },
    })
}

/// Whether stated probabilities hold, over all steps of a sweep.
fn probability(figures: &Figures) -> Option<Picture> {
    let mut series: Vec<Series> = Vec::new();
    for step in &figures.steps {
        for method in step.methods.iter().filter(|method| !method.calibration.is_empty()) {
            let name = match step.value {
                Some(value) => format!("{} at {value}", method.method),
                None => method.method.clone(),
            };
            let points = method.calibration.iter().filter_map(|bin| Some((bin.stated, bin.right.ratio()?)));
            series.push(Series::of(name, points));
        }
    }
    if series.is_empty() {
        return None;
    }
    series.insert(0, Series::of("as it should be", [(0.0, 0.0), (1.0, 1.0)]));
    let panel = Panel {
        title: "probabilities".into(),
        x: Axis::share("stated probability of a pose"),
        y: Axis::share("share of such poses that are right"),
        series,
    };
    Some(Picture {
        name: "probability".into(),
        caption: "Poses by their stated probability, best ones and alternatives, and how many of them are right."
            .into(),
        figure: Figure { title: String::new(), panels: vec![panel] },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::method::Method;
    use crate::evaluate::study::{Parameter, Sweep};

    fn drawn(study: &Study) -> Vec<Picture> {
        let mut sums = Shard::default();
        for number in 0..study.shards() {
            sums.merge(Shard::run_keeping(study, number, &|| 0.0, &|| true).expect("goes on"));
        }
        pictures(study, &sums, &Figures::of(study, &sums))
    }

    #[test]
    fn the_seeds_figures_are_drawn_for_each_solver() {
        let found = drawn(&Study::thesis_2012(20, 1));
        let names: Vec<&str> = found.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["runs-epnp", "runs-posit", "runs-homography", "shares"]);
        let panels: Vec<&str> = found[0].figure.panels.iter().map(|panel| panel.title.as_str()).collect();
        assert_eq!(panels, ["roll", "pitch", "yaw", "x", "y", "z", "time"]);
        let marks = found[0].figure.panels[6].series[0].points.iter().flatten().count();
        assert_eq!(marks, 20);
    }

    #[test]
    fn a_sweep_is_drawn_against_its_values() {
        let sweep = Some(Sweep { parameter: Parameter::PixelSigmaPx, values: vec![0.1, 1.0, 4.0] });
        let found = drawn(&Study { sweep, methods: vec![Method::AUTO], ..Study::thesis_2012(20, 1) });
        let names: Vec<&str> = found.iter().map(|picture| picture.name.as_str()).collect();
        assert_eq!(names, ["sweep", "probability"]);
        let median = &found[0].figure.panels[0].series[0];
        let values: Vec<f64> = median.points.iter().flatten().map(|point| point[0]).collect();
        assert_eq!(values, [0.1, 1.0, 4.0]);
    }
}
