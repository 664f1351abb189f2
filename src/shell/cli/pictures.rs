//! Annotated copies of frames.

use std::collections::BTreeSet;
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
    /// All go to this folder, as PNG under their own names, with a number where the name is taken.
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What has been written.
        written: BTreeSet<PathBuf>,
    },
}

impl Pictures {
    /// For `count` frames: a file for a single one if the name has an ending, a folder otherwise.
    pub(super) fn new(out: Option<&Path>, count: usize) -> Result<Self, Fault> {
        let Some(out) = out else { return Ok(Self::None) };
        if count == 1 && out.extension().is_some() && !out.is_dir() {
            return Ok(Self::File(out.to_owned()));
        }
        std::fs::create_dir_all(out).map_err(|error| super::inputs::unreadable(out, &error))?;
        Ok(Self::Folder { folder: out.to_owned(), written: BTreeSet::new() })
    }

    /// Draws what was found in the frame of `source`, never over that file itself.
    pub(super) fn write(
        &mut self,
        source: &Path,
        frame: &Frame,
        task: &FrameTask,
        overlay: &Overlay<'_>,
    ) -> Result<(), Fault> {
        let path = match self {
            Self::None => return Ok(()),
            Self::File(path) => path.clone(),
            Self::Folder { folder, written } => {
                let stem = source.file_stem().unwrap_or_default().to_string_lossy();
                let names = std::iter::once(format!("{stem}.png")).chain((2..).map(|n| format!("{stem}-{n}.png")));
                let free = |path: &PathBuf| !written.contains(path) && !is_same(path, source);
                let path = names.map(|name| folder.join(name)).find(free).unwrap_or_default();
                written.insert(path.clone());
                path
            }
        };
        if is_same(&path, source) {
            let detail = format!("{}: the annotated frame would replace the frame itself", path.display());
            return Err(Fault::new(FaultKind::Conflict, detail));
        }
        let picture = annotate(frame, task.camera(), overlay);
        picture.save(&path).map_err(|error| {
            let detail =
                format!("{}: {error} (annotated frames are written as PNG, BMP, TIFF, WebP or PNM)", path.display());
            Fault::new(FaultKind::Unreadable, detail)
        })
    }
}

/// Whether both are the same existing file.
fn is_same(a: &Path, b: &Path) -> bool {
    a.canonicalize().ok().zip(b.canonicalize().ok()).is_some_and(|(a, b)| a == b)
}
