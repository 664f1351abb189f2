//! Planes in a pipe: YUV4MPEG2, a line of text with the size and the format, then for each frame a line `FRAME` and its planes.

use std::io::{self, BufRead, Read};

use crate::frame::Planar;

/// Longest line that is read.
const MAX_LINE: u64 = 1024;

/// What all frames have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) planar: Planar,
}

impl Header {
    /// The first line; none if there is nothing.
    pub(super) fn read(pipe: &mut impl BufRead) -> io::Result<Option<Self>> {
        let Some(line) = line_of(pipe)? else { return Ok(None) };
        let strange = || io::Error::new(io::ErrorKind::InvalidData, format!("not a header of video: {line:?}"));
        let words = line.strip_prefix("YUV4MPEG2 ").ok_or_else(strange)?;
        let word = |name: char| words.split(' ').find_map(|word| word.strip_prefix(name));
        let size = |name| word(name).and_then(|size| size.parse().ok());
        let planar = match word('C') {
            Some("mono") => Some(Planar::Mono),
            Some("444") => Some(Planar::Full),
            Some("422") => Some(Planar::Pairs),
            Some("420mpeg2" | "420paldv") => Some(Planar::Squares { on_left: true }),
            Some("420jpeg" | "420") | None => Some(Planar::Squares { on_left: false }),
            Some(_) => None,
        };
        match (size('W'), size('H'), planar) {
            (Some(width), Some(height), Some(planar)) => Ok(Some(Self { width, height, planar })),
            _ => Err(strange()),
        }
    }

    /// Reads one frame into `planes`, whatever they held; false at the end.
    pub(super) fn read_frame(self, pipe: &mut impl BufRead, planes: &mut Vec<u8>) -> io::Result<bool> {
        let Some(line) = line_of(pipe)? else { return Ok(false) };
        if line != "FRAME" && !line.starts_with("FRAME ") {
            return Err(io::Error::new(io::ErrorKind::InvalidData, format!("not a frame: {line:?}")));
        }
        let count = self.planar.byte_count(self.width, self.height);
        planes.clear();
        if pipe.take(count).read_to_end(planes)? as u64 != count {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        Ok(true)
    }
}

/// A line without its end; none where nothing comes.
fn line_of(pipe: &mut impl BufRead) -> io::Result<Option<String>> {
    let mut line = Vec::new();
    if pipe.by_ref().take(MAX_LINE).read_until(b'\n', &mut line)? == 0 {
        return Ok(None);
    }
    if line.pop() != Some(b'\n') {
        return Err(io::ErrorKind::UnexpectedEof.into());
    }
    Ok(Some(String::from_utf8_lossy(&line).into_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MONO: Header = Header { width: 4, height: 1, planar: Planar::Mono };

    #[test]
    fn a_header_and_its_frames_are_read_to_the_end() {
        let mut pipe: &[u8] = b"YUV4MPEG2 W4 H1 F25:1 Ip A1:1 Cmono XCOLORRANGE=FULL\nFRAME\nabcdFRAME Ixyz\nefgh";
        let header = Header::read(&mut pipe).expect("reads").expect("a header");
        assert_eq!(header, MONO);
        let mut planes = Vec::new();
        for wanted in [b"abcd", b"efgh"] {
            assert!(header.read_frame(&mut pipe, &mut planes).expect("reads"));
            assert_eq!(planes, wanted);
        }
        assert!(!header.read_frame(&mut pipe, &mut planes).expect("reads"));
    }

    #[test]
    fn what_is_cut_off_or_out_of_step_is_an_error_and_nothing_is_nothing() {
        assert_eq!(Header::read(&mut &b""[..]).expect("reads"), None);
        for cut in [&b"YUV4MPEG2 W4"[..], b"YUV4MPEG2 W4 H3 C410\n", b"YUV4MPEG2 H3\n", b"hello\n", &[b'x'; 5000]] {
            assert!(Header::read(&mut &cut[..]).is_err());
        }
        for cut in [&b"FRAME\nabc"[..], b"FRA", b"abcdFRAME\n"] {
            assert!(MONO.read_frame(&mut &cut[..], &mut Vec::new()).is_err());
        }
    }
}
