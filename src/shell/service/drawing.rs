//! Pictures as pages have them.

use crate::plot::Picture;

/// A picture in a page.
pub(super) struct Drawing {
    /// What it shows.
    pub caption: String,
    /// The picture.
    pub svg: String,
    /// Whether it wants the whole width.
    pub is_wide: bool,
}

impl From<&Picture> for Drawing {
    fn from(picture: &Picture) -> Self {
        Self { caption: picture.caption.clone(), svg: picture.figure.svg(), is_wide: picture.figure.panels.len() > 1 }
    }
}
