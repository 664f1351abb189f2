use super::super::views::{BARREL, FISHEYE, PINHOLE, View, judged, noise};
use super::super::{NoBoard, find};

const SHEET: &str = "dots:120:0.25x0.18:0.003";

#[test]
fn dots_are_told_apart_however_the_sheet_is_tilted_and_turned() {
    for (board, lens, most_tilt_deg) in [
        (SHEET, PINHOLE, 60.0),
        (SHEET, BARREL, 50.0),
        (SHEET, FISHEYE, 50.0),
        ("dots:20:0.25x0.18:0.006", PINHOLE, 60.0),
        ("dots:400:0.25x0.18:0.002:3", PINHOLE, 40.0),
    ] {
        let mut errors = Vec::new();
        for index in 0..6_u32 {
            let i = f64::from(index);
            let tilt_deg = most_tilt_deg * i / 5.0;
            let view = View { tilt_deg, way_deg: 77.0 * i, turn_deg: 61.0 * i, fill: 0.85, ..View::of(board, lens) };
            let seen = view.seen(u64::from(index)).unwrap_or_else(|error| panic!("{board} {index}: {error}"));
            assert!(seen.len() * 20 >= view.in_view() * 17, "{board} {index}: {} of {}", seen.len(), view.in_view());
            errors.extend(view.errors(&seen));
        }
        let (mean_square, largest) = judged(&errors);
        assert!((0.2..1.8).contains(&mean_square), "{board}: {mean_square}");
        // None is taken for another: those are more than ten pixels off.
        assert!(largest < 0.6, "{board}: {largest}");
    }
}

#[test]
fn an_object_on_the_sheet_and_the_pictures_border_hide_only_what_is_behind_them() {
    let mut view = View { tilt_deg: 30.0, ..View::of(SHEET, PINHOLE) };
    view.sheet.obstacle = Some([0.5, 0.45, 0.17, 0.2]);
    let seen = view.seen(11).expect("the sheet");
    assert!((50..100).contains(&seen.len()), "{}", seen.len());
    assert!(judged(&view.errors(&seen)).1 < 1.0);
    let aside = View { middle: [0.35, 0.2], turn_deg: 200.0, tilt_deg: 30.0, ..View::of(SHEET, PINHOLE) };
    let seen = aside.seen(12).expect("the sheet");
    assert!(seen.len() * 10 >= aside.in_view() * 9 && seen.len() < 110, "{} of {}", seen.len(), aside.in_view());
    assert!(judged(&aside.errors(&seen)).1 < 0.6);
}

#[test]
fn what_is_not_the_sheet_is_not_seen() {
    let view = View::of(SHEET, PINHOLE);
    let other = View::of("dots:120:0.25x0.18:0.003:5", PINHOLE);
    let grid = View::of("circles:10x8:0.03", PINHOLE);
    let frame = view.frame(13);
    let rgb = frame.rgb();
    let mirrored = rgb.chunks_exact(3 * 520).flat_map(|row| row.chunks_exact(3).rev().flatten().copied()).collect();
    let mirrored =
        crate::frame::Frame::checked(520, 400, crate::frame::Pixels::Rgb(mirrored), crate::frame::Coding::LOSSLESS);
    for (what, frame) in [
        ("other dots", other.frame(14)),
        ("a grid", grid.frame(15)),
        ("noise", noise()),
        ("a mirror", mirrored.expect("a frame")),
    ] {
        assert!(matches!(find(&frame, &view.board), Err(NoBoard::NotSeen { pattern: "board of dots", .. })), "{what}");
    }
}
