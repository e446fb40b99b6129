//! Where models run: what is said where there is no GPU, and, in a program built for them, the kernels of
//! a GPU on the processor.

use crate::common::{Desk, PUSH};

#[test]
fn a_gpu_that_cannot_be_had_is_said_before_anything_is_written() {
    let desk = Desk::new();
    desk.write("push.toml", PUSH);
    // Where there is a GPU it works, and there is nothing to say.
    let said = desk.run("rollout push.toml --device cuda --frames 2 --no-truth --no-clip");
    if said.code == Some(0) {
        return;
    }
    let words: &[&str] = if cfg!(feature = "gpu") {
        &["was not found", "no GPU", "too old", "failed on the device"]
    } else {
        &["built without GPUs", "--features gpu"]
    };
    assert_eq!(said.code, Some(1), "{}", said.err);
    assert!(
        words.iter().any(|word| said.err.contains(word)),
        "{}",
        said.err
    );
    assert_eq!(desk.names(), ["push.toml"]);
    desk.fails("bench gpu", 1, &["cpu", "--device cuda"]);
    desk.fails("bench conformance", 1, &["cpu", "--device cuda"]);
}

#[cfg(feature = "gpu")]
#[test]
fn a_rollout_by_the_kernels_of_a_gpu_is_that_of_the_engine() {
    use selvedge_data::Trajectory;

    let desk = Desk::new();
    desk.write("push.toml", PUSH);
    let call = "rollout push.toml --frames 20 --guard none --no-truth --no-clip";
    desk.json(&format!("{call} --out cpu"));
    let report = desk.json(&format!("{call} --out host --device host"));
    assert!(
        report["device"]
            .as_str()
            .unwrap()
            .starts_with("this machine")
    );
    let read = |name: &str| Trajectory::read(&desk.path(name)).unwrap();
    let [a, b] = ["cpu/rollout.safetensors", "host/rollout.safetensors"].map(read);
    for frame in 0..a.frame_count() {
        for (p, q) in a.frame(frame).iter().zip(b.frame(frame)) {
            // Roundings of 1e-7 m that the model feeds back for a third of a second.
            assert!(p.distance(*q) < 1e-4, "frame {frame}: {p} {q}");
        }
    }
}

#[cfg(feature = "gpu")]
#[test]
fn a_training_that_the_kernels_of_a_gpu_began_goes_on_with_the_engine() {
    use serde_json::Value;

    let desk = Desk::new();
    desk.model();
    let train = "train moment.toml --data tiny --out halves";
    let report = desk.json(&format!("{train} --steps 4 --device host"));
    assert!(
        report["device"]
            .as_str()
            .unwrap()
            .starts_with("this machine")
    );
    desk.json(&format!("{train} --resume"));
    let losses = |folder: &str| -> Vec<f64> {
        let log = String::from_utf8(desk.read(&format!("{folder}/log.jsonl"))).unwrap();
        let lines = log.lines().map(|line| serde_json::from_str(line).unwrap());
        lines
            .map(|line: Value| line["loss"].as_f64().unwrap())
            .collect()
    };
    let [found, expected] = ["halves", "run"].map(losses);
    assert_eq!([found.len(), expected.len()], [3, 3]);
    for (found, expected) in found.iter().zip(&expected) {
        // Six steps of f32, of which Adam makes moves of 1e-3 whatever the gradient's size.
        assert!(
            (found - expected).abs() < 1e-3 * expected,
            "{found} {expected}"
        );
    }
}
