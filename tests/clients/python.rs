//! Programs of others, in Python.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

/// Python with these modules, or nothing where there is none and nobody requires it (`ZENOH_TESTS=required`).
pub fn python(modules: &str) -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let own = target.join("swarm/bin/python3");
    let candidates = [std::env::var_os("ZENOH_PYTHON").map(PathBuf::from), Some(own), Some("python3".into())];
    let has_all = |python: &PathBuf| {
        let import = Command::new(python).args(["-c", &format!("import {modules}")]).stderr(Stdio::null()).status();
        import.is_ok_and(|status| status.success())
    };
    let found = candidates.into_iter().flatten().find(has_all);
    assert!(
        found.is_some() || std::env::var_os("ZENOH_TESTS").is_none_or(|value| value != "required"),
        "no Python has {modules}: python3 -m venv {0}/swarm && {0}/swarm/bin/pip install eclipse-zenoh rosbags pymavlink",
        target.display()
    );
    if found.is_none() {
        println!("left out: no Python has {modules}");
    }
    found
}

/// A process, killed when dropped.
pub struct Peer(Child, BufReader<ChildStdout>);

impl Peer {
    pub fn start(python: &Path, script: &str, arguments: &[&str]) -> Self {
        Self::of(Command::new(python), script, arguments)
    }

    /// By a command that runs Python, wherever it does.
    pub fn of(mut command: Command, script: &str, arguments: &[&str]) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/clients").join(script);
        command.arg(script).args(arguments);
        Self::run(command)
    }

    /// Any program.
    pub fn run(mut command: Command) -> Self {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("a process");
        let output = BufReader::new(child.stdout.take().expect("piped"));
        Self(child, output)
    }

    /// Its number.
    #[allow(dead_code, reason = "not everybody asks")]
    pub fn id(&self) -> u32 {
        self.0.id()
    }

    /// Its next line.
    pub fn line(&mut self) -> String {
        let mut line = String::new();
        self.1.read_line(&mut line).expect("a line");
        line.trim().to_owned()
    }

    #[allow(dead_code, reason = "most live as long as their test")]
    pub fn kill(mut self) {
        self.0.kill().expect("kills");
        self.0.wait().expect("ends");
    }

    /// Tells it to go on.
    #[allow(dead_code, reason = "not everybody waits")]
    pub fn go(&mut self) {
        let input = self.0.stdin.as_mut().expect("piped");
        input.write_all(b"go\n").expect("writes");
        input.flush().expect("writes");
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
