//! What cargo knows of the workspace: its root, its members and who depends on whom, reduced to
//! the small graph that the checks are written against.
//!
//! Every feature is switched on, so that no arrow can hide behind one; packages of other platforms
//! than this one are left out, so that nothing has to be downloaded.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use cargo_metadata::{CargoOpt, DependencyKind, Metadata, MetadataCommand};

/// Packages by name, and the packages each of them needs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    /// Names of the workspace's own packages.
    pub(crate) members: BTreeSet<String>,
    /// Packages that each package needs to be built.
    pub(crate) normal: BTreeMap<String, BTreeSet<String>>,
    /// Packages that each package needs only for its tests.
    pub(crate) development: BTreeMap<String, BTreeSet<String>>,
}

/// Folder of the workspace.
pub(crate) fn root() -> &'static Path {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
    root.unwrap_or(Path::new("."))
}

/// The graph of all packages of the workspace.
pub(crate) fn graph() -> Result<Graph> {
    let metadata = MetadataCommand::new()
        .features(CargoOpt::AllFeatures)
        .current_dir(root())
        .other_options(vec![
            "--locked".to_owned(),
            "--filter-platform".to_owned(),
            host_platform()?,
        ])
        .exec()
        .context("cannot resolve the workspace with cargo metadata --locked")?;
    graph_of(&metadata)
}

fn graph_of(metadata: &Metadata) -> Result<Graph> {
    let name = |id| metadata[id].name.to_string();
    let mut graph = Graph {
        members: metadata.workspace_members.iter().map(name).collect(),
        ..Graph::default()
    };
    let resolve = metadata
        .resolve
        .as_ref()
        .context("cargo metadata gave no resolved dependencies")?;
    for node in &resolve.nodes {
        for dependency in &node.deps {
            for kind in &dependency.dep_kinds {
                let arrows = match kind.kind {
                    DependencyKind::Development => &mut graph.development,
                    _ => &mut graph.normal,
                };
                arrows
                    .entry(name(&node.id))
                    .or_default()
                    .insert(name(&dependency.pkg));
            }
        }
    }
    Ok(graph)
}

/// The target that the compiler builds for where none is named.
pub(crate) fn host_platform() -> Result<String> {
    let output = Command::new("rustc")
        .arg("-vV")
        .output()
        .context("cannot start rustc -vV")?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines()
        .find_map(|line| line.strip_prefix("host: "))
        .map(str::to_owned)
        .context("rustc -vV names no host")
}
