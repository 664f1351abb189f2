//! Videos: their frames, their times, and what is wrong with them. The videos are made here, by ffmpeg, of frames whose
//! content is known.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stderr,
    reason = "a test says what it takes for granted, and what it leaves out"
)]

#[path = "program/said.rs"]
mod said;

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use said::Said;
use serde_json::{Value, json};
use skypose::frame::{Decoding, Frame};
use skypose::geometry::CameraFromTarget;
use skypose::random;
use skypose::scene::flight::Flight;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::wire::{CameraWire, TargetWire};
use tempfile::TempDir;

const SKYPOSE: &str = env!("CARGO_BIN_EXE_skypose");

/// Whether ffmpeg is there; where it is not, the test says so and passes. `.ci/run` installs it.
fn has_ffmpeg() -> bool {
    let runs = Command::new("ffmpeg").arg("-version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok();
    if !runs {
        eprintln!("left out: ffmpeg is not installed");
    }
    runs
}

/// Leaves the test where there is no ffmpeg.
macro_rules! need_ffmpeg {
    () => {
        if !has_ffmpeg() {
            return;
        }
    };
}

/// A folder in which the program runs.
struct Desk(TempDir);

impl Desk {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(SKYPOSE);
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SKYPOSE_")) {
            command.env_remove(name);
        }
        command.args(arguments).current_dir(self.0.path()).stdin(Stdio::null());
        command
    }

    fn run(&self, arguments: &[&str]) -> Said {
        Said::of(self.command(arguments).output().expect("starts"))
    }

    /// ffmpeg with these arguments, separated by blanks; whether it could.
    fn ffmpeg(&self, arguments: &str, input: &[u8]) -> bool {
        let mut command = Command::new("ffmpeg");
        command.args(["-v", "error", "-y"]).args(arguments.split(' ')).current_dir(self.0.path());
        let mut child = command.stdin(Stdio::piped()).stderr(Stdio::null()).spawn().expect("starts");
        // Where it gives up before the end, its status tells.
        let _ = child.stdin.take().expect("piped").write_all(input);
        child.wait().expect("ends").success()
    }

    /// The lines of a folder's list.
    fn list(&self, folder: &str) -> Vec<Value> {
        let text = fs::read_to_string(self.path(folder).join("frames.jsonl")).expect("a list");
        text.lines().map(|line| serde_json::from_str(line).expect("a line is JSON")).collect()
    }

    /// The pictures of a folder, in the order of its list.
    fn frames(&self, folder: &str) -> Vec<Frame> {
        let file = |line: &Value| self.path(folder).join(line["file"].as_str().expect("a name"));
        let decoded = |path: PathBuf| Frame::decode(&fs::read(path).expect("a picture"), &Decoding::default());
        let frames: Vec<Frame> = self.list(folder).iter().map(|line| decoded(file(line)).expect("decodes")).collect();
        let pictures = fs::read_dir(self.path(folder)).expect("a folder").count() - 1;
        assert_eq!(frames.len(), pictures, "the list names every picture");
        frames
    }
}

fn times(list: &[Value]) -> Vec<i64> {
    list.iter().map(|line| line["time_us"].as_i64().expect("a time")).collect()
}

const SIZE: (u32, u32) = (160, 96);

/// Where the red square of a frame is: its middle.
fn place(number: u32) -> (f64, f64) {
    (f64::from(12 + 5 * number) + 7.5, f64::from(20 + 2 * number) + 7.5)
}

/// Raw RGB frames of a red square of 16 px that moves over gray.
fn square_frames(count: u32) -> Vec<u8> {
    let pixel = |number: u32, x: u32, y: u32| {
        let (u, v) = place(number);
        let is_inside = (f64::from(x) - u).abs() < 8.0 && (f64::from(y) - v).abs() < 8.0;
        if is_inside { [220, 30, 30] } else { [120, 125, 130] }
    };
    let frame = |number| (0..SIZE.1).flat_map(move |y| (0..SIZE.0).flat_map(move |x| pixel(number, x, y)));
    (0..count).flat_map(frame).collect()
}

/// The middle of what is red, by moments.
fn red_middle(frame: &Frame) -> (f64, f64) {
    let (mut sum, mut u, mut v) = (0.0, 0.0, 0.0);
    for (at, pixel) in (0_u32..).zip(frame.rgb().chunks_exact(3)) {
        let weight = (f64::from(pixel[0]) - f64::from(pixel[1]) - 40.0).max(0.0);
        sum += weight;
        u += weight * f64::from(at % frame.width());
        v += weight * f64::from(at / frame.width());
    }
    assert!(sum > 0.0, "nothing is red");
    (u / sum, v / sum)
}

/// `count` frames at ten a second in this coding; whether ffmpeg can do that.
fn square_video(desk: &Desk, count: u32, coding: &str, name: &str) -> bool {
    let input = format!("-f rawvideo -pix_fmt rgb24 -s {}x{} -r 10 -i -", SIZE.0, SIZE.1);
    desk.ffmpeg(&format!("{input} {coding} {name}"), &square_frames(count))
}

/// Exact in the pixels, and known everywhere.
fn lossless(desk: &Desk, count: u32) {
    assert!(square_video(desk, count, "-c:v ffv1 -pix_fmt yuv444p", "square.mkv"));
}

// ---- grab ----

#[test]
fn every_frame_of_every_coding_is_there_with_its_content_and_its_time() {
    need_ffmpeg!();
    let desk = Desk::new();
    // Where shared colour lies is for each coding to say: on the left of two pixels, or between them as in JPEG.
    let left = "-vf format=yuv444p,scale=out_h_chr_pos=0:out_v_chr_pos=128,format=yuv420p";
    let between = "-vf format=yuv444p,scale=out_h_chr_pos=128:out_v_chr_pos=128,format=yuv420p";
    let mut tried = 0;
    for (siting, coding, name, tolerance_px) in [
        // MPEG-2 knows no ten frames a second.
        (left, "-r 25 -c:v mpeg2video -q:v 2", "mpeg2.mpg", 0.2),
        (left, "-c:v mpeg4 -q:v 2", "mpeg4.mp4", 0.2),
        (left, "-c:v libx264 -crf 10", "h264.mp4", 0.2),
        (between, "-c:v mjpeg -q:v 2 -pix_fmt yuvj420p", "mjpeg.avi", 0.2),
        (between, "-c:v ffv1", "ffv1.mkv", 0.05),
        ("-vf format=yuv444p,scale=out_h_chr_pos=0,format=yuv422p", "-c:v ffv1", "ffv1-422.mkv", 0.2),
        ("-vf null", "-c:v rawvideo -pix_fmt bgr24", "rgb.avi", 0.05),
    ] {
        let coding = &format!("{siting} {coding}");
        if !square_video(&desk, 12, coding, name) {
            eprintln!("left out: this ffmpeg does not write {coding}");
            continue;
        }
        tried += 1;
        let out = format!("of-{name}");
        let said = desk.run(&["grab", name, "--out", &out]);
        assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{name}: {said:?}");
        let (list, frames) = (desk.list(&out), desk.frames(&out));
        assert!(said.out.starts_with(&format!("{} frames of 160 x 96 px in {out}", frames.len())), "{said:?}");
        let rate = if name == "mpeg2.mpg" { 25.0 } else { 10.0 };
        assert!((f64::from(12_u8) * rate / 10.0 - frames.len() as f64).abs() <= 1.0, "{name}: {}", frames.len());
        for (index, (line, frame)) in list.iter().zip(&frames).enumerate() {
            assert_eq!((&line["source"], &line["frame_index"]), (&json!(name), &json!(index)), "{name}");
            let seconds = line["time_us"].as_f64().expect("a time") * 1e-6;
            // AVI and Matroska count whole milliseconds at worst.
            assert!((seconds - index as f64 / rate).abs() < 0.002, "{name}: {line}");
            if name == "mpeg2.mpg" {
                continue;
            }
            let (found, wanted) = (red_middle(frame), place(u32::try_from(index).expect("small")));
            let off = (found.0 - wanted.0).hypot(found.1 - wanted.1);
            assert!(off < tolerance_px, "{name}, frame {index}: {found:?}, not {wanted:?}");
        }
    }
    assert!(tried >= 5, "{tried}");
}

#[test]
fn colours_come_out_as_they_went_in() {
    need_ffmpeg!();
    let desk = Desk::new();
    // High definition has another matrix than the colour space in which frames are kept.
    for (name, coding) in [
        ("sd.mkv", "-vf scale=out_color_matrix=bt601,setparams=colorspace=smpte170m"),
        ("hd.mkv", "-vf scale=out_color_matrix=bt709,setparams=colorspace=bt709"),
        ("full.mkv", "-vf scale=out_color_matrix=bt601:out_range=full,setparams=range=pc:colorspace=smpte170m"),
    ] {
        assert!(square_video(&desk, 1, &format!("{coding} -c:v ffv1 -pix_fmt yuv444p"), name), "{name}");
        assert_eq!(desk.run(&["grab", name, "--out", &format!("of-{name}")]).code, Some(0));
        let frame = desk.frames(&format!("of-{name}")).remove(0);
        let worst = frame.rgb().iter().zip(square_frames(1)).map(|(a, b)| a.abs_diff(b)).max();
        // Rounding, twice in limited range.
        assert!(worst <= Some(4), "{name}: {worst:?}");
    }
}

#[test]
fn interlaced_video_has_no_combs_and_other_video_is_left_alone() {
    need_ffmpeg!();
    let desk = Desk::new();
    // Fifty moments a second, two to a frame; the picture moves sideways.
    let source = "-f lavfi -i testsrc2=s=352x288:r=50:d=1 -vf scroll=h=0.02,tinterlace=interleave_top,fieldorder=tff";
    assert!(desk.ffmpeg(&format!("{source} -flags +ilme+ildct -c:v mpeg2video -q:v 2 interlaced.mpg"), b""));
    let combs = |folder: &str, options: &[&str]| {
        let said = desk.run(&[&["grab", "interlaced.mpg", "--out", folder], options].concat());
        assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
        let frames = desk.frames(folder);
        assert_eq!(frames.len(), 25, "a frame for each frame");
        let comb = |frame: &Frame| {
            let (rgb, width) = (frame.rgb().into_owned(), frame.width() as usize * 3);
            let at = |y: usize, x: usize| f64::from(rgb[y * width + x]);
            let rows = 2..frame.height() as usize - 2;
            rows.flat_map(|y| (0..width).map(move |x| (y, x)))
                .map(|(y, x)| (2.0 * at(y, x) - at(y - 1, x) - at(y + 1, x)).abs())
                .sum::<f64>()
        };
        frames[5..15].iter().map(comb).sum::<f64>()
    };
    let (without, with) = (combs("auto", &[]), combs("never", &["--deinterlace", "never"]));
    assert!(without * 2.0 < with, "{without} against {with}");
    lossless(&desk, 3);
    desk.run(&["grab", "square.mkv", "--out", "a"]);
    desk.run(&["grab", "square.mkv", "--out", "b", "--deinterlace", "never"]);
    assert_eq!(desk.frames("a"), desk.frames("b"));
}

#[test]
fn a_rate_and_a_region_leave_what_was_asked_for() {
    need_ffmpeg!();
    let desk = Desk::new();
    lossless(&desk, 10);
    let said = desk.run(&["grab", "square.mkv", "--out", "few", "--fps", "2"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(times(&desk.list("few")), [0, 500_000]);
    // And each is the frame of that time.
    for (few, index) in desk.frames("few").iter().zip([0, 5]) {
        let (u, v) = red_middle(few);
        assert!((u - place(index).0).hypot(v - place(index).1) < 0.3, "{index}: {u}, {v}");
    }
    let said = desk.run(&["grab", "square.mkv", "--out", "most", "--fps", "60"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(times(&desk.list("most")).len(), 10, "no frame is repeated");
    assert_eq!(desk.run(&["grab", "square.mkv", "--out", "all"]).code, Some(0));
    let said = desk.run(&["grab", "square.mkv", "--out", "part", "--region", "3,5,101,77", "--frames", "4"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let (all, part) = (desk.frames("all"), desk.frames("part"));
    assert_eq!((all.len(), part.len()), (10, 4));
    let region = skypose::frame::Region { x: 3, y: 5, width: 101, height: 77 };
    for (whole, part) in all.iter().zip(&part) {
        assert_eq!(whole.cropped(region).expect("inside"), *part);
    }
    for region in ["100,0,61,10", "0,0,0,10", "0,90,10,7"] {
        desk.run(&["grab", "square.mkv", "--out", "none", "--region", region])
            .assert_complains(2, &["square.mkv", "region"]);
        assert!(!desk.path("none").exists(), "what gives no frame leaves nothing behind");
    }
    let said = desk.run(&["grab", "square.mkv", "--out", "small", "--format", "jpg", "--quality", "90"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    assert_eq!(desk.list("small")[9]["file"], "frame-000009-0000900000us.jpg");
    let (u, v) = red_middle(&desk.frames("small")[9]);
    assert!((u - place(9).0).hypot(v - place(9).1) < 0.3, "{u}, {v}");
}

#[test]
fn frames_that_come_unevenly_keep_their_times() {
    need_ffmpeg!();
    let desk = Desk::new();
    let filter = "-vf setpts=N*N/(10*TB) -fps_mode vfr -c:v ffv1";
    if !square_video(&desk, 6, filter, "uneven.mkv") {
        assert!(square_video(&desk, 6, &filter.replace("-fps_mode", "-vsync"), "uneven.mkv"));
    }
    assert_eq!(desk.run(&["grab", "uneven.mkv", "--out", "frames"]).code, Some(0));
    assert_eq!(times(&desk.list("frames")), [0, 100_000, 400_000, 900_000, 1_600_000, 2_500_000]);
}

#[test]
fn the_date_of_a_recording_and_its_turn_are_read() {
    need_ffmpeg!();
    let desk = Desk::new();
    let coding = "-c:v mpeg4 -metadata creation_time=2020-03-30T20:01:38Z -metadata:s:v rotate=90";
    assert!(square_video(&desk, 3, coding, "dated.mov"));
    let said = desk.run(&["grab", "dated.mov", "--out", "frames"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let stamps: Vec<_> = desk.list("frames").iter().filter_map(|line| line["timestamp_us"].as_i64()).collect();
    assert_eq!(stamps, [0, 100_000, 200_000].map(|us| 1_585_598_498_000_000 + us));
    let said_of_turn = said.err.contains("turned");
    let said = desk.run(&["grab", "dated.mov", "--out", "turned", "--orientation", "apply", "--start", "5000000"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert_eq!(desk.list("turned")[1]["timestamp_us"], 5_100_000);
    if said_of_turn {
        assert_eq!(desk.frames("turned")[0].width(), SIZE.1);
        let replies = desk.run(&["detect", "dated.mov"]).lines();
        assert_ne!(replies[0]["frame"]["orientation"], Value::Null);
        assert_eq!(replies[0]["frame"]["width"], SIZE.0);
    } else {
        eprintln!("left out: this ffmpeg writes no rotation");
    }
}

#[test]
fn without_ffmpeg_there_is_the_line_that_installs_it() {
    let desk = Desk::new();
    fs::write(desk.path("video.mp4"), b"whatever").expect("writes");
    for arguments in [&["grab", "video.mp4", "--out", "frames"][..], &["grab", "rtsp://127.0.0.1/x", "--out", "frames"]]
    {
        let said = Said::of(desk.command(arguments).env("PATH", desk.path("none")).output().expect("starts"));
        said.assert_complains(1, &["ffmpeg", "not installed", "apt-get install ffmpeg"]);
    }
    let said =
        Said::of(desk.command(&["detect", "video.mp4"]).env("PATH", desk.path("none")).output().expect("starts"));
    assert_eq!((said.code, said.lines()[0]["error"]["status"].as_i64()), (Some(1), Some(500)), "{said:?}");
    assert!(said.err.contains("apt-get install ffmpeg"), "{said:?}");
}

#[test]
fn what_cannot_be_read_is_named_with_the_reason() {
    need_ffmpeg!();
    let desk = Desk::new();
    fs::write(desk.path("text.mp4"), b"This is no video.").expect("writes");
    fs::write(desk.path("empty.mp4"), b"").expect("writes");
    fs::create_dir(desk.path("folder")).expect("makes a folder");
    let grab = |source: &str| desk.run(&["grab", source, "--out", "frames"]);
    grab("missing.mp4").assert_complains(2, &["missing.mp4", "No such file"]);
    grab("folder").assert_complains(2, &["folder", "is a folder"]);
    grab("text.mp4").assert_complains(2, &["text.mp4: not a video", "Invalid data"]);
    grab("empty.mp4").assert_complains(2, &["empty.mp4: not a video"]);
    grab("/dev/video99").assert_complains(2, &["/dev/video99", "No such file"]);
    let unreachable = grab("rtsp://me:secret@127.0.0.1:1/x");
    unreachable.assert_complains(2, &["rtsp://me:***@127.0.0.1:1/x", "refused"]);
    assert!(!unreachable.err.contains("secret"), "{unreachable:?}");
    assert!(desk.ffmpeg("-f lavfi -i sine=d=0.2 sound.wav", b""));
    fs::rename(desk.path("sound.wav"), desk.path("sound.avi")).expect("renames");
    grab("sound.avi").assert_complains(2, &["sound.avi"]);
    assert!(!desk.path("frames").exists());
}

#[test]
fn a_video_that_is_cut_off_gives_the_frames_that_it_has() {
    need_ffmpeg!();
    let desk = Desk::new();
    assert!(square_video(&desk, 30, "-c:v mjpeg -q:v 2", "whole.mkv"));
    let bytes = fs::read(desk.path("whole.mkv")).expect("a video");
    fs::write(desk.path("cut.mkv"), &bytes[..bytes.len() / 2]).expect("writes");
    let said = desk.run(&["grab", "cut.mkv", "--out", "frames"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let frames = desk.frames("frames");
    assert!((8..22).contains(&frames.len()), "{}", frames.len());
    assert!(said.err.contains(&format!("cut.mkv: broken after {} frames", frames.len())), "{said:?}");
    for (number, frame) in (0..).zip(&frames[..frames.len() - 1]) {
        let ((u, v), wanted) = (red_middle(frame), place(number));
        assert!((u - wanted.0).hypot(v - wanted.1) < 0.5, "{u}, {v}: {wanted:?}");
    }
    let said = desk.run(&["detect", "cut.mkv", "whole.mkv"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let replies = said.lines();
    assert_eq!(replies.len(), frames.len() + 1 + 30, "a line for each frame, one for the fault");
    assert_eq!(replies[frames.len()]["error"]["status"], 415);
}

#[test]
fn whatever_the_container_a_video_that_is_cut_off_is_told_from_a_whole_one() {
    need_ffmpeg!();
    let desk = Desk::new();
    let mut tried = 0;
    let even = "-pix_fmt yuv420p -c:v";
    for (coding, name) in [
        (format!("{even} libx264"), "a.ts"),
        (format!("{even} mpeg2video"), "b.ts"),
        ("-pix_fmt yuvj420p -c:v mjpeg".into(), "c.avi"),
        (format!("{even} mpeg4"), "d.avi"),
        (format!("{even} mpeg2video"), "e.mpg"),
        (format!("{even} libtheora"), "f.ogv"),
        ("-pix_fmt yuv420p".into(), "g.y4m"),
        (format!("{even} mpeg4 -movflags +faststart"), "h.mp4"),
        (format!("{even} mpeg2video"), "i.m2v"),
        ("-pix_fmt yuvj420p -c:v mjpeg".into(), "j.mjpeg"),
        (format!("{even} flv1"), "k.flv"),
    ] {
        if !desk.ffmpeg(&format!("-f lavfi -i testsrc=s=320x240:r=25:d=2 {coding} {name}"), b"") {
            eprintln!("left out: this ffmpeg does not write {coding}");
            continue;
        }
        tried += 1;
        let whole = desk.run(&["grab", name, "--out", &format!("whole-{name}")]);
        assert_eq!((whole.code, whole.err.as_str()), (Some(0), ""), "{name}: {whole:?}");
        let bytes = fs::read(desk.path(name)).expect("a video");
        // Behind the header, before the index, and not where a packet ends.
        let cut = format!("cut-{name}");
        fs::write(desk.path(&cut), &bytes[..bytes.len() * 7 / 10 / 188 * 188 + 101]).expect("writes");
        let said = desk.run(&["grab", &cut, "--out", &format!("of-{name}")]);
        assert_eq!((said.code, said.err.lines().count()), (Some(2), 1), "{name}: {said:?}");
        assert!(said.err.contains(&cut), "{name}: {said:?}");
        let frames = (desk.list(&format!("of-{name}")).len(), desk.list(&format!("whole-{name}")).len());
        assert!((1..frames.1).contains(&frames.0), "{name}: {frames:?}");
    }
    assert!(tried >= 8, "{tried}");
}

#[test]
fn frames_of_two_sizes_are_not_taken_for_those_of_one_camera() {
    need_ffmpeg!();
    let desk = Desk::new();
    let part = |size: &str, name: &str| {
        assert!(
            desk.ffmpeg(&format!("-f lavfi -i testsrc=s={size}:r=10:d=1 -c:v mpeg2video -r 25 -q:v 2 {name}"), b"")
        );
        fs::read(desk.path(name)).expect("a video")
    };
    let both = [part("320x240", "a.m2v"), part("640x480", "b.m2v")].concat();
    fs::write(desk.path("both.m2v"), both).expect("writes");
    let said = desk.run(&["grab", "both.m2v", "--out", "frames"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    let count = desk.frames("frames").len();
    assert!((20..=26).contains(&count), "{count}");
    assert!(said.err.contains(&format!("the size of its frames changes after {count} frames")), "{said:?}");
}

#[test]
fn what_is_in_a_folder_is_not_overwritten_unasked() {
    need_ffmpeg!();
    let desk = Desk::new();
    lossless(&desk, 3);
    fs::create_dir(desk.path("full")).expect("makes a folder");
    fs::write(desk.path("full/frames.jsonl"), b"mine").expect("writes");
    desk.run(&["grab", "square.mkv", "--out", "full"]).assert_complains(2, &["full", "--overwrite"]);
    assert_eq!(fs::read(desk.path("full/frames.jsonl")).expect("is there"), b"mine");
    assert_eq!(desk.run(&["grab", "square.mkv", "--out", "full", "--overwrite"]).code, Some(0));
    assert_eq!(desk.frames("full").len(), 3);
    // A file where a folder is wanted.
    desk.run(&["grab", "square.mkv", "--out", "square.mkv"]).assert_complains(2, &["square.mkv"]);
    desk.run(&["grab", "square.mkv", "--out", "square.mkv/frames"]).assert_complains(2, &["square.mkv/frames"]);
    if Path::new("/dev/full").exists() {
        // A disk without room: the list is the first that is written whole, so it stands in for all.
        fs::remove_file(desk.path("full/frames.jsonl")).expect("is there");
        std::os::unix::fs::symlink("/dev/full", desk.path("full/frames.jsonl")).expect("links");
        desk.run(&["grab", "square.mkv", "--out", "full", "--overwrite"])
            .assert_complains(1, &["full/frames.jsonl", "No space left"]);
    }
}

// ---- detect, estimate ----

/// A flight of the demo, without loss, eight frames at ten a second.
fn flight_video(desk: &Desk) -> Vec<CameraFromTarget> {
    let camera = demo_camera();
    let poses: Vec<CameraFromTarget> =
        (0..8).map(|step| Flight::Crossing.pose(Flight::Crossing.len() / 2 + step)).collect();
    let mut raw = Vec::new();
    for (case, pose) in (0..).zip(&poses) {
        let sky = Sky::fair(3, [0.0; 2]);
        let frame = render(&camera, pose, &wing(), &sky, &Optics::default(), &mut random::case("video", case));
        raw.extend_from_slice(&frame.rgb());
    }
    let size = format!("{}x{}", camera.width(), camera.height());
    let input = format!("-f rawvideo -pix_fmt rgb24 -s {size} -r 10 -i -");
    assert!(desk.ffmpeg(&format!("{input} -c:v ffv1 -pix_fmt yuv420p flight.mkv"), &raw));
    fs::write(desk.path("camera.json"), json!(CameraWire::from(&camera)).to_string()).expect("writes");
    fs::write(desk.path("target.json"), json!(TargetWire::from(&wing().target)).to_string()).expect("writes");
    poses
}

fn assert_poses(replies: &[Value], truth: &[CameraFromTarget]) {
    assert_eq!(replies.len(), truth.len());
    for (index, (reply, truth)) in replies.iter().zip(truth).enumerate() {
        assert_eq!((&reply["source"], &reply["frame_index"]), (&json!("flight.mkv"), &json!(index)), "{reply}");
        assert_eq!(reply["frame"]["timestamp_us"], json!(index * 100_000), "{reply}");
        let target = &reply["targets"][0];
        assert_eq!(target["detected"], true, "{reply}");
        let found = target["pose"]["translation_m"].as_array().expect("a pose");
        for (found, truth) in found.iter().zip(truth.translation.iter()) {
            // A hundredth of the range: ten standard deviations of these frames.
            let off = (found.as_f64().expect("a number") - truth).abs();
            assert!(off < 0.01 * reply["targets"][0]["pose"]["range_m"].as_f64().expect("a range"), "{index}: {off}");
        }
    }
}

#[test]
fn the_frames_of_a_video_are_answered_one_a_line() {
    need_ffmpeg!();
    let desk = Desk::new();
    let truth = flight_video(&desk);
    let said = desk.run(&[
        "estimate",
        "--camera",
        "camera.json",
        "--target",
        "target.json",
        "flight.mkv",
        "--annotate",
        "drawn",
    ]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert_poses(&said.lines(), &truth);
    assert!(desk.path("drawn/flight-000007.png").exists());
    // A folder's videos are videos, and each is counted anew.
    fs::create_dir(desk.path("folder")).expect("makes a folder");
    for name in ["one.mkv", "two"] {
        fs::copy(desk.path("flight.mkv"), desk.path("folder").join(name)).expect("copies");
    }
    let said = desk.run(&["detect", "folder", "--fps", "5", "--persistent", "2"]);
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    let replies = said.lines();
    let places: Vec<_> =
        replies.iter().map(|reply| (reply["frame_index"].as_u64(), reply["time_us"].as_u64())).collect();
    let four = [0, 1, 2, 3].map(|n| (Some(n), Some(200_000 * n)));
    assert_eq!(places, [four, four].concat(), "{said:?}");
    for first in [0, 4] {
        assert_eq!(replies[first]["centroids"], json!([]), "nothing lasts in the first frame");
    }
    // What is wrong with one frame of a video is told once.
    let said = desk.run(&["detect", "flight.mkv", "--region", "0,0,5000,5"]);
    assert_eq!((said.code, said.lines().len(), said.err.lines().count()), (Some(2), 1, 1), "{said:?}");
}

// ---- processes ----

/// Processes that have `mark` in their command line, this test's aside.
fn processes_with(mark: &str) -> Vec<String> {
    let entries = fs::read_dir("/proc").into_iter().flatten().filter_map(Result::ok);
    let lines = entries.filter_map(|entry| fs::read_to_string(entry.path().join("cmdline")).ok());
    lines.filter(|line| line.starts_with("ffmpeg") && line.contains(mark)).collect()
}

/// Waits until nothing has the mark, for as long as a slow machine needs.
fn assert_gone(mark: &str) {
    let deadline = Instant::now() + Duration::from_secs(10);
    while !processes_with(mark).is_empty() {
        assert!(Instant::now() < deadline, "{:?} still runs", processes_with(mark));
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// A program of ours at work on a long video whose name nobody else uses.
fn at_work(desk: &Desk, arguments: &[&str]) -> Child {
    let mut command = desk.command(arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("starts")
}

fn long_video(desk: &Desk, name: &str) {
    assert!(desk.ffmpeg(&format!("-f lavfi -i testsrc2=s=640x480:r=25:d=60 -c:v mpeg4 -q:v 10 {name}"), b""));
}

#[test]
fn a_reader_that_leaves_ends_ffmpeg_too() {
    need_ffmpeg!();
    let desk = Desk::new();
    let name = format!("leaving-{}.mp4", std::process::id());
    long_video(&desk, &name);
    let mut child = at_work(&desk, &["detect", &name]);
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("piped")).read_line(&mut line).expect("a line");
    let said = Said::of(child.wait_with_output().expect("ends"));
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{said:?}");
    assert_gone(&name);
}

#[test]
fn an_interrupt_ends_ffmpeg_and_leaves_whole_pictures() {
    need_ffmpeg!();
    for signal in ["-INT", "-TERM"] {
        let desk = Desk::new();
        let name = format!("interrupted{signal}-{}.mp4", std::process::id());
        long_video(&desk, &name);
        let mut child = at_work(&desk, &["grab", &name, "--out", "frames"]);
        while !desk.path("frames/frames.jsonl").exists() {
            std::thread::sleep(Duration::from_millis(10));
        }
        assert!(!processes_with(&name).is_empty() || !Path::new("/proc/self").exists());
        let sent = Command::new("kill").args([signal, &child.id().to_string()]).status();
        assert!(sent.expect("kill is there").success());
        let mut out = String::new();
        child.stdout.take().expect("piped").read_to_string(&mut out).expect("UTF-8");
        let said = Said::of(child.wait_with_output().expect("ends"));
        assert_eq!((said.code, said.err.as_str()), (Some(130), ""), "{said:?}");
        let frames = desk.frames("frames").len();
        assert!(frames < 1500 && out.starts_with(&format!("{frames} frame")), "{out}");
        assert_gone(&name);
    }
}

#[test]
fn a_flood_of_complaints_stops_nothing() {
    need_ffmpeg!();
    let desk = Desk::new();
    assert!(desk.ffmpeg("-f lavfi -i testsrc2=s=320x240:r=25:d=20 -c:v mpeg4 -q:v 3 -g 5 noisy.mp4", b""));
    let mut bytes = fs::read(desk.path("noisy.mp4")).expect("a video");
    let (start, end) = (bytes.len() / 20, bytes.len() * 17 / 20);
    bytes[start..end].iter_mut().step_by(211).for_each(|byte| *byte ^= 0x5a);
    fs::write(desk.path("noisy.mp4"), bytes).expect("writes");
    let said = desk.run(&["detect", "noisy.mp4"]);
    assert!(said.out.lines().count() > 100, "{} lines, {}", said.out.lines().count(), said.err);
    assert!(said.err.lines().count() <= 2 && said.err.contains("more)"), "{}", said.err);
}

// ---- replay ----

/// A server of its own, ended with the test.
struct Server {
    child: Child,
    address: String,
}

impl Server {
    fn start(desk: &Desk) -> Self {
        let mut command = desk.command(&["serve", "--listen", "127.0.0.1:0", "--data", "data"]);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("a line");
        let address = line.trim().strip_prefix("listening on ").expect("the contract's words").to_owned();
        Self { child, address }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_video_is_played_against_a_server() {
    need_ffmpeg!();
    let desk = Desk::new();
    let truth = flight_video(&desk);
    let server = Server::start(&desk);
    let replay = |arguments: &[&str]| desk.run(&[&["replay", "--server", &server.address][..], arguments].concat());
    let known = ["--camera", "camera.json", "--target", "target.json"];
    for post in ["jpeg", "png", "raw"] {
        let said = replay(&[&["flight.mkv", "--speed", "max", "--post", post], &known[..]].concat());
        assert_eq!(said.code, Some(0), "{said:?}");
        assert_poses(&said.lines(), &truth);
        assert!(said.err.starts_with("8 frames in ") && said.err.contains("8 answered"), "{said:?}");
        assert!(said.err.contains("0 dropped, 0 refused, 0 failed"), "{said:?}");
    }
    // At its own pace: the last of eight frames at ten a second is due after 0.7 s.
    let start = Instant::now();
    let said = replay(&["flight.mkv", "--in-flight", "8"]);
    assert_eq!((said.code, said.lines().len()), (Some(0), 8), "{said:?}");
    assert!(start.elapsed() > Duration::from_millis(700), "{:?}", start.elapsed());
    assert!(said.lines()[0]["targets"].is_null() && said.lines()[0]["centroids"].is_array());
    // What grab has written is played with its times, and a rate goes over them.
    assert_eq!(desk.run(&["grab", "flight.mkv", "--out", "frames", "--fps", "5"]).code, Some(0));
    let said = replay(&["frames", "--speed", "max"]);
    assert_eq!(times(&said.lines()), [0, 200_000, 400_000, 600_000], "{said:?}");
    let said = replay(&["frames", "--speed", "max", "--fps", "20"]);
    assert_eq!(times(&said.lines()), [0, 50_000, 100_000, 150_000], "{said:?}");
    // A camera that the server does not know is told of once, not with each frame.
    let said = replay(&["flight.mkv", "--camera", "nobody", "--target", "target.json"]);
    assert_eq!((said.code, said.err.lines().count()), (Some(2), 2), "{said:?}");
    assert!(said.lines().len() < 8 && said.lines()[0]["error"]["status"] == 404, "{said:?}");
}

#[test]
fn pictures_are_played_without_ffmpeg_and_a_server_that_is_not_there_is_named() {
    let desk = Desk::new();
    let frame = skypose::frame::Pixels::Luma(vec![90; 64 * 48]);
    let frame = Frame::checked(64, 48, frame, skypose::frame::Coding::LOSSLESS).expect("a frame");
    for number in 0..30 {
        let png = skypose::scene::encode::png(&frame).expect("encodes");
        fs::write(desk.path(&format!("{number}.png")), png).expect("writes");
    }
    let mut server = Server::start(&desk);
    let said = desk.run(&["replay", "--server", &server.address, "--speed", "100", "--in-flight", "1", "."]);
    assert_eq!(said.code, Some(0), "{said:?}");
    // A thousand frames a second are more than one request at a time can carry.
    let dropped = 30 - said.lines().len();
    assert!(said.err.contains("30 frames in ") && said.err.contains(&format!(" {dropped} dropped")), "{said:?}");
    server.child.kill().expect("ends");
    server.child.wait().expect("ends");
    desk.run(&["replay", "--server", &server.address, "."])
        .assert_complains(1, &[&server.address, "cannot be reached"]);
    desk.run(&["replay", "--server", "nowhere", "."]).assert_complains(2, &["nowhere"]);
}
