//! Spheres and capsules, which are touched as what they are and not as their meshes.

use glam::{DQuat, DVec3};
use selvedge_cloth::{Obstacle, ObstaclePath, RigidKey, Scene, Stepper, bodies};
use selvedge_contact::{Kind, gap};
use selvedge_sim::Simulator;

use crate::scenes::square_mesh;
use crate::touching::{lying, mean, run};

/// A sheet of 0.6 m on a body that turns about y by a radian per second, after so many frames: its
/// simulator, and how far it has turned `[rad]` and sunk `[m]` in the mean.
fn on_turning(body: &Obstacle, frames: usize) -> (Simulator, f64, f64) {
    let scene = scene(body);
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, frames);
    let flat = |p: &DVec3| DVec3::new(p.x, 0.0, p.z);
    let ways = scene.mesh.positions().iter().zip(simulator.positions_f64());
    let turned = mean(ways.clone().map(|(from, to)| {
        let (from, to) = (flat(from), flat(to));
        to.cross(from).y.atan2(from.dot(to)).abs()
    }));
    let sunk = mean(ways.map(|(from, to)| from.y - to.y));
    (simulator, turned, sunk)
}

fn scene(body: &Obstacle) -> Scene {
    let mut scene = lying(24, |p| p * 0.6 + DVec3::Y * 0.153);
    let rest = square_mesh(24);
    let coordinates = rest.material_coordinates().iter().map(|p| *p * 0.6);
    let positions = scene.mesh.positions().to_vec();
    let faces = rest.topology().face_indices();
    scene.mesh = selvedge_cloth::Mesh::new(&faces, coordinates.collect(), positions).unwrap();
    scene.contact.as_mut().unwrap().friction = 0.5;
    let key = |time: f64| RigidKey {
        time,
        rotation: DQuat::from_rotation_y(time),
        translation: DVec3::ZERO,
    };
    let path = ObstaclePath::Rigid(vec![key(0.0), key(1.0), key(2.0)]);
    scene.obstacles = vec![body.clone().moving(path).unwrap()];
    scene
}

/// The least distance of the cloth's faces from the core of the body, less the radius `[m]`.
fn nearest(scene: &Scene, simulator: &Simulator) -> f64 {
    let time = simulator.frame() as f64 / scene.frame_rate;
    let core = scene.obstacles[0].core_at(time).unwrap();
    let [p, q] = core.ends;
    let places = simulator.positions_f64();
    let mut least = f64::INFINITY;
    for face in scene.mesh.topology().face_indices() {
        let [a, b, c] = face.map(|v| places[v as usize]);
        for k in 0..=20 {
            let point = p.lerp(q, f64::from(k) / 20.0);
            least = least.min(gap(Kind::VertexFace, [point, a, b, c]).distance);
        }
    }
    least - core.radius
}

#[test]
fn a_round_body_carries_and_turns_cloth_as_its_fine_mesh_does() {
    let lying_down = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let tube = bodies::capsule(0.15, 0.5, 0.02).placed(1.0, |p| lying_down * p);
    for body in [bodies::sphere(0.15, 0.02), tube] {
        let round = Obstacle::of("body", body).unwrap();
        let (simulator, turned, sunk) = on_turning(&round, 60);
        let (_, meshed_turned, meshed_sunk) = on_turning(&round.clone().as_mesh(), 60);
        let apart = nearest(&scene(&round), &simulator);
        assert!((0.0..1e-3).contains(&apart), "{apart}");
        assert!(turned > 0.3, "it is dragged along");
        assert!((turned - meshed_turned).abs() < 0.1 * meshed_turned);
        assert!((sunk - meshed_sunk).abs() < 0.05 * meshed_sunk);
    }
}

#[test]
fn a_round_body_that_reaches_into_the_cloth_is_named() {
    let inside = bodies::sphere(0.154, 0.05);
    let scene = scene(&Obstacle::of("ball", inside).unwrap());
    let error = Simulator::new(&scene).err().unwrap().to_string();
    assert!(error.contains("obstacle \"ball\""), "{error}");
    // A needle of a capsule through a face, of which no edge and no end is near.
    let along = |p: DVec3| p + DVec3::new(0.01, 0.153, 0.004);
    let needle = bodies::capsule(1e-4, 0.5, 1e-4).placed(1.0, along);
    let scene = self::scene(&Obstacle::of("needle", needle).unwrap());
    assert!(Simulator::new(&scene).is_err());
}
