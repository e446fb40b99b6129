//! The nouns that every crate of Selvedge shares. This crate reads no files and moves no cloth.
//!
//! # Terms
//!
//! - A **mesh** ([`Mesh`]) has vertices, edges and faces. [`Topology`] is its connectivity: faces
//!   are counter-clockwise, and an edge has two directions, its **arcs**.
//! - The **material coordinates** of a vertex say where it lies in the flat, unstrained cloth.
//!   Where flat pieces are sewn together, a vertex lies in several: the **pattern** ([`Pattern`])
//!   has them per corner of a face. The **rest pose** is the cloth hanging still from its handles.
//! - A **handle** ([`Handles`]) is a vertex whose motion is given. A [`Motion`] bound to the start
//!   of the handles is a [`HandlePath`], which gives [`HandleTargets`] for each frame.
//! - A **cloth** ([`Cloth`]) is everything that stays the same while it moves: topology, handles,
//!   rest pose, material coordinates, masses and areas.
//! - A **scene** ([`Scene`]) is everything that decides a motion: mesh, handles, [`Material`],
//!   [`Environment`] and [`Motion`].
//! - A **stepper** ([`Stepper`]) moves a cloth by one **frame** at a time. The physics, the learned
//!   model and a recording are steppers.
//!
//! # Example
//!
//! A square that hangs from its upper corners, and where a motion leads them:
//!
//! ```
//! use selvedge_cloth::generate::square;
//! use selvedge_cloth::motion::named;
//! use selvedge_cloth::{Cloth, Handles};
//!
//! let sheet = square(400, 1.0, 1)?;
//! let handles = Handles::new(sheet.label("upper-corners")?, 400)?;
//! let start = handles.select(sheet.mesh.positions());
//! let cloth = Cloth::of_mesh(&sheet.mesh, 0.2, handles)?;
//! let mass: f32 = cloth.vertex_mass().iter().sum();
//! assert!((mass - 0.2).abs() < 1e-5);
//!
//! let motion = named::by_name("forward").expect("a motion of this name");
//! let path = motion.bind(&start, 60.0)?;
//! let targets = path.targets(119, 1)?;
//! assert_eq!(targets.end()[0].x - start[0].x, 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Conventions
//!
//! SI units without suffix (m, kg, s, N); y is up. Positions are `f64` where a scene is described
//! and solved ([`glam::DVec3`]) and `f32` where a motion is handed on ([`glam::Vec3`]). Take the vectors
//! from [`glam`] here, or depend on the same version of that crate, 0.34: those of another one are other
//! types.

pub mod bodies;
mod cloth;
mod contact;
mod contact_memory;
mod drape;
mod environment;
mod error;
pub mod generate;
pub mod geometry;
mod handles;
mod ids;
mod isotropic;
mod loose_panels;
mod material;
mod mesh;
pub mod motion;
mod obstacle;
mod pattern;
mod physics;
mod rigid;
mod scene;
mod schedule;
mod stepper;
mod stop;
mod topology;

/// Vectors of all interfaces.
pub use glam;

pub use cloth::{Cloth, ClothArrays};
pub use contact::{ContactSettings, Squeezed};
pub use contact_memory::{
    CaughtPair, Checkpoint, ContactMemory, FrictionAnchor, PreviousSubstep, Pushing,
    ReleasedContact, Still, Touching,
};
pub use drape::Drape;
pub use environment::{Environment, Gust};
pub use error::{SceneError, require};
pub use handles::{HandleError, HandleTargets, Handles};
pub use ids::{EdgeId, FaceId, VertexId};
pub use isotropic::Isotropic;
pub use loose_panels::LoosePanels;
pub use material::{BendTable, Compression, Material, StretchTable};
pub use mesh::{FaceFabrics, Mesh, MeshError, RestShape};
pub use motion::{
    Block, HandlePath, Keyframe, KeyframeGroup, KeyframeMotion, Motion, Pace, PoseKeyframe,
    Profile, RandomMotion, RecordedMotion, Rotation, SplineGroup, SplineMotion, Translation,
    TurnSense,
};
pub use obstacle::{Obstacle, ObstaclePath, RigidKey};
pub use pattern::{EdgeSide, NumberedPattern, Pattern, PatternPoint, Texture};
pub use physics::{
    AirLaw, ConjugateGradients, ElasticLaw, GeneralisedAlpha, HandleConstraint, Integrator,
    LinearSolver, PhysicsMode, PhysicsSettings, SagSettings,
};
pub use rigid::{Impulse, Rigid};
pub use scene::{DEFAULT_FRAME_RATE, Scene};
pub use schedule::{HandleSchedule, Release};
pub use stepper::{
    Correctable, Snapshot, StepError, Stepper, check_target_count, check_targets_hold,
};
pub use stop::Stop;
pub use topology::{Arc, Edge, Topology, TopologyError};
