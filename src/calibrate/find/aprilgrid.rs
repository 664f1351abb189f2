//! A lattice of tags in a picture: the corners of the tags.
//!
//! The squares in the gaps make every corner of a tag one where four fields meet, two black and two white: a saddle of the
//! picture ([`corners`]). Corners that black edges join four by four ([`quads`]) enclose a tag where its cells read as one
//! ([`tag`]), and beside a tag are others ([`growth`]); tags that lie to each other as on the board ([`lattice`]) are the board. A model of the light about each corner says
//! where exactly it is ([`crossing`]), with edges as bent as the lens makes the board's lines there ([`bends`]). Only neighbouring tags are ever compared, so that a lens may bend the board.

mod bends;
mod corners;
mod crossing;
mod growth;
mod lattice;
mod plane;
mod quads;
mod tag;

use self::bends::Bends;
use self::crossing::{Fit, Start};
use self::lattice::Seen;
use self::plane::Plane;
use self::tag::Tag;
use super::tone::{self, Tone};
use super::{Luma, NoBoard};
use crate::board::{AprilGrid, Board};
use crate::calibrate::SeenPoint;

/// Blurs under which corners are looked for, px: the first finds what is sharp, the second small tags, the third what is out of
/// focus.
const BLURS_PX: [f64; 3] = [1.2, 0.7, 2.4];

/// Fewer tags are no board.
const MIN_TAGS: usize = 2;

/// What no model knows: JPEG, lenses that bend more than they do at large; px.
const FLOOR_PX: f64 = 0.003;

/// How far an edge is looked at from its corner, sides of a tag.
const BEND_OVER: f64 = 0.2;

/// The corners of the tags that are seen.
pub(super) fn find(picture: &Luma, board: &Board, grid: &AprilGrid) -> Result<Vec<SeenPoint>, NoBoard> {
    let raw = Plane::of(picture);
    let all = (grid.columns * grid.rows) as usize;
    let mut best: Vec<Tag> = Vec::new();
    for blur_px in BLURS_PX {
        let smooth = raw.blurred(blur_px);
        let corners = corners::corners(&smooth, blur_px);
        let quads = quads::quads(&smooth, &corners);
        let mut tags: Vec<Tag> = Vec::new();
        for tag in quads.iter().filter_map(|quad| Tag::read(&raw, quad, grid)) {
            if !tags.iter().any(|other| other.is_same(&tag)) {
                tags.push(tag);
            }
        }
        growth::grow(&raw, &corners, &mut tags, grid);
        match lattice::of(tags, grid) {
            Seen::Board(tags) if tags.len() > best.len() => best = tags,
            Seen::Board(_) => {}
            Seen::Several(count) => return Err(NoBoard::Several { count }),
            Seen::Other { columns, rows } => {
                return Err(NoBoard::OtherSize {
                    pattern: "board of tags",
                    found_columns: columns,
                    found_rows: rows,
                    columns: grid.columns as usize,
                    rows: grid.rows as usize,
                    cut: false,
                });
            }
        }
        if best.len() == all {
            break;
        }
    }
    let points = settled(picture, &raw, &best, board, grid);
    if best.len() < MIN_TAGS || points.len() < 4 {
        return Err(NoBoard::NotSeen { pattern: "board of tags", found: points.len(), need: 4 * all });
    }
    Ok(points)
}

/// The corners where the picture has them exactly.
fn settled(picture: &Luma, raw: &Plane, tags: &[Tag], board: &Board, grid: &AprilGrid) -> Vec<SeenPoint> {
    let curved = Plane::in_tone(picture, Tone::Curved);
    let straight = |plane: &Plane| -> Vec<(usize, Start, f64)> {
        let corners = tags.iter().flat_map(|tag| (0..4).map(move |corner| (tag, corner)));
        let fitted = corners.filter_map(|(tag, corner)| {
            let start = tag.start(corner, grid)?;
            let fit = crossing::fit(plane, &start)?;
            Some((4 * tag.number + corner, Start { place: fit.place, ..start }, fit.curve))
        });
        fitted.collect()
    };
    let (tone, straight) = tone::evenest([&curved, raw].map(straight), |(_, _, curve)| *curve);
    let light = if tone == Tone::Curved { &curved } else { raw };
    // Bent edges move neighbouring corners alike, so that the lines through them bend as they do in truth.
    let seen: Vec<_> = straight.iter().map(|(point, start, _)| (*point, start.place)).collect();
    let bends = Bends::of(board, &seen, [raw.width, raw.height]);
    let mut fits: Vec<(usize, Fit)> = Vec::with_capacity(straight.len());
    for (point, start, _) in &straight {
        let at = |bends: &Bends| bends.per_px(&board.points()[*point], BEND_OVER * grid.tag_m);
        let bent = Start { bends_per_px: bends.as_ref().map_or(start.bends_per_px, at), ..*start };
        if let Some(fit) = crossing::fit(light, &bent) {
            fits.push((*point, fit));
        }
    }
    let mut noises: Vec<f64> = fits.iter().map(|(_, fit)| fit.noise_ratio()).collect();
    noises.sort_by(f64::total_cmp);
    let usual = noises.get(noises.len() / 2).copied().unwrap_or_default();
    // What stands before a corner is no noise.
    fits.retain(|(_, fit)| fit.noise_ratio() < (3.0 * usual).max(0.04));
    let likeness = crossing::Likeness::of(&fits.iter().map(|(_, fit)| fit));
    let mut points: Vec<SeenPoint> = fits
        .iter()
        .filter_map(|(point, fit)| {
            let sigma_px = fit.sigma_px(&likeness).hypot(FLOOR_PX);
            (sigma_px < 1.0).then_some(SeenPoint { point: *point, pixel: fit.place, sigma_px })
        })
        .collect();
    points.sort_unstable_by_key(|seen| seen.point);
    points
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector2, Vector3};

    use super::super::{NoBoard, find};
    use crate::board::Board;
    use crate::calibrate::SeenPoint;
    use crate::camera::{Camera, Distortion};
    use crate::frame::{Coding, Frame, Pixels};
    use crate::geometry::CameraFromBoard;
    use crate::random::case;
    use crate::scene::render::{Optics, Rays, Sheet, render_sheet};

    fn board(text: &str) -> Board {
        text.parse().expect("a board")
    }

    fn pinhole() -> Camera {
        camera(600.0, Distortion::None)
    }

    fn camera(focal_px: f64, lens: Distortion) -> Camera {
        Camera::checked([800, 600], [focal_px; 2], [390.0, 305.0], lens).expect("a camera")
    }

    /// The board's middle at this place, turned by these angles about the camera's axes, z first.
    fn pose(board: &Board, middle: [f64; 3], angles_deg: [f64; 3]) -> CameraFromBoard {
        let [x, y, z] = angles_deg.map(f64::to_radians);
        let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
        let rotation = about(Vector3::x_axis(), x) * about(Vector3::y_axis(), y) * about(Vector3::z_axis(), z);
        let [least, greatest] = board.sheet();
        let centre = (0.5 * (least + greatest)).push(0.0);
        CameraFromBoard::new(rotation, Vector3::from(middle) - rotation * centre)
    }

    fn taken(rays: &Rays, pose: &CameraFromBoard, sheet: &Sheet, optics: &Optics, number: u64) -> Frame {
        render_sheet(rays, pose, sheet, optics, &mut case("aprilgrid", number))
    }

    /// Errors of points, also in standard deviations.
    #[derive(Default)]
    struct Errors {
        squares: f64,
        shares: f64,
        count: f64,
    }

    impl Errors {
        fn add(&mut self, board: &Board, camera: &Camera, pose: &CameraFromBoard, seen: &[SeenPoint]) {
            for point in seen {
                let truth = camera.project(&(*pose * board.points()[point.point])).expect("in view");
                let error: Vector2<f64> = point.pixel - truth;
                assert!(error.norm() < 0.4, "point {} is off by {error}, sigma {}", point.point, point.sigma_px);
                self.squares += error.norm_squared() / 2.0;
                self.shares += (error / point.sigma_px).norm_squared() / 2.0;
                self.count += 1.0;
            }
        }

        /// Root mean square error, px, and mean square of error over sigma.
        fn told(&self, what: &str) -> [f64; 2] {
            let [rmse_px, chi_square] = [(self.squares / self.count).sqrt(), self.shares / self.count];
            println!("{what}: {} points, RMSE {rmse_px:.4} px, chi-square {chi_square:.2}", self.count);
            [rmse_px, chi_square]
        }
    }

    #[test]
    fn every_corner_is_found_up_to_sixty_degrees_and_sigma_says_how_well() {
        let board = board("aprilgrid:6x6:0.03");
        let lenses = [
            ("pinhole", pinhole()),
            ("barrel", camera(600.0, Distortion::PlumbBob([-0.28, 0.08, 0.0005, -0.0004, 0.0]))),
            ("fisheye", camera(420.0, Distortion::Equidistant([0.02, -0.01, 0.002, 0.0]))),
        ];
        let mono = Optics { bayer: None, ..Optics::default() };
        let noisy = Optics { shot_noise_ratio: 0.03, read_noise_ratio: 0.01, ..Optics::default() };
        for (number, (lens, camera)) in (0..).zip(&lenses) {
            // The fisheye has smaller tags at the same distance.
            let (nearer, rays) = (camera.focal_lengths()[0] / 600.0, Rays::of(camera));
            for (kind, optics, most_px) in
                [("colour", Optics::default(), 0.02), ("gray", mono, 0.02), ("noisy", noisy, 0.04)]
            {
                // What a sensor does to a corner has nothing to do with the lens.
                if kind == "gray" && *lens != "pinhole" || kind == "noisy" && *lens == "barrel" {
                    continue;
                }
                let mut errors = Errors::default();
                for (index, (distance_m, angles)) in
                    (0..).zip([(0.4, [0.0, 45.0, 10.0]), (0.4, [35.0, -30.0, 170.0]), (0.38, [0.0, -60.0, 20.0])])
                {
                    let pose = pose(&board, [0.0, 0.0, distance_m * nearer], angles);
                    let frame = taken(&rays, &pose, &Sheet::of(&board), &optics, 10 * number + index);
                    let seen = find(&frame, &board).unwrap_or_else(|error| panic!("{lens} {kind} {angles:?}: {error}"));
                    // The fisheye's farthest tags have sides of 12 px.
                    let least = if *lens == "fisheye" { 110 } else { 140 };
                    assert!(seen.len() >= least, "{lens} {kind} {angles:?}: {}", seen.len());
                    errors.add(&board, camera, &pose, &seen);
                }
                let [rmse_px, chi_square] = errors.told(&format!("{lens}, {kind}"));
                assert!(rmse_px < most_px, "{lens} {kind}");
                // About 432 points, whose noise is like in neighbouring pixels as far as that can be told from one picture.
                assert!((0.5..1.7).contains(&chi_square), "{lens} {kind}");
            }
        }
    }

    #[test]
    fn a_fisheye_bends_edges_and_moves_no_corner() {
        let board = board("aprilgrid:6x4:0.03");
        let camera = camera(330.0, Distortion::Equidistant([-0.02, 0.006, -0.003, 0.001]));
        let (middle, rays) = (Vector2::from(camera.principal_point()), Rays::of(&camera));
        let (mut inwards_px, mut count) = (0.0, 0.0);
        for (number, place) in (400..).zip([[0.07, 0.04], [-0.07, 0.04], [0.07, -0.04], [-0.07, -0.04]]) {
            let pose = pose(&board, [place[0], place[1], 0.22], [20.0 * place[1].signum(), -15.0, 5.0]);
            let frame = taken(&rays, &pose, &Sheet::of(&board), &Optics::default(), number);
            for seen in find(&frame, &board).expect("a board") {
                let truth = camera.project(&(pose * board.points()[seen.point])).expect("in view");
                inwards_px += (seen.pixel - truth).dot(&(middle - truth).normalize());
                count += 1.0;
            }
        }
        // Straight edges have it at 0.008 px; of so many points the mean is known to 0.001 px.
        println!("{count} corners, {:.4} px to the middle", inwards_px / count);
        assert!(count > 250.0 && (inwards_px / count).abs() < 0.003, "{count} {inwards_px}");
    }

    #[test]
    fn what_is_seen_of_a_board_is_found() {
        let (board, camera) = (board("aprilgrid:6x6:0.03"), pinhole());
        let (whole, rays) = (Sheet::of(&board), Rays::of(&camera));
        let mut covered = whole.clone();
        covered.obstacle = Some([0.45, 0.5, 0.08, 0.1]);
        let mut slope = whole.clone();
        slope.light_slope = [1.2, -0.5];
        for (what, middle, sheet, least) in [
            ("partly", [0.12, 0.1, 0.3], &whole, 30),
            ("covered", [0.0, 0.0, 0.35], &covered, 90),
            ("in sloping light", [0.0, 0.0, 0.35], &slope, 144),
        ] {
            let pose = pose(&board, middle, [20.0, -15.0, 5.0]);
            let frame = taken(&rays, &pose, sheet, &Optics::default(), 100);
            let seen = find(&frame, &board).unwrap_or_else(|error| panic!("{what}: {error}"));
            assert!(
                (least..=if what == "covered" { 136 } else { 144 }).contains(&seen.len()),
                "{what}: {}",
                seen.len()
            );
            assert!(seen.is_sorted_by(|a, b| a.point < b.point), "each once, in order");
            let mut errors = Errors::default();
            errors.add(&board, &camera, &pose, &seen);
            assert!(errors.told(what)[0] < 0.03);
        }
    }

    #[test]
    fn another_board_is_told_from_it_and_nothing_is_nothing() {
        let (here, camera) = (board("aprilgrid:6x6:0.03"), pinhole());
        let frame = taken(
            &Rays::of(&camera),
            &pose(&here, [0.0, 0.0, 0.38], [20.0, 0.0, 0.0]),
            &Sheet::of(&here),
            &Optics::default(),
            200,
        );
        let other = NoBoard::OtherSize {
            pattern: "board of tags",
            found_columns: 6,
            found_rows: 6,
            columns: 5,
            rows: 7,
            cut: false,
        };
        assert_eq!(find(&frame, &board("aprilgrid:5x7:0.03")), Err(other));
        let fewer = NoBoard::OtherSize {
            pattern: "board of tags",
            found_columns: 6,
            found_rows: 6,
            columns: 6,
            rows: 4,
            cut: false,
        };
        assert_eq!(find(&frame, &board("aprilgrid:6x4:0.03")), Err(fewer));
        let chess = board("chessboard:9x6:0.02");
        let frame = taken(
            &Rays::of(&camera),
            &pose(&chess, [0.0, 0.0, 0.38], [20.0, 0.0, 0.0]),
            &Sheet::of(&chess),
            &Optics::default(),
            201,
        );
        assert_eq!(find(&frame, &here), Err(NoBoard::NotSeen { pattern: "board of tags", found: 0, need: 144 }));
        for sample in [0, 255] {
            let even = Frame::checked(64, 48, Pixels::Luma(vec![sample; 64 * 48]), Coding::LOSSLESS).expect("a frame");
            assert!(matches!(find(&even, &here), Err(NoBoard::NotSeen { .. })));
        }
    }

    #[test]
    fn of_two_equal_boards_none_is_taken() {
        let (board, camera) = (board("aprilgrid:4x4:0.03"), pinhole());
        let half = |x: f64, number: u64| {
            let pose = pose(&board, [x, 0.0, 0.45], [0.0, 10.0, 0.0]);
            taken(&Rays::of(&camera), &pose, &Sheet::of(&board), &Optics::default(), number).rgb().into_owned()
        };
        let (left, right) = (half(-0.14, 300), half(0.15, 301));
        let mixed = (0..left.len()).map(|at| if at / 3 % 800 < 400 { left[at] } else { right[at] }).collect();
        let frame = Frame::checked(800, 600, Pixels::Rgb(mixed), Coding::LOSSLESS).expect("a frame");
        assert_eq!(find(&frame, &board), Err(NoBoard::Several { count: 2 }));
    }
}
