//! Ctrl-C: the first press asks for an orderly end, the second one ends the program.
//!
//! The first press only sets a flag. Loops poll it, stop where they are and finish what can be
//! finished, so that every file that exists is whole. A signal to terminate counts as a press.
//!
//! Where no loop hears of the press for a while, the program is at work that cannot be stopped in
//! the middle. It then ends by itself, unless a file is being written or results would be lost.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, LazyLock, OnceLock};
use std::time::{Duration, Instant};

use anyhow::Context;

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
/// Time from the press to the last loop that heard of it `[ms]`.
static HEARD: AtomicU64 = AtomicU64::new(0);
static PRESSED: OnceLock<Instant> = OnceLock::new();
/// There are results that no file has yet.
static UNSAVED: AtomicBool = AtomicBool::new(false);

/// Time that a loop has to hear of the press, and the next one after it.
const PATIENCE: Duration = Duration::from_millis(500);
/// Between two looks at whether the program can end.
const LOOK: Duration = Duration::from_millis(20);

/// The exit code after an interruption, as shells have it.
pub(crate) const EXIT_CODE: u8 = 130;

/// Starts to listen for presses.
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(EXIT_CODE));
        }
        PRESSED.get_or_init(Instant::now);
        // No panic where standard error is closed.
        let _ = writeln!(
            std::io::stderr(),
            "\ninterrupted: finishing the files (press Ctrl-C again to stop at once)"
        );
        std::thread::spawn(end_the_deaf);
    })
    .context("listening for Ctrl-C")
}

/// Ends the program where no loop hears of the press and nothing would be lost.
fn end_the_deaf() {
    loop {
        let heard = Duration::from_millis(HEARD.load(Ordering::SeqCst));
        let is_deaf = since_press() > heard + PATIENCE;
        if is_deaf && !UNSAVED.load(Ordering::SeqCst) && !selvedge_data::is_writing() {
            let _ = writeln!(std::io::stderr(), "stopped: nothing was left to finish");
            std::process::exit(i32::from(EXIT_CODE));
        }
        std::thread::sleep(LOOK);
    }
}

/// Time since the first press.
fn since_press() -> Duration {
    PRESSED.get().map_or(Duration::ZERO, Instant::elapsed)
}

/// Says that from now on there are results that no file has yet.
pub(crate) fn keep_results() {
    if !UNSAVED.swap(true, Ordering::SeqCst) {
        tracing::debug!("there are results: Ctrl-C waits until they are written");
    }
}

/// The flag that the first press sets.
pub(crate) fn flag() -> Arc<AtomicBool> {
    Arc::clone(&REQUESTED)
}

/// Returns `true` after the first press.
pub(crate) fn requested() -> bool {
    let requested = REQUESTED.load(Ordering::SeqCst);
    if requested {
        let heard = u64::try_from(since_press().as_millis()).unwrap_or(u64::MAX);
        HEARD.fetch_max(heard, Ordering::SeqCst);
    }
    requested
}

/// Breaks a loop after the first press.
pub(crate) fn flow() -> ControlFlow<()> {
    if requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
