//! Drawings of figures.

use super::calibration::Bin;
use super::figures::Figures;
use super::spread::Spread;
use crate::plot::{Axis, Figure, Limits, Panel, Series};

/// Points of a curve that are drawn.
const MOST_POINTS: usize = 120;

/// Points of a cloud that are drawn: more hide each other.
const MOST_IN_CLOUD: usize = 4000;

/// Drawings, as SVG; each is left out where there is nothing to draw.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plots {
    /// Share found against false alarms a frame, over the threshold of the score.
    pub curve: Option<String>,
    /// Error of centroids against range.
    pub centroids: Option<String>,
    /// Error of position and attitude against range.
    pub poses: Option<String>,
    /// How often what was stated with some probability was so.
    pub probabilities: Option<String>,
    /// Time taken by each stage.
    pub latency: Option<String>,
}

/// Name of each stage with how its times, ms, are spread.
pub type Latencies<'a> = &'a [(&'a str, Spread)];

/// Drawings of the figures of each suite, the last of all together.
#[must_use]
pub fn plots(suites: &[(&str, Figures)], all: &Figures, latency: Latencies<'_>) -> Plots {
    Plots {
        curve: curve(suites, all),
        centroids: centroids(suites),
        poses: poses(suites),
        probabilities: probabilities(all),
        latency: latencies(latency),
    }
}

fn figure(title: &str, panels: Vec<Panel>) -> Option<String> {
    let is_empty = panels.iter().all(|panel| panel.series.is_empty());
    (!is_empty).then(|| Figure { title: title.into(), panels }.svg())
}

/// A cloud: every point by itself.
fn cloud(name: &str, points: &[[f64; 2]]) -> Option<Series> {
    let stride = points.len().div_ceil(MOST_IN_CLOUD).max(1);
    let points: Vec<Option<[f64; 2]>> = points.iter().step_by(stride).flat_map(|point| [Some(*point), None]).collect();
    (!points.is_empty()).then(|| Series { name: name.into(), points })
}

fn curve(suites: &[(&str, Figures)], all: &Figures) -> Option<String> {
    // A single suite is all.
    let parts = if suites.len() > 1 { suites } else { &[] };
    let named = parts.iter().map(|(name, figures)| (*name, figures)).chain([("all", all)]);
    let series = named.filter_map(|(name, figures)| {
        let curve = figures.detection.as_ref()?.curve.thinned(MOST_POINTS);
        let points = curve.points.iter().filter(|point| point.false_alarms > 0.0);
        let points: Vec<(f64, f64)> = points.map(|point| (point.false_alarms, point.probability)).collect();
        (!points.is_empty()).then(|| Series::of(name, points))
    });
    let panel = Panel {
        title: "Receiver curve".into(),
        x: Axis::logarithmic("false alarms a frame"),
        y: Axis::share("share found"),
        series: series.collect(),
    };
    figure("", vec![panel])
}

fn centroids(suites: &[(&str, Figures)]) -> Option<String> {
    let series = suites
        .iter()
        .filter_map(|(name, figures)| cloud(name, &figures.detection.as_ref()?.error_against_range))
        .collect();
    let panel = Panel {
        title: "Centroids".into(),
        x: Axis::logarithmic("range (m)"),
        y: Axis::logarithmic("error (px)"),
        series,
    };
    figure("", vec![panel])
}

fn poses(suites: &[(&str, Figures)]) -> Option<String> {
    let of = |turn: f64, points: fn(&super::pose::TargetFigures) -> &Vec<[f64; 2]>| -> Vec<Series> {
        suites
            .iter()
            .filter_map(|(name, figures)| {
                let points = points(figures.targets.as_ref()?);
                cloud(name, &points.iter().map(|[range, error]| [*range, error * turn]).collect::<Vec<_>>())
            })
            .collect()
    };
    let position = Panel {
        title: "Position".into(),
        x: Axis::logarithmic("range (m)"),
        y: Axis::logarithmic("error (m)"),
        series: of(1.0, |targets| &targets.position_against_range),
    };
    let attitude = Panel {
        title: "Attitude".into(),
        x: Axis::logarithmic("range (m)"),
        y: Axis::logarithmic("error (deg)"),
        series: of(1.0_f64.to_degrees(), |targets| &targets.attitude_against_range),
    };
    figure("", vec![position, attitude])
}

fn probabilities(all: &Figures) -> Option<String> {
    let panel = |title: &str, bins: &[Bin]| {
        let told = bins.iter().filter(|bin| bin.rate.of > 0);
        let held: Vec<(f64, f64)> = told.clone().filter_map(|bin| Some((bin.stated, bin.rate.ratio()?))).collect();
        let interval: Vec<Option<[f64; 2]>> = told
            .flat_map(|bin| {
                let [low, high] = bin.rate.interval();
                [Some([bin.stated, low]), Some([bin.stated, high]), None]
            })
            .collect();
        let series = vec![
            Series::of("it was so", held),
            Series { name: "95 % interval".into(), points: interval },
            Series::of("as stated", [(0.0, 0.0), (1.0, 1.0)]),
        ];
        Panel { title: title.into(), x: Axis::share("stated"), y: Axis::share("share that was so"), series }
    };
    let is_told = |bins: &&[Bin]| bins.iter().any(|bin| bin.rate.of > 0);
    let of_poses = all.targets.as_ref().map(|targets| targets.probabilities.as_slice()).filter(is_told);
    let of_scores = all.detection.as_ref().map(|detection| detection.scores.as_slice()).filter(is_told);
    let panels = of_poses
        .map(|bins| panel("Probability of poses", bins))
        .into_iter()
        .chain(of_scores.map(|bins| panel("Score of reports", bins)));
    figure("", panels.collect())
}

fn latencies(latency: Latencies<'_>) -> Option<String> {
    let most_ms = latency.iter().map(|(_, spread)| spread.largest).fold(0.0, f64::max);
    if most_ms <= 0.0 {
        return None;
    }
    let series = latency
        .iter()
        .map(|(name, spread)| {
            let held = [(spread.median, 0.5), (spread.p95, 0.95), (spread.largest, 1.0)];
            Series::of(*name, held)
        })
        .collect();
    let panel = Panel {
        title: "Latency: median, 95 %, largest".into(),
        x: Axis::logarithmic("time (ms)"),
        y: Axis { limits: Limits::Fixed(0.4, 1.0), ..Axis::linear("share of frames within") },
        series,
    };
    figure("", vec![panel])
}
