//! Functions that a reader can call and take in: every parameter has a name of its own, and a
//! function fits on a screen.
//!
//! A tuple or an array that is taken apart in the signature hides several parameters in one. The
//! remedy is a struct with named fields, or separate parameters up to five.

use syn::{FnArg, Pat, Type};

use super::violation::Violation;
use crate::rust::{Function, RustFile};

/// No function is longer than this (in lines).
const LONGEST: usize = 60;

/// Functions with tuples as parameters, and functions that are too long.
pub(crate) fn check(files: &[RustFile]) -> Vec<Violation> {
    let mut found = Vec::new();
    for file in files {
        for function in &file.functions {
            if function.signature.inputs.iter().any(hides_parameters) {
                let what = format!("`{}` takes a tuple apart", function.name);
                let remedy = "name the parts: a struct, or parameters of their own";
                found.push(Violation::new(&file.path, function.line, what, remedy));
            }
            found.extend(too_long(file, function));
        }
    }
    found
}

fn too_long(file: &RustFile, function: &Function) -> Option<Violation> {
    (function.lines > LONGEST).then(|| {
        let what = format!("`{}` has {} lines", function.name, function.lines);
        let remedy = format!("divide it by what it does, into functions of up to {LONGEST} lines");
        Violation::new(&file.path, function.line, what, remedy)
    })
}

/// True for a tuple of two or more parts, and for an array that the signature takes apart.
fn hides_parameters(input: &FnArg) -> bool {
    let FnArg::Typed(typed) = input else {
        return false;
    };
    let apart = match &*typed.pat {
        Pat::Tuple(pattern) => pattern.elems.len() > 1,
        Pat::Slice(pattern) => pattern.elems.len() > 1,
        _ => false,
    };
    apart || is_tuple(&typed.ty)
}

fn is_tuple(of: &Type) -> bool {
    match of {
        Type::Tuple(tuple) => tuple.elems.len() > 1,
        Type::Reference(reference) => is_tuple(&reference.elem),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rust::parse;
    use crate::tree::tree_of;

    fn whats(text: &str) -> Vec<String> {
        let (files, refused) = parse(&tree_of(&[("crates/x/src/a.rs", text)]));
        assert!(refused.is_empty(), "{refused:?}");
        check(&files).into_iter().map(|v| v.what).collect()
    }

    #[test]
    fn named_parameters_pass() {
        let text = "fn a(x: u8, [y]: [u8; 1], z: &[u8; 3], of: impl Fn((u8, u8))) {}";
        assert!(whats(text).is_empty());
    }

    #[test]
    fn tuples_and_arrays_taken_apart_fail() {
        for bad in [
            "fn a((x, y): (u8, u8)) {}",
            "fn a(pair: (u8, u8)) {}",
            "fn a(pair: &mut (u8, u8)) {}",
            "fn a([x, y]: [u8; 2]) {}",
            "trait T { fn a(&self, pair: (u8, u8)); }",
        ] {
            assert_eq!(whats(bad), ["`a` takes a tuple apart"], "{bad}");
        }
    }

    #[test]
    fn the_longest_function_is_inclusive() {
        let of = |lines: usize| format!("fn a() {{{}}}", "\n".repeat(lines - 1));
        assert!(whats(&of(LONGEST)).is_empty());
        assert_eq!(whats(&of(LONGEST + 1)), ["`a` has 61 lines"]);
    }
}
