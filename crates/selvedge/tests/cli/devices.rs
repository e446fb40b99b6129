//! Where models run: what is said where there is no GPU, and, in a program built for them, what a
//! GPU computes. A driver that calculates on the processor (Debian: mesa-vulkan-drivers) is one too;
//! where there is neither, these tests say so and show nothing, or fail with `SELVEDGE_ALL_TOOLS`.

use crate::common::{TRAINING, TestFolder};

#[test]
fn a_gpu_that_cannot_be_had_is_said_before_anything_is_written() {
    let dir = TestFolder::with_push();
    dir.write("moment.toml", TRAINING);
    let words: &[&str] = if cfg!(feature = "gpu") {
        &["no GPU was found", "the GPU"]
    } else {
        &["built without GPUs"]
    };
    for call in [
        "run --model paper push.toml --frames 2 --no-clip",
        "train moment.toml --data nowhere -o run",
        "eval --model nothing.safetensors --data nowhere -o report",
        "view",
    ] {
        let said = dir.run(&format!("{call} --device gpu"));
        // Where there is a GPU it works, and there is nothing to say.
        if said.code == Some(0) {
            return;
        }
        assert_eq!(said.code, Some(1), "{call}: {}", said.err);
        let is_said = words.iter().any(|word| said.err.contains(word));
        assert!(is_said, "{call}: {}", said.err);
    }
    assert_eq!(dir.names(), ["moment.toml", "push.toml"]);
}

#[test]
fn a_device_without_a_model_is_refused() {
    let dir = TestFolder::with_push();
    dir.refuses(
        "1 | run push.toml --frames 2 --device gpu | --device | --model
         1 | run push.toml --rest --device gpu | --device | --model",
    );
}

/// True where there is no GPU, which is then said.
#[cfg(feature = "gpu")]
fn no_gpu() -> bool {
    use selvedge::machine::{DeviceName, Machine};

    let none = Machine::open(DeviceName::Gpu(0)).is_err();
    if none {
        let all = std::env::var_os("SELVEDGE_ALL_TOOLS");
        assert!(all.is_none(), "no driver for a GPU: run .ci/setup first");
        eprintln!("no GPU and no software driver for one (mesa-vulkan-drivers): not tested");
    }
    none
}

#[cfg(feature = "gpu")]
#[test]
fn a_rollout_on_a_gpu_is_that_of_the_processor() {
    if no_gpu() {
        return;
    }
    let dir = TestFolder::with_push();
    let call = "run push.toml --model paper --frames 20 --guard none --no-clip";
    dir.json(&format!("{call} -o cpu"));
    let report = dir.json(&format!("{call} -o gpu --device gpu"));
    assert_ne!(report["device"], "cpu");
    let [a, b] = ["cpu", "gpu"].map(|on| dir.trajectory(&format!("{on}/rollout.safetensors")));
    for frame in 0..a.frame_count() {
        for (p, q) in a.frame(frame).iter().zip(b.frame(frame)) {
            // Roundings of 1e-7 m that the model feeds back for a third of a second.
            assert!(p.distance(*q) < 1e-4, "frame {frame}: {p} {q}");
        }
    }
}
