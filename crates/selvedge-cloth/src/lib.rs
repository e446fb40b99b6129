//! The nouns that every crate of Selvedge shares: a cloth's topology and rest shape, its material,
//! the air around it, its handles and their motion, and [`Stepper`], the one seam behind which a
//! cloth is moved forward in time.
//!
//! Conventions: SI units without suffix (m, kg, s, N), y up, faces counter-clockwise. Positions
//! are `f64` where a scene is described and solved ([`glam::DVec3`]) and `f32` where a motion is
//! handed on ([`glam::Vec3`]). This crate reads no files and moves no cloth.

mod cloth;
pub mod conformance;
mod environment;
pub mod generate;
pub mod geometry;
mod gust;
mod handles;
mod ids;
mod isotropic;
mod material;
mod mesh;
pub mod motion;
mod physics;
mod scene;
mod schedule;
mod stepper;
mod topology;

pub use cloth::{Cloth, ClothArrays, ClothError};
pub use environment::{Environment, EnvironmentError};
pub use gust::Gust;
pub use handles::{HandleError, HandleTargets, Handles};
pub use ids::{EdgeId, FaceId, VertexId};
pub use isotropic::{Isotropic, IsotropicError};
pub use material::{BendTable, Material, MaterialError, StrainLimits, StretchTable};
pub use mesh::{Mesh, MeshError, RestShape};
pub use motion::{
    Block, HandlePath, Keyframe, KeyframeGroup, KeyframeMotion, Motion, MotionError, Pace,
    PoseKeyframe, Profile, RandomMotion, RecordedMotion, Rotation, SplineGroup, SplineMotion,
    Translation, TurnSense,
};
pub use physics::{
    AdaptiveSubsteps, AirLaw, BendingLaw, ConjugateGradients, HandleConstraint, Integrator,
    LinearSolver, Newton, PhysicsError, PhysicsMode, PhysicsSettings, SagMethod, SagSettings,
    StretchLookup, Substepping,
};
pub use scene::{DEFAULT_FRAME_RATE, Scene, SceneError};
pub use schedule::{HandleSchedule, Release, ScheduleError};
pub use stepper::{Correctable, StepError, Stepper, check_target_count, check_targets_hold};
pub use topology::{Arc, Edge, Topology, TopologyError};
