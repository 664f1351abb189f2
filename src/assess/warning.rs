//! What is wrong with a constellation, whatever the noise.

use std::fmt;

use super::congruence::{Congruence, congruences};
use super::sight::MERGING_GAP_PX;
use super::stage::{Stage, extent_m};
use crate::target::Target;

/// Places within this share of the extent count as the same: what tape measure and glue leave.
const SAME_PLACE_RATIO: f64 = 0.02;

/// However small the target appears, places further apart than this share of the extent are different.
const MAX_SAME_PLACE_RATIO: f64 = 0.1;

/// Two images of a marker closer than this many standard deviations do not tell its places apart.
const TOLD_APART_DEVIATIONS: f64 = 3.0;

/// Flatter than this, a target has two poses that look nearly alike; deeper, the second is found out from near by.
const FLAT_RATIO: f64 = 0.05;

/// Narrower than this, the turn about the long axis is poorly seen.
const NARROW_RATIO: f64 = 0.15;

/// Gaps between markers below this share of the extent close long before the target is too small.
const NARROW_GAP_RATIO: f64 = 0.08;

/// Something that moving or marking markers would better. The display tells the numbers.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// The constellation looks the same when it is turned: poses that nobody can tell apart.
    Symmetric {
        /// For each marker the ids of it and of the one onto which it falls, in the smallest turn.
        image_of: Vec<(String, String)>,
        /// The smallest turn.
        angle_rad: f64,
        /// How many turns there are.
        turns: usize,
    },
    /// The constellation is its own mirror image in depth: far away, two poses look the same.
    OwnMirrorImage {
        /// For each marker the ids of it and of its mirror image.
        image_of: Vec<(String, String)>,
    },
    /// Another target is the same constellation.
    SameAs {
        /// The other's name.
        name: String,
    },
    /// Another target is the mirror image.
    MirrorImageOf {
        /// The other's name.
        name: String,
    },
    /// All markers (nearly) in a plane: two attitudes look alike.
    Flat {
        /// Extent across the plane over the largest extent, root mean square.
        plane_ratio: f64,
    },
    /// All markers nearly in a line: the turn about it is poorly seen.
    NearlyCollinear {
        /// Second extent over the largest, root mean square.
        spread_ratio: f64,
    },
    /// Blobs of two markers grow together early.
    TooClose {
        /// The markers' ids.
        ids: [String; 2],
        /// Distance of their centres.
        distance_m: f64,
        /// Seen face on, they are one blob from here on; zero if they overlap.
        merged_from_m: f64,
    },
    /// Markers of unknown size: their blobs' areas say nothing.
    RadiusUnknown {
        /// The markers' ids.
        ids: Vec<String>,
    },
    /// Markers of which nobody knows from where they are seen.
    NormalUnknown {
        /// The markers' ids.
        ids: Vec<String>,
    },
    /// As many markers as make a detection: none may be hidden.
    NoneToSpare {
        /// How many there are.
        markers: usize,
    },
    /// Ranges at which identification is told not to expect a target.
    RangeNotExpected {
        /// Nearest and farthest range that it expects.
        expected_m: [f64; 2],
    },
}

impl Warning {
    /// One word for programs.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Symmetric { .. } => "symmetric",
            Self::OwnMirrorImage { .. } => "own_mirror_image",
            Self::SameAs { .. } => "same_as_other",
            Self::MirrorImageOf { .. } => "mirror_image_of_other",
            Self::Flat { .. } => "flat",
            Self::NearlyCollinear { .. } => "nearly_collinear",
            Self::TooClose { .. } => "too_close",
            Self::RadiusUnknown { .. } => "radius_unknown",
            Self::NormalUnknown { .. } => "normal_unknown",
            Self::NoneToSpare { .. } => "none_to_spare",
            Self::RangeNotExpected { .. } => "range_not_expected",
        }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Symmetric { image_of, angle_rad, turns } => write!(
                f,
                "turned by {:.0} degrees it looks the same ({}); {}: as the markers look alike, these poses cannot be told \
                 apart at any range",
                angle_rad.to_degrees(),
                moves(image_of),
                if *turns == 1 { "there is one such turn".into() } else { format!("there are {turns} such turns") },
            ),
            Self::OwnMirrorImage { image_of } => write!(
                f,
                "it is its own mirror image ({}): far away, where perspective cannot be seen, two poses look the same",
                moves(image_of)
            ),
            Self::SameAs { name } => {
                write!(f, "{name:?} is the same constellation: which of the two it is cannot be seen")
            }
            Self::MirrorImageOf { name } => write!(
                f,
                "{name:?} is its mirror image: the two are told apart only by the side from which they are seen or, in space, \
                 by perspective"
            ),
            Self::Flat { plane_ratio } => write!(
                f,
                "the markers lie in a plane (depth {:.1} % of the width): two attitudes, mirrored about the line of sight, look \
                 alike",
                plane_ratio * 100.0
            ),
            Self::NearlyCollinear { spread_ratio } => write!(
                f,
                "the markers lie nearly in a line (width {:.0} % of the length): the turn about it is poorly seen",
                spread_ratio * 100.0
            ),
            Self::TooClose { ids: [a, b], distance_m, merged_from_m } => write!(
                f,
                "{a} and {b} are only {:.0} mm apart: even seen face on they are one blob from {merged_from_m:.1} m on",
                distance_m * 1e3
            ),
            Self::RadiusUnknown { ids } => write!(
                f,
                "no radius is given for {}: the areas of blobs cannot help, and when they grow together is not known",
                listed(ids)
            ),
            Self::NormalUnknown { ids } => write!(
                f,
                "no normal is given for {}: they are taken to be seen from everywhere, and poses from behind are not ruled out",
                listed(ids)
            ),
            Self::NoneToSpare { markers } => {
                write!(f, "{markers} markers make a detection and there are no more: with one hidden there is no pose")
            }
            Self::RangeNotExpected { expected_m: [nearest, farthest] } => write!(
                f,
                "identification expects targets from {nearest} to {farthest} m (settings); beyond, none is identified"
            ),
        }
    }
}

/// "a to b, b to c", of the markers that move.
fn moves(image_of: &[(String, String)]) -> String {
    listed(&image_of.iter().filter(|(a, b)| a != b).map(|(a, b)| format!("{a} to {b}")).collect::<Vec<_>>())
}

/// The first few by name.
fn listed(words: &[String]) -> String {
    const SHOWN: usize = 6;
    let rest = if words.len() > SHOWN { format!(" and {} more", words.len() - SHOWN) } else { String::new() };
    format!("{}{rest}", words[..words.len().min(SHOWN)].join(", "))
}

/// Everything that is to be said, the worst first.
pub(super) fn warnings(
    stage: &Stage<'_>,
    others: &[Target],
    ranges_m: &[f64],
    pixel_sigma: f64,
    identify: &crate::identify::IdentifyOptions,
) -> Vec<Warning> {
    let target = stage.target;
    let mut found = Vec::new();
    let middle_m = ranges_m.first().zip(ranges_m.last()).map_or(1.0, |(nearest, farthest)| (nearest * farthest).sqrt());
    let tolerance_m = tolerance_m(stage, middle_m, pixel_sigma);
    found.extend(symmetries(target, tolerance_m));
    for other in others {
        let name = other.name().to_owned();
        if !congruences(target, other, false, tolerance_m).is_empty() {
            found.push(Warning::SameAs { name });
        } else if !congruences(target, other, true, tolerance_m).is_empty() {
            found.push(Warning::MirrorImageOf { name });
        }
    }
    let spread = target.spread();
    if spread.line_ratio() < NARROW_RATIO {
        found.push(Warning::NearlyCollinear { spread_ratio: spread.line_ratio() });
    }
    if spread.plane_ratio() < FLAT_RATIO {
        found.push(Warning::Flat { plane_ratio: spread.plane_ratio() });
    }
    found.extend(too_close(stage));
    let markers = target.markers();
    let ids = |lacks: fn(&crate::target::Marker) -> bool| -> Vec<String> {
        markers.iter().filter(|marker| lacks(marker)).map(|marker| marker.id.clone()).collect()
    };
    let without_normal = ids(|marker| marker.normal.is_none());
    if !without_normal.is_empty() {
        found.push(Warning::NormalUnknown { ids: without_normal });
    }
    let without_radius = ids(|marker| marker.radius_m.is_none());
    if !without_radius.is_empty() {
        found.push(Warning::RadiusUnknown { ids: without_radius });
    }
    if markers.len() <= identify.min_markers {
        found.push(Warning::NoneToSpare { markers: markers.len() });
    }
    let [nearest, farthest] = identify.range_m;
    if ranges_m.iter().any(|range| !(nearest..=farthest).contains(range)) {
        found.push(Warning::RangeNotExpected { expected_m: identify.range_m });
    }
    found
}

/// Places nearer than this cannot be told apart by who measures the target, nor at this range by the camera.
fn tolerance_m(stage: &Stage<'_>, range_m: f64, pixel_sigma: f64) -> f64 {
    let extent_m = extent_m(stage.target);
    let told_apart_m = TOLD_APART_DEVIATIONS * pixel_sigma * range_m / stage.magnification_px;
    told_apart_m.clamp(SAME_PLACE_RATIO * extent_m, MAX_SAME_PLACE_RATIO * extent_m)
}

fn symmetries(target: &Target, tolerance_m: f64) -> Option<Warning> {
    let named = |congruence: &Congruence| {
        let id = |marker: usize| target.markers()[marker].id.clone();
        congruence.image_of.iter().enumerate().map(|(marker, image)| (id(marker), id(*image))).collect()
    };
    let turns: Vec<Congruence> =
        congruences(target, target, false, tolerance_m).into_iter().filter(|c| !c.is_identity()).collect();
    if let Some(smallest) = turns.first() {
        let (image_of, angle_rad) = (named(smallest), smallest.angle_rad);
        return Some(Warning::Symmetric { image_of, angle_rad, turns: turns.len() });
    }
    // A flat target is always its own mirror image in its plane; that is what `Flat` says.
    if target.spread().is_coplanar() {
        return None;
    }
    let mirrored = congruences(target, target, true, tolerance_m);
    mirrored.iter().find(|c| !c.is_identity()).map(|c| Warning::OwnMirrorImage { image_of: named(c) })
}

/// The pair with the narrowest gap, if that closes early.
fn too_close(stage: &Stage<'_>) -> Option<Warning> {
    let markers = stage.target.markers();
    let pairs = markers.iter().enumerate().flat_map(|(i, a)| markers[..i].iter().map(move |b| (b, a)));
    let (a, b, distance_m, gap_m) = pairs
        .map(|(a, b)| {
            let distance_m = (a.position.coords - b.position.coords).norm();
            (a, b, distance_m, distance_m - a.radius_m.unwrap_or(0.0) - b.radius_m.unwrap_or(0.0))
        })
        .min_by(|p, q| p.3.total_cmp(&q.3))?;
    (gap_m < NARROW_GAP_RATIO * extent_m(stage.target)).then(|| Warning::TooClose {
        ids: [a.id.clone(), b.id.clone()],
        distance_m,
        merged_from_m: gap_m.max(0.0) * stage.magnification_px / MERGING_GAP_PX,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assess::tests::{flat_target, kinds, target};
    use crate::identify::IdentifyOptions;
    use crate::scene::models::{demo_camera, wing_six};

    fn of(target: &Target, others: &[Target]) -> Vec<Warning> {
        let camera = demo_camera();
        warnings(&Stage::of(&camera, target), others, &[1.0, 30.0], 0.3, &IdentifyOptions::default())
    }

    #[test]
    fn a_constellation_without_symmetry_has_no_warning_of_one() {
        assert_eq!(kinds(&of(&wing_six(), &[])), ["flat"]);
    }

    #[test]
    fn a_square_is_warned_of_with_its_smallest_turn() {
        let square = flat_target(&[[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3]], true);
        let found = of(&square, &[]);
        let Warning::Symmetric { image_of, angle_rad, turns } = &found[0] else { panic!("{found:?}") };
        assert!((angle_rad.to_degrees() - 90.0).abs() < 1e-6);
        assert_eq!((*turns, image_of.len()), (3, 4));
        assert!(image_of.iter().all(|(a, b)| a != b));
        assert!(kinds(&found).contains(&"none_to_spare"));
    }

    #[test]
    fn a_constellation_in_space_that_is_its_own_mirror_image_is_warned_of() {
        // Mirrored in the plane y = 0, and without a turn.
        let achiral =
            target(&[[0.4, 0.0, 0.0], [-0.2, 0.3, 0.0], [-0.2, -0.3, 0.0], [0.1, 0.0, 0.25], [-0.3, 0.0, 0.1]]);
        let found = of(&achiral, &[]);
        assert!(matches!(&found[0], Warning::OwnMirrorImage { image_of } if image_of[1].1 == "2"), "{found:?}");
        let chiral =
            target(&[[0.4, 0.0, 0.0], [-0.2, 0.3, 0.0], [-0.2, -0.3, 0.2], [0.1, 0.0, 0.25], [-0.3, 0.0, 0.1]]);
        assert!(!kinds(&of(&chiral, &[])).contains(&"own_mirror_image"));
    }

    #[test]
    fn others_in_the_same_sky_are_compared() {
        let mirrored: Vec<[f64; 2]> =
            wing_six().markers().iter().map(|m| [m.position.coords.x, -m.position.coords.y]).collect();
        let found = of(&wing_six(), &[wing_six(), flat_target(&mirrored, true), flat_target(&mirrored[..5], true)]);
        assert_eq!(found[0], Warning::SameAs { name: "wing-six".into() });
        assert_eq!(found[1], Warning::MirrorImageOf { name: "t".into() });
        assert_eq!(kinds(&found)[2], "flat", "a target of five is another");
    }

    #[test]
    fn markers_that_nearly_touch_or_lack_a_size_are_named() {
        let near = flat_target(&[[0.3, 0.3], [-0.3, 0.25], [-0.3, -0.3], [0.3, -0.1], [0.3, 0.27]], true);
        let found = of(&near, &[]);
        let Some(Warning::TooClose { ids, merged_from_m, .. }) = found.iter().find(|w| w.kind() == "too_close") else {
            panic!("{found:?}")
        };
        assert_eq!(ids, &["0", "4"]);
        // A gap of 30 mm is 2 px wide at 15 m with a focal length of 1000 px.
        assert!((merged_from_m - 15.0).abs() < 0.1, "{merged_from_m}");
        assert!(kinds(&found).contains(&"radius_unknown") && !kinds(&found).contains(&"normal_unknown"));
    }
}
