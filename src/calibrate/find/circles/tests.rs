use super::super::views::{BARREL, FISHEYE, PINHOLE, View, judged, noise};
use super::super::{NoBoard, find};
use super::PATTERN;
use crate::calibrate::SeenPoint;
use crate::frame::{Coding, Frame, Pixels};

const GRID: &str = "circles:7x5:0.03";
const ASYMMETRIC: &str = "asymmetric-circles:4x11:0.02";

/// Whether columns turn into rows from x to y, as on the sheet: a mirrored order would turn the other way.
fn is_right_handed(seen: &[SeenPoint], columns: usize) -> bool {
    let at = |point: usize| seen.iter().find(|seen| seen.point == point).map(|seen| seen.pixel);
    let turn = |point: usize| {
        let corner = at(point)?;
        Some((at(point + 1)? - corner).perp(&(at(point + 2 * columns)? - corner)) > 0.0)
    };
    let turns: Vec<bool> =
        seen.iter().filter(|seen| (seen.point + 1) % columns > 0).filter_map(|seen| turn(seen.point)).collect();
    !turns.is_empty() && turns.iter().all(|turn| *turn)
}

#[test]
fn discs_are_within_their_deviations_however_the_board_is_tilted_and_turned() {
    for (board, columns, lens) in
        [(GRID, 7, PINHOLE), (ASYMMETRIC, 4, PINHOLE), (GRID, 7, BARREL), (ASYMMETRIC, 4, FISHEYE)]
    {
        let mut errors = Vec::new();
        for index in 0..8_u32 {
            let i = f64::from(index);
            let mut view = View { tilt_deg: 8.0 * i, way_deg: 77.0 * i, fill: 0.6, ..View::of(board, lens) };
            // A symmetric grid, and one of an even number of rows, looks the same turned by half: less than that here.
            view.turn_deg = if columns == 7 { 20.0 * i - 70.0 } else { 45.0 * i };
            view.sheet.light_slope = [0.1 * i, -0.08 * i];
            let seen = view.seen(u64::from(index)).unwrap_or_else(|error| panic!("{board} {index}: {error}"));
            assert_eq!(seen.len(), view.board.points().len(), "{board} {index}");
            assert!(is_right_handed(&seen, columns), "{board} {index}");
            errors.extend(view.errors(&seen));
        }
        let (mean_square, largest) = judged(&errors);
        // The deviation holds what no two pictures share, as aliasing does: it may be the larger.
        assert!((0.2..1.5).contains(&mean_square), "{board}: {mean_square}");
        // Half a pixel: at the edge of the fisheye a disc is three pixels wide.
        assert!(largest < 0.5, "{board}: {largest}");
    }
}

#[test]
fn point_zero_is_the_one_at_the_top_left_where_the_board_leaves_a_choice() {
    for turn_deg in [-150.0, -100.0, -30.0, 40.0, 80.0, 120.0, 170.0] {
        let view = View { turn_deg, ..View::of(GRID, PINHOLE) };
        let seen = view.seen(1).expect("the board");
        assert!(is_right_handed(&seen, 7), "{turn_deg}");
        let corner = |point: usize| seen[point].pixel.x + seen[point].pixel.y;
        assert!(corner(0) <= corner(34), "{turn_deg}");
    }
}

#[test]
fn a_board_partly_out_of_the_picture_is_seen_in_part() {
    for (board, columns) in [(GRID, 7), (ASYMMETRIC, 4)] {
        let view = View { middle: [0.33, 0.1], turn_deg: 5.0, tilt_deg: 25.0, ..View::of(board, PINHOLE) };
        let seen = view.seen(2).unwrap_or_else(|error| panic!("{board}: {error}"));
        assert!(seen.len() + 6 > view.in_view() && seen.len() < view.board.points().len(), "{board}: {}", seen.len());
        assert!(is_right_handed(&seen, columns), "{board}");
        assert!(seen.iter().all(|seen| seen.point < view.board.points().len()));
        // Which point is which is open by a shift, but the same for all: the steps between two are those of the truth.
        let truth = view.truth();
        for pair in seen.windows(2) {
            let nearest = |seen: &SeenPoint| {
                let off = |at: &usize| truth[*at].map_or(f64::INFINITY, |pixel| (pixel - seen.pixel).norm());
                (0..truth.len()).min_by(|a, b| off(a).total_cmp(&off(b))).expect("a point")
            };
            let (a, b) = (nearest(&pair[0]), nearest(&pair[1]));
            assert!((truth[a].expect("in view") - pair[0].pixel).norm() < 0.2);
            assert_eq!(b - a, pair[1].point - pair[0].point, "{board}");
        }
    }
}

#[test]
fn what_stands_before_the_board_leaves_a_hole() {
    for (board, need) in [(GRID, 24), (ASYMMETRIC, 30)] {
        let mut view = View { tilt_deg: 20.0, ..View::of(board, PINHOLE) };
        view.sheet.obstacle = Some([0.47, 0.52, 0.07, 0.09]);
        let seen = view.seen(3).unwrap_or_else(|error| panic!("{board}: {error}"));
        assert!(seen.len() >= need && seen.len() < view.board.points().len(), "{board}: {}", seen.len());
        let (_, largest) = judged(&view.errors(&seen));
        assert!(largest < 0.5, "{board}: {largest}");
    }
}

#[test]
fn another_size_two_boards_and_none_are_told_apart() {
    let larger = View { turn_deg: 0.0, ..View::of("circles:8x6:0.03", PINHOLE) };
    let frame = larger.frame(4);
    let size = |board: &str| find(&frame, &board.parse().expect("a board"));
    let expected =
        NoBoard::OtherSize { pattern: PATTERN, found_columns: 8, found_rows: 6, columns: 7, rows: 5, cut: false };
    assert_eq!(size(GRID), Err(expected));
    assert!(matches!(size("circles:9x7:0.03"), Err(NoBoard::OtherSize { found_columns: 8, found_rows: 6, .. })));
    assert!(size("circles:8x6:0.03").is_ok());

    let half = |x: f64| View { middle: [x, 0.0], fill: 0.4, ..View::of(GRID, PINHOLE) };
    let (left, right) = (half(-0.25), half(0.25));
    let [left_rgb, right_rgb] = [left.frame(5), right.frame(6)].map(|frame| frame.rgb().into_owned());
    let samples = left_rgb.iter().zip(&right_rgb).enumerate();
    let both = samples.map(|(i, (l, r))| if i / 3 % 520 < 260 { *l } else { *r }).collect();
    let both = Frame::checked(520, 400, Pixels::Rgb(both), Coding::LOSSLESS).expect("a frame");
    assert_eq!(find(&both, &left.board), Err(NoBoard::Several { count: 2 }));

    let nothing = View { middle: [3.0, 0.0], ..View::of(GRID, PINHOLE) };
    assert_eq!(nothing.seen(7), Err(NoBoard::NotSeen { pattern: PATTERN, found: 0, need: 35 }));
    assert!(matches!(find(&noise(), &nothing.board), Err(NoBoard::NotSeen { .. })));
    let dots = View::of("dots:150:0.25x0.18:0.003", PINHOLE);
    assert!(matches!(find(&dots.frame(8), &nothing.board), Err(NoBoard::NotSeen { .. })));
}

#[test]
fn a_few_blobs_beside_a_whole_board_make_no_larger_one_and_a_whole_line_does() {
    let view = View { turn_deg: 4.0, fill: 0.55, ..View::of(GRID, PINHOLE) };
    let at: Vec<_> = view.truth().into_iter().map(|pixel| pixel.expect("in view")).collect();
    let with = |rows: &[usize]| {
        let mut samples = view.frame(9).rgb().into_owned();
        for row in rows {
            let last = at[7 * row + 6];
            let step = last - at[7 * row + 5];
            for (index, pixel) in samples.chunks_exact_mut(3).enumerate() {
                let place = crate::camera::Pixel::new((index % 520) as f64, (index / 520) as f64);
                if (place - last - step).norm() < 0.3 * step.norm() {
                    pixel.fill(20);
                }
            }
        }
        Frame::checked(520, 400, Pixels::Rgb(samples), Coding::LOSSLESS).expect("a frame")
    };
    for rows in [&[][..], &[1, 2], &[0, 4]] {
        let seen = find(&with(rows), &view.board).unwrap_or_else(|error| panic!("{rows:?}: {error}"));
        assert_eq!(seen.len(), 35, "{rows:?}");
    }
    let larger = find(&with(&[0, 1, 2, 3, 4]), &view.board);
    assert!(matches!(larger, Err(NoBoard::OtherSize { found_columns: 8, found_rows: 5, .. })), "{larger:?}");
}

#[test]
fn what_runs_out_of_the_picture_is_not_said_to_be_of_another_size() {
    // Of which two or three rows are less than is needed.
    let mut cut_off = 0;
    for board in ["circles:11x9:0.02", ASYMMETRIC] {
        for step in 0..12_u64 {
            let middle = [0.0, 0.3 + 0.04 * step as f64];
            let view = View { middle, turn_deg: 3.0, ..View::of(board, PINHOLE) };
            match view.seen(20 + step) {
                Err(NoBoard::CutOff { found_columns, found_rows, columns, rows, .. }) => {
                    assert!(found_columns <= columns && found_rows < rows, "{board}: {found_columns} x {found_rows}");
                    cut_off += 1;
                }
                Err(NoBoard::OtherSize { cut, .. }) => assert!(cut, "{board} {middle:?}"),
                Err(NoBoard::NotSeen { .. }) | Ok(_) => {}
                Err(error) => panic!("{board}: {error}"),
            }
        }
    }
    assert!(cut_off > 0);
}
