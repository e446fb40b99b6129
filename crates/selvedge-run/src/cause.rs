//! Errors with their causes as one line of text.

use std::borrow::Cow;
use std::error::Error;

/// The messages from the outermost to the cause. Many errors already quote their cause: a message
/// that stands in the one before is left out.
pub fn chain(error: &(dyn Error + 'static)) -> String {
    let mut text = String::new();
    let mut last = String::new();
    let mut next = Some(error);
    while let Some(cause) = next {
        next = cause.source();
        let message = cause.to_string();
        if last.contains(message.trim()) {
            continue;
        }
        if !text.is_empty() {
            text.push_str(": ");
        }
        text.push_str(&bounded(message.trim()));
        last = message;
    }
    text
}

/// Bytes of a message that are shown: of its beginning, and of its end, where the cause stands.
const SHOWN: [usize; 2] = [1200, 600];

/// A message that may quote what a file has, of any length, with its middle left out where it is
/// long.
pub fn bounded(message: &str) -> Cow<'_, str> {
    let [first, last] = SHOWN;
    if message.len() <= first + last {
        return Cow::Borrowed(message);
    }
    let start = &message[..message.floor_char_boundary(first)];
    let end = &message[message.ceil_char_boundary(message.len() - last)..];
    let left_out = message.len() - start.len() - end.len();
    Cow::Owned(format!("{start} … ({left_out} bytes left out) … {end}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_messages_lose_their_middle() {
        for whole in ["", "short", &"é".repeat(900)] {
            assert_eq!(bounded(whole), whole);
        }
        let long = format!("{}cause", "é[".repeat(50_000));
        let shown = bounded(&long);
        assert!(shown.len() < 2000 && shown.ends_with("cause"), "{shown}");
        assert!(shown.starts_with("é[") && shown.contains("bytes left out"));
        let error = std::io::Error::other(long);
        assert!(chain(&error).len() < 2000);
    }
}
