//! The figures and plots of docs/accuracy.md: the studies of `scene::protocols`, judged by `scene::verdict`.
//!
//!     cargo run --release --example accuracy [TRIALS] [FOLDER]
//!
//! prints the tables and writes the plots into the folder (docs/accuracy).

#![allow(clippy::print_stdout, clippy::expect_used, reason = "a program that prints figures and stops where it cannot")]

use std::f64::consts::FRAC_PI_2;

use skypose::geometry::{Point, rotation::angle_between_rad};
use skypose::plot::{Axis, Figure, Panel, Series};
use skypose::pose::{PoseAnswer, PoseEstimate, PoseOptions, PosePrior, estimate_pose, estimate_pose_robustly};
use skypose::random;
use skypose::scene::cases;
use skypose::scene::protocols::{Protocol, Trial};
use skypose::scene::verdict::{Figures, MAX_GOOD_ROTATION_DEG, Verdict, sharp_bound};

/// 95 % of chi-square with six degrees of freedom.
const CHI_SQUARE_6_95: f64 = 12.592;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let trials = arguments.next().map_or(20_000, |text| text.parse().expect("a number of trials"));
    let folder = std::path::PathBuf::from(arguments.next().unwrap_or_else(|| "docs/accuracy".into()));
    std::fs::create_dir_all(&folder).expect("a folder for the plots");
    let studies: Vec<Study> = Protocol::ALL.into_iter().map(|protocol| Study::of(protocol, trials)).collect();
    print_errors(&studies);
    print_covariance(&studies);
    print_probabilities(&studies);
    let write = |name: &str, figure: &Figure| {
        std::fs::write(folder.join(name), figure.svg()).expect("a file in that folder");
    };
    write("probability.svg", &probability(&studies));
    write("range.svg", &over_range(trials / 10));
}

/// The poses of an answer by falling probability.
fn poses(answer: &PoseAnswer) -> impl Iterator<Item = &PoseEstimate> {
    std::iter::once(&answer.best).chain(&answer.alternatives)
}

/// The one of the answer's minima that is meant by the truth.
fn meant<'a>(answer: &'a PoseAnswer, trial: &Trial) -> &'a PoseEstimate {
    let truth = &trial.case.camera_from_target.rotation;
    let off = |estimate: &PoseEstimate| angle_between_rad(&estimate.camera_from_target.rotation, truth);
    poses(answer).min_by(|a, b| off(a).total_cmp(&off(b))).expect("at least the best")
}

/// All trials of a study.
struct Study {
    protocol: Protocol,
    trials: usize,
    best: Vec<Option<Verdict>>,
    pair: Vec<Option<Verdict>>,
    /// As `best`: with limits of +-90 degrees for the thesis, with the right pairs alone for outliers.
    knowing: Vec<Option<Verdict>>,
    inside: Share,
    sharp_inside: Share,
    reliable_inside: Share,
    /// Tenths of probability: how many poses, how many of them right, the sum of what was stated.
    bins: [(f64, f64, f64); 10],
    brier: f64,
}

#[derive(Default)]
struct Share {
    count: f64,
    of: f64,
}

impl Share {
    fn add(&mut self, holds: bool) {
        self.of += 1.0;
        self.count += f64::from(u8::from(holds));
    }

    fn percent(&self) -> f64 {
        100.0 * self.count / self.of
    }
}

impl Study {
    fn of(protocol: Protocol, trials: u64) -> Self {
        let mut study = Self {
            protocol,
            trials: 0,
            best: Vec::new(),
            pair: Vec::new(),
            knowing: Vec::new(),
            inside: Share::default(),
            sharp_inside: Share::default(),
            reliable_inside: Share::default(),
            bins: [(0.0, 0.0, 0.0); 10],
            brier: 0.0,
        };
        for index in 0..trials {
            study.add(&protocol.trial(index));
        }
        study
    }

    fn add(&mut self, trial: &Trial) {
        self.trials += 1;
        let camera = &trial.case.camera;
        let bound = sharp_bound(trial);
        let judged = |estimate: &PoseEstimate| Verdict::of(trial, bound.as_ref(), &estimate.camera_from_target);
        let options = PoseOptions::default();
        let plain = |seen: &[_]| estimate_pose(camera, seen, &options).ok();
        let answer = if self.protocol == Protocol::Outliers {
            estimate_pose_robustly(camera, &trial.correspondences(), &options).ok().map(|(answer, _)| answer)
        } else {
            plain(&trial.correspondences())
        };
        let knowing = match self.protocol {
            Protocol::Outliers => plain(&trial.right_correspondences()),
            // The draw keeps within these limits.
            Protocol::Thesis => answer.clone().and_then(|answer| answer.given(&facing(), &middle(trial)).ok()),
            Protocol::Nonplanar | Protocol::Visible => None,
        };
        self.knowing.push(knowing.map(|answer| judged(&answer.best)));
        self.best.push(answer.as_ref().map(|answer| judged(&answer.best)));
        self.pair.push(answer.as_ref().map(|answer| judged(meant(answer, trial))));
        let Some(answer) = answer else { return };
        let meant = meant(&answer, trial);
        let truth = &trial.case.camera_from_target;
        let is_inside = meant.covariance.normalized_error_squared(&meant.camera_from_target, truth) < CHI_SQUARE_6_95;
        self.inside.add(is_inside);
        if bound.is_some() {
            self.sharp_inside.add(is_inside);
        }
        if meant.covariance_reliable {
            self.reliable_inside.add(is_inside);
        }
        let is_right = |estimate: &PoseEstimate| f64::from(u8::from(std::ptr::eq(estimate, meant)));
        self.brier += (answer.best.probability - is_right(&answer.best)).powi(2);
        for estimate in poses(&answer) {
            #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a tenth")]
            let bin = &mut self.bins[((estimate.probability * 10.0) as usize).min(9)];
            *bin = (bin.0 + 1.0, bin.1 + is_right(estimate), bin.2 + estimate.probability);
        }
    }
}

/// Limits of half a turn about each axis.
fn facing() -> PosePrior {
    PosePrior { euler_limits_rad: [Some([-FRAC_PI_2, FRAC_PI_2]); 3], ..PosePrior::default() }
}

fn middle(trial: &Trial) -> Point<skypose::geometry::space::Target> {
    let points = &trial.case.points;
    (points.iter().map(|p| p.coords).sum::<nalgebra::Vector3<f64>>() / points.len() as f64).into()
}

fn print_errors(studies: &[Study]) {
    println!(
        "| protocol | answer | good % | flips % | error over the bound | median rotation, deg | median range, % |"
    );
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: |");
    for study in studies {
        let knowing = match study.protocol {
            Protocol::Outliers => "the right pairs known",
            _ => "with limits of +-90 degrees",
        };
        for (name, verdicts) in
            [("the first", &study.best), ("the nearer of all", &study.pair), (knowing, &study.knowing)]
        {
            if verdicts.iter().all(Option::is_none) {
                continue;
            }
            let figures = Figures::of(verdicts);
            println!(
                "| {} | {name} | {:.1} | {:.1} | {:.3} | {:.2} | {:.2} |",
                study.protocol.name(),
                100.0 * figures.good_ratio,
                100.0 * figures.flip_ratio,
                figures.over_bound_ratio,
                figures.median_rotation_deg,
                100.0 * figures.median_range_ratio,
            );
        }
        println!();
    }
}

fn print_covariance(studies: &[Study]) {
    println!("| protocol | all | bound sharp | called reliable | share called reliable |");
    println!("| --- | ---: | ---: | ---: | ---: |");
    for study in studies {
        println!(
            "| {} | {:.1} % | {:.1} % | {:.1} % | {:.0} % |",
            study.protocol.name(),
            study.inside.percent(),
            study.sharp_inside.percent(),
            study.reliable_inside.percent(),
            100.0 * study.reliable_inside.of / study.inside.of,
        );
    }
    println!();
}

fn print_probabilities(studies: &[Study]) {
    for study in studies.iter().filter(|study| study.protocol.is_planar()) {
        println!("| {}: stated | observed | poses |", study.protocol.name());
        println!("| ---: | ---: | ---: |");
        for (count, right, sum) in study.bins {
            println!("| {:.3} | {:.3} | {count} |", sum / count, right / count);
        }
        let off: f64 = study.bins.iter().map(|(_, right, sum)| (right - sum).abs()).sum();
        let count: f64 = study.bins.iter().map(|bin| bin.0).sum();
        let brier = study.brier / study.trials as f64;
        println!("\noff by {:.4} on average, Brier score of the first {brier:.4}\n", off / count);
    }
}

fn probability(studies: &[Study]) -> Figure {
    let mut series = vec![Series::of("perfect", [(0.0, 0.0), (1.0, 1.0)])];
    for study in studies.iter().filter(|study| study.protocol.is_planar()) {
        let points = study.bins.iter().map(|(count, right, sum)| (sum / count, right / count));
        series.push(Series::of(study.protocol.name(), points));
    }
    let panel = Panel {
        title: "How often a pose is the right one".into(),
        x: Axis::linear("stated probability"),
        y: Axis::linear("observed share"),
        series,
    };
    Figure { title: String::new(), panels: vec![panel] }
}

/// A flat and a deep target at one range after the other, half a pixel of noise.
fn over_range(trials: u64) -> Figure {
    let ranges = (0..12).map(|i| 1.0 * 20.0_f64.powf(f64::from(i) / 11.0));
    let mut rotation = Vec::new();
    let mut range = Vec::new();
    let mut flips = Vec::new();
    let mut inside = Vec::new();
    for (name, thickness_m) in [("six points in a plane", 0.0), ("six points 0.2 m deep", 0.2)] {
        let (mut rotations, mut range_errors, mut bounds, mut range_bounds) = (vec![], vec![], vec![], vec![]);
        let (mut flip_points, mut inside_points) = (vec![], vec![]);
        for range_m in ranges.clone() {
            let row = at_range(range_m, thickness_m, trials);
            rotations.push((range_m, row.rotation_deg));
            bounds.push((range_m, row.bound_rotation_deg));
            range_errors.push((range_m, row.range_m));
            range_bounds.push((range_m, row.bound_range_m));
            flip_points.push((range_m, row.flips.percent()));
            inside_points.push((range_m, row.inside.percent()));
        }
        let bound = format!("{name}, the bound");
        rotation.extend([Series::of(name, rotations), Series::of(&bound, bounds)]);
        range.extend([Series::of(name, range_errors), Series::of(&bound, range_bounds)]);
        flips.push(Series::of(name, flip_points));
        inside.push(Series::of(name, inside_points));
    }
    inside.push(Series::of("nominal", [(1.0, 95.0), (20.0, 95.0)]));
    let distance = || Axis::logarithmic("distance (m)");
    let panel = |title: &str, y: Axis, series| Panel { title: title.into(), x: distance(), y, series };
    Figure {
        title: String::new(),
        panels: vec![
            panel("Median error of the nearer of both attitudes", Axis::logarithmic("rotation (deg)"), rotation),
            panel("Median error of the range", Axis::logarithmic("range (m)"), range),
            panel("The first is the wrong one of two", Axis::linear("share (%)"), flips),
            panel("Errors inside the 95 % ellipsoid", Axis::linear("share (%)"), inside),
        ],
    }
}

struct AtRange {
    rotation_deg: f64,
    bound_rotation_deg: f64,
    range_m: f64,
    bound_range_m: f64,
    flips: Share,
    inside: Share,
}

/// Random targets of six points turned by up to 60 degrees, straight ahead.
fn at_range(range_m: f64, thickness_m: f64, trials: u64) -> AtRange {
    use nalgebra::Vector3;
    use rand::RngExt;
    use skypose::geometry::{CameraFromTarget, PoseCovariance, rotation};
    let (mut rotations, mut ranges, mut rotation_bounds, mut range_bounds) = (vec![], vec![], vec![], vec![]);
    let (mut flips, mut inside) = (Share::default(), Share::default());
    let camera = cases::seed_camera();
    for index in 0..trials {
        let rng = &mut random::case("accuracy over range", index);
        let points: Vec<_> = (0..6)
            .map(|_| {
                let depth = rng.random_range(-0.5..0.5) * thickness_m;
                Point::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), depth)
            })
            .collect();
        let side = rng.random_range(0.0..std::f64::consts::TAU);
        let tilt = Vector3::new(side.cos(), side.sin(), 0.0) * rng.random_range(0.0..60.0_f64).to_radians();
        let sight = Vector3::new(0.0, -0.13, 1.0).normalize();
        let pose = CameraFromTarget::new(rotation::exp(&tilt), sight * range_m);
        let Some(case) = cases::observe(rng, &camera, points, pose, 0.5) else { continue };
        let trial = Trial::clean(case, 0.5);
        let Ok(answer) = estimate_pose(&camera, &trial.correspondences(), &PoseOptions::default()) else { continue };
        let meant = meant(&answer, &trial);
        let verdict = Verdict::of(&trial, None, &meant.camera_from_target);
        rotations.push(verdict.rotation_deg);
        ranges.push(verdict.range_ratio * range_m);
        flips.add(Verdict::of(&trial, None, &answer.best.camera_from_target).rotation_deg > MAX_GOOD_ROTATION_DEG);
        let nees = meant.covariance.normalized_error_squared(&meant.camera_from_target, &pose);
        inside.add(nees < CHI_SQUARE_6_95);
        let information = skypose::refine::information(&camera, &trial.correspondences(), &pose).ok();
        if let Some(bound) = information.as_ref().and_then(PoseCovariance::from_information) {
            // The median of errors that are drawn from the bound.
            let error = bound.matrix().cholesky().expect("positive").l()
                * nalgebra::Vector6::from_fn(|_, _| random::normal(rng));
            rotation_bounds.push(error.fixed_rows::<3>(3).norm().to_degrees());
            range_bounds.push(error.fixed_rows::<3>(0).dot(&sight).abs());
        }
    }
    let median = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    AtRange {
        rotation_deg: median(rotations),
        bound_rotation_deg: median(rotation_bounds),
        range_m: median(ranges),
        bound_range_m: median(range_bounds),
        flips,
        inside,
    }
}
