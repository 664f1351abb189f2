//! Markers whose light is not where the target has it.
//!
//! Of a disc that is partly hidden, or that blends with what is beside it, the centroid of what is seen lies aside, and its own deviation
//! cannot know. The other markers do. Where all together leave more than they state, each is weighed as one whose light lies aside by as
//! much as a part of a disc can: it then hardly counts, at the price of being improbable beforehand. What is answered is the mixture, each
//! reading with the evidence for it (Box and Tiao 1968, "A Bayesian approach to some outlier problems").

use super::merge::{NEGLIGIBLE, merged};
use crate::camera::Camera;
use crate::pose::{NoPose, Noise, PoseAnswer, PoseOptions, estimate_pose};
use crate::refine::Correspondence;

/// How many markers are displaced, before anything is seen.
const SHARE: f64 = 0.02;

/// How far the centroid of a part of a disc lies from that of the whole, per axis, in radii of what is seen.
const DISPLACEMENT: f64 = 0.5;

/// How often deviations are all too small, by a factor that the residuals tell.
const UNDERSTATED: f64 = 0.1;

/// So many markers must be where they should: they alone determine the pose.
const MIN_TRUE: usize = 4;

/// A pose and what it says of the markers.
#[derive(Clone, Debug)]
pub(super) struct Weighed {
    pub answer: PoseAnswer,
    /// Of the pairs, by how much the light of each lies aside, px: the deviation, 0 where it is more probably where it should be.
    pub displacement_px: Vec<f64>,
}

/// One reading of the pairs.
struct Reading {
    displaced: Vec<bool>,
    ln_weight: f64,
    answer: PoseAnswer,
}

impl Reading {
    /// Of pairs that are so probably displaced beforehand. Where residuals are larger than stated, all are by the same factor: what is
    /// seen is as probable as that makes it.
    fn of(displaced: Vec<bool>, ln_prior: f64, answer: PoseAnswer) -> Self {
        let freedom = (2 * displaced.len()).saturating_sub(6) as f64;
        let scale = answer.noise_scale;
        let of_scale =
            if scale > 1.0 { UNDERSTATED.ln() + freedom * (0.5 * (scale * scale - 1.0) - scale.ln()) } else { 0.0 };
        Self { displaced, ln_weight: ln_prior + answer.ln_evidence + of_scale, answer }
    }

    /// Residuals are what they are stated to be.
    fn explains(&self) -> bool {
        self.answer.noise_scale <= 1.0
    }
}

/// The pose of `pairs`, of which each shows a thing of this radius, px, in the picture; `None` where that is not known.
///
/// # Errors
/// Those of [`estimate_pose`], where no reading has a pose.
pub(super) fn weighed(
    camera: &Camera,
    pairs: &[Correspondence],
    radii_px: &[Option<f64>],
    options: &PoseOptions,
) -> Result<Weighed, NoPose> {
    let count = pairs.len();
    let plain = estimate_pose(camera, pairs, options);
    let is_explained = plain.as_ref().is_ok_and(|answer| answer.noise_scale <= 1.0);
    let is_other = plain.as_ref().is_err_and(|reason| !matches!(reason, NoPose::HighResidual { .. }));
    // A method by name is that method on all pairs.
    if is_explained || is_other || options.solver.is_some() || options.noise != Noise::Stated {
        return plain.map(|answer| Weighed { answer, displacement_px: vec![0.0; count] });
    }
    let mut displaced = vec![false; count];
    let mut readings: Vec<Reading> =
        plain.clone().into_iter().map(|answer| Reading::of(displaced.clone(), 0.0, answer)).collect();
    for _ in MIN_TRUE..count {
        let one_more = (0..count).filter(|&pair| !displaced[pair]).filter_map(|pair| {
            let mut displaced = displaced.clone();
            displaced[pair] = true;
            read(camera, pairs, radii_px, displaced, options)
        });
        readings.extend(one_more);
        match best(&readings) {
            Some(best) if !best.explains() && best.displaced != displaced => displaced.clone_from(&best.displaced),
            _ => break,
        }
    }
    if readings.is_empty() {
        return plain.map(|answer| Weighed { answer, displacement_px: vec![0.0; count] });
    }
    Ok(mixture(readings, pairs, radii_px))
}

fn best(readings: &[Reading]) -> Option<&Reading> {
    readings.iter().max_by(|a, b| a.ln_weight.total_cmp(&b.ln_weight))
}

/// The pairs if the light of these is displaced; `None` where no pose explains them, or how large one is is not known.
fn read(
    camera: &Camera,
    pairs: &[Correspondence],
    radii_px: &[Option<f64>],
    displaced: Vec<bool>,
    options: &PoseOptions,
) -> Option<Reading> {
    let mut ln_prior = 0.0;
    let mut wider = pairs.to_vec();
    for (index, pair) in wider.iter_mut().enumerate().filter(|(index, _)| displaced[*index]) {
        let stated_px = pair.sigma_px;
        pair.sigma_px = stated_px.hypot(displacement_px(radii_px[index]?));
        ln_prior += (SHARE / (1.0 - SHARE)).ln() - 2.0 * (pair.sigma_px / stated_px).ln();
    }
    let answer = estimate_pose(camera, &wider, options).ok()?;
    Some(Reading::of(displaced, ln_prior, answer))
}

fn displacement_px(radius_px: f64) -> f64 {
    DISPLACEMENT * radius_px.max(1.0)
}

/// `readings` are not empty.
fn mixture(mut readings: Vec<Reading>, pairs: &[Correspondence], radii_px: &[Option<f64>]) -> Weighed {
    readings.sort_by(|a, b| b.ln_weight.total_cmp(&a.ln_weight));
    let most = readings[0].ln_weight;
    let total: f64 = readings.iter().map(|reading| (reading.ln_weight - most).exp()).sum();
    let share = |reading: &Reading| (reading.ln_weight - most).exp() / total;
    let displacement_px = |pair: usize| {
        let probability: f64 = readings.iter().filter(|reading| reading.displaced[pair]).map(share).sum();
        radii_px[pair].filter(|_| probability > 0.5).map_or(0.0, displacement_px)
    };
    let displacement_px = (0..pairs.len()).map(displacement_px).collect();
    let of = |reading: &Reading| (share(reading), reading.answer.clone());
    let rivals = readings[1..].iter().map(of).filter(|(share, _)| *share >= NEGLIGIBLE);
    let answer = PoseAnswer { ln_evidence: most + total.ln(), ..merged(of(&readings[0]), rivals) };
    Weighed { answer, displacement_px }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;
    use rand::RngExt;

    use super::*;
    use crate::geometry::CameraFromTarget;
    use crate::random::{case, normal2};
    use crate::scene::flight::Flight;
    use crate::scene::models::{demo_camera, wing_six};
    use crate::solve::Solver;

    const SIGMA_PX: f64 = 0.03;

    /// Where the camera sees the wing's markers, with noise of `noise_px`, at some pose.
    fn seen(number: u64, noise_px: f64) -> (Camera, CameraFromTarget, Vec<Correspondence>) {
        let (camera, target) = (demo_camera(), wing_six());
        let mut rng = case("displaced light", number);
        let flight = Flight::ALL[0];
        let pose = flight.pose(rng.random_range(0..flight.len()));
        let pair = |marker: &crate::target::Marker| {
            let pixel = camera.project(&(pose * marker.position)).expect("in view") + normal2(&mut rng) * noise_px;
            Correspondence { point: marker.position, pixel, sigma_px: SIGMA_PX }
        };
        let pairs = target.markers().iter().map(pair).collect();
        (camera, pose, pairs)
    }

    const RADII_PX: [Option<f64>; 6] = [Some(6.0); 6];

    fn squared_error(weighed: &Weighed, pose: &CameraFromTarget) -> f64 {
        let best = &weighed.answer.best;
        best.covariance.normalized_error_squared(&best.camera_from_target, pose)
    }

    #[test]
    fn light_that_lies_aside_is_found_and_spoils_no_pose() {
        let (mut right, mut inside, mut named, cases) = (0, 0, 0, 100);
        for number in 0..cases {
            let (camera, pose, mut pairs) = seen(number, SIGMA_PX);
            let hidden = usize::try_from(number % 6).expect("small");
            let turn = 0.7 * number as f64;
            pairs[hidden].pixel += Vector2::new(turn.cos(), turn.sin()) * 2.5;
            assert!(estimate_pose(&camera, &pairs, &PoseOptions::default()).is_err(), "without a word there is none");
            let found = weighed(&camera, &pairs, &RADII_PX, &PoseOptions::default()).expect("a pose");
            let error = squared_error(&found, &pose);
            let is_listed = found
                .answer
                .alternatives
                .iter()
                .any(|other| other.covariance.normalized_error_squared(&other.camera_from_target, &pose) < 30.0);
            right += i32::from(error < 30.0 || is_listed);
            inside += i32::from(error < 12.59);
            let displaced: Vec<usize> = (0..6).filter(|&pair| found.displacement_px[pair] > 0.0).collect();
            named += i32::from(displaced == [hidden]);
        }
        println!("{right} right, {inside} inside their 95 %, {named} named, of {cases}");
        assert!(right >= 97 && inside >= 85 && named >= 85, "{right} right, {inside} inside, {named} named");
    }

    #[test]
    fn where_all_say_too_little_none_is_blamed() {
        let (mut blamed, mut inside, mut count, mut inside_plainly) = (0, 0, 0, 0);
        for number in 0..100 {
            let (camera, pose, pairs) = seen(number, 2.5 * SIGMA_PX);
            let Ok(found) = weighed(&camera, &pairs, &RADII_PX, &PoseOptions::default()) else { continue };
            count += 1;
            blamed += i32::from(found.displacement_px.iter().any(|displacement| *displacement > 0.0));
            inside += i32::from(squared_error(&found, &pose) < 22.5);
            let plain = estimate_pose(&camera, &pairs, &PoseOptions::default()).expect("a pose");
            let plain = Weighed { answer: plain, displacement_px: Vec::new() };
            inside_plainly += i32::from(squared_error(&plain, &pose) < 22.5);
        }
        println!("{blamed} blamed, {inside} inside their 99.9 %, plainly {inside_plainly}, of {count}");
        assert!(count >= 95 && blamed <= 5, "{blamed} blamed of {count}");
        // A noise that residuals alone tell has a long tail, with six degrees of freedom; it is no longer here.
        assert!(inside >= inside_plainly - 2, "{inside} inside, plainly {inside_plainly}");
    }

    #[test]
    fn what_is_as_stated_is_left_alone_and_a_method_by_name_is_that_on_all() {
        let (camera, _, mut pairs) = seen(1, 0.0);
        let options = PoseOptions::default();
        let found = weighed(&camera, &pairs, &RADII_PX, &options).expect("a pose");
        assert_eq!(found.answer, estimate_pose(&camera, &pairs, &options).expect("a pose"));
        assert_eq!(found.displacement_px, [0.0; 6]);
        pairs[2].pixel.x += 2.5;
        let named = PoseOptions { solver: Some(Solver::Epnp), ..options };
        assert!(weighed(&camera, &pairs, &RADII_PX, &named).is_err());
        // How large it is must be known: a point may be anywhere.
        assert!(weighed(&camera, &pairs, &[None; 6], &options).is_err());
    }
}
