//! The call of `selvedge view`.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args;
use selvedge_live::Mover;

use super::{DeviceArgs, word};

/// Simulate a cloth live in the browser, and drag it.
///
/// Serves a page at an address of this machine, which is printed. The cloth is moved by the solver, by
/// a learned model, or by both side by side with the same handles; or a recorded trajectory is
/// played. Several pages may watch. Ctrl-C stops; an unfinished recording is written.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge view --open
  selvedge view my-scene.toml --model my-model.safetensors --show both
  selvedge view out/truth.safetensors --beside out/rollout.safetensors

In the page: drag a handle, or any point of the cloth; arrows, page up and down, q and e move all handles.")]
pub(crate) struct ViewArgs {
    /// A scene (a TOML file, ARCSim's JSON, or the name of a shipped one) or a trajectory
    /// (.safetensors).
    #[arg(default_value = "tablecloth", value_name = "SCENE|TRAJECTORY")]
    pub(crate) subject: String,
    /// A model's weights; repeat the option for several to choose from [default: the shipped model].
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Vec<PathBuf>,
    /// What moves the cloth at first.
    #[arg(long, default_value = "physics", value_parser = word::<Mover>([("model", "The learned model"), ("physics", "The solver"), ("both", "Both, side by side")]))]
    pub(crate) show: Mover,
    /// The machine of the models.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
    /// Another trajectory of the same mesh, to play beside the first.
    #[arg(long, value_name = "TRAJECTORY")]
    pub(crate) beside: Option<PathBuf>,
    /// The address to listen at; port 0 takes one that is free. Beyond 127.0.0.1 anyone who reaches
    /// it may drag the cloth.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:7878")]
    pub(crate) address: SocketAddr,
    /// A name under which the page may be reached, beside localhost and addresses in numbers; repeat
    /// the option for several.
    #[arg(long, value_name = "NAME")]
    pub(crate) allow_host: Vec<String>,
    /// The folder for recordings; it is created with the first.
    #[arg(long, value_name = "FOLDER", default_value = "recordings")]
    pub(crate) recordings: PathBuf,
    /// Open the page in the browser.
    #[arg(long)]
    pub(crate) open: bool,
}
