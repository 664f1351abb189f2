//! The surfaces of a target as the camera meets them, and which of them a ray hits first.

use nalgebra::{Matrix3, Vector2, Vector3};

use super::light::{Light, of_srgb, scaled};
use super::model::Model;
use super::outline::Outline;
use crate::camera::Normalized;
use crate::geometry::CameraFromTarget;

/// A disc that lies no deeper than this under the airframe's skin is painted on it, m.
const SKIN_M: f64 = 1e-3;

/// What a ray hits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Seen {
    /// Nothing of the target.
    Sky,
    /// The airframe, or the patch of this number on it.
    Body(Option<usize>),
    /// The marker of this number.
    Marker(usize),
}

/// A bundle of rays: a pixel or a square of pixels.
pub struct Cell {
    /// The ray through its middle.
    pub middle: Normalized,
    /// The rays through its corners.
    pub corners: [Normalized; 4],
}

/// A plane with a point as origin and two unit vectors as axes, in the camera's space.
struct Plane {
    from_ray: Matrix3<f64>,
}

/// Where a bundle of rays meets a plane.
enum Footprint {
    /// Nowhere: the plane is behind the camera.
    Nothing,
    /// Within `reach_m` of `middle`.
    Within { middle: Vector2<f64>, reach_m: f64 },
    /// Some rays meet it and some do not.
    Beyond,
}

impl Plane {
    /// `None` for a plane through the camera, of which nothing is seen.
    fn of(across: Vector3<f64>, down: Vector3<f64>, origin: Vector3<f64>) -> Option<Self> {
        // depth * ray = across * a + down * b + origin, so (a, b, 1) / depth = inverse * ray.
        let from_ray = Matrix3::from_columns(&[across, down, origin]).try_inverse()?;
        from_ray.iter().all(|x| x.is_finite()).then_some(Self { from_ray })
    }

    /// Where on the plane, metres, and how deep in the scene, metres along the optical axis.
    fn meet(&self, ray: &Normalized) -> Option<(Vector2<f64>, f64)> {
        let hit = self.from_ray * Vector3::new(ray.x, ray.y, 1.0);
        (hit.z > 0.0).then(|| (hit.xy() / hit.z, hit.z.recip()))
    }

    fn footprint(&self, cell: &Cell) -> Footprint {
        let hits = cell.corners.each_ref().map(|corner| self.meet(corner));
        match (self.meet(&cell.middle), hits) {
            (None, [None, None, None, None]) => Footprint::Nothing,
            (Some((middle, _)), [Some((a, _)), Some((b, _)), Some((c, _)), Some((d, _))]) => {
                let reach_m = [a, b, c, d].iter().map(|corner| (corner - middle).norm()).fold(0.0, f64::max);
                Footprint::Within { middle, reach_m }
            }
            _ => Footprint::Beyond,
        }
    }
}

struct Body {
    plane: Plane,
    outline: Outline,
    light: Light,
    paint: Vec<(usize, Outline, Light)>,
}

impl Body {
    fn of(model: &Model, pose: &CameraFromTarget) -> Option<Self> {
        let axes = pose.rotation.matrix();
        let (across, down, up) = (axes.column(0), axes.column(1), axes.column(2));
        let is_marked_side = up.dot(&pose.translation) > 0.0;
        let paint = model
            .paint
            .iter()
            .enumerate()
            .filter(|_| is_marked_side)
            .filter_map(|(index, patch)| Some((index, Outline::of(&patch.outline)?, of_srgb(patch.rgb))))
            .collect();
        Some(Self {
            plane: Plane::of(across.into_owned(), down.into_owned(), pose.translation)?,
            outline: Outline::of(&model.body)?,
            light: of_srgb(model.body_rgb),
            paint,
        })
    }

    /// What is seen at this place of the plane.
    fn at(&self, place: &Vector2<f64>) -> Seen {
        if !self.outline.contains(place) {
            return Seen::Sky;
        }
        let top = self.paint.iter().rev().find(|(_, outline, _)| outline.contains(place));
        Seen::Body(top.map(|(index, ..)| *index))
    }

    fn has_edge_within(&self, place: &Vector2<f64>, reach_m: f64) -> bool {
        self.outline.passes_within(place, reach_m)
            || self.paint.iter().any(|(_, outline, _)| outline.passes_within(place, reach_m))
    }
}

struct Disc {
    marker: usize,
    plane: Plane,
    radius_m: f64,
}

/// The unit normal, in the camera's space, of the disc that is seen of a marker at this pose; `None` where its lit side faces
/// away.
pub fn facing_normal(model: &Model, marker: usize, pose: &CameraFromTarget) -> Option<Vector3<f64>> {
    let placed = &model.target.markers()[marker];
    let towards = -(*pose * placed.position).coords.try_normalize(0.0)?;
    match placed.normal {
        Some(normal) => Some(pose.rotation * normal).filter(|normal| normal.dot(&towards) > 0.0),
        None if model.target.spread().is_coplanar() => {
            let normal = pose.rotation * model.target.spread().axes.column(2);
            Some(if normal.dot(&towards) < 0.0 { -normal } else { normal })
        }
        None => Some(towards),
    }
}

impl Disc {
    fn of(model: &Model, marker: usize, pose: &CameraFromTarget) -> Option<Self> {
        let placed = &model.target.markers()[marker];
        let normal = facing_normal(model, marker, pose)?;
        let mut least_aligned = Vector3::zeros();
        least_aligned[normal.iamin()] = 1.0;
        let across = normal.cross(&least_aligned).normalize();
        let plane = Plane::of(across, normal.cross(&across), (*pose * placed.position).coords)?;
        Some(Self { marker, plane, radius_m: placed.radius_m.unwrap_or(model.default_radius_m) })
    }
}

/// All surfaces of a target that turn towards the camera.
pub struct Surfaces {
    body: Option<Body>,
    discs: Vec<Disc>,
    marker_light: Light,
}

impl Surfaces {
    /// The surfaces of `model` at this pose.
    #[must_use]
    pub fn of(model: &Model, camera_from_target: &CameraFromTarget) -> Self {
        let markers = 0..model.target.markers().len();
        #[expect(clippy::cast_possible_truncation, reason = "light has three digits")]
        let gain = model.marker_gain as f32;
        Self {
            body: Body::of(model, camera_from_target),
            discs: markers.filter_map(|marker| Disc::of(model, marker, camera_from_target)).collect(),
            marker_light: scaled(of_srgb(model.marker_rgb), gain),
        }
    }

    /// What `ray` hits first.
    #[must_use]
    pub fn seen_by(&self, ray: &Normalized) -> Seen {
        let mut nearest = (Seen::Sky, f64::INFINITY);
        if let Some(body) = &self.body
            && let Some((place, depth)) = body.plane.meet(ray)
        {
            match body.at(&place) {
                Seen::Sky => {}
                hit => nearest = (hit, depth + SKIN_M),
            }
        }
        for disc in &self.discs {
            if let Some((place, depth)) = disc.plane.meet(ray)
                && place.norm_squared() <= disc.radius_m * disc.radius_m
                && depth < nearest.1
            {
                nearest = (Seen::Marker(disc.marker), depth);
            }
        }
        nearest.0
    }

    /// What all rays of the cell hit, if that is the same thing and it can be told without trying them.
    #[must_use]
    pub fn seen_by_all(&self, cell: &Cell) -> Option<Seen> {
        let mut layers = 0;
        if let Some(body) = &self.body {
            match body.plane.footprint(cell) {
                Footprint::Nothing => {}
                Footprint::Within { middle, reach_m } if !body.has_edge_within(&middle, reach_m) => {
                    layers += usize::from(body.outline.contains(&middle));
                }
                _ => return None,
            }
        }
        for disc in &self.discs {
            match disc.plane.footprint(cell) {
                Footprint::Nothing => {}
                Footprint::Within { middle, reach_m } if (middle.norm() - disc.radius_m).abs() > reach_m => {
                    layers += usize::from(middle.norm() < disc.radius_m);
                }
                _ => return None,
            }
        }
        // Where two lie over each other, which is in front may change within the cell.
        (layers <= 1).then(|| self.seen_by(&cell.middle))
    }

    /// The light that comes from there; `sky` from nowhere.
    #[must_use]
    pub fn light_of(&self, seen: Seen, sky: Light) -> Light {
        match (seen, &self.body) {
            (Seen::Sky, _) | (Seen::Body(_), None) => sky,
            (Seen::Marker(_), _) => self.marker_light,
            (Seen::Body(patch), Some(body)) => {
                let painted = patch.and_then(|patch| body.paint.iter().find(|(index, ..)| *index == patch));
                painted.map_or(body.light, |(.., light)| *light)
            }
        }
    }
}
