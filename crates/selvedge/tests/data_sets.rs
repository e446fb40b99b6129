//! Data sets from the command line: the same bytes for any number of threads, and after any
//! interruption.

mod common;

use common::{Desk, contents, names_in, number};
use selvedge_data::{Dataset, Split};

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let desk = Desk::new();
    for threads in [1, 3] {
        desk.json(&format!(
            "dataset generate tiny --out {threads} --threads {threads}"
        ));
    }
    let strip = |name: &str| -> Vec<(String, Vec<u8>)> {
        let folder = desk.path(name);
        let files = contents(&folder).into_iter();
        files
            .map(|(path, bytes)| {
                let path = path.strip_prefix(&folder).unwrap();
                (path.display().to_string(), bytes)
            })
            .collect()
    };
    assert_eq!(strip("1").len(), 4);
    assert!(strip("1") == strip("3"));
}

#[test]
fn a_second_run_makes_only_what_is_missing() {
    let desk = Desk::new();
    desk.tiny();
    let whole = contents(&desk.path("tiny"));
    std::fs::remove_file(desk.path("tiny/train/turn.safetensors")).unwrap();
    let report = desk.json("dataset generate tiny --out tiny");
    assert_eq!(number(&report, "/trajectories_kept"), 2.0);
    // The turn lasts one second.
    assert_eq!(number(&report, "/frames_made"), 61.0);
    assert!(contents(&desk.path("tiny")) == whole);
}

#[test]
fn a_data_set_is_told_by_its_folder() {
    let desk = Desk::new();
    desk.tiny();
    let report = desk.json("inspect tiny");
    let dataset = Dataset::open(&desk.path("tiny")).unwrap();
    assert_eq!(report["kind"], "dataset");
    let samples = dataset.samples().count() as f64;
    assert_eq!(number(&report, "/statistics/samples"), samples);
    assert_eq!(dataset.entries(Split::Train).len(), 2);
    assert_eq!(report, desk.json("dataset inspect tiny"));
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let desk = Desk::new();
    std::fs::create_dir_all(desk.path("mine/train")).unwrap();
    desk.write("mine/train/thesis.txt", "precious");
    desk.fails(
        "dataset generate tiny --out mine",
        1,
        &["mine", "empty folder"],
    );
    assert_eq!(names_in(&desk.path("mine/train")), ["thesis.txt"]);
    desk.fails("inspect mine", 1, &["index.json"]);
}

#[test]
fn a_changed_file_is_found() {
    let desk = Desk::new();
    desk.tiny();
    let mut bytes = desk.read("tiny/test/lift.safetensors");
    *bytes.last_mut().unwrap() ^= 1;
    desk.write("tiny/test/lift.safetensors", bytes);
    desk.fails(
        "dataset inspect tiny",
        1,
        &["lift.safetensors", "has changed"],
    );
}
