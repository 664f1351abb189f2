//! Where the markers of a rendered frame are.

use nalgebra::Vector2;

use super::render::{Model, Seen, Surfaces, facing_normal};
use crate::camera::{Camera, Pixel};
use crate::geometry::{CameraFromTarget, Point};

/// How much of a marker the camera sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// All of it.
    Whole,
    /// A part: cut by the frame's border, or covered.
    Part,
    /// Nothing of it.
    Hidden,
}

/// The image of one marker.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MarkerTruth {
    /// Centroid of the image of the whole disc, px, also where a part is not seen; `None` where it faces away or has no
    /// image.
    pub centroid: Option<Pixel>,
    /// Area of the image of the whole disc, px; 0 where it faces away or has no image.
    pub area_px: f64,
    /// How much of it is seen.
    pub sight: Sight,
}

/// Points on the rim by which coverage is told.
const RIM_POINTS: u32 = 24;

/// The images of the markers of `model`, in its order.
#[must_use]
pub fn truth(camera: &Camera, camera_from_target: &CameraFromTarget, model: &Model) -> Vec<MarkerTruth> {
    let surfaces = Surfaces::of(model, camera_from_target);
    let markers = 0..model.target.markers().len();
    let unseen = MarkerTruth { centroid: None, area_px: 0.0, sight: Sight::Hidden };
    markers.map(|marker| of(camera, camera_from_target, model, &surfaces, marker).unwrap_or(unseen)).collect()
}

fn of(
    camera: &Camera,
    pose: &CameraFromTarget,
    model: &Model,
    surfaces: &Surfaces,
    marker: usize,
) -> Option<MarkerTruth> {
    let placed = &model.target.markers()[marker];
    let radius_m = placed.radius_m.unwrap_or(model.default_radius_m);
    let normal = facing_normal(model, marker, pose)?;
    let centre = *pose * placed.position;
    let centroid = camera.disc_centroid(&centre, &normal, radius_m)?;
    let mut least_aligned = nalgebra::Vector3::zeros();
    least_aligned[normal.iamin()] = 1.0;
    let across = normal.cross(&least_aligned).normalize();
    let down = normal.cross(&across);
    let place = |angle: f64, reach: f64| {
        let offset = Vector2::new(angle.cos(), angle.sin()) * radius_m * reach;
        camera.project(&Point::from(centre.coords + across * offset.x + down * offset.y))
    };
    let angle = |index: u32| std::f64::consts::TAU * f64::from(index) / f64::from(RIM_POINTS);
    let rim: Option<Vec<Pixel>> = (0..RIM_POINTS).map(|index| place(angle(index), 1.0)).collect();
    let is_seen = |pixel: Option<Pixel>| {
        let ray = pixel.filter(|pixel| camera.contains(pixel)).and_then(|pixel| camera.unproject(&pixel));
        ray.is_some_and(|ray| surfaces.seen_by(&ray) == Seen::Marker(marker))
    };
    // Just inside the rim, so that rounding does not decide.
    let seen = (0..RIM_POINTS).filter(|&index| is_seen(place(angle(index), 0.999))).count();
    let sight = match (seen, is_seen(place(0.0, 0.0))) {
        (count, true) if count == RIM_POINTS as usize => Sight::Whole,
        (0, false) => Sight::Hidden,
        _ => Sight::Part,
    };
    Some(MarkerTruth { centroid: Some(centroid), area_px: area(&rim?), sight })
}

/// Area within the ellipse through these evenly spread points of it, px: that of the polygon, made good for the slivers
/// outside of it.
fn area(rim: &[Pixel]) -> f64 {
    let polygon: f64 = rim.iter().zip(rim.iter().cycle().skip(1)).map(|(a, b)| 0.5 * a.perp(b)).sum();
    let step = std::f64::consts::TAU / f64::from(RIM_POINTS);
    polygon.abs() * step / step.sin()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::geometry::rotation;
    use crate::scene::models;

    fn pose(turn: Vector3<f64>, translation: [f64; 3]) -> CameraFromTarget {
        CameraFromTarget::new(rotation::exp(&turn), translation.into())
    }

    #[test]
    fn face_on_all_markers_are_whole_and_round() {
        let (camera, model) = (models::demo_camera(), models::wing());
        let [fx, _] = camera.focal_lengths();
        for marker in truth(&camera, &pose(Vector3::zeros(), [0.0, 0.0, 4.0]), &model) {
            assert_eq!(marker.sight, Sight::Whole);
            let round = std::f64::consts::PI * (0.03 * fx / 4.0).powi(2);
            // The lens changes areas by 1 % here.
            assert!((marker.area_px / round - 1.0).abs() < 0.02);
        }
    }

    #[test]
    fn from_behind_no_marker_has_an_image() {
        let (camera, model) = (models::demo_camera(), models::wing());
        for marker in truth(&camera, &pose(Vector3::x() * 3.0, [0.0, 0.0, 4.0]), &model) {
            assert_eq!((marker.centroid, marker.sight), (None, Sight::Hidden));
        }
    }

    #[test]
    fn at_the_border_some_markers_are_cut_and_some_outside() {
        let (camera, model) = (models::demo_camera(), models::wing());
        let left = camera.unproject(&Vector2::new(-0.5, 360.0)).expect("at the border");
        // The marker "mid" sits at x = 0.05: its middle is on the border.
        let depth = 4.0;
        let seen = truth(&camera, &pose(Vector3::zeros(), [left.x * depth - 0.05, -0.11, depth]), &model);
        assert_eq!(seen[4].sight, Sight::Part);
        assert_eq!((seen[0].sight, seen[3].sight), (Sight::Whole, Sight::Hidden));
        assert!(seen[3].centroid.is_some(), "it has an image beside the frame");
    }

    #[test]
    fn the_airframe_covers_what_is_behind_it() {
        use crate::target::{Marker, Target};
        let at = |id: &str, x: f64, y: f64, z: f64| Marker {
            id: id.into(),
            position: Point::new(x, y, z),
            radius_m: Some(0.02),
            normal: None,
        };
        let markers = vec![
            at("near", 0.0, 0.0, -0.1),
            at("far", 0.1, 0.1, 0.1),
            at("beside", 0.5, 0.0, 0.1),
            at("on", -0.1, 0.1, 0.0),
        ];
        let target = Target::checked("ball", markers).expect("a good target");
        let body = vec![[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]];
        let model = Model { body, ..Model::bare(target) };
        let seen = truth(&models::demo_camera(), &pose(Vector3::zeros(), [0.0, 0.0, 3.0]), &model);
        let sights: Vec<Sight> = seen.iter().map(|marker| marker.sight).collect();
        assert_eq!(sights, [Sight::Whole, Sight::Hidden, Sight::Whole, Sight::Whole]);
    }
}
