//! This node among others that see it: what its cameras say of them, what they say of it, and how that agrees.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tokio::sync::broadcast;

use super::Service;
use super::tracks::Followed;
use crate::shell::config::SwarmSettings;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::relative::{AgreementWire, BodiesWire, BodyWire, RelativeWire, VerdictName};
use crate::swarm::{Mounts, NoView, OwnView, Sighting, Sightings, SwarmOptions};
use crate::track::{Life, TrackOptions};

/// What a listener may leave unheard; then he misses the oldest.
const MOST_WAITING: usize = 256;

/// What is told of other nodes.
#[derive(Clone, Debug, PartialEq)]
pub enum SwarmTold {
    /// Where our cameras see another.
    Relative(RelativeWire),
    /// How that agrees with what it says of us.
    Agreement(Box<AgreementWire>),
}

/// What is known of the others.
#[derive(Debug)]
pub(super) struct Swarm {
    options: SwarmOptions,
    mounts: Mounts,
    sightings: Mutex<Sightings>,
    last: Mutex<BTreeMap<String, Last>>,
    told: broadcast::Sender<Arc<SwarmTold>>,
}

/// The last of another.
#[derive(Debug, Default)]
struct Last {
    relative: Option<RelativeWire>,
    agreement: Option<AgreementWire>,
}

impl Swarm {
    pub(super) fn new(settings: &SwarmSettings) -> Self {
        Self {
            options: settings.options(),
            mounts: settings.mounts(),
            sightings: Mutex::default(),
            last: Mutex::default(),
            told: broadcast::Sender::new(MOST_WAITING),
        }
    }

    fn sightings(&self) -> MutexGuard<'_, Sightings> {
        self.sightings.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn last(&self) -> MutexGuard<'_, BTreeMap<String, Last>> {
        self.last.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn own_view(&self, peer: &str, timestamp_us: i64) -> Result<OwnView, NoView> {
        self.sightings().own_view(&self.mounts, peer, stamp_of(timestamp_us), &self.options)
    }

    fn tell(&self, told: SwarmTold) {
        let mut last = self.last();
        match &told {
            SwarmTold::Relative(relative) => {
                last.entry(relative.other.clone()).or_default().relative = Some(relative.clone());
            }
            SwarmTold::Agreement(agreement) => {
                let of = last.entry(agreement.other.clone()).or_default();
                log_change(of.agreement.as_ref(), agreement);
                metrics::counter!("skypose_comparisons_total", "verdict" => agreement.verdict.name()).increment(1);
                of.agreement = Some(AgreementWire::clone(agreement));
            }
        }
        drop(last);
        // Nobody has to listen.
        let _ = self.told.send(Arc::new(told));
    }
}

/// Once, where they begin to disagree or to agree again.
fn log_change(before: Option<&AgreementWire>, now: &AgreementWire) {
    let (other, squared, limit) = (&now.other, now.distance_squared, now.limit);
    match (before.map(|before| before.verdict), now.verdict) {
        (before, verdict) if before.unwrap_or(VerdictName::Agreed) == verdict => {}
        (_, VerdictName::Agreed) => tracing::info!(%other, squared, limit, "views agree again"),
        (_, VerdictName::Disagreed) => {
            tracing::warn!(%other, squared, limit, "what we see of it and what it sees of us disagree");
        }
        (_, VerdictName::CamerasDisagree) => tracing::warn!(%other, squared, limit, "our own cameras disagree"),
    }
}

fn stamp_of(timestamp_us: i64) -> Duration {
    Duration::from_micros(u64::try_from(timestamp_us).unwrap_or(0))
}

impl Service {
    /// A frame of one of our cameras has been looked at: what it shows of others is told.
    pub(super) fn saw(&self, camera: &str, timestamp_us: i64, followed: &[Followed], options: &TrackOptions) {
        let swarm = &self.swarm;
        if !swarm.mounts.cameras.contains_key(camera) {
            return;
        }
        for Followed { target, tracks } in followed {
            let peers = swarm.mounts.peers.iter().filter(|(_, worn)| worn.target == *target);
            let peers: Vec<&String> = peers.map(|(peer, _)| peer).collect();
            if peers.is_empty() {
                continue;
            }
            let is_seen = tracks.iter().any(|track| track.life() == Life::Confirmed);
            let sighting = Sighting { stamp: stamp_of(timestamp_us), tracks: tracks.clone(), options: *options };
            swarm.sightings().add(camera, target, sighting, &swarm.options);
            // What is only predicted is nothing new to anybody.
            for peer in peers.into_iter().filter(|_| is_seen) {
                match swarm.own_view(peer, timestamp_us) {
                    Ok(own) => {
                        let relative = RelativeWire::of(&self.node, peer, timestamp_us, &own.view);
                        swarm.tell(SwarmTold::Relative(relative));
                    }
                    Err(NoView::Contradiction { comparison, views }) => {
                        let views: Vec<_> = views.iter().map(|view| (self.node.as_str(), view)).collect();
                        let nodes = [self.node.as_str(), peer.as_str()];
                        let verdict = VerdictName::CamerasDisagree;
                        let told = AgreementWire::of(verdict, nodes, timestamp_us, &views, &comparison);
                        swarm.tell(SwarmTold::Agreement(Box::new(told)));
                    }
                    Err(NoView::Unseen) => {}
                }
            }
        }
    }

    /// Another node has told where it sees us. It is compared with where we saw it at that moment, and what comes of it is told; nothing
    /// where we did not see it then.
    ///
    /// # Errors
    /// If it makes no sense, is not of us, or if nobody has told us what that node wears.
    pub fn heard_of_us(&self, relative: &RelativeWire) -> Result<(), Fault> {
        let swarm = &self.swarm;
        if relative.other != self.node {
            return Err(Fault::senseless("/other", format!("{}: this is {}", relative.other, self.node)));
        }
        if !swarm.mounts.peers.contains_key(&relative.node) {
            let detail = format!("{}: no body of this node is in [[swarm.bodies]]", relative.node);
            return Err(Fault::senseless("/node", detail));
        }
        let theirs = relative.heard()?;
        let (peer, timestamp_us) = (relative.node.as_str(), relative.timestamp_us);
        let Ok(own) = swarm.own_view(peer, timestamp_us) else {
            metrics::counter!("skypose_comparisons_unmatched_total").increment(1);
            return Ok(());
        };
        let numbers = || Fault::new(FaultKind::Senseless, "its covariances cannot be weighed");
        let comparison = own.compare(&theirs, &swarm.options).ok_or_else(numbers)?;
        let verdict = if comparison.agrees() { VerdictName::Agreed } else { VerdictName::Disagreed };
        let views = [(self.node.as_str(), &own.view), (peer, &theirs)];
        let told = AgreementWire::of(verdict, [&self.node, peer], timestamp_us, &views, &comparison);
        let frame_age_us = u64::try_from(own.apart.as_micros()).unwrap_or(u64::MAX);
        let told = AgreementWire { frame_age_us, ..told.with_fused(&comparison.fused) };
        swarm.tell(SwarmTold::Agreement(Box::new(told)));
        Ok(())
    }

    /// Hears what is told of other nodes from now on.
    #[must_use]
    pub fn hear_of_others(&self) -> broadcast::Receiver<Arc<SwarmTold>> {
        self.swarm.told.subscribe()
    }

    /// The other nodes as they were seen and compared last.
    #[must_use]
    pub fn bodies(&self) -> BodiesWire {
        let last = self.swarm.last();
        let body = |(node, worn): (&String, &crate::swarm::Worn)| {
            let of = last.get(node);
            BodyWire {
                node: node.clone(),
                target: worn.target.clone(),
                relative: of.and_then(|of| of.relative.clone()),
                agreement: of.and_then(|of| of.agreement.clone()),
            }
        };
        BodiesWire { bodies: self.swarm.mounts.peers.iter().map(body).collect() }
    }
}
