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
