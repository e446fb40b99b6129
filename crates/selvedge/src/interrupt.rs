//! Ctrl-C: the first press asks for an orderly end, the second one ends the program.
//!
//! The first press only sets a flag. Loops poll it, stop where they are and finish what can be
//! finished, so that every file that exists is whole. A signal to terminate counts as a press.

use std::io::Write;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Context;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// The exit code after an interruption.
pub(crate) const EXIT_CODE: u8 = 1;

/// Starts to listen for presses.
///
/// # Errors
/// When the system refuses a handler.
pub(crate) fn install() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(EXIT_CODE));
        }
        // No panic where standard error is closed.
        let _ = writeln!(
            std::io::stderr(),
            "\ninterrupted: finishing the files (press Ctrl-C again to stop at once)"
        );
    })
    .context("listening for Ctrl-C")
}

/// Returns `true` after the first press.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}

/// Breaks a loop after the first press.
pub(crate) fn flow() -> ControlFlow<()> {
    if requested() {
        ControlFlow::Break(())
    } else {
        ControlFlow::Continue(())
    }
}
