//! Parts of a data set, made by runs that never meet, and the whole that they are merged into.

use crate::common::{TestFolder, number, tiny_preset};
use serde_json::{Value, json};

#[test]
fn parts_merge_into_the_bytes_of_the_whole() {
    let dir = TestFolder::new();
    dir.tiny();
    for (count, made) in [(2, [2.0, 1.0, 0.0]), (3, [1.0, 1.0, 1.0])] {
        let mut parts = Vec::new();
        for part in 1..=count {
            let name = format!("part-{part}-{count}");
            let generate = format!("data generate tiny -o {name} --shard {part}/{count}");
            let report = dir.json(&generate);
            assert_eq!(report["part"], format!("{part}/{count}"));
            assert_eq!(number(&report, "/trajectories_missing"), 0.0);
            let index = dir.text(&format!("{name}/index.partial.json"));
            let trajectories = index.matches("blake3").count() as f64;
            assert_eq!(trajectories, made[part - 1], "{name}");
            parts.insert(0, name);
        }
        let out = format!("merged-{count}");
        let merge = format!("data merge {} -o {out}", parts.join(" "));
        let report = dir.json(&merge);
        assert_eq!(number(&report, "/trajectories"), 3.0);
        assert!(dir.files(&out) == dir.files("tiny"), "{count} parts");
        // Once more, and as a data set that the usual command finds complete.
        dir.json(&merge);
        let report = dir.json(&format!("data generate tiny -o {out}"));
        assert_eq!(number(&report, "/frames_made"), 0.0);
        assert!(dir.files(&out) == dir.files("tiny"));
    }
}

#[test]
fn a_part_goes_on_and_is_no_other_part() {
    let dir = TestFolder::new();
    let generate = "data generate tiny -o part --shard 1/2";
    dir.json(generate);
    let whole = dir.files("part");
    std::fs::remove_file(dir.path("part/train/push.safetensors")).unwrap();
    let report = dir.json(generate);
    assert_eq!(number(&report, "/trajectories_kept"), 1.0);
    assert!(dir.files("part") == whole);
    let all = "data generate tiny -o part";
    dir.refuses(&format!(
        "1 | {all} --shard 2/2 | part | 1/2 | not part 2/2 | another folder
         1 | {all} | 1/2 | not the whole | another folder
         1 | info part | part",
    ));
}

#[test]
fn a_merge_says_what_is_missing_or_does_not_fit() {
    let dir = TestFolder::new();
    for part in [1, 2, 3] {
        dir.json(&format!("data generate tiny -o {part} --shard {part}/3"));
    }
    dir.json("data generate tiny -o of-two --shard 1/2");
    dir.json("data generate tiny -o whole");
    dir.write("other.toml", tiny_preset().replace("seed = 1", "seed = 2"));
    dir.json("data generate other.toml -o third --shard 3/3");
    dir.refuses(
        "1 | data merge 1 2 -o all | parts 3/3 are missing
         1 | data merge 1 1 2 -o all | both part 1/3
         1 | data merge 2 of-two -o all | of-two | part 1/2 | part 2/3
         1 | data merge whole -o all | whole | no part | --shard I/N
         1 | data merge 1 2 third -o all | third | does not fit | another configuration
         2 | data generate tiny -o x --shard 4/3 | --shard | I/N",
    );
    dir.write("2/train/turn.safetensors", "short");
    let merge = "data merge 1 2 3 -o all";
    dir.fails(merge, 1, &["turn.safetensors", "changed"]);
    let mut value: Value = serde_json::from_slice(&dir.read("1/index.partial.json")).unwrap();
    value["done"]["train"] = json!([]);
    dir.write("1/index.partial.json", value.to_string());
    dir.fails(merge, 1, &["part 1/3 lacks 1", "push", "run again"]);
}
