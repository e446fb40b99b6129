//! Rest poses: the static equilibrium of a cloth that hangs from handles held still.
//!
//! From the start positions with a smooth bulge ([`start`]), [`equilibrium`] repeats long implicit
//! steps without velocity. The bulge decides the side to which the cloth buckles.
//!
//! The rest pose belongs to the cloth and to the handles that hold at the start of the motion. The
//! air is still: cloth in wind flutters and has no equilibrium (from some 3 m/s on). Damping is
//! left out, as no static force depends on it. A sheet without a holding handle has no rest pose
//! and stays at its start.

mod anderson;
mod equilibrium;
mod gradient;
mod last_step;
mod start;

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use glam::DVec3;
use selvedge_cloth::{
    Environment, Handles, Integrator, LinearSolver, Material, Mesh, PhysicsSettings, SagSettings,
    Scene, SceneError, VertexId,
};
use serde::Serialize;
use thiserror::Error;

use equilibrium::find_equilibrium;
pub use gradient::{RestGradient, sag_gradient};
use start::{bulged, scene_at_start};

/// Version of the laws and of the search. To be raised with every change that moves a rest pose,
/// be it by a rounding.
const VERSION: u32 = 6;

/// A cloth in static equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct SaggedRest {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Number of solves.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex `[m/s²]`.
    pub residual: f64,
}

/// Progress of a search for a rest pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SagProgress {
    /// Solves so far.
    pub solves: u32,
    /// Largest residual acceleration |F|/m of a free vertex now `[m/s²]`.
    pub residual: f64,
    /// The vertex that has it.
    pub vertex: VertexId,
    /// Residual at which the search ends `[m/s²]`.
    pub tolerance: f64,
}

/// Reason why no rest pose was found.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SagError {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("the scene has no handles: nothing holds the cloth, so it has no sagged rest pose")]
    NoHandles,
    #[error(
        "no equilibrium after {solves} solves: vertex {vertex} is still accelerated by {residual:e} m/s², sag.tolerance is {tolerance:e}; raise sag.max_steps or sag.tolerance"
    )]
    NotConverged {
        solves: u32,
        vertex: VertexId,
        residual: f64,
        tolerance: f64,
    },
    #[error("stopped, as was asked, before an equilibrium was found ({solves} solves)")]
    Stopped { solves: u32 },
    #[error("solve {solves} of the sag failed: {cause}")]
    Solve { solves: u32, cause: String },
}

/// Finds the sagged rest pose of a scene's cloth, its handles at their places in the mesh.
///
/// # Errors
/// A scene that does not validate or has no handles; [`SagError::NotConverged`].
pub fn sag(scene: &Scene) -> Result<SaggedRest, SagError> {
    sag_with_progress(scene, &mut |_| ControlFlow::Continue(()))
}

/// Does the same as [`sag`]; `progress` is called at every solve and may stop.
///
/// # Errors
/// As for [`sag`]; [`SagError::Stopped`].
pub fn sag_with_progress(
    scene: &Scene,
    progress: &mut dyn FnMut(SagProgress) -> ControlFlow<()>,
) -> Result<SaggedRest, SagError> {
    scene.validate()?;
    let mut scene = scene_at_start(scene)?;
    scene.physics.least_damping = Some(0.0);
    find_equilibrium(&scene, bulged(&scene), progress)
}

/// Everything that decides the bytes of a scene's rest pose: its serialised form tells two of them
/// apart. A field that is added to any part is in it, or has to be named here.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RestPoseContent {
    version: u32,
    mesh: Mesh,
    handles: Handles,
    material: Material,
    fabrics: BTreeMap<String, Material>,
    environment: Environment,
    physics: PhysicsSettings,
    sag: SagSettings,
}

impl RestPoseContent {
    /// The content of `scene`. Its name, its motion, its wind, later releases and contact are no
    /// part; nor are the settings of a motion: equilibrium is found without velocity, by a complete
    /// factorisation and without damping.
    ///
    /// # Errors
    /// A scene that does not validate or has no handles.
    pub fn of(scene: &Scene) -> Result<Self, SagError> {
        scene.validate()?;
        let Scene {
            mesh,
            handles,
            material,
            fabrics,
            environment,
            physics,
            sag,
            name: _,
            schedule: _,
            motion: _,
            frame_rate: _,
            contact: _,
            obstacles: _,
        } = scene_at_start(scene)?;
        Ok(Self {
            version: VERSION,
            mesh,
            handles,
            material,
            fabrics,
            environment,
            physics: PhysicsSettings {
                substeps: 0,
                integrator: Integrator::Linearised,
                least_damping: None,
                solver: LinearSolver::Cholesky,
                ..physics
            },
            sag,
        })
    }
}
