//! Every example of every reader, and the corpus of damaged files: none panics, and each is taken
//! or refused as before. libFuzzer goes on from them, nightly.

use std::path::Path;

use selvedge_trials::replay;

/// Examples that are refused, all of the corpus: a target and the number of its example.
const REFUSED: [(&str, usize); 5] = [
    ("obj", 2),
    ("usda", 1),
    ("usda", 2),
    ("usda", 3),
    ("options", 8),
];

#[test]
fn examples_and_corpus_are_taken_or_refused_as_before() {
    let folder = tempfile::tempdir().unwrap();
    let all = replay(Path::new(env!("CARGO_BIN_EXE_selvedge")), folder.path()).unwrap();
    // Large cloths are left out, not refused.
    let is_refusal = |text: &String| !text.ends_with("left out");
    let refused = all
        .iter()
        .filter(|one| one.refusal.as_ref().is_some_and(is_refusal));
    let found: Vec<_> = refused
        .clone()
        .map(|one| (one.target, one.number))
        .collect();
    assert_eq!(found, REFUSED, "{:#?}", refused.collect::<Vec<_>>());
    assert!(all.len() > 60, "{} examples", all.len());
}
