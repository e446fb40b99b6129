//! Circles of imports between the files of a crate: a few files that need each other may be one
//! idea, many are a knot.
//!
//! A file's `pub use` of its own children is no import. A name that is exported again counts as an
//! import of the file that defines it.

use std::collections::{BTreeMap, BTreeSet};

use crate::rust::{ModulePath, RustFile};
use crate::violation::Violation;

/// Files that may need each other in a circle.
const LARGEST: usize = 3;

/// Circles of more files than that.
pub(crate) fn check(files: &[RustFile]) -> Vec<Violation> {
    let mut crates: BTreeMap<&str, Vec<&RustFile>> = BTreeMap::new();
    for file in files {
        let root = file.path.split_once("/src/").map_or("", |(root, _)| root);
        crates.entry(root).or_default().push(file);
    }
    let mut found = Vec::new();
    for (root, files) in crates {
        let modules = Modules::new(root, &files);
        for circle in circles(&modules.imports(&files)) {
            if circle.len() > LARGEST {
                let names: Vec<&str> = circle.iter().map(|&k| &*files[k].path).collect();
                let what = format!("a circle of {} imports: {}", names.len(), names.join(", "));
                let remedy = "move the type that ties them to a file of its own";
                found.push(Violation::new(names[0], 0, what, remedy));
            }
        }
    }
    found
}

type Name = Vec<String>;

/// The modules of a crate.
struct Modules {
    /// Number of the file of each module.
    files: BTreeMap<Name, usize>,
    /// Path of the module of each file.
    names: Vec<Name>,
    /// Full path of each name that a module exports again.
    exports: BTreeMap<(Name, String), Name>,
}

impl Modules {
    fn new(root: &str, files: &[&RustFile]) -> Self {
        let names: Vec<Name> = files.iter().map(|f| module_of(root, &f.path)).collect();
        let numbered = names.iter().cloned().enumerate();
        let mut modules = Self {
            files: numbered.map(|(number, name)| (name, number)).collect(),
            names,
            exports: BTreeMap::new(),
        };
        for (number, file) in files.iter().enumerate() {
            for path in &file.paths {
                if let (Some(full), Some(name)) = (modules.full(number, path), &path.exported_as) {
                    let module = modules.names[number].clone();
                    modules.exports.insert((module, name.clone()), full);
                }
            }
        }
        modules
    }

    /// `path`, written in file `number`, from the root of the crate; none when it leads elsewhere.
    fn full(&self, number: usize, path: &ModulePath) -> Option<Name> {
        let mut here = [&*self.names[number], &*path.within].concat();
        let mut rest = path.segments.as_slice();
        match rest.first().map(String::as_str)? {
            "crate" => {
                here.clear();
                rest = &rest[1..];
            }
            "self" => rest = &rest[1..],
            "super" => {
                while rest.first().is_some_and(|first| first == "super") {
                    here.pop()?;
                    rest = &rest[1..];
                }
            }
            first => {
                here.push(first.to_owned());
                let child = self.files.contains_key(&here);
                here.pop();
                if !child {
                    return None;
                }
            }
        }
        Some([&*here, rest].concat())
    }

    /// The file that defines the item at `full`.
    fn defines(&self, full: &[String], exports_left: usize) -> Option<usize> {
        let prefixes = (0..=full.len()).rev();
        let length = prefixes
            .into_iter()
            .find(|&n| self.files.contains_key(&full[..n]))?;
        let (module, rest) = full.split_at(length);
        if let (Some(name), Some(left)) = (rest.first(), exports_left.checked_sub(1)) {
            let export = self.exports.get(&(module.to_vec(), name.clone()));
            if let Some(export) = export.filter(|export| **export != *full) {
                return self.defines(&[&**export, &rest[1..]].concat(), left);
            }
        }
        self.files.get(module).copied()
    }

    /// The files that each file needs.
    fn imports(&self, files: &[&RustFile]) -> Vec<BTreeSet<usize>> {
        let of_file = |(number, file): (usize, &&RustFile)| {
            let mut needed = BTreeSet::new();
            for path in &file.paths {
                let Some(target) = self.full(number, path).and_then(|p| self.defines(&p, 8)) else {
                    continue;
                };
                let child = self.names[target].starts_with(&self.names[number]);
                if target != number && !(path.exported_as.is_some() && child) {
                    needed.insert(target);
                }
            }
            needed
        };
        files.iter().enumerate().map(of_file).collect()
    }
}

/// Path of the module that a file holds.
fn module_of(root: &str, path: &str) -> Name {
    let inside = path.strip_prefix(root).unwrap_or(path);
    let inside = inside.trim_start_matches("/src/").trim_end_matches(".rs");
    let mut parts: Name = inside.split('/').map(str::to_owned).collect();
    if parts
        .last()
        .is_some_and(|last| ["mod", "lib", "main"].contains(&last.as_str()))
    {
        parts.pop();
    }
    parts
}

/// Groups of two or more files in which each needs every other, directly or not.
fn circles(imports: &[BTreeSet<usize>]) -> Vec<Vec<usize>> {
    let reached: Vec<BTreeSet<usize>> = (0..imports.len()).map(|k| reach(imports, k)).collect();
    let mut seen: BTreeSet<usize> = BTreeSet::new();
    let mut found = Vec::new();
    for k in 0..imports.len() {
        if !seen.contains(&k) && reached[k].contains(&k) {
            let both = reached[k]
                .iter()
                .filter(|&&other| reached[other].contains(&k));
            let circle: Vec<usize> = both.copied().collect();
            seen.extend(&circle);
            found.push(circle);
        }
    }
    found
}

/// All files that can be reached from file `from` by one import or more.
fn reach(imports: &[BTreeSet<usize>], from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut open: Vec<usize> = imports[from].iter().copied().collect();
    while let Some(next) = open.pop() {
        if reached.insert(next) {
            open.extend(&imports[next]);
        }
    }
    reached
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rust::parse;
    use crate::tree::tree_of;

    fn whats(files: &[(&str, &str)]) -> Vec<String> {
        let files: Vec<(String, &str)> = files
            .iter()
            .map(|(path, text)| (format!("crates/x/src/{path}"), *text))
            .collect();
        let files: Vec<(&str, &str)> = files.iter().map(|(p, t)| (&**p, *t)).collect();
        let (files, refused) = parse(&tree_of(&files));
        assert!(refused.is_empty(), "{refused:?}");
        check(&files).into_iter().map(|v| v.what).collect()
    }

    #[test]
    fn a_circle_of_four_is_found_through_every_kind_of_path() {
        let files = [
            ("lib.rs", "mod a; mod b; mod c; mod d; pub use b::B;"),
            ("a.rs", "use crate::B; pub struct A;"),
            ("b.rs", "use super::c::C; pub struct B;"),
            ("c.rs", "pub struct C; fn f(d: crate::d::D) {}"),
            ("d/mod.rs", "use crate::{a::{self, A}}; pub struct D;"),
        ];
        assert_eq!(
            whats(&files),
            [
                "a circle of 4 imports: crates/x/src/a.rs, crates/x/src/b.rs, \
              crates/x/src/c.rs, crates/x/src/d/mod.rs"
            ]
        );
    }

    #[test]
    fn a_circle_of_three_passes_and_so_does_one_of_tests() {
        let files = [
            ("lib.rs", "mod a; mod b; mod c; mod d;"),
            ("a.rs", "use crate::b;"),
            ("b.rs", "use crate::c;"),
            ("c.rs", "use crate::a; use crate::d;"),
            ("d.rs", "#[cfg(test)]\nmod tests { use crate::a; }"),
        ];
        assert!(whats(&files).is_empty());
    }

    #[test]
    fn a_parent_may_export_what_its_children_define() {
        let files = [
            ("lib.rs", "mod a;"),
            (
                "a/mod.rs",
                "mod b; mod c; mod d; mod e; pub use b::B; pub(crate) use c::C;",
            ),
            ("a/b.rs", "use super::C; pub struct B;"),
            ("a/c.rs", "use super::d; pub struct C;"),
            ("a/d.rs", "use super::e;"),
            ("a/e.rs", "pub struct E;"),
        ];
        assert!(whats(&files).is_empty());
    }
}
