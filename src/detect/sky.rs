//! Things in the sky without markers.

pub mod camera_motion;
pub mod candidate;
pub mod cells;
pub mod change;
pub mod level;
pub mod outline;
pub mod silhouette;
pub mod track;
pub mod watch;

pub use watch::Watch;
