//! Every model that is handed out has a card beside it that says where it comes from and what it
//! cannot do; and what the repository carries along stays small enough to clone.

use crate::tree::Tree;
use crate::violation::Violation;

/// Headings that a card has at least.
const HEADINGS: [&str; 7] = [
    "data",
    "seed",
    "configuration",
    "commit",
    "cost",
    "measured errors",
    "known failures",
];

/// All that is carried along: assets, and arrays wherever they lie (in bytes).
const LARGEST_CARGO: u64 = 40_000_000;
const ARRAYS: [&str; 5] = [".safetensors", ".npy", ".npz", ".bin", ".tfrecord"];

/// Models without a full card, and cargo that is too heavy.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let mut found = Vec::new();
    for path in tree.sizes.keys() {
        let name = path.strip_suffix(".safetensors");
        if let Some(name) = name.filter(|name| name.starts_with("assets/models/")) {
            found.extend(check_card(tree, &format!("{name}.md")));
        }
    }
    let cargo = tree.sizes.iter().filter(|(path, _)| is_cargo(path));
    let total: u64 = cargo.map(|(_, bytes)| bytes).sum();
    if total > LARGEST_CARGO {
        found.push(Violation::new(
            "assets",
            0,
            format!("models and data take {total} bytes, more than {LARGEST_CARGO}"),
            "keep the smallest set that the tests and the first example need",
        ));
    }
    found
}

fn is_cargo(path: &str) -> bool {
    path.starts_with("assets/") || ARRAYS.iter().any(|ending| path.ends_with(ending))
}

fn check_card(tree: &Tree, card: &str) -> Vec<Violation> {
    let Some(file) = tree.text(card) else {
        let remedy = format!("write it, with the headings: {}", HEADINGS.join(", "));
        return vec![Violation::new(
            card,
            0,
            "this model's card is missing",
            remedy,
        )];
    };
    let headings: Vec<String> = file
        .text
        .lines()
        .filter(|line| line.starts_with('#'))
        .map(|line| line.trim_start_matches('#').trim().to_lowercase())
        .collect();
    HEADINGS
        .iter()
        .filter(|needed| !headings.iter().any(|heading| heading.starts_with(*needed)))
        .map(|needed| {
            let what = format!("the card has no heading \"{needed}\"");
            Violation::new(card, 0, what, "add it, with what is known")
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_of;

    fn full_card() -> String {
        HEADINGS
            .map(|heading| format!("## {heading}\nx\n"))
            .concat()
    }

    #[test]
    fn a_model_needs_its_card() {
        let model = ("assets/models/a.safetensors", "weights");
        let found = check(&tree_of(&[model]));
        assert_eq!(found[0].what, "this model's card is missing");
        assert_eq!(found[0].path, "assets/models/a.md");
        let card = full_card();
        assert!(check(&tree_of(&[model, ("assets/models/a.md", &card)])).is_empty());
        // A trajectory is no model.
        assert!(check(&tree_of(&[("assets/datasets/a.safetensors", "")])).is_empty());
    }

    #[test]
    fn each_heading_is_needed() {
        for heading in HEADINGS {
            let card = full_card().replace(&format!("## {heading}\n"), "## Other\n");
            let files = [
                ("assets/models/a.safetensors", ""),
                ("assets/models/a.md", &card),
            ];
            let found = check(&tree_of(&files));
            assert_eq!(found.len(), 1);
            assert!(found[0].what.contains(heading));
        }
    }

    #[test]
    fn cargo_is_limited_in_all() {
        let mut tree = Tree::default();
        let half = LARGEST_CARGO / 2;
        tree.sizes.insert("assets/meshes/a.obj".to_owned(), half);
        tree.sizes.insert("crates/a/golden.npy".to_owned(), half);
        tree.sizes.insert("Cargo.lock".to_owned(), half);
        assert!(check(&tree).is_empty());
        tree.sizes.insert("assets/b".to_owned(), 1);
        assert_eq!(check(&tree).len(), 1);
    }
}
