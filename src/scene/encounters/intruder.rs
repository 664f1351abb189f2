//! What the camera sees of the intruder, and what is behind it.

use nalgebra::Vector2;

use crate::camera::Camera;
use crate::scene::models;
use crate::scene::render::{Clouds, Ground, Model, Optics, Sky};
use crate::target::Target;

/// By which light an encounter is flown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Light {
    /// Painted discs on a fair day.
    Day,
    /// LEDs that outshine the sensor, at night.
    Night,
}

/// Light of an LED in multiples of what fills the sensor.
const LED_GAIN: f64 = 30.0;

/// The airframe reaches so far beyond a marker's middle, in radii of the marker.
const RIM_RADII: f64 = 2.5;

/// Corners by which the rim about a marker is drawn.
const RIM_CORNERS: u32 = 12;

/// The flying wing of [`models::wing`] in another size.
#[must_use]
pub fn wing(scale: f64) -> Option<Model> {
    let wing = models::wing();
    let markers = wing.target.markers().iter().map(|marker| {
        let mut marker = marker.clone();
        marker.position = (marker.position.coords * scale).into();
        marker.radius_m = marker.radius_m.map(|radius_m| radius_m * scale);
        marker
    });
    let target = Target::checked(wing.target.name(), markers.collect()).ok()?;
    let scaled = |outline: &[[f64; 2]]| outline.iter().map(|place| place.map(|x| x * scale)).collect::<Vec<_>>();
    let mut paint = wing.paint.clone();
    for patch in &mut paint {
        patch.outline = scaled(&patch.outline);
    }
    Some(Model { body: scaled(&wing.body), paint, target, default_radius_m: wing.default_radius_m * scale, ..wing })
}

/// A constellation on a gray plate, where its markers lie in the plane z = 0; otherwise the markers alone.
#[must_use]
pub fn plate(target: Target) -> Model {
    let model = Model::bare(target);
    let markers = model.target.markers();
    if markers.iter().any(|marker| marker.position.coords.z.abs() > 1e-6) {
        return model;
    }
    let rim = markers.iter().flat_map(|marker| {
        let reach_m = RIM_RADII * marker.radius_m.unwrap_or(model.default_radius_m);
        (0..RIM_CORNERS).map(move |corner| {
            let angle = std::f64::consts::TAU * f64::from(corner) / f64::from(RIM_CORNERS);
            marker.position.coords.xy() + Vector2::new(angle.cos(), angle.sin()) * reach_m
        })
    });
    let body = hull(rim.collect());
    Model { body, ..model }
}

/// Matt paint of this hue, as bright as `red`, which is of hue 0: the same three levels, shared out anew.
#[must_use]
pub fn painted(hue_deg: f64, red: [u8; 3]) -> [u8; 3] {
    if hue_deg.abs() < f64::EPSILON {
        return red;
    }
    let (most, least) = (f64::from(red[0]), f64::from(red[2]));
    let level = |centre_deg: f64| {
        let turn = (hue_deg - centre_deg).rem_euclid(360.0);
        let share = (2.0 - turn.min(360.0 - turn) / 60.0).clamp(0.0, 1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between two levels")]
        let level = (least + (most - least) * share).round() as u8;
        level
    };
    [level(0.0), level(120.0), level(240.0)]
}

impl Light {
    /// The model in this light.
    #[must_use]
    pub fn on(self, model: Model) -> Model {
        match self {
            Self::Day => model,
            Self::Night => Model { body_rgb: [22, 23, 26], paint: Vec::new(), marker_gain: LED_GAIN, ..model },
        }
    }

    /// What is behind the intruder for a level camera that looks up by `pitch_rad`: the horizon is where it is, and so is an
    /// intruder at our height. `seed` names clouds and hills.
    #[must_use]
    pub fn sky(self, seed: u64, camera: &Camera, pitch_rad: f64) -> Sky {
        let horizon_px = camera.principal_point()[1] + camera.focal_lengths()[1] * pitch_rad.tan();
        let horizon_ratio = horizon_px / f64::from(camera.height());
        match self {
            Self::Day => Sky {
                clouds: Some(Clouds { seed, cover_ratio: 0.35, drift: [0.0; 2] }),
                ground: Some(Ground { seed, horizon_ratio, rgb: [92, 104, 66] }),
                ..Sky::default()
            },
            Self::Night => Sky { zenith_rgb: [7, 8, 12], horizon_rgb: [14, 14, 20], ..Sky::default() },
        }
    }

    /// Lens and sensor.
    #[must_use]
    pub fn optics(self) -> Optics {
        match self {
            Self::Day => Optics::default(),
            Self::Night => Optics { glare_ratio: 0.01, ..Optics::default() },
        }
    }
}

/// Corners of the convex hull, in order (Andrew 1979).
fn hull(mut points: Vec<Vector2<f64>>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let half = |points: &mut dyn Iterator<Item = Vector2<f64>>| {
        let mut chain: Vec<Vector2<f64>> = Vec::new();
        for point in points {
            while let [.., before, last] = chain[..]
                && (last - before).perp(&(point - last)) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    let lower = half(&mut points.iter().copied());
    let upper = half(&mut points.iter().rev().copied());
    lower.into_iter().chain(upper).map(Into::into).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Distortion;
    use crate::target::Marker;

    #[test]
    fn a_scaled_wing_is_the_wing_from_farther_away() {
        let (wing, large) = (models::wing(), wing(3.0).expect("a good size"));
        for (marker, scaled) in wing.target.markers().iter().zip(large.target.markers()) {
            assert!((marker.position.coords * 3.0 - scaled.position.coords).norm() < 1e-12);
            assert_eq!(scaled.radius_m, marker.radius_m.map(|r| 3.0 * r));
        }
        assert_eq!((large.paint.len(), large.body.len()), (wing.paint.len(), wing.body.len()));
        assert_eq!(super::wing(0.0), None, "all markers at one place");
    }

    #[test]
    fn a_plate_holds_all_of_its_markers_and_no_plate_goes_through_a_solid() {
        let plate = plate(models::wing_six());
        let inside = |place: [f64; 2]| {
            plate.body.iter().zip(plate.body.iter().cycle().skip(1)).all(|(a, b)| {
                let (edge, to) = ([b[0] - a[0], b[1] - a[1]], [place[0] - a[0], place[1] - a[1]]);
                edge[0] * to[1] - edge[1] * to[0] > 0.0
            })
        };
        for marker in models::wing_six().markers() {
            let middle = marker.position.coords;
            for corner in [[0.04, 0.0], [-0.04, 0.0], [0.0, 0.04], [0.0, -0.04]] {
                assert!(inside([middle.x + corner[0], middle.y + corner[1]]), "{}", marker.id);
            }
        }
        let raised =
            |marker: &Marker| Marker { position: [marker.position.coords.x, 0.1, 0.2].into(), ..marker.clone() };
        let mut markers = models::wing_six().markers().to_vec();
        markers[2] = raised(&markers[2]);
        let solid = super::plate(Target::checked("solid", markers).expect("a good target"));
        assert_eq!(solid.body, Vec::<[f64; 2]>::new());
    }

    #[test]
    fn the_horizon_is_where_a_level_camera_sees_it() {
        let camera = Camera::checked([640, 480], [500.0; 2], [320.0, 240.0], Distortion::None).expect("a camera");
        let horizon = |pitch_rad: f64| Light::Day.sky(1, &camera, pitch_rad).ground.expect("by day").horizon_ratio;
        assert!((horizon(0.0) - 0.5).abs() < 1e-12);
        assert!((horizon(0.1) - (240.0 + 500.0 * 0.1_f64.tan()) / 480.0).abs() < 1e-12);
    }
}
