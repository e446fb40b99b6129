//! Forces of a sewn cloth against the gradient of its energy, panels, seam and fabrics included.

use glam::{DVec2, DVec3};
use selvedge_cloth::geometry::dihedral_angle;
use selvedge_cloth::{
    BendTable, Environment, FaceFabrics, HandleSchedule, Handles, Material, Mesh, Motion,
    PhysicsSettings, SagSettings, Scene, StretchLookup, StretchTable,
};

use super::*;

const SEAM_STIFFNESS: f64 = 3.0;
const REST_ANGLES: [f64; 9] = [0.0, 0.3, -0.2, 0.5, 0.0, 0.1, 0.7, -0.4, 0.0];

fn material(stretch: [f64; 4], bend: [f64; 3]) -> Material {
    Material {
        name: "test".to_owned(),
        source: String::new(),
        density: 0.2,
        damping: 0.0,
        stretch: StretchTable([stretch; 6]),
        bend: BendTable(bend.map(|row| [row; 5])),
        strain_limits: None,
    }
}

/// Two quads sewn along 1-2. The second is turned, mirrored and a little longer in the pattern,
/// and of another fabric.
fn scene() -> Scene {
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let at = [
        (0.0, 0.0),
        (0.1, 0.0),
        (0.1, 0.1),
        (0.0, 0.1),
        (0.2, 0.0),
        (0.21, 0.1),
    ];
    let corners: Vec<[DVec2; 3]> = faces
        .iter()
        .enumerate()
        .map(|(number, face)| {
            face.map(|v: usize| {
                let flat = DVec2::from(at[v]);
                match number < 2 {
                    true => flat,
                    false => DVec2::from_angle(0.7).rotate(DVec2::new(-flat.x, 1.05 * flat.y)),
                }
            })
        })
        .collect();
    let faces = faces.map(|face| face.map(|v| v as u32));
    let positions = (0..6)
        .map(|k| {
            let (x, y) = at[k];
            let k = k as f64;
            DVec3::new(1.1 * x, 0.95 * y, 0.03 * (2.0 * k).sin())
        })
        .collect();
    let fabrics = FaceFabrics {
        names: vec!["lining".to_owned()],
        of_face: vec![None, None, Some(0), Some(0)],
    };
    let mesh = Mesh::sewn(&faces, &corners, positions)
        .and_then(|mesh| mesh.with_rest_angles(REST_ANGLES.to_vec()))
        .and_then(|mesh| mesh.with_seam_stiffness(SEAM_STIFFNESS))
        .and_then(|mesh| mesh.with_fabrics(fabrics));
    Scene {
        name: "seam".to_owned(),
        mesh: mesh.unwrap(),
        handles: Handles::new(&[], 6).unwrap(),
        schedule: HandleSchedule::default(),
        material: material([40.0, 15.0, 80.0, 30.0], [3e-3, 2e-3, 1e-3]),
        fabrics: [(
            "lining".to_owned(),
            material([20.0, 5.0, 10.0, 9.0], [1e-3; 3]),
        )]
        .into(),
        environment: Environment {
            gravity: DVec3::ZERO,
            air_density: 0.0,
            ..Environment::default()
        },
        motion: Motion::still(1.0),
        physics: PhysicsSettings {
            stretch_lookup: StretchLookup::Exact,
            ..PhysicsSettings::default()
        },
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}

/// Energy of the faces `[J]`: a [(k0 G00² + k2 G11²)/2 + k1 G00 G11 + k3 G01²] with twice the
/// table's numbers.
fn stretch_energy(scene: &Scene, positions: &[DVec3]) -> f64 {
    let tables = [
        scene.material.stretch.0[0],
        scene.fabrics["lining"].stretch.0[0],
    ];
    let faces = scene.mesh.topology().face_indices();
    let shapes = scene.mesh.pattern().faces();
    faces
        .iter()
        .zip(shapes)
        .enumerate()
        .map(|(number, (corners, shape))| {
            let element = StretchElement::new(shape);
            let strain = element.strain(corners.map(|v| positions[v as usize]));
            let [k0, k1, k2, k3] = tables[number / 2].map(|k| 2.0 * k);
            let normal = 0.5 * (k0 * strain.uu.powi(2) + k2 * strain.vv.powi(2));
            element.area * (normal + k1 * strain.uu * strain.vv + k3 * strain.uv.powi(2))
        })
        .sum()
}

/// ke of a table with equal columns along a direction: linear between the rows at 0, 45 and 90°.
fn stiffness(material: &Material, along: DVec2) -> f64 {
    let place = along.abs().to_angle() / std::f64::consts::FRAC_PI_4;
    let rows = material.bend.0.map(|row| row[0]);
    if place < 1.0 {
        rows[0] + place * (rows[1] - rows[0])
    } else {
        rows[1] + (place - 1.0) * (rows[2] - rows[1])
    }
}

/// Energy of the hinges `[J]`: k (θ - θ₀)²/2 with k = ke l²/(4 (a_A + a_B)) held at `start`.
fn bend_energy(scene: &Scene, start: &[DVec3], positions: &[DVec3]) -> f64 {
    let (topology, pattern) = (scene.mesh.topology(), scene.mesh.pattern());
    let fabric = |face: selvedge_cloth::FaceId| match face.0 < 2 {
        true => &scene.material,
        false => &scene.fabrics["lining"],
    };
    let mut energy = 0.0;
    for (edge, rest) in topology.edges().iter().zip(REST_ANGLES) {
        let Some(opposite) = edge.opposite.1 else {
            continue;
        };
        let [a, b] = edge.vertices;
        let [left, right] = [edge.faces.0, edge.faces.1.unwrap()];
        let [ke, other] = [left, right].map(|face| {
            let vertices = topology.faces()[face.index()];
            let place = |v| pattern.face(face)[vertices.iter().position(|w| *w == v).unwrap()];
            stiffness(fabric(face), place(b) - place(a))
        });
        let factor = if left.0 < 2 && right.0 >= 2 {
            SEAM_STIFFNESS
        } else {
            1.0
        };
        let area = scene.rest_shape().face_area[left.index()]
            + scene.rest_shape().face_area[right.index()];
        let length = start[a.index()].distance(start[b.index()]);
        let k = factor * 0.5 * (ke + other) * length.powi(2) / (4.0 * area);
        let [from, to, left, right] =
            [a, b, edge.opposite.0, opposite].map(|v| positions[v.index()]);
        energy += 0.5 * k * (dihedral_angle(from, to, left, right) - rest).powi(2);
    }
    energy
}

#[test]
fn forces_across_a_seam_are_the_gradient_of_the_energy() {
    let scene = scene();
    scene.validate().unwrap();
    let start = scene.mesh.positions().to_vec();
    let mut elements = Elements::new(&scene);
    let still = vec![DVec3::ZERO; start.len()];
    let mut impulses = still.clone();
    let at = Linearisation {
        dt: 1.0,
        jacobian: 1.0,
        rate: 0.0,
        positions: &start,
        rates: &still,
        air_positions: &start,
        air_velocities: &still,
        stiffening: false,
        air_resistance: AirResistance::None,
    };
    elements.evaluate(Threads::Pool.for_cloth(6), at, &mut impulses);
    let seams = scene.mesh.topology().edges().iter();
    assert_eq!(
        seams
            .filter(|edge| scene.mesh.pattern().is_seam(edge))
            .count(),
        1
    );
    let h = 1e-6;
    let mut largest: f64 = 0.0;
    for (vertex, force) in impulses.iter().enumerate() {
        for axis in 0..3 {
            let energy = |by: f64| {
                let mut moved = start.clone();
                moved[vertex][axis] += by;
                stretch_energy(&scene, &moved) + bend_energy(&scene, &start, &moved)
            };
            let slope = (energy(h) - energy(-h)) / (2.0 * h);
            // Forces of about 1 N; third derivatives of about 1e4 N/m² times h²/6, and rounding
            // of an energy of 0.05 J over h: 1e-11 N.
            assert!(
                (force[axis] + slope).abs() < 2e-8,
                "{vertex} {axis}: {force} {slope}"
            );
            largest = largest.max(force[axis].abs());
        }
    }
    assert!(largest > 0.1, "{largest}");
}

#[test]
fn each_face_weighs_what_its_fabric_weighs() {
    let mut scene = scene();
    scene.fabrics.get_mut("lining").unwrap().density = 0.5;
    let rest = scene.rest_shape();
    let elements = Elements::new(&scene);
    let total: f64 = elements.mass.iter().sum();
    let [a, b, c, d] = [0, 1, 2, 3].map(|face| rest.face_area[face]);
    assert!((total - 0.2 * (a + b) - 0.5 * (c + d)).abs() < 1e-16);
}
