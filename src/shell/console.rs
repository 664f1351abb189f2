//! The terminal: progress where somebody watches, and lines that end quietly when nobody reads on.

use std::io::{self, IsTerminal, Write};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar on standard error, with rate and time left; nothing where that is no terminal or the work is short.
#[must_use]
pub fn progress(total: usize, what: &'static str) -> ProgressBar {
    let bar = ProgressBar::new(total as u64);
    let visible = total > 8 && io::stderr().is_terminal();
    bar.set_draw_target(if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() });
    let template = "{msg} {wide_bar} {pos}/{len} {per_sec} {eta} left";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}

/// How far a video has come: a bar with time left where its length is known, frames and their rate in any case; nothing
/// where standard error is no terminal.
#[derive(Debug)]
pub struct Timeline {
    bar: ProgressBar,
    start: Instant,
    frames: u64,
}

impl Timeline {
    /// For a video of this length.
    #[must_use]
    pub fn new(duration_us: Option<i64>) -> Self {
        let length = duration_us.and_then(|us| u64::try_from(us).ok());
        let bar = length.map_or_else(ProgressBar::no_length, ProgressBar::new);
        let is_watched = io::stderr().is_terminal();
        bar.set_draw_target(if is_watched { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() });
        let template = if length.is_some() { "{wide_bar} {percent}% {msg}, {eta} left" } else { "{spinner} {msg}" };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Self { bar, start: Instant::now(), frames: 0 }
    }

    /// One more frame, at this time of the video.
    pub fn step(&mut self, time_us: i64) {
        self.frames += 1;
        if self.bar.is_hidden() {
            return;
        }
        let rate = self.frames as f64 / self.start.elapsed().as_secs_f64().max(1e-3);
        let seconds = time_us as f64 * 1e-6;
        self.bar.set_message(format!("{} frames, {seconds:.1} s, {rate:.0}/s", self.frames));
        self.bar.set_position(u64::try_from(time_us).unwrap_or(0));
    }

    /// Prints something else in between.
    pub fn suspend<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bar.suspend(print)
    }
}

impl Drop for Timeline {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// Writes what went wrong to standard error, where there still is one.
pub fn complain(what: &str) {
    _ = writeln!(io::stderr(), "skypose: {what}");
}

/// Writes to standard error what is worth knowing and nothing wrong.
pub fn note(what: &str) {
    _ = writeln!(io::stderr(), "{what}");
}

/// Writes a line to standard output.
///
/// # Errors
/// If it cannot be written; see [`is_closed`].
pub fn print_line(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(line.as_bytes())?;
    out.write_all(b"\n")
}

/// Whether the reader of our output has gone, as `head` does: a reason to end, not an error.
#[must_use]
pub fn is_closed(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::BrokenPipe
}
