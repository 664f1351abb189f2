//! `skypose demo`: a service, a client and a flying target in one process, with real HTTP between them.

mod score;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;

use super::Stop;
use super::inputs::unreadable;
use crate::annotate::{Overlay, annotate};
use crate::detect::Workspace;
use crate::frame::Frame;
use crate::geometry::CameraFromTarget;
use crate::random;
use crate::scene::encode;
use crate::scene::flight::Flight;
use crate::scene::models::{demo_camera, wing};
use crate::scene::render::{Optics, Sky, render};
use crate::shell::config::{LogSettings, Settings};
use crate::shell::console::print_line;
use crate::shell::fault::{Fault, FaultKind};
use crate::shell::http::App;
use crate::shell::http::server::Server;
use crate::shell::service::Service;
use crate::shell::service::compute::{FrameTask, Seen, Terms};
use crate::shell::service::lookup::Lookup;
use crate::shell::telemetry;
use crate::shell::wire::{CameraWire, EstimateReply, FrameRequest, Ref, TargetWire};
use score::Scores;

/// Quality of the JPEG frames: that of a camera, with colour at half the rate.
const QUALITY: u8 = 90;

/// Where the frames as they were posted go.
const FRAMES: &str = "frames";

#[derive(Args, Debug)]
pub(super) struct Demo {
    /// Folder for the annotated frames; the frames as they were posted, the camera and the target go there too.
    #[arg(long, value_name = "FOLDER", default_value = "skypose-demo")]
    out: PathBuf,
    /// Frames of each flight.
    #[arg(long, value_name = "N", default_value_t = 25, value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,
    /// Seed of clouds and noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

impl Demo {
    pub(super) fn run(self) -> Result<(), Stop> {
        telemetry::start_logging(&LogSettings { level: "warn".into(), ..LogSettings::default() });
        // TLS is not used on the loopback, but the client wants to know whose it would be.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let frames = self.out.join(FRAMES);
        std::fs::create_dir_all(&frames).map_err(|error| unreadable(&frames, &error))?;
        self.write("camera.json", &json_of(&CameraWire::from(&demo_camera()))?)?;
        self.write("target.json", &json_of(&TargetWire::from(&wing().target))?)?;
        let data = std::env::temp_dir().join(format!("skypose-demo-{}", std::process::id()));
        let runtime = tokio::runtime::Runtime::new().map_err(internal)?;
        let result = runtime.block_on(self.fly(&data));
        let _ = std::fs::remove_dir_all(&data);
        result
    }

    async fn fly(&self, data: &Path) -> Result<(), Stop> {
        let mut settings = Settings::default();
        settings.http.listen.set_port(0);
        settings.store.data = data.to_owned();
        let server = Server::bind(App::new(Service::start(settings).await?)).map_err(internal)?;
        let client = Client { base: format!("http://{}", server.address()?), http: reqwest::Client::new() };
        let stopper = server.stopper();
        let serving = tokio::spawn(server.run());
        print_line(&format!("A service of its own listens on {}.", client.base))?;
        client.put("cameras/demo", &CameraWire::from(&demo_camera())).await?;
        client.put("targets/wing-six", &TargetWire::from(&wing().target)).await?;
        print_line("Six red discs of 30 mm radius fly past a 1280 x 720 camera; each frame is posted as JPEG.\n")?;

        let mut all = Scores::default();
        for flight in Flight::ALL {
            print_line(&score::head(flight.name()))?;
            let mut scores = Scores::default();
            for number in 0..self.frames {
                let shot = self.shot(flight, number)?;
                let start = Instant::now();
                let reply = client.estimate(shot.jpeg.clone()).await?;
                let score = score::Score::of(&shot.truth, &reply, start.elapsed());
                print_line(&score.line(number))?;
                scores.add(score);
                let name = format!("{}-{number:03}.jpg", flight.name());
                self.write(&format!("{FRAMES}/{name}"), &shot.jpeg)?;
                self.write(&name, &annotated(&shot.jpeg).await?)?;
            }
            print_line("")?;
            all.append(scores);
        }
        stopper.stop();
        serving.await.map_err(internal)?.map_err(internal)?;
        print_line(&all.summary())?;
        let out = self.out.display();
        print_line(&format!("Annotated frames are in {out}/, the frames that were posted in {out}/{FRAMES}/."))?;
        Ok(())
    }

    /// One frame of a flight with its truth.
    fn shot(&self, flight: Flight, number: u32) -> Result<Shot, Fault> {
        let step = (flight.len() - 1) * number as usize / (self.frames as usize - 1);
        let truth = flight.pose(step);
        let name = format!("{} {}", flight.name(), self.seed);
        let drift = [0.4 * f64::from(number), 0.0];
        let sky = Sky::fair(self.seed, drift);
        let mut rng = random::case(&name, u64::from(number));
        let frame = render(&demo_camera(), &truth, &wing(), &sky, &Optics::default(), &mut rng);
        Ok(Shot { truth, jpeg: encode::jpeg(&frame, QUALITY).map_err(internal)? })
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Fault> {
        let path = self.out.join(name);
        std::fs::write(&path, bytes).map_err(|error| unreadable(&path, &error))
    }
}

/// The frame as it was posted, with what was found drawn in.
async fn annotated(jpeg: &[u8]) -> Result<Vec<u8>, Fault> {
    let request = FrameRequest {
        camera: Some(Ref::Object(CameraWire::from(&demo_camera()))),
        targets: vec![Ref::Object(TargetWire::from(&wing().target))],
        ..FrameRequest::default()
    };
    let task = FrameTask::for_estimate(request, &Lookup::new(None, std::sync::Arc::default())).await?;
    let (terms, mut workspace) = (Terms::of(&Settings::default()), Workspace::default());
    let (frame, estimate, _) = task.estimated(Seen::Bytes(jpeg), &terms, None, &mut workspace)?;
    let overlay = Overlay::of(&estimate.detection, task.targets(), &estimate.targets);
    let drawn = Frame::from_rgb_image(annotate(&frame, task.camera(), &overlay)).map_err(internal)?;
    encode::jpeg(&drawn, QUALITY).map_err(internal)
}

fn json_of<T: serde::Serialize>(thing: &T) -> Result<Vec<u8>, Fault> {
    serde_json::to_vec_pretty(thing).map_err(internal)
}

/// A frame on its way, and where the target really is.
struct Shot {
    truth: CameraFromTarget,
    jpeg: Vec<u8>,
}

/// A ground station.
struct Client {
    base: String,
    http: reqwest::Client,
}

impl Client {
    async fn put<T: serde::Serialize>(&self, path: &str, thing: &T) -> Result<(), Fault> {
        let reply = self.http.put(format!("{}/v1/{path}", self.base)).json(thing).send().await.map_err(internal)?;
        reply.error_for_status().map(|_| ()).map_err(internal)
    }

    async fn estimate(&self, jpeg: Vec<u8>) -> Result<EstimateReply, Fault> {
        let url = format!("{}/v1/estimates?camera=demo&target=wing-six", self.base);
        let post = self.http.post(url).header("content-type", "image/jpeg").body(jpeg).timeout(Duration::from_secs(30));
        let reply = post.send().await.map_err(internal)?.error_for_status().map_err(internal)?;
        reply.json().await.map_err(internal)
    }
}

fn internal(error: impl std::fmt::Display) -> Fault {
    Fault::new(FaultKind::Internal, error.to_string())
}
