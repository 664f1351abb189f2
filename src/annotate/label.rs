//! Words beside things, put where they cover the least.

use super::canvas::{Box, Canvas, Ink, whole};
use super::marks::stroke;
use super::palette::DARK;
use super::scale::Scale;
use super::text::{Lettering, shortened};
use crate::camera::Pixel;

/// A word and what it is the name of.
pub(super) struct Label {
    /// Middle of the thing, px.
    pub anchor: Pixel,
    /// Half the size of the thing, px.
    pub reach_px: f64,
    /// The word.
    pub text: String,
    /// Its letters.
    pub letters: Lettering,
    /// Its colour.
    pub ink: Ink,
    /// Where other things are likely, px: the label goes to the other side if it can.
    pub away_from: Option<Pixel>,
    /// Left out where it would cover something.
    pub is_optional: bool,
}

/// Labels with their places, and the places that are taken.
pub(super) struct Labels {
    frame: Box,
    margin_px: i32,
    taken: Vec<Box>,
    placed: Vec<(Label, Box)>,
}

/// Longest label, letters.
const MAX_LETTERS: usize = 24;

/// A pixel outside of the frame is as bad as this many covered.
const OUTSIDE_COST: i64 = 20;

impl Labels {
    /// None yet.
    pub fn new(canvas: &Canvas, scale: Scale) -> Self {
        let margin_px = whole(scale.line_px);
        Self { frame: canvas.bounds(), margin_px, taken: Vec::new(), placed: Vec::new() }
    }

    /// The frame.
    pub const fn frame(&self) -> Box {
        self.frame
    }

    /// Keeps labels away from here.
    pub fn keep_clear(&mut self, area: Box) {
        self.taken.push(area);
    }

    /// Finds the label a place: beside its thing, above, below, or at a corner, whichever covers the least. Without any if
    /// the thing itself is out of the frame.
    pub fn add(&mut self, mut label: Label) {
        let is_inside = Box::about(&label.anchor, 0.0).overlap(&self.frame) > 0;
        if !is_inside || !label.anchor.iter().all(|c| c.is_finite()) {
            return;
        }
        label.text = shortened(&label.text, MAX_LETTERS);
        let near = self.candidates(&label, 0).into_iter().map(|area| (self.cost(&label, &area), area));
        // Farther off, with a line to its thing, only where that covers much less.
        let distance = label.letters.height_px() * 3 / 2;
        let penalty = i64::from(label.letters.width_px("x")) * i64::from(label.letters.height_px());
        let far = self.candidates(&label, distance).into_iter().map(|area| (self.cost(&label, &area) + penalty, area));
        let best = near.chain(far).min_by_key(|(cost, _)| *cost);
        if let Some((_, area)) = best
            && !(label.is_optional && self.covered(&area) > 0)
        {
            self.taken.push(area);
            self.placed.push((label, area));
        }
    }

    /// The eight places about a label's thing, this much farther off than need be.
    fn candidates(&self, label: &Label, distance: i32) -> [Box; 8] {
        let (width, height) =
            (label.letters.width_px(&label.text) + 2 * self.margin_px, label.letters.height_px() + self.margin_px);
        let (x, y) = (whole(label.anchor.x), whole(label.anchor.y));
        let reach = whole(label.reach_px) + self.margin_px + 1 + distance;
        let corner = reach * 3 / 4;
        let (left, right) = (x - reach - width, x + reach + 1);
        let (above, below) = (y - reach - height, y + reach + 1);
        let (middle_x, middle_y) = (x - width / 2, y - height / 2);
        [
            (right, middle_y),
            (left, middle_y),
            (middle_x, above),
            (middle_x, below),
            (x + corner, y - corner - height),
            (x + corner, y + corner),
            (x - corner - width, y - corner - height),
            (x - corner - width, y + corner),
        ]
        .map(|(x, y)| Box { x, y, width, height })
    }

    /// Pixels covered, and pixels lost beyond the frame's border.
    fn covered(&self, area: &Box) -> i64 {
        let outside = i64::from(area.width) * i64::from(area.height) - area.overlap(&self.frame);
        let covered: i64 = self.taken.iter().map(|taken| area.overlap(taken)).sum();
        OUTSIDE_COST * outside + covered
    }

    fn cost(&self, label: &Label, area: &Box) -> i64 {
        let inward = label.away_from.map_or(0.0, |middle| {
            let (inwards, to_label) = (middle - label.anchor, area.middle() - label.anchor);
            let lengths = inwards.norm() * to_label.norm();
            if lengths > 0.0 { inwards.dot(&to_label) / lengths } else { 0.0 }
        });
        let size = f64::from(area.width) * f64::from(area.height);
        self.covered(area) + i64::from(whole((1.0 + inward) * 0.25 * size))
    }

    /// Writes all labels, each on a dark box that lets the frame shine through.
    pub fn draw(&self, canvas: &mut Canvas) {
        for (label, area) in &self.placed {
            let end = area.nearest(&label.anchor);
            let way = end - label.anchor;
            let gap_px = way.norm() - label.reach_px;
            if gap_px > 3.0 * f64::from(self.margin_px) + 2.0 {
                let start = end - way.normalize() * gap_px;
                stroke(canvas, start, end, 0.6 * f64::from(self.margin_px), label.ink);
            }
            canvas.fill(*area, Ink { rgb: DARK, opacity: 0.55 });
            let (x, y) = (area.x + self.margin_px, area.y + self.margin_px / 2);
            label.letters.write(canvas, x, y, &label.text, label.ink);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Coding, Frame, Pixels};

    fn labels() -> Labels {
        let frame = Frame::checked(300, 200, Pixels::Luma(vec![0; 60_000]), Coding::LOSSLESS).expect("a frame");
        Labels::new(&Canvas::of(&frame), Scale::of(480))
    }

    fn label(u: f64, v: f64, is_optional: bool) -> Label {
        let letters = Scale::of(480).names;
        let (anchor, ink) = (Pixel::new(u, v), Ink::solid([255; 3]));
        Label { anchor, reach_px: 6.0, text: "marker".into(), letters, ink, away_from: None, is_optional }
    }

    #[test]
    fn labels_of_close_things_do_not_cover_each_other() {
        let mut labels = labels();
        for (u, v) in [(140.0, 90.0), (160.0, 92.0), (150.0, 105.0), (148.0, 80.0)] {
            labels.keep_clear(Box::about(&Pixel::new(u, v), 6.0));
        }
        for (u, v) in [(140.0, 90.0), (160.0, 92.0), (150.0, 105.0), (148.0, 80.0)] {
            labels.add(label(u, v, false));
        }
        let boxes: Vec<Box> = labels.placed.iter().map(|(_, area)| *area).collect();
        assert_eq!(boxes.len(), 4);
        for (i, a) in boxes.iter().enumerate() {
            assert!(boxes[..i].iter().all(|b| a.overlap(b) == 0), "{boxes:?}");
        }
    }

    #[test]
    fn a_label_in_the_corner_stays_on_the_frame() {
        let mut labels = labels();
        for (u, v) in [(0.0, 0.0), (299.0, 0.0), (0.0, 199.0), (299.0, 199.0)] {
            labels.add(label(u, v, false));
        }
        let whole = |area: &Box| area.overlap(&labels.frame) == i64::from(area.width) * i64::from(area.height);
        assert!(labels.placed.len() == 4 && labels.placed.iter().all(|(_, area)| whole(area)));
    }

    #[test]
    fn an_optional_label_gives_way_and_one_off_the_frame_is_left_out() {
        let mut labels = labels();
        labels.keep_clear(Box { x: 0, y: 0, width: 300, height: 200 });
        labels.add(label(100.0, 100.0, true));
        labels.add(label(-20.0, 100.0, false));
        labels.add(label(f64::NAN, 100.0, false));
        assert!(labels.placed.is_empty());
        labels.add(label(100.0, 100.0, false));
        assert_eq!(labels.placed.len(), 1);
    }

    #[test]
    fn a_name_goes_to_the_outer_side_of_its_target() {
        let mut labels = labels();
        labels.add(Label { away_from: Some(Pixel::new(200.0, 100.0)), ..label(150.0, 100.0, false) });
        let (_, area) = &labels.placed[0];
        assert!(area.x + area.width <= 150);
    }
}
