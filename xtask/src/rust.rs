//! The Rust files of the tree, parsed: paths between modules.
//!
//! Modules that exist only for tests, files in `tests`, `benches` and `examples` folders and files
//! called `tests.rs` or `test_*.rs` are left out. Macro calls are not looked into.

use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, ItemUse, UseTree};

use crate::tree::Tree;

/// A parsed file of a crate.
pub(crate) struct RustFile {
    /// Path relative to the root.
    pub(crate) path: String,
    /// Imports and paths of the file, those of its inline modules included.
    pub(crate) paths: Vec<ModulePath>,
}

/// A path of an import, an expression or a type.
pub(crate) struct ModulePath {
    /// Inline modules around it, outermost first.
    pub(crate) within: Vec<String>,
    pub(crate) segments: Vec<String>,
    /// Name under which a `pub use` exports it again.
    pub(crate) exported_as: Option<String>,
}

/// Parses the Rust files of the product: `crates/*/src` and `xtask/src`. A file that does not parse
/// is named with the parser's words.
pub(crate) fn parse(tree: &Tree) -> (Vec<RustFile>, Vec<(String, String)>) {
    let (mut files, mut refused) = (Vec::new(), Vec::new());
    for text in &tree.texts {
        if !is_product(&text.path) {
            continue;
        }
        match syn::parse_file(&text.text) {
            Ok(parsed) => {
                let mut reader = Reader::default();
                reader.visit_file(&parsed);
                files.push(RustFile {
                    path: text.path.clone(),
                    paths: reader.paths,
                });
            }
            Err(error) => refused.push((text.path.clone(), error.to_string())),
        }
    }
    (files, refused)
}

fn is_product(path: &str) -> bool {
    let Some((_, inside)) = path.split_once("src/") else {
        return false;
    };
    let name = inside.rsplit('/').next().unwrap_or_default();
    path.ends_with(".rs")
        && !inside.split('/').any(|part| part == "tests")
        && name != "tests.rs"
        && !name.starts_with("test_")
}

#[derive(Default)]
struct Reader {
    within: Vec<String>,
    paths: Vec<ModulePath>,
}

impl Reader {
    fn add_import(&mut self, tree: &UseTree, before: &[String], public: bool) {
        let mut segments = before.to_vec();
        match tree {
            UseTree::Path(path) => {
                segments.push(path.ident.to_string());
                self.add_import(&path.tree, &segments, public);
            }
            UseTree::Group(group) => {
                for item in &group.items {
                    self.add_import(item, before, public);
                }
            }
            UseTree::Name(name) => {
                segments.push(name.ident.to_string());
                self.push_import(segments, None, public);
            }
            UseTree::Rename(rename) => {
                segments.push(rename.ident.to_string());
                self.push_import(segments, Some(rename.rename.to_string()), public);
            }
            UseTree::Glob(_) => self.push_import(segments, None, false),
        }
    }

    fn push_import(&mut self, mut segments: Vec<String>, renamed: Option<String>, public: bool) {
        if segments.last().is_some_and(|last| last == "self") {
            segments.pop();
        }
        let name = renamed.or_else(|| segments.last().cloned());
        self.paths.push(ModulePath {
            within: self.within.clone(),
            segments,
            exported_as: name.filter(|_| public),
        });
    }
}

impl<'ast> Visit<'ast> for Reader {
    fn visit_item(&mut self, item: &'ast Item) {
        if !is_for_tests(attributes_of(item)) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, module: &'ast ItemMod) {
        self.within.push(module.ident.to_string());
        visit::visit_item_mod(self, module);
        self.within.pop();
    }

    fn visit_item_use(&mut self, item: &'ast ItemUse) {
        let public = !matches!(item.vis, syn::Visibility::Inherited);
        self.add_import(&item.tree, &[], public);
    }

    fn visit_path(&mut self, path: &'ast syn::Path) {
        let segments: Vec<String> = path.segments.iter().map(|s| s.ident.to_string()).collect();
        if segments.len() > 1 {
            self.paths.push(ModulePath {
                within: self.within.clone(),
                segments,
                exported_as: None,
            });
        }
        visit::visit_path(self, path);
    }
}

fn attributes_of(item: &Item) -> &[Attribute] {
    match item {
        Item::Fn(item) => &item.attrs,
        Item::Impl(item) => &item.attrs,
        Item::Mod(item) => &item.attrs,
        Item::Use(item) => &item.attrs,
        Item::Struct(item) => &item.attrs,
        Item::Trait(item) => &item.attrs,
        _ => &[],
    }
}

/// True for an item that is compiled for tests only.
fn is_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        let text = match &attribute.meta {
            syn::Meta::List(list) if list.path.is_ident("cfg") => list.tokens.to_string(),
            meta => return meta.path().is_ident("test"),
        };
        let words: Vec<&str> = text.split(|c: char| !c.is_alphanumeric()).collect();
        words.contains(&"test") && !words.contains(&"not") && !words.contains(&"any")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    #[test]
    fn paths_are_read_but_not_those_of_tests() {
        let text = "use a::b;\nfn f() { c::d(); }\n\
                    #[cfg(test)]\nmod tests { use e::f; }\n#[test]\nfn t() { g::h(); }\n";
        let (files, refused) = parse(&tree_of(&[("crates/x/src/a.rs", text)]));
        assert!(refused.is_empty());
        let found: Vec<_> = files[0]
            .paths
            .iter()
            .map(|p| p.segments.join("::"))
            .collect();
        assert_eq!(found, ["a::b", "c::d"]);
    }

    #[test]
    fn only_the_product_is_read_and_what_does_not_parse_is_named() {
        let files = [
            ("crates/x/src/tests/a.rs", "fn"),
            ("crates/x/src/test_a.rs", "fn"),
            ("crates/x/tests/a.rs", "fn"),
            ("crates/x/src/a.rs", "fn"),
        ];
        let (parsed, refused) = parse(&tree_of(&files));
        assert!(parsed.is_empty());
        assert_eq!(refused.len(), 1);
        assert_eq!(refused[0].0, "crates/x/src/a.rs");
    }
}
