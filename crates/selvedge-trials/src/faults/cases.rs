//! The commands that are tried.

/// A command that reads what [`super::prepare`] made, and writes into the folder `out`, if it
/// writes.
pub(super) struct Case {
    pub(super) name: &'static str,
    /// The command whose files are there before; none where it starts with an empty folder.
    pub(super) old: Option<&'static str>,
    /// The command under trial.
    pub(super) new: &'static str,
    /// True where files of before may be removed: the folder holds one run, and never two.
    pub(super) holds_one_run: bool,
}

pub(super) const CASES: [Case; 21] = [
    of(
        "trajectory",
        "run push.toml --start mesh --frames 3 -o out/a.safetensors",
        "run push.toml --start mesh -o out/a.safetensors",
    ),
    of(
        "states",
        "run push.toml --start mesh --frames 3 -o b.safetensors --states out/a.safetensors",
        "run push.toml --start mesh -o b.safetensors --states out/a.safetensors",
    ),
    of(
        "glb",
        "export short.safetensors -o out/a.glb",
        "export run.safetensors -o out/a.glb",
    ),
    of(
        "usda",
        "export short.safetensors -o out/a.usda",
        "export run.safetensors -o out/a.usda",
    ),
    of(
        "npz",
        "export short.safetensors -o out/a.npz",
        "export run.safetensors -o out/a.npz",
    ),
    of(
        "pc2",
        "export short.safetensors -o out/a.pc2",
        "export run.safetensors -o out/a.pc2",
    ),
    of(
        "usdc",
        "export short.safetensors -o out/a.usdc",
        "export run.safetensors -o out/a.usdc",
    ),
    of(
        "usdz",
        "export short.safetensors -o out/a.usdz",
        "export run.safetensors -o out/a.usdz",
    ),
    of(
        "abc",
        "export short.safetensors -o out/a.abc",
        "export run.safetensors -o out/a.abc",
    ),
    of(
        "obj",
        "export run.safetensors -o out/a.obj --frames 0",
        "export run.safetensors -o out/a.obj --frames 5",
    ),
    of(
        "gif",
        "export short.safetensors -o out/a.gif",
        "export run.safetensors -o out/a.gif",
    ),
    of(
        "png",
        "info short.safetensors --picture out/a.png",
        "info run.safetensors --picture out/a.png",
    ),
    of(
        "model",
        "model convert model.safetensors --weights bf16 -o out/a.safetensors",
        "model convert model.safetensors --weights f16 -o out/a.safetensors",
    ),
    Case {
        name: "data set",
        old: None,
        new: "data generate tiny -o out",
        holds_one_run: false,
    },
    Case {
        name: "import",
        old: None,
        new: "data import caches --density 0.2 --frame-rate 60 --handles handle_0,handle_1 -o out",
        holds_one_run: false,
    },
    Case {
        name: "training",
        old: None,
        new: "train moment.toml --data tiny -o out",
        holds_one_run: false,
    },
    of(
        "simulation of files",
        "run files.toml --start mesh --frames 3 -o out/a.safetensors",
        "run files.toml --start mesh -o out/a.safetensors",
    ),
    Case {
        name: "frames",
        old: None,
        new: "export run.safetensors -o out --format obj --frames 0..3",
        holds_one_run: false,
    },
    Case {
        name: "rollout",
        old: Some("run push.toml --model model.safetensors --no-clip --frames 3 -o out"),
        new: "run push.toml --model model.safetensors --no-clip -o out",
        holds_one_run: true,
    },
    Case {
        name: "evaluation",
        old: None,
        new: "eval --model model.safetensors --data tiny",
        holds_one_run: false,
    },
    Case {
        name: "inspection",
        old: None,
        new: "info tiny",
        holds_one_run: false,
    },
];

const fn of(name: &'static str, old: &'static str, new: &'static str) -> Case {
    Case {
        name,
        old: Some(old),
        new,
        holds_one_run: false,
    }
}
