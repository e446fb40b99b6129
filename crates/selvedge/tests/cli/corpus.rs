//! Every example of every reader, and the corpus of damaged files: none panics, and each is taken
//! or refused as before. libFuzzer goes on from them, nightly.

use std::path::Path;

use readers::{Bench, TARGETS};

#[path = "../../../selvedge-trials/tests/readers/mod.rs"]
mod readers;

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
    let bench = Bench::new(
        Path::new(env!("CARGO_BIN_EXE_selvedge")),
        &folder.path().join("bench"),
    )
    .unwrap();
    let (mut count, mut refused, mut words) = (0, Vec::new(), Vec::new());
    for target in &TARGETS {
        for (number, input) in bench.examples(target).unwrap().iter().enumerate() {
            count += 1;
            match bench.read(target, input) {
                // Large cloths are left out, not refused.
                Err(text) if !text.ends_with("left out") => {
                    refused.push((target.0, number));
                    words.push(text);
                }
                _ => {}
            }
        }
    }
    assert_eq!(refused, REFUSED, "{words:#?}");
    assert!(count > 60, "{count} examples");
}
