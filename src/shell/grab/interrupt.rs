//! Ctrl-C and SIGTERM while children run: they end first, then whoever fetches frames finds no more and comes to an end.
//!
//! The second signal ends us at once.

use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError, Weak};

use super::child::end;
use super::error::GrabError;

/// Signals are the process's, and so is what is known of them.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static CHILDREN: Mutex<Vec<Weak<Mutex<Child>>>> = Mutex::new(Vec::new());
static WATCHED: OnceLock<Result<(), String>> = OnceLock::new();

/// The exit code of a program that Ctrl-C ended: 128 and the number of the signal.
const EXIT_CODE: i32 = 130;

/// Whether we have been asked to end.
#[must_use]
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// Registers a child that is to end at a signal.
pub(super) fn end_with_us(child: &Arc<Mutex<Child>>) {
    let mut children = CHILDREN.lock().unwrap_or_else(PoisonError::into_inner);
    children.retain(|child| child.strong_count() > 0);
    children.push(Arc::downgrade(child));
    drop(children);
    if is_interrupted() {
        end(child);
    }
}

/// Listens to signals from the first call on.
pub(super) fn watch() -> Result<(), GrabError> {
    let watched = WATCHED.get_or_init(|| listen().map_err(|error| error.to_string()));
    watched.clone().map_err(|detail| GrabError::NotRun { detail })
}

fn listen() -> std::io::Result<()> {
    use tokio::signal::unix::{SignalKind, signal};
    let runtime = tokio::runtime::Builder::new_current_thread().enable_io().build()?;
    let guard = runtime.enter();
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    drop(guard);
    let watching = async move {
        for is_first in [true, false] {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            INTERRUPTED.store(true, Ordering::Relaxed);
            let children = CHILDREN.lock().unwrap_or_else(PoisonError::into_inner);
            children.iter().filter_map(Weak::upgrade).for_each(|child| end(&child));
            if !is_first {
                leave();
            }
        }
    };
    std::thread::Builder::new().name("signals".into()).spawn(move || runtime.block_on(watching)).map(|_| ())
}

#[expect(clippy::exit, reason = "somebody asked twice: whatever does not come to its end is left as it is")]
fn leave() {
    std::process::exit(EXIT_CODE);
}
