//! Videos, streams and webcams on the command line.

use std::path::PathBuf;

use clap::Args;

use crate::frame::{Limits, Orientation};
use crate::shell::console::complain;
use crate::shell::grab::{Deinterlace, Grabber, Options, Source};

/// How videos, streams and webcams are read. The program ffmpeg does it.
#[derive(Args, Clone, Debug)]
pub(super) struct MovingArgs {
    /// Videos: frames a second at most, each with its own time; the others are left out [default: all frames, as they come].
    #[arg(long, value_name = "N", value_parser = rate)]
    pub(super) fps: Option<f64>,
    /// Videos: what is done about interlaced ones. Auto goes by what each frame says of itself.
    #[arg(long, value_name = "WHEN", value_enum, default_value_t)]
    deinterlace: Deinterlace,
    /// Videos: when the first frame was taken, in microseconds since 1970 [default: what the file says].
    #[arg(long, value_name = "TIME_US")]
    start: Option<i64>,
    /// Streams and webcams: an option of ffmpeg for them, as in `video_size=1280x720`.
    #[arg(long, value_name = "NAME=VALUE", value_parser = pair)]
    input_option: Vec<(String, String)>,
}

impl MovingArgs {
    /// For the reader.
    pub(super) fn options(&self, apply_orientation: bool, limits: Limits) -> Options {
        Options {
            fps: self.fps,
            deinterlace: self.deinterlace,
            apply_orientation,
            input: self.input_option.clone(),
            start_us: self.start,
            limits,
            ..Options::default()
        }
    }
}

/// Frames a second that make sense.
fn rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.001..=1000.0).contains(rate));
    rate.ok_or_else(|| "a number of frames a second is expected, from 0.001 to 1000".into())
}

/// `name=value`.
fn pair(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if name.starts_with(|c: char| c.is_ascii_alphabetic()) => Ok((name.into(), value.into())),
        _ => Err("name=value is expected".into()),
    }
}

/// A name as of a file for one frame of a source.
pub(super) fn frame_name(source: &Source, index: u64) -> PathBuf {
    let shown = source.to_string();
    let last = shown.rsplit(['/', '\\']).find(|part| !part.is_empty()).unwrap_or("frame");
    let stem = match last.rsplit_once('.') {
        Some((stem, _)) if !stem.is_empty() => stem,
        _ => last,
    };
    let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' };
    PathBuf::from(format!("{}-{index:06}.png", stem.chars().map(plain).collect::<String>()))
}

/// What a person should know of a source beside its frames.
pub(super) fn tell_oddities(source: &Source, grabber: &Grabber) {
    if let Some(warning) = grabber.warning() {
        complain(&format!("{source}: {warning}"));
    }
    let dropped = grabber.dropped();
    if dropped > 0 {
        complain(&format!("{source}: frames dropped, as they came faster than they could be used: {dropped}"));
    }
}

/// That the pixels are not as a player would show them.
pub(super) fn tell_orientation(source: &Source, grabber: &Grabber) {
    let turn = match grabber.orientation() {
        Orientation::Turned(6) => "90 degrees to the right",
        Orientation::Turned(8) => "90 degrees to the left",
        Orientation::Turned(_) => "180 degrees",
        Orientation::Upright => return,
    };
    complain(&format!(
        "{source}: to be shown turned by {turn}; the frames are as the sensor has them (--orientation apply turns them)"
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_named_after_their_source() {
        let name = |source: &str| frame_name(&Source::of(source.as_ref()), 12).display().to_string();
        assert_eq!(name("a/my.video.mp4"), "my.video-000012.png");
        assert_eq!(name("/dev/video0"), "video0-000012.png");
        assert_eq!(name("rtsp://me:secret@camera/live/?track=1"), "-track-1-000012.png");
        assert_eq!(name("rtsp://me:secret@camera"), "me-----camera-000012.png");
    }

    #[test]
    fn a_rate_is_a_number_of_frames() {
        assert_eq!(rate("29.97"), Ok(29.97));
        for wrong in ["0", "-1", "NaN", "inf", "many", "1001"] {
            assert!(rate(wrong).is_err(), "{wrong}");
        }
    }
}
