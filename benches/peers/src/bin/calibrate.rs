//! Skypose's chessboard against OpenCV's: the same pictures, one run, in turn round by round.
//!
//!     cargo run --release --manifest-path benches/peers/Cargo.toml --bin calibrate -- FOLDER [COLUMNSxROWS [ROUNDS]]
//!
//! FOLDER holds the pictures, JPEG or PNG, of a board of so many inner corners. OpenCV runs beside, as its wheel of `PyPI`
//! (`pip install opencv-python`): `findChessboardCorners` and `cornerSubPix`. What it prints is Markdown: for each picture the
//! median over the rounds, and the least, and their ratio.

use std::hint::black_box;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use skypose::board::Board;
use skypose::calibrate::find::find;
use skypose::frame::{Decoding, Frame, Wanted};

/// Rounds, unless told otherwise.
const ROUNDS: usize = 21;
/// Inner corners, unless told otherwise.
const SIZE: &str = "9x6";
/// Names the interpreter, `python3` if it is not set.
const INTERPRETER: &str = "SKYPOSE_PEERS_PYTHON";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let folder = PathBuf::from(words.next().ok_or("which folder holds the pictures?")?);
    let size = words.next().unwrap_or_else(|| SIZE.to_owned());
    let rounds = words.next().map_or(Ok(ROUNDS), |word| word.parse())?;
    let board: Board = format!("chessboard:{size}:1").parse()?;
    let mut pictures = pictures(&folder)?;
    let (columns, rows) = size.split_once('x').ok_or("how many columns and rows?")?;
    let interpreter = std::env::var(INTERPRETER).unwrap_or_else(|_| "python3".to_owned());
    let mut child = Command::new(interpreter)
        .arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("boards.py"))
        .arg(&folder)
        .args([columns, rows])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut say = child.stdin.take().ok_or("no pipe")?;
    let mut hear = BufReader::new(child.stdout.take().ok_or("no pipe")?).lines();
    println!("Against {}; {rounds} rounds; ms, median (least).\n", hear.next().ok_or("boards.py says nothing")??);
    // The first round warms up and is not counted.
    for round in 0..=rounds {
        for picture in &mut pictures {
            let start = Instant::now();
            let found = black_box(find(&picture.frame, &board));
            let ours = (1e3 * start.elapsed().as_secs_f64(), found.map_or(0, |points| points.len()));
            writeln!(say, "{}", picture.name)?;
            let theirs: (f64, usize) = serde_json::from_str(&hear.next().ok_or("boards.py went away")??)?;
            picture.corners = [ours.1, theirs.1];
            if round > 0 {
                picture.ms[0].push(ours.0);
                picture.ms[1].push(theirs.0);
            }
        }
    }
    drop(say);
    child.wait()?;
    print(&pictures);
    Ok(())
}

/// A picture, what both found in it and how long it took: ours, OpenCV's.
struct Picture {
    name: String,
    frame: Frame,
    corners: [usize; 2],
    ms: [Vec<f64>; 2],
}

fn pictures(folder: &Path) -> Result<Vec<Picture>, Box<dyn std::error::Error>> {
    let mut paths = std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "jpg" || ending == "png"));
    paths.sort();
    let decoding = Decoding { wanted: Wanted::Luma, ..Decoding::default() };
    paths
        .into_iter()
        .map(|path| {
            let frame = Frame::decode(&std::fs::read(&path)?, &decoding)?;
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Ok(Picture { name, frame, corners: [0; 2], ms: [Vec::new(), Vec::new()] })
        })
        .collect()
}

/// A line for each picture, and the sums.
fn print(pictures: &[Picture]) {
    println!("| picture | corners, ours | OpenCV's | ours | OpenCV | OpenCV / ours |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: |");
    let mut sums = [[0.0; 2]; 2];
    for picture in pictures {
        let figures = [0, 1].map(|who: usize| median_and_least(&picture.ms[who]));
        sums.iter_mut().zip(figures).for_each(|(sum, figure)| (0..2).for_each(|k| sum[k] += figure[k]));
        let corners = picture.corners;
        println!("| {} | {} | {} | {} |", picture.name, corners[0], corners[1], cells(figures));
    }
    println!("| all | | | {} |", cells(sums));
}

fn cells([ours, theirs]: [[f64; 2]; 2]) -> String {
    let figure = |[median, least]: [f64; 2]| format!("{median:.2} ({least:.2})");
    format!("{} | {} | {:.1} ({:.1})", figure(ours), figure(theirs), theirs[0] / ours[0], theirs[1] / ours[1])
}

fn median_and_least(times: &[f64]) -> [f64; 2] {
    let mut times = times.to_vec();
    times.sort_by(f64::total_cmp);
    [times[times.len() / 2], times[0]]
}
