//! Options of a trial: `--name value` pairs.

use std::time::Duration;

use anyhow::{Context, Result, bail};
use selvedge_lab::span;

/// The options that were given, in order.
pub(crate) struct Arguments {
    pairs: Vec<(String, String)>,
}

impl Arguments {
    /// Splits `words` into pairs of these `names` and their values.
    ///
    /// # Errors
    /// Another name, or a name without its value.
    pub(crate) fn parse(words: &[String], names: &[&str]) -> Result<Self> {
        let mut pairs = Vec::new();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            if !names.contains(&word.as_str()) {
                bail!("{word:?} is no option here: {}", names.join(" "));
            }
            let value = words.next();
            let value = value.with_context(|| format!("{word} needs a value"))?;
            pairs.push((word.clone(), value.clone()));
        }
        Ok(Self { pairs })
    }

    /// All values of `name`.
    pub(crate) fn all(&self, name: &str) -> Vec<&str> {
        let given = self.pairs.iter().filter(|pair| pair.0 == name);
        given.map(|pair| pair.1.as_str()).collect()
    }

    /// The number after `name`.
    ///
    /// # Errors
    /// A value that is no number.
    pub(crate) fn number(&self, name: &str) -> Result<Option<u64>> {
        let Some(last) = self.all(name).pop() else {
            return Ok(None);
        };
        let number = last.parse();
        Ok(Some(number.with_context(|| {
            format!("{name} {last}: not a whole number")
        })?))
    }

    /// The span of time after `name`.
    ///
    /// # Errors
    /// A value that is no span.
    pub(crate) fn span(&self, name: &str) -> Result<Option<Duration>> {
        let span = self.all(name).pop().map(span::parse);
        span.transpose().with_context(|| name.to_owned())
    }
}
