//! A scene by the cheap physics of a model, and its cloth as the model's columns see it.

use selvedge_cloth::{Cloth, Environment, Integrator, Scene, Substepping};
use selvedge_model::{ClothGraph, GraphError, PhysicsBase, Stiffness};

/// `scene` by the physics that a model corrects. Materials are damped as the converged physics
/// needs it, whatever the formula, so that both obey the same equations.
#[must_use]
pub fn base_scene(scene: &Scene, base: PhysicsBase) -> Scene {
    let mut scene = scene.clone();
    let physics = &mut scene.physics;
    physics.integrator = base.integrator;
    physics.substeps = base.substeps;
    physics.substepping = Substepping::Fixed;
    let damping = Integrator::default().least_damping();
    physics.least_damping.get_or_insert(damping);
    scene
}

/// Stiffnesses of the faces of a scene's cloth, each of its own fabric, `[faces]`.
#[must_use]
pub fn face_stiffness(scene: &Scene) -> Vec<Stiffness> {
    let (materials, of_face) = scene.materials();
    let each: Vec<Stiffness> = materials.into_iter().map(Stiffness::of).collect();
    of_face.into_iter().map(|number| each[number]).collect()
}

/// The graph of `cloth`, in the environment of `scene` but for its gusts: the physics has them, and
/// the model is told the wind of every frame.
///
/// # Errors
/// A frame rate or an environment that cannot be used.
pub fn cloth_graph(scene: &Scene, cloth: &Cloth) -> Result<ClothGraph, GraphError> {
    let environment = Environment {
        gust: None,
        ..scene.environment
    };
    ClothGraph::new(cloth, environment, scene.frame_rate)
}
