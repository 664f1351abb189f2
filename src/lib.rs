//! Where is that UAV, and how is it turned? A frame of a calibrated camera in, the six-degree-of-freedom pose of a marked
//! target out, with a covariance that holds, its runner-up where there is one, and a typed reason where there is no pose.
//!
//! # The rooms, in reading order
//!
//! *Words*, which everything else speaks:
//!
//! | room | what it is about |
//! | --- | --- |
//! | [`geometry`] | spaces as types, points, transforms, rotations, the covariance of a pose |
//! | [`camera`] | intrinsics, lens distortion, projection and its inverse with Jacobians |
//! | [`target`] | a constellation of markers, how its points are spread |
//! | [`board`] | a calibration board: its points, and what is printed of it |
//! | [`frame`] | one picture: decoding within limits, raw formats, region of interest |
//! | [`random`] | generators that have a name |
//! | [`statistics`] | shares and quantiles by which errors are judged |
//!
//! *Flow*, in the order in which a frame passes:
//!
//! | room | from | to |
//! | --- | --- | --- |
//! | [`detect`] | a frame | centroids, each with its sigma, and refused blobs, each with its reason |
//! | [`solve`] | correspondences | candidate poses: one solver, one file, one paper |
//! | [`refine`] | a candidate | the least reprojection error, with covariance |
//! | [`pose`] | correspondences | the answer: best pose, runners-up with probabilities, or the reason for none |
//! | [`identify`] | centroids | which of them is which marker (it tries poses, so it stands after them) |
//! | [`track`] | answers over time | tracks: motion with covariance, one attitude out of the mirrored ones, closest approach |
//! | [`swarm`] | tracks of several cameras and vehicles | whether they agree, and the pose that follows from all |
//! | [`pipeline`] | a frame | all of it, on one screen |
//!
//! *Workshops*, which use the flow: [`scene`] makes synthetic truth, from the simulated cases of the 2012 study to rendered
//! flights; [`annotate`] draws what was found; [`assess`] tells what a constellation is good for before anybody glues its markers;
//! [`calibrate`] makes a camera of pictures of a [`board`] and tells how far to trust it; [`plot`] draws charts; [`evaluate`] holds
//! answers against truth, of cases of [`scene`] and of recorded frames; [`encounter`] tells how early another aircraft must be seen.
//!
//! *The wall*: [`shell`]. Only behind it are clocks, files, sockets, threads, logs and serialised shapes: settings,
//! telemetry, the store, the service with its workers, HTTP, Zenoh (ROS 2 by it), MAVLink, videos and cameras, the command line.
//!
//! # The import law
//!
//! Words know only words; a flow room knows words and the flow rooms before it; workshops know words and flow; the shell
//! knows all, and its doors never know each other. Everything outside the shell is pure: values in, values out.
//! `tests/house.rs` holds it up.
//!
//! # One frame's walk
//!
//! `POST /v1/estimates` arrives at [`shell::http`], which reads the frame and its parameters within their limits and asks
//! [`shell::service`]; there the camera and the targets are looked up, and a worker takes the job. The worker decodes the
//! bytes to a [`frame::Frame`] and walks [`pipeline::estimate`]: [`detect`](detect::detect) finds blobs of the marker's
//! colour; [`identify`](identify::identify) weighs which blob is which marker, and as that tells their shapes, discs are located
//! once more; [`estimate_pose`](pose::estimate_pose) starts from the solvers that fit the geometry, refines every start, keeps
//! the distinct minima and weighs them. [`shell::wire`] writes the reply.
//!
//! # A pose from points
//!
//! ```
//! use skypose::camera::{Camera, Distortion, Pixel};
//! use skypose::geometry::Point;
//! use skypose::pose::{PoseOptions, estimate_pose};
//! use skypose::refine::Correspondence;
//!
//! let camera = Camera::checked([640, 480], [600.0; 2], [320.0, 240.0], Distortion::None)?;
//! let seen = [
//!     ([-0.2, -0.2], [296.3, 165.7]),
//!     ([0.2, -0.2], [434.3, 153.4]),
//!     ([0.2, 0.2], [434.3, 326.6]),
//!     ([-0.2, 0.2], [296.3, 314.3]),
//! ];
//! let correspondences = seen.map(|([x, y], [u, v])| Correspondence {
//!     point: Point::new(x, y, 0.0),
//!     pixel: Pixel::new(u, v),
//!     sigma_px: 0.5,
//! });
//! let answer = estimate_pose(&camera, &correspondences, &PoseOptions::default())?;
//! let range_m = answer.best.camera_from_target.translation.norm();
//! assert!((range_m - 1.503).abs() < 0.005, "{range_m}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod annotate;
pub mod assess;
pub mod board;
pub mod calibrate;
pub mod camera;
pub mod detect;
pub mod encounter;
pub mod evaluate;
pub mod frame;
pub mod geometry;
pub mod identify;
pub mod pipeline;
pub mod plot;
pub mod pose;
pub mod random;
pub mod refine;
pub mod scene;
pub mod shell;
pub mod solve;
pub mod statistics;
pub mod swarm;
pub mod target;
pub mod track;
