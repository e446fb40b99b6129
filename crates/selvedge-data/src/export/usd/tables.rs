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
        let mut tree = Tree::default();
        Node::tree(&self.paths).add_to(&mut tree, &mut self.tokens, false);
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
        paths.extend(count(tree.paths.len()));
        for list in [tree.paths, tree.names, tree.jumps] {
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

/// The tree of paths as lists, a node before its children before its siblings.
#[derive(Debug, Default)]
struct Tree {
    /// Numbers of the paths.
    paths: Vec<i32>,
    /// Tokens of the last parts of the paths, negative for properties.
    names: Vec<i32>,
    /// -2: neither child nor sibling follows; -1: a child; 0: a sibling; else a child, and a
    /// sibling so many nodes on.
    jumps: Vec<i32>,
}

/// A path within the path above it.
#[derive(Debug, Default)]
struct Node {
    name: String,
    number: u32,
    is_property: bool,
    children: Vec<Node>,
}

impl Node {
    /// The tree of all paths, with "/" at its root. Every path is there with all that are above it.
    fn tree(paths: &Texts) -> Self {
        let mut root = Self::default();
        for (number, path) in paths.iter().enumerate() {
            let mut node = &mut root;
            let (prim, property) = match path.split_once('.') {
                Some((prim, property)) => (prim, Some(property)),
                None => (path.as_str(), None),
            };
            let prims = prim.split('/').filter(|name| !name.is_empty());
            let steps = prims.map(|name| (name, false));
            for (name, is_property) in steps.chain(property.map(|name| (name, true))) {
                node = node.child(name, is_property);
            }
            node.number = number as u32;
        }
        root
    }

    fn child(&mut self, name: &str, is_property: bool) -> &mut Self {
        let known = self
            .children
            .iter()
            .position(|child| child.name == name && child.is_property == is_property);
        let place = known.unwrap_or_else(|| {
            self.children.push(Self {
                name: name.to_owned(),
                is_property,
                ..Self::default()
            });
            self.children.len() - 1
        });
        &mut self.children[place]
    }

    /// Adds the node and all below it.
    fn add_to(&self, tree: &mut Tree, tokens: &mut Texts, has_sibling: bool) {
        let place = tree.paths.len();
        tree.paths.push(self.number.cast_signed());
        // Token 0 is the name of a prim: every property has a sign.
        let name = number(tokens, &self.name).cast_signed();
        tree.names.push(if self.is_property { -name } else { name });
        tree.jumps.push(0);
        for (number, child) in self.children.iter().enumerate() {
            child.add_to(tree, tokens, number + 1 < self.children.len());
        }
        tree.jumps[place] = match (self.children.is_empty(), has_sibling) {
            (true, true) => 0,
            (true, false) => -2,
            (false, true) => (tree.paths.len() - place) as i32,
            (false, false) => -1,
        };
    }
}
