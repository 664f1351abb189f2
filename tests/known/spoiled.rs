//! Pictures of which no calibration can make use, each with words of the reason that is to be told; and good ones among them.

use nalgebra::{Rotation3, Vector3};
use skypose::board::Board;
use skypose::camera::{Camera, Distortion};
use skypose::frame::{Coding, Frame, Pixels};
use skypose::geometry::CameraFromBoard;
use skypose::random::named;
use skypose::scene::boards::{STUDY_LENSES, pose_in_view, study_camera};
use skypose::scene::encode::{jpeg, png};
use skypose::scene::render::{Optics, Rays, Sheet, render_sheet};

/// The board that the others are to show.
pub const BOARD: &str = "chessboard:9x6:0.025";

/// A picture: its name, its bytes, and words of the reason for which it is left out; empty for a good one.
pub type Picture = (&'static str, Vec<u8>, &'static str);

/// A board squarely before a pinhole, its middle so far to the right.
fn held(text: &str, right_m: f64) -> Frame {
    let board: Board = text.parse().expect("a board");
    let camera = study_camera(Distortion::None);
    let [least, greatest] = board.sheet();
    let middle = (0.5 * (least + greatest)).push(0.0);
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), 0.2);
    let pose = CameraFromBoard::new(turn, Vector3::new(right_m, 0.0, 0.9) - turn * middle);
    render_sheet(&Rays::of(&camera), &pose, &Sheet::of(&board), &Optics::default(), &mut named(text))
}

/// Two boards, one in each half.
fn two() -> Frame {
    let [left, right] = [-0.22, 0.22].map(|place| held(BOARD, place));
    let (width, height) = (left.width(), left.height());
    let (left, right) = (left.rgb(), right.rgb());
    let is_left = |at: usize| at / 3 % (width as usize) < width as usize / 2;
    let mixed = (0..left.len()).map(|at| if is_left(at) { left[at] } else { right[at] }).collect();
    Frame::checked(width, height, Pixels::Rgb(mixed), Coding::LOSSLESS).expect("a frame")
}

fn wall() -> Frame {
    Frame::checked(640, 480, Pixels::Luma(vec![128; 640 * 480]), Coding::LOSSLESS).expect("a frame")
}

/// A good picture of a camera of another size.
fn small() -> Frame {
    let board: Board = BOARD.parse().expect("a board");
    let camera = Camera::checked([480, 360], [400.0; 2], [239.5, 179.5], Distortion::None).expect("a camera");
    let mut rng = named("a smaller camera");
    let pose = pose_in_view(&camera, &board, &mut rng);
    render_sheet(&Rays::of(&camera), &pose, &Sheet::of(&board), &Optics::default(), &mut rng)
}

/// Seven good ones through a bent lens, and those that are not.
pub fn pictures() -> Vec<Picture> {
    let board: Board = BOARD.parse().expect("a board");
    let camera = study_camera(STUDY_LENSES[1]);
    let (rays, mut rng) = (Rays::of(&camera), named("good ones among the spoiled"));
    let names = ["good0.jpg", "good1.jpg", "good2.jpg", "good3.jpg", "good4.jpg", "good5.jpg", "good6.jpg"];
    let mut pictures: Vec<Picture> = names
        .into_iter()
        .map(|name| {
            let pose = pose_in_view(&camera, &board, &mut rng);
            let frame = render_sheet(&rays, &pose, &Sheet::of(&board), &Optics::default(), &mut rng);
            (name, jpeg(&frame, 92).expect("encodes"), "")
        })
        .collect();
    let encoded = |frame: &Frame| png(frame).expect("encodes");
    pictures.extend([
        ("dot.pgm", b"P5 1 1 255\n\0".to_vec(), "1 x 1"),
        ("eight.png", encoded(&held("chessboard:8x6:0.025", 0.0)), "a chessboard of 8 x 6 is seen, not of 9 x 6"),
        ("notes.png", b"I am a text".to_vec(), "not a picture"),
        ("small.png", encoded(&small()), "it is 480 x 360 px, most pictures are 640 x 480 px"),
        ("two.png", encoded(&two()), "2 boards are seen"),
        ("wall.png", encoded(&wall()), "no chessboard is seen"),
    ]);
    pictures
}
