//! A line of text for each target at the top of the frame.

use super::canvas::{Box, Canvas, Ink};
use super::label::Labels;
use super::palette::{DARK, of_target};
use super::scale::Scale;
use super::text::shortened;
use super::{Overlay, Sought};
use crate::pose::{PoseAnswer, PoseEstimate};

/// What is said of a target: its name, how many of its markers were found, range and probability, or why there is no pose.
fn sentence(sought: &Sought<'_>) -> String {
    let found = sought.estimate.centroid_of_marker.iter().flatten().count();
    let name = shortened(sought.target.name(), 24);
    let markers = format!("{found}/{} markers", sought.target.markers().len());
    match &sought.estimate.answer {
        Err(reason) => format!("{name}  {markers}  no pose, {}: {reason}", reason.reason()),
        Ok(answer) => {
            let others: Vec<String> = answer
                .alternatives
                .iter()
                .filter(|alternative| alternative.probability >= PoseAnswer::AMBIGUOUS_FROM)
                .map(|alternative| probability(alternative.probability))
                .collect();
            let rivals = if others.is_empty() { String::new() } else { format!(" or {}", others.join(", ")) };
            format!("{name}  {markers}  {}  p {}{rivals}", range(&answer.best), probability(answer.best.probability))
        }
    }
}

/// Range with its standard deviation, to the digit that this makes sense of.
fn range(estimate: &PoseEstimate) -> String {
    let translation = estimate.camera_from_target.translation;
    let range_m = translation.norm();
    let towards = translation / range_m;
    let covariance = estimate.covariance.matrix().fixed_view::<3, 3>(0, 0).into_owned();
    let sigma_m = (towards.transpose() * covariance * towards)[(0, 0)].max(0.0).sqrt();
    let digits = match sigma_m {
        sigma if sigma < 0.001 => 4,
        sigma if sigma < 0.02 => 3,
        sigma if sigma < 0.2 => 2,
        sigma if sigma < 2.0 => 1,
        _ => 0,
    };
    format!("{range_m:.digits$} \u{b1}{sigma_m:.digits$} m")
}

/// Two digits, never rounded to certainty.
fn probability(value: f64) -> String {
    if value > 0.995 { ">0.99".to_owned() } else { format!("{value:.2}") }
}

fn strip(frame: Box, scale: Scale, line: usize, text: &str) -> Box {
    let (margin, pitch) = (scale.headline.height_px() / 3, scale.headline.height_px() * 5 / 3);
    let y = i32::try_from(line).unwrap_or(i32::MAX).saturating_mul(pitch);
    let width = scale.headline.width_px(text).saturating_add(2 * margin);
    Box { x: 0, y, width: width.min(frame.width), height: pitch }
}

/// The lines with the boxes in which they stand.
fn lines<'a>(
    frame: Box,
    scale: Scale,
    overlay: &'a Overlay<'_>,
) -> impl Iterator<Item = (usize, String, Box)> + use<'a> {
    let room = frame.width / scale.headline.advance_px().max(1) - 2;
    let limit = usize::try_from(room).unwrap_or(0);
    overlay.targets.iter().enumerate().map(move |(index, sought)| {
        let text = shortened(&sentence(sought), limit);
        let area = strip(frame, scale, index, &text);
        (index, text, area)
    })
}

/// Keeps labels away from the lines.
pub(super) fn reserve(labels: &mut Labels, scale: Scale, overlay: &Overlay<'_>) {
    for (_, _, area) in lines(labels.frame(), scale, overlay) {
        labels.keep_clear(area);
    }
}

/// Writes the lines, each in its target's colour.
pub(super) fn draw(canvas: &mut Canvas, scale: Scale, overlay: &Overlay<'_>) {
    for (index, text, area) in lines(canvas.bounds(), scale, overlay) {
        canvas.fill(area, Ink { rgb: DARK, opacity: 0.65 });
        let margin = scale.headline.height_px() / 3;
        scale.headline.write(canvas, area.x + margin, area.y + margin, &text, Ink::solid(of_target(index)));
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Rotation3, Vector3};

    use super::*;
    use crate::geometry::{CameraFromTarget, PoseCovariance};
    use crate::pipeline::TargetEstimate;
    use crate::pose::NoPose;
    use crate::scene::models;
    use crate::solve::Solver;

    fn estimate(sigma_m: f64, probability: f64) -> PoseEstimate {
        PoseEstimate {
            camera_from_target: CameraFromTarget::new(Rotation3::identity(), Vector3::new(3.0, 0.0, 4.0)),
            covariance: PoseCovariance::checked(Matrix6::identity() * sigma_m * sigma_m).expect("positive definite"),
            covariance_reliable: true,
            reprojection_rms_px: 0.1,
            probability,
        }
    }

    fn told(found: usize, answer: Result<PoseAnswer, NoPose>) -> String {
        let centroid_of_marker = (0..6).map(|marker| Some(marker).filter(|&marker| marker < found)).collect();
        sentence(&Sought {
            target: &models::wing_six(),
            estimate: &TargetEstimate { target: 0, centroid_of_marker, answer },
        })
    }

    #[test]
    fn a_pose_is_told_with_its_range_and_its_rivals() {
        let answer = |best, alternatives| {
            Ok(PoseAnswer { best, alternatives, solver: Solver::Ippe, noise_scale: 1.0, ln_evidence: 0.0 })
        };
        assert_eq!(
            told(6, answer(estimate(0.03, 0.999), vec![estimate(0.03, 0.001)])),
            "wing-six  6/6 markers  5.00 \u{b1}0.03 m  p >0.99"
        );
        assert_eq!(
            told(5, answer(estimate(0.5, 0.6), vec![estimate(0.5, 0.4)])),
            "wing-six  5/6 markers  5.0 \u{b1}0.5 m  p 0.60 or 0.40"
        );
    }

    #[test]
    fn no_pose_is_told_with_its_reason() {
        assert_eq!(
            told(0, Err(NoPose::TooFewPoints { given: 2, need: 4 })),
            "wing-six  0/6 markers  no pose, too_few_points: 2 points, but at least 4 are needed"
        );
    }
}
