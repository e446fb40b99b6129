//! Ctrl-C where no loop listens, and inputs that would never end.

use std::time::{Duration, Instant};

use crate::common::Desk;

/// A mesh that takes a minute.
const LARGE: &str = r#"
name = "large"
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 300000, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
motion = { inline = { kind = "blocks", blocks = [{ duration = 0.1 }] } }
"#;

/// Calls the program, presses Ctrl-C after `wait`, and returns what it said on standard error and
/// how long it went on.
#[cfg(unix)]
fn interrupted(desk: &Desk, arguments: &str, wait: Duration) -> (String, Duration) {
    use std::io::Read;
    use std::process::{Command, Stdio};

    let mut command = desk.command(arguments);
    command.stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    std::thread::sleep(wait);
    assert!(child.try_wait().unwrap().is_none(), "it ended early");
    let pid = child.id().to_string();
    let pressed = Instant::now();
    let status = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(status.success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    let mut said = String::new();
    child.stderr.unwrap().read_to_string(&mut said).unwrap();
    (said, pressed.elapsed())
}

#[cfg(unix)]
#[test]
fn a_mesh_that_is_being_made_is_given_up_within_a_second() {
    let desk = Desk::new();
    desk.write("large.toml", LARGE);
    for command in ["info large.toml", "run large.toml -o x.safetensors"] {
        let (said, took) = interrupted(&desk, command, Duration::from_secs(3));
        // A second, and what a busy machine adds.
        assert!(took < Duration::from_secs(4), "{command}: {took:?}: {said}");
        assert!(said.contains("interrupted"), "{said}");
        assert!(!desk.path("x.safetensors").exists());
    }
}

#[cfg(unix)]
#[test]
fn a_pipe_or_a_device_is_no_input() {
    let desk = Desk::new();
    for name in [
        "pipe.obj",
        "pipe.toml",
        "pipe.safetensors",
        "pipe.glb",
        "pipe.json",
        "pipe.npz",
    ] {
        let made = std::process::Command::new("mkfifo")
            .arg(desk.path(name))
            .status();
        assert!(made.unwrap().success());
        desk.fails(&format!("info {name}"), 1, &[name, "a pipe or a device"]);
    }
    std::os::unix::fs::symlink("/dev/zero", desk.path("zero.toml")).unwrap();
    for command in [
        "run zero.toml -o x.safetensors",
        "train zero.toml -o run --data tiny",
    ] {
        desk.fails(command, 1, &["zero.toml", "a pipe or a device"]);
    }
    desk.write("named.toml", "name = \"n\"\nmaterial = \"gray-interlock\"\nmesh = { obj = \"pipe.obj\" }\nhandles = { vertices = [0] }\nmotion = { inline = { kind = \"blocks\", blocks = [{ duration = 0.1 }] } }\n");
    desk.fails("info named.toml", 1, &["pipe.obj", "a pipe or a device"]);
}
