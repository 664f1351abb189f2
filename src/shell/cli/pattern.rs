//! `skypose pattern`.

use std::ffi::OsStr;
use std::path::PathBuf;

use clap::Args;

use super::Stop;
use super::inputs::{pattern_of, unwritable};
use super::outputs::{one_is_printed, write};
use crate::board::{Paper, Print};
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::wire::PatternWire;

pub(super) const EXAMPLES: &str = "\
Patterns, lengths in metres:
  chessboard:COLUMNSxROWS:SQUARE                    counted by inner corners
  circles:COLUMNSxROWS:SPACING[:RADIUS]             radius 0.3 of the spacing unless given
  asymmetric-circles:COLUMNSxROWS:SPACING[:RADIUS]  every other row shifted, as in OpenCV
  dots:COUNT:WIDTHxHEIGHT:RADIUS[:SEED]             at random places
  aprilgrid:COLUMNSxROWS:TAG[:GAP]                  tags 36h11 as Kalibr prints them; gap 0.3 of the tag unless given
  FILE.json                                         a description, as --description writes it

Example:
  skypose pattern chessboard:9x6:0.025 --out board.pdf";

#[derive(Args, Debug)]
pub(super) struct PatternSheet {
    /// The pattern, or the JSON file that describes one.
    #[arg(value_name = "PATTERN")]
    pattern: String,
    /// Where the sheet goes, as SVG or PDF by its ending; may be given several times. Without it the SVG is printed.
    #[arg(long, value_name = "FILE.svg|FILE.pdf")]
    out: Vec<PathBuf>,
    /// Write the pattern as JSON, as the HTTP API takes it and as commands read it in place of a pattern.
    #[arg(long, value_name = "FILE.json")]
    description: Option<PathBuf>,
    /// a4, a3, letter, or WIDTHxHEIGHT in mm [default: the smaller of a4 and a3 that holds it, or else its own size].
    #[arg(long, value_name = "PAPER")]
    paper: Option<Paper>,
}

impl PatternSheet {
    pub(super) fn run(self) -> Result<(), Stop> {
        let (pattern, board) = pattern_of(&self.pattern)?;
        let senseless =
            |error: &dyn std::error::Error| Fault::new(FaultKind::Senseless, format!("{}: {error}", self.pattern));
        let print = Print::checked(&board, &pattern.text(), self.paper).map_err(|error| senseless(&error))?;
        let mut files: Vec<(&PathBuf, Vec<u8>)> = Vec::new();
        for path in &self.out {
            let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
            let bytes = match ending.as_str() {
                "svg" => print.svg().into_bytes(),
                "pdf" => print.pdf().map_err(|error| senseless(&error))?,
                _ => {
                    let detail = format!("{}: a sheet is written as .svg or .pdf", path.display());
                    return Err(Fault::new(FaultKind::Senseless, detail).into());
                }
            };
            files.push((path, bytes));
        }
        let is_described = one_is_printed([("--description", self.description.as_deref())])?;
        if let Some(path) = &self.description {
            let json = serde_json::to_string(&PatternWire::from(&board))
                .map_err(|error| Fault::new(FaultKind::Internal, error.to_string()))?;
            write(path, &json)?;
        }
        for (path, bytes) in files {
            std::fs::write(path, bytes).map_err(|error| unwritable(path, &error))?;
        }
        if self.out.is_empty() && !is_described {
            print_line(print.svg().trim_end())?;
        }
        Ok(())
    }
}
