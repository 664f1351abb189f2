//! What ffmpeg says on standard error: facts about the source, a time stamp for each frame, complaints.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::process::ChildStderr;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use super::error::GrabError;
use super::stamp::epoch_us;
use super::{Orientation, Source};

/// A line longer than this is taken in pieces.
const MAX_LINE: u64 = 8192;

/// Complaints that are kept: the last ones say why it ended.
const MAX_COMPLAINTS: usize = 3;

/// Words for a picture that was not decoded, or only in part; those of later versions of ffmpeg are others.
const LOST: [&str; 4] =
    ["Error while decoding stream", "Error submitting packet to decoder", "corrupt decoded frame", "overread "];

/// What the source says of itself.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Facts {
    /// Its length.
    pub(super) duration_us: Option<i64>,
    /// When it was recorded.
    pub(super) recorded_us: Option<i64>,
    /// How its frames are to be turned.
    pub(super) orientation: Orientation,
}

/// What has been said so far.
#[derive(Debug, Default)]
pub(super) struct Log {
    /// What the source says of itself.
    pub(super) facts: Facts,
    /// Errors, no two alike.
    complaints: VecDeque<String>,
    /// All of them.
    count: u64,
    /// Whether a frame has been told of.
    has_begun: bool,
    /// Whether a picture was lost since.
    has_lost: bool,
    /// What goes into the filters, in ffmpeg's words.
    size: Option<String>,
}

/// What the log says of the frames, in their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    /// The next one has this time, microseconds.
    Time(i64),
    /// All further ones have another size, and are scaled to the first: no camera has taken them so.
    Resized,
}

impl Log {
    /// Whoever panicked, the facts are facts.
    pub(super) fn of(shared: &Mutex<Self>) -> MutexGuard<'_, Self> {
        shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The complaints in one line; empty if there are none.
    pub(super) fn words(&self) -> String {
        let words = self.complaints.iter().map(String::as_str).collect::<Vec<_>>().join("; ");
        let more = self.count - self.complaints.len() as u64;
        if more > 0 { format!("{words} (and {more} more)") } else { words }
    }

    /// Whether a picture was lost, wholly or in part, after the first that was whole: a recording that begins in the midst of a stream
    /// has all that can be had of it.
    pub(super) const fn has_lost(&self) -> bool {
        self.has_lost
    }

    fn complain(&mut self, words: String) {
        self.count += 1;
        if self.complaints.contains(&words) {
            return;
        }
        if self.complaints.len() == MAX_COMPLAINTS {
            self.complaints.pop_front();
        }
        self.complaints.push_back(words);
    }

    /// Takes in a line.
    fn hear(&mut self, line: &str, names: &[String; 2]) -> Option<Mark> {
        if line.starts_with("[Parsed_metadata_") {
            let stamp = stamp_of(line);
            self.has_begun |= stamp.is_some();
            return stamp.map(Mark::Time);
        }
        let after = |level: &str| line.split_once(level).map(|(_, words)| words.trim());
        let is_lost = |words: &&str| LOST.iter().any(|lost| words.contains(lost));
        let complaint = ["[error] ", "[fatal] ", "[panic] "].into_iter().find_map(after);
        if let Some(words) = complaint.or_else(|| after("[warning] ").filter(is_lost)) {
            self.has_lost |= self.has_begun && is_lost(&words);
            self.complain(words.replace(&format!("{}: ", names[0]), "").replace(&names[0], &names[1]));
        } else if let Some(words) = after("[info] ") {
            self.facts.learn(words);
        } else if line.starts_with("[graph") {
            let size = after("[verbose] w:")?.split(" pixfmt:").next()?;
            match &self.size {
                Some(first) if first != size => return Some(Mark::Resized),
                Some(_) => {}
                None => self.size = Some(size.into()),
            }
        }
        None
    }
}

/// `... frame:12   pts:400000  pts_time:0.4`.
fn stamp_of(line: &str) -> Option<i64> {
    let (_, rest) = line.split_once(" pts:")?;
    rest.split_whitespace().next()?.parse().ok()
}

impl Facts {
    /// What is said of the input comes first, and what comes first holds: of the output the same words are said again.
    fn learn(&mut self, words: &str) {
        let Some((name, value)) = words.split_once(':') else {
            return;
        };
        match name.trim() {
            "Duration" if self.duration_us.is_none() => {
                self.duration_us = value.split(',').next().and_then(|clock| clock_us(clock.trim()));
            }
            // Zero is how recorders without a clock state it.
            "creation_time" if self.recorded_us.is_none() => {
                self.recorded_us = epoch_us(value.trim()).filter(|us| *us > 0);
            }
            "displaymatrix" if self.orientation == Orientation::Upright => {
                self.orientation = value.split_whitespace().find_map(turn_of).unwrap_or_default();
            }
            _ => {}
        }
    }
}

/// `00:00:10.77` in microseconds.
fn clock_us(clock: &str) -> Option<i64> {
    let mut parts = clock.split(':');
    let mut part = || parts.next()?.parse::<f64>().ok().filter(|part| (0.0..1e6).contains(part));
    let seconds = part()? * 3600.0 + part()? * 60.0 + part()?;
    #[expect(clippy::cast_possible_truncation, reason = "at most 4e9 s")]
    Some((seconds * 1e6).round() as i64)
}

/// Degrees to the left by which the picture is stated to be turned, as the value that EXIF has for it.
fn turn_of(degrees: &str) -> Option<Orientation> {
    let degrees: f64 = degrees.parse().ok()?;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 4")]
    let quarters = (degrees.rem_euclid(360.0) / 90.0).round() as u8;
    Some(match quarters % 4 {
        1 => Orientation::Turned(8),
        2 => Orientation::Turned(3),
        3 => Orientation::Turned(6),
        _ => Orientation::Upright,
    })
}

/// The thread that listens, so that the pipe never fills up.
#[derive(Debug)]
pub(super) struct LogReader {
    log: Arc<Mutex<Log>>,
    thread: Option<JoinHandle<()>>,
}

impl LogReader {
    /// Starts to listen; marks come in the order of the frames, each before its frame.
    pub(super) fn start(err: ChildStderr, source: &Source) -> Result<(Self, Receiver<Mark>), GrabError> {
        let log = Arc::new(Mutex::new(Log::default()));
        // As many marks as frames can be under way in ffmpeg, whose other pipe holds them back.
        let (sender, marks) = channel();
        let shared = Arc::clone(&log);
        let names = names_of(source);
        let listening = move || listen(BufReader::new(err), &shared, &sender, &names);
        let thread = std::thread::Builder::new()
            .name("ffmpeg-log".into())
            .spawn(listening)
            .map_err(|error| GrabError::NotRun { detail: error.to_string() })?;
        Ok((Self { log, thread: Some(thread) }, marks))
    }

    pub(super) const fn shared(&self) -> &Arc<Mutex<Log>> {
        &self.log
    }

    /// Waits until everything has been heard.
    pub(super) fn join(&mut self) {
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What ffmpeg calls the source, and what we call it: without a password, and without the name of a protocol. Before a
/// complaint the name is left out; whoever tells of it names the source.
fn names_of(source: &Source) -> [String; 2] {
    [source.input().1.to_string_lossy().into_owned(), source.to_string()]
}

fn listen(mut err: impl BufRead, log: &Mutex<Log>, marks: &Sender<Mark>, names: &[String; 2]) {
    let mut line = Vec::new();
    loop {
        line.clear();
        match err.by_ref().take(MAX_LINE).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let text = String::from_utf8_lossy(&line);
        // After the last frame nobody waits for a mark.
        if let Some(mark) = Log::of(log).hear(text.trim_end(), names) {
            let _ = marks.send(mark);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn heard(text: &str) -> (Log, Vec<Mark>) {
        let log = Mutex::new(Log::default());
        let (sender, marks) = channel();
        listen(text.as_bytes(), &log, &sender, &["file:a.mp4".into(), "a.mp4".into()]);
        drop(sender);
        (log.into_inner().expect("no panic"), marks.iter().collect())
    }

    #[test]
    fn facts_of_the_input_stamps_and_complaints_are_told_apart() {
        let (log, marks) = heard(
            "[info] Input #0, mov,mp4,m4a,3gp,3g2,mj2, from 'file:a.mp4':\n\
             [info]     creation_time   : 2020-03-30T20:01:38.000000Z\n\
             [info]     title           : frame:0 pts:77\n\
             [info]   Duration: 00:01:10.77, start: 0.033333, bitrate: 1078 kb/s\n\
             [info]       displaymatrix: rotation of -90.00 degrees\n\
             [info] Output #0, yuv4mpegpipe, to 'pipe:':\n\
             [info]       creation_time   : 2021-01-01T00:00:00.000000Z\n\
             [Parsed_metadata_5 @ 0x557e05ee5700] [info] frame:0    pts:0       pts_time:0\n\
             [Parsed_metadata_5 @ 0x557e05ee5700] [info] skypose=1\n\
             [h264 @ 0x55] [error] concealing 3 errors\n\
             [Parsed_metadata_5 @ 0x557e05ee5700] [info] frame:1    pts:33333   pts_time:0.0333333\n\
             [error] file:a.mp4: Invalid data found when processing input\n\
             [fatal] no frames in file:a.mp4\n",
        );
        let recorded_us = Some(1_585_598_498_000_000);
        let facts = Facts { duration_us: Some(70_770_000), recorded_us, orientation: Orientation::Turned(6) };
        assert_eq!(log.facts, facts);
        assert_eq!(marks, [Mark::Time(0), Mark::Time(33_333)]);
        assert_eq!(log.words(), "concealing 3 errors; Invalid data found when processing input; no frames in a.mp4");
    }

    #[test]
    fn what_was_lost_after_the_first_picture_counts_and_harmless_complaints_do_not() {
        let stamp = "[Parsed_metadata_5 @ 0x5] [info] frame:0    pts:0       pts_time:0\n";
        let corrupt = "[warning] file:a.mp4: corrupt decoded frame in stream 0\n";
        let undecoded = "[error] Error while decoding stream #0:0: Invalid data found when processing input\n";
        let harmless = "[h264 @ 0x5] [error] mmco: unref short failure\n\
                        [mpegts @ 0x5] [warning] Packet corrupt (stream = 0, dts = 482400).\n";
        for (text, lost) in [
            ([stamp, corrupt], true),
            ([stamp, undecoded], true),
            ([undecoded, stamp], false),
            ([stamp, harmless], false),
        ] {
            assert_eq!(heard(&text.concat()).0.has_lost(), lost, "{text:?}");
        }
        let (log, _) = heard(&[stamp, corrupt].concat());
        assert_eq!(log.words(), "corrupt decoded frame in stream 0");
    }

    #[test]
    fn a_change_of_size_comes_between_the_frames_that_it_parts() {
        let size = |size: &str| {
            format!("[graph 0 input from stream 0:0 @ 0x5] [verbose] {size} pixfmt:yuv420p tb:1/9 fr:10/1\n")
        };
        let stamp = |us: i64| format!("[Parsed_metadata_5 @ 0x5] [info] frame:0    pts:{us}       pts_time:0\n");
        let same = size("w:320 h:240");
        let text = [same.clone(), stamp(0), same, stamp(1), size("w:640 h:480"), stamp(2)].concat();
        let (_, marks) = heard(&text);
        assert_eq!(marks, [Mark::Time(0), Mark::Time(1), Mark::Resized, Mark::Time(2)]);
    }

    #[test]
    fn a_live_source_has_no_length_and_a_recorder_without_a_clock_no_date() {
        let (log, _) =
            heard("[info]   Duration: N/A, start: 0.0\n[info] creation_time : 1970-01-01T00:00:00.000000Z\n");
        assert_eq!(log.facts, Facts::default());
    }

    #[test]
    fn however_much_is_said_little_is_kept() {
        let text: Vec<String> = (0..1000).map(|n| format!("[x @ 0x1] [error] fault {}\n", n % 50)).collect();
        let (log, _) = heard(&text.concat());
        assert_eq!(log.words(), "fault 47; fault 48; fault 49 (and 997 more)");
        let (log, _) = heard(&"x".repeat(1_000_000));
        assert_eq!(log.words(), "");
    }

    #[test]
    fn turns_are_those_of_exif() {
        for (degrees, exif) in [("-90.00", 6), ("90.00", 8), ("180.00", 3), ("-180.00", 3), ("0.00", 1), ("-0.00", 1)] {
            assert_eq!(turn_of(degrees).map(Orientation::exif), Some(exif), "{degrees}");
        }
        assert_eq!(turn_of("rotation"), None);
    }
}
