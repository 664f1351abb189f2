//! Drawings of a calibration as SVG, in the picture's own pixels.

use std::fmt::Write;

use nalgebra::Vector2;

use super::SeenPoint;
use super::coverage::{CELLS, Coverage};
use super::estimate::{Calibration, FittedView};
use crate::camera::Pixel;

/// A drawing of the size of the picture, on white.
struct Sheet {
    text: String,
    size: [f64; 2],
}

impl Sheet {
    fn new([width, height]: [u32; 2], label: &str) -> Self {
        let text = format!(
            r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="-0.5 -0.5 {width} {height}" role="img" aria-label="{label}">"#
        );
        let mut sheet = Self { text, size: [width, height].map(f64::from) };
        let [w, h] = sheet.size;
        sheet.add(format_args!(
            r##"<rect x="-0.5" y="-0.5" width="{w}" height="{h}" fill="#fff" stroke="#9aa3ad" stroke-width="{}"/>"##,
            w / 400.0
        ));
        sheet
    }

    fn add(&mut self, part: std::fmt::Arguments<'_>) {
        // Writing into a string cannot fail.
        _ = self.text.write_fmt(part);
    }

    fn line(&mut self, from: Pixel, to: Pixel, colour: &str) {
        let width = self.size[0] / 450.0;
        self.add(format_args!(
            r#"<path d="M{:.2} {:.2}L{:.2} {:.2}" stroke="{colour}" stroke-width="{width:.2}"/>"#,
            from.x, from.y, to.x, to.y
        ));
    }

    fn dot(&mut self, at: Pixel, share: f64, colour: &str) {
        let radius = self.size[0] * share;
        self.add(format_args!(r#"<circle cx="{:.2}" cy="{:.2}" r="{radius:.2}" fill="{colour}"/>"#, at.x, at.y));
    }

    fn words(&mut self, at: Pixel, text: &str) {
        let size = self.size[0] / 34.0;
        self.add(format_args!(
            r##"<text x="{:.1}" y="{:.1}" font-size="{size:.1}" text-anchor="middle" fill="#1d2733">{text}</text>"##,
            at.x, at.y
        ));
    }

    fn finished(mut self) -> String {
        self.text.push_str("</svg>");
        self.text
    }
}

const COUNTS: &str = "#1f6fb2";
const LEFT_OUT: &str = "#c8102e";

/// Where points were seen and by how much, enlarged, they are off: systematic whirls and fans say that the lens model is too small. With
/// the factor by which they are enlarged.
#[must_use]
pub fn residual_field(size: [u32; 2], views: &[Vec<SeenPoint>], found: &Calibration) -> (String, f64) {
    let factor = nice(0.025 * f64::from(size[0]) / found.rms_px.max(1e-6));
    let mut sheet = Sheet::new(size, "residual of every point");
    for (seen, fitted) in views.iter().zip(&found.views).filter(|(_, fitted)| fitted.counts()) {
        for ((seen, residual), counts) in seen.iter().zip(&fitted.residuals_px).zip(&fitted.inliers) {
            let Some(residual) = residual else { continue };
            // What is left out may point anywhere.
            let length = residual.norm().min(0.1 * f64::from(size[0]) / factor);
            let shown = residual.try_normalize(0.0).map_or(Vector2::zeros(), |unit| unit * (length * factor));
            let colour = if *counts { COUNTS } else { LEFT_OUT };
            sheet.line(seen.pixel, seen.pixel + shown, colour);
            sheet.dot(seen.pixel, 1.0 / 500.0, colour);
        }
    }
    (sheet.finished(), factor)
}

/// 1, 2 or 5 times a power of ten, at most `value`.
fn nice(value: f64) -> f64 {
    let power = 10.0_f64.powf(value.log10().floor());
    let lead = value / power;
    let step = if lead >= 5.0 {
        5.0
    } else if lead >= 2.0 {
        2.0
    } else {
        1.0
    };
    step * power
}

/// How many points were seen in each part of the picture.
#[must_use]
pub fn coverage_map(size: [u32; 2], coverage: &Coverage) -> String {
    let most = coverage.points.iter().max().copied().unwrap_or(0).max(1) as f64;
    cells(size, "points in each part of the picture", |cell| {
        let count = coverage.points[cell];
        let shade = if count == 0 { 0.0 } else { 0.15 + 0.6 * count as f64 / most };
        (shade, count.to_string())
    })
}

/// How well rays through each part of the picture are known, px.
#[must_use]
pub fn certainty_map(size: [u32; 2], ray_sigmas_px: &[Option<f64>]) -> String {
    let most = ray_sigmas_px.iter().flatten().copied().fold(1e-9, f64::max);
    cells(size, "standard deviation of rays through each part of the picture", |cell| {
        match ray_sigmas_px.get(cell).copied().flatten() {
            Some(sigma) => (0.6 * sigma / most, format!("{sigma:.2}")),
            None => (0.0, "–".into()),
        }
    })
}

fn cells(size: [u32; 2], label: &str, of_cell: impl Fn(usize) -> (f64, String)) -> String {
    let mut sheet = Sheet::new(size, label);
    let [columns, rows] = CELLS;
    let [width, height] = [sheet.size[0] / columns as f64, sheet.size[1] / rows as f64];
    for cell in 0..columns * rows {
        let (shade, text) = of_cell(cell);
        let corner = Pixel::new((cell % columns) as f64 * width - 0.5, (cell / columns) as f64 * height - 0.5);
        sheet.add(format_args!(
            r#"<rect x="{:.2}" y="{:.2}" width="{width:.2}" height="{height:.2}" fill="{COUNTS}" fill-opacity="{shade:.3}"/>"#,
            corner.x, corner.y
        ));
        sheet.words(corner + Pixel::new(0.5 * width, 0.5 * height + sheet.size[0] / 100.0), &text);
    }
    sheet.finished()
}

/// The error of each view, by its number from 1; those that do not count in red.
#[must_use]
pub fn view_errors(found: &Calibration) -> String {
    let count = found.views.len().max(1) as f64;
    let (width, height) = ((26.0 * count + 70.0).max(360.0), 240.0);
    let most = found.views.iter().filter(|view| view.counts()).map(|view| view.rms_px).fold(1e-9, f64::max);
    let top = 1.25 * most;
    let [left, base, reach] = [48.0, height - 26.0, height - 44.0];
    let mut text = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0} {height:.0}" role="img" aria-label="error of each view">"#
    );
    for tick in 0..=4 {
        // The uppermost makes room for the unit.
        let value = if tick < 4 { format!("{:.3}", top * f64::from(tick) / 4.0) } else { String::new() };
        let y = base - reach * f64::from(tick) / 4.0;
        _ = write!(
            text,
            r##"<path d="M{left} {y:.1}H{width:.0}" stroke="#d5dae0"/><text x="{:.1}" y="{:.1}" font-size="11" text-anchor="end" fill="#49535e">{value}</text>"##,
            left - 6.0,
            y + 4.0
        );
    }
    let step = (width - left - 10.0) / count;
    for (index, view) in found.views.iter().enumerate() {
        let x = left + 6.0 + step * index as f64;
        let tall = if view.camera_from_board.is_some() { reach * (view.rms_px / top).min(1.0) } else { 0.0 };
        let colour = if view.counts() { COUNTS } else { LEFT_OUT };
        _ = write!(
            text,
            r##"<rect x="{x:.1}" y="{:.1}" width="{:.1}" height="{tall:.1}" fill="{colour}"/><text x="{:.1}" y="{:.1}" font-size="11" text-anchor="middle" fill="#49535e">{}</text>"##,
            base - tall,
            0.7 * step,
            x + 0.35 * step,
            base + 15.0,
            index + 1
        );
    }
    text.push_str(r##"<text x="6" y="14" font-size="11" fill="#49535e">px, root mean square</text></svg>"##);
    text
}

/// What was found in a picture, over the picture itself, a data address; the first point green, those left out red.
#[must_use]
pub fn found_points(size: [u32; 2], picture: Option<&str>, seen: &[SeenPoint], fitted: &FittedView) -> String {
    let mut sheet = Sheet::new(size, "points that were found");
    if let Some(address) = picture {
        let [width, height] = sheet.size;
        sheet.add(format_args!(
            r#"<image href="{address}" x="-0.5" y="-0.5" width="{width}" height="{height}" preserveAspectRatio="none"/>"#
        ));
    }
    for pair in seen.windows(2).filter(|pair| pair[1].point == pair[0].point + 1) {
        sheet.line(pair[0].pixel, pair[1].pixel, "#f2b705");
    }
    for (index, seen) in seen.iter().enumerate() {
        let counts = fitted.inliers.get(index).copied().unwrap_or(false);
        let colour = match (seen.point, counts) {
            (_, false) => LEFT_OUT,
            (0, true) => "#19a519",
            (_, true) => "#2fb5ff",
        };
        sheet.dot(seen.pixel, if seen.point == 0 { 1.0 / 80.0 } else { 1.0 / 160.0 }, colour);
    }
    sheet.finished()
}

/// Where to hold the board next, over what has been covered.
#[must_use]
pub fn next_view_map(size: [u32; 2], outline_px: &[Pixel], views: &[Vec<SeenPoint>]) -> String {
    let mut sheet = Sheet::new(size, "where to hold the board next");
    for seen in views.iter().flatten() {
        sheet.dot(seen.pixel, 1.0 / 300.0, "#b9c2cc");
    }
    let corners: Vec<String> = outline_px.iter().map(|pixel| format!("{:.1},{:.1}", pixel.x, pixel.y)).collect();
    let width = sheet.size[0] / 160.0;
    sheet.add(format_args!(
        r##"<polygon points="{}" fill="#f2b705" fill-opacity="0.35" stroke="#b07f00" stroke-width="{width:.2}"/>"##,
        corners.join(" ")
    ));
    if let Some(first) = outline_px.first() {
        sheet.dot(*first, 1.0 / 60.0, "#19a519");
    }
    sheet.finished()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_round() {
        for (value, expected) in [(0.7, 0.5), (1.0, 1.0), (4.9, 2.0), (7.3, 5.0), (130.0, 100.0)] {
            assert!((nice(value) - expected).abs() < 1e-9, "{value}");
        }
    }

    #[test]
    fn a_map_has_a_cell_for_each_count() {
        let mut points = vec![0; CELLS[0] * CELLS[1]];
        points[3] = 17;
        let svg = coverage_map([640, 480], &Coverage { points, share: 0.02 });
        assert_eq!(svg.matches("<text").count(), CELLS[0] * CELLS[1]);
        assert!(svg.contains(">17</text>") && svg.ends_with("</svg>"));
    }
}
