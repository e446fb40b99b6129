//! Progress: a bar with rate and estimate on standard error for what takes longer than two seconds.
//! Where standard error is no terminal, a plain line every ten seconds instead.
//!
//! A [`Progress`] may be told from several threads at once; [`listener`] shows what the laboratory
//! reports.

use std::fmt;
use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use selvedge::{Event, Goal};

use crate::interrupt;

/// Nothing is shown before.
const PATIENCE: Duration = Duration::from_secs(2);
/// Between two plain lines.
const PLAIN_INTERVAL: Duration = Duration::from_secs(10);
/// Between two drawings of the bar.
const DRAWS_PER_SECOND: u8 = 8;

/// True where no progress is shown.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Shows no progress from now on.
pub(crate) fn be_quiet() {
    QUIET.store(true, Ordering::Relaxed);
}

/// Another process talks to people.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Says nothing from now on.
pub(crate) fn silence() {
    SILENT.store(true, Ordering::Relaxed);
    be_quiet();
}

/// A count on its way to a total.
pub(crate) struct Progress {
    what: String,
    unit: &'static str,
    goal: Goal,
    /// Time after which it ends, whatever the count is by then.
    limit: Option<Duration>,
    started: Instant,
    form: Form,
}

enum Form {
    /// Nothing is shown.
    Quiet,
    Bar(ProgressBar),
    Plain(Mutex<Plain>),
}

struct Plain {
    done: u64,
    said: Instant,
    note: String,
}

impl Progress {
    /// Starts counting to `total` of `unit` (in the plural).
    pub(crate) fn new(what: impl Into<String>, total: usize, unit: &'static str) -> Self {
        Self::start(what.into(), Goal::Count(total as u64), unit)
    }

    fn start(what: String, goal: Goal, unit: &'static str) -> Self {
        let started = Instant::now();
        tracing::debug!("{what}: begun");
        let form = if QUIET.load(Ordering::Relaxed) {
            Form::Quiet
        } else if std::io::stderr().is_terminal() {
            Form::Bar(hidden_bar(&what, goal, unit))
        } else {
            Form::Plain(Mutex::new(Plain {
                done: 0,
                said: started,
                note: String::new(),
            }))
        };
        Self {
            what,
            unit,
            goal,
            limit: None,
            started,
            form,
        }
    }

    /// The same, ended by a span of time if the count is not done before.
    pub(crate) fn within(mut self, limit: Option<Duration>) -> Self {
        self.limit = limit;
        self
    }

    /// One more is done, which is a result that is to be kept.
    pub(crate) fn advance(&self) {
        interrupt::keep_results();
        self.count();
    }

    /// One more is done, as [`Self::advance`]; breaks after Ctrl-C.
    pub(crate) fn step(&self) -> ControlFlow<()> {
        self.advance();
        interrupt::flow()
    }

    /// One more is done; nothing is lost where the program ends now.
    pub(crate) fn count(&self) {
        match &self.form {
            Form::Quiet => {}
            Form::Bar(bar) => {
                if bar.is_hidden() && self.started.elapsed() >= PATIENCE {
                    bar.set_draw_target(ProgressDrawTarget::stderr_with_hz(DRAWS_PER_SECOND));
                }
                bar.inc(1);
                if let Some(limit) = self.limit {
                    let left = limit.saturating_sub(self.started.elapsed());
                    bar.set_prefix(format!("{}, {} s at most", self.what, left.as_secs()));
                }
            }
            Form::Plain(plain) => {
                // A panic elsewhere does not make a count wrong.
                let mut plain = plain.lock().unwrap_or_else(PoisonError::into_inner);
                plain.done += 1;
                if plain.said.elapsed() >= PLAIN_INTERVAL {
                    plain.said = Instant::now();
                    self.say(plain.done, &plain.note);
                }
            }
        }
    }

    /// A word on what is being done now, beside the bar.
    pub(crate) fn note(&self, note: impl Into<String>) {
        match &self.form {
            Form::Quiet => {}
            Form::Bar(bar) => bar.set_message(note.into()),
            Form::Plain(plain) => {
                let mut plain = plain.lock().unwrap_or_else(PoisonError::into_inner);
                plain.note = note.into();
            }
        }
    }

    fn say(&self, done: u64, note: &str) {
        let elapsed = self.started.elapsed().as_secs_f64();
        let rate = done as f64 / elapsed.max(1e-9);
        let (of, left) = match self.goal {
            Goal::Open => Default::default(),
            Goal::Count(total) => {
                let left = total.saturating_sub(done) as f64 / rate.max(1e-9);
                let limit = self.limit.map_or(f64::INFINITY, |limit| {
                    (limit.as_secs_f64() - elapsed).max(0.0)
                });
                let left = format!(", about {:.0} s to go", left.min(limit));
                (format!(" of {total}"), left)
            }
        };
        let note = match note {
            "" => String::new(),
            note => format!(", {note}"),
        };
        // Standard error may be closed; that is no reason to stop.
        let _ = writeln!(
            std::io::stderr(),
            "{}: {done}{of} {} after {elapsed:.0} s, {rate:.1} per second{left}{note}",
            self.what,
            self.unit
        );
    }
}

/// Says a line on standard error, which may be closed; that is no reason to stop.
pub(crate) fn say(line: &str) {
    if SILENT.load(Ordering::Relaxed) {
        return;
    }
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Shows the events of an operation and stops it after Ctrl-C.
pub(crate) fn listener() -> impl FnMut(Event<'_>) -> ControlFlow<()> + Send {
    listening(Progress::advance)
}

/// As [`listener`], of an operation that has in files what it is to keep.
pub(crate) fn listener_of_files() -> impl FnMut(Event<'_>) -> ControlFlow<()> + Send {
    listening(Progress::count)
}

fn listening(advance: fn(&Progress)) -> impl FnMut(Event<'_>) -> ControlFlow<()> + Send {
    let mut shown: Option<Progress> = None;
    move |event| {
        match (event, &shown) {
            (Event::Begun { task, goal, unit }, _) => {
                shown = Some(Progress::start(task.to_owned(), goal, unit));
            }
            (Event::Advanced, Some(progress)) => match progress.goal {
                // A search: its steps are of no use without its end.
                Goal::Open => progress.count(),
                Goal::Count(_) => advance(progress),
            },
            (Event::Noted(note), Some(progress)) => progress.note(note),
            (Event::Ended, _) => shown = None,
            (Event::Remarked(line), _) => say(line),
            (Event::Advanced | Event::Noted(_) | Event::Asked, _) => {}
        }
        match event {
            Event::Advanced | Event::Asked => interrupt::flow(),
            // Nobody listens to the answer.
            _ => ControlFlow::Continue(()),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Form::Bar(bar) = &self.form {
            bar.finish_and_clear();
        }
    }
}

fn hidden_bar(what: &str, goal: Goal, unit: &str) -> ProgressBar {
    let (total, template) = match goal {
        Goal::Count(total) => (
            Some(total),
            format!(
                "{{prefix}} [{{bar:12}}] {{pos}}/{{len}} {unit}, {{rate}}, {{eta}} to go  {{wide_msg}}"
            ),
        ),
        Goal::Open => (
            None,
            format!("{{prefix}} {{pos}} {unit}, {{rate}}  {{wide_msg}}"),
        ),
    };
    let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::hidden());
    // A bar that cannot be written is no reason to stop.
    let style = ProgressStyle::with_template(&template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .with_key("rate", |state: &ProgressState, out: &mut dyn fmt::Write| {
            let _ = write!(out, "{:.1}/s", state.per_sec());
        })
        .progress_chars("=> ");
    bar.with_style(style).with_prefix(what.to_owned())
}
