//! Messages of failures: one line, `error: what was done: what went wrong: why`, and an exit code
//! that says whether the call itself was wrong.

use std::io::Write;

use selvedge_lab::evaluation::ChoiceError;

const FAILED: u8 = 1;
/// Wrong usage, as clap has it.
const WRONG_USAGE: u8 = 2;

/// A call that makes no sense, as opposed to one that went wrong: says what is wrong with it, and
/// how it should be.
pub(crate) fn wrong(problem: impl Into<String>) -> anyhow::Error {
    ChoiceError(problem.into()).into()
}

/// The exit code of the program.
pub(crate) fn exit_code(error: &anyhow::Error) -> u8 {
    if error.is::<ChoiceError>() { WRONG_USAGE } else { FAILED }
}

/// Tells a person.
pub(crate) fn print(error: &anyhow::Error) {
    // Where standard error is closed nobody can be told.
    let _ = writeln!(std::io::stderr(), "error: {}", chain(error));
}

/// The messages from the outermost to the cause, as one line.
pub(crate) fn chain(error: &anyhow::Error) -> String {
    selvedge::cause::chain(error.as_ref())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_told_once() {
        let cause = std::io::Error::other("disk full");
        let quoting = anyhow::Error::new(cause).context("a.txt: disk full");
        assert_eq!(
            chain(&quoting.context("saving")),
            "saving: a.txt: disk full"
        );
    }
}
