//! Whether the file of a video ends where its container does. ffmpeg takes the end of some files for the end of the video, wherever it
//! is, and says nothing: of those the bytes tell.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use super::y4m::Header;

/// What is read of the beginning: more than the longest header of any of them.
const START: u64 = 2048;

/// An Ogg page has at most 27 + 255 + 255 * 255 bytes.
const OGG_PAGE: u64 = 65_307;

/// Why the file is not whole, as far as can be told; `None` also where it cannot.
pub(super) fn cut_off(path: &Path) -> Option<&'static str> {
    // What cannot be read again, as a pipe with a name, tells nothing.
    path.metadata().ok().filter(std::fs::Metadata::is_file)?;
    told(&mut File::open(path).ok()?).ok().flatten()
}

fn told(file: &mut (impl Read + Seek)) -> io::Result<Option<&'static str>> {
    let length = file.seek(SeekFrom::End(0))?;
    let start = bytes_at(file, 0, START)?;
    if start.starts_with(b"RIFF") {
        return Ok(is_riff_short(file, length)?.then_some("the file is shorter than it states"));
    }
    if start.starts_with(b"OggS") {
        let end = bytes_at(file, length.saturating_sub(OGG_PAGE), OGG_PAGE)?;
        return Ok(is_page_short(&end).then_some("the file ends within a page"));
    }
    if let Some(packet) = packet_length(&start) {
        return Ok((length % packet != 0).then_some("the file ends within a packet"));
    }
    let is_short = frame_length(&start).is_some_and(|(header, frame)| length.saturating_sub(header) % frame != 0);
    Ok(is_short.then_some("the file ends within a frame"))
}

fn bytes_at(file: &mut (impl Read + Seek), place: u64, most: u64) -> io::Result<Vec<u8>> {
    file.seek(SeekFrom::Start(place))?;
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// AVI, of one or several RIFF chunks, each with its length.
fn is_riff_short(file: &mut (impl Read + Seek), length: u64) -> io::Result<bool> {
    let mut place = 0;
    while place < length {
        let head = bytes_at(file, place, 8)?;
        let Some(([b'R', b'I', b'F', b'F'], rest)) = head.split_first_chunk() else { return Ok(false) };
        let Some(stated) = rest.first_chunk().copied().map(u32::from_le_bytes) else { return Ok(true) };
        // Who writes into a pipe knows no length.
        if matches!(stated, 0 | u32::MAX) {
            return Ok(false);
        }
        let end = place + 8 + u64::from(stated);
        if end > length {
            return Ok(true);
        }
        // An odd chunk is padded.
        place = end + end % 2;
    }
    Ok(false)
}

/// Whether the last page of Ogg, in the bytes that end the file, has less than it states.
fn is_page_short(end: &[u8]) -> bool {
    let Some(page) = end.windows(4).rposition(|word| word == b"OggS").and_then(|place| end.get(place..)) else {
        return false;
    };
    let lengths = page.get(26).and_then(|count| page.get(27..27 + usize::from(*count)));
    lengths.is_none_or(|lengths| {
        let body: usize = lengths.iter().copied().map(usize::from).sum();
        page.len() < 27 + lengths.len() + body
    })
}

/// Bytes of a packet of an MPEG transport stream: plain, with a time before each (Blu-ray, AVCHD), or with parity behind.
fn packet_length(start: &[u8]) -> Option<u64> {
    [(188, 0), (192, 4), (204, 0)].into_iter().find_map(|(packet, sync)| {
        let is_sync = |number: usize| start.get(sync + number * packet) == Some(&0x47);
        (0..5).all(is_sync).then_some(packet as u64)
    })
}

/// Bytes of the header of YUV4MPEG2 and of each frame, if the first frame is like all others: without parameters of its own.
fn frame_length(start: &[u8]) -> Option<(u64, u64)> {
    const FRAME: &[u8] = b"FRAME\n";
    let header = Header::read(&mut &*start).ok().flatten()?;
    let end = start.iter().position(|byte| *byte == b'\n')? + 1;
    let frame = FRAME.len() as u64 + header.planar.byte_count(header.width, header.height);
    start.get(end..)?.starts_with(FRAME).then_some((end as u64, frame))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    fn of(bytes: &[u8]) -> Option<&'static str> {
        told(&mut Cursor::new(bytes)).expect("memory")
    }

    /// Whole it is whole, and wherever it is cut behind `from` it is not.
    fn assert_told(whole: &[u8], from: usize) {
        assert_eq!(of(whole), None);
        for length in from..whole.len() {
            assert!(of(&whole[..length]).is_some(), "{length} of {}", whole.len());
        }
    }

    #[test]
    fn riff_states_its_length() {
        let chunk = |kind: &[u8; 4], content: usize| {
            let length = u32::try_from(content + 4).expect("small");
            [b"RIFF", length.to_le_bytes().as_slice(), kind, &vec![1; content]].concat()
        };
        let first = chunk(b"AVI ", 100);
        assert_told(&first, 8);
        let both = [first.clone(), chunk(b"AVIX", 60)].concat();
        assert_told(&both, first.len() + 4);
        let mut piped = first.clone();
        piped[4..8].fill(0xff);
        assert_eq!(of(&piped[..50]), None);
    }

    #[test]
    fn ogg_pages_state_their_length() {
        let page = |flag: u8| {
            let mut page = vec![0; 27];
            page[..4].copy_from_slice(b"OggS");
            (page[5], page[26]) = (flag, 2);
            [page, vec![255, 40], vec![7; 295]].concat()
        };
        let whole = [page(2), page(4)].concat();
        assert_told(&whole, page(2).len() + 4);
        assert_eq!(of(&page(2)), None);
    }

    #[test]
    fn packets_and_frames_are_all_of_a_length() {
        for (packet, sync) in [(188, 0), (192, 4), (204, 0)] {
            let whole: Vec<u8> = (0..8 * packet).map(|at| if at % packet == sync { 0x47 } else { 1 }).collect();
            assert_told(&whole, 7 * packet + 1);
        }
        let frames = b"FRAME\nabcdFRAME\nefgh".to_vec();
        let whole = [b"YUV4MPEG2 W4 H1 F25:1 Cmono\n".to_vec(), frames].concat();
        assert_told(&whole, whole.len() - 9);
    }

    #[test]
    fn of_others_nothing_is_told() {
        for bytes in [&b""[..], b"RI", b"\0\0\0\x18ftypmp42", &[0x47; 3], b"YUV4MPEG2 W4 H1 Cmono\nFRAME Ix\nab"] {
            assert_eq!(of(bytes), None, "{bytes:?}");
        }
    }
}
