//! Scenes of cloth that touches: grounds, balls, sheets that lie, stand or slide.

use glam::{DQuat, DVec3};
use selvedge_cloth::{
    ContactSettings, FrictionAnchor, HandleTargets, Handles, Integrator, Mesh, Motion, Obstacle,
    ObstaclePath, RigidKey, Scene, Stepper, Touching, bodies,
};
use selvedge_sim::{ContactGauge, Simulator};

use crate::scenes::{GRAY, by_default, material, square_mesh, steps};

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

/// A sphere around `centre`, drawn by 20 · 4^`level` faces.
pub(crate) fn sphere(centre: DVec3, radius: f64, level: i32) -> Obstacle {
    // Longest edge of the icosahedron, and what is left of it where edges are halved.
    let body = bodies::sphere(radius, 1.053 * radius * 0.588_f64.powi(level));
    Obstacle::of("sphere", body.placed(1.0, |p| p + centre)).unwrap()
}

/// An obstacle that goes from one place to the next, each after so many seconds.
pub(crate) fn led(obstacle: Obstacle, places: &[(f64, DVec3)]) -> Obstacle {
    let key = |(time, translation): &(f64, DVec3)| RigidKey {
        time: *time,
        rotation: DQuat::IDENTITY,
        translation: *translation,
    };
    let path = ObstaclePath::Rigid(places.iter().map(key).collect());
    obstacle.moving(path).unwrap()
}

/// A free sheet of `side`² vertices, 1 m wide, turned by `place` from lying flat at the origin.
pub(crate) fn lying(side: usize, place: impl Fn(DVec3) -> DVec3) -> Scene {
    let mesh = square_mesh(side);
    let flat = mesh.positions().iter();
    let flat = flat.map(|p| place(DVec3::new(p.y + 0.5, 0.0, p.z)));
    let mut scene = by_default(side);
    scene.name = "lying".to_owned();
    scene.mesh = mesh.clone().with_positions(flat.collect()).unwrap();
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
    steps(simulator, &none(), frames);
    assert_eq!(simulator.intersection_count(), 0);
}

/// The least gap of all pairs of the cloth with itself and with obstacles, which stand still, up to
/// the thickness of 1 mm `[m]`.
pub(crate) fn smallest_gap(scene: &Scene, simulator: &Simulator) -> f64 {
    let mut gauge = ContactGauge::of(scene).unwrap();
    let found = gauge.measure(0, simulator.positions()).smallest_gap;
    found.unwrap_or(1e-3)
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

/// The gap at which a sheet of gray interlock rests on a slope `[m]`: the fabric bears by its curve, with
/// the barrier, 2κ(ĝ - g)²/ĝ with κ = m/dt².
pub(crate) fn rest_gap(slope: f64, substeps: u32) -> f64 {
    let dt = 1.0 / (60.0 * f64::from(substeps));
    let fabric = material(GRAY);
    let density = fabric.density;
    let borne = |part: f64| {
        let barrier = 2.0 * density * 1e-3 * (1.0 - part).powi(2) / (dt * dt);
        fabric.compression.pressure(part) + barrier
    };
    let (mut low, mut high) = (0.5, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if borne(middle) > density * GRAVITY * slope.cos() {
            low = middle;
        } else {
            high = middle;
        }
    }
    1e-3 * low
}

/// A cloth at the start of its scene with these velocities `[m/s]`, whose vertices up to this `count` have lain at
/// `gap` `[m]` from the first obstacle, along `normal`, for long.
pub(crate) fn borne(
    scene: &Scene,
    velocities: Vec<DVec3>,
    count: usize,
    gap: f64,
    normal: DVec3,
) -> Simulator {
    let start = scene.mesh.positions().to_vec();
    let simulator = Simulator::with_state(scene, start, velocities).unwrap();
    let mut state = simulator.checkpoint();
    let anchor = |vertex| FrictionAnchor {
        of: Touching::Vertex { vertex, other: 1 },
        normal,
        pull: DVec3::ZERO,
        pressed: 1.0 - gap / 1e-3,
    };
    let memory = state.contact.get_or_insert_default();
    memory.anchors = (0..count as u32).map(anchor).collect();
    Simulator::from_checkpoint(scene, &state).unwrap()
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
        let count = scene.mesh.positions().len();
        let downhill = DQuat::from_rotation_z(-self.slope) * DVec3::X;
        let velocities = vec![downhill * self.speed; count];
        let normal = DQuat::from_rotation_z(-self.slope) * DVec3::Y;
        borne(
            &scene,
            velocities,
            count,
            rest_gap(self.slope, self.substeps),
            normal,
        )
    }
}

/// The mesh with a pattern `scale` times as large.
pub(crate) fn shrunk(mesh: &Mesh, scale: f64) -> Mesh {
    let coordinates = mesh.material_coordinates().iter();
    let coordinates = coordinates.map(|c| *c * scale).collect();
    let faces = mesh.topology().face_indices();
    Mesh::new(&faces, coordinates, mesh.positions().to_vec()).unwrap()
}

/// Several meshes as one, in their order.
pub(crate) fn joined(parts: &[Mesh]) -> Mesh {
    let (mut faces, mut coordinates, mut positions) = (Vec::new(), Vec::new(), Vec::new());
    for part in parts {
        let first = positions.len() as u32;
        let own = part.topology().face_indices().into_iter();
        faces.extend(own.map(|face| face.map(|v| v + first)));
        coordinates.extend(part.material_coordinates());
        positions.extend(part.positions());
    }
    Mesh::new(&faces, coordinates, positions).unwrap()
}

/// Several copies of a mesh as one, each placed by its number.
pub(crate) fn copies(mesh: &Mesh, count: usize, place: impl Fn(usize, DVec3) -> DVec3) -> Mesh {
    let copy = |number: usize| {
        let placed = mesh.positions().iter().map(|p| place(number, *p));
        mesh.clone().with_positions(placed.collect()).unwrap()
    };
    joined(&(0..count).map(copy).collect::<Vec<Mesh>>())
}

/// Mean place and speed downhill `[m]`, `[m/s]`.
pub(crate) fn downhill(simulator: &Simulator, slope: f64) -> (f64, f64) {
    let down = DQuat::from_rotation_z(-slope) * DVec3::X;
    (
        mean(simulator.positions_f64().iter().map(|p| p.dot(down))),
        mean(simulator.velocities_f64().iter().map(|v| v.dot(down))),
    )
}
