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
mod content;
mod equilibrium;
mod last_step;
mod progress;
mod start;

use std::ops::ControlFlow;

use selvedge_cloth::Scene;

use equilibrium::find_equilibrium;
use start::{bulged, scene_at_start};

pub use content::RestPoseContent;
pub use progress::{SagError, SagProgress, SaggedRest};

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
    let scene = &mut scene_at_start(scene)?;
    let start = bulged(scene);
    // Only the motion on the way to rest can be damped.
    scene.material.damping = 0.0;
    for fabric in scene.fabrics.values_mut() {
        fabric.damping = 0.0;
    }
    scene.physics.least_damping = Some(0.0);
    find_equilibrium(scene, start, progress)
}
