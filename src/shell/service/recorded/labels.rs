//! Clips of the sky as `labels.json` has them (made of the Drone-detection-dataset, F. Svanström 2020): by clip and frame boxes of class,
//! x, y, width, height.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::shell::fault::Fault;
use crate::shell::wire::detector::Method;
use crate::shell::wire::recorded::{BoxWire, SidecarWire, VideoFrameWire, VideoTruthWire};
use crate::shell::wire::{DetectorWire, from_json};

#[derive(Debug, Deserialize)]
struct Labels {
    classes: Vec<String>,
    clips: BTreeMap<String, Clip>,
}

#[derive(Debug, Deserialize)]
struct Clip {
    /// The suite.
    class: String,
    frames: Vec<Vec<Label>>,
}

/// Class, x, y, width, height.
type Label = (usize, f64, f64, f64, f64);

/// The truth of the clips.
///
/// # Errors
/// What is not such a file, with the place.
pub(super) fn read(bytes: &[u8]) -> Result<SidecarWire, Fault> {
    let labels: Labels = from_json(bytes)?;
    let detector = DetectorWire { method: Method::Edge, ..DetectorWire::default() };
    let video = |(name, clip): (&String, &Clip)| {
        let frames = clip.frames.iter().zip(0..).map(|(boxes, frame_index)| {
            let one = |&(class, x, y, width, height): &Label| {
                let known = labels.classes.get(class).ok_or_else(|| {
                    Fault::senseless(
                        format!("/clips/{name}/frames/{frame_index}"),
                        format!("there is no class {class}"),
                    )
                })?;
                Ok(BoxWire { box_px: [x, y, width, height], class: Some(word(known)) })
            };
            let boxes: Result<Vec<BoxWire>, Fault> = boxes.iter().map(one).collect();
            Ok(VideoFrameWire { frame_index, boxes: Some(boxes?), ..VideoFrameWire::default() })
        });
        Ok(VideoTruthWire {
            video: format!("{name}.mp4"),
            suite: Some(clip.class.to_lowercase()),
            detector: Some(detector.clone()),
            frames: frames.collect::<Result<_, Fault>>()?,
            ..VideoTruthWire::default()
        })
    };
    let videos = labels.clips.iter().map(video).collect::<Result<_, Fault>>()?;
    Ok(SidecarWire { videos, ..SidecarWire::default() })
}

/// The detector's word for what it has one for.
fn word(class: &str) -> String {
    match class {
        "AIRPLANE" | "HELICOPTER" | "DRONE" => "aircraft".into(),
        other => other.to_lowercase(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_become_boxes() {
        let text = br#"{"classes": ["AIRPLANE", "BIRD"], "box": "class,x,y,w,h",
            "clips": {"V_BIRD_1": {"class": "BIRD", "fps": 30.0, "frames": [[], [[1, 2.5, 3, 4, 5], [0, 6, 7, 8, 9]]]}}}"#;
        let truth = read(text).expect("labels");
        let [video] = truth.videos.as_slice() else { panic!("{truth:?}") };
        assert_eq!((video.video.as_str(), video.suite.as_deref()), ("V_BIRD_1.mp4", Some("bird")));
        assert_eq!(video.frames[0].boxes, Some(Vec::new()), "nothing is there, and that is known");
        let boxes = video.frames[1].boxes.as_ref().expect("boxes");
        assert_eq!((boxes[0].box_px, boxes[0].class.as_deref()), ([2.5, 3.0, 4.0, 5.0], Some("bird")));
        assert_eq!(boxes[1].class.as_deref(), Some("aircraft"));
    }
}
