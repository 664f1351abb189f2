//! A calibration board before a camera.

use nalgebra::{Matrix3, Vector2};
use rand::Rng;

use super::light::{Light, mixed, of_srgb, scaled};
use super::radiance::{Radiance, offsets};
use super::{Optics, blur, sensor};
use crate::board::{Board, Ink};
use crate::camera::{Camera, Normalized};
use crate::frame::Frame;
use crate::geometry::CameraFromBoard;

/// A board as it stands in the light.
#[derive(Clone, Debug)]
pub struct Sheet {
    ink: Ink,
    corners: [Vector2<f64>; 2],
    /// Colour of the paper, sRGB.
    pub paper_rgb: [u8; 3],
    /// Colour of the print, sRGB.
    pub ink_rgb: [u8; 3],
    /// Colour of what is around the board, sRGB.
    pub around_rgb: [u8; 3],
    /// How the light changes over the picture: by so much from its left to its right and from its top to its bottom, as a share of
    /// that in its middle.
    pub light_slope: [f64; 2],
    /// Something that stands before the board: its middle and its half sides, shares of the picture's size.
    pub obstacle: Option<[f64; 4]>,
}

impl Sheet {
    /// The board in even light on a gray wall.
    #[must_use]
    pub fn of(board: &Board) -> Self {
        Self {
            ink: Ink::of(board.shapes()),
            corners: board.sheet(),
            paper_rgb: [215; 3],
            ink_rgb: [40; 3],
            around_rgb: [120, 125, 130],
            light_slope: [0.0; 2],
            obstacle: None,
        }
    }

    fn light_at(&self, place: &Vector2<f64>, colours: &[Light; 3]) -> Light {
        let [least, greatest] = self.corners;
        let is_sheet = (least.x..=greatest.x).contains(&place.x) && (least.y..=greatest.y).contains(&place.y);
        match is_sheet {
            false => colours[2],
            true if self.ink.is_at(place) => colours[1],
            true => colours[0],
        }
    }
}

/// The rays of a camera through the corners of its pixels, the middles of their sides and their middles: the same for every picture
/// that it takes.
#[derive(Clone, Debug)]
pub struct Rays {
    width: usize,
    height: usize,
    halves: Vec<Option<Normalized>>,
}

impl Rays {
    /// Of this camera.
    #[must_use]
    pub fn of(camera: &Camera) -> Self {
        let (width, height) = (camera.width() as usize, camera.height() as usize);
        let half =
            |x: usize, y: usize| camera.unproject(&(Vector2::new(x as f64, y as f64) * 0.5 - Vector2::repeat(0.5)));
        let halves = (0..=2 * height).flat_map(|y| (0..=2 * width).map(move |x| half(x, y))).collect();
        Self { width, height, halves }
    }

    /// Rays through the corners of all pixels, row by row.
    fn corners(&self) -> impl Iterator<Item = Option<&Normalized>> {
        let rows = self.halves.chunks_exact(2 * self.width + 1).step_by(2);
        rows.flat_map(|row| row.iter().step_by(2).map(Option::as_ref))
    }

    /// The nine rays of a pixel, row by row.
    fn of_pixel(&self, x: usize, y: usize) -> Option<[Normalized; 9]> {
        let mut rays = [Normalized::zeros(); 9];
        for (k, ray) in rays.iter_mut().enumerate() {
            *ray = self.halves[(2 * y + k / 3) * (2 * self.width + 1) + 2 * x + k % 3]?;
        }
        Some(rays)
    }
}

/// The frame that a camera of these rays takes of the sheet. The same random numbers give the same bytes.
#[must_use]
pub fn render_sheet(
    rays: &Rays,
    camera_from_board: &CameraFromBoard,
    sheet: &Sheet,
    optics: &Optics,
    rng: &mut impl Rng,
) -> Frame {
    sensor::frame_of(&blur::through_lens(radiance(rays, camera_from_board, sheet, optics), optics), optics, rng)
}

#[expect(clippy::float_cmp, reason = "light that was copied, not computed")]
fn radiance(rays: &Rays, camera_from_board: &CameraFromBoard, sheet: &Sheet, optics: &Optics) -> Radiance {
    let (width, height) = (rays.width, rays.height);
    let colours = [sheet.paper_rgb, sheet.ink_rgb, sheet.around_rgb].map(of_srgb);
    let axes = camera_from_board.rotation.matrix();
    let image_from_board =
        Matrix3::from_columns(&[axes.column(0), axes.column(1), camera_from_board.translation.column(0)]);
    let board_from_image = image_from_board.try_inverse();
    // Only what lies before the camera is seen, and only from the printed side.
    let is_front = axes.column(2).dot(&camera_from_board.translation) > 0.0;
    let seen_by = |ray: &Normalized| {
        let hit = board_from_image.filter(|_| is_front).map(|inverse| inverse * ray.push(1.0));
        match hit {
            Some(hit) if hit.z > 0.0 => sheet.light_at(&(hit.xy() / hit.z), &colours),
            _ => colours[2],
        }
    };
    let offsets: Vec<Vector2<f64>> =
        offsets(optics.supersampling).iter().map(|offset| offset + Vector2::repeat(0.5)).collect();
    let at_corners: Vec<Light> = rays.corners().map(|ray| ray.map_or(colours[2], seen_by)).collect();
    let mut light = Vec::with_capacity(width * height);
    for y in 0..height {
        for x in 0..width {
            let at = y * (width + 1) + x;
            let corners = [at, at + 1, at + width + 1, at + width + 2].map(|corner| at_corners[corner]);
            let uniform = corners.iter().all(|corner| *corner == corners[0]);
            let seen = match rays.of_pixel(x, y) {
                Some(rays) if !uniform => {
                    let mut sum = [0.0; 3];
                    for s in &offsets {
                        let light = seen_by(&ray_at(&rays, s));
                        (0..3).for_each(|channel| sum[channel] += light[channel]);
                    }
                    scaled(sum, (offsets.len() as f32).recip())
                }
                _ => corners[0],
            };
            light.push(lit(seen, sheet, [x as f64 / width as f64 - 0.5, y as f64 / height as f64 - 0.5]));
        }
    }
    Radiance { width, height, light }
}

/// The ray at a place in a pixel, whose sides are 1, by the parabolas through its nine: straight lines between its corners would be off by
/// 0.002 px under a fisheye, everywhere to the same side.
fn ray_at(rays: &[Normalized; 9], place: &Vector2<f64>) -> Normalized {
    let shares = |t: f64| [(1.0 - t) * (1.0 - 2.0 * t), 4.0 * t * (1.0 - t), t * (2.0 * t - 1.0)];
    let (across, down) = (shares(place.x), shares(place.y));
    let mut sum = Normalized::zeros();
    for (k, ray) in rays.iter().enumerate() {
        sum += ray * (across[k % 3] * down[k / 3]);
    }
    sum
}

/// The light that is seen at a place of the picture, its middle the origin.
fn lit(seen: Light, sheet: &Sheet, [x, y]: [f64; 2]) -> Light {
    let [across, down] = sheet.light_slope;
    #[expect(clippy::cast_possible_truncation, reason = "light has three digits")]
    let gain = (1.0 + across * x + down * y).max(0.0) as f32;
    let is_hidden = sheet.obstacle.is_some_and(|[u, v, half_width, half_height]| {
        (x + 0.5 - u).abs() < half_width && (y + 0.5 - v).abs() < half_height
    });
    let colour = if is_hidden { mixed(of_srgb([90, 60, 30]), of_srgb([150, 160, 140]), 0.3) } else { seen };
    scaled(colour, gain)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};
    use rand::RngExt;

    use super::*;
    use crate::camera::Distortion;
    use crate::geometry::Point;
    use crate::random::named;

    #[test]
    fn rays_within_pixels_are_the_cameras() {
        let camera =
            Camera::checked([64, 48], [30.0; 2], [31.0, 24.5], Distortion::Equidistant([0.02, -0.01, 0.0, 0.0]))
                .expect("a camera");
        let (rays, mut rng) = (Rays::of(&camera), named("rays within pixels"));
        for (x, y) in (0..48).map(|y| (y + 8, y)) {
            let place = Vector2::new(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
            let pixel = Vector2::new(x as f64 - 0.5, y as f64 - 0.5) + place;
            let ray = ray_at(&rays.of_pixel(x, y).expect("rays"), &place);
            let seen = camera.project(&Point::new(ray.x, ray.y, 1.0)).expect("in view");
            // A ninth of the focal length of a VGA fisheye: lines between the corners are off by 0.015 px.
            assert!((seen - pixel).norm() < 1e-3, "{pixel}: {seen}");
        }
    }

    #[test]
    fn the_first_inner_corner_is_where_its_board_is_and_black_is_above_it_to_the_left() {
        let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
        let camera = Camera::checked([200, 160], [200.0; 2], [60.0, 50.0], Distortion::None).expect("a camera");
        let pose = CameraFromBoard::new(Rotation3::identity(), Vector3::new(0.0, 0.0, 0.5));
        let frame = render_sheet(&Rays::of(&camera), &pose, &Sheet::of(&board), &Optics::ideal(), &mut named("sheet"));
        let rgb = frame.rgb();
        let at = |x: usize, y: usize| rgb[3 * (y * 200 + x)];
        // A square is 10 px wide.
        assert_eq!([at(55, 45), at(65, 55), at(65, 45), at(55, 55)], [40, 40, 215, 215]);
        assert_eq!(at(30, 20), 120, "beside the sheet");
    }
}
