//! The studies by which solvers are compared, drawn the same wherever figures are made.
//!
//! A study is a rule for drawing trials; trial number `index` of a study is the same on every machine. How an answer is judged
//! stands in [`verdict`](super::verdict).

use rand::{Rng, RngExt};

use super::cases::{self, Case};
use crate::camera::Pixel;
use crate::random;
use crate::refine::Correspondence;

/// The studies by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Protocol {
    /// The seed's study: six points of a plane, up to 10 m along each axis, no limit of view, 1 px of noise.
    Thesis,
    /// Six points of a plane inside the picture, 1 to 15 m away, tilted by up to 75 degrees, 0.1 to 2 px of noise.
    Visible,
    /// Six to twenty points in a box of 0.8 x 0.8 x 0.3 m inside the picture, 1 to 15 m away, 0.1 to 2 px of noise.
    Nonplanar,
    /// Twelve to thirty points in that box, a tenth to half of the pairs wrong, 1 px of noise on the others.
    Outliers,
}

/// One case of a study.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Points, pixels and truth.
    pub case: Case,
    /// Noise per axis of the right pairs' pixels, px: what a solver is told.
    pub sigma_px: f64,
    /// Which pairs are right. A solver is not told.
    pub right: Vec<bool>,
}

impl Protocol {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Thesis, Self::Visible, Self::Nonplanar, Self::Outliers];

    /// One word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Thesis => "thesis",
            Self::Visible => "visible",
            Self::Nonplanar => "nonplanar",
            Self::Outliers => "outliers",
        }
    }

    /// What it draws, in a line for people.
    #[must_use]
    pub const fn definition(self) -> &'static str {
        match self {
            Self::Thesis => "6 coplanar points, 0 to 10 m along each axis, +-90 degrees, no limit of view, 1 px",
            Self::Visible => "6 coplanar points in the picture, 1 to 15 m, tilt to 75 degrees, 0.1 to 2 px",
            Self::Nonplanar => "6 to 20 points of a box 0.8 x 0.8 x 0.3 m in the picture, 1 to 15 m, 0.1 to 2 px",
            Self::Outliers => "12 to 30 points of that box, 10 to 50 % of pairs wrong, 1 px",
        }
    }

    /// Whether the points lie in a plane.
    #[must_use]
    pub const fn is_planar(self) -> bool {
        matches!(self, Self::Thesis | Self::Visible)
    }

    /// Trial number `index`.
    #[must_use]
    pub fn trial(self, index: u64) -> Trial {
        let rng = &mut random::case(&format!("protocol {}", self.name()), index);
        match self {
            Self::Thesis => Trial::clean(cases::thesis_2012(rng, 1.0), 1.0),
            Self::Visible => {
                let sigma_px = any_noise(rng);
                Trial::clean(cases::visible_plane(rng, 6, sigma_px), sigma_px)
            }
            Self::Nonplanar => {
                let (count, sigma_px) = (rng.random_range(6..=20), any_noise(rng));
                Trial::clean(cases::visible_box(rng, count, sigma_px), sigma_px)
            }
            Self::Outliers => {
                let count = rng.random_range(12..=30);
                let mut trial = Trial::clean(cases::visible_box(rng, count, 1.0), 1.0);
                let share = rng.random_range(0.1..=0.5);
                trial.spoil(rng, share);
                trial
            }
        }
    }
}

/// As often below as above the middle of 0.45 px: every octave is as likely as the next.
fn any_noise(rng: &mut impl Rng) -> f64 {
    0.1 * 20.0_f64.powf(rng.random_range(0.0..1.0))
}

impl Trial {
    /// A case of which every pair is right.
    #[must_use]
    pub fn clean(case: Case, sigma_px: f64) -> Self {
        let right = vec![true; case.points.len()];
        Self { case, sigma_px, right }
    }

    /// All pairs, as a solver gets them.
    #[must_use]
    pub fn correspondences(&self) -> Vec<Correspondence> {
        let pairs = self.case.points.iter().zip(&self.case.pixels);
        pairs.map(|(point, pixel)| Correspondence { point: *point, pixel: *pixel, sigma_px: self.sigma_px }).collect()
    }

    /// The right pairs alone.
    #[must_use]
    pub fn right_correspondences(&self) -> Vec<Correspondence> {
        let all = self.correspondences().into_iter().zip(&self.right);
        all.filter_map(|(pair, right)| right.then_some(pair)).collect()
    }

    /// Puts a share of the pixels, rounded to whole ones, anywhere in the picture. The cases draw their points one like the
    /// other, so it may be the first ones.
    fn spoil(&mut self, rng: &mut impl Rng, share: f64) {
        #[expect(clippy::cast_sign_loss, clippy::cast_possible_truncation, reason = "a share of a few points")]
        let wrong = (share * self.right.len() as f64).round() as usize;
        let (width, height) = (f64::from(self.case.camera.width()), f64::from(self.case.camera.height()));
        for index in 0..wrong {
            self.case.pixels[index] = Pixel::new(rng.random_range(0.0..width), rng.random_range(0.0..height));
            self.right[index] = false;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::target::Spread;

    fn trials(protocol: Protocol) -> impl Iterator<Item = Trial> {
        (0..200).map(move |index| protocol.trial(index))
    }

    #[test]
    fn a_trial_is_the_same_each_time_and_its_neighbour_another() {
        for protocol in Protocol::ALL {
            assert_eq!(protocol.trial(7).case.pixels, protocol.trial(7).case.pixels);
            assert_ne!(protocol.trial(7).case.pixels, protocol.trial(8).case.pixels);
        }
    }

    #[test]
    fn flat_studies_are_flat_and_the_others_are_not() {
        for protocol in Protocol::ALL {
            assert!(
                trials(protocol).all(|t| (Spread::of(&t.case.points).plane_ratio() < 1e-9) == protocol.is_planar())
            );
        }
    }

    #[test]
    fn right_pairs_lie_within_their_noise_and_wrong_ones_mostly_do_not() {
        for protocol in Protocol::ALL {
            let (mut far, mut wrong) = (0, 0);
            for trial in trials(protocol) {
                let case = &trial.case;
                for ((point, pixel), right) in case.points.iter().zip(&case.pixels).zip(&trial.right) {
                    let place = case.camera.project(&(case.camera_from_target * *point)).expect("in view");
                    // A normal pair leaves seven deviations once in 4e10.
                    let near = (place - pixel).norm() < 7.0 * trial.sigma_px;
                    assert!(near || !right);
                    wrong += u32::from(!right);
                    far += u32::from(!near);
                }
            }
            assert_eq!(wrong > 0, protocol == Protocol::Outliers);
            // A disc of 7 px covers a two-thousandth of the picture.
            assert!(far * 100 >= wrong * 99, "{far} of {wrong}");
        }
    }

    #[test]
    fn a_tenth_to_a_half_is_wrong_and_twelve_to_thirty_are_given() {
        for trial in trials(Protocol::Outliers) {
            let given = trial.right.len();
            let right = trial.right_correspondences().len();
            let share = (given - right) as f64 / given as f64;
            assert!((12..=30).contains(&given));
            // Rounded to whole pairs.
            assert!((0.05..=0.55).contains(&share), "{share}");
        }
    }
}
