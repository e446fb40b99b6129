//! The learned simulator without the learning: the spec of a network, the features it sees, its
//! arithmetic forward and backward, its weights on disk, and a rollout as a
//! [`Stepper`](selvedge_cloth::Stepper).
//!
//! # A cloth that a model moves
//!
//! A [`Model`] is a network, its weights and its normalisers, read from one file. A
//! [`ClothGraph`] is a cloth as the network sees it: with its arcs, hinges and rest vectors, its
//! air and its frame rate. A [`LearnedStepper`] joins both and moves the cloth frame by frame. Its
//! **handles** are the vertices whose motion is given.
//!
//! ```
//! use std::sync::Arc;
//!
//! use selvedge_cloth::generate::square;
//! use selvedge_cloth::{Cloth, Environment, HandleTargets, Handles, Stepper};
//! use selvedge_model::{ClothGraph, LearnedStepper, Model};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // The bytes of a model file, here of the shipped one.
//! let model = Arc::new(Model::from_bytes(selvedge_assets::PAPER)?);
//!
//! // A square of cloth, 1 m wide and 150 g/m², held by its upper corners.
//! let sheet = square(60, 1.0, 1)?;
//! let handles = Handles::new(&sheet.labels["upper-corners"], 60)?;
//! let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles)?;
//! let graph = ClothGraph::new(&cloth, Environment::default(), 60.0)?;
//!
//! // One frame, a sixtieth of a second, in which the corners move 5 mm to the side.
//! let rest = cloth.rest_positions();
//! let mut stepper = LearnedStepper::new(model, graph, &[rest])?;
//! let moved = |p: glam::Vec3| p.as_dvec3() + glam::DVec3::new(0.005, 0.0, 0.0);
//! let targets = cloth.handles().of(rest).map(moved).collect();
//! stepper.step(&HandleTargets::at_frame_end(targets)?)?;
//!
//! let corner = cloth.handles().vertices()[0].index();
//! assert!((stepper.positions()[corner].x - rest[corner].x - 0.005).abs() < 1e-6);
//! # Ok(())
//! # }
//! ```
//!
//! `examples/embed.rs` carries a cloth for a second.
//!
//! # Terms
//!
//! - **Node** and **arc**: a vertex of the mesh, and one direction of an edge of the mesh, in the
//!   graph. [`Connectivity`] holds the arcs of one cloth or of several side by side, a disjoint
//!   **union**.
//! - **Feature**: a group of columns of a node or of an arc ([`NodeFeature`], [`EdgeFeature`]).
//!   [`node_columns`] and [`edge_columns`] list them. A [`Window`] holds the features of the frames
//!   that the encoder sees, and a [`Normalizer`] scales them.
//! - **Latent** vector: the network's own numbers for a node or an arc. **Encoders** make them from
//!   features, **blocks** pass messages along the arcs and update them, a **decoder** makes
//!   accelerations from them.
//! - **Integration**: the motion of a cloth without its network, uniform. [`advance`] adds the
//!   acceleration to it; [`TwoFrames::acceleration_to`] is its inverse.
//! - **Pass**: the network on one input. [`Pass::Inference`] gives the output, [`Pass::Training`]
//!   also keeps the activations for [`Network::backward_packed`].
//! - **Packed weights**: matrices in the order in which the kernels read them ([`PackedWeights`]).
//!   They are packed once for inference and once per step in training.
//!
//! # The network by itself
//!
//! A [`Network`] is a layout without weights; weights are one flat array.
//! `tests/model/reference.rs` is the same network as its equations are written, in `f64`, and the place
//! to read first.
//!
//! # Limits
//!
//! The crate knows no physics: it trains nothing, simulates no truth, reads no scenes and uses no
//! GPU. A rollout that leaves the finite numbers
//! is an error of the step. Results on one machine do not depend on the number of threads; other
//! instruction sets change the last bits.

#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
mod domain;
mod features;
mod graph;
mod kernels;
mod network;
mod rollout;
mod spec;
#[cfg(test)]
mod test_cloth;

pub use domain::{Aspect, Bounds, Departure, Domain, DomainWatch, FabricBounds};
pub use features::{
    Column, Frames, Normalizer, Place, RunningStatistics, Window, edge_columns, edge_groups,
    node_columns, node_groups,
};
pub use graph::{
    ClothGraph, ClothSize, Connectivity, GraphError, Hinge, LocalFrame, Yaw, geometry,
};
pub use kernels::dropout::Dropout;
pub use kernels::real::Real;
pub use kernels::simd::Instructions;
pub use network::packed::{PackedWeights, Purpose};
pub use network::parameters::{Parameter, Start};
pub use network::workspace::Workspace;
pub use network::{Gradients, Input, InputGradient, Network, NetworkScalar, Pass, Stopped};
pub use rollout::{
    Inference, LearnedStepper, LocalAcceleration, MODEL_FORMAT, Model, ModelFileError, NonFinite,
    Normalizers, OnProcessor, RolloutError, TwoFrames, WeightType, advance, advance_backward,
};
pub use spec::{EdgeFeature, Encoder, Integration, ModelSpec, NodeFeature, OUTPUTS, SpecError};
