//! A scene: mesh, handles, material, environment and motion, checked against each other.

use thiserror::Error;

use crate::{
    Environment, EnvironmentError, HandleError, HandlePath, Handles, Material, MaterialError, Mesh,
    Motion, MotionError, PhysicsError, PhysicsSettings, SagSettings,
};

/// Everything that decides a cloth's motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// What people call it.
    pub name: String,
    /// The cloth, where it starts.
    pub mesh: Mesh,
    /// Which of its vertices are held.
    pub handles: Handles,
    /// What it is made of.
    pub material: Material,
    /// What acts on it.
    pub environment: Environment,
    /// How the handles move.
    pub motion: Motion,
    /// How the reference simulator runs it.
    pub physics: PhysicsSettings,
    /// How its sagged rest pose is found.
    pub sag: SagSettings,
    /// Frames per second.
    pub frame_rate: f64,
}

/// Why the parts of a scene do not fit.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "each message is its source's")]
pub enum SceneError {
    #[error(transparent)]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Material(#[from] MaterialError),
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    #[error(transparent)]
    Motion(#[from] MotionError),
    #[error(transparent)]
    Physics(#[from] PhysicsError),
    #[error("frame_rate must be between 1 and 100000 frames per second, found {found}")]
    FrameRate { found: f64 },
}

impl Scene {
    /// Checks every part, and that the motion can drive these handles.
    ///
    /// # Errors
    /// The first part that cannot be used.
    pub fn validate(&self) -> Result<(), SceneError> {
        let vertices: Vec<u32> = self.handles.vertices().iter().map(|v| v.0).collect();
        Handles::new(&vertices, self.mesh.topology().vertex_count())?;
        self.material.validate()?;
        self.environment.validate()?;
        self.physics.validate()?;
        self.sag.validate()?;
        if !(1.0..=1e5).contains(&self.frame_rate) {
            return Err(SceneError::FrameRate {
                found: self.frame_rate,
            });
        }
        self.handle_path()?;
        Ok(())
    }

    /// The path of the handles, from where they start.
    ///
    /// # Errors
    /// [`MotionError`] when the motion cannot drive these handles.
    pub fn handle_path(&self) -> Result<HandlePath, MotionError> {
        let start = self.handles.select(self.mesh.positions());
        self.motion.bind(&start, self.frame_rate)
    }

    /// Frames after the start that the motion lasts; a run has one position more.
    ///
    /// # Errors
    /// [`MotionError`] when the motion cannot drive these handles.
    pub fn frame_count(&self) -> Result<usize, MotionError> {
        Ok(self.handle_path()?.frame_count())
    }
}
