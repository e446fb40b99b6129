//! The words of a .usda file: names, numbers, texts in quotes, assets, paths and signs, with the
//! lines that they stand in. Comments are passed over.

use std::fmt;

use super::super::node::RigError;

/// A piece of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Token<'a> {
    /// A name, a keyword or a number: letters, digits and `_:.+-!`.
    Word(&'a str),
    /// Between quotes, as it is written.
    Text(&'a str),
    /// Between `@`.
    Asset,
    /// Between `<` and `>`.
    Path(&'a str),
    /// Any other character.
    Sign(&'a str),
}

impl fmt::Display for Token<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Word(text) | Self::Sign(text) => write!(f, "{:.40}", text),
            Self::Text(text) => write!(f, "\"{text:.40}\""),
            Self::Asset => write!(f, "an asset"),
            Self::Path(_) => write!(f, "a path"),
        }
    }
}

/// The tokens of a text, one after another.
pub(super) struct Tokens<'a> {
    rest: &'a str,
    line: usize,
    /// The next one, if it has been looked at, with its line and the rest after it.
    ahead: Option<(Token<'a>, usize, &'a str, usize)>,
    /// The line of the last one taken.
    taken: usize,
}

impl<'a> Tokens<'a> {
    pub(super) fn new(text: &'a str) -> Self {
        Self {
            rest: text,
            line: 1,
            ahead: None,
            taken: 1,
        }
    }

    /// The line of the last token taken.
    pub(super) fn line_of_last(&self) -> usize {
        self.taken
    }

    /// An error in the line of the last token taken.
    pub(super) fn wrong(&self, problem: impl fmt::Display) -> RigError {
        in_line(self.taken, problem)
    }

    /// The error that the last token taken was not what was `expected`.
    pub(super) fn expected(&self, expected: &str, found: Token<'_>) -> RigError {
        self.wrong(format!("expected {expected}, found {found}"))
    }

    /// The next token, which stays; none at the end.
    pub(super) fn peek(&mut self) -> Result<Option<Token<'a>>, RigError> {
        if self.ahead.is_none() {
            self.skip_blank();
            if !self.rest.is_empty() {
                let start = self.line;
                let (token, length) = self.token()?;
                let lines = self.rest[..length].matches('\n').count();
                let rest = &self.rest[length..];
                self.ahead = Some((token, start, rest, self.line + lines));
            }
        }
        Ok(self.ahead.map(|ahead| ahead.0))
    }

    /// Returns true when the next token is in a line after the last one taken; `peek` must have
    /// been called.
    pub(super) fn is_at_line_start(&self) -> bool {
        self.ahead.is_some_and(|ahead| ahead.1 > self.taken)
    }

    /// Takes the next token.
    pub(super) fn next(&mut self) -> Result<Token<'a>, RigError> {
        self.peek()?;
        let ahead = self.ahead.take();
        let (token, start, rest, line) =
            ahead.ok_or_else(|| in_line(self.line, "the file ends too early"))?;
        (self.taken, self.rest, self.line) = (start, rest, line);
        Ok(token)
    }

    /// Takes the next token if it is this sign.
    pub(super) fn skip_if(&mut self, sign: &str) -> Result<bool, RigError> {
        let is_there = self.peek()? == Some(Token::Sign(sign));
        if is_there {
            self.next()?;
        }
        Ok(is_there)
    }

    /// Takes this sign.
    pub(super) fn expect(&mut self, sign: &str) -> Result<(), RigError> {
        match self.next()? {
            Token::Sign(found) if found == sign => Ok(()),
            found => Err(self.expected(sign, found)),
        }
    }

    /// Takes a number.
    pub(super) fn number(&mut self) -> Result<f64, RigError> {
        let found = self.next()?;
        let number = match found {
            // A time code may be followed by the colon of its sample.
            Token::Word(word) => word.parse::<f64>().ok().filter(|number| number.is_finite()),
            _ => None,
        };
        number.ok_or_else(|| self.expected("a finite number", found))
    }

    fn skip_blank(&mut self) {
        loop {
            let trimmed = self.rest.trim_start();
            let blank = &self.rest[..self.rest.len() - trimmed.len()];
            self.line += blank.matches('\n').count();
            self.rest = trimmed;
            if !trimmed.starts_with('#') {
                return;
            }
            self.rest = &trimmed[trimmed.find('\n').unwrap_or(trimmed.len())..];
        }
    }

    /// The token at the start of the rest, which is not empty, and its length in bytes.
    fn token(&self) -> Result<(Token<'a>, usize), RigError> {
        let rest = self.rest;
        for quotes in ["\"\"\"", "'''", "\"", "'"] {
            if let Some(after) = rest.strip_prefix(quotes) {
                let inner = self.quoted(after, quotes)?;
                return Ok((Token::Text(inner), inner.len() + 2 * quotes.len()));
            }
        }
        for (open, close) in [("@@@", "@@@"), ("@", "@"), ("<", ">")] {
            if let Some(after) = rest.strip_prefix(open) {
                let inner = after.find(close).ok_or_else(|| self.unclosed(open))?;
                let token = match open {
                    "<" => Token::Path(&after[..inner]),
                    _ => Token::Asset,
                };
                return Ok((token, open.len() + inner + close.len()));
            }
        }
        let is_word = |c: char| c.is_alphanumeric() || "_:.+-!".contains(c);
        let mut length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
        // In `12: (…)` the colon is no part of the number.
        if rest[..length].ends_with(':') && length > 1 {
            length -= 1;
        }
        match rest.chars().next() {
            Some(first) if length == 0 || first == ':' => {
                let length = first.len_utf8();
                Ok((Token::Sign(&rest[..length]), length))
            }
            _ => Ok((Token::Word(&rest[..length]), length)),
        }
    }

    fn quoted(&self, after: &'a str, quotes: &str) -> Result<&'a str, RigError> {
        let mut from = 0;
        while let Some(found) = after[from..].find(quotes) {
            let end = from + found;
            let backslashes = after[..end]
                .chars()
                .rev()
                .take_while(|&c| c == '\\')
                .count();
            if backslashes % 2 == 0 {
                return Ok(&after[..end]);
            }
            from = end + 1;
        }
        Err(self.unclosed(quotes))
    }

    fn unclosed(&self, open: &str) -> RigError {
        in_line(self.line, format!("{open} is not closed"))
    }
}

/// A problem in a line of a text.
pub(super) fn in_line(line: usize, problem: impl fmt::Display) -> RigError {
    RigError::Content(format!("line {line}: {problem}"))
}
