//! Ground stations and autopilots: where targets are, as MAVLink 2 messages over UDP.
//!
//! `LANDING_TARGET` is what autopilots know: a target, seen from the vehicle, with its direction, distance and place in the body's axes.
//! `ODOMETRY` has a covariance but is by its definition the pose of the vehicle that sends it, so it is only for ground stations that
//! are told otherwise.

mod messages;

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use tokio::net::UdpSocket;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;

use super::config::{MavlinkMessage, MavlinkSettings};
use super::fault::{Fault, FaultKind};
use super::service::Service;
use super::service::told::Told;
use crate::geometry::{BodyFromCamera, EulerAngles, mount};
use ::mavlink::MavHeader;
use ::mavlink::dialects::common::MavMessage;

/// Failures to send come to the log no more often.
const TOLD_EVERY: Duration = Duration::from_secs(10);

/// What is sent to a ground station.
#[derive(Debug)]
pub struct Mavlink {
    sending: JoinHandle<()>,
}

impl Mavlink {
    /// Begins to send where the settings name an address; nothing where they name none.
    ///
    /// # Errors
    /// If no socket can be had.
    #[must_use]
    pub fn open(service: &Arc<Service>) -> BoxFuture<'_, Result<Option<Self>, Fault>> {
        async move {
            let settings = service.settings().mavlink.clone();
            let Some(receiver) = settings.receiver() else { return Ok(None) };
            let own: SocketAddr =
                if receiver.is_ipv4() { ([0, 0, 0, 0], 0).into() } else { ([0_u16, 0, 0, 0, 0, 0, 0, 0], 0).into() };
            let failed =
                |error: std::io::Error| Fault::new(FaultKind::Internal, format!("MAVLink to {receiver}: {error}"));
            let socket = UdpSocket::bind(own).await.map_err(failed)?;
            tracing::info!(%receiver, camera = %settings.camera, "MAVLink");
            let sender = Sender::new(socket, receiver, &settings);
            let sending = tokio::spawn(live(Arc::clone(service), settings, sender));
            Ok(Some(Self { sending }))
        }
        .boxed()
    }

    /// Waits until the service is told to stop.
    pub async fn closed(self) {
        let _ = self.sending.await;
    }
}

async fn live(service: Arc<Service>, settings: MavlinkSettings, mut sender: Sender) {
    let [roll_rad, pitch_rad, yaw_rad] = settings.camera_turned_rad;
    let turned = EulerAngles { roll_rad, pitch_rad, yaw_rad };
    let body_from_camera = mount::body_from_camera(turned, settings.camera_position_m);
    let mut stopping = service.jobs().stopping();
    let mut told = service.hear();
    let mut heart = tokio::time::interval(settings.heartbeat());
    heart.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            heard = told.recv() => match heard {
                Ok(told) if told.camera == settings.camera => {
                    for message in of_frame(&told, settings.message, &body_from_camera) {
                        sender.send(&message).await;
                    }
                }
                Ok(_) | Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            _ = heart.tick() => sender.send(&messages::heartbeat()).await,
            () = async { drop(stopping.wait_for(|is_stopping| *is_stopping).await) } => return,
        }
    }
}

/// What is said of a frame: every target of which one pose alone is likely. None of these messages can hold two.
fn of_frame(told: &Told, message: MavlinkMessage, body_from_camera: &BodyFromCamera) -> Vec<MavMessage> {
    let time_us = u64::try_from(told.timestamp_us.unwrap_or(told.received_us)).unwrap_or(0);
    let mut made = Vec::new();
    for (number, target) in (0_u8..).zip(&told.targets) {
        let Some(pose) = target.answer.pose.as_ref().filter(|_| !target.answer.ambiguous) else { continue };
        made.extend(match message {
            MavlinkMessage::LandingTarget => messages::landing_target(time_us, number, pose, body_from_camera),
            MavlinkMessage::Odometry => messages::odometry(time_us, pose, body_from_camera),
        });
    }
    made
}

/// A socket, and the number of the next message.
struct Sender {
    socket: UdpSocket,
    receiver: SocketAddr,
    header: MavHeader,
    failed: Option<std::time::Instant>,
}

impl Sender {
    fn new(socket: UdpSocket, receiver: SocketAddr, settings: &MavlinkSettings) -> Self {
        let header =
            MavHeader { system_id: settings.system_id.into(), component_id: settings.component_id, sequence: 0 };
        Self { socket, receiver, header, failed: None }
    }

    /// Sends it, or drops it where that is not possible: the next is worth more.
    async fn send(&mut self, message: &MavMessage) {
        let datagram = messages::datagram(self.header, message);
        self.header.sequence = self.header.sequence.wrapping_add(1);
        let Err(error) = self.socket.send_to(&datagram, self.receiver).await else {
            return metrics::counter!("skypose_mavlink_messages_total").increment(1);
        };
        metrics::counter!("skypose_mavlink_failed_total").increment(1);
        if self.failed.is_none_or(|at| at.elapsed() > TOLD_EVERY) {
            self.failed = Some(std::time::Instant::now());
            tracing::warn!(receiver = %self.receiver, %error, "MAVLink not sent");
        }
    }
}
