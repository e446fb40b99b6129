//! Parts of a data set, made by runs that never meet, and the whole that they are merged into.

use crate::common::{Desk, TRAINING, number};

#[test]
fn parts_merge_into_the_bytes_of_the_whole() {
    let desk = Desk::new();
    desk.tiny();
    for (count, made) in [(2, [2.0, 1.0, 0.0]), (3, [1.0, 1.0, 1.0])] {
        let mut parts = Vec::new();
        for part in 1..=count {
            let name = format!("part-{part}-{count}");
            let report = desk.json(&format!(
                "dataset generate tiny --out {name} --shard {part}/{count}"
            ));
            assert_eq!(report["part"], format!("{part}/{count}"));
            assert_eq!(number(&report, "/trajectories_missing"), 0.0);
            let index =
                String::from_utf8(desk.read(&format!("{name}/index.partial.json"))).unwrap();
            let trajectories = index.matches("blake3").count() as f64;
            assert_eq!(trajectories, made[part - 1], "{name}");
            parts.insert(0, name);
        }
        let out = format!("merged-{count}");
        let merge = format!("dataset merge {} --out {out}", parts.join(" "));
        let report = desk.json(&merge);
        assert_eq!(number(&report, "/trajectories"), 3.0);
        assert!(desk.files(&out) == desk.files("tiny"), "{count} parts");
        // Once more, and as a data set that the usual command finds complete.
        desk.json(&merge);
        let report = desk.json(&format!("dataset generate tiny --out {out}"));
        assert_eq!(number(&report, "/frames_made"), 0.0);
        assert!(desk.files(&out) == desk.files("tiny"));
    }
}

#[test]
fn a_part_goes_on_and_is_no_other_part() {
    let desk = Desk::new();
    let generate = "dataset generate tiny --out part --shard 1/2";
    desk.json(generate);
    let whole = desk.files("part");
    std::fs::remove_file(desk.path("part/train/push.safetensors")).unwrap();
    let report = desk.json(generate);
    assert_eq!(number(&report, "/trajectories_kept"), 1.0);
    let names = |files: &[(String, Vec<u8>)]| files.iter().map(|f| f.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&desk.files("part")), names(&whole));
    let other = "dataset generate tiny --out part --shard 2/2";
    desk.fails(other, 1, &["part", "1/2", "not part 2/2", "another folder"]);
    let all = "dataset generate tiny --out part";
    desk.fails(all, 1, &["1/2", "not the whole", "another folder"]);
    desk.fails("dataset inspect part", 1, &["part"]);
}

#[test]
fn a_merge_says_what_is_missing_or_does_not_fit() {
    let desk = Desk::new();
    for part in [1, 2] {
        desk.json(&format!(
            "dataset generate tiny --out {part} --shard {part}/3"
        ));
    }
    let missing = ["parts 3/3 are missing"];
    desk.fails("dataset merge 1 2 --out all", 1, &missing);
    desk.fails("dataset merge 1 1 2 --out all", 1, &["both part 1/3"]);
    desk.json("dataset generate tiny --out of-two --shard 1/2");
    let count = ["of-two", "part 1/2", "part 2/3"];
    desk.fails("dataset merge 2 of-two --out all", 1, &count);
    desk.json("dataset generate tiny --out whole");
    let whole = ["whole", "no part", "--shard I/N"];
    desk.fails("dataset merge whole --out all", 1, &whole);
    let preset = selvedge_data::shipped_presets()
        .iter()
        .find(|p| p.0 == "tiny");
    let other = preset.unwrap().1.replace("seed = 1", "seed = 2");
    desk.write("other.toml", other);
    desk.json("dataset generate other.toml --out third --shard 3/3");
    let other = ["third", "does not fit", "another configuration"];
    desk.fails("dataset merge 1 2 third --out all", 1, &other);
    desk.json("dataset generate tiny --out 3 --shard 3/3");
    std::fs::write(desk.path("2/train/turn.safetensors"), "short").unwrap();
    desk.fails(
        "dataset merge 1 2 3 --out all",
        1,
        &["turn.safetensors", "changed"],
    );
    let index = desk.path("1/index.partial.json");
    let text = std::fs::read_to_string(&index).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["done"]["train"] = serde_json::json!([]);
    std::fs::write(index, value.to_string()).unwrap();
    let lacks = ["part 1/3 lacks 1", "push", "run again"];
    desk.fails("dataset merge 1 2 3 --out all", 1, &lacks);
    desk.fails(
        "dataset generate tiny --out x --shard 4/3",
        2,
        &["--shard", "I/N"],
    );
}

#[test]
fn parts_of_evaluations_and_stress_tests_say_what_one_run_says() {
    let desk = Desk::new();
    desk.tiny();
    desk.write("moment.toml", TRAINING);
    desk.json("train moment.toml --data tiny --out run");
    let model = "--model run/model.safetensors";
    let evaluate = format!("evaluate {model} --data tiny --split train --steps 1,5");
    let stress = format!("stress {model} --runs 5 --frames 40");
    for command in [evaluate, stress] {
        let whole = desk.json(&command);
        let mut parts = Vec::new();
        for part in [3, 1, 2] {
            let file = format!("part-{part}.json");
            let report = desk.json(&format!("{command} --shard {part}/3 --part {file}"));
            assert_eq!(report["interrupted"], false);
            parts.push(file);
        }
        let list = parts.join(",");
        let merged = desk.json(&format!("{command} --parts {list}"));
        let rows = if command.starts_with("stress") {
            "runs"
        } else {
            "rows"
        };
        assert!(whole[rows].as_array().unwrap().len() > 4, "{command}");
        assert_eq!(merged[rows], whole[rows], "{command}");
        assert_eq!(merged["all"], whole["all"]);
        let two = parts[..2].join(",");
        let missing = ["parts 2/3 are missing"];
        desk.fails(&format!("{command} --parts {two}"), 1, &missing);
        let other = command
            .replace("--steps 1,5", "--steps 2")
            .replace("--runs 5", "--runs 6");
        desk.fails(&format!("{other} --parts {list}"), 1, &["another call"]);
        desk.fails(&format!("{command} --shard 1/2"), 2, &["--part"]);
        // Rows depend on the precision, too, of which a processor without bf16 has one.
        let half = format!("{command} --precision half");
        if command.starts_with("evaluate") && desk.run(&half).code == Some(0) {
            desk.fails(&format!("{half} --parts {list}"), 1, &["another call"]);
        }
    }
}

#[test]
fn parts_of_a_study_train_in_one_folder() {
    let desk = Desk::new();
    desk.tiny();
    desk.write("moment.toml", TRAINING);
    let entry = |name: &str, more: &str| {
        format!("[[train]]\nname = \"{name}\"\nconfig = \"moment.toml\"\n{more}\n")
    };
    let study = [
        "title = \"Three\"\nbudget = { steps = 6 }\n[data]\ntiny = { folder = \"tiny\" }\n",
        "[evaluation]\nsteps = [1]\nrivals = [\"rigid\"]\n",
        &entry("one", ""),
        &entry("other", "set = [\"seed=2\"]"),
        &entry("later", "after = \"one\""),
        "[[question]]\ntitle = \"Which?\"\nmodels = [\"one\", \"other\"]\nshow = [\"table\"]\n",
    ];
    desk.write("study.toml", study.concat());
    desk.json("study study.toml --out whole");
    for (part, trained) in [(2, 1.0), (1, 2.0)] {
        let report = desk.json(&format!("study study.toml --out parts --shard {part}/2"));
        assert_eq!(number(&report, "/trained"), trained);
        assert!(!desk.path("parts/report").exists());
    }
    let report = desk.json("study study.toml --out parts");
    assert_eq!(number(&report, "/trained"), 3.0);
    for name in ["one", "other", "later"] {
        let model = |out| desk.read(&format!("{out}/trainings/{name}/model.safetensors"));
        assert!(model("whole") == model("parts"), "{name}");
    }
    desk.write(
        "made.toml",
        study.concat().replace("folder = ", "preset = "),
    );
    let words = ["parts/data/tiny", "not there yet", "dataset generate tiny"];
    desk.fails("study made.toml --out parts --shard 1/2", 1, &words);
}
