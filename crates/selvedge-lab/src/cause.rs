//! Errors with their causes as one line of text.

use std::error::Error;

/// The messages from the outermost to the cause. Many errors already quote their cause: a message
/// that stands in the one before is left out.
#[must_use]
pub fn chain(error: &(dyn Error + 'static)) -> String {
    let mut told = String::new();
    let mut last = String::new();
    let mut next = Some(error);
    while let Some(cause) = next {
        next = cause.source();
        let message = cause.to_string();
        if last.contains(message.trim()) {
            continue;
        }
        if !told.is_empty() {
            told.push_str(": ");
        }
        told.push_str(message.trim());
        last = message;
    }
    told
}
