//! The door of the encounter room: when to act, from how far it must be seen, and whether a camera can do it.

#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test says what it takes for granted, and shows its figures"
)]

use std::f64::consts::{FRAC_PI_2, PI};

use skypose::assess::AssessOptions;
use skypose::camera::{Camera, Distortion};
use skypose::encounter::{
    Airspace, Answer, Course, Delays, Eye, Manoeuvre, Marked, NoTurn, Question, Regard, RelativeState, Scenario,
    Situation, Task, Turn, arc_width_rad, pictures,
};
use skypose::scene::models::{demo_camera, wing_six};

fn question(scenario: Scenario) -> Question {
    Question {
        situation: Situation::Meeting { course: Course::of(scenario), range_m: None },
        manoeuvre: Manoeuvre::default(),
        turn: Turn::Arc,
        delays: Delays::default(),
        size_m: [1.4, 0.28],
        airspace: Airspace::default(),
        eye: None,
        marked: None,
    }
}

fn answer(question: &Question) -> Answer {
    question.answer().expect("good numbers")
}

fn eye(camera: &Camera, azimuth_deg: f64) -> Eye {
    Eye::checked(*camera, azimuth_deg.to_radians(), 0.0).expect("good angles")
}

fn pinhole(fx: f64) -> Camera {
    Camera::checked([640, 480], [fx; 2], [319.5, 239.5], Distortion::None).expect("a camera")
}

#[test]
fn the_thesis_scenarios_are_answered_by_the_exact_arc() {
    for (bank_deg, time_s) in [(20.0_f64, 9.57), (30.0, 7.75), (45.0, 6.25), (60.0, 5.38)] {
        let manoeuvre = Manoeuvre::checked(bank_deg.to_radians(), 152.4).expect("a turn");
        let found = answer(&Question { manoeuvre, ..question(Scenario::HeadOn) }).needed.expect("a last moment");
        assert!((found.time_to_avoid_s - time_s).abs() < 0.02, "{bank_deg}: {found:?}");
        assert!((found.distance_to_avoid_m - 51.444 * found.time_to_avoid_s).abs() < 0.02);
        assert_eq!(found.time_to_avoid_s.to_bits(), found.time_to_detect_s.to_bits(), "no delay was stated");
    }
    let crossing = answer(&question(Scenario::Crossing));
    assert!((crossing.state.closing_speed_mps() - 36.4).abs() < 0.03);
    // 4 km ahead of us and 2 km to the side of us there are, at 50 knots each, 77.8 s.
    assert!((crossing.room.expect("an airspace").longest_s - 2000.0 / Scenario::SPEED_MPS).abs() < 1e-9);
    let head_on = answer(&question(Scenario::HeadOn));
    assert!((head_on.room.expect("an airspace").range_m - 4000.0).abs() < 1e-9);
    assert!((head_on.state.range_m() - 4000.0).abs() < 1e-9);
}

#[test]
fn delays_are_added_and_the_parabola_is_served_on_demand() {
    let delays = Delays::checked(0.2, 0.5, 0.1, 1.2).expect("times");
    let arc = answer(&Question { delays, ..question(Scenario::HeadOn) }).needed.expect("a last moment");
    assert!((arc.time_to_detect_s - arc.time_to_avoid_s - 2.0).abs() < 1e-12);
    assert!((arc.distance_to_detect_m - arc.distance_to_avoid_m - 2.0 * 51.444).abs() < 1e-2);
    assert!((arc.arc_width_rad - arc_width_rad(1.4, arc.distance_to_detect_m)).abs() < 1e-15);
    let parabola = answer(&Question { turn: Turn::Parabolic, ..question(Scenario::HeadOn) }).needed.expect("a moment");
    assert!((parabola.time_to_avoid_s - 5.58).abs() < 0.01, "{parabola:?}");
    for (which, bad) in [(0, -0.1), (1, f64::NAN), (2, f64::INFINITY), (3, 1e9)] {
        let mut times = [0.0; 4];
        times[which] = bad;
        let [detection, track, link, decision] = times;
        let names = ["detection_s", "track_s", "link_s", "decision_s"];
        let refused = Delays::checked(detection, track, link, decision).expect_err("no time");
        assert_eq!(refused.field(), names[which]);
    }
}

#[test]
fn the_angle_of_a_width_is_exact() {
    // Half as far away as it is wide: a right angle, where the thesis' w / d would have two radians.
    assert!((arc_width_rad(2.0, 1.0) - FRAC_PI_2).abs() < 1e-15);
    assert!((arc_width_rad(1.0, 1000.0) - 1e-3).abs() < 1e-10);
}

#[test]
fn too_late_and_hopeless_are_answers() {
    let at = |range_m: f64| {
        let situation = Situation::Meeting { course: Course::of(Scenario::HeadOn), range_m: Some(range_m) };
        answer(&Question { situation, ..question(Scenario::HeadOn) })
    };
    let late = at(200.0).needed.expect("a last moment, in the past");
    assert!((late.time_left_s - (200.0 / 51.444 - late.time_to_detect_s)).abs() < 1e-3 && late.time_left_s < 0.0);
    assert!(matches!(at(150.0).needed, Err(NoTurn::InsideMissDistance { .. })));
    let beside = Course::checked(20.0, 20.0, 0.0).expect("good numbers");
    let situation = Situation::Meeting { course: beside, range_m: None };
    let parallel = answer(&Question { situation, eye: Some(eye(&pinhole(600.0), 0.0)), ..question(Scenario::HeadOn) });
    assert!(matches!(parallel.needed, Err(NoTurn::NeverClosing { .. } | NoTurn::InsideMissDistance { .. })));
    assert!(parallel.view.expect("a camera").sighting.area_px.is_finite());
}

#[test]
fn a_measured_state_is_answered_like_the_course_that_it_is() {
    let course = Course::of(Scenario::Crossing);
    let state = course.at_range(800.0).expect("they meet");
    let given = Situation::Given { state, own_speed_mps: course.own_speed_mps() };
    let meeting = Situation::Meeting { course, range_m: Some(800.0) };
    let [one, other] =
        [given, meeting].map(|situation| answer(&Question { situation, ..question(Scenario::Crossing) }));
    assert_eq!(one.needed, other.needed);
    assert!((one.intruder_speed_mps - Scenario::SPEED_MPS).abs() < 1e-9);
    let climbing = RelativeState::checked([900.0, 0.0, 100.0].into(), [-50.0, 0.0, -2.0].into()).expect("good numbers");
    let situation = Situation::Given { state: climbing, own_speed_mps: 25.0 };
    assert!(answer(&Question { situation, ..question(Scenario::HeadOn) }).needed.is_ok());
}

#[test]
fn pixels_are_those_of_the_camera_where_the_intruder_is() {
    let with = |camera: Camera, azimuth_deg: f64, scenario: Scenario| {
        answer(&Question { eye: Some(eye(&camera, azimuth_deg)), ..question(scenario) }).view.expect("a camera")
    };
    let ahead = with(pinhole(600.0), 0.0, Scenario::HeadOn);
    let expected_px = 600.0 * 1.4 / ahead.distance_m;
    assert!((ahead.sighting.size_px[0] / expected_px - 1.0).abs() < 1e-9, "{ahead:?}");
    let centre = ahead.sighting.pixel.expect("seen");
    assert!((centre.x - 319.5).abs() < 1e-6 && (centre.y - 239.5).abs() < 1e-6);
    // Crossing traffic is 45 degrees to the side: out of 56 degrees of view, in the middle of a camera that is turned there.
    assert!(!with(pinhole(600.0), 0.0, Scenario::Crossing).sighting.is_in_picture);
    assert!(with(pinhole(600.0), 45.0, Scenario::Crossing).sighting.is_in_picture);
    // An ideal lens magnifies by 1 / cos^2 towards the rim, a fisheye does not.
    let wide = with(pinhole(250.0), 0.0, Scenario::Crossing);
    let [across, _] = wide.sighting.size_px;
    assert!((across / (250.0 * 1.4 / wide.distance_m) - 2.0).abs() < 1e-3, "{wide:?}");
    let fisheye =
        Camera::checked([640, 480], [250.0; 2], [319.5, 239.5], Distortion::Equidistant([0.0; 4])).expect("a camera");
    let bent = with(fisheye, 0.0, Scenario::Crossing);
    assert!((bent.sighting.size_px[0] / (250.0 * 1.4 / bent.distance_m) - 1.0).abs() < 1e-3, "{bent:?}");
}

#[test]
fn what_pixels_allow_is_told_for_each_task() {
    let marked = Marked { target: wing_six(), aspect_rad: 0.5, options: AssessOptions::default() };
    let at = |range_m: f64| {
        // Side by side: no turn is needed, so the camera looks at the distance of now.
        let situation = Situation::Meeting {
            course: Course::checked(20.0, 20.0, 0.0).expect("good numbers"),
            range_m: Some(range_m),
        };
        let question = Question {
            situation,
            eye: Some(eye(&demo_camera(), 0.0)),
            marked: Some(marked.clone()),
            ..question(Scenario::HeadOn)
        };
        answer(&question).view.expect("a camera")
    };
    let feasible = |range_m: f64| -> Vec<Task> {
        at(range_m).tasks.iter().filter(|task| task.feasible).map(|task| task.task).collect()
    };
    let all = [Task::Detection, Task::Classification, Task::Markers, Task::Identification, Task::Pose];
    assert_eq!(feasible(4.0), all);
    assert_eq!(feasible(50.0), [Task::Detection, Task::Classification, Task::Identification]);
    assert_eq!(feasible(150.0), [Task::Detection]);
    assert_eq!(feasible(500.0), []);
    // What it says of its reach holds: just enough on this side, just too little on that.
    let reach_m = at(100.0).tasks[0].reach_m.expect("a reach");
    for (factor, expected) in [(0.99, true), (1.01, false)] {
        assert_eq!(at(reach_m * factor).tasks[0].feasible, expected, "{reach_m}");
    }
    let sigma = |range_m: f64| {
        let (pose, covariance) = at(range_m).expected.expect("a target").pose.expect("four markers");
        assert!((pose.translation.norm() / range_m - 1.0).abs() < 0.05);
        covariance.matrix()[(2, 2)].sqrt()
    };
    // The range of a target is less well known by the square of the range.
    assert!((sigma(40.0) / sigma(10.0) / 16.0 - 1.0).abs() < 0.1, "{} {}", sigma(40.0), sigma(10.0));
}

#[test]
fn the_field_of_regard_of_a_pinhole_is_that_of_its_pyramid() {
    // 90 by 73.74 degrees: half of them 45 degrees, and the arctangent of three quarters.
    let regard = Regard::of(&eye(&pinhole(320.0), 0.0));
    let half = [(320.0_f64 / 320.0).atan(), (240.0_f64 / 320.0).atan()];
    for (ends, half) in [regard.azimuth_rad, regard.elevation_rad].into_iter().zip(half) {
        let [low, high] = ends.expect("it sees its own axis");
        assert!((low + half).abs() < 1e-6 && (high - half).abs() < 1e-6, "{low} {high} {half}");
    }
    // 4 asin(sin a sin b) of a pyramid with these half angles.
    let exact_sr = 4.0 * (half[0].sin() * half[1].sin()).asin();
    assert!((regard.solid_angle_sr / exact_sr - 1.0).abs() < 1e-3, "{} {exact_sr}", regard.solid_angle_sr);
    let [faa, icao, transport] = regard.covered.as_slice() else { panic!("three: {:?}", regard.covered) };
    // Of 120 degrees 90, over all ten degrees up and down; of 220 degrees 90.
    assert!((faa.azimuth_ratio - 0.75).abs() < 5e-3 && (faa.ratio - 0.75).abs() < 5e-3, "{faa:?}");
    assert_eq!(faa.elevation_ratio, Some(1.0));
    assert!((icao.ratio - 90.0 / 220.0).abs() < 5e-3 && icao.elevation_ratio.is_none(), "{icao:?}");
    assert!((transport.azimuth_ratio - 90.0 / 240.0).abs() < 5e-3 && transport.ratio < transport.azimuth_ratio);
}

#[test]
fn a_distorted_lens_covers_what_it_sees_and_a_turned_camera_covers_elsewhere() {
    let barrel = Distortion::PlumbBob([-0.25, 0.06, 0.0, 0.0, 0.0]);
    let lens =
        |distortion: Distortion| Camera::checked([640, 480], [320.0; 2], [319.5, 239.5], distortion).expect("a camera");
    let [straight, bent] = [Distortion::None, barrel].map(|distortion| Regard::of(&eye(&lens(distortion), 0.0)));
    assert!(bent.solid_angle_sr > 1.1 * straight.solid_angle_sr, "a barrel sees more: {bent:?}");
    let [_, end] = bent.azimuth_rad.expect("it sees its own axis");
    let seen = lens(barrel).unproject(&[639.5, 239.5].into()).expect("on the sensor");
    assert!((end - seen.x.atan()).abs() < 1e-6, "{end} {seen}");
    // Looking back, nothing of what is ahead is seen; turned to the right, nothing on the left.
    let back = Regard::of(&eye(&pinhole(320.0), 180.0));
    assert!(back.covered.iter().all(|covered| covered.ratio < 1e-9 || covered.guidance.azimuth_rad > 2.0), "{back:?}");
    let right = Regard::of(&eye(&pinhole(320.0), 90.0));
    let [low, high] = right.azimuth_rad.expect("it sees its own axis");
    assert!((low - 0.25 * PI).abs() < 1e-6 && (high - 0.75 * PI).abs() < 1e-6, "{low} {high}");
    let up = Eye::checked(pinhole(320.0), 0.0, 1.0).expect("good angles");
    let up = Regard::of(&up);
    assert!(up.azimuth_rad.is_none() && up.elevation_rad.is_some(), "{up:?}");
}

#[test]
fn pictures_are_drawn_of_what_there_is() {
    let names = |question: &Question| -> Vec<String> {
        pictures(question, &answer(question)).iter().map(|picture| picture.name.clone()).collect()
    };
    let bare = question(Scenario::HeadOn);
    assert_eq!(names(&bare), ["bank", "speed"]);
    let delays = Delays::checked(0.2, 0.5, 0.1, 1.2).expect("times");
    let full = Question { eye: Some(eye(&demo_camera(), 0.0)), delays, ..question(Scenario::Crossing) };
    assert_eq!(names(&full), ["bank", "speed", "pixels", "coverage"]);
    for picture in pictures(&full, &answer(&full)) {
        let svg = picture.figure.svg();
        assert!(svg.starts_with("<svg") && !svg.contains("NaN") && !svg.contains("inf"), "{}", picture.name);
        if picture.name == "bank" {
            assert!(svg.contains("exact arc and all delays") && svg.contains("parabola"), "{svg}");
        }
    }
}
