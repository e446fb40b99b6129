//! Small scenes that need no file and no generator.

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    GeneralisedAlpha, HandleTargets, Handles, Integrator, Keyframe, KeyframeGroup, KeyframeMotion,
    LinearSolver, Material, Mesh, Motion, PhysicsSettings, Scene, Stepper,
};
use selvedge_sim::Simulator;
use selvedge_sim::laws::stretch::StretchElement;

pub(crate) const GRAY: &str = selvedge_assets::MATERIALS[0].1;
pub(crate) const CAMEL: &str = selvedge_assets::MATERIALS[1].1;
pub(crate) const DENIM: &str = selvedge_assets::MATERIALS[2].1;
pub(crate) const NAVY: &str = selvedge_assets::MATERIALS[3].1;

/// The generalised-α method where it is BDF2.
pub(crate) const BDF2: Integrator = Integrator::GeneralisedAlpha(GeneralisedAlpha {
    spectral_radius: Some(0.0),
});

/// Every integrator: of first order, BDF2, and the default of the generalised-α method.
pub(crate) const INTEGRATORS: [Integrator; 3] = [
    Integrator::Linearised,
    BDF2,
    Integrator::GeneralisedAlpha(GeneralisedAlpha {
        spectral_radius: None,
    }),
];

pub(crate) fn material(text: &str) -> Material {
    let material: Material = toml::from_str(text).unwrap();
    material.validate().unwrap();
    material
}

/// A unit square of `side`² vertices in the yz-plane, row by row from the top edge (y = 0), its
/// inner vertices shifted so that no two faces are alike. Normals (-1, 0, 0).
pub(crate) fn square_mesh(side: usize) -> Mesh {
    let spacing = 1.0 / (side - 1) as f64;
    let mut coordinates = Vec::new();
    for row in 0..side {
        for column in 0..side {
            let inner = (1..side - 1).contains(&row) && (1..side - 1).contains(&column);
            let phase = (7 * row + 3 * column) as f64;
            let shift = if inner { 0.15 * spacing } else { 0.0 };
            coordinates.push(DVec2::new(
                column as f64 * spacing + shift * phase.sin(),
                1.0 - row as f64 * spacing + shift * (1.7 * phase).cos(),
            ));
        }
    }
    let positions = coordinates
        .iter()
        .map(|c| DVec3::new(0.0, c.y - 1.0, c.x - 0.5))
        .collect();
    Mesh::new(&squares(side - 1, side - 1), coordinates, positions).unwrap()
}

/// Faces of `columns` × `rows` squares whose vertices are numbered row by row. Diagonals alternate, so
/// that with an even number of columns the mesh is its own mirror image.
pub(crate) fn squares(columns: usize, rows: usize) -> Vec<[u32; 3]> {
    let square = |k: usize| {
        let (row, column) = (k / columns, k % columns);
        let a = (row * (columns + 1) + column) as u32;
        let (b, c, d) = (a + columns as u32 + 1, a + columns as u32 + 2, a + 1);
        match (row + column) % 2 {
            0 => [[a, b, c], [a, c, d]],
            _ => [[a, b, d], [d, b, c]],
        }
    };
    (0..columns * rows).flat_map(square).collect()
}

/// Gray interlock hanging from its upper corners, solved by a complete factorisation: what closed
/// forms and other runs are compared with to the last digits.
pub(crate) fn hanging(side: usize) -> Scene {
    let mesh = square_mesh(side);
    let vertex_count = mesh.topology().vertex_count();
    let handles = Handles::new(&[0, side as u32 - 1], vertex_count).unwrap();
    let mut scene = Scene::of("hanging", mesh, handles, material(GRAY));
    scene.physics.solver = LinearSolver::Cholesky;
    scene
}

/// The same cloth by the default physics in all.
pub(crate) fn by_default(side: usize) -> Scene {
    Scene {
        physics: PhysicsSettings::default(),
        ..hanging(side)
    }
}

/// The same cloth with nothing that holds it and nothing that acts on it.
pub(crate) fn floating(side: usize) -> Scene {
    let mut scene = hanging(side);
    scene.handles = Handles::new(&[], side * side).unwrap();
    scene.environment.gravity = DVec3::ZERO;
    scene.environment.air_density = 0.0;
    scene
}

/// Places of the handles at the start `[m]`, `[handles]`.
pub(crate) fn held(scene: &Scene) -> Vec<DVec3> {
    scene.handles.select(scene.mesh.positions())
}

/// Targets of a frame in which the handles stay where they started.
pub(crate) fn still(scene: &Scene) -> HandleTargets {
    moved(scene, DVec3::ZERO)
}

/// Targets of a frame at whose end the handles are `by` from where they started `[m]`.
pub(crate) fn moved(scene: &Scene, by: DVec3) -> HandleTargets {
    let places = held(scene).into_iter().map(|place| place + by);
    HandleTargets::at_frame_end(places.collect()).unwrap()
}

/// Both of two handles led by `by` `[m]` within 0.6 s.
pub(crate) fn led_by(by: DVec3) -> Motion {
    let end = Keyframe {
        time: 0.6,
        translation: by,
        rotation_deg: 0.0,
    };
    Motion::Keyframes(KeyframeMotion {
        duration: 0.6,
        groups: vec![KeyframeGroup {
            handles: vec![0, 1],
            axis: DVec3::Y,
            keyframes: vec![end],
        }],
    })
}

/// A simulator of `scene` that starts at `positions` `[m]` without velocity.
pub(crate) fn at_rest(scene: &Scene, positions: Vec<DVec3>) -> Simulator {
    let velocities = vec![DVec3::ZERO; positions.len()];
    Simulator::with_state(scene, positions, velocities).unwrap()
}

/// Moves the cloth by so many frames, its handles to these targets in each.
pub(crate) fn steps(simulator: &mut Simulator, targets: &HandleTargets, frames: usize) {
    for _ in 0..frames {
        simulator.step(targets).unwrap();
    }
}

/// What `work` gives in a pool of so many threads.
pub(crate) fn in_pool<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> R {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build().unwrap().install(work)
}

/// Stretches l/l₀ of the edges that handles do not hold at both ends.
pub(crate) fn edge_stretches(scene: &Scene, positions: &[DVec3]) -> Vec<f64> {
    let held = scene.handles.mask(positions.len());
    let edges = scene.mesh.topology().edges().iter();
    edges
        .zip(scene.mesh.pattern().edge_lengths())
        .filter(|(edge, _)| !edge.vertices.iter().all(|v| held[v.index()]))
        .map(|(edge, rest)| {
            let [a, b] = edge.vertices.map(|v| v.index());
            positions[a].distance(positions[b]) / rest
        })
        .collect()
}

/// Largest strain of such an edge.
pub(crate) fn largest_strain(scene: &Scene, positions: &[DVec3]) -> f64 {
    let stretches = edge_stretches(scene, positions).into_iter();
    stretches.fold(f64::NEG_INFINITY, f64::max) - 1.0
}

/// Momentum of the cloth `[N s]`.
pub(crate) fn momentum(simulator: &Simulator) -> DVec3 {
    let masses = simulator.vertex_mass().iter();
    let pairs = masses.zip(simulator.velocities_f64());
    pairs.map(|(mass, velocity)| *velocity * *mass).sum()
}

/// Vectors of length at most √3 · `scale` that look random and are always the same.
pub(crate) fn noise(count: usize, scale: f64) -> Vec<DVec3> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        scale * ((state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0)
    };
    (0..count)
        .map(|_| DVec3::new(next(), next(), next()))
        .collect()
}

/// Positions of the mesh of `scene`, each moved by [`noise`] of this `scale` `[m]`.
pub(crate) fn crumpled(scene: &Scene, scale: f64) -> Vec<DVec3> {
    let positions = scene.mesh.positions();
    let shifts = noise(positions.len(), scale);
    positions
        .iter()
        .zip(shifts)
        .map(|(x, shift)| *x + shift)
        .collect()
}

pub(crate) fn largest_distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f64::max)
}

/// Principal stretches of every face, the larger first, `[faces]`.
pub(crate) fn stretches(mesh: &Mesh, positions: &[DVec3]) -> Vec<[f64; 2]> {
    let uv = mesh.material_coordinates();
    let faces = mesh.topology().face_indices();
    let stretch = |corners: &[u32; 3]| {
        let element = StretchElement::new(corners.map(|v| uv[v as usize]));
        let (u, v) = element.gradient(corners.map(|v| positions[v as usize]));
        let trace = u.length_squared() + v.length_squared();
        let area = u.cross(v).length();
        let spread = (0.25 * trace * trace - area * area).max(0.0).sqrt();
        [1.0, -1.0].map(|sign| (0.5 * trace + sign * spread).max(0.0).sqrt())
    };
    faces.iter().map(stretch).collect()
}

/// Numbers of the variable `NUMBERS`, such as `0,4,8`; 0 without it.
pub(crate) fn numbers() -> Vec<usize> {
    let listed = std::env::var("NUMBERS").unwrap_or_else(|_| "0".to_owned());
    listed.split(',').map(|one| one.parse().unwrap()).collect()
}
