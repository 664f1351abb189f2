//! What is solved: the project's protocols for accuracy, and layouts of fixed size for speed.

use kornia_algebra::{Mat3AF32, Vec2F32, Vec3AF32};
use nalgebra::Vector3;
use skypose::geometry::{CameraFromTarget, Point, PoseCovariance, space};
use skypose::random;
use skypose::refine::Correspondence;
use skypose::scene::cases;
use skypose::scene::protocols::{Protocol, Trial};
use skypose::scene::verdict::sharp_bound;
use skypose::solve::{Pair, Solver};

/// Numbers of points of the layouts.
pub const COUNTS: [usize; 4] = [6, 20, 100, 1000];

/// Noise of the layouts, px: that of a good detector.
const LAYOUT_NOISE_PX: f64 = 0.5;

/// Where points lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// In a plane.
    Plane,
    /// In a box.
    Box,
}

impl Layout {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Plane, Self::Box];

    /// One word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Plane => "plane",
            Self::Box => "box",
        }
    }

    /// From whose answer all refinements of a layout start.
    const fn starter(self) -> Solver {
        match self {
            Self::Plane => Solver::Ippe,
            Self::Box => Solver::Sqpnp,
        }
    }
}

/// What a study is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// How good answers are.
    Accuracy(Protocol),
    /// What they cost at this number of points.
    Speed(usize),
}

/// A set of tasks.
pub struct Study {
    pub name: String,
    pub purpose: Purpose,
    pub layout: Layout,
    pub tasks: Vec<Task>,
}

/// One trial, in every form that a method takes, so that no conversion is timed.
pub struct Task {
    pub trial: Trial,
    /// The Cramer-Rao bound where it is sharp.
    pub bound: Option<PoseCovariance>,
    pub seen: Vec<Correspondence>,
    pub pairs: Vec<Pair>,
    /// Where refinements start.
    pub start: CameraFromTarget,
    /// Bearings of the first three pairs.
    pub bearings: [Vector3<f64>; 3],
    /// Their points.
    pub corners: [Point<space::Target>; 3],
    pub kornia: KorniaInput,
}

/// A trial in kornia's types, which are of single precision.
pub struct KorniaInput {
    pub world: Vec<Vec3AF32>,
    pub image: Vec<Vec2F32>,
    pub k: Mat3AF32,
    pub start_rotation: Mat3AF32,
    pub start_translation: Vec3AF32,
}

impl Study {
    /// The protocol's first trials.
    pub fn of_protocol(protocol: Protocol, trials: u64) -> Self {
        let layout = if protocol.is_planar() { Layout::Plane } else { Layout::Box };
        Self {
            name: protocol.name().to_owned(),
            purpose: Purpose::Accuracy(protocol),
            layout,
            tasks: (0..trials).map(|index| Task::of(protocol.trial(index), layout)).collect(),
        }
    }

    /// Trials of `count` points, all in the picture.
    pub fn of_layout(layout: Layout, count: usize, trials: u64) -> Self {
        let name = format!("{} {count}", layout.name());
        let task = |index| {
            let rng = &mut random::case(&format!("peers {name}"), index);
            let case = match layout {
                Layout::Plane => cases::visible_plane(rng, count, LAYOUT_NOISE_PX),
                Layout::Box => cases::visible_box(rng, count, LAYOUT_NOISE_PX),
            };
            Task::of(Trial::clean(case, LAYOUT_NOISE_PX), layout)
        };
        Self { tasks: (0..trials).map(task).collect(), purpose: Purpose::Speed(count), layout, name }
    }

    pub const fn is_planar(&self) -> bool {
        matches!(self.layout, Layout::Plane)
    }

    pub const fn has_outliers(&self) -> bool {
        matches!(self.purpose, Purpose::Accuracy(Protocol::Outliers))
    }
}

impl Task {
    fn of(trial: Trial, layout: Layout) -> Self {
        let seen = trial.correspondences();
        let camera = &trial.case.camera;
        let ray = |pair: &Correspondence| camera.unproject(&pair.pixel).expect("no lens, so every pixel has a ray");
        let pairs: Vec<Pair> = seen.iter().map(|pair| Pair { point: pair.point, ray: ray(pair) }).collect();
        let start = layout.starter().solve(&pairs).map_or(trial.case.camera_from_target, |poses| poses[0]);
        Self {
            bound: sharp_bound(&trial),
            bearings: [0, 1, 2].map(|i| Vector3::new(pairs[i].ray.x, pairs[i].ray.y, 1.0).normalize()),
            corners: [0, 1, 2].map(|i| pairs[i].point),
            kornia: KorniaInput::of(&trial, &start),
            trial,
            seen,
            pairs,
            start,
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "kornia computes in single precision")]
impl KorniaInput {
    fn of(trial: &Trial, start: &CameraFromTarget) -> Self {
        let camera = &trial.case.camera;
        let ([fx, fy], [cx, cy]) = (camera.focal_lengths(), camera.principal_point());
        let columns = |m: [[f64; 3]; 3]| {
            Mat3AF32::from_cols_array(
                &m.as_flattened().iter().map(|x| *x as f32).collect::<Vec<_>>().try_into().expect("nine numbers"),
            )
        };
        let vector = |v: &Vector3<f64>| Vec3AF32::new(v.x as f32, v.y as f32, v.z as f32);
        Self {
            world: trial.case.points.iter().map(|point| vector(&point.coords)).collect(),
            image: trial.case.pixels.iter().map(|pixel| Vec2F32::new(pixel.x as f32, pixel.y as f32)).collect(),
            k: columns([[fx, 0.0, 0.0], [0.0, fy, 0.0], [cx, cy, 1.0]]),
            start_rotation: columns(start.rotation.matrix().data.0),
            start_translation: vector(&start.translation),
        }
    }
}
