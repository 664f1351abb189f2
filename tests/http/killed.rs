//! The program, killed in the middle of its work and started again.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use reqwest::RequestBuilder;
use serde_json::{Value, json};

use crate::calibrations::{form, gone, request, wall};
use crate::station::client;

const PICTURES: u64 = 7;

/// The program in a process of its own, ended with the test.
pub struct Program {
    child: Child,
    pub base: String,
}

impl Program {
    pub fn start(data: &Path) -> Self {
        Self::with(data, &[])
    }

    /// With further options.
    pub fn with(data: &Path, options: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skypose"));
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("SKYPOSE_")) {
            command.env_remove(name);
        }
        command
            .env("SKYPOSE_JOBS_THREADS", "1")
            .args(["serve", "--listen", "127.0.0.1:0", "--data"])
            .arg(data)
            .args(options);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("starts");
        let mut line = String::new();
        BufReader::new(child.stdout.as_mut().expect("piped")).read_line(&mut line).expect("a line");
        let base = line.trim().strip_prefix("listening on ").expect("the contract's words").to_owned();
        Self { child, base }
    }

    pub async fn get(&self, place: &str) -> Value {
        let text = client().get(format!("{}{place}", self.base)).send().await.expect("an answer").text().await;
        serde_json::from_str(&text.expect("a text")).expect("JSON")
    }

    /// Where the job is.
    async fn post(&self) -> String {
        let wall = wall(2000, 1500);
        let pictures = (0..PICTURES).map(|number| (format!("{number:02}.png"), wall.clone()));
        let form = form(&request(), pictures);
        self.make("/v1/calibrations", |post| post.multipart(form)).await
    }

    /// Where the job is that is made of this body.
    pub async fn make(&self, kind: &str, body: impl FnOnce(RequestBuilder) -> RequestBuilder) -> String {
        let post = client().post(format!("{}{kind}", self.base));
        let reply = body(post).send().await.expect("an answer");
        assert_eq!(reply.status(), 202);
        reply.headers()["location"].to_str().expect("a text").to_owned()
    }

    pub async fn when(&self, place: &str, holds: impl Fn(&Value) -> bool) -> Value {
        for _ in 0..12_000 {
            let job = self.get(place).await;
            if holds(&job) {
                return job;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        panic!("it never came: {}", self.get(place).await);
    }

    /// SIGKILL: no time for last words.
    pub fn kill(mut self) {
        self.child.kill().expect("it lives");
        self.child.wait().expect("it ends");
    }

    pub fn terminate(mut self) {
        let status = Command::new("kill").args(["-TERM", &self.child.id().to_string()]).status();
        assert!(status.expect("kill is there").success());
        assert!(self.child.wait().expect("it ends").success());
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn is_final(job: &Value) -> bool {
    job["finished_us"].is_i64()
}

#[tokio::test]
async fn a_job_whose_process_is_killed_comes_to_the_result_of_one_left_alone() {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let data = tempfile::tempdir().expect("a folder");
    let program = Program::start(data.path());
    let place = program.post().await;
    let mut done = 0;
    // Killed at work, and again at work; the third is told to stop, which is gentler.
    let mut program = program;
    for end in [Program::kill as fn(Program), Program::kill, Program::terminate] {
        let job = program.when(&place, |job| job["shards_done"].as_u64() > Some(done)).await;
        done = job["shards_done"].as_u64().expect("a number");
        assert!(done < PICTURES, "more pictures are needed to be killed at work: {job}");
        end(program);
        program = Program::start(data.path());
        let kept = program.get(&place).await;
        assert!(kept["shards_done"].as_u64() >= Some(done), "{done} were done: {kept}");
    }
    let resumed = program.when(&place, is_final).await;
    let undisturbed = program.post().await;
    let undisturbed = program.when(&undisturbed, is_final).await;
    for member in ["status", "shards", "shards_done", "progress", "result", "error"] {
        assert_eq!(resumed[member], undisturbed[member], "{member}");
    }
    // Each picture was told of once, however often it was looked at.
    let events = client().get(format!("{}{place}/events", program.base)).send().await.expect("an answer");
    let events = events.text().await.expect("it ends");
    for number in 0..PICTURES {
        let told = events.matches(&format!("\"message\":\"{number:02}.png: ")).count();
        assert_eq!(told, 1, "picture {number}: {events}");
    }
    let left = data.path().join("jobs").join(place.rsplit('/').next().expect("an id")).join("uploads");
    gone(&left).await;
}

#[tokio::test]
async fn an_evaluation_whose_process_is_killed_comes_to_the_figures_of_one_left_alone() {
    killed_twice(&json!({"study": "thesis-2012", "runs": 12_000, "solvers": ["epnp+refine"]})).await;
}

#[tokio::test]
async fn encounters_whose_process_is_killed_come_to_the_figures_of_those_left_alone() {
    killed_twice(&json!({"kind": "encounters", "runs": 100})).await;
}

async fn killed_twice(study: &Value) {
    let _ = rustls::crypto::ring::default_provider().install_default();
    let data = tempfile::tempdir().expect("a folder");
    let mut program = Program::start(data.path());
    let post = async |program: &Program| program.make("/v1/evaluations", |post| post.json(study)).await;
    let place = post(&program).await;
    let mut done = 0;
    for _ in 0..2 {
        let job = program.when(&place, |job| job["shards_done"].as_u64() > Some(done)).await;
        done = job["shards_done"].as_u64().expect("a number");
        assert!(job["shards"].as_u64() > Some(done), "more shards are needed to be killed at work: {job}");
        program.kill();
        program = Program::start(data.path());
        assert!(program.get(&place).await["shards_done"].as_u64() >= Some(done));
    }
    let mut resumed = program.when(&place, is_final).await;
    let undisturbed = post(&program).await;
    let mut undisturbed = program.when(&undisturbed, is_final).await;
    for job in [&mut resumed, &mut undisturbed] {
        assert_eq!(job["status"], "succeeded", "{job}");
        job["result"].as_object_mut().expect("figures").remove("timing");
    }
    assert_eq!(resumed["result"], undisturbed["result"]);
}
