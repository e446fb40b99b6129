//! A wish to stop that a long solve hears.
//!
//! A listener belongs to the thread that called. A long piece of work runs on a thread beside it,
//! while the caller goes on asking the listener, and looks at a flag.

use std::ops::ControlFlow;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use selvedge_cloth::Stop;

/// Time between two questions.
pub(crate) const BEAT: Duration = Duration::from_millis(100);

/// Runs `work` on another thread, and meanwhile asks `go_on` from time to time. Where that breaks
/// `stop` is set, and `work` is waited for. Nothing is asked of short work.
pub(crate) fn beside<R: Send>(
    stop: &Stop,
    go_on: &mut dyn FnMut() -> ControlFlow<()>,
    work: impl FnOnce() -> R + Send,
) -> R {
    // A browser has no threads to ask from.
    if cfg!(target_family = "wasm") {
        return work();
    }
    let (sender, receiver) = channel();
    thread::scope(|scope| {
        let running = scope.spawn(move || {
            let result = work();
            // The other end waits until this one is dropped.
            let _ = sender.send(());
            result
        });
        while receiver.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
            if !stop.is_wanted() && go_on().is_break() {
                stop.ask();
            }
        }
        match running.join() {
            Ok(result) => result,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Instant;

    #[test]
    fn long_work_hears_the_wish_and_short_work_is_not_asked() {
        let mut asked = 0;
        let stop = Stop::default();
        let result = beside(
            &stop,
            &mut || {
                asked += 1;
                ControlFlow::Continue(())
            },
            || 7,
        );
        assert_eq!((result, stop.is_wanted()), (7, false));
        assert!(asked <= 1);
        let began = Instant::now();
        let heard = beside(&stop, &mut || ControlFlow::Break(()), || {
            while !stop.is_wanted() {
                assert!(began.elapsed() < Duration::from_secs(60));
                thread::sleep(Duration::from_millis(1));
            }
            true
        });
        assert!(heard && stop.is_wanted());
    }
}
