//! Frames on their way to be posted, made ready on a thread of their own.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use tokio::sync::mpsc::{Receiver, Sender, channel};

use super::{PICTURES_PER_SECOND, Posted, Replay};
use crate::frame::{Frame, Limits};
use crate::scene::encode;
use crate::shell::cli::inputs::{frames_of, unreadable_source};
use crate::shell::cli::moving::tell_oddities;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::grab::{Grabber, Options, Source};
use crate::shell::wire::frame::OrientationHandling;

/// Frames that wait to be posted.
const AHEAD: usize = 4;

/// A frame, ready to be posted.
pub(super) struct Shot {
    pub(super) source: String,
    pub(super) index: u64,
    pub(super) is_video: bool,
    pub(super) is_live: bool,
    /// With it the clock starts anew.
    pub(super) is_first: bool,
    pub(super) time_us: i64,
    pub(super) timestamp_us: Option<i64>,
    pub(super) body: Body,
}

/// The frame's bytes.
pub(super) enum Body {
    Encoded(Vec<u8>),
    Rgb { width: u32, height: u32, bytes: Vec<u8> },
}

/// A frame, or a source and why it gives none.
pub(super) type Fed = Result<Shot, (String, Fault)>;

/// What is played.
enum Item {
    Video(Source),
    Pictures(Vec<Picture>),
}

/// A picture and its time.
struct Picture {
    path: PathBuf,
    time_us: i64,
    timestamp_us: Option<i64>,
}

/// All that is played.
pub(super) struct Feed {
    items: Vec<Item>,
    options: Options,
    post: Posted,
    quality: u8,
}

impl Feed {
    pub(super) fn of(replay: &Replay) -> Result<Self, Fault> {
        let rate = replay.moving.fps.unwrap_or(PICTURES_PER_SECOND);
        let mut items = Vec::new();
        for given in &replay.sources {
            // The times of two folders have nothing to do with each other.
            if given.is_dir() {
                items.push(Item::Pictures(Vec::new()));
            }
            let times = Times::of(given, replay.moving.fps.is_some());
            for path in frames_of(std::slice::from_ref(given))? {
                if Source::is_video(&path) {
                    items.push(Item::Video(Source::of(&path)));
                    continue;
                }
                if !matches!(items.last(), Some(Item::Pictures(_))) {
                    items.push(Item::Pictures(Vec::new()));
                }
                if let Some(Item::Pictures(pictures)) = items.last_mut() {
                    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
                    let by_rate = (pictures.len() as f64 * 1e6 / rate).round() as i64;
                    let (time_us, timestamp_us) = times.of_picture(&path).unwrap_or((by_rate, None));
                    pictures.push(Picture { path, time_us, timestamp_us });
                }
            }
        }
        let apply = replay.orientation == OrientationHandling::Apply;
        let options = replay.moving.options(apply, Limits::default());
        Ok(Self { items, options, post: replay.post, quality: replay.quality })
    }

    /// Starts the thread. It ends when nobody takes frames any more.
    pub(super) fn start(self) -> Result<Receiver<Fed>, Fault> {
        let (sender, receiver) = channel(AHEAD);
        std::thread::Builder::new()
            .name("feed".into())
            .spawn(move || self.run(&sender))
            .map_err(|error| Fault::new(FaultKind::Internal, format!("no thread for the frames: {error}")))?;
        Ok(receiver)
    }

    fn run(&self, shots: &Sender<Fed>) {
        for item in &self.items {
            let is_wanted = match item {
                Item::Video(source) => self.video(source, shots),
                Item::Pictures(pictures) => Self::pictures(pictures, shots),
            };
            if !is_wanted {
                return;
            }
        }
    }

    /// False if nobody takes frames any more.
    fn video(&self, source: &Source, shots: &Sender<Fed>) -> bool {
        let name = source.to_string();
        let failed = |fault: Fault| Err((name.clone(), fault));
        let mut grabber = match Grabber::open(source, &self.options) {
            Ok(grabber) => grabber,
            Err(error) => return shots.blocking_send(failed(error.into())).is_ok(),
        };
        let mut is_first = true;
        for grabbed in &mut grabber {
            let fed = grabbed.map_err(Fault::from).and_then(|grabbed| {
                Ok(Shot {
                    source: name.clone(),
                    index: grabbed.index,
                    is_video: true,
                    is_live: source.is_live(),
                    is_first: std::mem::take(&mut is_first),
                    time_us: grabbed.time_us,
                    timestamp_us: Some(grabbed.timestamp_us),
                    body: self.body(&grabbed.frame)?,
                })
            });
            if shots.blocking_send(fed.or_else(failed)).is_err() {
                return false;
            }
        }
        tell_oddities(source, &grabber);
        true
    }

    fn body(&self, frame: &Frame) -> Result<Body, Fault> {
        let encoded = match self.post {
            Posted::Jpeg => encode::jpeg(frame, self.quality),
            Posted::Png => encode::png(frame),
            Posted::Raw => {
                let (width, height) = (frame.width(), frame.height());
                return Ok(Body::Rgb { width, height, bytes: frame.rgb().into_owned() });
            }
        };
        encoded.map(Body::Encoded).map_err(|error| Fault::new(FaultKind::Senseless, error.to_string()))
    }

    /// False if nobody takes frames any more.
    fn pictures(pictures: &[Picture], shots: &Sender<Fed>) -> bool {
        (0..).zip(pictures).all(|(index, picture)| {
            let source = picture.path.display().to_string();
            let fed = match std::fs::read(&picture.path) {
                Ok(bytes) => Ok(Shot {
                    source,
                    index,
                    is_video: false,
                    is_live: false,
                    is_first: index == 0,
                    time_us: picture.time_us,
                    timestamp_us: picture.timestamp_us,
                    body: Body::Encoded(bytes),
                }),
                Err(error) => Err((source, unreadable_source(&error))),
            };
            shots.blocking_send(fed).is_ok()
        })
    }
}

/// Times that `skypose grab` has written beside its pictures.
struct Times(BTreeMap<String, (i64, Option<i64>)>);

#[derive(Deserialize)]
struct Entry {
    file: String,
    time_us: i64,
    timestamp_us: i64,
}

impl Times {
    /// Of a folder. A rate that is asked for goes over them.
    fn of(folder: &Path, is_rated: bool) -> Self {
        let text = if is_rated { None } else { std::fs::read_to_string(folder.join("frames.jsonl")).ok() };
        let entries = text.iter().flat_map(|text| text.lines()).filter_map(|line| serde_json::from_str(line).ok());
        // A time since the source's start is no date.
        let dated = |entry: &Entry| (entry.timestamp_us != entry.time_us).then_some(entry.timestamp_us);
        Self(entries.map(|entry: Entry| (entry.file.clone(), (entry.time_us, dated(&entry)))).collect())
    }

    fn of_picture(&self, path: &Path) -> Option<(i64, Option<i64>)> {
        self.0.get(path.file_name()?.to_str()?).copied()
    }
}
