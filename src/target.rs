//! A target: the constellation of markers on the aircraft that is looked at.

use nalgebra::{Vector2, Vector3};
use thiserror::Error;

use crate::camera::{Camera, DiscImage};
use crate::geometry::{CameraFromTarget, Point, space};

pub mod spread;

pub use spread::Spread;

/// One marker of a constellation.
#[derive(Clone, Debug, PartialEq)]
pub struct Marker {
    /// Its name, unique within the target.
    pub id: String,
    /// Where its centre sits.
    pub position: Point<space::Target>,
    /// Radius of the disc or LED, metres, where known.
    pub radius_m: Option<f64>,
    /// Unit vector of the direction that it faces; it can be seen only from that side.
    pub normal: Option<Vector3<f64>>,
}

/// A constellation of four or more markers, not all on a line. Only [`Target::checked`] makes one.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    name: String,
    markers: Vec<Marker>,
    spread: Spread,
}

/// Why a set of markers is not a target.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum TargetError {
    /// Fewer markers than a pose needs.
    #[error("{found} markers: a target needs at least {need}")]
    TooFewMarkers {
        /// How many there are.
        found: usize,
        /// How many are needed.
        need: usize,
    },
    /// More markers than identification is built for.
    #[error("{found} markers: a target has at most {limit}")]
    TooManyMarkers {
        /// How many there are.
        found: usize,
        /// How many are allowed.
        limit: usize,
    },
    /// Two markers share an id.
    #[error("marker {index} has the id {id:?} of an earlier one")]
    DuplicateId {
        /// Position of the later one.
        index: usize,
        /// The shared id.
        id: String,
    },
    /// A marker without a name.
    #[error("marker {index} has an empty id")]
    EmptyId {
        /// Its position.
        index: usize,
    },
    /// Two markers sit at one place.
    #[error("markers {first} and {second} are {distance_m:.1e} m apart: no camera can tell them apart")]
    Coincident {
        /// Position of the one.
        first: usize,
        /// Position of the other.
        second: usize,
        /// Their distance, metres.
        distance_m: f64,
    },
    /// All markers on one line: the turn about it cannot be seen.
    #[error("markers are collinear: spread ratio {spread_ratio:.1e}, need {min_spread_ratio:.1e}")]
    Collinear {
        /// Second largest spread over the largest.
        spread_ratio: f64,
        /// The smallest that is accepted.
        min_spread_ratio: f64,
    },
    /// A number that is not finite, or a radius that is not positive, or a normal of no length.
    #[error("marker {index}: {field} = {value}: {need}")]
    Value {
        /// Position of the marker.
        index: usize,
        /// The contract's name of the field.
        field: &'static str,
        /// What was given.
        value: f64,
        /// What is accepted.
        need: &'static str,
    },
}

impl TargetError {
    /// Position of the marker at fault and the contract's name of its field, for a pointer into the request.
    #[must_use]
    pub const fn place(&self) -> Option<(usize, &'static str)> {
        match self {
            Self::TooFewMarkers { .. } | Self::TooManyMarkers { .. } | Self::Collinear { .. } => None,
            Self::DuplicateId { index, .. } | Self::EmptyId { index } => Some((*index, "id")),
            Self::Coincident { second, .. } => Some((*second, "position_m")),
            Self::Value { index, field, .. } => Some((*index, field)),
        }
    }
}

impl Target {
    /// Three markers leave up to four poses; the fourth decides.
    pub const MIN_MARKERS: usize = 4;
    /// Identification tries assignments; beyond this they are too many to try within a frame's time.
    pub const MAX_MARKERS: usize = 64;
    /// A constellation flatter than this towards a line gives no attitude.
    pub const MIN_SPREAD_RATIO: f64 = 1e-3;

    /// A target of these markers. Normals are brought to unit length.
    ///
    /// # Errors
    /// Names the marker and the field at fault, or says what the constellation lacks.
    pub fn checked(name: impl Into<String>, mut markers: Vec<Marker>) -> Result<Self, TargetError> {
        let found = markers.len();
        if found < Self::MIN_MARKERS {
            return Err(TargetError::TooFewMarkers { found, need: Self::MIN_MARKERS });
        }
        if found > Self::MAX_MARKERS {
            return Err(TargetError::TooManyMarkers { found, limit: Self::MAX_MARKERS });
        }
        for (index, marker) in markers.iter_mut().enumerate() {
            check_marker(index, marker)?;
        }
        check_distinct(&markers)?;
        let positions: Vec<_> = markers.iter().map(|m| m.position).collect();
        let spread = Spread::of(&positions);
        let spread_ratio = spread.line_ratio();
        if spread_ratio < Self::MIN_SPREAD_RATIO {
            return Err(TargetError::Collinear { spread_ratio, min_spread_ratio: Self::MIN_SPREAD_RATIO });
        }
        Ok(Self { name: name.into(), markers, spread })
    }

    /// The target's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its markers, at least four.
    #[must_use]
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// How the markers are spread in space.
    #[must_use]
    pub const fn spread(&self) -> &Spread {
        &self.spread
    }

    /// Cosine of the angle between the marker's normal and the direction to the camera: 1 face on, 0 edge on, negative from
    /// behind. `None` for a marker without a normal, which is seen from everywhere.
    #[must_use]
    pub fn facing_cosine(&self, index: usize, camera_from_target: &CameraFromTarget) -> Option<f64> {
        let marker = &self.markers[index];
        let towards_camera = -(*camera_from_target * marker.position).coords;
        marker.normal.map(|normal| (camera_from_target.rotation * normal).dot(&towards_camera) / towards_camera.norm())
    }

    /// Whether the marker's lit side is turned to the camera at this pose; true for a marker without a normal.
    #[must_use]
    pub fn faces_camera(&self, index: usize, camera_from_target: &CameraFromTarget) -> bool {
        self.facing_cosine(index, camera_from_target).is_none_or(|cosine| cosine > 0.0)
    }

    /// Image of the marker's disc; `None` for a marker without radius, or one whose attitude is not known, or where a part of
    /// it has no image. A disc without a normal lies in the plane of a flat target.
    #[must_use]
    pub fn disc_image(&self, index: usize, camera: &Camera, pose: &CameraFromTarget) -> Option<DiscImage> {
        let marker = &self.markers[index];
        let plane = || self.spread.is_coplanar().then(|| self.spread.axes.column(2).into_owned());
        let normal = marker.normal.or_else(plane)?;
        camera.disc_image(&(*pose * marker.position), &(pose.rotation * normal), marker.radius_m?)
    }

    /// By how much the centroid of the marker's image lies beside the image of its centre, px: zero for a marker of which no
    /// [`disc_image`](Self::disc_image) is known.
    #[must_use]
    pub fn centroid_offset(&self, index: usize, camera: &Camera, pose: &CameraFromTarget) -> Vector2<f64> {
        let offset = self.disc_image(index, camera, pose).and_then(|image| {
            let centre = camera.project(&(*pose * self.markers[index].position))?;
            Some(image.centroid - centre)
        });
        offset.unwrap_or_default()
    }
}

fn check_marker(index: usize, marker: &mut Marker) -> Result<(), TargetError> {
    let refuse = |field, value, need| Err(TargetError::Value { index, field, value, need });
    if marker.id.is_empty() {
        return Err(TargetError::EmptyId { index });
    }
    // A kilometre is beyond any airframe, and keeps squares and cubes of positions in range.
    if let Some(&value) = marker.position.coords.iter().find(|c| !(c.abs() <= 1e3)) {
        return refuse("position_m", value, "a finite number of metres within 1000 is needed");
    }
    if let Some(radius) = marker.radius_m
        && !(radius > 0.0 && radius <= 1e3)
    {
        return refuse("radius_m", radius, "a positive number of metres is needed");
    }
    if let Some(normal) = marker.normal {
        let length = normal.norm();
        if !(length > 1e-9 && length.is_finite()) {
            return refuse("normal", length, "a direction of non-zero, finite length is needed");
        }
        marker.normal = Some(normal / length);
    }
    Ok(())
}

fn check_distinct(markers: &[Marker]) -> Result<(), TargetError> {
    let extent = markers.iter().map(|m| m.position.coords.norm()).fold(0.0, f64::max);
    for (second, marker) in markers.iter().enumerate() {
        for (first, earlier) in markers[..second].iter().enumerate() {
            if earlier.id == marker.id {
                return Err(TargetError::DuplicateId { index: second, id: marker.id.clone() });
            }
            let distance_m = (earlier.position.coords - marker.position.coords).norm();
            if distance_m <= 1e-6 * extent {
                return Err(TargetError::Coincident { first, second, distance_m });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::models::wing_six;

    fn marker(id: &str, position: [f64; 3]) -> Marker {
        Marker { id: id.into(), position: position.into(), radius_m: Some(0.03), normal: None }
    }

    #[test]
    fn three_markers_are_refused() {
        let three = vec![marker("a", [0.0; 3]), marker("b", [1.0, 0.0, 0.0]), marker("c", [0.0, 1.0, 0.0])];
        assert_eq!(Target::checked("t", three), Err(TargetError::TooFewMarkers { found: 3, need: 4 }));
    }

    #[test]
    fn collinear_markers_are_refused_also_far_from_the_origin() {
        let line = (0..5).map(|i| marker(&i.to_string(), [100.0 + f64::from(i) * 0.1, 50.0, 7.0])).collect();
        assert!(matches!(Target::checked("t", line), Err(TargetError::Collinear { .. })));
    }

    #[test]
    fn duplicate_ids_coincident_places_and_bad_numbers_are_named() {
        let square = || {
            vec![
                marker("a", [0.0, 0.0, 0.0]),
                marker("b", [1.0, 0.0, 0.0]),
                marker("c", [0.0, 1.0, 0.0]),
                marker("d", [1.0, 1.0, 0.0]),
            ]
        };
        assert!(Target::checked("t", square()).is_ok());
        let place = |change: &dyn Fn(&mut Vec<Marker>)| {
            let mut markers = square();
            change(&mut markers);
            Target::checked("t", markers).expect_err("a bad target").place()
        };
        assert_eq!(place(&|m| m[2].id = "a".into()), Some((2, "id")));
        assert_eq!(place(&|m| m[2].id = String::new()), Some((2, "id")));
        assert_eq!(place(&|m| m[3].position = m[1].position), Some((3, "position_m")));
        assert_eq!(place(&|m| m[1].position.coords.z = f64::NAN), Some((1, "position_m")));
        assert_eq!(place(&|m| m[0].radius_m = Some(0.0)), Some((0, "radius_m")));
        assert_eq!(place(&|m| m[0].normal = Some(Vector3::zeros())), Some((0, "normal")));
    }

    #[test]
    fn a_marker_is_seen_only_from_the_side_it_faces() {
        let target = wing_six();
        let straight = CameraFromTarget::new(nalgebra::Rotation3::identity(), Vector3::new(0.0, 0.0, 5.0));
        assert!(target.faces_camera(0, &straight));
        let turned = CameraFromTarget::new(crate::geometry::rotation::exp(&(Vector3::x() * 3.0)), straight.translation);
        assert!(!target.faces_camera(0, &turned));
    }
}
