//! Forces of a sewn cloth against the gradient of its energy, panels, seam and fabrics included.

use glam::{DMat3, DVec2, DVec3, Mat3A};
use selvedge_cloth::geometry::dihedral_angle;
use selvedge_cloth::{BendTable, FaceFabrics, Handles, Material, Mesh, Scene, StretchTable};

use super::*;
use crate::laws::number::GROUP;
use crate::solver::faces::FaceBlocks;

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
        compression: selvedge_cloth::Compression::default(),
    }
}

/// Two quads sewn along 1-2. The second is turned, mirrored and a little longer in the pattern,
/// and of another fabric.
fn scene() -> Scene {
    let places = (0..6)
        .map(|k| {
            let (x, y) = AT[k];
            let k = k as f64;
            DVec3::new(1.1 * x, 0.95 * y, 0.03 * (2.0 * k).sin())
        })
        .collect();
    sewn(1.05, REST_ANGLES, places)
}

/// Material coordinates of the quads as one sheet `[m]`.
const AT: [(f64, f64); 6] = [
    (0.0, 0.0),
    (0.1, 0.0),
    (0.1, 0.1),
    (0.0, 0.1),
    (0.2, 0.0),
    (0.21, 0.1),
];

/// The quads at these positions `[m]`, the second `longer` than `AT` in the pattern.
fn sewn(longer: f64, rest_angles: [f64; 9], positions: Vec<DVec3>) -> Scene {
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let corners: Vec<[DVec2; 3]> = faces
        .iter()
        .enumerate()
        .map(|(number, face)| {
            face.map(|v: usize| {
                let flat = DVec2::from(AT[v]);
                if number < 2 {
                    flat
                } else {
                    DVec2::from_angle(0.7).rotate(DVec2::new(-flat.x, longer * flat.y))
                }
            })
        })
        .collect();
    let faces = faces.map(|face| face.map(|v| v as u32));
    let fabrics = FaceFabrics {
        names: vec!["lining".to_owned()],
        of_face: vec![None, None, Some(0), Some(0)],
    };
    let mesh = Mesh::sewn(&faces, &corners, positions)
        .and_then(|mesh| mesh.with_rest_angles(rest_angles.to_vec()))
        .and_then(|mesh| mesh.with_seam_stiffness(SEAM_STIFFNESS))
        .and_then(|mesh| mesh.with_fabrics(fabrics));
    let lining = material([20.0, 5.0, 10.0, 9.0], [2e-3; 3]);
    let own = material([40.0, 15.0, 80.0, 30.0], [3e-3, 2e-3, 1e-3]);
    let mut scene = Scene::of("seam", mesh.unwrap(), Handles::new(&[], 6).unwrap(), own);
    scene.physics.even_bending = false;
    scene.fabrics.insert("lining".to_owned(), lining);
    scene.environment.gravity = DVec3::ZERO;
    scene.environment.air_density = 0.0;
    scene
}

/// Two faces that an element belongs to, of a face itself twice, and its energy `[J]`.
type Energy = ([usize; 2], f64);

/// Energy of each face: a [(k0 G00² + k2 G11²)/2 + k1 G00 G11 + k3 G01²] with twice the table's
/// numbers. And that of each hinge.
fn energies(scene: &Scene, positions: &[DVec3]) -> Vec<Energy> {
    let tables = [
        scene.material.stretch.0[0],
        scene.fabrics["lining"].stretch.0[0],
    ];
    let faces = scene.mesh.topology().face_indices();
    let shapes = scene.mesh.pattern().faces();
    let stretched = faces.iter().zip(shapes).enumerate();
    let stretched = stretched.map(|(number, (corners, shape))| {
        let element = StretchElement::new(shape);
        let strain = element.strain(corners.map(|v| positions[v as usize]));
        let [k0, k1, k2, k3] = tables[number / 2].map(|k| 2.0 * k);
        let normal = 0.5 * (k0 * strain.uu.powi(2) + k2 * strain.vv.powi(2));
        let density = normal + k1 * strain.uu * strain.vv + k3 * strain.uv.powi(2);
        ([number; 2], element.area * density)
    });
    stretched.chain(bend_energies(scene, positions)).collect()
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

/// Energy of each hinge: k (θ - θ₀)²/2 with k = ke l²/(4 (a_A + a_B)), l the mean of the edge's
/// lengths in the two faces' patterns.
fn bend_energies(scene: &Scene, positions: &[DVec3]) -> Vec<Energy> {
    let (topology, pattern) = (scene.mesh.topology(), scene.mesh.pattern());
    let fabric = |face: selvedge_cloth::FaceId| {
        if face.0 < 2 { &scene.material } else { &scene.fabrics["lining"] }
    };
    let mut bent = Vec::new();
    for (number, edge) in topology.edges().iter().enumerate() {
        let rest = scene.mesh.rest_angles().get(number).copied();
        let Some(opposite) = edge.opposite.1 else {
            continue;
        };
        let [a, b] = edge.vertices;
        let [left, right] = [edge.faces.0, edge.faces.1.unwrap()];
        let along = [left, right].map(|face| {
            let vertices = topology.faces()[face.index()];
            let place = |v| pattern.face(face)[vertices.iter().position(|w| *w == v).unwrap()];
            place(b) - place(a)
        });
        let ke = stiffness(fabric(left), along[0]);
        let other = stiffness(fabric(right), along[1]);
        let factor = if left.0 < 2 && right.0 >= 2 { SEAM_STIFFNESS } else { 1.0 };
        let faces = [left, right].map(selvedge_cloth::FaceId::index);
        let area = scene.rest_shape().face_area[left.index()]
            + scene.rest_shape().face_area[right.index()];
        let length = 0.5 * (along[0].length() + along[1].length());
        let k = factor * 0.5 * (ke + other) * length.powi(2) / (4.0 * area);
        let [from, to, left, right] =
            [a, b, edge.opposite.0, opposite].map(|v| positions[v.index()]);
        let angle = dihedral_angle(from, to, left, right) - rest.unwrap_or(0.0);
        bent.push((faces, 0.5 * k * angle.powi(2)));
    }
    bent
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
        ahead: 0.0,
        positions: &start,
        rates: &still,
        air_velocities: &still,
        stiffening: false,
        air_resistance: AirResistance::None,
    };
    elements.evaluate(Threads::Pool.for_cloth(6), at, &mut impulses);
    let mut seams = scene.mesh.topology().edges().iter();
    assert!(seams.any(|edge| scene.mesh.pattern().is_seam(edge)));
    let h = 1e-6;
    let mut largest = 0.0_f64;
    for (vertex, force) in impulses.iter().enumerate() {
        for axis in 0..3 {
            let energy = |by: f64| {
                let mut moved = start.clone();
                moved[vertex][axis] += by;
                let energies = energies(&scene, &moved).into_iter();
                energies.map(|(_, energy)| energy).sum::<f64>()
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

/// Both panels stretched alike in all directions, a little bent about rest, where the Jacobian of
/// the laws is that of their forces; each panel of its own damping.
fn damped(damping: [f64; 2]) -> Scene {
    let places = AT.map(|(x, y)| DVec3::new(1.2 * x, 1.2 * y, 0.0));
    let mut scene = sewn(1.0, [0.0; 9], places.to_vec());
    scene.material.damping = damping[0];
    scene.fabrics.get_mut("lining").unwrap().damping = damping[1];
    scene.physics.least_damping = Some(0.0);
    scene
}

/// Velocities of six vertices, or any vectors `[m/s]`.
fn velocities() -> Vec<DVec3> {
    let wave = |k: usize| {
        let k = k as f64;
        DVec3::new((2.0 * k).sin(), (1.3 * k).cos(), (0.7 * k + 1.0).sin())
    };
    (0..6).map(wave).collect()
}

/// The derivative along `vectors` of the gradient of Σ w E by differences of the energies E, `[6]`,
/// each element's weight w from the dampings of its faces' panels.
fn curvature(scene: &Scene, weights: [f64; 2], vectors: &[DVec3]) -> Vec<DVec3> {
    let start = scene.mesh.positions();
    let weight = |face: usize| weights[face / 2];
    let energy = |places: &[DVec3]| {
        let energies = energies(scene, places).into_iter();
        let weighted = energies.map(|(faces, energy)| {
            let [left, right] = faces.map(weight);
            0.5 * (left + right) * energy
        });
        weighted.sum::<f64>()
    };
    let h = 1e-5;
    let mut product = vec![DVec3::ZERO; start.len()];
    for (vertex, product) in product.iter_mut().enumerate() {
        for axis in 0..3 {
            let at = |along: f64, across: f64| {
                let mut places = start.to_vec();
                for (place, vector) in places.iter_mut().zip(vectors) {
                    *place += *vector * along;
                }
                places[vertex][axis] += across;
                energy(&places)
            };
            let differences = at(h, h) - at(h, -h) - at(-h, h) + at(-h, -h);
            product[axis] = differences / (4.0 * h * h);
        }
    }
    product
}

#[test]
fn each_panel_is_damped_by_its_own_fabric() {
    let (dt, damping) = (0.004, [0.003, 0.05]);
    let scene = damped(damping);
    scene.validate().unwrap();
    let start = scene.mesh.positions().to_vec();
    let mut elements = Elements::new(&scene);
    let (still, moving) = (vec![DVec3::ZERO; 6], velocities());
    let impulses = |elements: &mut Elements, rates: &[DVec3], ahead: f64| {
        let mut impulses = vec![DVec3::ZERO; 6];
        let at = Linearisation {
            dt,
            ahead,
            positions: &start,
            rates,
            air_velocities: &still,
            stiffening: false,
            air_resistance: AirResistance::None,
        };
        elements.evaluate(Threads::One, at, &mut impulses);
        impulses
    };
    let at_rest = impulses(&mut elements, &still, 0.0);
    for ahead in [0.0, dt] {
        let pushed = impulses(&mut elements, &moving, ahead);
        let expected = curvature(&scene, damping.map(|c| dt * (ahead + c)), &moving);
        for ((pushed, at_rest), expected) in pushed.iter().zip(&at_rest).zip(&expected) {
            // Impulses of 1e-3 to 1e-2 N s; rounding of 1e-5 J s over 4 h² is 1e-11.
            let error = (*pushed - *at_rest + *expected).length();
            assert!(error < 1e-8, "{error:e}: {pushed} {at_rest} {expected}");
        }
        assert!(expected.iter().any(|impulse| impulse.length() > 1e-3));
    }
    // The matrix, as a product and as blocks.
    let mut product = vec![DVec3::ZERO; 6];
    elements.multiply(Threads::One, &moving, &mut product);
    let expected = curvature(&scene, damping.map(|c| dt * (dt + c)), &moving);
    for (vertex, (product, expected)) in product.iter().zip(&expected).enumerate() {
        let whole = *expected + moving[vertex] * elements.mass[vertex];
        let error = product.distance(whole);
        assert!(error < 1e-8, "{error:e}: {product} {whole}");
    }
    // One number for both panels is wrong by far more than the bound.
    let uniform = curvature(&scene, [dt * (dt + damping[0]); 2], &moving);
    let apart = uniform.iter().zip(&expected).map(|(a, b)| a.distance(*b));
    assert!(apart.fold(0.0, f64::max) > 1e-3);
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

/// Elements side by side are the same bits as one by one, at any width of the vectors, and the f32
/// blocks of faces are those of their Jacobians.
#[test]
fn elements_side_by_side_are_as_one_by_one() {
    let mut scene = scene();
    scene.mesh = selvedge_cloth::generate::square(60, 0.3, 2).unwrap().mesh;
    scene.handles = Handles::new(&[], scene.mesh.positions().len()).unwrap();
    scene.physics.law = ElasticLaw::Energy;
    scene.environment.air_density = 1.2;
    scene.environment.wind = DVec3::new(1.0, -2.0, 0.5);
    let wave = |k: usize, by: f64| {
        let t = k as f64;
        DVec3::new(t.sin(), (1.7 * t).cos(), (2.3 * t).sin()) * by
    };
    let start = scene.mesh.positions().iter().enumerate();
    let positions: Vec<DVec3> = start.map(|(k, x)| *x + wave(k, 0.01)).collect();
    let rates: Vec<DVec3> = (0..positions.len()).map(|k| wave(k, 0.3)).collect();
    let at = Linearisation {
        dt: 0.01,
        ahead: 0.0,
        positions: &positions,
        rates: &rates,
        air_velocities: &rates,
        stiffening: true,
        air_resistance: AirResistance::Tangent,
    };
    let mut elements = Elements::new(&scene);
    let mut impulses = vec![DVec3::ZERO; positions.len()];
    elements.evaluate(Threads::One, at, &mut impulses);

    let StretchLaws::Energy(laws) = &elements.stretch_laws else {
        panic!("the law of this scene has an energy")
    };
    let setting = Setting {
        at,
        environment: &elements.environment,
        damping: &elements.damping,
    };
    let corners: Vec<_> = elements.faces.corners().collect();
    let materials: Vec<_> = elements.faces.elements().map(|e| e.1 as usize).collect();
    let faces: Vec<_> = elements.faces.elements().map(|e| e.0).collect();
    let pairs: Vec<_> = corners.iter().copied().zip(faces).collect();
    let mut singly = Faces::new(&pairs, &materials);
    singly.evaluate(Threads::One, laws, setting);
    for face in 0..singly.count() {
        for corner in 0..3 {
            let impulse = elements.faces.impulse(face, corner);
            assert_eq!(impulse, singly.impulse(face, corner), "face {face}");
        }
        let (one, other) = (elements.faces.response(face), singly.response(face));
        for (row, column) in [(0, 0), (1, 0), (2, 1)] {
            let block = one.stretch.negative_jacobian(row, column);
            assert_eq!(block, other.stretch.negative_jacobian(row, column));
        }
        assert_eq!(one.drag, other.drag);
    }

    let mut blocks = vec![FaceBlocks([Mat3A::ZERO; 6]); GROUP];
    let (first, _) = blocks.as_chunks_mut();
    elements.faces.blocks(0, 2.0, 3.0, &mut first[0]);
    for (face, blocks) in blocks.iter().enumerate() {
        let response = elements.faces.response(face);
        for row in 0..3 {
            for column in 0..3 {
                let [x, y, z] = response.stretch.negative_jacobian(row, column);
                let scale = 2.0 * response.jacobian;
                let expected = DMat3::from_cols(x, y, z) * scale + response.drag.matrix(3.0);
                let found = blocks.of(row, column).as_dmat3();
                let largest = |of: DMat3| of.abs().to_cols_array().into_iter().fold(0.0, f64::max);
                let difference = largest(found - expected);
                assert!(difference < 1e-6 * largest(expected), "{row} {column}");
            }
        }
    }

    let hinges = elements.hinges.corners().zip(elements.hinges.elements());
    for (number, (corners, element)) in hinges.enumerate() {
        let places = corners.map(|corner| positions[corner as usize]);
        let expected = element.respond(ElasticLaw::Energy, places);
        let found = elements.hinges.response(number);
        assert_eq!(
            (found.gradient, found.tangent),
            (expected.gradient, expected.tangent)
        );
    }
}
