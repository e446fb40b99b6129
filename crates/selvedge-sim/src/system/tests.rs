//! The sparse system against a slow, obvious one: dense matrices over all vertices, each law
//! written out as the equations say, exact handles by striking rows and columns out.

use glam::{DMat3, DVec2, DVec3};
use selvedge_cloth::geometry::dihedral_angle;
use selvedge_cloth::{
    BendTable, BendingLaw, Environment, HandleConstraint, HandleSchedule, Handles, Material, Mesh,
    Motion, PhysicsSettings, SagSettings, Scene, StretchLookup, StretchTable,
};

use super::*;
use crate::bend::angle_gradient;
use crate::stretch::Strain;

const DT: f64 = 1.0 / 120.0;

/// A bent strip of eight faces with two handles that are no neighbours in number.
fn scene(handles: HandleConstraint, bending: BendingLaw) -> Scene {
    let coordinates: Vec<DVec2> = (0..10)
        .map(|k| {
            let k = f64::from(k);
            DVec2::new(0.05 * (k / 2.0).floor() + 0.004 * k.sin(), 0.06 * (k % 2.0))
        })
        .collect();
    let faces: Vec<[u32; 3]> = (0..4)
        .flat_map(|k| {
            let a = 2 * k;
            [[a, a + 2, a + 1], [a + 1, a + 2, a + 3]]
        })
        .collect();
    let positions = coordinates
        .iter()
        .enumerate()
        .map(|(k, c)| {
            let wave = 0.02 * (70.0 * c.x + 0.3 * k as f64).sin();
            DVec3::new(1.1 * c.x, wave, 0.95 * c.y + 0.2 * wave)
        })
        .collect();
    Scene {
        name: "strip".to_owned(),
        mesh: Mesh::new(&faces, coordinates, positions).unwrap(),
        handles: Handles::new(&[7, 2], 10).unwrap(),
        schedule: HandleSchedule::default(),
        material: Material {
            name: "test".to_owned(),
            source: String::new(),
            density: 0.2,
            damping: 0.004,
            stretch: StretchTable([[40.0, 15.0, 80.0, 30.0]; 6]),
            bend: BendTable([[3e-5; 5], [2e-5; 5], [1e-5; 5]]),
            strain_limits: None,
        },
        environment: Environment {
            wind: DVec3::new(0.5, -0.3, 0.2),
            air_drag: 0.1,
            ..Environment::default()
        },
        motion: Motion::still(1.0),
        physics: PhysicsSettings {
            handles,
            bending,
            stretch_lookup: StretchLookup::Exact,
            ..PhysicsSettings::default()
        },
        sag: SagSettings::default(),
        frame_rate: 60.0,
    }
}

fn state(scene: &Scene) -> State {
    let positions = scene.mesh.positions().to_vec();
    let velocities = (0..positions.len())
        .map(|k| {
            let k = k as f64;
            DVec3::new(k.sin(), (2.0 * k).cos(), (0.7 * k).sin())
        })
        .collect();
    State {
        positions,
        velocities,
    }
}

/// Force and Jacobian of everything, `[3 vertices]` and `[3 vertices, 3 vertices]`.
struct Dense {
    force: Vec<f64>,
    jacobian: Vec<Vec<f64>>,
}

impl Dense {
    fn of(scene: &Scene, state: &State) -> Self {
        let size = 3 * state.positions.len();
        let mut dense = Self {
            force: vec![0.0; size],
            jacobian: vec![vec![0.0; size]; size],
        };
        for corners in scene.mesh.topology().face_indices() {
            dense.add_face(scene, state, corners);
        }
        for corners in hinge_stencils(&scene.mesh) {
            dense.add_hinge(scene, state, corners);
        }
        dense
    }

    fn add(&mut self, corners: &[u32], force: &[f64], jacobian: &dyn Fn(usize, usize) -> f64) {
        let place = |k: usize| 3 * corners[k / 3] as usize + k % 3;
        for i in 0..force.len() {
            self.force[place(i)] += force[i];
            for j in 0..force.len() {
                self.jacobian[place(i)][place(j)] += jacobian(i, j);
            }
        }
    }

    fn add_face(&mut self, scene: &Scene, state: &State, corners: [u32; 3]) {
        let [p, q, r] = corners.map(|v| scene.mesh.material_coordinates()[v as usize]);
        let area = 0.5 * (q - p).perp_dot(r - p);
        // The gradient of a corner's linear weight is its opposite edge, turned, over 2 a.
        let turned = [r - q, p - r, q - p].map(|edge| edge.perp() / (2.0 * area));
        let x = corners.map(|v| state.positions[v as usize]);
        let along_u: DVec3 = (0..3).map(|a| x[a] * turned[a].x).sum();
        let along_v: DVec3 = (0..3).map(|a| x[a] * turned[a].y).sum();
        let flat = |d: &dyn Fn(usize) -> f64, f: DVec3| -> Vec<f64> {
            (0..9).map(|k| d(k / 3) * f[k % 3]).collect()
        };
        let (du, dv) = (|a: usize| turned[a].x, |a: usize| turned[a].y);
        let (uu, vv) = (flat(&du, along_u), flat(&dv, along_v));
        let (u_v, v_u) = (flat(&du, along_v), flat(&dv, along_u));
        let uv: Vec<f64> = (0..9).map(|k| 0.5 * (u_v[k] + v_u[k])).collect();
        let strain = Strain {
            uu: 0.5 * (along_u.length_squared() - 1.0),
            vv: 0.5 * (along_v.length_squared() - 1.0),
            uv: 0.5 * along_u.dot(along_v),
        };
        let [k0, k1, k2, k3] = ExactStiffness::new(scene.material.stretch).at(strain);
        let force: Vec<f64> = (0..9)
            .map(|k| {
                -area
                    * ((k0 * strain.uu + k1 * strain.vv) * uu[k]
                        + (k2 * strain.vv + k1 * strain.uu) * vv[k]
                        + 2.0 * k3 * strain.uv * uv[k])
            })
            .collect();
        let (tense_u, tense_v) = (strain.uu.max(0.0), strain.vv.max(0.0));
        let jacobian = |i: usize, j: usize| {
            let identity = f64::from(u8::from(i % 3 == j % 3));
            -area
                * (k0 * uu[i] * uu[j]
                    + k2 * vv[i] * vv[j]
                    + k1 * (uu[i] * vv[j] + vv[i] * uu[j])
                    + 2.0 * k3 * uv[i] * uv[j]
                    + (k0 * tense_u + k1 * tense_v) * du(i / 3) * du(j / 3) * identity
                    + (k2 * tense_v + k1 * tense_u) * dv(i / 3) * dv(j / 3) * identity)
        };
        self.add(&corners, &force, &jacobian);
    }

    fn add_hinge(&mut self, scene: &Scene, state: &State, corners: [u32; 4]) {
        let [p, q, r, s] = corners.map(|v| scene.mesh.material_coordinates()[v as usize]);
        let areas = 0.5 * ((q - p).perp_dot(r - p) + (s - p).perp_dot(q - p));
        let x = corners.map(|v| state.positions[v as usize]);
        let theta = dihedral_angle(x[0], x[1], x[2], x[3]);
        // Every column of the test's table is the same: only the direction matters.
        let place = (q - p).y.abs().atan2((q - p).x.abs()) / std::f64::consts::FRAC_PI_4;
        let ke = 3e-5 - 1e-5 * place;
        let length = x[0].distance(x[1]);
        let coefficient = ke * length * length / (2.0 * areas);
        let gradient: Vec<f64> = angle_gradient(x)
            .iter()
            .flat_map(|g| g.to_array())
            .collect();
        let force: Vec<f64> = gradient
            .iter()
            .map(|g| -coefficient * theta / 2.0 * g)
            .collect();
        let jacobian = |i: usize, j: usize| -coefficient / 2.0 * gradient[i] * gradient[j];
        self.add(&corners, &force, &jacobian);
    }
}

/// A and b of one solve over all vertices, springs included.
fn dense_system(scene: &Scene, state: &State, targets: &[DVec3]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let dense = Dense::of(scene, state);
    let mass = scene.mesh.rest_shape(scene.material.density).vertex_mass;
    let rest = scene.mesh.rest_shape(scene.material.density).face_area;
    let size = dense.force.len();
    let velocity: Vec<f64> = state.velocities.iter().flat_map(|v| v.to_array()).collect();
    let scale = DT * (DT + scene.material.damping);
    let mut matrix = dense.jacobian.clone();
    let mut right_side = vec![0.0; size];
    for i in 0..size {
        matrix[i].iter_mut().for_each(|entry| *entry *= -scale);
        matrix[i][i] += mass[i / 3];
        let damping: f64 = (0..size).map(|j| dense.jacobian[i][j] * velocity[j]).sum();
        let gravity = mass[i / 3] * scene.environment.gravity[i % 3];
        right_side[i] = DT * (gravity + dense.force[i]) + scale * damping;
    }
    for (face, area) in scene.mesh.topology().face_indices().iter().zip(rest) {
        let x = face.map(|v| state.positions[v as usize]);
        let v = face.map(|v| state.velocities[v as usize]);
        let force = air_force(&scene.environment, area, x, v);
        for k in 0..9 {
            right_side[3 * face[k / 3] as usize + k % 3] += DT * force[k % 3] / 3.0;
        }
    }
    if scene.physics.handles == HandleConstraint::Spring {
        for (handle, target) in scene.handles.vertices().iter().zip(targets) {
            for axis in 0..3 {
                let i = 3 * handle.index() + axis;
                let x = state.positions[handle.index()][axis];
                matrix[i][i] += DT * DT * 1e3;
                right_side[i] -= DT * 1e3 * (x - target[axis] + DT * velocity[i]);
            }
        }
    }
    (matrix, right_side)
}

/// Replaces the rows of exact handles by "Δv is what leads to the target".
fn prescribe(
    scene: &Scene,
    state: &State,
    targets: &[DVec3],
    (matrix, right_side): (&mut [Vec<f64>], &mut [f64]),
) {
    for (handle, target) in scene.handles.vertices().iter().zip(targets) {
        let h = handle.index();
        let change = (*target - state.positions[h]) / DT - state.velocities[h];
        for axis in 0..3 {
            let i = 3 * h + axis;
            matrix[i].fill(0.0);
            matrix[i][i] = 1.0;
            right_side[i] = change[axis];
        }
    }
}

/// Gauss with partial pivoting.
fn eliminate(mut matrix: Vec<Vec<f64>>, mut right_side: Vec<f64>) -> Vec<f64> {
    let size = right_side.len();
    for k in 0..size {
        let pivot = (k..size)
            .max_by(|&a, &b| matrix[a][k].abs().total_cmp(&matrix[b][k].abs()))
            .unwrap();
        matrix.swap(k, pivot);
        right_side.swap(k, pivot);
        let row = matrix[k].clone();
        for i in k + 1..size {
            let factor = matrix[i][k] / row[k];
            for (entry, above) in matrix[i].iter_mut().zip(&row) {
                *entry -= factor * above;
            }
            right_side[i] -= factor * right_side[k];
        }
    }
    for k in (0..size).rev() {
        let known: f64 = (k + 1..size).map(|j| matrix[k][j] * right_side[j]).sum();
        right_side[k] = (right_side[k] - known) / matrix[k][k];
    }
    right_side
}

fn targets(scene: &Scene) -> Vec<DVec3> {
    let shift = DVec3::new(0.004, -0.002, 0.003);
    let start = scene.handles.select(scene.mesh.positions());
    start.iter().map(|x| *x + shift).collect()
}

#[test]
fn sparse_solve_is_the_dense_one() {
    for constraint in [HandleConstraint::Exact, HandleConstraint::Spring] {
        for bending in [BendingLaw::Symmetric, BendingLaw::Arcsim] {
            let scene = scene(constraint, bending);
            let (before, targets) = (state(&scene), targets(&scene));
            let (mut matrix, mut right_side) = dense_system(&scene, &before, &targets);
            if constraint == HandleConstraint::Exact {
                prescribe(&scene, &before, &targets, (&mut matrix, &mut right_side));
            }
            let expected = eliminate(matrix, right_side);
            let mut after = before.clone();
            let mut system = System::new(&scene).unwrap();
            system.advance(DT, &mut after, &targets).unwrap();
            for (v, change) in expected.chunks_exact(3).enumerate() {
                let velocity = before.velocities[v] + DVec3::from_slice(change);
                let position = before.positions[v] + velocity * DT;
                // Entries of A span three orders of magnitude, velocities are about 1 m/s.
                assert!(
                    after.velocities[v].distance(velocity) < 1e-11,
                    "{constraint:?} {v}"
                );
                assert!(
                    after.positions[v].distance(position) < 1e-13,
                    "{constraint:?} {v}"
                );
            }
        }
    }
}

#[test]
fn assembled_blocks_are_those_of_the_dense_matrix() {
    let scene = scene(HandleConstraint::Exact, BendingLaw::Symmetric);
    let (before, targets) = (state(&scene), targets(&scene));
    let (matrix, _) = dense_system(&scene, &before, &targets);
    let mut system = System::new(&scene).unwrap();
    // Twice, because nothing of an earlier solve may be left.
    system.assemble(0.3, &before, &targets);
    system.assemble(DT, &before, &targets);
    let unused = system.pattern.slot_count() - 1;
    for &a in system.pattern.vertices() {
        for &b in system.pattern.vertices() {
            let (row, column) = if system.pattern.unknown(a) >= system.pattern.unknown(b) {
                (a, b)
            } else {
                (b, a)
            };
            let slot = system.pattern.slot(a, b) as usize;
            let found = if slot == unused {
                DMat3::ZERO
            } else {
                system.blocks[slot]
            };
            for i in 0..3 {
                for j in 0..3 {
                    let expected = matrix[3 * row as usize + i][3 * column as usize + j];
                    assert!((found.col(j)[i] - expected).abs() < 1e-15, "{row} {column}");
                }
            }
        }
    }
}

#[test]
fn laws_and_look_ups_of_the_scene_are_used() {
    let mut scene = scene(HandleConstraint::Exact, BendingLaw::Symmetric);
    scene.material.bend.0 = [[3e-4, 1e-4, 2e-5, 1e-5, 5e-6]; 3];
    scene.material.stretch.0[0] = [10.0, 5.0, 20.0, 10.0];
    let run = |scene: &Scene| {
        let mut after = state(scene);
        System::new(scene)
            .unwrap()
            .advance(DT, &mut after, &targets(scene))
            .unwrap();
        after
    };
    let base = run(&scene);
    let mut arcsim = scene.clone();
    arcsim.physics.bending = BendingLaw::Arcsim;
    let mut grid = scene.clone();
    grid.physics.stretch_lookup = StretchLookup::Grid;
    let mut spring = scene.clone();
    spring.physics.handles = HandleConstraint::Spring;
    for other in [arcsim, grid, spring] {
        assert_ne!(run(&other), base);
    }
}
