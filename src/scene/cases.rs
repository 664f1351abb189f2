//! Random points, poses and images with known truth.

use nalgebra::{Rotation3, Vector2, Vector3};
use rand::{Rng, RngExt};

use crate::camera::{Camera, Distortion, Pixel};
use crate::geometry::{CameraFromTarget, EulerAngles, Point, rotation, space};
use crate::random::{normal, normal2};

/// Points of a target, where the camera sees them, and the pose that is asked for.
#[derive(Clone, Debug)]
pub struct Case {
    /// The camera.
    pub camera: Camera,
    /// Points in the target's space.
    pub points: Vec<Point<space::Target>>,
    /// Their images with noise.
    pub pixels: Vec<Pixel>,
    /// The pose that made them.
    pub camera_from_target: CameraFromTarget,
}

/// The seed's camera: f = 608.7, c = (314, 320), 640 x 480.
///
/// # Panics
/// Never: the numbers are good.
#[must_use]
pub fn seed_camera() -> Camera {
    #[expect(clippy::expect_used, reason = "constants that a test of the camera holds up")]
    Camera::checked([640, 480], [608.7, 608.7], [314.0, 320.0], Distortion::None).expect("a good camera")
}

/// A case of the seed's study as its program draws it (table 4.1 has misprints): six points on a square of 0.8 m, angles of
/// +-90 degrees, 0 to 10 m along each axis, nothing behind the camera, no limit of view; Gaussian noise on the pixels.
pub fn thesis_2012(rng: &mut impl Rng, noise_px: f64) -> Case {
    let camera = seed_camera();
    loop {
        let points: Vec<_> =
            (0..6).map(|_| Point::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), 0.0)).collect();
        let mut angle = || rng.random_range(-90.0_f64..90.0).to_radians();
        let euler = EulerAngles { roll_rad: angle(), pitch_rad: angle(), yaw_rad: angle() };
        let mut metres = || rng.random_range(0.0..10.0);
        let translation = Vector3::new(metres(), metres(), metres());
        let camera_from_target = CameraFromTarget::new(euler.to_rotation(), translation);
        if let Some(case) = observe(rng, &camera, points, camera_from_target, noise_px) {
            return case;
        }
    }
}

/// A flat target of `count` points on a square of 0.8 m inside the picture: 1 to 15 m away, turned by up to 75 degrees.
pub fn visible_plane(rng: &mut impl Rng, count: usize, noise_px: f64) -> Case {
    let camera = seed_camera();
    loop {
        let points: Vec<_> =
            (0..count).map(|_| Point::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), 0.0)).collect();
        let tilt = rotation::exp(&(direction_in_plane(rng) * rng.random_range(0.0..75.0_f64).to_radians()));
        let spin = rotation::exp(&(Vector3::z() * rng.random_range(0.0..std::f64::consts::TAU)));
        let pose = in_view(rng, &camera, tilt * spin);
        if let Some(case) = observe_within(rng, &camera, points, pose, noise_px) {
            return case;
        }
    }
}

/// Points in a box of 0.8 x 0.8 x 0.3 m inside the picture: 1 to 15 m away, turned any way.
pub fn visible_box(rng: &mut impl Rng, count: usize, noise_px: f64) -> Case {
    let camera = seed_camera();
    loop {
        let points: Vec<_> = (0..count)
            .map(|_| {
                Point::new(rng.random_range(-0.4..0.4), rng.random_range(-0.4..0.4), rng.random_range(-0.15..0.15))
            })
            .collect();
        let turn = any_rotation(rng);
        let pose = in_view(rng, &camera, turn);
        if let Some(case) = observe_within(rng, &camera, points, pose, noise_px) {
            return case;
        }
    }
}

/// A rotation drawn evenly from all.
pub fn any_rotation(rng: &mut impl Rng) -> Rotation3<f64> {
    let quaternion = nalgebra::Quaternion::new(normal(rng), normal(rng), normal(rng), normal(rng));
    nalgebra::UnitQuaternion::from_quaternion(quaternion).to_rotation_matrix()
}

fn direction_in_plane(rng: &mut impl Rng) -> Vector3<f64> {
    let angle: f64 = rng.random_range(0.0..std::f64::consts::TAU);
    Vector3::new(angle.cos(), angle.sin(), 0.0)
}

fn in_view(rng: &mut impl Rng, camera: &Camera, turn: Rotation3<f64>) -> CameraFromTarget {
    let depth = rng.random_range(1.0..15.0);
    let pixel = Vector2::new(
        rng.random_range(0.0..f64::from(camera.width())),
        rng.random_range(0.0..f64::from(camera.height())),
    );
    let ray = camera.unproject(&pixel).unwrap_or_default();
    CameraFromTarget::new(turn, Vector3::new(ray.x, ray.y, 1.0) * depth)
}

fn observe_within(
    rng: &mut impl Rng,
    camera: &Camera,
    points: Vec<Point<space::Target>>,
    pose: CameraFromTarget,
    noise_px: f64,
) -> Option<Case> {
    let inside = points.iter().all(|p| camera.project(&(pose * *p)).is_some_and(|pixel| camera.contains(&pixel)));
    inside.then(|| observe(rng, camera, points, pose, noise_px)).flatten()
}

/// The image of the points with noise; `None` if one has none.
pub fn observe(
    rng: &mut impl Rng,
    camera: &Camera,
    points: Vec<Point<space::Target>>,
    camera_from_target: CameraFromTarget,
    noise_px: f64,
) -> Option<Case> {
    let exact: Option<Vec<Pixel>> = points.iter().map(|p| camera.project(&(camera_from_target * *p))).collect();
    let pixels = exact?.into_iter().map(|pixel| pixel + normal2(rng) * noise_px).collect();
    Some(Case { camera: *camera, points, pixels, camera_from_target })
}
