//! Scenes of cloth that touches: grounds, balls, sheets that lie, stand or slide.

use glam::{DQuat, DVec3};
use selvedge_cloth::{
    ContactSettings, HandleTargets, Handles, Integrator, Mesh, Motion, Obstacle, Scene, Stepper,
};
use selvedge_contact::{Candidates, Reach, Surface, Ways, gap};
use selvedge_sim::Simulator;

use crate::scenes::{GRAY, by_default, material, square_mesh};

pub(crate) const GRAVITY: f64 = 9.8;

/// Two triangles around the origin, tilted about z by `slope` `[rad]`.
pub(crate) fn ground(slope: f64) -> Obstacle {
    let turn = DQuat::from_rotation_z(-slope);
    let corner = |x: f64, z: f64| turn * DVec3::new(x, 0.0, z);
    let points = vec![
        corner(-50.0, -50.0),
        corner(50.0, -50.0),
        corner(50.0, 50.0),
        corner(-50.0, 50.0),
    ];
    Obstacle::new("ground", points, vec![[0, 2, 1], [0, 3, 2]]).unwrap()
}

/// A sphere of 20 · 4^`level` faces around `centre`.
pub(crate) fn sphere(centre: DVec3, radius: f64, level: u32) -> Obstacle {
    let t = (1.0 + 5_f64.sqrt()) / 2.0;
    let mut points: Vec<DVec3> = [
        (-1.0, t, 0.0),
        (1.0, t, 0.0),
        (-1.0, -t, 0.0),
        (1.0, -t, 0.0),
        (0.0, -1.0, t),
        (0.0, 1.0, t),
        (0.0, -1.0, -t),
        (0.0, 1.0, -t),
        (t, 0.0, -1.0),
        (t, 0.0, 1.0),
        (-t, 0.0, -1.0),
        (-t, 0.0, 1.0),
    ]
    .map(|(x, y, z)| DVec3::new(x, y, z).normalize())
    .to_vec();
    let mut faces: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middles = std::collections::BTreeMap::new();
        let mut finer = Vec::new();
        for [a, b, c] in faces {
            let mut middle = |p: u32, q: u32| {
                *middles.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as u32 - 1
                })
            };
            let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
            finer.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
        }
        faces = finer;
    }
    let points = points.iter().map(|p| *p * radius + centre).collect();
    Obstacle::new("sphere", points, faces).unwrap()
}

/// A free sheet of `side`² vertices, 1 m wide, turned by `place` from lying flat at the origin.
pub(crate) fn lying(side: usize, place: impl Fn(DVec3) -> DVec3) -> Scene {
    let mesh = square_mesh(side);
    let positions = mesh
        .positions()
        .iter()
        .map(|p| place(DVec3::new(p.y + 0.5, 0.0, p.z)))
        .collect();
    let coordinates = mesh.material_coordinates().to_vec();
    let faces = mesh.topology().face_indices();
    let mut scene = by_default(side);
    scene.name = "lying".to_owned();
    scene.mesh = Mesh::new(&faces, coordinates, positions).unwrap();
    scene.handles = Handles::new(&[], side * side).unwrap();
    scene.material = material(GRAY);
    scene.motion = Motion::still(10.0);
    scene.environment.air_density = 0.0;
    scene.contact = Some(ContactSettings::default());
    scene
}

/// As closed forms know it: backward Euler, four substeps.
pub(crate) fn first_order(mut scene: Scene) -> Scene {
    scene.physics.integrator = Integrator::Linearised;
    scene.physics.substeps = 4;
    scene
}

pub(crate) fn none() -> HandleTargets {
    HandleTargets::at_frame_end(Vec::new()).unwrap()
}

/// Steps, and looks for intersections in every frame.
pub(crate) fn run(simulator: &mut Simulator, frames: usize) {
    for _ in 0..frames {
        simulator.step(&none()).unwrap();
        assert_eq!(
            simulator.intersection_count(),
            0,
            "frame {}",
            simulator.frame()
        );
    }
    assert!(simulator.yielded().is_empty());
}

/// Steps, and looks for intersections at the end.
pub(crate) fn glide(simulator: &mut Simulator, frames: usize) {
    for _ in 0..frames {
        simulator.step(&none()).unwrap();
    }
    assert_eq!(simulator.intersection_count(), 0);
}

/// The least gap of all pairs of the cloth with itself and with obstacles, up to `most`, at
/// positions of the frame at `time` `[s]`, in metres.
pub(crate) fn smallest_gap(scene: &Scene, positions: &[DVec3], time: f64, most: f64) -> f64 {
    let surface = Surface::new(scene.mesh.topology(), &scene.obstacles);
    let mut points = positions.to_vec();
    for obstacle in &scene.obstacles {
        points.extend(obstacle.positions_at(time));
    }
    let mut candidates = Candidates::new(&surface, &points, true);
    let reach = Reach {
        gap: most,
        slack: 0.0,
    };
    candidates.find(&surface, Ways::still(&points), reach);
    let pairs = candidates.pairs().iter();
    pairs
        .map(|pair| gap(pair.kind, pair.places(&points)).distance)
        .fold(most, f64::min)
}

pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

/// A sheet of 0.3 m on a slope, at its rest gap.
#[derive(Clone, Copy)]
pub(crate) struct OnSlope {
    /// Vertices along a side.
    pub(crate) side: usize,
    /// `[rad]`.
    pub(crate) slope: f64,
    pub(crate) friction: f64,
    /// Angle of the mesh on the slope `[rad]`.
    pub(crate) turn: f64,
    /// Speed downhill at first `[m/s]`.
    pub(crate) speed: f64,
    /// Per frame.
    pub(crate) substeps: u32,
}

/// The gap at which a sheet rests on a slope `[m]`: 2κ(ĝ - g)²/ĝ = m g with κ = m/dt².
pub(crate) fn rest_gap(slope: f64, substeps: u32) -> f64 {
    let dt = 1.0 / (60.0 * f64::from(substeps));
    1e-3 * (1.0 - (GRAVITY * slope.cos() * dt * dt / 2e-3).sqrt())
}

impl OnSlope {
    pub(crate) fn scene(self) -> Scene {
        let down = DQuat::from_rotation_z(-self.slope);
        let across = DQuat::from_rotation_y(self.turn);
        let gap = rest_gap(self.slope, self.substeps);
        let place = |p: DVec3| down * (across * p * 0.3 + DVec3::Y * gap);
        let mut scene = first_order(lying(self.side, place));
        scene.physics.substeps = self.substeps;
        scene.mesh = shrunk(&scene.mesh, 0.3);
        scene.obstacles = vec![ground(self.slope)];
        scene.contact.as_mut().unwrap().friction = self.friction;
        scene
    }

    pub(crate) fn simulator(self) -> Simulator {
        let scene = self.scene();
        let start = scene.mesh.positions().to_vec();
        let downhill = DQuat::from_rotation_z(-self.slope) * DVec3::X;
        let velocities = vec![downhill * self.speed; start.len()];
        Simulator::with_state(&scene, start, velocities).unwrap()
    }
}

/// The mesh with a pattern `scale` times as large.
pub(crate) fn shrunk(mesh: &Mesh, scale: f64) -> Mesh {
    let coordinates = mesh.material_coordinates().iter();
    let coordinates = coordinates.map(|c| *c * scale).collect();
    let faces = mesh.topology().face_indices();
    Mesh::new(&faces, coordinates, mesh.positions().to_vec()).unwrap()
}

/// Several copies of a mesh as one, each placed by its number.
pub(crate) fn copies(mesh: &Mesh, count: usize, place: impl Fn(usize, DVec3) -> DVec3) -> Mesh {
    let own = mesh.positions().len();
    let (mut faces, mut positions) = (Vec::new(), Vec::new());
    for copy in 0..count {
        let first = (copy * own) as u32;
        let moved = mesh.topology().face_indices().into_iter();
        faces.extend(moved.map(|face| face.map(|v| v + first)));
        positions.extend(mesh.positions().iter().map(|p| place(copy, *p)));
    }
    let coordinates = mesh.material_coordinates().repeat(count);
    Mesh::new(&faces, coordinates, positions).unwrap()
}

/// Mean place and speed downhill `[m]`, `[m/s]`.
pub(crate) fn downhill(simulator: &Simulator, slope: f64) -> (f64, f64) {
    let down = DQuat::from_rotation_z(-slope) * DVec3::X;
    (
        mean(simulator.positions_f64().iter().map(|p| p.dot(down))),
        mean(simulator.velocities_f64().iter().map(|v| v.dot(down))),
    )
}
