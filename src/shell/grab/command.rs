//! What ffmpeg is told.

use std::process::{Command, Stdio};

use super::{Options, Source};
use crate::frame::Wanted;

/// What is done about interlaced video, whose frames show two moments in alternate rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Deinterlace {
    /// Frames that the source says are interlaced are deinterlaced.
    #[default]
    Auto,
    /// All frames are: for sources that do not say so.
    Always,
    /// None is.
    Never,
}

/// The option by which no frame is repeated or left out to make the rate even.
pub(super) const PASS_ALL: &str = "fps_mode";
/// Its name before.
pub(super) const PASS_ALL_BEFORE_5_1: &str = "vsync";

/// Of a source to planes on standard output and time stamps in the log.
pub(super) fn of(source: &Source, options: &Options, pass_all: &str) -> Command {
    let mut command = Command::new("ffmpeg");
    // The level before each message tells errors from facts; without `repeat`, stamps could be left out; changes of size are
    // told of at `verbose`.
    command.args(["-hide_banner", "-nostdin", "-nostats", "-loglevel", "repeat+level+verbose"]);
    let (known, name) = source.input();
    command.args(known);
    if !options.apply_orientation {
        command.arg("-noautorotate");
    }
    for (option, value) in &options.input {
        command.arg(format!("-{option}")).arg(value);
    }
    command.arg("-i").arg(name);
    // V: a cover is no video.
    command.args(["-map", "0:V:0", "-an", "-sn", "-dn"]);
    command.args(["-vf", &filters(options)]);
    command.args([&format!("-{pass_all}"), "passthrough", "-f", "yuv4mpegpipe", "pipe:1"]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    // Nothing of ours in colour, and no report file that somebody asked for of another run.
    command.env("AV_LOG_FORCE_NOCOLOR", "1").env_remove("AV_LOG_FORCE_COLOR").env_remove("FFREPORT");
    command
}

/// The first frame of every period since the start, with its own time: ffmpeg's `fps` would give it the time of the nearest tick, and
/// repeat frames of slow sources.
fn sparse(fps: f64) -> String {
    // Times are rounded to their time base, so that a tick may lie just before its frame.
    let period = |time: &str| format!("floor(({time}-start_t)*{fps}+1e-3)");
    format!("select='isnan(prev_selected_t)+gt({},{})'", period("t"), period("prev_selected_t"))
}

/// The way of each frame.
fn filters(options: &Options) -> String {
    let mut filters = Vec::new();
    match options.deinterlace {
        Deinterlace::Auto => filters.push("bwdif=mode=send_frame:deint=interlaced".to_owned()),
        Deinterlace::Always => filters.push("bwdif=mode=send_frame:deint=all".to_owned()),
        Deinterlace::Never => {}
    }
    if let Some(fps) = options.fps {
        filters.push(sparse(fps));
    }
    // The colour space of `Pixels::YCbCr`; planes that are in it already pass as they are.
    filters.push("scale=out_color_matrix=bt601:out_range=full".into());
    filters.push(match options.wanted {
        Wanted::Luma => "format=pix_fmts=gray".into(),
        Wanted::Native | Wanted::Rgb => "format=pix_fmts=yuv420p|yuv422p|yuv444p|gray".into(),
    });
    // Every frame's time in the log, in whole microseconds. Only metadata are printed, so each frame gets some.
    filters.push("settb=expr=1/1000000".into());
    filters.push("metadata=mode=add:key=skypose:value=1".into());
    filters.push("metadata=mode=print:key=skypose".into());
    filters.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn words(source: &str, options: &Options) -> String {
        let command = of(&Source::of(Path::new(source)), options, PASS_ALL);
        command.get_args().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_file_is_a_file_whatever_its_name() {
        assert!(words("-y.mp4", &Options::default()).contains(" -i file:-y.mp4 "));
        assert!(words("rtsp://x", &Options::default()).contains(" -rtsp_flags prefer_tcp -noautorotate -i rtsp://x "));
        let camera = Options { input: vec![("video_size".into(), "1280x720".into())], ..Options::default() };
        assert!(words("/dev/video1", &camera).contains(" -f v4l2 -noautorotate -video_size 1280x720 -i /dev/video1 "));
    }

    #[test]
    fn frames_are_deinterlaced_before_some_are_left_out() {
        let some = Options { fps: Some(2.5), ..Options::default() };
        assert!(filters(&some).starts_with("bwdif=mode=send_frame:deint=interlaced,select='"));
        let never = Options { deinterlace: Deinterlace::Never, ..Options::default() };
        assert!(filters(&never).starts_with("scale="));
    }

    #[test]
    fn where_luma_is_enough_no_colours_are_read() {
        let luma = Options { wanted: Wanted::Luma, ..Options::default() };
        assert!(filters(&luma).contains(",format=pix_fmts=gray,"), "{}", filters(&luma));
        assert!(filters(&Options::default()).contains("yuv420p"));
    }
}
