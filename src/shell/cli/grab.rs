//! `skypose grab`: the frames of a video as pictures.

mod folder;

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Stop;
use super::frames::{named, region};
use super::moving::{MovingArgs, tell_oddities, tell_orientation};
use crate::frame::{Limits, Region};
use crate::shell::console::{Timeline, print_line};
use crate::shell::fault::Fault;
use crate::shell::grab::{Grabbed, Grabber, Options, Source, is_interrupted};
use crate::shell::wire::frame::OrientationHandling;
use folder::Folder;

pub(super) const EXAMPLES: &str = "Examples:
  skypose grab flight.mp4 --out frames
  skypose grab flight.mp4 --out frames --fps 2 --region 320,180,640,360
  skypose grab rtsp://192.168.1.20/live --out frames --frames 500
  skypose grab /dev/video0 --out frames --input-option video_size=1280x720

Pictures are named by number and time. frames.jsonl has a line for each: source, frame_index, time_us since the source's \
start, timestamp_us since 1970 where that is known (else as time_us), file. Ctrl-C ends a stream or a webcam.";

/// Frames of a live source that may wait to be written: a disk hesitates now and then.
const AHEAD: usize = 8;

#[derive(Args, Debug)]
pub(super) struct Grab {
    /// A video, a stream (rtsp://...) or a webcam (/dev/video0).
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// Folder for the pictures; it is made, or must be empty.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Write into a folder that is not empty; pictures of the same name and frames.jsonl are replaced.
    #[arg(long)]
    overwrite: bool,
    /// Only this part of each frame: x,y,width,height in pixels.
    #[arg(long, value_name = "X,Y,W,H", value_parser = region)]
    region: Option<[u32; 4]>,
    /// End after so many frames.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    frames: Option<u64>,
    /// png keeps the pixels as they are decoded; jpg is smaller.
    #[arg(long, value_enum, default_value_t)]
    format: Format,
    /// Quality of jpg.
    #[arg(long, value_name = "1-100", default_value_t = 95, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: u8,
    /// What to do with an orientation that a video states, as of phones: ignore or apply.
    #[arg(long, default_value = "ignore", value_parser = named::<OrientationHandling>)]
    orientation: OrientationHandling,
    #[command(flatten)]
    moving: MovingArgs,
}

/// Formats of pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Format {
    #[default]
    Png,
    Jpg,
}

impl Grab {
    pub(super) fn run(self) -> Result<(), Stop> {
        let source = Source::of(&self.source);
        let mut folder = Folder::at(&self.out, self.overwrite)?;
        let apply = self.orientation == OrientationHandling::Apply;
        let options = Options { ahead: AHEAD, ..self.moving.options(apply, Limits::default()) };
        let of_source = |fault: Fault| Fault { detail: format!("{source}: {fault}"), pointer: None, ..fault };
        let mut grabber = Grabber::open(&source, &options).map_err(|error| of_source(error.into()))?;
        if !apply {
            tell_orientation(&source, &grabber);
        }
        let mut timeline = Timeline::new(grabber.duration_us());
        let mut ended = Ok(());
        for grabbed in
            grabber.by_ref().take(self.frames.map_or(usize::MAX, |n| usize::try_from(n).unwrap_or(usize::MAX)))
        {
            let written = grabbed.map_err(Fault::from).and_then(|grabbed| {
                timeline.step(grabbed.time_us);
                self.write(&mut folder, &source, grabbed)
            });
            if let Err(fault) = written {
                ended = Err(of_source(fault));
                break;
            }
        }
        drop(timeline);
        tell_oddities(&source, &grabber);
        if let Some(summary) = folder.summary() {
            print_line(&summary)?;
        }
        ended?;
        // A file was not at its end; of a live source it is the only end there is.
        if is_interrupted() && !source.is_live() { Err(Stop::Interrupted) } else { Ok(()) }
    }

    fn write(&self, folder: &mut Folder, source: &Source, mut grabbed: Grabbed) -> Result<(), Fault> {
        if let Some([x, y, width, height]) = self.region {
            let region = Region { x, y, width, height };
            grabbed.frame =
                grabbed.frame.cropped(region).map_err(|error| Fault { pointer: None, ..Fault::of_frame(&error) })?;
        }
        folder.write(source, &grabbed, self.format, self.quality)
    }
}
