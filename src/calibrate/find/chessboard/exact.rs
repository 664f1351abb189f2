//! The corners of a lattice at the accuracy of the picture.

use super::super::tone::{self, Tone};
use super::growth::ring_px;
use super::lattice::{Lattice, Node};
use super::pyramid::{Level, Pyramid};
use super::saddle::{Light, Settled, Start, fit};

/// A square's width on the level on which its corner is fitted first, px.
const FIRST_PX: f64 = 14.0;

/// Blur that is expected there, px: lens, pixel, and the halving of the picture.
const FIRST_BLUR_PX: f64 = 0.9;

/// A finer level tells no more once the blur on this one is wider, px.
const ENOUGH_BLUR_PX: f64 = 2.0;

/// What no model knows: JPEG, lenses that bend more than once within a square; px of the level of the fit.
const FLOOR_PX: f64 = 0.003;

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
pub(super) fn settle(lattice: &mut Lattice, pyramid: &Pyramid<'_>) -> Vec<f64> {
    let in_tone = |tone: Tone| {
        fitted(lattice, |node| {
            let width = width_px(lattice, node)?;
            let level = pyramid.level_with(width, FIRST_PX);
            let half = 0.5 * node.contrast * if (node.cell[0] + node.cell[1]) % 2 == 0 { -1.0 } else { 1.0 };
            let light = Light::expected(half, FIRST_BLUR_PX * level.scale);
            fit_of(lattice, node, level, &light, tone, &Settled::ROUGHLY)
        })
    };
    let (tone, first) = tone::evenest(Tone::ALL.map(in_tone), |fit| fit.light.curve / fit.light.half.abs());
    let first = replace(lattice, first);
    let second = fitted(lattice, |node| {
        let light = &first[lattice.index(node.cell)?].light;
        let level = pyramid.level_with(light.sharpest_px(), ENOUGH_BLUR_PX);
        fit_of(lattice, node, level, light, tone, &Settled::FULLY).filter(|fit| fit.sigma_px < MAX_SIGMA_PX)
    });
    replace(lattice, second).iter().map(|fit| fit.sigma_px).collect()
}

/// A node where its fit has it; px of the picture.
struct Fit {
    node: Node,
    /// What the fit leaves over, as a share of the contrast.
    noise: f64,
    sigma_px: f64,
    light: Light,
}

fn fitted(lattice: &Lattice, fit: impl Fn(&Node) -> Option<Fit>) -> Vec<Fit> {
    lattice.nodes.iter().filter_map(fit).collect()
}

/// Puts the fits into the lattice instead of what it had, without those that do not fit as well as the others.
fn replace(lattice: &mut Lattice, mut fits: Vec<Fit>) -> Vec<Fit> {
    let mut noises: Vec<f64> = fits.iter().map(|fit| fit.noise).collect();
    noises.sort_unstable_by(f64::total_cmp);
    let median = noises.get(noises.len() / 2).copied().unwrap_or(0.0);
    fits.retain(|fit| fit.noise <= MAX_NOISES * median + SPARE_NOISE);
    lattice.retain(|_| false);
    for fit in &fits {
        lattice.insert(fit.node);
    }
    fits
}

fn width_px(lattice: &Lattice, node: &Node) -> Option<f64> {
    // A ring has 0.4 of a width.
    lattice.axes(node.cell).map(|axes| 2.5 * ring_px(&axes))
}

/// The fit on this level, `light` with its blur in px of the picture.
fn fit_of(
    lattice: &Lattice,
    node: &Node,
    level: &Level<'_>,
    light: &Light,
    tone: Tone,
    settled: &Settled,
) -> Option<Fit> {
    let start = Start {
        place: level.of_picture(&node.pixel),
        axes: lattice.axes(node.cell)? / level.scale,
        bends: lattice.bends(node.cell).map(|bend| bend / level.scale),
        light: light.scaled(level.scale),
        tone,
    };
    let saddle = fit(&level.plane, &start, settled)?;
    let pixel = level.to_picture(&saddle.place);
    let is_corner = saddle.noise < MAX_NOISE && (pixel - node.pixel).norm() < MAX_MOVE * width_px(lattice, node)?;
    let node = Node { pixel, ..*node };
    let sigma_px = saddle.sigma_px.hypot(FLOOR_PX) * level.scale;
    let light = saddle.light.scaled(level.scale.recip());
    is_corner.then_some(Fit { node, noise: saddle.noise, sigma_px, light })
}
