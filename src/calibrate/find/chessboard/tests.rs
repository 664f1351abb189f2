//! Rendered boards, whose corners are known.

use nalgebra::{Vector2, Vector3};
use rand::RngExt;

use crate::board::Board;
use crate::calibrate::SeenPoint;
use crate::calibrate::find::tone::Tone;
use crate::calibrate::find::{Need, NoBoard, find};
use crate::camera::{Camera, Distortion, Pixel};
use crate::detect::luma;
use crate::frame::{Coding, Decoding, Frame, Pixels};
use crate::geometry::{CameraFromBoard, rotation};
use crate::random;
use crate::scene::encode;
use crate::scene::render::{Optics, Rays, Sheet, render_sheet};

/// A board of squares of 25 mm before a camera.
struct View {
    camera: Camera,
    rays: Rays,
    board: Board,
    sheet: Sheet,
    optics: Optics,
}

impl View {
    fn of(size: [u32; 2], focal_px: f64, lens: Distortion, board: &str) -> Self {
        let middle = size.map(|side| 0.5 * f64::from(side) + 1.7);
        let camera = Camera::checked(size, [focal_px; 2], middle, lens).expect("a camera");
        let board: Board = board.parse().expect("a board");
        let optics = Optics { bayer: None, supersampling: 6, ..Optics::default() };
        Self { rays: Rays::of(&camera), camera, sheet: Sheet::of(&board), board, optics }
    }

    fn small() -> Self {
        Self::of([400, 320], 380.0, Distortion::None, "chessboard:7x6:0.025")
    }

    /// The pose with the board's middle at `middle`, px from the picture's, its squares `square_px` wide, turned by `turn`.
    fn pose(&self, square_px: f64, middle: [f64; 2], turn: Vector3<f64>) -> CameraFromBoard {
        let points = self.board.points();
        let centre = points.iter().fold(Vector3::zeros(), |sum, point| sum + point.coords) / points.len() as f64;
        let focal = self.camera.focal_lengths()[0];
        let depth = 0.025 * focal / square_px;
        let place = Vector3::new(middle[0] * depth / focal, middle[1] * depth / focal, depth);
        let rotation = rotation::exp(&turn);
        CameraFromBoard::new(rotation, place - rotation * centre)
    }

    fn frame(&self, pose: &CameraFromBoard, name: &str) -> Frame {
        render_sheet(&self.rays, pose, &self.sheet, &self.optics, &mut random::named(name))
    }

    fn truth(&self, pose: &CameraFromBoard) -> Vec<Pixel> {
        let seen = |point| self.camera.project(&(*pose * point)).unwrap_or_else(|| Vector2::repeat(f64::NAN));
        self.board.points().iter().copied().map(seen).collect()
    }

    fn found(&self, pose: &CameraFromBoard, name: &str) -> Vec<SeenPoint> {
        find(&self.frame(pose, name), &self.board).unwrap_or_else(|error| panic!("{name}: {error}"))
    }
}

/// Squares of error by deviation, one an axis; every point is the right one.
fn squares(found: &[SeenPoint], truth: &[Pixel]) -> Vec<f64> {
    let error = |seen: &SeenPoint| {
        let error = seen.pixel - truth[seen.point];
        assert!(error.norm() < 8.0 * seen.sigma_px, "{seen:?} {:?}", truth[seen.point]);
        0.5 * error.norm_squared() / seen.sigma_px.powi(2)
    };
    found.iter().map(error).collect()
}

fn rms(found: &[SeenPoint], truth: &[Pixel]) -> f64 {
    let sum: f64 = found.iter().map(|seen| (seen.pixel - truth[seen.point]).norm_squared()).sum();
    (0.5 * sum / found.len() as f64).sqrt()
}

#[test]
fn places_are_right_to_their_deviations() {
    let mut view = View::small();
    let sensors = [
        ("sharp", Optics::ideal(), None, 0.02),
        ("plain", view.optics, None, 0.015),
        ("mosaic and JPEG", Optics::default(), Some(80), 0.025),
        ("noise", Optics { shot_noise_ratio: 0.05, read_noise_ratio: 0.02, ..view.optics }, None, 0.035),
        ("defocus", Optics { blur_sigma_px: 3.0, ..view.optics }, None, 0.03),
        ("motion", Optics { motion_px: [4.0, -3.0], ..view.optics }, None, 0.03),
        ("overexposed", Optics { exposure_ratio: 2.0, ..view.optics }, None, 0.04),
        ("underexposed", Optics { exposure_ratio: 0.05, ..view.optics }, None, 0.04),
    ];
    let mut rng = random::named("poses of boards");
    let mut all = Vec::new();
    for (name, optics, quality, most) in sensors {
        view.optics = optics;
        let tilt = rng.random_range(0.3..0.6);
        let axis: f64 = rng.random_range(0.0..6.0);
        let turn = Vector3::new(tilt * axis.cos(), tilt * axis.sin(), rng.random_range(-0.5..0.5));
        let pose = view.pose(34.0, [rng.random_range(-8.0..8.0), rng.random_range(-8.0..8.0)], turn);
        let mut frame = view.frame(&pose, name);
        if let Some(quality) = quality {
            let file = encode::jpeg(&frame, quality).expect("a file");
            frame = Frame::decode(&file, &Decoding::default()).expect("a frame");
        }
        let found = find(&frame, &view.board).unwrap_or_else(|error| panic!("{name}: {error}"));
        let truth = view.truth(&pose);
        assert_eq!(found.len(), 42, "{name}");
        assert!(rms(&found, &truth) < most, "{name}: {} px", rms(&found, &truth));
        all.extend(squares(&found, &truth));
    }
    // Deviations hold what coding and aliasing may add, so they may be the larger, but not by more than twice.
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    assert!((0.25..1.5).contains(&mean), "{mean}");
}

#[test]
fn deviations_hold_for_gray_sensors_linear_ones_and_mosaics_sharp_and_soft() {
    let mut view = View::small();
    for (kind, bayer) in [("gray", None), ("linear", None), ("mosaic", Optics::default().bayer)] {
        for blur_sigma_px in [0.35, 1.0] {
            view.optics = Optics { bayer, blur_sigma_px, supersampling: 10, ..view.optics };
            let name = format!("{kind} {blur_sigma_px}");
            let mut rng = random::named(&name);
            let (mut all, mut errors) = (Vec::new(), 0.0);
            for number in 0..10 {
                let axis: f64 = rng.random_range(0.0..6.0);
                let turn =
                    Vector3::new(axis.cos(), axis.sin(), rng.random_range(-0.5..0.5)) * rng.random_range(0.3..0.6);
                let middle = [rng.random_range(-8.0..8.0), rng.random_range(-8.0..8.0)];
                let pose = view.pose(rng.random_range(28.0..36.0), middle, turn);
                let mut frame = view.frame(&pose, &format!("{name} {number}"));
                if bayer.is_none() {
                    let mut luma = Vec::new();
                    luma::take(&frame, frame.full(), &mut luma);
                    if kind == "linear" {
                        let lights = Tone::Curved.lights();
                        for code in &mut luma {
                            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
                            let light = lights[usize::from(*code)].round() as u8;
                            *code = light;
                        }
                    }
                    frame = Frame::checked(frame.width(), frame.height(), Pixels::Luma(luma), Coding::LOSSLESS)
                        .expect("a frame");
                }
                let found = find(&frame, &view.board).unwrap_or_else(|error| panic!("{name}: {error}"));
                let truth = view.truth(&pose);
                errors += rms(&found, &truth).powi(2) / 10.0;
                all.extend(squares(&found, &truth));
            }
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            // Corners of a row share what sampling does to its edge, so that ten pictures tell the mean to a third; deviations hold for edges along rows.
            assert!(all.len() > 400 && (0.25..1.7).contains(&mean), "{name}: {mean}");
            // In the wrong tone corners of a linear sensor err by 0.008 px, those of a gray one by 0.01 px.
            assert!(blur_sigma_px < 0.5 || errors.sqrt() < 0.007, "{name}: {} px", errors.sqrt());
        }
    }
}

#[test]
fn tilted_boards_are_found_and_never_mirrored() {
    let view = View::of([480, 400], 460.0, Distortion::None, "chessboard:7x6:0.025");
    for (index, axis) in [0.0_f64, 0.8, 1.7, 2.9, 4.1, 5.2].into_iter().enumerate() {
        let tilt = 1.2;
        let turn = Vector3::new(tilt * axis.cos(), tilt * axis.sin(), 0.0);
        let pose = view.pose(50.0, [0.0; 2], turn);
        let found = view.found(&pose, &format!("tilted {index}"));
        assert!(found.len() >= 40, "{index}: {}", found.len());
        squares(&found, &view.truth(&pose));
    }
}

#[test]
fn a_board_turned_any_way_has_the_order_that_its_colours_tell() {
    let view = View::small();
    for quarter in 0..8 {
        let turn = Vector3::new(0.0, 0.0, 0.2 + f64::from(quarter) * std::f64::consts::FRAC_PI_4);
        let pose = view.pose(30.0, [0.0; 2], turn);
        let found = view.found(&pose, "turned");
        assert_eq!(found.len(), 42);
        squares(&found, &view.truth(&pose));
    }
}

#[test]
fn where_colours_leave_two_or_four_orders_the_first_point_is_at_the_upper_left() {
    for board in ["chessboard:7x5:0.025", "chessboard:6x4:0.025", "chessboard:5x5:0.025", "chessboard:4x4:0.025"] {
        let view = View::of([400, 320], 380.0, Distortion::None, board);
        for quarter in 0..4 {
            let turn = Vector3::new(0.1, 0.2, 0.15 + f64::from(quarter) * std::f64::consts::FRAC_PI_2);
            let pose = view.pose(32.0, [0.0; 2], turn);
            let found = view.found(&pose, "alike");
            let truth = view.truth(&pose);
            assert_eq!(found.len(), truth.len());
            // Each corner is seen, whatever its number, and rows lie to the right of columns.
            for point in &truth {
                assert!(found.iter().any(|seen| (seen.pixel - point).norm() < 0.2), "{board} {quarter}");
            }
            let columns = if board.contains("7x5") { 7 } else { board.as_bytes()[11].wrapping_sub(b'0').into() };
            let [across, down] = [1, columns].map(|next: usize| found[next].pixel - found[0].pixel);
            assert!(across.perp(&down) > 0.0, "{board} {quarter}: mirrored");
            let sum = |seen: &SeenPoint| seen.pixel.x + seen.pixel.y;
            assert!(sum(&found[0]) < sum(&found[found.len() - 1]), "{board} {quarter}");
        }
    }
}

#[test]
fn a_fisheye_bends_lines_and_moves_no_corner() {
    let lens = Distortion::Equidistant([0.02, -0.005, 0.0, 0.0]);
    let view = View::of([480, 480], 150.0, lens, "chessboard:12x11:0.025");
    let pose = view.pose(28.0, [10.0, -6.0], Vector3::new(0.2, -0.15, 0.1));
    let found = view.found(&pose, "fisheye");
    assert_eq!(found.len(), 132);
    let truth = view.truth(&pose);
    assert!(rms(&found, &truth) < 0.03, "{}", rms(&found, &truth));
    squares(&found, &truth);
}

#[test]
fn small_squares_and_uneven_light_are_seen() {
    let mut view = View::small();
    let pose = view.pose(8.5, [40.0, 30.0], Vector3::new(0.2, 0.3, 0.1));
    let found = view.found(&pose, "small squares");
    assert_eq!(found.len(), 42);
    assert!(rms(&found, &view.truth(&pose)) < 0.06, "{}", rms(&found, &view.truth(&pose)));
    view.sheet.light_slope = [1.7, -0.2];
    let pose = view.pose(36.0, [0.0; 2], Vector3::new(-0.3, 0.2, 0.1));
    let found = view.found(&pose, "light slope");
    assert_eq!(found.len(), 42);
    assert!(rms(&found, &view.truth(&pose)) < 0.03, "{}", rms(&found, &view.truth(&pose)));
}

#[test]
fn large_squares_and_defocus_are_seen() {
    let mut view = View::of([1600, 1200], 1500.0, Distortion::None, "chessboard:7x6:0.025");
    view.optics = Optics { blur_sigma_px: 5.0, supersampling: 3, ..view.optics };
    let pose = view.pose(150.0, [0.0; 2], Vector3::new(0.2, -0.3, 0.1));
    let found = view.found(&pose, "large squares");
    assert_eq!(found.len(), 42);
    assert!(rms(&found, &view.truth(&pose)) < 0.05, "{}", rms(&found, &view.truth(&pose)));
}

#[test]
fn a_part_of_the_board_is_enough_where_the_picture_ends() {
    let view = View::small();
    for (middle, least) in [([110.0, 0.0], 18), ([-110.0, 20.0], 18), ([90.0, 90.0], 16), ([0.0, -120.0], 18)] {
        let pose = view.pose(36.0, middle, Vector3::new(0.1, 0.2, 0.05));
        let found = view.found(&pose, "cut off");
        let truth = view.truth(&pose);
        assert!((least..42).contains(&found.len()), "{middle:?}: {}", found.len());
        // The board's sides that are seen tell which part it is.
        squares(&found, &truth);
    }
}

#[test]
fn what_runs_out_of_the_picture_is_not_said_to_be_of_another_size() {
    let view = View::small();
    let mut cut_off = 0;
    for step in 0..10_i32 {
        let middle = [0.0, -100.0 - 15.0 * f64::from(step)];
        let pose = view.pose(36.0, middle, Vector3::new(0.1, 0.1, 0.0));
        match find(&view.frame(&pose, "runs out"), &view.board) {
            Err(NoBoard::CutOff {
                found_columns: 7, found_rows: 3, columns: 7, rows: 6, need: Need::Lines(4), ..
            }) => {
                cut_off += 1;
            }
            Err(NoBoard::NotSeen { .. }) | Ok(_) => {}
            Err(error) => panic!("{middle:?}: {error:?}"),
        }
    }
    assert!(cut_off > 0);
}

#[test]
fn a_board_larger_than_the_picture_gives_a_part_of_its_lattice() {
    let view = View::of([400, 320], 380.0, Distortion::None, "chessboard:20x19:0.025");
    let pose = view.pose(32.0, [5.0, 3.0], Vector3::new(0.1, 0.2, 0.05));
    let found = view.found(&pose, "all sides cut off");
    let truth = view.truth(&pose);
    assert!(found.len() >= 70, "{}", found.len());
    // Shifted by the same number of squares each, and at corners.
    let shift = |seen: &SeenPoint| {
        let nearest = (0..truth.len()).min_by(|a, b| {
            let far = |index: usize| (truth[index] - seen.pixel).norm();
            far(*a).total_cmp(&far(*b))
        });
        let nearest = nearest.expect("corners");
        assert!((truth[nearest] - seen.pixel).norm() < 0.2);
        [nearest % 20, nearest / 20].map(usize::cast_signed)
    };
    let place = |seen: &SeenPoint| [seen.point % 20, seen.point / 20].map(usize::cast_signed);
    let from = |seen: &SeenPoint| [0, 1].map(|k| shift(seen)[k] - place(seen)[k]);
    assert!(found.iter().all(|seen| from(seen) == from(&found[0])));
}

#[test]
fn corners_that_something_covers_are_left_out() {
    let mut view = View::small();
    view.sheet.obstacle = Some([0.5, 0.5, 0.06, 0.07]);
    let pose = view.pose(34.0, [0.0; 2], Vector3::new(0.2, -0.2, 0.1));
    let found = view.found(&pose, "covered");
    assert!((34..42).contains(&found.len()), "{}", found.len());
    squares(&found, &view.truth(&pose));
}

#[test]
fn a_board_of_another_size_is_told_with_its_size() {
    let view = View::small();
    let pose = view.pose(30.0, [0.0; 2], Vector3::new(0.2, -0.2, 0.1));
    let frame = view.frame(&pose, "another size");
    for (wanted, [columns, rows]) in [("chessboard:9x6:1", [9, 6]), ("chessboard:5x6:1", [5, 6])] {
        let error = find(&frame, &wanted.parse().expect("a board"));
        let [found_columns, found_rows] = if columns > rows { [7, 6] } else { [6, 7] };
        let pattern = "chessboard";
        assert_eq!(error, Err(NoBoard::OtherSize { pattern, found_columns, found_rows, columns, rows, cut: false }));
    }
}

#[test]
fn of_two_boards_none_is_taken_but_of_one_and_a_small_one_the_large() {
    let view = View::small();
    let squarely = Vector3::new(0.1, 0.1, 0.0);
    let [one, other] = [[-100.0, 0.0], [95.0, 10.0]].map(|middle| view.pose(19.0, middle, squarely));
    let [left, right] = [one, other].map(|pose| view.frame(&pose, "two boards"));
    let error = find(&beside(&left, &right), &view.board);
    assert_eq!(error, Err(NoBoard::Several { count: 2 }));
    let small = view.frame(&view.pose(9.0, [95.0, 10.0], squarely), "two boards");
    let found = find(&beside(&left, &small), &view.board).expect("the large one");
    assert_eq!(found.len(), 42);
    squares(&found, &view.truth(&one));
}

/// The left half of one frame and the right half of the other.
fn beside(left: &Frame, right: &Frame) -> Frame {
    let (width, height) = (left.width(), left.height());
    let [left, right] = [left, right].map(|frame| frame.rgb().into_owned());
    let half = 3 * width as usize / 2;
    let rows = left.chunks_exact(2 * half).zip(right.chunks_exact(2 * half));
    let samples = rows.flat_map(|(left, right)| [&left[..half], &right[half..]].concat()).collect();
    Frame::checked(width, height, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
}

#[test]
fn where_there_is_no_board_none_is_seen() {
    let board: Board = "chessboard:9x6:0.025".parse().expect("a board");
    let mut rng = random::named("no board");
    let (width, height) = (320_u32, 240_u32);
    let kinds: [&mut dyn FnMut(u32, u32) -> u8; 5] = [
        &mut |_, _| 90,
        &mut |_, _| rng.random(),
        // Stripes, single dots, and a weave.
        &mut |x, _| if x / 7 % 2 == 0 { 30 } else { 220 },
        &mut |x, y| if x % 5 == 0 && y % 5 == 0 { 30 } else { 220 },
        &mut |x, y| if (x * y + x) % 7 < 3 { 30 } else { 220 },
    ];
    for (index, kind) in kinds.into_iter().enumerate() {
        let mut samples = Vec::new();
        for y in 0..height {
            (0..width).for_each(|x| samples.push(kind(x, y)));
        }
        let frame = Frame::checked(width, height, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
        let error = find(&frame, &board);
        assert!(matches!(error, Err(NoBoard::NotSeen { found: 0..20, need: 54, .. })), "{index}: {error:?}");
    }
}
