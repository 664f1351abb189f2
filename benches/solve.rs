//! What a pose costs once the points are known.
//!
//! - group `solver`: each method alone, unrefined, on the layouts that it takes: `plane` (points of a flat target) and `box`
//!   (points in space), named `method/layout/points`.
//! - group `refine`: Levenberg-Marquardt from the start that the pipeline would give it (IPPE of a plane, EPnP of a box).
//! - group `auto`: the whole answer of `estimate_pose` with default options: all starts, all minima refined, covariance and
//!   probability of each.
//!
//! Every iteration takes the next of 64 random scenes with 0.5 px of noise, so a figure is the mean over easy and hard ones,
//! those without an answer included; their number is printed where it is not zero.

#![allow(
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark of a scene that does not come out as planned must stop, and shows its figures"
)]

use std::time::Duration;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion};
use skypose::geometry::CameraFromTarget;
use skypose::pose::{PoseOptions, estimate_pose};
use skypose::random;
use skypose::refine::{Correspondence, RefineOptions, refine};
use skypose::scene::cases::{self, Case};
use skypose::solve::{Pair, Solver};

const COUNTS: [usize; 3] = [6, 20, 100];
const SCENES: u64 = 64;
const NOISE_PX: f64 = 0.5;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Layout {
    Plane,
    Box,
}

impl Layout {
    const ALL: [Self; 2] = [Self::Plane, Self::Box];

    const fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Box => "box",
        }
    }

    const fn takes(self, solver: Solver) -> bool {
        matches!(self, Self::Plane) || !matches!(solver, Solver::Homography | Solver::Ippe)
    }

    const fn starter(self) -> Solver {
        match self {
            Self::Plane => Solver::Ippe,
            Self::Box => Solver::Epnp,
        }
    }

    fn scenes(self, count: usize) -> Vec<Scene> {
        let name = format!("bench solve {} {count}", self.name());
        (0..SCENES)
            .map(|index| {
                let rng = &mut random::case(&name, index);
                Scene::of(match self {
                    Self::Plane => cases::visible_plane(rng, count, NOISE_PX),
                    Self::Box => cases::visible_box(rng, count, NOISE_PX),
                })
            })
            .collect()
    }
}

/// A case as the solvers and as the refinement take it.
struct Scene {
    case: Case,
    pairs: Vec<Pair>,
    seen: Vec<Correspondence>,
}

impl Scene {
    fn of(case: Case) -> Self {
        let points = || case.points.iter().zip(&case.pixels);
        let ray = |pixel| case.camera.unproject(pixel).expect("no lens");
        let pairs = points().map(|(point, pixel)| Pair { point: *point, ray: ray(pixel) }).collect();
        let seen = points()
            .map(|(point, pixel)| Correspondence { point: *point, pixel: *pixel, sigma_px: NOISE_PX })
            .collect();
        Self { case, pairs, seen }
    }

    /// Where the refinement begins: the method's best, or the truth where it has none.
    fn start(&self, starter: Solver) -> CameraFromTarget {
        starter.solve(&self.pairs).map_or(self.case.camera_from_target, |poses| poses[0])
    }
}

fn main() {
    let mut criterion = Criterion::default()
        .sample_size(20)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(600))
        .configure_from_args();

    let mut group = criterion.benchmark_group("solver");
    for solver in Solver::ALL {
        for layout in Layout::ALL.into_iter().filter(|layout| layout.takes(solver)) {
            let fewest = (solver == Solver::P3p).then_some(3);
            for count in fewest.into_iter().chain(COUNTS) {
                let name = format!("{}/{}/{count}", solver.name(), layout.name());
                bench(&mut group, &name, &layout.scenes(count), |scene| solver.solve(&scene.pairs));
            }
        }
    }
    group.finish();

    let mut group = criterion.benchmark_group("refine");
    for (layout, count) in all() {
        let scenes = layout.scenes(count);
        let started: Vec<_> = scenes.iter().map(|scene| (scene, scene.start(layout.starter()))).collect();
        bench(&mut group, &format!("{}/{count}", layout.name()), &started, |(scene, start)| {
            refine(&scene.case.camera, &scene.seen, start, &RefineOptions::default())
        });
    }
    group.finish();

    let mut group = criterion.benchmark_group("auto");
    for (layout, count) in all() {
        bench(&mut group, &format!("{}/{count}", layout.name()), &layout.scenes(count), |scene| {
            estimate_pose(&scene.case.camera, &scene.seen, &PoseOptions::default())
        });
    }
    group.finish();
    criterion.final_summary();
}

fn all() -> impl Iterator<Item = (Layout, usize)> {
    Layout::ALL.into_iter().flat_map(|layout| COUNTS.map(|count| (layout, count)))
}

/// One scene after the other, round and round.
fn bench<S, T, E>(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    scenes: &[S],
    work: impl Fn(&S) -> Result<T, E>,
) {
    let unanswered = scenes.iter().filter(|scene| work(scene).is_err()).count();
    if unanswered > 0 {
        println!("{name}: no answer to {unanswered} of {} scenes", scenes.len());
    }
    let mut next = scenes.iter().cycle();
    group.bench_function(name, |b| b.iter(|| next.next().map(&work)));
}
