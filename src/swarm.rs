//! Several cameras and several vehicles that see each other: whether what they see agrees, and what follows from all of it.
//!
//! # How it works
//!
//! A vehicle is a *body*. Its cameras sit on it where their mounts say, and it wears a target where that target's mount says
//! ([`Mounts`]). What a camera's tracks tell of a target thus tells where the other's body is: `body_from_peer =
//! body_from_camera * camera_from_target * target_from_peer`, with the covariances of the mounts where they are given.
//!
//! *One time.* [`Sightings`] keeps the tracks of the last frames. What another tells of a moment is compared with our last frame before
//! it, taken on to it by the track's own motion and process noise. Nothing is compared over more than
//! [`max_apart`](SwarmOptions::max_apart).
//!
//! *The test.* The pose of the other in our axes and ours in the other's must undo each other: `Log(T_ab T_ba) = 0` within the errors of
//! both. [`compare`] looks for the pose that explains all views best, each with the errors of the axes in which it was measured, by
//! Gauss and Newton on SE(3), and takes what is left: the squared Mahalanobis distance of `Log(T_ab T_ba)` to first order, and without
//! the first order's flaw that a turn of a degree at 50 m bends errors to bananas. It is chi-square with six degrees of freedom for each
//! view beyond the first (Bar-Shalom, Li and Kirubarajan 2001, 8.4: track-to-track association).
//!
//! *Fusion.* That pose is the fused one, and the inverse of the added informations its covariance. One sees a direction well that the other
//! sees badly: who looks along the line between both knows the other's place across it to millimetres and the other's attitude to
//! degrees, and the place tells the attitude of who looks back.
//!
//! *Two attitudes.* Where flat targets leave two attitudes alive, all combinations are tried. Those that pass the test are kept, each
//! weighed by how well it explains the views, so that a pair of mirrored attitudes on both sides is resolved by one look.
//!
//! *Disagreement.* If no combination passes, nothing is fused, and the nearest is told with its distance. Combinations that together were
//! less probable than the [`significance`](SwarmOptions::significance) are not called to witness: else anything would agree with a
//! hypothesis in a million.
//!
//! # What it rests on
//!
//! That the errors of the views are independent: pixel noise of different cameras is, also in tracks. What is wrong for both alike is not
//! seen and not counted: the same wrong drawing of a target that both wear, a common error of the clocks. Errors of mounts are drawn
//! once and stay: one comparison is right with them, but a thousand comparisons then do not average them out. The clocks of the nodes
//! agree within [`clock_sigma`](SwarmOptions::clock_sigma).
//!
//! # What it must not be fed
//!
//! A fused pose contains the other's view. It is nobody's own view any more: told to the other as such, or given to a tracker, it would
//! be counted twice.

mod comparison;
mod fit;
mod mounts;
mod options;
mod sightings;
mod view;

pub use comparison::{Comparison, Fused, compare};
pub use mounts::{Mounts, Worn};
pub use options::{SwarmError, SwarmOptions};
pub use sightings::{NoView, OwnView, Sighting, Sightings};
pub use view::{Candidate, Seen, View};

#[cfg(test)]
mod tests;
