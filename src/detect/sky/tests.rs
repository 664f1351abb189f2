//! Sequences with truth: what flies is one track with a good score, what stands is not, and nothing is carried over a gap or a cut.

use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::frame::{Coding, Pixels};
use crate::random;

const WIDTH: u32 = 320;
const HEIGHT: u32 = 256;

/// Sky with clouds that drift, seen by a camera that looks `pan` px to the right, in gray levels.
fn clouds(x: f64, y: f64, time: f64, pan: f64) -> f64 {
    let (x, y) = (x + pan - 0.2 * time, y);
    let wave = |across: f64, down: f64, phase: f64| (x / across + y / down + phase).sin();
    150.0 + 12.0 * wave(31.0, 47.0, 0.0) * wave(53.0, -29.0, 1.0) + 8.0 * wave(-23.0, 37.0, 2.0) * wave(71.0, 61.0, 0.5)
}

/// A frame of which each pixel is painted, with noise of a gray level.
fn painted(name: &str, paint: impl Fn(f64, f64) -> f64) -> Frame {
    let mut rng = random::named(name);
    let samples = (0..HEIGHT)
        .flat_map(|y| (0..WIDTH).map(move |x| (f64::from(x), f64::from(y))))
        .map(|(x, y)| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
            let sample = (paint(x, y) + noise).clamp(0.0, 255.0) as u8;
            sample
        })
        .collect();
    Frame::checked(WIDTH, HEIGHT, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame")
}

/// How much of a blurred spot of some radii is at a place.
fn spot(x: f64, y: f64, [u, v]: [f64; 2], [across, down]: [f64; 2]) -> f64 {
    (-((x - u) / across).powi(2) - ((y - v) / down).powi(2)).exp()
}

fn observe(watch: &mut Watch, frame: &Frame, stamp: Stamp) -> Detection {
    let detection = watch.observe(frame, frame.full(), stamp, &SkyOptions { min_score: 0.0, ..SkyOptions::default() });
    for centroid in &detection.centroids {
        assert!(crate::detect::spans(centroid.bounds, &centroid.pixel), "outside its own box: {centroid:?}");
    }
    detection
}

fn nearest(detection: &Detection, place: [f64; 2]) -> Option<&Centroid> {
    let away = |c: &&Centroid| (c.pixel.x - place[0]).hypot(c.pixel.y - place[1]);
    detection.centroids.iter().filter(|c| away(c) < 4.0).min_by(|a, b| away(a).total_cmp(&away(b)))
}

/// A dark dot that crosses drifting clouds.
fn dot_at(time: f64) -> [f64; 2] {
    [60.0 + 2.5 * time, 90.0 + 0.7 * time]
}

fn dot_frame(index: u32) -> Frame {
    let time = f64::from(index);
    painted(&format!("dot {index}"), |x, y| clouds(x, y, time, 0.0) - 70.0 * spot(x, y, dot_at(time), [2.0, 1.6]))
}

#[test]
fn a_dot_that_moves_over_moving_clouds_is_one_track_with_one_number() {
    let mut watch = Watch::new();
    let mut ids = Vec::new();
    for index in 0..40 {
        let detection = observe(&mut watch, &dot_frame(index), Stamp::default());
        let dot = nearest(&detection, dot_at(f64::from(index))).expect("the dot is seen");
        ids.push(dot.track_id);
        if index >= 10 {
            assert_eq!(detection.centroids[0], *dot, "frame {index}: nothing is more likely to fly");
            assert!(dot.score > 0.5, "frame {index}: {}", dot.score);
            let error = (dot.pixel.x - dot_at(f64::from(index))[0]).hypot(dot.pixel.y - dot_at(f64::from(index))[1]);
            // It is located where its outline at half its height lies, which clouds behind it shift.
            assert!(error < 2.0, "frame {index}: {error} px");
        }
    }
    assert!(ids.iter().all(|id| *id == ids[0]), "{ids:?}");
}

#[test]
fn a_mast_under_a_panning_camera_scores_less_than_what_flies() {
    let mut watch = Watch::new();
    let (mut mast_scores, mut dot_scores) = (Vec::new(), Vec::new());
    for index in 0..40 {
        let time = f64::from(index);
        let pan = 1.5 * time;
        let mast = 260.0 - pan;
        // A lamp on a post, on ground with grass.
        let frame = painted(&format!("mast {index}"), |x, y| {
            let ground = if y > 215.0 { -60.0 + 25.0 * ((x + pan) / 3.0).sin() * (y / 2.3).cos() } else { 0.0 };
            let post = if (x - mast).abs() < 1.5 && y > 110.0 { -60.0 } else { 0.0 };
            let lamp = -70.0 * spot(x, y, [mast, 108.0], [4.0, 3.0]);
            clouds(x, y, 0.0, pan) + ground + f64::min(post, lamp) - 70.0 * spot(x, y, dot_at(time), [2.0, 1.6])
        });
        let detection = observe(&mut watch, &frame, Stamp::default());
        if index >= 15 {
            dot_scores.push(nearest(&detection, dot_at(time)).map_or(0.0, |dot| dot.score));
            let near_mast = detection.centroids.iter().filter(|c| (c.pixel.x - mast).abs() < 8.0);
            mast_scores.push(near_mast.map(|c| c.score).fold(0.0, f64::max));
        }
    }
    let mean = |scores: &[f64]| scores.iter().sum::<f64>() / scores.len() as f64;
    let (mast, dot) = (mean(&mast_scores), mean(&dot_scores));
    assert!(mast < 0.2 && dot > 0.9, "mast {mast}, dot {dot}");
}

#[test]
fn what_passes_close_to_a_mast_is_not_taken_for_a_part_of_it() {
    let mut watch = Watch::new();
    for index in 0..30 {
        let time = f64::from(index);
        let place = [60.0 + 3.0 * time, 90.0];
        // A lamp post in clear sky, which the dot passes at a few pixels.
        let frame = painted(&format!("post {index}"), |x, y| {
            let post = if (x - 130.0).abs() < 4.0 && y > 100.0 { -90.0 } else { 0.0 };
            let ground = if y > 215.0 { -80.0 + 25.0 * (x / 3.0).sin() * (y / 2.3).cos() } else { 0.0 };
            180.0 + f64::min(post, ground) + 60.0 * spot(x, y, place, [3.0, 1.6])
        });
        let detection = observe(&mut watch, &frame, Stamp::default());
        let is_before_the_post = (place[0] - 130.0).abs() < 12.0;
        if index >= 6 && !is_before_the_post {
            let dot = nearest(&detection, place).unwrap_or_else(|| panic!("frame {index}: it is seen"));
            assert!(dot.score > 0.3, "frame {index}: {}", dot.score);
        }
    }
}

#[test]
fn of_a_contrail_its_head_is_reported() {
    let mut watch = Watch::new();
    let head = |time: f64| [160.0 + 2.0 * time, 150.0 - 1.4 * time];
    for index in 0..40 {
        let [u, v] = head(f64::from(index));
        let frame = painted(&format!("trail {index}"), |x, y| {
            // Along and across its course; behind it fades and widens.
            let (along, across) = (((x - u) * 2.0 - (y - v) * 1.4) / 2.44, ((x - u) * 1.4 + (y - v) * 2.0) / 2.44);
            let trail = if along < 0.0 { 60.0 * (along / 400.0).exp() * (-(across / 2.0).powi(2)).exp() } else { 0.0 };
            120.0 + trail
        });
        let detection = observe(&mut watch, &frame, Stamp::default());
        if index >= 10 {
            let first = &detection.centroids[0];
            let away = (first.pixel.x - u).hypot(first.pixel.y - v);
            assert!(away < 15.0, "frame {index}: {away} px from the head, {first:?}");
            assert!(first.score > 0.3, "frame {index}: {}", first.score);
        }
    }
}

#[test]
fn a_cut_a_gap_and_another_size_begin_anew_and_a_lost_frame_does_not() {
    let known = |watch: &mut Watch, index: u32, stamp: Stamp| {
        let detection = observe(watch, &dot_frame(index), stamp);
        (watch.beginning(), nearest(&detection, dot_at(f64::from(index))).and_then(|dot| dot.track_id))
    };
    let at =
        |index: u64| Stamp { index: Some(index), timestamp_us: Some(i64::try_from(index).expect("small") * 33_000) };
    let mut begun = Watch::new();
    assert_eq!(known(&mut begun, 0, at(0)).0, Some(Beginning::First));
    (1..6).for_each(|index| assert_eq!(known(&mut begun, index, at(index.into())).0, None));
    let (_, id) = known(&mut begun, 6, at(6));
    assert_eq!(known(&mut begun.clone(), 8, at(8)), (None, id), "one frame is missing");
    let anew = |stamp: Stamp, why: Beginning| {
        let (beginning, other) = known(&mut begun.clone(), 7, stamp);
        assert_eq!(beginning, Some(why));
        assert!(other.is_some() && other != id, "{other:?}");
    };
    anew(at(20), Beginning::Gap);
    anew(at(5), Beginning::Gap);
    anew(Stamp { index: Some(7), timestamp_us: Some(3_000_000) }, Beginning::Gap);
    let mut cut = begun.clone();
    let hills = painted("hills", |x, y| if y > 100.0 + 40.0 * (x / 40.0).sin() { 40.0 } else { 220.0 });
    let detection = observe(&mut cut, &hills, at(7));
    assert_eq!(cut.beginning(), Some(Beginning::Cut));
    assert!(detection.centroids.iter().all(|c| c.track_id > id), "numbers are not used again");
    let frame = dot_frame(7);
    begun.observe(&frame, Region { x: 0, y: 0, width: 300, height: 256 }, at(7), &SkyOptions::default());
    assert_eq!(begun.beginning(), Some(Beginning::Resized));
}

#[test]
fn a_single_frame_scores_less_than_a_sequence() {
    let single = detect(
        &mut Watch::new(),
        &dot_frame(30),
        dot_frame(30).full(),
        &SkyOptions { min_score: 0.0, ..SkyOptions::default() },
    );
    let single = nearest(&single, dot_at(30.0)).expect("seen");
    assert_eq!(single.track_id, None);
    let mut watch = Watch::new();
    let last = (0..=30).map(|index| observe(&mut watch, &dot_frame(index), Stamp::default())).last().expect("frames");
    let followed = nearest(&last, dot_at(30.0)).expect("seen");
    assert!(single.score < followed.score, "{} {}", single.score, followed.score);
}

#[test]
fn a_region_moves_nothing() {
    let frame = dot_frame(3);
    let region = Region { x: 21, y: 33, width: 160, height: 128 };
    let options = SkyOptions { min_score: 0.0, ..SkyOptions::default() };
    let found = detect(&mut Watch::new(), &frame, region, &options);
    let dot = nearest(&found, dot_at(3.0)).expect("seen");
    assert!((dot.pixel.x - dot_at(3.0)[0]).abs() < 1.0 && (dot.pixel.y - dot_at(3.0)[1]).abs() < 1.0, "{dot:?}");
    for c in &found.centroids {
        assert!(c.bounds.x >= region.x && c.bounds.x + c.bounds.width <= region.x + region.width, "{c:?}");
        assert!(c.bounds.y >= region.y && c.bounds.y + c.bounds.height <= region.y + region.height, "{c:?}");
    }
}

#[test]
fn frames_of_any_size_and_content_are_survived() {
    for (width, height) in [(1, 1), (3, 200), (200, 3), (7, 9), (16, 16), (33, 31), (64, 48)] {
        for content in [0, 255, 1] {
            let mut watch = Watch::new();
            for index in 0..4_u32 {
                let mut rng = random::named(&format!("any {width} {height} {index}"));
                let samples: Vec<u8> = (0..width * height)
                    .map(|_| if content == 1 { rand::RngExt::random(&mut rng) } else { content })
                    .collect();
                let frame = Frame::checked(width, height, Pixels::Luma(samples), Coding::LOSSLESS).expect("a frame");
                let detection = observe(&mut watch, &frame, Stamp::default());
                assert!(detection.centroids.iter().all(|c| c.score.is_finite() && c.pixel.x.is_finite()));
                assert!(content == 1 || detection.centroids.is_empty());
            }
        }
    }
}

#[test]
fn what_flaps_is_a_bird_and_what_does_not_is_an_aircraft() {
    let classes = |flaps: bool| {
        let mut watch = Watch::new();
        let mut class = None;
        for index in 0..60_u32 {
            let time = f64::from(index);
            let place = [40.0 + 2.0 * time, 100.0 + 0.3 * time];
            // Wings up and down ten times a second.
            let beat = if flaps { 1.0 + 0.95 * (2.1 * time).sin() } else { 1.0 };
            let frame = painted(&format!("wings {flaps} {index}"), |x, y| {
                180.0 - 100.0 * spot(x, y, place, [7.0, 0.4 + 7.0 * beat])
            });
            let detection = observe(&mut watch, &frame, Stamp::default());
            // Wings that are just level leave little to be seen, and no class.
            class = nearest(&detection, place).and_then(|c| c.class).or(class);
        }
        class
    };
    assert_eq!(classes(true), Some(crate::detect::Class::Bird));
    assert_eq!(classes(false), Some(crate::detect::Class::Aircraft));
}

#[test]
fn what_rather_does_not_fly_has_no_class() {
    use super::candidate::{Candidate, Cues};
    let class = |goes_on: f32| {
        let cues = Cues { contrast_ln: 3.5, moving_ln: 1.5, size_ln: 1.5, goes_on, ..Cues::default() };
        let mut track = Track::start(1, Candidate { cues, area_px: 200.0, ..Candidate::default() });
        (track.hits, track.flicker) = (100, 4.0);
        let score = score::probability(&track);
        let seen = centroid(&track, score, None, Region { x: 0, y: 0, width: 160, height: 128 });
        (seen.score > 0.5, seen.class)
    };
    assert_eq!(class(0.0), (true, Some(crate::detect::Class::Bird)));
    // The same that goes on beyond its outline, as a branch does.
    assert_eq!(class(2.0), (false, None));
}
