//! A JSON object that knows where it is in its file and which of its keys have been read.

use std::collections::BTreeSet;
use std::fmt::Display;
use std::ops::RangeInclusive;

use glam::DVec3;
use serde_json::{Map, Value};

use super::super::problem::SceneProblem;
use crate::formats::unique::Unique;

/// An object of the file.
pub(super) struct Object<'a> {
    /// Within of the object, as `cloths[0].`; nothing at the top.
    prefix: String,
    entries: &'a Map<String, Value>,
    read: BTreeSet<&'a str>,
}

/// Reads JSON in which `//` and `/* */` are comments, and in which no key stands twice.
pub(super) fn parse_json(text: &str) -> Result<Value, SceneProblem> {
    match serde_json::from_str(&without_comments(text)) {
        Ok(Unique(value)) => Ok(value),
        // Any value is taken: only a repeated key is no syntax.
        Err(error) if error.is_data() => Err(SceneProblem::RepeatedKey(error)),
        Err(error) => Err(SceneProblem::Json(error)),
    }
}

/// The text with blanks for comments, so that lines and columns stay.
fn without_comments(text: &str) -> String {
    #[derive(PartialEq)]
    enum Within {
        Code,
        Text,
        Line,
        Block,
    }
    let mut place = Within::Code;
    let mut plain = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let next = letters.peek().copied();
        match (&place, letter, next) {
            (Within::Code, '/', Some('/')) => place = Within::Line,
            (Within::Code, '/', Some('*')) => {
                letters.next();
                plain.push(' ');
                place = Within::Block;
            }
            (Within::Code, '"', _) => place = Within::Text,
            (Within::Text, '"', _) => place = Within::Code,
            (Within::Text, '\\', Some(escaped)) => {
                plain.push(letter);
                plain.push(escaped);
                letters.next();
                continue;
            }
            (Within::Line, '\n', _) => place = Within::Code,
            (Within::Block, '*', Some('/')) => {
                letters.next();
                plain.push_str("  ");
                place = Within::Code;
                continue;
            }
            _ => {}
        }
        let hidden = matches!(place, Within::Line | Within::Block) && letter != '\n';
        plain.push(if hidden { ' ' } else { letter });
    }
    plain
}

impl<'a> Object<'a> {
    /// The object `value`, which stands at `place` in its file.
    pub(super) fn new(value: &'a Value, place: String) -> Result<Self, SceneProblem> {
        let Some(entries) = value.as_object() else {
            let key = if place.is_empty() { "the file" } else { &place };
            return Err(problem(key, "must be an object", value));
        };
        let prefix = match place.as_str() {
            "" => place,
            place => format!("{place}."),
        };
        Ok(Self {
            prefix,
            entries,
            read: BTreeSet::new(),
        })
    }

    /// The value of `key`, if there is one that is not null.
    pub(super) fn value(&mut self, key: &'a str) -> Option<&'a Value> {
        self.read.insert(key);
        self.entries.get(key).filter(|value| !value.is_null())
    }

    /// Passes over `keys`: they have no effect here, and none is missed.
    pub(super) fn pass_over(&mut self, keys: &[&'a str]) {
        self.read.extend(keys);
    }

    pub(super) fn number(&mut self, key: &'a str) -> Result<Option<f64>, SceneProblem> {
        self.value(key)
            .map(|value| number(value).ok_or_else(|| self.wrong(key, "must be a number", value)))
            .transpose()
    }

    /// A number that must be in `range`.
    pub(super) fn number_within(
        &mut self,
        key: &'a str,
        range: &RangeInclusive<f64>,
    ) -> Result<Option<f64>, SceneProblem> {
        match self.number(key)? {
            Some(number) if !range.contains(&number) => {
                let must = format!("must be between {} and {}", range.start(), range.end());
                Err(self.wrong(key, &must, &number))
            }
            number => Ok(number),
        }
    }

    pub(super) fn needed_number(&mut self, key: &'a str) -> Result<f64, SceneProblem> {
        self.number(key)?.ok_or_else(|| self.missing(key))
    }

    pub(super) fn whole(&mut self, key: &'a str) -> Result<Option<u64>, SceneProblem> {
        self.value(key)
            .map(|value| {
                value
                    .as_u64()
                    .ok_or_else(|| self.wrong(key, "must be a whole number from 0", value))
            })
            .transpose()
    }

    pub(super) fn text(&mut self, key: &'a str) -> Result<Option<&'a str>, SceneProblem> {
        self.value(key)
            .map(|value| {
                value
                    .as_str()
                    .ok_or_else(|| self.wrong(key, "must be a text", value))
            })
            .transpose()
    }

    pub(super) fn numbers<const N: usize>(
        &mut self,
        key: &'a str,
    ) -> Result<Option<[f64; N]>, SceneProblem> {
        self.value(key)
            .map(|value| {
                numbers(value).ok_or_else(|| {
                    self.wrong(key, &format!("must be a list of {N} numbers"), value)
                })
            })
            .transpose()
    }

    pub(super) fn vector(&mut self, key: &'a str) -> Result<Option<DVec3>, SceneProblem> {
        Ok(self.numbers::<3>(key)?.map(DVec3::from_array))
    }

    /// A vector of at most this length.
    pub(super) fn vector_up_to(
        &mut self,
        key: &'a str,
        most: f64,
    ) -> Result<Option<DVec3>, SceneProblem> {
        match self.vector(key)? {
            Some(vector) if vector.length() > most => {
                let must = format!("must be at most {most} long");
                Err(self.wrong(key, &must, &vector))
            }
            vector => Ok(vector),
        }
    }

    /// The entries of a list; none where there is no list.
    pub(super) fn list(&mut self, key: &'a str) -> Result<&'a [Value], SceneProblem> {
        match self.value(key) {
            None => Ok(&[]),
            Some(Value::Array(entries)) => Ok(entries),
            Some(other) => Err(self.wrong(key, "must be a list", other)),
        }
    }

    /// The objects of a list.
    pub(super) fn objects(&mut self, key: &'a str) -> Result<Vec<Object<'a>>, SceneProblem> {
        let prefix = self.prefix.clone();
        let entries = self.list(key)?.iter().enumerate();
        entries
            .map(|(k, entry)| Object::new(entry, format!("{prefix}{key}[{k}]")))
            .collect()
    }

    pub(super) fn child(&mut self, key: &'a str) -> Result<Option<Object<'a>>, SceneProblem> {
        self.value(key)
            .map(|value| Object::new(value, self.place(key)))
            .transpose()
    }

    /// Within of `key` in the file.
    pub(super) fn place(&self, key: &str) -> String {
        format!("{}{key}", self.prefix)
    }

    pub(super) fn wrong(&self, key: &str, must: &str, found: &impl Display) -> SceneProblem {
        problem(&self.place(key), must, found)
    }

    pub(super) fn missing(&self, key: &str) -> SceneProblem {
        SceneProblem::Key {
            key: self.place(key),
            problem: "is missing".to_owned(),
        }
    }

    /// Warns of the keys that nobody has read.
    pub(super) fn finish(self, warnings: &mut Vec<String>) {
        for key in self.entries.keys() {
            if !self.read.contains(key.as_str()) {
                let place = self.place(key);
                warnings.push(format!("{place} is not supported: it has no effect"));
            }
        }
    }
}

/// The numbers of a list of exactly `N`.
pub(super) fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let entries: Option<Vec<f64>> = value.as_array()?.iter().map(number).collect();
    entries?.try_into().ok()
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().filter(|number| number.is_finite())
}

fn problem(key: &str, must: &str, found: &impl Display) -> SceneProblem {
    let mut found = found.to_string();
    if let Some((cut, _)) = found.char_indices().nth(60) {
        found.truncate(cut);
        found.push('…');
    }
    SceneProblem::Key {
        key: key.to_owned(),
        problem: format!("{must}, found {found}"),
    }
}
