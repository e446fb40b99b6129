//! Cloth that touches: closed forms of rest and friction, momentum, and that nothing ever
//! intersects.

use glam::{DQuat, DVec3};
use selvedge_cloth::{
    ContactSettings, HandleTargets, Handles, Integrator, Mesh, Motion, Obstacle, ObstaclePath,
    RigidKey, Scene, StepError, Stepper,
};
use selvedge_sim::{Simulator, SimulatorError, Threads};

use crate::scenes::{GRAY, hanging, material, square_mesh};

const GRAVITY: f64 = 9.8;

/// Two triangles around the origin, tilted about z by `slope` `[rad]`.
fn ground(slope: f64) -> Obstacle {
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
fn sphere(centre: DVec3, radius: f64, level: u32) -> Obstacle {
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
fn lying(side: usize, place: impl Fn(DVec3) -> DVec3) -> Scene {
    let mesh = square_mesh(side);
    let positions = mesh
        .positions()
        .iter()
        .map(|p| place(DVec3::new(p.y + 0.5, 0.0, p.z)))
        .collect();
    let coordinates = mesh.material_coordinates().to_vec();
    let faces = mesh.topology().face_indices();
    let mut scene = hanging(side);
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
fn first_order(mut scene: Scene) -> Scene {
    scene.physics.integrator = Integrator::Linearised;
    scene.physics.substeps = 4;
    scene
}

fn none() -> HandleTargets {
    HandleTargets::at_frame_end(Vec::new()).unwrap()
}

/// Steps, and looks for intersections in every frame.
fn run(simulator: &mut Simulator, frames: usize) {
    for _ in 0..frames {
        simulator.step(&none()).unwrap();
        assert_eq!(
            simulator.intersection_count(),
            0,
            "frame {}",
            simulator.frame()
        );
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value;
        count += 1.0;
    }
    sum / count
}

#[test]
fn a_sheet_at_rest_stands_where_the_barrier_carries_it() {
    let mut scene = first_order(lying(8, |p| p + DVec3::Y * 8e-4));
    scene.obstacles = vec![ground(0.0)];
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, 60);
    // 2κ(ĝ - g)²/ĝ = m g with κ = m/dt²: g = ĝ (1 - √(g dt²/(2ĝ))).
    let expected = 1e-3 * (1.0 - (GRAVITY / 240.0 / 240.0 / 2e-3_f64).sqrt());
    assert!((expected / 1e-3 - 0.71).abs() < 0.005);
    let found = mean(simulator.positions_f64().iter().map(|p| p.y));
    assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
    assert!(
        simulator.kinetic_energy() < 1e-9,
        "{}",
        simulator.kinetic_energy()
    );
}

#[test]
fn a_sheet_drapes_over_a_sphere() {
    let mut scene = lying(16, |p| p + DVec3::Y * 0.31);
    scene.obstacles = vec![sphere(DVec3::ZERO, 0.3, 3), ground(0.0)];
    scene.obstacles[1] = {
        let points = ground(0.0)
            .positions_at(0.0)
            .map(|p| p - DVec3::Y * 0.4)
            .collect();
        Obstacle::new("ground", points, vec![[0, 2, 1], [0, 3, 2]]).unwrap()
    };
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, 60);
    let counts = simulator.contact_counts();
    assert!(counts.touching > 20, "{counts:?}");
    assert_eq!(counts.divisions, 0, "{counts:?}");
}

#[test]
fn a_strip_folds_onto_itself() {
    let mut scene = lying(12, |p| {
        DVec3::new(0.2 * p.z, p.x + 0.55, 0.02 * (7.0 * p.x).sin())
    });
    let _ = &mut scene;
    scene.obstacles = vec![ground(0.0)];
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, 100);
    let counts = simulator.contact_counts();
    assert!(counts.touching > 20, "{counts:?}");
}

/// A sheet on a slope, at its rest gap, at first at `speed` `[m/s]` downhill; turned on the slope
/// by `turn` `[rad]`.
fn on_slope(side: usize, slope: f64, friction: f64, turn: f64, speed: f64) -> Simulator {
    let down = DQuat::from_rotation_z(-slope);
    let across = DQuat::from_rotation_y(turn);
    let gap = 1e-3 * (1.0 - (GRAVITY * slope.cos() / 240.0 / 240.0 / 2e-3_f64).sqrt());
    let place = |p: DVec3| down * (across * p * 0.3 + DVec3::Y * gap);
    let mut scene = first_order(lying(side, place));
    // The pattern shrinks with the sheet.
    let coordinates = scene
        .mesh
        .material_coordinates()
        .iter()
        .map(|c| *c * 0.3)
        .collect();
    let faces = scene.mesh.topology().face_indices();
    scene.mesh = Mesh::new(&faces, coordinates, scene.mesh.positions().to_vec()).unwrap();
    scene.obstacles = vec![ground(slope)];
    scene.contact.as_mut().unwrap().friction = friction;
    let start = scene.mesh.positions().to_vec();
    let velocities = vec![down * DVec3::X * speed; start.len()];
    Simulator::with_state(&scene, start, velocities).unwrap()
}

/// Mean place and speed downhill `[m]`, `[m/s]`.
fn downhill(simulator: &Simulator, slope: f64) -> (f64, f64) {
    let down = DQuat::from_rotation_z(-slope) * DVec3::X;
    (
        mean(simulator.positions_f64().iter().map(|p| p.dot(down))),
        mean(simulator.velocities_f64().iter().map(|v| v.dot(down))),
    )
}

#[test]
fn friction_above_the_slope_holds_without_creep() {
    for (side, degrees, turn) in [
        (5, 10.0_f64, 0.0),
        (5, 20.0, 0.4),
        (17, 20.0, 0.0),
        (5, 35.0, 0.7),
    ] {
        let slope = degrees.to_radians();
        let mut simulator = on_slope(side, slope, 1.02 * slope.tan(), turn, 0.0);
        run(&mut simulator, 60);
        let (from, _) = downhill(&simulator, slope);
        run(&mut simulator, 240);
        let (to, _) = downhill(&simulator, slope);
        let creep = (to - from) / 4.0;
        assert!(creep.abs() < 1e-5, "{side} {degrees}: {creep}");
    }
}

#[test]
fn a_resumed_sheet_slips_once_for_the_pull_that_its_anchors_lost() {
    let slope = 20_f64.to_radians();
    let resting = || {
        let mut simulator = on_slope(5, slope, 1.02 * slope.tan(), 0.4, 0.0);
        run(&mut simulator, 60);
        simulator
    };
    let (mut straight, mut resumed) = (resting(), resting());
    let (from, _) = downhill(&straight, slope);
    // A state file has positions and velocities.
    let (positions, velocities) = (
        resumed.positions_f64().to_vec(),
        resumed.velocities_f64().to_vec(),
    );
    resumed.resume(60, &positions, &velocities).unwrap();
    run(&mut straight, 60);
    run(&mut resumed, 60);
    let [held, slipped] = [straight, resumed].map(|s| downhill(&s, slope).0 - from);
    // An anchor gives way by g sin θ dt². Where none is left, the sheet gains g sin θ dt in one
    // substep, which 2 % of g sin θ take from it again: 25 times as far.
    let give = GRAVITY * slope.sin() / 240.0 / 240.0;
    assert!(held.abs() < 0.1 * give, "{held}");
    assert!(
        slipped > 0.1 * give && slipped < 25.0 * give,
        "{slipped} {give}"
    );
}

#[test]
fn friction_below_the_slope_slides_as_coulomb_has_it() {
    for (side, degrees, turn) in [
        (5, 10.0_f64, 0.0),
        (5, 20.0, 0.4),
        (17, 20.0, 0.0),
        (5, 35.0, 0.7),
    ] {
        let slope = degrees.to_radians();
        let friction = 0.5 * slope.tan();
        let mut simulator = on_slope(side, slope, friction, turn, 0.0);
        run(&mut simulator, 10);
        let (_, from) = downhill(&simulator, slope);
        run(&mut simulator, 60);
        let (_, to) = downhill(&simulator, slope);
        let expected = GRAVITY * (slope.sin() - friction * slope.cos());
        assert!(
            ((to - from) / expected - 1.0).abs() < 0.02,
            "{} {expected}",
            to - from
        );
    }
}

#[test]
fn a_sliding_sheet_stops_after_its_distance() {
    let mut simulator = on_slope(5, 0.0, 0.3, 0.3, 1.0);
    let (from, _) = downhill(&simulator, 0.0);
    run(&mut simulator, 40);
    let (to, speed) = downhill(&simulator, 0.0);
    let expected = 1.0 / (2.0 * 0.3 * GRAVITY);
    assert!(
        ((to - from) / expected - 1.0).abs() < 0.02,
        "{} {expected}",
        to - from
    );
    assert!(speed.abs() < 1e-3, "{speed}");
}

#[test]
fn two_free_sheets_that_meet_keep_their_momentum() {
    // Both in one mesh: the second above the first, turned, and thrown at it.
    let mut scene = lying(6, |p| p);
    let lower = scene.mesh.clone();
    let count = lower.positions().len() as u32;
    let mut positions = lower.positions().to_vec();
    let turn = DQuat::from_rotation_y(0.5);
    positions.extend(
        lower
            .positions()
            .iter()
            .map(|p| turn * *p + DVec3::Y * 0.01),
    );
    let mut faces = lower.topology().face_indices();
    let upper: Vec<[u32; 3]> = faces.iter().map(|face| face.map(|v| v + count)).collect();
    faces.extend(upper);
    let coordinates = lower.material_coordinates().repeat(2);
    scene.mesh = Mesh::new(&faces, coordinates, positions.clone()).unwrap();
    scene.handles = Handles::new(&[], 2 * count as usize).unwrap();
    scene.environment.gravity = DVec3::ZERO;
    let thrown = |v: u32| {
        if v < count {
            DVec3::ZERO
        } else {
            DVec3::new(0.3, -1.0, 0.0)
        }
    };
    let velocities = (0..2 * count).map(thrown).collect();
    let mut simulator = Simulator::with_state(&scene, positions, velocities).unwrap();
    let momentum = |simulator: &Simulator| -> DVec3 {
        let mass = simulator.vertex_mass().iter();
        mass.zip(simulator.velocities_f64())
            .map(|(m, v)| *v * *m)
            .sum()
    };
    let (before, energy) = (momentum(&simulator), simulator.kinetic_energy());
    run(&mut simulator, 30);
    let after = momentum(&simulator);
    let counts = simulator.contact_counts();

    assert!(counts.touching > 0 || counts.repeated > 0);
    assert!((after - before).length() < 1e-6 * before.length());
    assert!(simulator.kinetic_energy() < energy);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let mut scene = lying(46, |p| {
        DVec3::new(p.z, p.x + 0.55, 0.02 * (7.0 * p.x).sin())
    });
    scene.mesh = {
        let mesh = &scene.mesh;
        let coordinates = mesh.material_coordinates().to_vec();
        let faces = mesh.topology().face_indices();
        Mesh::new(&faces, coordinates, mesh.positions().to_vec()).unwrap()
    };
    scene.obstacles = vec![ground(0.0)];
    let run_with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mut simulator = Simulator::new(&scene).unwrap();
            simulator.set_threads(Threads::Pool);
            for _ in 0..8 {
                simulator.step(&none()).unwrap();
            }
            simulator.positions_f64().to_vec()
        })
    };
    let one = run_with(1);
    for threads in [2, 3, 8] {
        assert_eq!(run_with(threads), one, "{threads}");
    }
}

#[test]
fn what_cannot_be_is_said() {
    let mut scene = lying(8, |p| p);
    scene.obstacles = vec![ground(0.0)];
    let error = Simulator::new(&scene).err().unwrap();
    assert!(
        matches!(error, SimulatorError::Intersections { .. }),
        "{error}"
    );
    assert!(error.to_string().contains("obstacle \"ground\""), "{error}");
    let mut scene = lying(8, |p| p + DVec3::Y);
    scene.contact.as_mut().unwrap().thickness = 0.05;
    let error = Simulator::new(&scene).err().unwrap();
    assert!(matches!(error, SimulatorError::Thickness { .. }), "{error}");
}

/// A ground that lies still, and a lid that comes down on the sheet in between.
#[test]
fn planes_that_close_are_an_error_with_the_cloth_where_it_was() {
    let mut scene = lying(6, |p| p + DVec3::Y * 0.01);
    let lid = ground(0.0);
    let key = |time: f64, height: f64| RigidKey {
        time,
        rotation: DQuat::IDENTITY,
        translation: DVec3::Y * height,
    };
    let path = ObstaclePath::Rigid(vec![key(0.0, 0.1), key(0.2, -0.02)]);
    scene.obstacles = vec![ground(0.0), lid.moving(path).unwrap()];
    let mut simulator = Simulator::new(&scene).unwrap();
    let mut before = simulator.positions().to_vec();
    let error = loop {
        match simulator.step(&none()) {
            Ok(()) => before = simulator.positions().to_vec(),
            Err(error) => break error,
        }
        assert_eq!(simulator.intersection_count(), 0);
        assert!(simulator.frame() < 20);
    };
    assert!(matches!(error, StepError::Contact { .. }), "{error}");
    assert_eq!(simulator.positions(), before);
    assert!(simulator.frame() > 5, "{}", simulator.frame());
}

/// A ball that moves through a hanging sheet at 3 m/s pushes it aside.
#[test]
fn a_fast_ball_does_not_pass() {
    let mut scene = hanging(12);
    scene.contact = Some(ContactSettings::default());
    let key = |time: f64, x: f64| RigidKey {
        time,
        rotation: DQuat::from_rotation_y(3.0 * time),
        translation: DVec3::new(x, -0.5, 0.0),
    };
    let path = ObstaclePath::Rigid(vec![key(0.0, -0.3), key(0.2, 0.3)]);
    let ball = sphere(DVec3::ZERO, 0.15, 2).moving(path).unwrap();
    scene.obstacles = vec![ball];
    let mut simulator = Simulator::new(&scene).unwrap();
    let hold = HandleTargets::at_frame_end(scene.handles.select(scene.mesh.positions())).unwrap();
    for _ in 0..30 {
        simulator.step(&hold).unwrap();
        assert_eq!(
            simulator.intersection_count(),
            0,
            "frame {}",
            simulator.frame()
        );
    }
    let middle = simulator.positions()[12 * 6 + 6];
    assert!(middle.x > 0.2, "{middle}");
}

#[test]
fn contact_without_a_touch_changes_no_byte() {
    let apart = hanging(12);
    let mut together = apart.clone();
    together.contact = Some(ContactSettings::default());
    let mut runs = [apart, together].map(|scene| Simulator::new(&scene).unwrap());
    let hold = runs[0].handles().select(runs[0].positions_f64());
    for frame in 1..=20 {
        let aside = DVec3::X * 0.1 * (0.1 * f64::from(frame)).sin();
        let targets: Vec<DVec3> = hold.iter().map(|p| *p + aside).collect();
        for simulator in &mut runs {
            let targets = HandleTargets::at_frame_end(targets.clone()).unwrap();
            simulator.step(&targets).unwrap();
        }
        assert_eq!(runs[0].positions_f64(), runs[1].positions_f64());
    }
    assert!(runs[1].contact_counts().certified > 0);
}
