//! Real pictures of boards, where they are at hand.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::fs;

use skypose::board::Board;
use skypose::calibrate::find::find;
use skypose::frame::{Decoding, Frame};

/// OpenCV's thirteen pictures of a board of 9 x 6 inner corners; one of them also shows itself on a screen.
const PICTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/chessboard");

#[test]
fn the_board_is_seen_whole_in_every_real_picture() {
    let Ok(folder) = fs::read_dir(PICTURES) else {
        println!("skipped: there are no pictures in {PICTURES}");
        return;
    };
    let board: Board = "chessboard:9x6:1".parse().expect("a board");
    for path in folder.map(|entry| entry.expect("an entry").path()) {
        if path.extension().is_none_or(|ending| ending != "jpg") {
            continue;
        }
        let name = path.display();
        let frame = Frame::decode(&fs::read(&path).expect("a file"), &Decoding::default()).expect("a picture");
        let found = find(&frame, &board).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(found.len(), 54, "{name}");
        // OpenCV's calibration leaves 0.2 px of its own corners, most of it the board's: paper is not flat.
        let worst = found.iter().map(|seen| seen.sigma_px).fold(0.0, f64::max);
        assert!(worst < 0.15, "{name}: {worst}");
        // Rows lie to the right of columns, and lines are nearly straight: no corner is another's.
        let pixel = |column: usize, row: usize| found[row * 9 + column].pixel;
        for row in 0..6 {
            for column in 1_usize..8 {
                let [before, here, after] = [-1, 0, 1].map(|step| pixel(column.saturating_add_signed(step), row));
                let bend = (before + after - 2.0 * here).norm() / (after - before).norm();
                assert!(bend < 0.05, "{name}: {column} {row}: {bend}");
            }
        }
        assert!((pixel(8, 0) - pixel(0, 0)).perp(&(pixel(0, 5) - pixel(0, 0))) > 0.0, "{name}: mirrored");
    }
}
