//! Colours, sRGB. The markers are red and the sky is blue, so neither is used for a ring.

/// Axes x, y, z.
pub(super) const AXES: [[u8; 3]; 3] = [[255, 72, 64], [70, 235, 86], [110, 164, 255]];

/// Centroids of no target.
pub(super) const NO_TARGET: [u8; 3] = [255, 226, 64];

/// Places where a pose puts a marker.
pub(super) const PREDICTED: [u8; 3] = [255, 255, 255];

/// What was refused.
pub(super) const REFUSED: [u8; 3] = [186, 190, 194];

/// Under and around everything, so that it stands out from a bright frame.
pub(super) const DARK: [u8; 3] = [12, 14, 18];

/// The targets' colours, in the order in which they were asked for; then again from the first.
const TARGETS: [[u8; 3]; 5] = [[0, 232, 255], [255, 130, 255], [150, 255, 90], [255, 176, 64], [180, 170, 255]];

/// The colour of a target.
pub(super) const fn of_target(index: usize) -> [u8; 3] {
    TARGETS[index % TARGETS.len()]
}
