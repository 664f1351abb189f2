//! How the answer for one frame stands to the truth.

use super::truth::{BoxTruth, MarkerTruth, Presence, TargetTruth, Truth};
use super::verdict::{Candidate, DetectionVerdict, FalseAlarm, Hit, Outcome, PoseVerdict, TargetVerdict, Verdict};
use crate::camera::Pixel;
use crate::detect::{Centroid, Detection};
use crate::geometry::rotation::{EulerAngles, angle_between_rad};
use crate::geometry::{CameraFromTarget, PoseCovariance};
use crate::pipeline::TargetEstimate;
use crate::pose::{PoseAnswer, PoseEstimate};

/// A report is of a box if its place lies in it, grown by this to all sides: labels are drawn by hand, and of things of a few px.
pub const BOX_GROWTH_PX: f64 = 2.0;

/// A report is of a marker if it is within this of the centroid of its light. Detectors are off by a tenth of it, and
/// neighbouring markers that can be told apart are farther away.
pub const MARKER_REACH_PX: f64 = 3.0;

/// A right pose is turned by less than this: the mirrored minimum of a flat target is off by twice its tilt.
pub const RIGHT_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// A right pose is off by less than this share of the range.
pub const RIGHT_RANGE_RATIO: f64 = 0.05;

/// Chi-square with six degrees of freedom exceeds this once in a thousand.
const CHI_SQUARE_6_999: f64 = 22.458;

/// How what was found stands to the truth. `estimates` are those of the pipeline, at least one for each target of the truth, or
/// none where no pose was asked for.
#[must_use]
pub fn judge(truth: &Truth, detection: &Detection, estimates: &[TargetEstimate]) -> Verdict {
    let of_target = |(index, target): (usize, &TargetTruth)| {
        let estimate = estimates.iter().find(|estimate| estimate.target == index)?;
        Some(target_verdict(target, detection, estimate))
    };
    Verdict {
        detection: objects_of(truth).map(|objects| detection_verdict(&objects, &detection.centroids)),
        targets: truth.targets.iter().enumerate().filter_map(of_target).collect(),
    }
}

/// What a report can be of.
struct Object<'a> {
    middle: Pixel,
    /// A box, or a marker.
    outline: Option<&'a BoxTruth>,
    /// Whether it ought to be reported. A covered marker may be or not.
    counts: bool,
    range_m: Option<f64>,
}

impl Object<'_> {
    fn holds(&self, place: &Pixel) -> bool {
        match self.outline {
            Some(outline) => outline.holds(place, BOX_GROWTH_PX),
            None => (place - self.middle).norm() < MARKER_REACH_PX,
        }
    }
}

/// All that can be reported; `None` if that is not known.
fn objects_of(truth: &Truth) -> Option<Vec<Object<'_>>> {
    if let Some(boxes) = &truth.boxes {
        let object =
            |outline| Object { middle: BoxTruth::middle(outline), outline: Some(outline), counts: true, range_m: None };
        return Some(boxes.iter().map(object).collect());
    }
    if truth.targets.is_empty() || !truth.targets.iter().all(TargetTruth::tells_markers) {
        return None;
    }
    let objects = truth.targets.iter().flat_map(|target| {
        let range_m = range_of(target);
        target.markers.iter().flatten().filter_map(move |marker| match *marker {
            MarkerTruth::Unseen => None,
            MarkerTruth::Hidden(middle) => Some(Object { middle, outline: None, counts: false, range_m }),
            MarkerTruth::Visible(middle) => Some(Object { middle, outline: None, counts: true, range_m }),
        })
    });
    Some(objects.collect())
}

fn range_of(target: &TargetTruth) -> Option<f64> {
    target.camera_from_target.map(|pose| pose.translation.norm())
}

/// The surest report has the first choice among the things that it lies on and takes the nearest that is free, so that what holds
/// for a threshold of the score holds for the reports above it alone.
fn detection_verdict(objects: &[Object<'_>], centroids: &[Centroid]) -> DetectionVerdict {
    let mut reports: Vec<&Centroid> = centroids.iter().collect();
    reports.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut is_free = vec![true; objects.len()];
    let count = objects.iter().filter(|object| object.counts).count();
    let mut verdict =
        DetectionVerdict { objects: u32::try_from(count).unwrap_or(u32::MAX), ..DetectionVerdict::default() };
    for report in reports {
        let distance = |index: &usize| (report.pixel - objects[*index].middle).norm();
        let on: Vec<usize> = (0..objects.len()).filter(|&index| objects[index].holds(&report.pixel)).collect();
        let wanted = on.iter().copied().filter(|&index| objects[index].counts && is_free[index]);
        if let Some(taken) = wanted.min_by(|a, b| distance(a).total_cmp(&distance(b))) {
            is_free[taken] = false;
            verdict.hits.push(hit(&objects[taken], report));
        } else if on.iter().all(|&index| objects[index].counts) {
            verdict.false_alarms.push(FalseAlarm { score: report.score });
        }
    }
    verdict
}

fn hit(object: &Object<'_>, report: &Centroid) -> Hit {
    let error = report.pixel - object.middle;
    Hit {
        score: report.score,
        error_px: [error.x, error.y],
        sigma_px: object.outline.is_none().then_some(report.sigma_px),
        range_m: object.range_m,
        class: report.class,
        true_class: object.outline.and_then(|outline| outline.class.clone()),
    }
}

fn target_verdict(truth: &TargetTruth, detection: &Detection, estimate: &TargetEstimate) -> TargetVerdict {
    let count = |count: usize| u32::try_from(count).unwrap_or(u32::MAX);
    let place = |centroid: Option<usize>| detection.centroids.get(centroid?).map(|centroid| centroid.pixel);
    let (mut right_markers, mut wrong_markers) = (0, 0);
    for (marker, found) in estimate.centroid_of_marker.iter().enumerate() {
        let Some(found) = place(*found) else { continue };
        match truth.markers.as_ref().and_then(|markers| markers.get(marker)) {
            Some(MarkerTruth::Visible(known) | MarkerTruth::Hidden(known))
                if (found - known).norm() < MARKER_REACH_PX =>
            {
                right_markers += 1;
            }
            // Of a target that is not seen nothing is right.
            Some(_) => wrong_markers += 1,
            None => wrong_markers += u32::from(truth.presence != Presence::Seen),
        }
    }
    let answer = estimate.answer.as_ref();
    TargetVerdict {
        presence: truth.presence,
        is_solvable: truth.is_solvable(),
        is_detected: estimate.is_detected(),
        visible_markers: truth.tells_markers().then(|| count(truth.visible().count())),
        right_markers,
        wrong_markers,
        range_m: range_of(truth),
        outcome: outcome(truth, answer.ok()),
        reason: answer.err().map(|reason| reason.reason().to_owned()),
        pose: answer.ok().zip(truth.camera_from_target.as_ref()).map(|(answer, pose)| pose_verdict(answer, pose)),
    }
}

fn is_right(found: &CameraFromTarget, truth: &CameraFromTarget) -> bool {
    angle_between_rad(&found.rotation, &truth.rotation) < RIGHT_RAD
        && (found.translation - truth.translation).norm() < RIGHT_RANGE_RATIO * truth.translation.norm()
}

fn outcome(truth: &TargetTruth, answer: Option<&PoseAnswer>) -> Option<Outcome> {
    if truth.presence != Presence::Seen {
        return Some(if answer.is_some() { Outcome::Invented } else { Outcome::Refused });
    }
    let pose = truth.camera_from_target.as_ref()?;
    let right = |estimate: &PoseEstimate| is_right(&estimate.camera_from_target, pose);
    Some(match answer {
        None => Outcome::Missed,
        Some(answer) if right(&answer.best) => Outcome::Right,
        Some(answer) if answer.is_ambiguous() && answer.alternatives.iter().any(right) => Outcome::Flagged,
        Some(_) => Outcome::Wrong,
    })
}

fn pose_verdict(answer: &PoseAnswer, truth: &CameraFromTarget) -> PoseVerdict {
    let best = &answer.best;
    let found = &best.camera_from_target;
    let [true_angles, angles] = [truth, found]
        .map(|pose| EulerAngles::from_rotation(&pose.rotation))
        .map(|e| [e.roll_rad, e.pitch_rad, e.yaw_rad]);
    let all: Vec<&PoseEstimate> = std::iter::once(best).chain(&answer.alternatives).collect();
    let off_rad = |estimate: &PoseEstimate| angle_between_rad(&estimate.camera_from_target.rotation, &truth.rotation);
    let nearest = (0..all.len()).min_by(|&a, &b| off_rad(all[a]).total_cmp(&off_rad(all[b])));
    let candidate = |(index, estimate): (usize, &&PoseEstimate)| {
        let explained =
            normalized_squared(&estimate.covariance, &estimate.camera_from_target, truth) < CHI_SQUARE_6_999;
        let is_near = explained || is_right(&estimate.camera_from_target, truth);
        Candidate { probability: estimate.probability, is_right: nearest == Some(index) && is_near }
    };
    PoseVerdict {
        error: found.difference_to(truth).into(),
        euler_error_rad: std::array::from_fn(|axis| wrapped(true_angles[axis] - angles[axis])),
        normalized_squared: normalized_squared(&best.covariance, found, truth),
        is_reliable: best.covariance_reliable,
        probability: best.probability,
        candidates: all.iter().enumerate().map(candidate).collect(),
    }
}

/// Held within what sums can hold.
fn normalized_squared(covariance: &PoseCovariance, found: &CameraFromTarget, truth: &CameraFromTarget) -> f64 {
    covariance.normalized_error_squared(found, truth).min(1e12)
}

/// An angle in (-pi, pi].
fn wrapped(angle_rad: f64) -> f64 {
    let turned = angle_rad.rem_euclid(std::f64::consts::TAU);
    if turned > std::f64::consts::PI { turned - std::f64::consts::TAU } else { turned }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Region;

    fn report(x: f64, y: f64, score: f64) -> Centroid {
        let bounds = Region { x: 0, y: 0, width: 1, height: 1 };
        Centroid { pixel: Pixel::new(x, y), sigma_px: 0.5, area_px: 9.0, bounds, score, class: None, track_id: None }
    }

    fn outline(x: f64, y: f64) -> BoxTruth {
        BoxTruth { corner_px: [x, y], size_px: [10.0, 6.0], class: Some("bird".into()) }
    }

    #[test]
    fn a_thing_is_hit_once_by_its_surest_report_and_the_rest_are_false_alarms() {
        let truth = Truth { boxes: Some(vec![outline(100.0, 50.0), outline(300.0, 50.0)]), ..Truth::default() };
        // Two on the first, one 2 px beside the second, one 2.1 px below it, one nowhere.
        let centroids = vec![
            report(104.0, 52.0, 0.3),
            report(106.0, 53.0, 0.9),
            report(298.0, 50.0, 0.8),
            report(305.0, 58.1, 0.7),
            report(10.0, 10.0, 0.1),
        ];
        let verdict = judge(&truth, &Detection { centroids, refused: Vec::new() }, &[]).detection.expect("boxes");
        assert_eq!(verdict.objects, 2);
        assert_eq!(verdict.hits.iter().map(|hit| hit.score).collect::<Vec<_>>(), [0.9, 0.8]);
        let [across, down] = verdict.hits[0].error_px;
        assert!((across - 1.0).abs() < 1e-12 && down.abs() < 1e-12, "the middle is at (105, 53)");
        assert_eq!(verdict.false_alarms.iter().map(|alarm| alarm.score).collect::<Vec<_>>(), [0.7, 0.3, 0.1]);
    }

    #[test]
    fn a_covered_marker_may_be_reported_or_not() {
        let markers = vec![MarkerTruth::Visible(Pixel::new(50.0, 50.0)), MarkerTruth::Hidden(Pixel::new(80.0, 50.0))];
        let target = TargetTruth { presence: Presence::Seen, camera_from_target: None, markers: Some(markers) };
        let truth = Truth { targets: vec![target], boxes: None };
        let centroids = vec![report(50.5, 50.0, 1.0), report(81.0, 50.0, 0.9), report(53.1, 50.0, 0.8)];
        let verdict = judge(&truth, &Detection { centroids, refused: Vec::new() }, &[]).detection.expect("markers");
        assert_eq!((verdict.objects, verdict.hits.len(), verdict.false_alarms.len()), (1, 1, 1), "{verdict:?}");
    }

    #[test]
    fn what_is_not_known_is_not_judged() {
        let seen = TargetTruth { presence: Presence::Seen, camera_from_target: None, markers: None };
        let unknown = Truth { targets: vec![seen.clone()], boxes: None };
        assert_eq!(judge(&unknown, &Detection::default(), &[]).detection, None);
        let absent = TargetTruth { presence: Presence::Absent, ..seen };
        let empty = Truth { targets: vec![absent], boxes: None };
        assert_eq!(judge(&empty, &Detection::default(), &[]).detection, Some(DetectionVerdict::default()));
    }

    #[test]
    fn angles_are_told_the_short_way_round() {
        for (angle, short) in [(0.1, 0.1), (6.2, 6.2 - std::f64::consts::TAU), (-6.2, std::f64::consts::TAU - 6.2)] {
            assert!((wrapped(angle) - short).abs() < 1e-12, "{angle}");
        }
    }
}
