//! Sets whose errors go together within a view, with known truth.

use crate::calibrate::estimate::calibrate;
use crate::calibrate::estimate::tests::{
    SIZE, chessboard, lenses, options, parameter_chi_square, truth, views, views_of_a_bent_board,
};
use crate::random::case;

#[test]
fn a_board_that_bends_anew_for_each_view_widens_the_deviations_by_as_much() {
    let (board, lens) = (chessboard(), lenses()[1]);
    let camera = truth(lens);
    let size = (4 + lens.coefficients().len()) as f64;
    let sets = 40;
    let (mut chi_square, mut independent) = (0.0, 0.0);
    for set in 0..sets {
        let views = views_of_a_bent_board(&camera, &board, 14, 0.03, &mut case("bent boards", set));
        let found = calibrate(SIZE, &board, &views, &options(lens)).expect("a camera");
        let square = parameter_chi_square(&found.camera, &camera) / size / sets as f64;
        chi_square += square;
        independent += square * found.design_effect;
    }
    // As if errors were independent, these are off by a multiple.
    assert!(independent > 2.5, "{independent}");
    // Fourteen views tell their covariance only roughly, and squares in units of it have a long tail.
    assert!((0.6..1.6).contains(&chi_square), "{chi_square}");
}

#[test]
fn independent_errors_are_taken_for_what_they_are() {
    let board = chessboard();
    for lens in lenses().into_iter().take(2) {
        let camera = truth(lens);
        let taken = (0..50).filter(|set| {
            let mut rng = case("independent errors", *set);
            let views = views(&camera, &board, 9, 0.2, &mut rng);
            calibrate(SIZE, &board, &views, &options(lens)).expect("a camera").design_effect > 1.0
        });
        let taken = taken.count();
        assert!(taken <= 2, "{}: {taken} of 50", lens.name());
    }
}
