//! The process, and that it ends.

use std::io;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use super::error::GrabError;
use super::interrupt;

/// How long a child that has closed its output may take to leave.
const GRACE: Duration = Duration::from_secs(5);

/// A child that is killed and waited for at the latest when this is dropped.
#[derive(Debug)]
pub(super) struct Running(Arc<Mutex<Child>>);

impl Running {
    /// Starts it. Its standard output and error are pipes.
    pub(super) fn start(mut command: Command) -> Result<(Self, ChildStdout, ChildStderr), GrabError> {
        // Ctrl-C at a terminal goes to the whole group of processes; we want to be the ones who end it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let not_run = |error: io::Error| match error.kind() {
            io::ErrorKind::NotFound => GrabError::NoProgram,
            _ => GrabError::NotRun { detail: error.to_string() },
        };
        let mut child = command.spawn().map_err(not_run)?;
        let pipes = (child.stdout.take(), child.stderr.take());
        let running = Self(Arc::new(Mutex::new(child)));
        interrupt::end_with_us(&running.0);
        match pipes {
            (Some(out), Some(err)) => Ok((running, out, err)),
            _ => Err(GrabError::NotRun { detail: "it has no output".into() }),
        }
    }

    /// Its standard input, if that is a pipe; given once.
    pub(super) fn take_input(&self) -> Option<ChildStdin> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).stdin.take()
    }

    /// Waits for its end, which is near; whether it was a success. Nothing holds the lock for long, so that a signal can
    /// still end the child.
    pub(super) fn wait(&self) -> bool {
        let deadline = Instant::now() + GRACE;
        loop {
            match self.0.lock().unwrap_or_else(PoisonError::into_inner).try_wait() {
                Ok(Some(status)) => return status.success(),
                Ok(None) if Instant::now() < deadline => {}
                Ok(None) | Err(_) => return false,
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Ends it if it has not ended, and takes its last breath, so that no zombie is left.
    pub(super) fn end(&self) {
        end(&self.0);
    }
}

/// Kills and waits.
pub(super) fn end(child: &Mutex<Child>) {
    let mut child = child.lock().unwrap_or_else(PoisonError::into_inner);
    // An error means that it has ended already; then waiting returns at once.
    let _ = child.kill();
    let _ = child.wait();
}

impl Drop for Running {
    fn drop(&mut self) {
        self.end();
    }
}
