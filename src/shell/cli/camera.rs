//! `skypose camera`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use super::Stop;
use super::inputs::camera_of;
use super::outputs::write;
use crate::shell::console::print_line;
use crate::shell::fault::Fault;
use crate::shell::wire::{CameraFormat, DerivedCameraWire, write_camera};

#[derive(Args, Debug)]
pub(super) struct CameraFile {
    /// The camera: JSON, YAML of the calibration of ROS, or YAML or XML of OpenCV's FileStorage, told by what is in it.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// json, ros, opencv-yaml or opencv-xml. Covariances are in JSON only.
    #[arg(long, value_name = "FORMAT", default_value = "json", value_parser = CameraFormat::of_name)]
    to: CameraFormat,
    /// Where it goes; without it, or as -, to standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The camera of this part of its pictures: x, y, width, height, px.
    #[arg(long, value_name = "X,Y,W,H", allow_hyphen_values = true)]
    crop: Option<Numbers<4>>,
    /// The camera of its pictures, or of the part, at another size, px.
    #[arg(long, value_name = "WxH")]
    size: Option<Numbers<2>>,
}

/// Whole numbers with `,` or `x` between.
#[derive(Clone, Copy, Debug)]
struct Numbers<const N: usize>([u32; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers: Option<Vec<u32>> = text.split([',', 'x']).map(|part| part.trim().parse().ok()).collect();
        let wrong = || format!("{N} whole numbers are needed, not {text:?}");
        numbers.and_then(|numbers| numbers.try_into().ok()).map(Self).ok_or_else(wrong)
    }
}

impl CameraFile {
    pub(super) fn run(self) -> Result<(), Stop> {
        let name = self.file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let given = camera_of(&self.file)?;
        let [width, height] = [0, 1].map(|side| self.size.map(|Numbers(size)| size[side]));
        let crop_px = self.crop.map(|Numbers(crop)| crop);
        let camera = if crop_px.is_some() || width.is_some() {
            DerivedCameraWire { derived_from: name.clone(), crop_px, width, height }.of(&given)
        } else {
            given.checked()
        };
        let in_file =
            |fault: Fault| Fault { detail: format!("{}: {fault}", self.file.display()), pointer: None, ..fault };
        let camera = camera.map_err(in_file)?;
        let text = write_camera(&camera, &name, self.to)?;
        match &self.out {
            Some(path) => write(path, &text),
            None => Ok(print_line(text.trim_end())?),
        }
    }
}
