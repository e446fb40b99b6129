//! Long work: the interpreter's lock is released, Ctrl-C is heard, progress is told.
//!
//! Python lets only its main thread handle signals, so the work goes to another thread, and the
//! caller looks every few hundredths of a second whether there was one. Work that is asked to stop
//! is waited for: what it was writing is whole.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::prelude::*;
use selvedge::{Event, Goal};

/// Time between two looks for a signal.
const LOOK: Duration = Duration::from_millis(30);

/// A wish to stop, and the exception that is its reason.
#[derive(Default)]
pub(crate) struct Stop {
    flag: Arc<AtomicBool>,
    reason: Mutex<Option<PyErr>>,
}

impl Stop {
    /// The flag that is set where someone wants to stop.
    pub(crate) fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.flag)
    }

    /// A wish that also sets this flag.
    pub(crate) fn with_flag(flag: Arc<AtomicBool>) -> Self {
        flag.store(false, Ordering::Relaxed);
        Self {
            flag,
            reason: Mutex::default(),
        }
    }

    /// Breaks a loop after the wish.
    pub(crate) fn flow(&self) -> ControlFlow<()> {
        if self.flag.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Asks for an end, for this reason if it is the first.
    pub(crate) fn ask(&self, reason: Option<PyErr>) {
        let mut known = self.reason.lock().unwrap_or_else(PoisonError::into_inner);
        if known.is_none() {
            *known = reason;
        }
        self.flag.store(true, Ordering::Relaxed);
    }

    fn take_reason(&self) -> Option<PyErr> {
        let mut known = self.reason.lock().unwrap_or_else(PoisonError::into_inner);
        known.take()
    }
}

/// Runs `work` without the interpreter's lock while Ctrl-C is heard. The first exception, of a
/// signal or of a callback, is raised once the work has ended.
pub(crate) fn beside<R: Send>(
    py: Python<'_>,
    stop: &Stop,
    work: impl FnOnce() -> R + Send,
) -> PyResult<R> {
    let result = py.detach(|| {
        let (sender, receiver) = channel();
        thread::scope(|scope| {
            let running = scope.spawn(move || {
                let result = work();
                // The other end waits until this one is dropped.
                let _ = sender.send(());
                result
            });
            while receiver.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if let Err(signal) = Python::attach(|py| py.check_signals()) {
                    stop.ask(Some(signal));
                }
            }
            running.join()
        })
    });
    match (result, stop.take_reason()) {
        (_, Some(reason)) => Err(reason),
        (Ok(result), None) => Ok(result),
        (Err(panic), None) => std::panic::resume_unwind(panic),
    }
}

/// [`beside`] for work that tells `progress` how far it is, and hears of the wish to stop.
pub(crate) fn beside_reporting<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Stop, &mut Progress<'_>) -> R + Send,
) -> PyResult<R> {
    let stop = Stop::default();
    let mut reporter = Progress::new(progress, &stop);
    beside(py, &stop, || work(&stop, &mut reporter))
}

/// A callback of Python that hears of progress; none where nobody listens.
pub(crate) struct Progress<'a> {
    callback: Option<Py<PyAny>>,
    stop: &'a Stop,
    task: String,
    goal: Option<u64>,
    done: u64,
}

impl<'a> Progress<'a> {
    /// Tells `callback` as `callback(task, done, goal)`; a goal that is not known is `None`.
    pub(crate) fn new(callback: Option<Py<PyAny>>, stop: &'a Stop) -> Self {
        Self {
            callback,
            stop,
            task: String::new(),
            goal: None,
            done: 0,
        }
    }

    /// Begins a task of so many units.
    pub(crate) fn begin(&mut self, task: &str, goal: Option<u64>) {
        task.clone_into(&mut self.task);
        self.goal = goal;
        self.done = 0;
    }

    /// Counts one more unit. Breaks where someone wants to stop.
    pub(crate) fn advance(&mut self) -> ControlFlow<()> {
        self.done += 1;
        let Some(callback) = &self.callback else {
            return self.stop.flow();
        };
        let state = (self.task.as_str(), self.done, self.goal);
        call(callback, self.stop, |py| {
            Ok(state.into_pyobject(py)?.unbind())
        });
        self.stop.flow()
    }

    /// Hears an event of the laboratory.
    pub(crate) fn on_event(&mut self, event: Event<'_>) -> ControlFlow<()> {
        match event {
            Event::Begun { task, goal, .. } => {
                let goal = match goal {
                    Goal::Count(count) => Some(count),
                    Goal::Open => None,
                };
                self.begin(task, goal);
                ControlFlow::Continue(())
            }
            Event::Advanced => self.advance(),
            Event::Asked => self.stop.flow(),
            Event::Remarked(line) => {
                tracing::info!("{line}");
                ControlFlow::Continue(())
            }
            Event::Noted(_) | Event::Ended => ControlFlow::Continue(()),
        }
    }
}

/// Calls `callback` with the arguments that `arguments` makes. An answer of `False` asks for an
/// end, and so does an exception, which is raised in the end.
pub(crate) fn call(
    callback: &Py<PyAny>,
    stop: &Stop,
    arguments: impl FnOnce(Python<'_>) -> PyResult<Py<pyo3::types::PyTuple>>,
) {
    let answer = Python::attach(|py| {
        let answer = callback.bind(py).call1(arguments(py)?.bind(py).clone())?;
        Ok(!answer.is_none() && !answer.is_truthy()?)
    });
    match answer {
        Ok(false) => {}
        Ok(true) => stop.ask(None),
        Err(problem) => stop.ask(Some(problem)),
    }
}
