//! Ctrl-C where no loop listens, and inputs that would never end.

use std::time::{Duration, Instant};

use crate::common::{PUSH, TRAINING, TestFolder, tiny_preset};

/// A mesh that takes a minute.
const LARGE: &str = r#"
name = "large"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 300000, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
motion = { inline = { kind = "blocks", blocks = [{ duration = 0.1 }] } }
"#;

#[cfg(unix)]
#[test]
fn a_mesh_that_is_being_made_is_given_up_within_a_second() {
    let dir = TestFolder::new();
    dir.write("large.toml", LARGE);
    for command in ["info large.toml", "run large.toml -o x.safetensors"] {
        let mut running = dir.start(command);
        std::thread::sleep(Duration::from_secs(1));
        assert!(running.goes_on(), "it ended early");
        let pressed = Instant::now();
        running.press();
        let said = running.ended();
        let took = pressed.elapsed();
        assert_eq!(said.code, Some(130), "{command}: {}", said.err);
        // A second, and what a busy machine adds.
        assert!(took < Duration::from_secs(4), "{command}: {took:?}");
        assert!(said.err.contains("interrupted"), "{}", said.err);
        assert!(!dir.path("x.safetensors").exists());
    }
}

/// What has nothing to show for itself when it is stopped: hours of it, if it went on.
#[cfg(unix)]
#[test]
fn work_that_is_stopped_before_its_first_result_leaves_no_folder() {
    let dir = TestFolder::new();
    dir.tiny();
    let never = "sag]\ntolerance = 1e-300\nmax_steps = 1000000000\n";
    dir.write("never.toml", format!("{PUSH}\n[{never}"));
    dir.write("set.toml", format!("{}\n[setting.{never}", tiny_preset()));
    let recurrent = "encoder = { kind = \"gru\", window = 64 }";
    let recurrent = TRAINING.replace("encoder = { kind = \"mlp\" }", recurrent);
    dir.write("moment.toml", recurrent);
    let (sag, statistics) = ("sagging to rest: begun", "gathering statistics: begun");
    let roll = "run --model paper --compare never.toml";
    let train = "train moment.toml --data tiny --set statistics_samples=1000000 --json";
    for (call, begun, message) in [
        (roll, sag, "stopped, as was asked"),
        ("data generate set.toml", sag, ""),
        (train, statistics, "\"interrupted\":true"),
    ] {
        let mut running = dir.start(&format!("{call} -o made"));
        running.wait_for(begun);
        assert!(dir.path("made").is_dir(), "{call}");
        running.press();
        let said = running.ended();
        assert_eq!(said.code, Some(130), "{call}: {}", said.err);
        let words = said.out + &said.err;
        assert!(words.contains(message), "{call}: {words}");
        assert!(!dir.path("made").exists(), "{call}");
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_or_a_device_is_no_input() {
    let dir = TestFolder::new();
    for name in [
        "pipe.obj",
        "pipe.toml",
        "pipe.safetensors",
        "pipe.glb",
        "pipe.json",
        "pipe.npz",
    ] {
        let made = std::process::Command::new("mkfifo")
            .arg(dir.path(name))
            .status();
        assert!(made.unwrap().success());
        dir.fails(&format!("info {name}"), 1, &[name, "a pipe or a device"]);
    }
    std::os::unix::fs::symlink("/dev/zero", dir.path("zero.toml")).unwrap();
    for command in [
        "run zero.toml -o x.safetensors",
        "train zero.toml -o run --data tiny",
    ] {
        dir.fails(command, 1, &["zero.toml", "a pipe or a device"]);
    }
    dir.write("named.toml", "name = \"n\"\nmaterial = \"gray-interlock\"\nmesh = { obj = \"pipe.obj\" }\nhandles = { vertices = [0] }\nmotion = { inline = { kind = \"blocks\", blocks = [{ duration = 0.1 }] } }\n");
    dir.fails("info named.toml", 1, &["pipe.obj", "a pipe or a device"]);
}
