//! A scene by the cheap physics of a model, and its cloth as the model's columns see it.

use selvedge_cloth::{Cloth, ElasticLaw, Environment, Integrator, Scene};
use selvedge_model::{ClothGraph, GraphError, PhysicsBase, Stiffness};

/// Stiffness-proportional damping of the physics that shipped models correct `[s]`.
const DAMPING: f64 = 2e-4;

/// `scene` by the physics that a model corrects: with the measured law, as when the shipped models
/// learned. Materials are damped alike whatever the formula, so that model and teacher obey the same
/// equations.
#[must_use]
pub fn base_scene(scene: &Scene, base: PhysicsBase) -> Scene {
    let mut scene = scene.clone();
    let physics = &mut scene.physics;
    physics.integrator = Integrator::SecondOrder;
    physics.substeps = base.substeps;
    physics.law = ElasticLaw::Measured;
    physics.least_damping.get_or_insert(DAMPING);
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
