//! What nodes tell each other of their bodies, and what comes of it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::pose::RotationWire;
use super::prior::sound_pose;
use crate::geometry::UncertainTransform;
use crate::geometry::space::{Body, Peer, Space};
use crate::shell::fault::Fault;
use crate::swarm::{Candidate, Comparison, Fused, Seen, View};

/// Most poses that are read of one message.
const MOST_CANDIDATES: usize = 64;

/// Where a node sees another's body.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Relative)]
pub struct RelativeWire {
    /// The node that sees it.
    pub node: String,
    /// The node that is seen.
    pub other: String,
    /// The moment, microseconds since the Unix epoch: when the frame was taken.
    pub timestamp_us: i64,
    /// The cameras that see it.
    pub cameras: Vec<String>,
    /// All poses that are held possible, at least one, by falling probability.
    pub candidates: Vec<RelativePoseWire>,
}

/// Where a body is, seen from another: `p_node = R p_other + t`. Axes of a body: x forward, y right, z down.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = RelativePose)]
pub struct RelativePoseWire {
    /// That this pose and none of those beside it is the right one.
    pub probability: f64,
    /// Attitude of the other's body.
    pub rotation: RotationWire,
    /// Origin of the other's body along the axes of the node's body.
    pub translation_m: [f64; 3],
    /// Length of the translation.
    pub range_m: f64,
    /// 6 x 6, order x, y, z, rotation about the axes of the node's body, of the error `(t_true - t, Log(R_true R^T))`; m and rad.
    pub covariance: [[f64; 6]; 6],
}

/// How what a node sees of another agrees with what the other sees of it, and the pose that follows from both.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Agreement)]
pub struct AgreementWire {
    /// The node that compares.
    pub node: String,
    /// The node with which it compares.
    pub other: String,
    /// The moment, microseconds since the Unix epoch.
    pub timestamp_us: i64,
    /// How they compare.
    pub verdict: VerdictName,
    /// Squared distance of the views below from the pose that explains them best, in units of their covariances: to first order that of
    /// `Log(T_ab T_ba)`.
    pub distance_squared: f64,
    /// The most at which they agree.
    pub limit: f64,
    /// Degrees of freedom of the distance, chi-square where nothing is wrong: six for each view beyond the first.
    pub freedom: u32,
    /// How often chance alone makes the distance as large as that.
    pub share_above: f64,
    /// How far apart the first and the last view are.
    pub apart_m: f64,
    /// The angle between their attitudes.
    pub apart_rad: f64,
    /// How long before that moment the oldest frame of the node's own was taken.
    pub frame_age_us: u64,
    /// What each says, as seen from the node that compares; of several hypotheses those that agree best.
    pub views: Vec<ViewWire>,
    /// The pose that follows from all; null where they disagree.
    #[schema(required = true)]
    pub fused: Option<RelativePoseWire>,
    /// Others that are possible, by falling probability.
    pub alternatives: Vec<RelativePoseWire>,
}

/// How views compare.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = Verdict)]
pub enum VerdictName {
    /// They undo each other within their errors.
    Agreed,
    /// They do not: somebody is wrong. Nothing is fused.
    Disagreed,
    /// The node's own cameras contradict each other. Nothing is fused, and nothing told to the other.
    CamerasDisagree,
}

impl VerdictName {
    /// As it is written.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Agreed => "agreed",
            Self::Disagreed => "disagreed",
            Self::CamerasDisagree => "cameras_disagree",
        }
    }
}

/// What somebody says.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = View)]
pub struct ViewWire {
    /// The node whose cameras say it.
    pub node: String,
    /// These cameras.
    pub cameras: Vec<String>,
    /// The pose of the other's body, seen from the node that compares.
    pub pose: RelativePoseWire,
}

/// Another node, as this one knows it.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = BodyState)]
pub struct BodyWire {
    /// The other node.
    pub node: String,
    /// The target that it wears.
    pub target: String,
    /// The last that our cameras said of it; null where they have not seen it yet.
    #[schema(required = true)]
    pub relative: Option<RelativeWire>,
    /// How that compared last; null where it was not yet.
    #[schema(required = true)]
    pub agreement: Option<AgreementWire>,
}

/// All other nodes.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize, ToSchema)]
#[schema(as = Bodies)]
pub struct BodiesWire {
    /// By name.
    pub bodies: Vec<BodyWire>,
}

impl RelativePoseWire {
    /// A pose with this probability.
    #[must_use]
    pub fn of<To: Space, From: Space>(pose: &UncertainTransform<To, From>, probability: f64) -> Self {
        let UncertainTransform { transform, covariance } = pose;
        Self {
            probability,
            rotation: RotationWire::from(&transform.rotation),
            translation_m: transform.translation.into(),
            range_m: transform.translation.norm(),
            covariance: std::array::from_fn(|row| std::array::from_fn(|column| covariance[(row, column)])),
        }
    }

    fn fused(fused: &Fused<Body, Peer>) -> Self {
        Self::of(&fused.pose, fused.probability)
    }
}

impl RelativeWire {
    /// What the cameras of `node` say of `other`.
    #[must_use]
    pub fn of(node: &str, other: &str, timestamp_us: i64, view: &View<Body, Peer>) -> Self {
        let mut candidates: Vec<RelativePoseWire> = view
            .candidates
            .iter()
            .map(|candidate| RelativePoseWire::of(&candidate.seen.along(), candidate.probability))
            .collect();
        candidates.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        Self { node: node.into(), other: other.into(), timestamp_us, cameras: view.cameras.clone(), candidates }
    }

    /// As the node that is seen hears it: its own body, seen from its peer.
    ///
    /// # Errors
    /// Names the field that makes no sense.
    pub fn heard(&self) -> Result<View<Body, Peer>, Fault> {
        if self.candidates.is_empty() || self.candidates.len() > MOST_CANDIDATES {
            let detail = format!("{} poses: 1 to {MOST_CANDIDATES} are accepted", self.candidates.len());
            return Err(Fault::senseless("/candidates", detail));
        }
        let total: f64 = self.candidates.iter().map(|candidate| candidate.probability).sum();
        let read = |(place, candidate): (usize, &RelativePoseWire)| {
            let within = |fault: Fault| fault.within(&format!("/candidates/{place}"));
            if !(candidate.probability > 0.0 && candidate.probability <= 1.0) {
                return Err(within(Fault::senseless("/probability", "a number above 0, at most 1, is expected")));
            }
            let quaternion = candidate.rotation.quaternion_xyzw;
            let (transform, covariance) =
                sound_pose(quaternion, candidate.translation_m, &candidate.covariance).map_err(within)?;
            let seen = Seen::Back(UncertainTransform { transform, covariance: *covariance.matrix() });
            Ok(Candidate { seen, probability: candidate.probability / total })
        };
        let candidates: Result<_, Fault> = self.candidates.iter().enumerate().map(read).collect();
        Ok(View { cameras: self.cameras.clone(), candidates: candidates? })
    }
}

/// A view, and the node that has it.
type Said<'a> = (&'a str, &'a View<Body, Peer>);

impl AgreementWire {
    /// What came of comparing these views of a moment; `chosen` of each of them are told.
    #[must_use]
    pub fn of<To: Space, From: Space>(
        verdict: VerdictName,
        [node, other]: [&str; 2],
        timestamp_us: i64,
        views: &[Said<'_>],
        comparison: &Comparison<To, From>,
    ) -> Self {
        let chosen = views.iter().zip(&comparison.chosen).filter_map(|((node, view), chosen)| {
            let candidate = view.candidates.get(*chosen)?;
            Some((*node, *view, candidate.seen.along(), candidate.probability))
        });
        let chosen: Vec<_> = chosen.collect();
        let ends = chosen.first().zip(chosen.last());
        let off = ends.map(|(first, last)| first.2.transform.difference_to(&last.2.transform)).unwrap_or_default();
        let view =
            |(node, view, pose, probability): &(&str, &View<Body, Peer>, UncertainTransform<Body, Peer>, f64)| {
                ViewWire {
                    node: (*node).into(),
                    cameras: view.cameras.clone(),
                    pose: RelativePoseWire::of(pose, *probability),
                }
            };
        Self {
            node: node.into(),
            other: other.into(),
            timestamp_us,
            verdict,
            distance_squared: comparison.squared,
            limit: comparison.limit,
            freedom: comparison.freedom,
            share_above: comparison.share_above,
            apart_m: off.fixed_rows::<3>(0).norm(),
            apart_rad: off.fixed_rows::<3>(3).norm(),
            frame_age_us: 0,
            views: chosen.iter().map(view).collect(),
            fused: None,
            alternatives: Vec::new(),
        }
    }

    /// With the poses that follow.
    #[must_use]
    pub fn with_fused(mut self, fused: &[Fused<Body, Peer>]) -> Self {
        let mut poses = fused.iter().map(RelativePoseWire::fused);
        self.fused = poses.next();
        self.alternatives = poses.collect();
        self
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix6, Vector3};

    use super::*;
    use crate::geometry::{Transform, rotation};

    fn relative() -> RelativeWire {
        let transform = Transform::new(rotation::exp(&Vector3::new(0.3, -0.2, 3.0)), Vector3::new(7.0, 0.5, -0.2));
        let covariance = Matrix6::identity() * 1e-3;
        let candidate =
            |probability| Candidate { seen: Seen::Along(UncertainTransform { transform, covariance }), probability };
        let view = View { cameras: vec!["front".into()], candidates: vec![candidate(0.2), candidate(0.8)] };
        RelativeWire::of("alpha", "beta", 17, &view)
    }

    #[test]
    fn what_is_told_is_heard_from_the_other_side() {
        let told = relative();
        assert_eq!(told.candidates.iter().map(|c| c.probability).collect::<Vec<_>>(), [0.8, 0.2]);
        let json = serde_json::to_string(&told).expect("JSON");
        let heard = super::super::from_json::<RelativeWire>(json.as_bytes()).expect("reads").heard().expect("sound");
        let Seen::Back(seen) = heard.candidates[0].seen else { panic!("{heard:?}") };
        assert!((seen.transform.translation - Vector3::new(7.0, 0.5, -0.2)).norm() < 1e-12);
        assert!((seen.covariance - Matrix6::identity() * 1e-3).amax() < 1e-15);
        assert!((heard.candidates[0].probability - 0.8).abs() < 1e-12);
    }

    #[test]
    fn what_makes_no_sense_is_named() {
        type Change = fn(&mut RelativeWire);
        let changes: [(&str, Change); 6] = [
            ("/candidates", |told| told.candidates.clear()),
            ("/candidates", |told| told.candidates = vec![told.candidates[0].clone(); 65]),
            ("/candidates/1/probability", |told| told.candidates[1].probability = 0.0),
            ("/candidates/0/rotation/quaternion_xyzw", |told| told.candidates[0].rotation.quaternion_xyzw = [0.0; 4]),
            ("/candidates/0/translation_m", |told| told.candidates[0].translation_m[1] = 1e300),
            ("/candidates/1/covariance", |told| told.candidates[1].covariance[2][2] = -1.0),
        ];
        for (pointer, change) in changes {
            let mut told = relative();
            change(&mut told);
            assert_eq!(told.heard().expect_err(pointer).pointer.as_deref(), Some(pointer));
        }
    }
}
