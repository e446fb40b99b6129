//! A scene by the cheap physics of a model, and its cloth as the model's columns see it.

use selvedge_cloth::{Cloth, Environment, Integrator, Material, Scene, Substepping};
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
    let damping = Integrator::SecondOrder.least_damping();
    physics.least_damping.get_or_insert(damping);
    scene
}

/// Stiffnesses of a material as the columns of a model have them: means of its tables
/// `[eq:mean-stiffness]`, stretching along and across the threads with the law's factor 2.
#[must_use]
pub fn stiffness(material: &Material) -> Stiffness {
    let rows = material.stretch.0.iter();
    let along_and_across = rows.flat_map(|row| [row[0], row[2]]);
    let count = 2.0 * material.stretch.0.len() as f64;
    let bend = material.bend.0.as_flattened();
    Stiffness {
        stretch: 2.0 * along_and_across.sum::<f64>() / count,
        bend: bend.iter().sum::<f64>() / bend.len() as f64,
        density: material.density,
    }
}

/// Stiffnesses of the faces of a scene's cloth, each of its own fabric, `[faces]`.
#[must_use]
pub fn face_stiffness(scene: &Scene) -> Vec<Stiffness> {
    let (materials, of_face) = scene.materials();
    let each: Vec<Stiffness> = materials.into_iter().map(stiffness).collect();
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
