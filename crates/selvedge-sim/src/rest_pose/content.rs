//! What decides a rest pose, so that one that was found can be known again.

use std::collections::BTreeMap;

use selvedge_cloth::{
    Environment, HandleSchedule, Handles, Integrator, LinearSolver, Material, Mesh,
    PhysicsSettings, SagSettings, Scene,
};

use crate::rest_pose::progress::SagError;
use crate::rest_pose::start::scene_at_start;

/// Version of the laws and of the search. To be raised with every change that moves a rest pose,
/// be it by a rounding.
const VERSION: u32 = 4;

/// Everything that decides the bytes of a scene's rest pose. Its [`Debug`](std::fmt::Debug)
/// form tells two of them apart; it belongs to this version of the program.
#[derive(Clone, Debug)]
#[allow(dead_code, reason = "the fields are read by Debug")]
pub struct RestPoseContent {
    version: u32,
    mesh: Mesh,
    handles: Handles,
    schedule: HandleSchedule,
    material: Material,
    fabrics: BTreeMap<String, Material>,
    environment: Environment,
    physics: PhysicsSettings,
    sag: SagSettings,
    frame_rate: f64,
}

impl RestPoseContent {
    /// The content of `scene`. Its name, its motion, its wind, later releases and contact are no
    /// part; nor are the settings of a motion.
    ///
    /// # Errors
    /// A scene that does not validate or has no handles.
    pub fn of(scene: &Scene) -> Result<Self, SagError> {
        scene.validate()?;
        // A new field of a scene is to be thought about here.
        let Scene {
            name: _,
            mesh,
            handles,
            schedule,
            material,
            fabrics,
            environment,
            motion: _,
            physics,
            sag,
            frame_rate,
            contact: _,
            obstacles: _,
        } = scene_at_start(scene)?;
        let mut content = Self {
            version: VERSION,
            mesh,
            handles,
            schedule,
            material,
            fabrics,
            environment,
            physics,
            sag,
            frame_rate,
        };
        content.leave_motion_out();
        Ok(content)
    }

    /// Equilibrium is found without velocity, by a complete factorisation and without damping.
    fn leave_motion_out(&mut self) {
        self.material.damping = 0.0;
        for fabric in self.fabrics.values_mut() {
            fabric.damping = 0.0;
        }
        self.frame_rate = 0.0;
        self.physics.substeps = 0;
        self.physics.integrator = Integrator::Linearised;
        self.physics.least_damping = None;
        self.physics.solver = LinearSolver::Cholesky;
    }
}
