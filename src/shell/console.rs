//! The terminal: progress where somebody watches, and lines that end quietly when nobody reads on.

use std::io::{self, IsTerminal, Write};

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

/// Writes what went wrong to standard error, where there still is one.
pub fn complain(what: &str) {
    _ = writeln!(io::stderr(), "skypose: {what}");
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
