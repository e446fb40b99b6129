//! Data sets: what is written is opened with everything in place, an interrupted run goes on, and
//! what is wrong with a folder is an error that says what.

use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_data::{
    Dataset, DatasetPlan, DatasetPreset, DatasetWriter, Section, SectionRule, Split, Trajectory,
};
use serde_json::json;
use tempfile::TempDir;

use crate::help::{run, says, sheet, table};

/// A triangle that moves by `step` [m] per frame at 2 frames per second.
fn trajectory(frames: usize, step: f32) -> Trajectory {
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let flat = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let cloth = sheet(&corners, &flat, &[[0, 1, 2]], &[0]);
    let positions = (0..frames)
        .flat_map(|f| corners.map(|c| c + Vec3::Z * step * f as f32))
        .collect();
    run(cloth, 2.0, positions)
}

fn plan() -> DatasetPlan {
    DatasetPlan {
        name: "small".to_owned(),
        config: json!({"seed": 1}),
        train: vec!["a".to_owned(), "b".to_owned()],
        test: vec!["a".to_owned()],
        sections: SectionRule::Whole,
    }
}

/// The data set of [`plan`], its trajectories written in another order than the plan's.
fn make(folder: &Path) -> Dataset {
    let mut writer = DatasetWriter::open(folder, plan()).unwrap();
    writer.add(Split::Train, "b", &trajectory(9, 0.5)).unwrap();
    writer.add(Split::Test, "a", &trajectory(4, 1.0)).unwrap();
    writer.add(Split::Train, "a", &trajectory(3, 0.25)).unwrap();
    writer.finish().unwrap()
}

/// The same in a folder of its own.
fn made() -> (TempDir, Dataset) {
    let folder = tempfile::tempdir().unwrap();
    let dataset = make(folder.path());
    (folder, dataset)
}

fn edit_index(folder: &Path, from: &str, to: &str) {
    let path = folder.join("index.json");
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{from} is not in {text}");
    std::fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn a_finished_data_set_has_its_trajectories_sections_and_statistics() {
    let (folder, made) = made();
    let dataset = Dataset::open(folder.path()).unwrap();
    assert_eq!(dataset, made);
    let train = dataset.entries(Split::Train);
    assert!(train.iter().map(|entry| &entry.motion).eq(["a", "b"]));
    assert_eq!(dataset.read(&train[1]).unwrap(), trajectory(9, 0.5));
    let whole = |trajectory, end| Section {
        trajectory,
        start: 0,
        end,
    };
    assert_eq!(dataset.sections(), [whole(0, 3), whole(1, 9)]);
    // All frames but the two ends of each.
    let samples = dataset.samples().map(|s| (s.trajectory, s.current));
    assert!(samples.eq((1..2).map(|k| (0, k)).chain((1..8).map(|k| (1, k)))));
    let statistics = dataset.index().statistics;
    assert_eq!((statistics.trajectories, statistics.samples), (3, 8));
    assert_eq!(statistics.train_frames, 12);
    // 0.5 m/s for 3 frames and 1 m/s for 9.
    assert_eq!((statistics.mean_speed, statistics.max_speed), (0.875, 1.0));
    assert!(!folder.path().join("index.partial.json").exists());
}

#[test]
fn the_order_of_writing_and_an_interruption_do_not_change_the_index() {
    let [first, second] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    make(first.path());
    let mut writer = DatasetWriter::open(second.path(), plan()).unwrap();
    writer.add(Split::Train, "a", &trajectory(3, 0.25)).unwrap();
    writer.add(Split::Train, "b", &trajectory(9, 0.5)).unwrap();
    drop(writer);
    assert!(Dataset::open(second.path()).is_err());
    let mut writer = DatasetWriter::open(second.path(), plan()).unwrap();
    for name in ["a", "b"] {
        assert!(writer.written(Split::Train, name).is_some(), "{name}");
    }
    assert!(writer.written(Split::Test, "a").is_none());
    assert_eq!(writer.missing(), [(Split::Test, "a".to_owned())]);
    writer.add(Split::Test, "a", &trajectory(4, 1.0)).unwrap();
    writer.finish().unwrap();
    let index = |folder: &Path| std::fs::read(folder.join("index.json")).unwrap();
    assert_eq!(index(first.path()), index(second.path()));
}

#[test]
fn a_damaged_file_is_made_again_and_a_finished_set_is_kept() {
    let (folder, dataset) = made();
    let file = &dataset.entries(Split::Train)[0].file;
    std::fs::write(folder.path().join(file), "damaged").unwrap();
    let mut writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    assert_eq!(writer.missing(), [(Split::Train, "a".to_owned())]);
    writer.add(Split::Train, "a", &trajectory(3, 0.25)).unwrap();
    assert_eq!(writer.finish().unwrap(), dataset);
    let again = DatasetWriter::open(folder.path(), plan()).unwrap();
    assert!(again.missing().is_empty());
}

#[test]
fn foreign_files_are_refused() {
    let (folder, _) = made();
    std::fs::remove_file(folder.path().join("index.json")).unwrap();
    let error = DatasetWriter::open(folder.path(), plan()).unwrap_err();
    says(error, &["choose an empty folder"]);
}

#[test]
fn a_run_goes_on_only_with_the_same_plan() {
    type Change = fn(&mut DatasetPlan);
    let changes: [Change; 6] = [
        |p| p.config = json!({"seed": 2}),
        |p| p.name = "other".into(),
        |p| p.sections = SectionRule::Paper,
        |p| p.train.swap(0, 1),
        |p| p.train.push("c".into()),
        |p| p.test.clear(),
    ];
    let refusals = [
        "another configuration",
        "is called \"small\", not \"other\"",
        "has other sections: choose another folder",
        "has the training motions [a, b], not [b, a]",
        "has the training motions [a, b], not [a, b, c]",
        "has the test motions [a], not []",
    ];
    let [begun, finished] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let mut writer = DatasetWriter::open(begun.path(), plan()).unwrap();
    writer.add(Split::Train, "a", &trajectory(3, 0.25)).unwrap();
    drop(writer);
    let dataset = make(finished.path());
    for (change, expected) in changes.iter().zip(refusals) {
        let mut other = plan();
        change(&mut other);
        for folder in [&begun, &finished] {
            let opened = DatasetWriter::open(folder.path(), other.clone());
            says(opened.unwrap_err(), &[expected]);
        }
    }
    let writer = DatasetWriter::open(begun.path(), plan()).unwrap();
    assert_eq!(writer.missing().len(), 2);
    let writer = DatasetWriter::open(finished.path(), plan()).unwrap();
    assert_eq!(writer.finish().unwrap(), dataset);
}

#[test]
fn a_plan_must_have_usable_names_and_be_fulfilled() {
    let folder = tempfile::tempdir().unwrap();
    for names in ["../a", "a/b", "", ".a", "a a"] {
        let mut bad = plan();
        bad.train = names.split(' ').map(str::to_owned).collect();
        assert!(DatasetWriter::open(folder.path(), bad).is_err(), "{names}");
    }
    let mut writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    let unplanned = writer.add(Split::Test, "b", &trajectory(3, 0.0));
    let words = ["motion \"b\": is not in the plan"];
    says(unplanned.unwrap_err(), &words);
    let error = writer.finish().unwrap_err();
    assert_eq!(error.to_string(), "motion \"a\": has not been written yet");
}

#[test]
fn an_index_that_is_wrong_is_an_error_that_says_where() {
    let cases = r#"
        selvedge-dataset | other | format: expected
        "version": 1 | "version": 7 | version: expected 1, found 7
        "sections" | "section" | unknown field `section`
        "end": 9 | "end": 10 | frames 0..10 of training trajectory 1
        "trajectory": 1 | "trajectory": 2 | trajectory 2 do not exist
        train/b.safetensors | ../b.safetensors | file "../b.safetensors" is not that of motion "b"
        train/b.safetensors | train/a.safetensors | file "train/a.safetensors" is not that of motion "b"
        "motion": "b" | "motion": "../../evil" | motion "../../evil" is no name
        "motion": "b" | "motion": "a" | motion "a" is twice in one split
        "motion": "b" | "motion": "c" | is not that of motion "c"
        "start": 0,\n      "end": 9 | "start": 7,\n      "end": 9 | section 1: frames 7..9 are fewer than the 3 of a sample
    "#;
    for [from, to, expected] in table(cases) {
        let (folder, _) = made();
        edit_index(folder.path(), from, to);
        let text = Dataset::open(folder.path()).unwrap_err().to_string();
        says(&text, &["index.json: ", expected]);
        assert!(text.ends_with("restore the index, or make the data set again"));
    }
}

/// Changes the index and writes it again.
fn change_index(folder: &Path, change: impl Fn(&mut serde_json::Value)) {
    let path = folder.join("index.json");
    let mut index = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    change(&mut index);
    std::fs::write(&path, serde_json::to_vec(&index).unwrap()).unwrap();
}

#[test]
fn a_trajectory_that_is_there_twice_is_named() {
    let (folder, _) = made();
    change_index(folder.path(), |index| {
        let hash = index["splits"]["train"][1]["blake3"].clone();
        index["splits"]["test"][0]["blake3"] = hash;
    });
    let twice = "files \"train/b.safetensors\" and \"test/a.safetensors\" are the same trajectory";
    says(Dataset::open(folder.path()).unwrap_err(), &[twice]);
}

#[test]
fn a_frame_rate_that_is_not_the_configurations_is_named() {
    for (place, rate) in [("setting", 2.0), ("setting", 60.0), ("import", 60.0)] {
        let (folder, _) = made();
        change_index(folder.path(), |index| {
            index["config"] = json!({place: {"frame_rate": rate}});
        });
        let dataset = Dataset::open(folder.path()).unwrap();
        let read = dataset.read(&dataset.entries(Split::Train)[0]);
        assert_eq!(read.is_err(), rate == 60.0);
        if let Err(error) = read {
            let expected = "train/a.safetensors: has 2 frames per second, the index says 60 frames";
            says(error, &[expected]);
        }
    }
}

#[test]
fn a_trajectory_that_is_too_short_is_refused_before_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    let error = writer.add(Split::Train, "a", &trajectory(2, 0.25));
    let words = ["trajectory a has 2 frames, but the section rule needs at least 3"];
    says(error.unwrap_err(), &words);
    assert!(!folder.path().join("train/a.safetensors").exists());
    // To test on, two frames are enough.
    writer.add(Split::Test, "a", &trajectory(2, 0.25)).unwrap();
}

#[test]
fn a_plan_of_which_nothing_was_written_can_be_withdrawn() {
    let folder = tempfile::tempdir().unwrap();
    let count = || std::fs::read_dir(folder.path()).unwrap().count();
    let writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    writer.withdraw();
    assert_eq!(count(), 0);
    let mut writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    writer.add(Split::Test, "a", &trajectory(4, 1.0)).unwrap();
    writer.withdraw();
    let writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    let entry = writer.written(Split::Test, "a").unwrap();
    assert_eq!((entry.motion.as_str(), entry.frames), ("a", 4));
    // A file that is not listed yet, of a run that was killed before it could, keeps the plan, too.
    let folder = tempfile::tempdir().unwrap();
    let writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    let path = folder.path().join("train/a.safetensors");
    trajectory(3, 0.25).write(&path).unwrap();
    writer.withdraw();
    make(folder.path());
}

#[test]
fn a_trajectory_that_another_motion_has_is_refused_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = DatasetWriter::open(folder.path(), plan()).unwrap();
    writer.add(Split::Train, "b", &trajectory(9, 0.5)).unwrap();
    let twin = writer.add(Split::Test, "a", &trajectory(9, 0.5));
    assert_eq!(
        twin.unwrap_err().to_string(),
        "motion \"a\" (test/a.safetensors) is the same trajectory as motion \"b\" (train/b.safetensors): leave one of them out"
    );
    assert!(!folder.path().join("test/a.safetensors").exists());
    // No motion is its own twin.
    writer.add(Split::Train, "b", &trajectory(9, 0.5)).unwrap();
    drop(writer);
    make(folder.path());
}

#[test]
fn a_preset_is_the_same_whether_defaults_are_written_out_or_not() {
    let folder = tempfile::tempdir().unwrap();
    let plan = DatasetPreset::open("tiny").unwrap().plan().unwrap();
    let mut earlier = plan.clone();
    let physics = earlier.config["setting"]["physics"].as_object_mut();
    assert!(physics.unwrap().remove("solver").is_some());
    let mut writer = DatasetWriter::open(folder.path(), earlier).unwrap();
    for (number, (split, motion)) in writer.missing().into_iter().enumerate() {
        let made = trajectory(number + 3, 0.5);
        writer.add(split, &motion, &made).unwrap();
    }
    let dataset = writer.finish().unwrap();
    assert_eq!(plan.difference(dataset.index()), None);
    let mut other = plan;
    other.config["setting"]["physics"]["substeps"] = json!(8);
    let difference = other.difference(dataset.index()).unwrap();
    assert_eq!(difference, "has another configuration");
}

#[test]
fn a_missing_or_altered_file_is_named_wherever_it_is_read() {
    let (folder, dataset) = made();
    let path = folder.path().join("train/b.safetensors");
    let entry = &dataset.entries(Split::Train)[1];
    let bytes = std::fs::read(&path).unwrap();
    // One bit of the last position, which would read as a cloth like any other.
    let mut altered = bytes.clone();
    *altered.last_mut().unwrap() ^= 1;
    let longer = [&bytes[..], &[0]].concat();
    for changed in [&altered, &longer, &bytes[..bytes.len() - 1].to_vec()] {
        std::fs::write(&path, changed).unwrap();
        says(
            dataset.read(entry).unwrap_err(),
            &["train/b.safetensors", "has changed", &entry.blake3],
        );
    }
    std::fs::remove_file(&path).unwrap();
    let unread = ["train/b.safetensors: could not be read"];
    says(dataset.read(entry).unwrap_err(), &unread);
    let missing = ["\"train/b.safetensors\" is missing"];
    says(Dataset::open(folder.path()).unwrap_err(), &missing);
}

#[test]
fn another_vertex_count_than_that_of_the_trajectory_is_named() {
    let (folder, _) = made();
    edit_index(folder.path(), "\"vertices\": 3", "\"vertices\": 4");
    let dataset = Dataset::open(folder.path()).unwrap();
    let read = dataset.read(&dataset.entries(Split::Test)[0]);
    let expected = "has 4 frames of 3 vertices, the index says 4 frames of 4 vertices";
    says(read.unwrap_err(), &["test/a.safetensors", expected]);
}
