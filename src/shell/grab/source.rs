//! Where frames come from.

use std::ffi::{OsStr, OsString};
use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::error::GrabError;

/// A video file, a stream or a webcam.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A file.
    File(PathBuf),
    /// A video device (`Video4Linux`).
    Device(PathBuf),
    /// Whatever ffmpeg opens by an address: RTSP, RTMP, HTTP, ...
    Address(String),
}

/// Names that videos end in.
const VIDEOS: [&str; 33] = [
    "mp4", "m4v", "mov", "mkv", "webm", "avi", "mpg", "mpeg", "mpe", "m1v", "m2v", "m2p", "vob", "ts", "m2t", "m2ts",
    "mts", "mxf", "wmv", "asf", "flv", "3gp", "3g2", "ogv", "dv", "h264", "264", "h265", "265", "hevc", "mjpeg", "y4m",
    "nut",
];

/// Schemes of addresses that send as they please.
const LIVE: [&str; 10] = ["rtsp", "rtsps", "rtmp", "rtmps", "rtp", "srtp", "udp", "tcp", "srt", "rist"];

impl Source {
    /// What a text names: an address has a scheme, a device is under `/dev`, everything else is a file.
    #[must_use]
    pub fn of(name: &Path) -> Self {
        match name.to_str() {
            Some(text) if scheme_of(text).is_some() => Self::Address(text.into()),
            Some(text) if text.starts_with("/dev/") => Self::Device(name.into()),
            _ => Self::File(name.into()),
        }
    }

    /// Whether a name stands for moving pictures: an address, a device, or a file whose name or first bytes say so.
    #[must_use]
    pub fn is_video(name: &Path) -> bool {
        match Self::of(name) {
            Self::Address(_) => true,
            Self::Device(path) => path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("video")),
            Self::File(path) => has_video_name(&path) || (path.extension().is_none() && starts_as_video(&path)),
        }
    }

    /// Whether it goes on whether or not we listen.
    #[must_use]
    pub fn is_live(&self) -> bool {
        match self {
            Self::File(_) => false,
            Self::Device(_) => true,
            Self::Address(address) => scheme_of(address).is_some_and(|scheme| LIVE.contains(&scheme.as_str())),
        }
    }

    /// The file, if it is one.
    pub(super) fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Device(_) | Self::Address(_) => None,
        }
    }

    /// What can be said before ffmpeg is asked.
    pub(super) fn check(&self) -> Result<(), GrabError> {
        let missing = |detail: String| GrabError::NoSource { detail };
        match self {
            Self::Address(_) => Ok(()),
            Self::Device(path) => path.metadata().map(|_| ()).map_err(|error| missing(error.to_string())),
            Self::File(path) => match path.metadata() {
                Err(error) => Err(missing(error.to_string())),
                Ok(metadata) if metadata.is_dir() => Err(missing("is a folder, not a video".into())),
                Ok(_) => Ok(()),
            },
        }
    }

    /// The options with which ffmpeg opens it, and its name there.
    pub(super) fn input(&self) -> (&'static [&'static str], OsString) {
        match self {
            Self::File(path) => {
                // With the protocol's name, a colon or a dash in the file's name has no meaning.
                let mut name = OsString::from("file:");
                name.push(path);
                (&[], name)
            }
            Self::Device(path) => (&["-f", "v4l2"], path.into()),
            Self::Address(address) => match scheme_of(address).as_deref() {
                // Over UDP, the first thing that is lost under load is a part of a frame.
                Some("rtsp" | "rtsps") => (&["-rtsp_flags", "prefer_tcp"], address.into()),
                _ => (&[], address.into()),
            },
        }
    }
}

/// For people and replies: the password of an address is nobody's business.
impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) | Self::Device(path) => path.display().fmt(f),
            Self::Address(address) => f.write_str(&without_password(address)),
        }
    }
}

/// `scheme://user:password@host` with stars for the password.
fn without_password(address: &str) -> String {
    let hidden = || {
        let (scheme, rest) = address.split_once("://")?;
        let authority = rest.split(['/', '?', '#']).next()?;
        let (login, host) = authority.rsplit_once('@')?;
        let (user, _) = login.split_once(':')?;
        Some(format!("{scheme}://{user}:***@{host}{}", &rest[authority.len()..]))
    };
    hidden().unwrap_or_else(|| address.to_owned())
}

/// The scheme of an address, lower case.
fn scheme_of(text: &str) -> Option<String> {
    let (scheme, _) = text.split_once("://")?;
    let is_word = |word: &str| word.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    // One letter is a drive.
    (scheme.len() > 1 && is_word(scheme)).then(|| scheme.to_ascii_lowercase())
}

fn has_video_name(path: &Path) -> bool {
    let ending = path.extension().and_then(OsStr::to_str).unwrap_or_default().to_ascii_lowercase();
    VIDEOS.contains(&ending.as_str())
}

/// Containers known by their first bytes: MP4 and MOV, Matroska, AVI, MPEG streams.
fn starts_as_video(path: &Path) -> bool {
    let mut start = [0; 12];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut start));
    read.is_ok()
        && (start[4..8] == *b"ftyp"
            || start[..4] == [0x1a, 0x45, 0xdf, 0xa3]
            || (start[..4] == *b"RIFF" && start[8..] == *b"AVI ")
            || start[..4] == [0, 0, 1, 0xba]
            || start[..4] == [0, 0, 1, 0xb3])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_says_what_it_stands_for() {
        let of = |name: &str| Source::of(Path::new(name));
        assert_eq!(of("rtsp://camera/live"), Source::Address("rtsp://camera/live".into()));
        assert_eq!(of("/dev/video0"), Source::Device("/dev/video0".into()));
        assert_eq!(of("a:b.mp4"), Source::File("a:b.mp4".into()));
        assert_eq!(of("C://video.mp4"), Source::File("C://video.mp4".into()));
        for live in ["rtsp://x", "RTSP://x", "udp://@:5000", "/dev/video2", "srt://x"] {
            assert!(of(live).is_live(), "{live}");
        }
        for still in ["https://x/video.mp4", "video.mp4", "file:///video.mp4"] {
            assert!(!of(still).is_live(), "{still}");
        }
    }

    #[test]
    fn pictures_are_no_videos() {
        for video in ["a.mp4", "a.MPG", "rtsp://camera", "/dev/video0", "http://camera/mjpg", "a.b/c.mkv"] {
            assert!(Source::is_video(Path::new(video)), "{video}");
        }
        for picture in ["a.jpg", "mp4", "video", "a.mp4/b.png", "/dev/null", ""] {
            assert!(!Source::is_video(Path::new(picture)), "{picture}");
        }
        let folder = tempfile::tempdir().expect("a folder");
        let nameless = folder.path().join("nameless");
        std::fs::write(&nameless, b"\0\0\0\x18ftypmp42\0\0").expect("writes");
        assert!(Source::is_video(&nameless));
        std::fs::write(&nameless, b"\xff\xd8\xff\xe0 a JPEG file").expect("writes");
        assert!(!Source::is_video(&nameless));
    }

    #[test]
    fn a_password_is_not_shown() {
        let shown = |name: &str| Source::of(Path::new(name)).to_string();
        assert_eq!(shown("rtsp://me:se:cret@camera:554/a@b?c"), "rtsp://me:***@camera:554/a@b?c");
        assert_eq!(shown("rtsp://me:s@cret@camera"), "rtsp://me:***@camera");
        assert_eq!(shown("rtsp://me@camera/x:y@z"), "rtsp://me@camera/x:y@z");
        assert_eq!(shown("rtsp://camera/x"), "rtsp://camera/x");
    }

    #[test]
    fn what_is_not_there_or_is_a_folder_needs_no_ffmpeg_to_be_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let check = |path: PathBuf| Source::of(&path).check().expect_err("refused").to_string();
        assert!(check(folder.path().join("no.mp4")).contains("No such file"), "{folder:?}");
        assert!(check(folder.path().into()).ends_with("is a folder, not a video"));
    }
}
