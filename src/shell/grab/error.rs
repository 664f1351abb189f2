//! What can go wrong between a source and its frames.

use std::time::Duration;

use thiserror::Error;

use crate::frame::FrameError;
use crate::shell::fault::{Fault, FaultKind};

/// Why a source gives no frames, or no more. Which source it is, whoever has named it knows.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum GrabError {
    /// There is no such program.
    #[error(
        "videos, streams and webcams are read by the program ffmpeg, which is not installed: apt-get install ffmpeg (Debian, \
         Ubuntu), dnf install ffmpeg-free (Fedora), brew install ffmpeg (macOS), winget install ffmpeg (Windows)"
    )]
    NoProgram,
    /// The same, when a video is to be written.
    #[error(
        "videos are written by the program ffmpeg, which is not installed: apt-get install ffmpeg (Debian, Ubuntu), dnf install \
         ffmpeg-free (Fedora), brew install ffmpeg (macOS), winget install ffmpeg (Windows); a name without an ending is taken as that of a \
         folder, for pictures"
    )]
    NoProgramToWrite,
    /// A video that could not be written.
    #[error("the video cannot be written: {words}")]
    Unwritable {
        /// ffmpeg's last words.
        words: String,
    },
    /// The system refuses to run it.
    #[error("ffmpeg cannot be run: {detail}")]
    NotRun {
        /// The system's words.
        detail: String,
    },
    /// No such file.
    #[error("{detail}")]
    NoSource {
        /// The system's words.
        detail: String,
    },
    /// It cannot be opened, or nothing in it decoded.
    #[error("not a video that can be read: {words}")]
    Unreadable {
        /// ffmpeg's last words.
        words: String,
    },
    /// It was opened and there was nothing in it.
    #[error("a video without frames")]
    NoFrames,
    /// It ended before its end.
    #[error("broken after {frames} frames, at {seconds:.2} s{of}: {words}")]
    Broken {
        /// Frames that were read.
        frames: u64,
        /// Time of the last of them.
        seconds: f64,
        /// The length that it states, in words.
        of: String,
        /// ffmpeg's last words.
        words: String,
    },
    /// Some of its frames did not decode, or not wholly.
    #[error("{frames} frames could be read, but some are damaged or missing: {words}")]
    Damaged {
        /// Frames that were read.
        frames: u64,
        /// ffmpeg's last words.
        words: String,
    },
    /// The picture became larger or smaller, so that it cannot be of the camera that it was of.
    #[error("the size of its frames changes after {frames} frames")]
    SizeChanged {
        /// Frames before the change.
        frames: u64,
    },
    /// A live source sends nothing.
    #[error("no frame for {} s, after {frames} frames", .patience.as_secs_f64())]
    Silent {
        /// Frames that were read.
        frames: u64,
        /// How long it was waited for.
        patience: Duration,
    },
    /// Frames that are not accepted.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

impl From<GrabError> for Fault {
    fn from(error: GrabError) -> Self {
        let kind = match &error {
            GrabError::NoProgram | GrabError::NoProgramToWrite | GrabError::NotRun { .. } => FaultKind::Internal,
            GrabError::Unwritable { .. } => FaultKind::Unreadable,
            GrabError::NoSource { .. } => FaultKind::NotFound,
            GrabError::Silent { .. } => FaultKind::DeadlineExceeded,
            GrabError::Unreadable { .. }
            | GrabError::NoFrames
            | GrabError::Broken { .. }
            | GrabError::Damaged { .. }
            | GrabError::SizeChanged { .. } => FaultKind::NotAFrame,
            GrabError::Frame(error) => Self::of_frame(error).kind,
        };
        Self::new(kind, error.to_string())
    }
}
