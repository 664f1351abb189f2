//! Annotated copies of frames.

use std::path::{Path, PathBuf};

use crate::annotate::{Overlay, annotate};
use crate::frame::Frame;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::FrameTask;

/// Where annotated frames go.
pub(super) enum Pictures {
    /// Nowhere.
    None,
    /// The one frame goes to this file.
    File(PathBuf),
    /// All go to this folder, as PNG under their own names.
    Folder(PathBuf),
}

impl Pictures {
    /// For `count` frames: a file for a single one if the name has an ending, a folder otherwise.
    pub(super) fn new(out: Option<&Path>, count: usize) -> Result<Self, Fault> {
        let Some(out) = out else { return Ok(Self::None) };
        if count == 1 && out.extension().is_some() && !out.is_dir() {
            return Ok(Self::File(out.to_owned()));
        }
        std::fs::create_dir_all(out).map_err(|error| super::inputs::unreadable(out, &error))?;
        Ok(Self::Folder(out.to_owned()))
    }

    /// Draws what was found in the frame of `source`.
    pub(super) fn write(
        &self,
        source: &Path,
        frame: &Frame,
        task: &FrameTask,
        overlay: &Overlay<'_>,
    ) -> Result<(), Fault> {
        let path = match self {
            Self::None => return Ok(()),
            Self::File(path) => path.clone(),
            Self::Folder(folder) => folder.join(source.file_name().unwrap_or_default()).with_extension("png"),
        };
        let picture = annotate(frame, task.camera(), overlay);
        picture.save(&path).map_err(|error| {
            let detail =
                format!("{}: {error} (annotated frames are written as PNG, BMP, TIFF, WebP or PNM)", path.display());
            Fault::new(FaultKind::Unreadable, detail)
        })
    }
}
