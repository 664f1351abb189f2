//! A service of its own for each test, and a client.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use std::time::Duration;

use nalgebra::Vector3;
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use skypose::geometry::{CameraFromTarget, rotation};
use skypose::random;
use skypose::scene::encode;
use skypose::scene::models::{demo_camera, wing};
use skypose::scene::render::{Optics, Sky, render};
use skypose::shell::config::Settings;
use skypose::shell::http::App;
use skypose::shell::http::server::{Server, Stopper};
use skypose::shell::service::Service;
use skypose::shell::wire::{CameraWire, TargetWire};
use tempfile::TempDir;
use tokio::task::JoinHandle;

pub struct Station {
    pub base: String,
    pub http: reqwest::Client,
    pub stopper: Stopper,
    pub serving: JoinHandle<std::io::Result<()>>,
    /// The network, where the settings name one.
    #[cfg(feature = "zenoh")]
    #[allow(dead_code, reason = "asked for by the tests of the network alone")]
    pub bus: Option<skypose::shell::bus::Bus>,
    /// What is sent to a ground station, where the settings name one.
    #[cfg(feature = "mavlink")]
    #[allow(dead_code, reason = "asked for by its own tests alone")]
    pub mavlink: Option<skypose::shell::mavlink::Mavlink>,
    folder: TempDir,
}

/// A reply read to its end.
#[derive(Debug)]
pub struct Reply {
    pub status: StatusCode,
    pub headers: reqwest::header::HeaderMap,
    pub json: Value,
}

/// A client that trusts nobody, as it asks nobody for a certificate: to read those of the system takes a debug build longer than a test's own work.
pub fn client() -> reqwest::Client {
    let builder = reqwest::Client::builder().tls_certs_only([]).timeout(Duration::from_secs(30));
    builder.build().expect("a client")
}

impl Station {
    pub async fn start() -> Self {
        Self::with(|_| {}).await
    }

    pub async fn with(change: impl FnOnce(&mut Settings)) -> Self {
        let _ = rustls::crypto::ring::default_provider().install_default();
        skypose::shell::telemetry::metrics();
        let data = tempfile::tempdir().expect("a folder");
        let mut settings = Settings::default();
        settings.http.listen.set_port(0);
        settings.store.data = data.path().join("data");
        change(&mut settings);
        let app = App::new(Service::start(settings).await.expect("starts"));
        #[cfg(feature = "zenoh")]
        let bus = skypose::shell::bus::Bus::open(app.service.clone()).await.expect("joins");
        #[cfg(feature = "mavlink")]
        let mavlink = skypose::shell::mavlink::Mavlink::open(&app.service).await.expect("sends");
        let server = Server::bind(app).expect("binds");
        let base = format!("http://{}", server.address().expect("bound"));
        let stopper = server.stopper();
        let serving = tokio::spawn(server.run());
        let http = client();
        Self {
            base,
            http,
            stopper,
            serving,
            #[cfg(feature = "zenoh")]
            bus,
            #[cfg(feature = "mavlink")]
            mavlink,
            folder: data,
        }
    }

    /// With the demo's camera and target stored.
    pub async fn equipped() -> Self {
        Self::equipped_with(|_| {}).await
    }

    /// The same with other settings.
    pub async fn equipped_with(change: impl FnOnce(&mut Settings)) -> Self {
        let station = Self::with(change).await;
        let camera = station.put("/v1/cameras/demo", &json!(CameraWire::from(&demo_camera()))).await;
        let target = station.put("/v1/targets/wing-six", &json!(TargetWire::from(&wing().target))).await;
        assert_eq!((camera.status, target.status), (StatusCode::CREATED, StatusCode::CREATED));
        station
    }

    /// Where it stores everything.
    pub fn data(&self) -> PathBuf {
        self.folder.path().join("data")
    }

    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        self.http.request(method, format!("{}{path}", self.base))
    }

    pub async fn get(&self, path: &str) -> Reply {
        read(self.request(Method::GET, path)).await
    }

    pub async fn put(&self, path: &str, body: &Value) -> Reply {
        read(self.request(Method::PUT, path).json(body)).await
    }

    pub async fn post(&self, path: &str, body: &Value) -> Reply {
        read(self.request(Method::POST, path).json(body)).await
    }

    pub async fn post_bytes(&self, path: &str, content_type: &str, body: impl Into<reqwest::Body>) -> Reply {
        read(self.request(Method::POST, path).header("content-type", content_type).body(body)).await
    }
}

pub async fn read(request: RequestBuilder) -> Reply {
    let response = request.send().await.expect("an answer");
    let (status, headers) = (response.status(), response.headers().clone());
    let bytes = response.bytes().await.expect("a whole answer");
    let json = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
    Reply { status, headers, json }
}

impl Reply {
    /// A problem of this status, well formed.
    pub fn assert_problem(&self, status: u16) -> &Self {
        assert_eq!(self.status.as_u16(), status, "{self:?}");
        assert_eq!(self.headers["content-type"], "application/problem+json", "{self:?}");
        assert_eq!(self.json["status"], status);
        for member in ["type", "title", "detail"] {
            assert!(self.json[member].as_str().is_some_and(|text| !text.is_empty()), "{member} of {self:?}");
        }
        self
    }

    pub fn detail(&self) -> &str {
        self.json["detail"].as_str().unwrap_or_default()
    }

    pub fn pointer(&self) -> &str {
        self.json["pointer"].as_str().unwrap_or_default()
    }
}

/// Where the target is in [`frame`].
pub fn truth() -> CameraFromTarget {
    CameraFromTarget::new(rotation::exp(&Vector3::new(0.35, -0.25, 0.6)), Vector3::new(0.4, -0.2, 4.5))
}

/// A frame of the demo's target before the demo's camera, without the coding.
pub fn frame() -> &'static skypose::frame::Frame {
    static FRAME: LazyLock<skypose::frame::Frame> = LazyLock::new(|| {
        let sky = Sky::fair(3, [0.0; 2]);
        render(&demo_camera(), &truth(), &wing(), &sky, &Optics::default(), &mut random::named("station"))
    });
    &FRAME
}

pub fn jpeg() -> Vec<u8> {
    static JPEG: LazyLock<Vec<u8>> = LazyLock::new(|| encode::jpeg(frame(), 92).expect("encodes"));
    JPEG.clone()
}

/// The pose of a reply is that of [`truth`]: within its own covariance, and within a degree and one percent.
pub fn assert_true_pose(pose: &Value) {
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
    };
    let translation = Vector3::from_vec(numbers(&pose["translation_m"]));
    let rows: Vec<Vec<f64>> = pose["rotation"]["matrix"].as_array().expect("rows").iter().map(numbers).collect();
    let matrix = nalgebra::Matrix3::from_fn(|r, c| rows[r][c]);
    let found = CameraFromTarget::new(nalgebra::Rotation3::from_matrix_unchecked(matrix), translation);
    let error = found.difference_to(&truth());
    assert!(error.fixed_rows::<3>(0).norm() < 0.01 * truth().translation.norm(), "{error}");
    assert!(error.fixed_rows::<3>(3).norm() < 1_f64.to_radians(), "{error}");
    let covariance: Vec<Vec<f64>> = pose["covariance"].as_array().expect("rows").iter().map(numbers).collect();
    let covariance = nalgebra::Matrix6::from_fn(|r, c| covariance[r][c]);
    let nees = error.dot(&covariance.cholesky().expect("positive definite").solve(&error));
    // 99.99 % of chi-square with six degrees of freedom.
    assert!(nees < 27.9, "{nees}");
}

/// Text without the value of its last member, `timing_us`, which differs by nature.
pub fn without_timing(text: &[u8]) -> &[u8] {
    let word = b"\"timing_us\":";
    let at = text.windows(word.len()).position(|window| window == word).expect("it tells its times");
    let value: Value = serde_json::from_slice(&text[at + word.len()..text.len() - 1]).expect("an object at the end");
    assert!(value["total"].as_u64().is_some_and(|total| total > 0), "{value}");
    &text[..at]
}

/// A frame, its camera, its target and the method for it.
pub struct Case {
    pub frame: Vec<u8>,
    pub camera: Value,
    pub target: Value,
    pub method: &'static str,
}

/// Recorded frames of several kinds.
pub fn corpus() -> Vec<Case> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/frames");
    let truth = std::fs::read(folder.join("truth.json")).expect("a truth");
    let truth: Value = serde_json::from_slice(&truth).expect("JSON");
    let frames = truth["frames"].as_array().expect("frames");
    let case = |entry: &Value| {
        let name = entry["frame"].as_str().expect("a name");
        let mut target = entry["target"].clone();
        target["name"] = json!("recorded");
        let method = if name.starts_with("led") { "beacon" } else { "color" };
        let frame = std::fs::read(folder.join(name)).expect("a frame");
        Case { frame, camera: entry["camera"].clone(), target, method }
    };
    frames.iter().step_by(2).map(case).collect()
}
