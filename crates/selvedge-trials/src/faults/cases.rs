//! The commands that are tried.

/// A command that reads what [`super::prepare`] made, and writes into the folder `out`, if it
/// writes.
pub(super) struct Case {
    pub(super) name: &'static str,
    /// The command whose files are there before; none where it starts with an empty folder.
    pub(super) old: Option<String>,
    /// The command under trial.
    pub(super) new: String,
    /// True where files of before may be removed: the folder holds one run, and never two.
    pub(super) holds_one_run: bool,
}

/// Commands that replace the file of a run by that of another, where `{}` stands: a name, the
/// command, and the words in it before and after.
const REPLACED: [(&str, &str, [&str; 2]); 6] = [
    (
        "trajectory",
        "run push.toml --start mesh {} -o out/a.safetensors",
        ["--frames 3", ""],
    ),
    (
        "states",
        "run push.toml --start mesh {} -o b.safetensors --states out/a.safetensors",
        ["--frames 3", ""],
    ),
    (
        "obj",
        "export run.safetensors -o out/a.obj --frames {}",
        ["0", "5"],
    ),
    (
        "png",
        "info {}.safetensors --picture out/a.png",
        ["short", "run"],
    ),
    (
        "model",
        "model convert model.safetensors --weights {} -o out/a.safetensors",
        ["bf16", "f16"],
    ),
    (
        "simulation of files",
        "run files.toml --start mesh {} -o out/a.safetensors",
        ["--frames 3", ""],
    ),
];

/// Formats of exports, each one file.
const EXPORTS: [&str; 8] = ["glb", "usda", "npz", "pc2", "usdc", "usdz", "abc", "gif"];

/// Commands that begin in an empty folder.
const NEW: [(&str, &str); 6] = [
    ("data set", "data generate tiny -o out"),
    (
        "import",
        "data import caches --density 0.2 --frame-rate 60 --handles handle_0,handle_1 -o out",
    ),
    ("training", "train moment.toml --data tiny -o out"),
    (
        "frames",
        "export run.safetensors -o out --format obj --frames 0..3",
    ),
    ("evaluation", "eval --model model.safetensors --data tiny"),
    ("inspection", "info tiny"),
];

/// All commands.
pub(super) fn cases() -> Vec<Case> {
    let case = |name, old, new, holds_one_run| Case {
        name,
        old,
        new,
        holds_one_run,
    };
    let replaced = REPLACED.into_iter().map(|(name, command, words)| {
        let [old, new] = words.map(|words| command.replace("{}", words));
        case(name, Some(old), new, false)
    });
    let exports = EXPORTS.into_iter().map(|format| {
        let [old, new] =
            ["short", "run"].map(|run| format!("export {run}.safetensors -o out/a.{format}"));
        case(format, Some(old), new, false)
    });
    let new = NEW.map(|(name, command)| case(name, None, command.to_owned(), false));
    let rollout = "run push.toml --model model.safetensors --no-clip";
    let rollout = [" --frames 3", ""].map(|frames| format!("{rollout}{frames} -o out"));
    let [old, last] = rollout;
    let rollout = case("rollout", Some(old), last, true);
    replaced
        .chain(exports)
        .chain(new)
        .chain([rollout])
        .collect()
}
