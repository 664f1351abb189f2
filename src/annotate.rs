//! What was found, drawn on a copy of the frame, for people.
//!
//! A ring about each centroid, in the colour of the target it belongs to or yellow; the markers' names; the axes of each
//! pose, x red, y green, z blue, dashed for an alternative; a cross where the pose puts each marker; a gray mark with the
//! reason on what was refused; a line for each target at the top.

mod axes;
mod canvas;
mod caption;
mod clip;
mod headline;
mod label;
mod marks;
mod palette;
mod scale;
mod text;

use image::RgbImage;

use crate::camera::Camera;
use crate::detect::Detection;
use crate::frame::Frame;
use crate::pipeline::TargetEstimate;
use crate::target::Target;

pub use caption::caption;

use canvas::Canvas;
use label::Labels;
use scale::Scale;

/// What is to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlay<'a> {
    /// The blobs.
    pub detection: &'a Detection,
    /// The targets that were looked for.
    pub targets: Vec<Sought<'a>>,
}

/// A target and what the frame tells of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sought<'a> {
    /// The target.
    pub target: &'a Target,
    /// Its markers among the centroids of the detection, and its poses.
    pub estimate: &'a TargetEstimate,
}

impl<'a> Overlay<'a> {
    /// A detection with what it tells of `targets`; both empty for a detection alone.
    #[must_use]
    pub fn of(detection: &'a Detection, targets: &'a [Target], estimates: &'a [TargetEstimate]) -> Self {
        let sought = |estimate: &'a TargetEstimate| Some(Sought { target: targets.get(estimate.target)?, estimate });
        Self { detection, targets: estimates.iter().filter_map(sought).collect() }
    }
}

/// The frame with the overlay on it, of the same size. Without a camera no pose is drawn.
#[must_use]
pub fn annotate(frame: &Frame, camera: Option<&Camera>, overlay: &Overlay<'_>) -> RgbImage {
    let scale = Scale::of(frame.height());
    let mut canvas = Canvas::of(frame);
    let mut labels = Labels::new(&canvas, scale);
    headline::reserve(&mut labels, scale, overlay);
    marks::refused(&mut canvas, &mut labels, scale, &overlay.detection.refused);
    marks::rings(&mut canvas, &mut labels, scale, overlay);
    marks::names(&mut labels, scale, overlay);
    if let Some(camera) = camera {
        for sought in &overlay.targets {
            if let Ok(answer) = &sought.estimate.answer {
                axes::draw(&mut canvas, &mut labels, scale, camera, sought.target, answer);
                marks::predictions(&mut canvas, &mut labels, scale, camera, sought, answer);
            }
        }
    }
    marks::reasons(&mut labels, scale, &overlay.detection.refused);
    labels.draw(&mut canvas);
    headline::draw(&mut canvas, scale, overlay);
    canvas.into_image()
}

#[cfg(test)]
mod tests;
