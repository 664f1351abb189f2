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

/// So is one whose fit leaves over more than this multiple of the lattice's median, and a share of the contrast besides.
const MAX_NOISES: f64 = 3.0;
const SPARE_NOISE: f64 = 0.06;

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
        let (node, saddle) = saddle(node, level, &start, width, false)?;
        Some(Fit { node, noise: saddle.noise / saddle.contrast, px: saddle.blur_px * level.scale })
    });
    let blurs = replace(lattice, first);
    let second = fitted(lattice, |node| {
        let blur_px = blurs[lattice.index(node.cell)?];
        let level = pyramid.level_with(blur_px, ENOUGH_BLUR_PX);
        let start = start(lattice, node, level, blur_px / level.scale)?;
        let (node, saddle) = saddle(node, level, &start, width_px(lattice, node)?, true)?;
        let px = saddle.sigma_px.hypot(FLOOR_PX) * level.scale;
        (px < MAX_SIGMA_PX).then(|| Fit { node, noise: saddle.noise / saddle.contrast, px })
    });
    replace(lattice, second)
}

/// A node where its fit has it.
struct Fit {
    node: Node,
    /// What the fit leaves over, as a share of the contrast.
    noise: f64,
    /// Blur after the first fit, deviation after the second, px of the picture.
    px: f64,
}

fn fitted(lattice: &Lattice, fit: impl Fn(&Node) -> Option<Fit>) -> Vec<Fit> {
    lattice.nodes.iter().filter_map(fit).collect()
}

/// Puts the fits into the lattice instead of what it had, without those that do not fit as well as the others.
fn replace(lattice: &mut Lattice, mut fits: Vec<Fit>) -> Vec<f64> {
    let mut noises: Vec<f64> = fits.iter().map(|fit| fit.noise).collect();
    noises.sort_unstable_by(f64::total_cmp);
    let median = noises.get(noises.len() / 2).copied().unwrap_or(0.0);
    fits.retain(|fit| fit.noise <= MAX_NOISES * median + SPARE_NOISE);
    lattice.retain(|_| false);
    fits.iter().for_each(|fit| lattice.insert(fit.node));
    fits.iter().map(|fit| fit.px).collect()
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
