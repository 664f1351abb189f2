//! What may be asked: the requests of HTTP with the replies of HTTP.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;
use tokio::runtime::Handle;
use tokio::sync::Semaphore;
use zenoh::Session;
use zenoh::Wait;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::key_expr::KeyExpr;
use zenoh::query::{Query, Queryable};

use super::keys::{Call, Keys};
use super::payload::bytes_of;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::Service;
use crate::shell::wire::{FrameRequest, Health, Problem, from_json};

/// Answers as long as it is kept.
pub(super) async fn answer_all(
    session: &Session,
    service: &Arc<Service>,
    keys: &Keys,
    node: &str,
) -> Result<Vec<Queryable<()>>, Fault> {
    let places = Arc::new(Semaphore::new(service.settings().zenoh.max_queries));
    let mut open = Vec::with_capacity(Call::ALL.len());
    for call in Call::ALL {
        let key = keys.rpc(node, call)?;
        let (service, places, runtime) = (Arc::clone(service), Arc::clone(&places), Handle::current());
        let own = key.clone();
        let answering = session.declare_queryable(key).complete(true).callback(move |query| {
            let (service, own) = (Arc::clone(&service), own.clone());
            let place = Arc::clone(&places).try_acquire_owned();
            metrics::counter!("skypose_queries_total", "call" => call.name()).increment(1);
            runtime.spawn(async move {
                let answer = if place.is_ok() {
                    answer(&service, call, &query).await
                } else {
                    let detail = "as many queries as the service takes are under way";
                    Err(Fault::new(FaultKind::Overloaded, detail))
                };
                // A reply may wait for a client that reads slowly: not on a thread that others need.
                let _ = tokio::task::spawn_blocking(move || {
                    send(&query, &own, answer);
                    drop(place);
                })
                .await;
            });
        });
        open.push(answering.await.map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?);
    }
    Ok(open)
}

fn send(query: &Query, key: &KeyExpr<'static>, answer: Result<Vec<u8>, Fault>) {
    let sent = match answer {
        Ok(reply) => query.reply(key, reply).encoding(Encoding::APPLICATION_JSON).wait(),
        Err(fault) => {
            let problem = serde_json::to_vec(&Problem::from(&fault)).unwrap_or_default();
            let encoding = Encoding::from("application/problem+json");
            query.reply_err(problem).encoding(encoding).wait()
        }
    };
    if let Err(error) = sent {
        tracing::debug!(%key, %error, "a reply was not sent");
    }
}

async fn answer(service: &Service, call: Call, query: &Query) -> Result<Vec<u8>, Fault> {
    let http = &service.settings().http;
    let deadline = Instant::now() + http.deadline();
    let most_json = http.max_json_bytes;
    match call {
        Call::Poses => {
            let body = from_json(&bytes_of(within(query.payload(), most_json, "request")?))?;
            written(&service.points(body, deadline).await?)
        }
        Call::Detections | Call::Estimates => {
            let frame = bytes_of(within(query.payload(), http.max_frame_bytes, "frame")?);
            let request: FrameRequest = match query.attachment() {
                Some(note) => from_json(&bytes_of(within(Some(note), most_json, "request")?))?,
                None => FrameRequest::default(),
            };
            if call == Call::Detections {
                written(&service.detection(frame, request, deadline).await?)
            } else {
                written(&service.estimate(frame, request, deadline).await?)
            }
        }
        Call::Cameras => written(&service.cameras().await?),
        Call::Targets => written(&service.targets().await?),
        Call::Health if service.is_ready().await => written(&Health::OK),
        Call::Health => Err(Fault::new(FaultKind::Unreachable, "the store cannot be read")),
    }
}

fn within<'a>(payload: Option<&'a ZBytes>, most: usize, what: &str) -> Result<&'a ZBytes, Fault> {
    let payload = payload.ok_or_else(|| Fault::new(FaultKind::Unreadable, format!("the query carries no {what}")))?;
    if payload.len() > most {
        let detail = format!("a {what} of {} bytes: at most {most} are accepted", payload.len());
        return Err(Fault::new(FaultKind::TooLarge, detail));
    }
    Ok(payload)
}

fn written<T: Serialize>(reply: &T) -> Result<Vec<u8>, Fault> {
    serde_json::to_vec(reply).map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))
}
