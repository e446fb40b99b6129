//! The commands by their names of the last release: they work for this one, and say the new name.

use std::ffi::OsString;

/// Options of the last release and what they are called now; nothing where they are gone.
type Renamed = (&'static str, Option<&'static str>);

/// An old command: its words, the new ones, and its options.
struct Old {
    words: &'static [&'static str],
    new: &'static [&'static str],
    options: &'static [Renamed],
}

const OLD: &[Old] = &[
    Old {
        words: &["rollout"],
        new: &["run"],
        options: &[("--no-truth", None), ("--truth", None)],
    },
    Old {
        words: &["simulate"],
        new: &["run"],
        options: &[
            ("--from-rest", Some("--start=rest")),
            ("--from-start", Some("--start=mesh")),
            ("--fit", Some("--start=fit")),
            ("--state", Some("--start")),
            ("--clip", Some("--export")),
        ],
    },
    Old {
        words: &["sag"],
        new: &["run", "--rest"],
        options: &[],
    },
    Old {
        words: &["dataset", "plan"],
        new: &["info"],
        options: &[],
    },
    Old {
        words: &["dataset", "inspect"],
        new: &["info"],
        options: &[],
    },
    Old {
        words: &["dataset"],
        new: &["data"],
        options: &[],
    },
    Old {
        words: &["evaluate"],
        new: &["eval"],
        options: &[
            ("--no-mirror", Some("--baselines=rigid")),
            ("--steps", Some("--horizons")),
            ("--motions", Some("--motion")),
        ],
    },
    Old {
        words: &["study", "convergence"],
        new: &["eval"],
        options: &[("--whole", None)],
    },
    Old {
        words: &["stress"],
        new: &["eval"],
        options: &[("--runs", Some("--random"))],
    },
    Old {
        words: &["inspect"],
        new: &["info"],
        options: &[],
    },
    Old {
        words: &["convert"],
        new: &["model", "convert"],
        options: &[],
    },
    Old {
        words: &["presets"],
        new: &["list", "configs"],
        options: &[],
    },
];

/// The call of the program with the new name in the place of an old one, and a line that says so.
pub(super) fn renewed(call: Vec<OsString>) -> (Vec<OsString>, Option<String>) {
    let words: Vec<&str> = call
        .iter()
        .map(|word| word.to_str().unwrap_or(""))
        .collect();
    // Options of every command may come before its name.
    let flags = words
        .iter()
        .skip(1)
        .take_while(|word| word.starts_with('-'));
    let first = 1 + flags.count();
    let is_called = |old: &&Old| {
        words
            .get(first..)
            .is_some_and(|rest| rest.starts_with(old.words))
    };
    let Some(old) = OLD.iter().find(is_called) else {
        return (call, None);
    };
    let mut renewed: Vec<OsString> = call[..first].to_vec();
    renewed.extend(old.new.iter().map(Into::into));
    let rest = &call[first + old.words.len()..];
    let has = |name: &str| {
        let with_value = format!("{name}=");
        rest.iter()
            .filter_map(|word| word.to_str())
            .any(|word| word == name || word.starts_with(&with_value))
    };
    // What went without saying.
    let mut added: Vec<&str> = Vec::new();
    match old.words[0] {
        "rollout" => {
            added.extend((!has("--model")).then_some("--model=paper"));
            added.extend((!has("--no-truth")).then_some("--compare"));
        }
        "stress" => added.extend((!has("--runs")).then_some("--random=100")),
        "evaluate" => {
            added.extend((!has("--no-mirror")).then_some("--baselines=rigid,mirror"));
        }
        _ => {}
    }
    for word in rest {
        renewed.extend(option(old, word));
    }
    with_state_frame(&mut renewed);
    // Help is asked of the new command as it is.
    if !has("--help") && !has("-h") {
        renewed.extend(added.into_iter().map(Into::into));
    }
    let shown = renewed[1..].iter().map(|word| word.to_string_lossy());
    let note = format!(
        "note: `selvedge {}` is called `selvedge {}` now: selvedge {}",
        old.words.join(" "),
        old.new.join(" "),
        shown.collect::<Vec<_>>().join(" ")
    );
    (renewed, Some(note))
}

/// Puts the frame of a state behind its file.
fn with_state_frame(call: &mut Vec<OsString>) {
    let place = |call: &[OsString], name: &str| call.iter().position(|word| word == name);
    if let Some(frame) = place(call, "--state-frame")
        && let Some(number) = call.get(frame + 1).cloned()
    {
        call.drain(frame..=frame + 1);
        if let Some(start) = place(call, "--start")
            && let Some(file) = call.get_mut(start + 1)
        {
            file.push(":");
            file.push(number);
        }
    }
}

/// A word of an old call as it is now; none for an option that is gone.
fn option(old: &Old, word: &OsString) -> Option<OsString> {
    let Some(text) = word.to_str() else {
        return Some(word.clone());
    };
    let (name, value) = match text.split_once('=') {
        Some((name, value)) => (name, Some(value)),
        None => (text, None),
    };
    match old.options.iter().find(|known| known.0 == name) {
        None => Some(word.clone()),
        Some((_, None)) => None,
        Some((_, Some(new))) => Some(match value {
            Some(value) => format!("{new}={value}").into(),
            None => new.into(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn old_calls_are_understood_and_the_new_ones_are_said() {
        for (old, new) in [
            ("rollout", "run --model=paper --compare"),
            (
                "rollout a.toml --model m --no-truth --out o",
                "run a.toml --model m --out o",
            ),
            (
                "simulate a.toml --out b.safetensors --from-start --clip c.gif",
                "run a.toml --out b.safetensors --start=mesh --export c.gif",
            ),
            (
                "simulate a.toml --out b.safetensors --state c.npz --state-frame 60",
                "run a.toml --out b.safetensors --start c.npz:60",
            ),
            ("sag a.toml --out b.obj", "run --rest a.toml --out b.obj"),
            (
                "dataset generate tiny --out d --threads 2",
                "data generate tiny --out d --threads 2",
            ),
            ("dataset inspect d --pictures p", "info d --pictures p"),
            ("dataset plan tiny", "info tiny"),
            (
                "evaluate --model a --data b --steps 1,2 --no-mirror --report r",
                "eval --model a --data b --horizons 1,2 --baselines=rigid --report r",
            ),
            ("study convergence default --out c", "eval default --out c"),
            ("stress --seed 3", "eval --seed 3 --random=100"),
            ("inspect a.toml", "info a.toml"),
            (
                "convert a --weights f16 --out b",
                "model convert a --weights f16 --out b",
            ),
            ("presets", "list configs"),
        ] {
            let words = |text: &str| -> Vec<OsString> {
                let words = std::iter::once("selvedge").chain(text.split(' '));
                words.map(OsString::from).collect()
            };
            let (found, note) = renewed(words(old));
            assert_eq!(found, words(new));
            let note = note.unwrap();
            assert!(note.ends_with(&format!("now: selvedge {new}")), "{note}");
            Cli::try_parse_from(found).unwrap_or_else(|error| panic!("{new}: {error}"));
        }
        let call: Vec<OsString> = ["selvedge", "run"].map(OsString::from).to_vec();
        assert_eq!(renewed(call.clone()), (call, None));
    }
}
