//! How the program is called: help, wrong calls, where its answers go, and Ctrl-C.

use crate::common::{PUSH, TestFolder};

#[test]
fn wrong_calls_exit_with_2_and_say_why() {
    let dir = TestFolder::new();
    // It is the help that is said where there is no call.
    let said = dir.run("");
    assert_eq!((said.code, said.out.as_str()), (Some(2), ""));
    assert!(said.err.contains("Usage"), "{}", said.err);
    dir.refuses(
        "2 | exprt | export
         2 | run default --compare | --model
         2 | run default -o a.safetensors --frames 0 | --frames
         2 | run default -o a.safetensors --frames many | --frames
         2 | run default -o a.safetensors --start rest --start mesh | --start
         2 | train a.toml --data d -o o --for soon | 1h30m
         2 | data generate tiny -o d -j 0 | --jobs
         2 | run --model paper --states s.safetensors | --states
         2 | view default --beside a.safetensors | --beside
         2 | view --address here | --address
         2 | run --device cuda | gpu:N
         2 | eval --model a --data b --device gpu:x | gpu:N
         2 | run --device double | --device
         2 | run --rest default --quiet --verbose | --verbose
         2 | completions tcsh | bash",
    );
}

/// A scene or a preset goes by its shipped name first. So does a model, unless the folder could be
/// meant.
#[test]
fn a_folder_hides_nothing_that_is_shipped() {
    let dir = TestFolder::new();
    for name in ["default", "paper", "tiny", "mine"] {
        std::fs::create_dir(dir.path(name)).unwrap();
    }
    dir.json("run default --start mesh --frames 1 -o run.safetensors");
    assert_eq!(dir.json("info default")["kind"], "scene");
    dir.json("data generate tiny -o set");
    dir.write("push.toml", PUSH);
    let rollout = "run push.toml --no-clip --frames 1 -o out --model";
    dir.json(&format!("{rollout} paper"));
    let words = "mine: is a folder | name the model in it, mine/model.safe";
    dir.refuses(&format!("1 | {rollout} mine | {words}"));
    dir.write("paper/model.safetensors", "a model of the user's");
    let words = "paper: is a folder | paper/model.safetensors \
        | for the shipped model of this name, start from another folder";
    dir.refuses(&format!("1 | {rollout} paper | {words}"));
    // What the program made in a folder is what the folder stands for.
    std::fs::rename(dir.path("default"), dir.path("empty")).unwrap();
    std::fs::rename(dir.path("set"), dir.path("default")).unwrap();
    assert_ne!(dir.json("info default")["kind"], "scene");
}

#[test]
fn every_shell_has_a_script_that_knows_the_commands() {
    let dir = TestFolder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let said = dir.run(&format!("completions {shell}"));
        assert_eq!((said.code, said.err.as_str()), (Some(0), ""), "{shell}");
        for word in ["selvedge", "compare", "horizons", "no-clip"] {
            assert!(said.out.contains(word), "{shell} lacks {word}");
        }
    }
}

#[test]
fn the_version_is_that_of_the_package_with_its_commit() {
    let said = TestFolder::new().run("--version").out;
    let rest = said.strip_prefix("selvedge ").unwrap().trim();
    let version = env!("CARGO_PKG_VERSION");
    let commit = rest.strip_prefix(version).unwrap();
    let is_commit = |text: &str| {
        let inner = text.strip_prefix(" (").and_then(|t| t.strip_suffix(')'));
        let digits = inner.and_then(|t| t.split(',').next()).unwrap_or_default();
        digits.len() >= 9 && digits.chars().all(|c| c.is_ascii_hexdigit())
    };
    // Without a repository there is none.
    assert!(commit.is_empty() || is_commit(commit), "{said}");
}

#[test]
fn what_ships_is_listed() {
    let dir = TestFolder::new();
    for (what, name) in [
        ("scenes", "default"),
        ("materials", "gray-interlock"),
        ("models", "paper"),
        ("motions", "forward"),
        ("configs", "first"),
        ("presets", "tiny"),
    ] {
        let said = dir.run(&format!("list {what}"));
        assert!(said.out.contains(name), "{what}: {}", said.out);
    }
}

#[test]
fn a_person_gets_a_table_and_a_program_gets_json() {
    let dir = TestFolder::with_push();
    let said = dir.run("run push.toml -o run.safetensors --frames 2");
    assert_eq!(said.code, Some(0), "{}", said.err);
    assert!(said.out.contains("wrote"), "{}", said.out);
    let said = dir.run("run push.toml -o run.safetensors --frames 2 --json -vv");
    let report: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert_eq!(report["out"], "run.safetensors");
    assert!(said.err.contains("found the rest pose"), "{}", said.err);
}

#[cfg(unix)]
mod interrupts {
    use super::*;
    use crate::common::{Running, Said, names_in};

    #[test]
    fn an_interrupted_simulation_writes_the_frames_so_far() {
        let dir = TestFolder::with_push();
        let mut run = dir.start("run push.toml -o run.safetensors --frames 100000");
        run.wait_for(Running::HAS_RESULTS);
        run.press();
        let Said { code, out, .. } = run.ended();
        assert_eq!(code, Some(130));
        assert!(out.contains("interrupted"), "{out}");
        let run = dir.trajectory("run.safetensors");
        let frames = run.frame_count();
        assert!((1..100_001).contains(&frames));
        assert!(out.contains(&format!("{frames} of 100001")), "{out}");
        assert_eq!(dir.names(), ["push.toml", "run.safetensors"]);
    }

    #[test]
    fn an_interrupted_rollout_leaves_no_file_of_an_earlier_one() {
        let dir = TestFolder::with_push();
        // The earlier one is of another mesh, to be told from the new one however far that comes.
        dir.write("other.toml", PUSH.replace("vertices = 36", "vertices = 25"));
        dir.json("run --model paper --compare other.toml --frames 2 -o out");
        let mut rollout = dir.start("run --model paper --compare push.toml --frames 100000 -o out");
        rollout.wait_for(Running::HAS_RESULTS);
        rollout.press();
        let Said { code, out, .. } = rollout.ended();
        assert_eq!(code, Some(130));
        assert!(out.contains("interrupted"), "{out}");
        assert_eq!(names_in(&dir.path("out")), ["rollout.safetensors"]);
        let run = dir.trajectory("out/rollout.safetensors");
        assert_eq!(run.vertex_count(), 36);
        for name in ["truth.safetensors", "sheet.png", "clip.gif"] {
            let line = format!("{name}, of an earlier rollout");
            assert!(out.contains(&line), "{out}");
        }
    }

    #[test]
    fn an_interrupted_data_set_is_completed_by_a_second_run() {
        let dir = TestFolder::new();
        // Long enough that a press right after the start comes before the end.
        let preset = r#"
            name = "long"
            sections = "whole"
            train = ["speed-0.015", "speed-0.02", "speed-0.03"]
            test = ["speed-0.04"]
            [setting]
            material = "gray-interlock"
            mesh = { generator = { kind = "square", vertices = 64, size = 1.0, seed = 1 } }
            handles = { label = "upper-corners" }
        "#;
        dir.write("long.toml", preset);
        let mut generate = dir.start("data generate long.toml -o pieces -j 2");
        // Of a set of which nothing was written, nothing would stay.
        let is_made = |name: &String| name.ends_with(".safetensors");
        let train = dir.path("pieces/train");
        while !(train.is_dir() && names_in(&train).iter().any(is_made)) {
            assert!(generate.goes_on(), "it ended early");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        generate.press();
        let Said { code, out, .. } = generate.ended();
        assert_eq!(code, Some(130));
        assert!(out.contains("run the same command again"), "{out}");
        assert!(!dir.path("pieces/index.json").exists());
        dir.refuses("1 | info pieces | not complete | again");
        dir.json("data generate long.toml -o pieces");
        dir.json("data generate long.toml -o whole");
        assert!(dir.files("pieces") == dir.files("whole"));
    }
}
