//! The corners of a lattice at the accuracy of the picture.

use super::growth::ring_px;
use super::lattice::{Lattice, Node};
use super::pyramid::{Level, Pyramid};
use super::saddle::{Saddle, Start, fit};

/// A square's width on the level on which its corner is fitted first, px.
const FIRST_PX: f64 = 14.0;

/// Blur that is expected there, px: lens, pixel, and the halving of the picture.
const FIRST_BLUR_PX: f64 = 0.9;

/// A finer level tells no more once the blur on this one is wider, px.
const ENOUGH_BLUR_PX: f64 = 2.0;

/// What no model knows: mosaic, JPEG, lenses that bend more than once within a square; px of the level of the fit.
const FLOOR_PX: f64 = 0.006;

/// A corner whose fit leaves over more than this share of its contrast is covered or none.
const MAX_NOISE: f64 = 0.22;

/// A fit leaves the place where the lattice has its corner by no more than this share of a square's width.
const MAX_MOVE: f64 = 0.2;

/// Deviation of a corner that is no corner's, px.
const MAX_SIGMA_PX: f64 = 1.0;

/// Moves every node to where its corner is, and gives the deviation of each, px; nodes that have none are taken away.
pub(super) fn settle(lattice: &mut Lattice, pyramid: &Pyramid) -> Vec<f64> {
    let first = fitted(lattice, |node| {
        let width = width_px(lattice, node)?;
        let level = pyramid.level_with(width, FIRST_PX);
        let start = start(lattice, node, level, FIRST_BLUR_PX)?;
        saddle(node, level, &start, width, false).map(|saddle| (saddle.0, saddle.1.blur_px * level.scale))
    });
    replace(lattice, &first);
    let blurs = kept(&first);
    let second = fitted(lattice, |node| {
        let blur_px = blurs[lattice.index(node.cell)?];
        let level = pyramid.level_with(blur_px, ENOUGH_BLUR_PX);
        let start = start(lattice, node, level, blur_px / level.scale)?;
        let (node, saddle) = saddle(node, level, &start, width_px(lattice, node)?, true)?;
        let sigma_px = saddle.sigma_px.hypot(FLOOR_PX) * level.scale;
        (sigma_px < MAX_SIGMA_PX).then_some((node, sigma_px))
    });
    replace(lattice, &second);
    kept(&second)
}

type Fitted = Vec<Option<(Node, f64)>>;

fn fitted(lattice: &Lattice, fit: impl Fn(&Node) -> Option<(Node, f64)>) -> Fitted {
    lattice.nodes.iter().map(fit).collect()
}

fn kept(fitted: &Fitted) -> Vec<f64> {
    fitted.iter().flatten().map(|(_, number)| *number).collect()
}

fn replace(lattice: &mut Lattice, fitted: &Fitted) {
    lattice.retain(|_| false);
    fitted.iter().flatten().for_each(|(node, _)| lattice.insert(*node));
}

fn width_px(lattice: &Lattice, node: &Node) -> Option<f64> {
    // A ring has 0.4 of a width.
    lattice.axes(node.cell).map(|axes| 2.5 * ring_px(&axes))
}

fn start(lattice: &Lattice, node: &Node, level: &Level, blur_px: f64) -> Option<Start> {
    Some(Start {
        place: level.of_picture(&node.pixel),
        axes: lattice.axes(node.cell)? / level.scale,
        bends: lattice.bends(node.cell).map(|bend| bend / level.scale),
        is_black: (node.cell[0] + node.cell[1]) % 2 == 0,
        contrast: node.contrast,
        blur_px,
    })
}

fn saddle(node: &Node, level: &Level, start: &Start, width_px: f64, wants_sigma: bool) -> Option<(Node, Saddle)> {
    let saddle = fit(&level.plane, start, wants_sigma)?;
    let pixel = level.to_picture(&saddle.place);
    let is_corner = saddle.noise < MAX_NOISE * saddle.contrast && (pixel - node.pixel).norm() < MAX_MOVE * width_px;
    is_corner.then(|| (Node { pixel, contrast: saddle.contrast, ..*node }, saddle))
}
