//! Annotated copies of frames.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use image::ImageFormat;

use crate::annotate::{Overlay, annotate};
use crate::frame::Frame;
use crate::scene::encode;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::service::compute::FrameTask;

/// What annotated frames are written as.
const FORMATS: [ImageFormat; 6] =
    [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::Bmp, ImageFormat::Tiff, ImageFormat::WebP, ImageFormat::Pnm];

/// Of a JPEG.
const QUALITY: u8 = 92;

/// Where annotated frames go; never over the frames themselves.
pub(super) enum Pictures {
    /// Nowhere.
    None,
    /// The one frame goes to this file.
    File(PathBuf),
    /// All go to this folder, as PNG under their own names, with a number where that is taken.
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The frames, and what has been written.
        taken: BTreeSet<PathBuf>,
    },
}

impl Pictures {
    /// For these frames: a file for a single one if the name has an ending, a folder otherwise.
    pub(super) fn new(out: Option<&Path>, sources: &[&Path], is_single: bool) -> Result<Self, Fault> {
        let Some(out) = out else { return Ok(Self::None) };
        let taken: BTreeSet<PathBuf> = sources.iter().filter_map(|source| source.canonicalize().ok()).collect();
        if is_single && out.extension().is_some() && !out.is_dir() {
            if out.canonicalize().is_ok_and(|out| taken.contains(&out)) {
                let detail = format!("{}: the annotated frame would replace the frame itself", out.display());
                return Err(Fault::new(FaultKind::Conflict, detail));
            }
            // Before anything is opened, as opening empties the file.
            let format = ImageFormat::from_path(out).ok().filter(|format| FORMATS.contains(format));
            if format.is_none() {
                let detail =
                    format!("{}: annotated frames are written as PNG, JPEG, BMP, TIFF, WebP or PNM", out.display());
                return Err(Fault::new(FaultKind::Senseless, detail));
            }
            return Ok(Self::File(out.to_owned()));
        }
        std::fs::create_dir_all(out).map_err(|error| super::inputs::unreadable(out, &error))?;
        let folder = out.canonicalize().map_err(|error| super::inputs::unreadable(out, &error))?;
        Ok(Self::Folder { folder, taken })
    }

    /// Draws what was found in the frame of `source`.
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
            Self::Folder { folder, taken } => {
                let stem = source.file_stem().unwrap_or_default().to_string_lossy();
                let mut path = folder.join(format!("{stem}.png"));
                let mut number = 1;
                while !taken.insert(path.clone()) {
                    number += 1;
                    path = folder.join(format!("{stem}-{number}.png"));
                }
                path
            }
        };
        let picture = annotate(frame, task.camera(), overlay);
        let failed =
            |error: &dyn std::fmt::Display| Fault::new(FaultKind::Unreadable, format!("{}: {error}", path.display()));
        if ImageFormat::from_path(&path).is_ok_and(|format| format == ImageFormat::Jpeg) {
            let frame = Frame::from_rgb_image(picture).map_err(|error| failed(&error))?;
            let bytes = encode::jpeg(&frame, QUALITY).map_err(|error| failed(&error))?;
            return std::fs::write(&path, bytes).map_err(|error| failed(&error));
        }
        picture.save(&path).map_err(|error| failed(&error))
    }
}
