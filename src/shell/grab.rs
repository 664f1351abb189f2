//! Frames out of videos, streams and webcams, one at a time, by the `ffmpeg` program as a child process.
//!
//! `ffmpeg` decodes, deinterlaces and, if asked, resamples; uncompressed planes come through its standard output and the
//! frames' time stamps through its log. Two threads of ours read, one each, so that neither pipe can fill up while the other
//! is waited for. What is not fetched holds a file back: at most a few frames are in memory. A live source cannot be held
//! back; its frames that nobody fetches in time are dropped and counted.
//!
//! The child is in a process group of its own and never outlives the [`Grabber`]: it is killed and waited for when that is
//! dropped, and when a signal ends us.

mod child;
mod command;
mod ending;
mod error;
pub mod film;
mod interrupt;
mod log;
mod reader;
mod source;
mod stamp;
mod y4m;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

pub use command::Deinterlace;
pub use error::GrabError;
pub use interrupt::is_interrupted;
pub use source::Source;

use crate::frame::{Frame, Limits, Orientation, Wanted};
use child::Running;
use log::{Log, LogReader};
use reader::{Dropped, Reader};

/// How a source is read.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Frames a second, by repeating and leaving out; all frames as they come if none.
    pub fps: Option<f64>,
    /// What is done about interlaced video.
    pub deinterlace: Deinterlace,
    /// Turn the frames as the source says. Off by default: intrinsics belong to the sensor's pixel grid.
    pub apply_orientation: bool,
    /// Options of ffmpeg for this input, as in `video_size` and `1280x720`.
    pub input: Vec<(String, String)>,
    /// When the first frame was taken, microseconds since the Unix epoch; what the source says, if none.
    pub start_us: Option<i64>,
    /// What of the frames is needed: where luma is enough, their colours are not read.
    pub wanted: Wanted,
    /// What a frame may cost.
    pub limits: Limits,
    /// Frames that may wait to be fetched.
    pub ahead: usize,
    /// How long a live source may be silent.
    pub patience: Duration,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            fps: None,
            deinterlace: Deinterlace::default(),
            apply_orientation: false,
            input: Vec::new(),
            start_us: None,
            wanted: Wanted::Native,
            limits: Limits::default(),
            // One is worked on, one waits, one is being read.
            ahead: 1,
            // Some cameras take seconds until the first frame from which decoding can start.
            patience: Duration::from_secs(15),
        }
    }
}

/// One frame of a source.
#[derive(Clone, Debug, PartialEq)]
pub struct Grabbed {
    /// Its number, from 0; those that were dropped count.
    pub index: u64,
    /// Time since the source's start, microseconds.
    pub time_us: i64,
    /// The same since the Unix epoch where the start is known: a live source starts now, a file may say when it was
    /// recorded. Otherwise the time since the source's start.
    pub timestamp_us: i64,
    /// The picture.
    pub frame: Frame,
    /// Time from planes to the frame, microseconds.
    pub decode_us: u64,
}

/// A source that is being read.
#[derive(Debug)]
pub struct Grabber {
    child: Running,
    frames: Option<Receiver<Result<Grabbed, GrabError>>>,
    reader: Option<JoinHandle<bool>>,
    log: LogReader,
    dropped: Dropped,
    /// The frame that proved that the source can be read.
    first: Option<Grabbed>,
    /// Frames given out, and the time of the last of them.
    passed: (u64, i64),
    patience: Option<Duration>,
    /// How much earlier than its stated end the last frame may be.
    slack_us: i64,
    /// The file, if it is one.
    file: Option<PathBuf>,
    over: bool,
    warning: Option<String>,
}

impl Grabber {
    /// Starts to read; returns when the first frame is there.
    ///
    /// # Errors
    /// No `ffmpeg`, no source, or one without a frame that can be read, with ffmpeg's words.
    pub fn open(source: &Source, options: &Options) -> Result<Self, GrabError> {
        interrupt::watch()?;
        source.check()?;
        match Self::try_open(source, options, command::PASS_ALL) {
            // Before version 5.1 the option had another name.
            Err(GrabError::Unreadable { words, .. }) if words.contains(command::PASS_ALL) => {
                Self::try_open(source, options, command::PASS_ALL_BEFORE_5_1)
            }
            result => result,
        }
    }

    fn try_open(source: &Source, options: &Options, pass_all: &str) -> Result<Self, GrabError> {
        let (child, out, err) = Running::start(command::of(source, options, pass_all))?;
        let (log, marks) = LogReader::start(err, source)?;
        let (sender, frames) = sync_channel(options.ahead.max(1));
        let reader = Reader::new(out, marks, Arc::clone(log.shared()), source, options);
        let dropped = reader.dropped();
        let mut grabber = Self {
            child,
            frames: Some(frames),
            reader: Some(reader.start(sender)?),
            log,
            dropped,
            first: None,
            passed: (0, 0),
            patience: source.is_live().then_some(options.patience),
            slack_us: slack_us(options),
            file: source.file().map(Path::to_path_buf),
            over: false,
            warning: None,
        };
        grabber.first = grabber.fetch().transpose()?;
        Ok(grabber)
    }

    /// Length in microseconds, where the source states it.
    #[must_use]
    pub fn duration_us(&self) -> Option<i64> {
        Log::of(self.log.shared()).facts.duration_us
    }

    /// How the source says that its frames are to be turned. Whether they have been is for the options to say.
    #[must_use]
    pub fn orientation(&self) -> Orientation {
        Log::of(self.log.shared()).facts.orientation
    }

    /// Frames of a live source that came while nobody fetched them.
    #[must_use]
    pub fn dropped(&self) -> u64 {
        self.dropped.get()
    }

    /// At the end: what was odd about a source that could be read nevertheless.
    #[must_use]
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// The next frame as the reader has it.
    fn fetch(&mut self) -> Option<Result<Grabbed, GrabError>> {
        if self.over {
            return None;
        }
        let frames = self.frames.as_ref()?;
        let received = match self.patience {
            None => frames.recv().map_err(|_| RecvTimeoutError::Disconnected),
            Some(patience) => frames.recv_timeout(patience),
        };
        let fetched = match received {
            Ok(Ok(grabbed)) => return Some(Ok(grabbed)),
            Ok(Err(error)) => Some(Err(error)),
            Err(RecvTimeoutError::Timeout) => {
                Some(Err(GrabError::Silent { frames: self.passed.0, patience: self.patience.unwrap_or_default() }))
            }
            Err(RecvTimeoutError::Disconnected) => self.ended().err().map(Err),
        };
        self.stop();
        fetched.filter(|_| !is_interrupted())
    }

    /// How it came to its end by itself.
    fn ended(&mut self) -> Result<(), GrabError> {
        // A reader that panicked has not read to the end.
        let is_whole = self.reader.take().is_some_and(|reader| reader.join().unwrap_or(false));
        let succeeded = self.child.wait();
        self.log.join();
        let log = Log::of(self.log.shared());
        let (frames, last_us) = self.passed;
        let (mut words, seconds) = (log.words(), last_us as f64 * 1e-6);
        if frames == 0 {
            return Err(if words.is_empty() { GrabError::NoFrames } else { GrabError::Unreadable { words } });
        }
        let missing_us = log.facts.duration_us.map_or(0, |duration| duration - last_us);
        let is_short = missing_us > self.slack_us && !words.is_empty();
        let cut_off = self.file.as_deref().and_then(ending::cut_off);
        if let Some(how) = cut_off {
            words = if words.is_empty() { how.into() } else { format!("{how}; {words}") };
        }
        if !is_whole || !succeeded || is_short || cut_off.is_some() {
            let of = log.facts.duration_us.map_or(String::new(), |us| format!(" of {:.2} s", us as f64 * 1e-6));
            return Err(GrabError::Broken { frames, seconds, of, words });
        }
        // On a line that is not ours pictures get lost, and it goes on.
        if self.patience.is_none() && log.has_lost() {
            return Err(GrabError::Damaged { frames, words });
        }
        self.warning = (!words.is_empty()).then(|| format!("{frames} frames could be read, but: {words}"));
        Ok(())
    }

    /// Ends the child and the threads, if they have not ended.
    fn stop(&mut self) {
        self.over = true;
        self.child.end();
        // Whoever waits to hand over a frame is told that nobody takes it.
        self.frames = None;
        if let Some(reader) = self.reader.take() {
            let _ = reader.join();
        }
        self.log.join();
    }
}

/// The last frame lasts for a while too, and sound may be longer than the pictures.
fn slack_us(options: &Options) -> i64 {
    let frame_us = options.fps.map_or(0.0, |fps| 1e6 / fps);
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let slack_us = 500_000.0_f64.max(2.0 * frame_us) as i64;
    slack_us
}

impl Iterator for Grabber {
    type Item = Result<Grabbed, GrabError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = match self.first.take() {
            Some(first) => Some(Ok(first)),
            None => self.fetch(),
        };
        if let Some(Ok(grabbed)) = &next {
            self.passed = (self.passed.0 + 1, grabbed.time_us);
        }
        next
    }
}

impl Drop for Grabber {
    fn drop(&mut self) {
        self.stop();
    }
}
