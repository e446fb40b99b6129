//! What cargo knows of the workspace: its members and who depends on whom, reduced to the small
//! graph that the checks are written against.
//!
//! Every feature is switched on, so that no arrow can hide behind one; packages of other platforms
//! than this one are left out, so that nothing has to be downloaded.

use std::collections::{BTreeMap, BTreeSet};

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

/// The graph of all packages of the workspace.
pub(crate) fn graph() -> Result<Graph> {
    let metadata = MetadataCommand::new()
        .features(CargoOpt::AllFeatures)
        .current_dir(crate::root())
        .other_options(["--locked", "--filter-platform", "host-tuple"].map(str::to_owned))
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
