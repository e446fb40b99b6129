//! Warnings of the libraries, given to Python's `logging` under the name `selvedge`.

use std::fmt;

use pyo3::prelude::*;
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

/// Hands every warning and every remark on.
struct ToLogging;

/// The words of an event.
#[derive(Default)]
struct Words(String);

impl Visit for Words {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        use fmt::Write;
        // Writing to a string does not fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, " {name}={value:?}"),
        };
    }
}

impl Subscriber for ToLogging {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        let is_ours = ["selvedge", "_native"].map(|name| metadata.target().starts_with(name));
        *metadata.level() <= Level::INFO && is_ours.contains(&true)
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut words = Words::default();
        event.record(&mut words);
        let method = match *event.metadata().level() {
            Level::ERROR => "error",
            Level::WARN => "warning",
            _ => "info",
        };
        // An interpreter that is ending hears no more.
        let _ = Python::try_attach(|py| {
            let logging = py.import("logging")?;
            let logger = logging.call_method1("getLogger", ("selvedge",))?;
            logger.call_method1(method, (words.0,)).map(drop)
        });
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

/// Begins to hand warnings on. Only the first call counts.
pub(crate) fn begin() {
    // A second call asks for what is there.
    let _ = tracing::subscriber::set_global_default(ToLogging);
}
