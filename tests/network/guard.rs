//! The guarded configurations of `deploy/zenoh`, as they are shipped, at other places: who belongs to them comes through, a stranger does
//! not come in, and nobody does what is another's.

use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use rcgen::{BasicConstraints, CertificateParams, CertifiedIssuer, DnType, IsCa, KeyPair};
use serde_json::{Value, json};
use tempfile::TempDir;
use zenoh::Session;
use zenoh::bytes::{Encoding, ZBytes};
use zenoh::handlers::FifoChannelHandler;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::sample::{Locality, Sample};

use crate::station::{Station, assert_true_pose, jpeg};

const BASE: &str = "skypose/v1/default/alpha";
/// Longer than anything here takes.
const SOON: Duration = Duration::from_secs(20);
/// Longer than what is allowed takes; what is not has not come until then.
const A_WHILE: Duration = Duration::from_secs(1);

type Listener = Subscriber<FifoChannelHandler<Sample>>;

/// Certificates, and the configurations that name them.
struct Papers(TempDir);

impl Papers {
    /// Of an authority: one for each of these, at this machine.
    fn of(names: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let mut params = CertificateParams::new(Vec::new()).expect("parameters");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        params.distinguished_name.push(DnType::CommonName, "swarm");
        let authority = CertifiedIssuer::self_signed(params, KeyPair::generate().expect("a key")).expect("signs");
        let papers = Self(folder);
        papers.write("ca.pem", &authority.pem());
        for name in names {
            let mut params = CertificateParams::new(vec!["localhost".into()]).expect("parameters");
            params.distinguished_name.push(DnType::CommonName, *name);
            let key = KeyPair::generate().expect("a key");
            papers.write(&format!("{name}.pem"), &params.signed_by(&key, &authority).expect("signs").pem());
            papers.write(&format!("{name}.key"), &key.serialize_pem());
        }
        papers
    }

    /// By the commands that the example tells; nothing where there is no openssl.
    fn by_the_example() -> Option<Self> {
        if Command::new("openssl").arg("version").output().is_err() {
            println!("left out: there is no openssl");
            return None;
        }
        let text = deployed("guarded.json5");
        let commands: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("//   ")).collect();
        let commands = commands.join("\n").replace("DNS:$name.local", "DNS:localhost");
        assert!(commands.contains("openssl") && commands.contains("localhost"), "{commands}");
        let papers = Self(tempfile::tempdir().expect("a folder"));
        let done = Command::new("sh").args(["-ec", &commands]).current_dir(papers.0.path()).output().expect("a shell");
        assert!(done.status.success(), "{done:?}");
        Some(papers)
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) {
        std::fs::write(self.0.path().join(name), text).expect("writes");
    }

    /// A shipped configuration with these papers, where nothing but what has to be is replaced. The file's path.
    fn config(&self, example: &str, port: u16, who: &str) -> String {
        let mut text = deployed(example);
        for (from, to) in [
            ("tls/0.0.0.0:7447", format!("tls/127.0.0.1:{port}")),
            ("tls/alpha.local:7447", format!("tls/localhost:{port}")),
            ("/etc/skypose/member.", format!("{}.", self.path(who))),
            ("/etc/skypose/", self.path("")),
        ] {
            text = text.replace(from, &to);
        }
        let name = format!("{who}-{example}");
        self.write(&name, &text);
        self.path(&name)
    }

    async fn open(&self, port: u16, who: &str) -> zenoh::Result<Session> {
        let config = zenoh::Config::from_file(self.config("member.json5", port, who)).expect("a configuration");
        // Who is not let in waits for nothing else.
        tokio::time::timeout(SOON, async { zenoh::open(config).await }).await.expect("in time")
    }
}

fn deployed(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("deploy/zenoh").join(name);
    std::fs::read_to_string(path).expect("an example")
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|socket| socket.local_addr()).expect("a free port").port()
}

/// A node with the stream `front`, on the network that the file says.
async fn node(network: String) -> Station {
    let station = Station::equipped_with(|settings| {
        settings.zenoh.network = network;
        settings.zenoh.node = "alpha".into();
        settings.streams.max_age_ms = 20_000;
    })
    .await;
    for camera in ["front", "aft"] {
        let stream = json!({"camera": "demo", "targets": ["wing-six"]});
        let stored = station.put(&format!("/v1/streams/{camera}"), &stream).await;
        assert_eq!(stored.status, 201, "{stored:?}");
    }
    station
}

async fn listen(session: &Session, key: &str) -> Listener {
    session.declare_subscriber(format!("{BASE}/{key}")).await.expect("listens")
}

async fn send(session: &Session, key: &str, payload: impl Into<ZBytes>, sequence: u64) {
    let note = json!({ "sequence": sequence }).to_string();
    session
        .put(format!("{BASE}/{key}"), payload)
        .encoding(Encoding::IMAGE_JPEG)
        .attachment(note)
        .congestion_control(CongestionControl::Block)
        // Not to oneself.
        .allowed_destination(Locality::Remote)
        .await
        .expect("sends");
}

async fn next(listener: &Listener) -> Option<Sample> {
    tokio::time::timeout(A_WHILE, listener.recv_async()).await.ok().map(|sample| sample.expect("open"))
}

fn json_of(payload: &ZBytes) -> Value {
    serde_json::from_slice(&payload.to_bytes()).expect("JSON")
}

/// Whether somebody answers.
async fn is_answered(session: &Session, call: &str) -> bool {
    let replies = session.get(format!("{BASE}/rpc/{call}")).timeout(A_WHILE).await.expect("asks");
    replies.recv_async().await.is_ok_and(|reply| reply.result().is_ok())
}

/// Sends as the camera until the ground station hears of it, as what is declared has to cross first. The frames that it took.
async fn answered(camera: &Session, estimates: &Listener) -> u64 {
    let start = Instant::now();
    let mut sequence = 0;
    loop {
        assert!(start.elapsed() < SOON, "no estimate of {sequence} frames");
        send(camera, "camera/front/frame", jpeg(), sequence).await;
        if let Some(sample) = next(estimates).await {
            assert_true_pose(&json_of(sample.payload())["targets"][0]["pose"]);
            return sequence + 1;
        }
        sequence += 1;
    }
}

/// What the node has counted of a camera.
async fn status(ground: &Session, camera: &str) -> Value {
    let statuses = listen(ground, &format!("camera/{camera}/status")).await;
    // The first may have been on its way before.
    let mut last = Value::Null;
    for _ in 0..2 {
        let sample = tokio::time::timeout(SOON, statuses.recv_async()).await.expect("in time").expect("a status");
        last = json_of(sample.payload());
    }
    last
}

/// Camera and ground station do what is theirs; everything else is denied to them, and everything to who has a certificate of the authority
/// and no name that is known.
async fn assert_each_has_its_own(camera: &Session, ground: &Session, nobody: &Session) {
    let estimates = listen(ground, "camera/front/estimate").await;
    let frames = answered(camera, &estimates).await;
    assert!(is_answered(ground, "health").await);
    // Frames of who may only listen, of another camera than one's own, of nobody.
    send(ground, "camera/front/frame", jpeg(), 1000).await;
    send(nobody, "camera/front/frame", jpeg(), 2000).await;
    send(camera, "camera/aft/frame", jpeg(), 3000).await;
    // Estimates that no node has made.
    let forgery = json!({"targets": []}).to_string();
    send(ground, "camera/front/estimate", forgery.clone(), 0).await;
    send(camera, "camera/front/estimate", forgery.clone(), 0).await;
    send(nobody, "camera/front/estimate", forgery, 0).await;
    // What is seen is not for all.
    let (camera_hears, nobody_hears) = (listen(camera, "camera/*/*").await, listen(nobody, "camera/*/*").await);
    let exactly = listen(nobody, "camera/front/estimate").await;
    assert!(!is_answered(camera, "health").await && !is_answered(nobody, "health").await);
    assert!(next(&estimates).await.is_none(), "a frame or an estimate came from who may not send it");
    send(camera, "camera/front/frame", jpeg(), frames).await;
    assert!(next(&estimates).await.is_some(), "who may goes on");
    for listener in [camera_hears, nobody_hears, exactly] {
        assert!(next(&listener).await.is_none(), "who may not has heard something");
    }
    let front = status(ground, "front").await;
    println!("{front}");
    assert_eq!((&front["refused"], &front["restarts"]), (&json!(0), &json!(0)), "{front}");
    assert_eq!((&front["last_sequence"], &front["published"]), (&json!(frames), &front["received"]), "{front}");
    assert!(front["received"].as_u64() <= Some(frames + 1), "{front}");
    assert_eq!(status(ground, "aft").await["received"], 0);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_guarded_node_lets_each_do_what_is_its_own() {
    let papers = Papers::of(&["alpha", "front", "ground", "mallory"]);
    let port = free_port();
    let _node = node(papers.config("guarded.json5", port, "alpha")).await;
    let camera = papers.open(port, "front").await.expect("comes in");
    let ground = papers.open(port, "ground").await.expect("comes in");
    let nobody = papers.open(port, "mallory").await.expect("has a certificate of ours");
    assert_each_has_its_own(&camera, &ground, &nobody).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_guarded_router_lets_each_do_what_is_its_own() {
    let papers = Papers::of(&["router", "alpha", "front", "ground", "mallory"]);
    let port = free_port();
    let config = zenoh::Config::from_file(papers.config("router.json5", port, "router")).expect("a configuration");
    let _router = zenoh::open(config).await.expect("listens");
    let _node = node(papers.config("member.json5", port, "alpha")).await;
    let camera = papers.open(port, "front").await.expect("comes in");
    let ground = papers.open(port, "ground").await.expect("comes in");
    let nobody = papers.open(port, "mallory").await.expect("has a certificate of ours");
    assert_each_has_its_own(&camera, &ground, &nobody).await;
    // What nodes tell of each other's bodies is for nodes and ground stations, and each speaks in its own name.
    let alpha = papers.open(port, "alpha").await.expect("comes in");
    let (at_ground, at_alpha) = (bodies(&ground, "*", "*").await, bodies(&alpha, "*", "alpha").await);
    let start = Instant::now();
    loop {
        send(&alpha, "body/beta/relative", "{}", 0).await;
        if next(&at_ground).await.is_some() {
            break;
        }
        assert!(start.elapsed() < SOON, "the ground station does not hear of bodies");
    }
    for forger in [&ground, &camera, &nobody, &alpha] {
        forger
            .put("skypose/v1/default/beta/body/alpha/relative", "{}")
            .allowed_destination(Locality::Remote)
            .await
            .expect("sends");
    }
    assert!(next(&at_alpha).await.is_none() && next(&at_ground).await.is_none(), "somebody spoke for beta");
}

/// What a node says of another's body.
async fn bodies(session: &Session, node: &str, other: &str) -> Listener {
    let key = format!("skypose/v1/default/{node}/body/{other}/relative");
    session.declare_subscriber(key).await.expect("listens")
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_stranger_does_not_come_in() {
    let papers = Papers::of(&["alpha", "ground"]);
    let port = free_port();
    let node = node(papers.config("guarded.json5", port, "alpha")).await;
    let refused = async |config: zenoh::Config, who: &str| {
        let opened = tokio::time::timeout(SOON, async { zenoh::open(config).await }).await.expect("in time");
        let error = opened.err().unwrap_or_else(|| panic!("{who} came in")).to_string();
        println!("{who}: {error}");
    };
    let with = |change: &[(&str, Value)]| {
        let mut config = zenoh::Config::from_file(papers.config("member.json5", port, "ground")).expect("well formed");
        for (key, value) in change {
            config.insert_json5(key, &value.to_string()).expect("a setting");
        }
        config
    };
    let tls = |key: &str| format!("transport/link/tls/{key}");
    refused(
        with(&[
            ("connect/endpoints", json!([format!("tcp/127.0.0.1:{port}")])),
            ("transport/link/protocols", json!(["tcp"])),
        ]),
        "who speaks in clear",
    )
    .await;
    refused(
        with(&[
            (&tls("enable_mtls"), json!(false)),
            (&tls("connect_certificate"), Value::Null),
            (&tls("connect_private_key"), Value::Null),
        ]),
        "who has no certificate",
    )
    .await;
    // The same name, signed by somebody else, who takes the node's authority for granted.
    let others = Papers::of(&["alpha", "ground"]);
    refused(
        with(&[
            (&tls("connect_certificate"), json!(others.path("ground.pem"))),
            (&tls("connect_private_key"), json!(others.path("ground.key"))),
        ]),
        "who has another authority's certificate",
    )
    .await;
    // A certificate without its key.
    refused(with(&[(&tls("connect_private_key"), json!(others.path("ground.key")))]), "who has found a certificate")
        .await;
    let ground = papers.open(port, "ground").await.expect("who belongs to us comes in");
    assert!(is_answered(&ground, "health").await);
    drop(node);
    // Nor is anybody taken in by a node that is none.
    let port = free_port();
    let _impostor = self::node(others.config("guarded.json5", port, "alpha")).await;
    assert!(papers.open(port, "ground").await.is_err(), "the impostor's certificate was believed");
    assert!(others.open(port, "ground").await.is_ok());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn certificates_made_as_the_example_says_are_good() {
    let Some(papers) = Papers::by_the_example() else { return };
    let port = free_port();
    let _node = node(papers.config("guarded.json5", port, "alpha")).await;
    let camera = papers.open(port, "front").await.expect("comes in");
    let ground = papers.open(port, "ground").await.expect("comes in");
    let estimates = listen(&ground, "camera/front/estimate").await;
    answered(&camera, &estimates).await;
}
