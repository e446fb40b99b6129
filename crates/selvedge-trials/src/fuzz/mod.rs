//! Readers of files, texts and messages, each with its examples: libFuzzer damages them nightly
//! ([`Guided`]), a test reads all of them as they are ([`replay`]).

mod bench;
mod guided;
mod readers;
mod replay;
mod seeds;
mod targets;

pub use self::guided::Guided;
pub use self::replay::{Replayed, replay};
pub(crate) use self::seeds::{SCENE, TRAINING};
use self::targets::TARGETS;

/// Length that the text of an error may have over three times that of the input with its control
/// characters escaped `[bytes]`: the program shortens what quotes a whole input, but nothing may
/// grow.
const LONGEST_TEXT: usize = 4096;

pub(crate) fn names() -> [&'static str; TARGETS.len()] {
    TARGETS.map(|target| target.name)
}

fn is_too_long(text: &str, input: &[u8]) -> bool {
    text.len() > LONGEST_TEXT + 3 * input.escape_ascii().count()
}
