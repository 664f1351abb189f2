//! What a server sees in the frames of a camera, by server-sent events.

use std::time::Duration;

use serde_json::{Value, json};

use super::{Watch, lines};
use crate::shell::cli::Stop;
use crate::shell::console::{note, print_line};
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::store::check_name;
use crate::shell::wire::swarm::GapWire;
use crate::shell::wire::{EstimateReply, Problem, from_json};

/// Time until a server that has gone is looked for again.
const AGAIN_AFTER: Duration = Duration::from_secs(1);
/// A server says something every few seconds; one that is silent for longer has gone.
const SILENT: Duration = Duration::from_secs(40);
/// Most bytes of one event: more is no server of ours.
const MOST_EVENT: usize = 16 << 20;

impl Watch {
    pub(super) fn watch_server(&self, server: &str, camera: &str) -> Result<(), Stop> {
        // Whether or not the server is reached by TLS, the client wants to know whose it would be.
        let _ = rustls::crypto::ring::default_provider().install_default();
        check_name(camera)?;
        let server = server.trim_end_matches('/');
        if !server.starts_with("http://") && !server.starts_with("https://") {
            let detail = format!("--server {server}: an address as http://127.0.0.1:8080 is expected");
            return Err(Fault::new(FaultKind::Senseless, detail).into());
        }
        let url = format!("{server}/v1/cameras/{camera}/estimates");
        crate::shell::cli::runtime()?.block_on(async {
            let http =
                reqwest::Client::builder().read_timeout(SILENT).build().map_err(|error| unreached(&url, &error))?;
            let mut watching = Watching { last: None, left: self.count.unwrap_or(u64::MAX), json: self.json, camera };
            let mut is_first = true;
            while watching.left > 0 {
                match watching.watch(&http, &url, &mut is_first).await {
                    Err(Ended::Over(stop)) => return Err(stop),
                    // It was there once, so it may come again.
                    Err(Ended::Gone(fault)) if is_first => return Err(fault.into()),
                    Err(Ended::Gone(fault)) => note(&format!("{fault}; looking for it again")),
                    Ok(()) if watching.left > 0 => {
                        note(&format!("{server} has ended the stream; looking for it again"));
                    }
                    Ok(()) => break,
                }
                tokio::time::sleep(AGAIN_AFTER).await;
            }
            Ok(())
        })
    }
}

/// Why a connection is over.
enum Ended {
    /// It may come again.
    Gone(Fault),
    /// It makes no sense to try again.
    Over(Stop),
}

impl<T: Into<Stop>> From<T> for Ended {
    fn from(stop: T) -> Self {
        Self::Over(stop.into())
    }
}

/// What goes with us from connection to connection.
struct Watching<'a> {
    /// The event that was seen last.
    last: Option<String>,
    left: u64,
    json: bool,
    camera: &'a str,
}

impl Watching<'_> {
    async fn watch(&mut self, http: &reqwest::Client, url: &str, is_first: &mut bool) -> Result<(), Ended> {
        let gone = |error: reqwest::Error| Ended::Gone(unreached(url, &error));
        let mut request = http.get(url).header("accept", "text/event-stream");
        if let Some(last) = &self.last {
            request = request.header("last-event-id", last);
        }
        let mut reply = request.send().await.map_err(gone)?;
        if !reply.status().is_success() {
            let status = reply.status();
            let problem: Option<Problem> = reply.json().await.ok();
            let detail = problem.map_or_else(|| format!("{url} answers {status}"), |problem| problem.detail);
            let kind = match status.as_u16() {
                404 => FaultKind::NotFound,
                503 => return Err(Ended::Gone(Fault::new(FaultKind::Overloaded, detail))),
                _ => FaultKind::Internal,
            };
            return Err(Fault::new(kind, detail).into());
        }
        if std::mem::replace(is_first, false) {
            note(&format!("watching {url}"));
        }
        let mut text = Vec::new();
        while let Some(chunk) = reply.chunk().await.map_err(gone)? {
            text.extend_from_slice(&chunk);
            while let Some(end) = text.windows(2).position(|pair| pair == b"\n\n") {
                let event: Vec<u8> = text.drain(..end + 2).collect();
                self.tell(&Event::of(&String::from_utf8_lossy(&event)))?;
                if self.left == 0 {
                    return Ok(());
                }
            }
            if text.len() > MOST_EVENT {
                return Err(Fault::new(FaultKind::TooLarge, format!("{url} sends no events")).into());
            }
        }
        Ok(())
    }

    fn tell(&mut self, event: &Event) -> Result<(), Stop> {
        match event.kind.as_str() {
            "estimate" => {
                self.left -= 1;
                for line in self.lines(event) {
                    print_line(&line)?;
                }
            }
            "gap" => {
                let missed = from_json::<GapWire>(event.data.as_bytes()).ok().and_then(|gap| gap.missed_count);
                let missed =
                    missed.map_or_else(|| "what was told".into(), |count| format!("{count} estimates and tracks"));
                note(&format!("{missed} in between cannot be had any more"));
            }
            _ => {}
        }
        if event.id.is_some() {
            self.last.clone_from(&event.id);
        }
        Ok(())
    }

    fn lines(&self, event: &Event) -> Vec<String> {
        if self.json {
            let estimate: Value = serde_json::from_str(&event.data).unwrap_or_default();
            return vec![json!({"camera": self.camera, "id": event.id, "estimate": estimate}).to_string()];
        }
        match from_json::<EstimateReply>(event.data.as_bytes()) {
            Ok(reply) => lines(self.camera, &reply, None),
            Err(fault) => vec![format!("{}  not an estimate: {}", self.camera, fault.to_string().escape_debug())],
        }
    }
}

/// A server-sent event.
#[derive(Debug, Default, PartialEq, Eq)]
struct Event {
    id: Option<String>,
    kind: String,
    data: String,
}

impl Event {
    /// Of its lines. A colon at the beginning is a comment; what is not known is nothing to us.
    fn of(text: &str) -> Self {
        let mut event = Self::default();
        for line in text.lines() {
            let (name, value) = line.split_once(':').unwrap_or((line, ""));
            let value = value.strip_prefix(' ').unwrap_or(value);
            match name {
                "id" => event.id = Some(value.into()),
                "event" => event.kind = value.into(),
                "data" => {
                    if !event.data.is_empty() {
                        event.data.push('\n');
                    }
                    event.data.push_str(value);
                }
                _ => {}
            }
        }
        event
    }
}

/// With the reason behind the reason: the first only says that something failed.
fn unreached(url: &str, error: &reqwest::Error) -> Fault {
    let mut last: &dyn std::error::Error = error;
    while let Some(source) = last.source() {
        last = source;
    }
    Fault::new(FaultKind::Unreachable, format!("{url} cannot be reached: {last}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_read_and_a_comment_is_none() {
        let event = Event::of("event: estimate\nid: 17\ndata: {\"a\": \ndata:1}\nretry: 5\n\n");
        assert_eq!(event, Event { id: Some("17".into()), kind: "estimate".into(), data: "{\"a\": \n1}".into() });
        assert_eq!(Event::of(":\n\n"), Event::default());
    }
}
