//! Errors of rigs.

use std::path::PathBuf;

use thiserror::Error;

/// A file that is no rig, or a node of it that cannot be followed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RigError {
    #[error("{}: {source}", path.display())]
    File {
        path: PathBuf,
        #[source]
        source: Box<RigError>,
    },
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("the name must end in .glb, .usda, .usdc, .usdz or .usd")]
    Extension,
    #[error("{0}")]
    Archive(String),
    #[error("is no complete .glb file: {0}")]
    Container(&'static str),
    #[error("its JSON cannot be understood: {0}")]
    Json(#[source] serde_json::Error),
    #[error("{what}: {problem}")]
    Part { what: String, problem: String },
    #[error("line {line}: {problem}")]
    Line { line: usize, problem: String },
    #[error("there is no node called {name:?}; there are [{known}]")]
    NoNode { name: String, known: String },
    #[error("{count} nodes are called {name:?}: give them different names")]
    Ambiguous { name: String, count: usize },
    #[error("node {name:?}: {problem}")]
    Node { name: String, problem: String },
    #[error("has several animations: choose one by `animation`, of [{known}]")]
    Animations { known: String },
    #[error("has no animation called {name:?}; there are [{known}]")]
    NoAnimation { name: String, known: String },
    #[error("has no mesh{}", .0.iter().map(|left| format!("; {left}")).collect::<String>())]
    NoMesh(Vec<String>),
    #[error("none of the nodes [{names}] is animated")]
    Still { names: String },
    #[error("lasts {frames} frames of the scene, more than {most}")]
    Long { frames: f64, most: usize },
}
