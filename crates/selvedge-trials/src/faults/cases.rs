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

pub(super) const CASES: [Case; 20] = [
    of(
        "trajectory",
        "simulate push.toml --from-start --frames 3 --out out/a.safetensors",
        "simulate push.toml --from-start --out out/a.safetensors",
    ),
    of(
        "states",
        "simulate push.toml --from-start --frames 3 --out b.safetensors --states out/a.safetensors",
        "simulate push.toml --from-start --out b.safetensors --states out/a.safetensors",
    ),
    of(
        "glb",
        "export short.safetensors --to out/a.glb",
        "export run.safetensors --to out/a.glb",
    ),
    of(
        "usda",
        "export short.safetensors --to out/a.usda",
        "export run.safetensors --to out/a.usda",
    ),
    of(
        "npz",
        "export short.safetensors --to out/a.npz",
        "export run.safetensors --to out/a.npz",
    ),
    of(
        "pc2",
        "export short.safetensors --to out/a.pc2",
        "export run.safetensors --to out/a.pc2",
    ),
    of(
        "usdc",
        "export short.safetensors --to out/a.usdc",
        "export run.safetensors --to out/a.usdc",
    ),
    of(
        "usdz",
        "export short.safetensors --to out/a.usdz",
        "export run.safetensors --to out/a.usdz",
    ),
    of(
        "abc",
        "export short.safetensors --to out/a.abc",
        "export run.safetensors --to out/a.abc",
    ),
    of(
        "obj",
        "export run.safetensors --to out/a.obj --frames 0",
        "export run.safetensors --to out/a.obj --frames 5",
    ),
    of(
        "gif",
        "export short.safetensors --to out/a.gif",
        "export run.safetensors --to out/a.gif",
    ),
    of(
        "png",
        "inspect short.safetensors --picture out/a.png",
        "inspect run.safetensors --picture out/a.png",
    ),
    of(
        "model",
        "convert model.safetensors --weights bf16 --out out/a.safetensors",
        "convert model.safetensors --weights f16 --out out/a.safetensors",
    ),
    Case {
        name: "data set",
        old: None,
        new: "dataset generate tiny --out out",
        holds_one_run: false,
    },
    Case {
        name: "import",
        old: None,
        new: "dataset import cache caches --density 0.2 --frame-rate 60 --handles found --out out",
        holds_one_run: false,
    },
    Case {
        name: "training",
        old: None,
        new: "train moment.toml --data tiny --out out",
        holds_one_run: false,
    },
    of(
        "simulation of files",
        "simulate files.toml --from-start --frames 3 --out out/a.safetensors",
        "simulate files.toml --from-start --out out/a.safetensors",
    ),
    Case {
        name: "rollout",
        old: Some(
            "rollout push.toml --model model.safetensors --no-clip --no-truth --frames 3 --out out",
        ),
        new: "rollout push.toml --model model.safetensors --no-clip --no-truth --out out",
        holds_one_run: true,
    },
    Case {
        name: "evaluation",
        old: None,
        new: "evaluate --model model.safetensors --data tiny",
        holds_one_run: false,
    },
    Case {
        name: "inspection",
        old: None,
        new: "inspect tiny",
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
