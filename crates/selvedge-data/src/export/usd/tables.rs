//! The tables of a crate: tokens, strings, paths, fields (a name with a value), sets of fields, and
//! specs (a path with a set of fields).

use std::collections::BTreeMap;

use indexmap::IndexSet;

use super::crate_file::Spec;
use crate::formats::packing::{pack, pack_numbers};

/// End of a set of fields.
const END: u32 = u32::MAX;

/// Tables under way. Equal texts and paths are one entry.
#[derive(Debug, Default)]
pub(super) struct Tables {
    tokens: Texts,
    strings: Vec<u32>,
    /// Paths from the root: "/", "/a", "/a/b.c".
    paths: Texts,
    fields: Vec<(u32, u64)>,
    sets: Vec<u32>,
    specs: Vec<[u32; 3]>,
}

/// Texts, numbered in the order in which they came.
type Texts = IndexSet<String>;

fn number(texts: &mut Texts, text: &str) -> u32 {
    texts.insert_full(text.to_owned()).0 as u32
}

impl Tables {
    /// The number of a token.
    pub(super) fn token(&mut self, text: &str) -> u32 {
        number(&mut self.tokens, text)
    }

    /// The number of a string.
    pub(super) fn string(&mut self, text: &str) -> u32 {
        // A text ends at its first zero.
        let token = self.token(&text.replace('\0', " "));
        self.strings.push(token);
        self.strings.len() as u32 - 1
    }

    /// The number of a path.
    pub(super) fn path(&mut self, path: &str) -> u32 {
        number(&mut self.paths, path)
    }

    /// Adds a spec with these fields.
    pub(super) fn spec(&mut self, path: &str, spec: Spec, fields: &BTreeMap<&str, u64>) {
        let path = self.path(path);
        let set = self.sets.len() as u32;
        for (name, value) in fields {
            let name = self.token(name);
            self.sets.push(self.fields.len() as u32);
            self.fields.push((name, *value));
        }
        self.sets.push(END);
        self.specs.push([path, set, spec as u32]);
    }

    /// The names and bytes of all tables.
    pub(super) fn sections(mut self) -> [(&'static str, Vec<u8>); 6] {
        // The tree of paths names parts of paths by tokens.
        let tree = tree(&self.paths, &mut self.tokens);
        let mut tokens = Vec::new();
        for text in &self.tokens {
            tokens.extend(text.as_bytes());
            tokens.push(0);
        }
        let mut token_table = count(self.tokens.len());
        token_table.extend(count(tokens.len()));
        token_table.extend(counted(pack(&tokens)));
        let mut strings = count(self.strings.len());
        strings.extend(self.strings.iter().flat_map(|n| n.to_le_bytes()));
        let mut fields = count(self.fields.len());
        fields.extend(numbers(
            self.fields.iter().map(|field| field.0.cast_signed()),
        ));
        let values: Vec<u8> = self.fields.iter().flat_map(|f| f.1.to_le_bytes()).collect();
        fields.extend(counted(pack(&values)));
        let mut sets = count(self.sets.len());
        sets.extend(numbers(self.sets.iter().map(|n| n.cast_signed())));
        let mut paths = count(self.paths.len());
        paths.extend(count(self.paths.len()));
        for list in tree {
            paths.extend(numbers(list.into_iter()));
        }
        let mut specs = count(self.specs.len());
        for column in 0..3 {
            let column = self.specs.iter().map(|spec| spec[column].cast_signed());
            specs.extend(numbers(column));
        }
        [
            ("TOKENS", token_table),
            ("STRINGS", strings),
            ("FIELDS", fields),
            ("FIELDSETS", sets),
            ("PATHS", paths),
            ("SPECS", specs),
        ]
    }
}

fn count(count: usize) -> Vec<u8> {
    (count as u64).to_le_bytes().to_vec()
}

/// Packed bytes after their length.
fn counted(packed: Vec<u8>) -> Vec<u8> {
    [count(packed.len()), packed].concat()
}

fn numbers(numbers: impl Iterator<Item = i32>) -> Vec<u8> {
    counted(pack_numbers(&numbers.collect::<Vec<_>>()))
}

/// The tree of paths as three lists, a path before its children before its siblings: their numbers,
/// the tokens of their last parts, negative for properties, and jumps. -2: neither child nor sibling
/// follows; -1: a child; 0: a sibling; else a child, and a sibling so many entries on. Every path is
/// there with all that are above it.
fn tree(paths: &Texts, tokens: &mut Texts) -> [Vec<i32>; 3] {
    let mut sorted = Vec::with_capacity(paths.len());
    for (number, path) in paths.iter().enumerate() {
        let parts = path.split(['/', '.']).filter(|part| !part.is_empty());
        sorted.push((parts.collect::<Vec<&str>>(), number));
    }
    sorted.sort();
    let depth = |place: usize| sorted.get(place).map_or(0, |(parts, _)| parts.len());
    let mut lists = [const { Vec::new() }; 3];
    for (place, (parts, path)) in sorted.iter().enumerate() {
        // Token 0 is the name of a prim: every property has a sign.
        let name = number(tokens, parts.last().copied().unwrap_or_default()).cast_signed();
        let next = (place + 1..sorted.len()).find(|&other| depth(other) <= depth(place));
        let sibling = next.filter(|&other| depth(other) == depth(place));
        let jump = match (depth(place + 1) > depth(place), sibling) {
            (false, Some(_)) => 0,
            (false, None) => -2,
            (true, Some(other)) => (other - place) as i32,
            (true, None) => -1,
        };
        lists[0].push(*path as i32);
        lists[1].push(if paths[*path].contains('.') { -name } else { name });
        lists[2].push(jump);
    }
    lists
}
