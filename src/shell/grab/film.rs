//! The other way: pictures into a video, by the same program.

use std::io::{Read, Write};
use std::path::Path;
use std::process::{ChildStderr, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use super::child::Running;
use super::error::GrabError;

/// Endings of the names of videos that are written.
pub const VIDEO_ENDINGS: [&str; 7] = ["mp4", "mkv", "mov", "m4v", "avi", "webm", "ts"];

/// Whether a name is that of a video.
#[must_use]
pub fn is_video_name(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| VIDEO_ENDINGS.contains(&ending.as_str()))
}

/// A video that is being written. What is not [finished](Self::finish) is no whole video.
#[derive(Debug)]
pub struct Film {
    child: Running,
    pixels: Option<ChildStdin>,
    words: Option<JoinHandle<String>>,
}

impl Film {
    /// Begins a video of pictures of this size, RGB, at `rate_hz`; what stood at `path` is replaced.
    ///
    /// # Errors
    /// If `ffmpeg` cannot be run.
    pub fn create(path: &Path, [width, height]: [u32; 2], rate_hz: f64) -> Result<Self, GrabError> {
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-nostats", "-loglevel", "error", "-y"]);
        command.args(["-f", "rawvideo", "-pixel_format", "rgb24", "-video_size", &format!("{width}x{height}")]);
        command.args(["-framerate", &rate_hz.to_string(), "-i", "pipe:0"]);
        // Most players want both sides even, and colours at half the rate.
        command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]);
        let mut file = std::ffi::OsString::from("file:");
        file.push(path);
        command.arg(file);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.env("AV_LOG_FORCE_NOCOLOR", "1").env_remove("AV_LOG_FORCE_COLOR").env_remove("FFREPORT");
        let (child, _, words) = Running::start(command).map_err(|error| match error {
            GrabError::NoProgram => GrabError::NoProgramToWrite,
            other => other,
        })?;
        let pixels = child.take_input();
        let words = std::thread::Builder::new().name("ffmpeg-words".into()).spawn(move || last_line(words));
        let words = words.map_err(|error| GrabError::NotRun { detail: error.to_string() })?;
        Ok(Self { child, pixels, words: Some(words) })
    }

    /// One more picture: its rows of red, green, blue from the top.
    ///
    /// # Errors
    /// If `ffmpeg` takes no more, with its reason.
    pub fn push(&mut self, rgb: &[u8]) -> Result<(), GrabError> {
        let written = self.pixels.as_mut().map(|pixels| pixels.write_all(rgb));
        if matches!(written, Some(Ok(()))) { Ok(()) } else { Err(self.unwritable()) }
    }

    /// Ends the video.
    ///
    /// # Errors
    /// If it could not be written, with the reason.
    pub fn finish(mut self) -> Result<(), GrabError> {
        drop(self.pixels.take());
        let words = self.words.take().and_then(|words| words.join().ok()).unwrap_or_default();
        if self.child.wait() { Ok(()) } else { Err(GrabError::Unwritable { words }) }
    }

    fn unwritable(&mut self) -> GrabError {
        drop(self.pixels.take());
        let words = self.words.take().and_then(|words| words.join().ok()).unwrap_or_default();
        GrabError::Unwritable { words }
    }
}

fn last_line(mut from: ChildStderr) -> String {
    let mut text = Vec::new();
    // What can be read of its words is better than none.
    let _ = from.read_to_end(&mut text);
    let text = String::from_utf8_lossy(&text).into_owned();
    text.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("ffmpeg ended without a word").trim().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn videos_are_known_by_their_names() {
        for (name, is_video) in
            [("a.mp4", true), ("b/C.MKV", true), ("frames", false), ("a.png", false), ("mp4", false)]
        {
            assert_eq!(is_video_name(Path::new(name)), is_video, "{name}");
        }
    }
}
