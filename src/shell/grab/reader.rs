//! The thread that makes frames of planes and marks.

use std::io::BufReader;
use std::process::ChildStdout;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Instant, SystemTime};

use super::error::GrabError;
use super::log::{Log, Mark};
use super::y4m::Header;
use super::{Grabbed, Options, Orientation, Source};
use crate::frame::{Frame, FrameError, Limits};

/// A pipe holds 64 kB; frames are read past this buffer.
const BUFFER: usize = 64 << 10;

/// Frames that nobody fetched in time.
#[derive(Clone, Debug, Default)]
pub(super) struct Dropped(Arc<AtomicU64>);

impl Dropped {
    pub(super) fn get(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// What the thread has.
pub(super) struct Reader {
    pipe: BufReader<ChildStdout>,
    marks: Receiver<Mark>,
    log: Arc<Mutex<Log>>,
    dropped: Dropped,
    is_live: bool,
    apply_orientation: bool,
    start_us: Option<i64>,
    limits: Limits,
}

impl Reader {
    pub(super) fn new(
        out: ChildStdout,
        marks: Receiver<Mark>,
        log: Arc<Mutex<Log>>,
        source: &Source,
        options: &Options,
    ) -> Self {
        Self {
            pipe: BufReader::with_capacity(BUFFER, out),
            marks,
            log,
            dropped: Dropped::default(),
            is_live: source.is_live(),
            apply_orientation: options.apply_orientation,
            start_us: options.start_us,
            limits: options.limits,
        }
    }

    pub(super) fn dropped(&self) -> Dropped {
        self.dropped.clone()
    }

    /// Starts the thread; it tells in the end whether the pipe ended where a frame did.
    pub(super) fn start(self, frames: SyncSender<Result<Grabbed, GrabError>>) -> Result<JoinHandle<bool>, GrabError> {
        std::thread::Builder::new()
            .name("ffmpeg-frames".into())
            .spawn(move || self.run(&frames))
            .map_err(|error| GrabError::NotRun { detail: error.to_string() })
    }

    fn run(mut self, frames: &SyncSender<Result<Grabbed, GrabError>>) -> bool {
        let header = match Header::read(&mut self.pipe) {
            Ok(Some(header)) => header,
            Ok(None) => return true,
            Err(_) => return false,
        };
        // Before memory is taken for them.
        if let Err(error) = self.limits.check_size(header.width, header.height) {
            let _ = frames.send(Err(error.into()));
            return true;
        }
        let mut planes = Vec::new();
        let mut epoch_us = None;
        for index in 0.. {
            match header.read_frame(&mut self.pipe, &mut planes) {
                Ok(true) => {}
                Ok(false) => return true,
                Err(_) => return false,
            }
            // In the log it comes before the frame does.
            let time_us = match self.marks.recv() {
                Ok(Mark::Time(us)) => us,
                Ok(Mark::Resized) => {
                    let _ = frames.send(Err(GrabError::SizeChanged { frames: index }));
                    return true;
                }
                Err(_) => return false,
            };
            let watch = Instant::now();
            let grabbed = self.frame(header, &planes).map(|frame| Grabbed {
                index,
                time_us,
                timestamp_us: time_us.saturating_add(*epoch_us.get_or_insert_with(|| self.epoch_us(time_us))),
                frame,
                decode_us: u64::try_from(watch.elapsed().as_micros()).unwrap_or(u64::MAX),
            });
            if !self.hand_over(grabbed.map_err(GrabError::from), frames) {
                return true;
            }
        }
        true
    }

    fn frame(&self, header: Header, planes: &[u8]) -> Result<Frame, FrameError> {
        let frame = Frame::from_planes(header.planar, header.width, header.height, planes, self.limits)?;
        let orientation =
            if self.apply_orientation { Orientation::Upright } else { Log::of(&self.log).facts.orientation };
        Ok(frame.stating(orientation))
    }

    /// Where stamps count from: microseconds since the Unix epoch, or zero where nobody knows.
    fn epoch_us(&self, first_us: i64) -> i64 {
        if let Some(start_us) = self.start_us {
            return start_us.saturating_sub(first_us);
        }
        if self.is_live {
            let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
            return i64::try_from(now.as_micros()).unwrap_or(i64::MAX).saturating_sub(first_us);
        }
        Log::of(&self.log).facts.recorded_us.unwrap_or(0)
    }

    /// False if nobody takes frames any more.
    fn hand_over(&self, grabbed: Result<Grabbed, GrabError>, frames: &SyncSender<Result<Grabbed, GrabError>>) -> bool {
        if !self.is_live {
            return frames.send(grabbed).is_ok();
        }
        match frames.try_send(grabbed) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.dropped.0.fetch_add(1, Ordering::Relaxed);
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }
}
