//! What one picture shows of the board.

use std::collections::HashMap;
use std::fmt;

use super::thumbnail;
use serde::{Deserialize, Serialize};

use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::calibrate::find::find;
use crate::camera::Pixel;
use crate::frame::{Decoding, Frame, Limits, Wanted};
use crate::shell::fault::{Fault, FaultKind};

/// One picture, as it is stored.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Sighting {
    /// Name of its file.
    pub name: String,
    /// Its size, if it could be read.
    pub size: Option<[u32; 2]>,
    /// What is seen of the board: position in the board's points, u, v, standard deviation, px.
    pub points: Vec<(usize, f64, f64, f64)>,
    /// The picture made small, as JPEG in base 64, for the page.
    pub thumbnail: Option<String>,
    /// Why nothing is seen, or why what is seen does not count.
    pub reason: Option<String>,
}

impl Sighting {
    /// Of a picture that cannot be read.
    #[must_use]
    pub const fn unreadable(name: String, reason: String) -> Self {
        Self { name, size: None, points: Vec::new(), thumbnail: None, reason: Some(reason) }
    }

    /// What is seen, for the estimate.
    #[must_use]
    pub fn seen(&self) -> Vec<SeenPoint> {
        let seen = |&(point, u, v, sigma_px)| SeenPoint { point, pixel: Pixel::new(u, v), sigma_px };
        self.points.iter().map(seen).collect()
    }
}

impl fmt::Display for Sighting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.reason {
            Some(reason) => write!(f, "{}: {reason}", self.name),
            None => write!(f, "{}: {} points", self.name, self.points.len()),
        }
    }
}

/// The board in one picture.
#[must_use]
pub fn look(name: String, bytes: &[u8], board: &Board, limits: Limits) -> Sighting {
    let none = |size, thumbnail, reason: String| Sighting {
        name: name.clone(),
        size,
        points: Vec::new(),
        thumbnail,
        reason: Some(reason),
    };
    let frame = match Frame::decode(bytes, &Decoding { wanted: Wanted::Luma, limits, ..Decoding::default() }) {
        Ok(frame) => frame,
        Err(error) => return none(None, None, error.to_string()),
    };
    let size = Some([frame.width(), frame.height()]);
    let thumbnail = thumbnail::of(&frame);
    match find(&frame, board) {
        Ok(seen) => {
            let points = seen.iter().map(|seen| (seen.point, seen.pixel.x, seen.pixel.y, seen.sigma_px)).collect();
            Sighting { name, size, points, thumbnail, reason: None }
        }
        Err(error) => none(size, thumbnail, error.to_string()),
    }
}

/// The size that most pictures have; of two that are as frequent the one that comes first.
#[must_use]
pub fn usual_size(sightings: &[Sighting]) -> Option<[u32; 2]> {
    let mut counts: HashMap<[u32; 2], usize> = HashMap::new();
    for size in sightings.iter().filter_map(|sighting| sighting.size) {
        *counts.entry(size).or_default() += 1;
    }
    let most = counts.values().max()?;
    sightings.iter().filter_map(|sighting| sighting.size).find(|size| counts.get(size) == Some(most))
}

/// A camera has one size.
pub fn refuse_other_sizes(sightings: &mut [Sighting], usual: Option<[u32; 2]>) {
    for sighting in sightings {
        if let (Some([width, height]), Some([usual_width, usual_height])) = (sighting.size, usual)
            && sighting.size != usual
            && sighting.reason.is_none()
        {
            let reason = format!("it is {width} x {height} px, most pictures are {usual_width} x {usual_height} px");
            sighting.reason = Some(reason);
        }
    }
}

/// The fault of pictures none of which shows the board.
#[must_use]
pub fn nothing_seen(sightings: &[Sighting]) -> Fault {
    let first = sightings.iter().find_map(|sighting| Some((&sighting.name, sighting.reason.as_ref()?)));
    let example = first.map(|(name, reason)| format!(" ({name}: {reason})")).unwrap_or_default();
    let detail = format!("the board is seen in none of {} pictures{example}", sightings.len());
    Fault::new(FaultKind::Senseless, detail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sighting(name: &str, size: Option<[u32; 2]>) -> Sighting {
        let reason = size.is_none().then(|| "not a picture".into());
        Sighting { name: name.into(), size, points: vec![(0, 1.5, 2.5, 0.1)], thumbnail: None, reason }
    }

    #[test]
    fn a_picture_of_another_size_does_not_count() {
        let (wide, tall) = (Some([640, 480]), Some([480, 640]));
        let mut sightings =
            [sighting("a", None), sighting("b", tall), sighting("c", wide), sighting("d", wide), sighting("e", tall)];
        assert_eq!(usual_size(&sightings), tall, "as many of each: the first");
        sightings[4].size = wide;
        let usual = usual_size(&sightings);
        assert_eq!(usual, wide);
        refuse_other_sizes(&mut sightings, usual);
        let reasons: Vec<Option<&str>> = sightings.iter().map(|sighting| sighting.reason.as_deref()).collect();
        let other = Some("it is 480 x 640 px, most pictures are 640 x 480 px");
        assert_eq!(reasons, [Some("not a picture"), other, None, None, None]);
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        let board = "chessboard:9x6:0.025".parse().expect("a board");
        let sighting = look("a.jpg".into(), b"I am a text", &board, Limits::default());
        assert_eq!((sighting.size, sighting.points.len()), (None, 0));
        assert!(sighting.reason.is_some_and(|reason| reason.contains("not a picture")));
        let tiny = look("b.pgm".into(), b"P5 1 1 255\n\0", &board, Limits::default());
        assert!(tiny.reason.is_some_and(|reason| reason.contains("1 x 1")));
    }
}
