//! Bodies that feel: what they weigh, push and carry is what mechanics has it to be.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "tests, and their figures"
)]

use rapier3d_f64::prelude::*;
use selvedge::glam::{DVec2, DVec3};
use selvedge::{HandleTargets, Run};
use selvedge_cloth::{
    Compression, ContactSettings, Handles, LinearSolver, Material, Mesh, Obstacle, Scene, Stepper,
    bodies,
};
use selvedge_rapier::World;

const GRAVITY: f64 = 9.81;
/// Frames per second for what lies on cloth upon a floor, with one step of the cloth each.
const SHORT: f64 = 1920.0;

/// `layers` sheets of `squares`² squares of side `spacing` `[m]` that lie at these heights, their middle
/// at the origin, held at vertices that `is_held` by their places.
fn lying(squares: usize, spacing: f64, heights: &[f64], is_held: impl Fn(DVec3) -> bool) -> Scene {
    let (mut faces, mut flat, mut places) = (vec![], vec![], vec![]);
    let side = squares as u32 + 1;
    for (layer, height) in (0..).zip(heights) {
        let first: u32 = layer * side * side;
        let half = 0.5 * spacing * squares as f64;
        for k in 0..side * side {
            let at = DVec2::new(f64::from(k % side), f64::from(k / side)) * spacing;
            flat.push(at);
            places.push(DVec3::new(at.x - half, *height, half - at.y));
        }
        for k in 0..(squares * squares) as u32 {
            let a = first + k / (side - 1) * side + k % (side - 1);
            let [b, c, d] = [a + 1, a + side + 1, a + side];
            match (k / (side - 1) + k % (side - 1)) % 2 {
                0 => faces.extend([[a, b, c], [a, c, d]]),
                _ => faces.extend([[a, b, d], [b, c, d]]),
            }
        }
    }
    let held: Vec<u32> = (0..places.len() as u32)
        .filter(|v| is_held(places[*v as usize]))
        .collect();
    let handles = Handles::new(&held, places.len()).unwrap();
    let material: Material = toml::from_str(selvedge_assets::MATERIALS[0].1).unwrap();
    let mesh = Mesh::new(&faces, flat, places).unwrap();
    let mut scene = Scene::of("bodies", mesh, handles, material);
    scene.environment.gravity = DVec3::Y * -GRAVITY;
    scene.environment.air_density = 0.0;
    scene.contact = Some(ContactSettings::default());
    scene
}

fn obstacle(name: &str, body: bodies::Body, at: DVec3) -> Obstacle {
    let points = body.points.iter().map(|p| *p + at).collect();
    Obstacle::new(name, points, body.faces).unwrap()
}

fn floor() -> Obstacle {
    obstacle("floor", bodies::plane([4.0; 2]), DVec3::ZERO)
}

fn world(gravity: f64) -> PhysicsWorld {
    PhysicsWorld {
        gravity: Vector::Y * -gravity,
        ..PhysicsWorld::default()
    }
}

/// A body of this shape and `mass` `[kg]` in `world` at `place`.
fn dynamic(
    world: &mut PhysicsWorld,
    shape: ColliderBuilder,
    mass: f64,
    place: DVec3,
) -> RigidBodyHandle {
    let [x, y, z] = place.to_array();
    let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, y, z));
    world.insert(body.can_sleep(false), shape.mass(mass)).0
}

/// Starts where the scene's mesh is.
fn run_of(scene: Scene) -> Run {
    let places = scene.mesh.positions().to_vec();
    Run::new(&selvedge::Scene::at(scene, places)).unwrap()
}

fn place(world: &World, body: RigidBodyHandle) -> DVec3 {
    DVec3::from_array(world.rapier.bodies[body].translation().to_array())
}

fn speed(world: &World, body: RigidBodyHandle) -> DVec3 {
    DVec3::from_array(world.rapier.bodies[body].linvel().to_array())
}

fn hold(run: &Run) -> HandleTargets {
    HandleTargets::at_frame_end(run.handle_places()).unwrap()
}

#[test]
fn cloth_and_ball_together_keep_their_momentum() {
    for (substeps, rate, most_steps) in [(1, 60.0, 12), (4, 60.0, 12), (1, SHORT, 1)] {
        let mut scene = lying(12, 0.05, &[0.0], |_| false);
        scene.frame_rate = rate;
        scene.environment.gravity = DVec3::ZERO;
        scene.physics.solver = LinearSolver::Cholesky;
        scene.physics.substeps = substeps;
        let at = DVec3::new(0.04, 0.12, 0.02);
        scene.obstacles = vec![obstacle("ball", bodies::sphere(0.1, 0.03), at)];
        let mut rapier = world(0.0);
        let ball = dynamic(&mut rapier, ColliderBuilder::ball(0.1), 0.1, at);
        rapier.bodies[ball].set_linvel(Vector::new(0.3, -2.0, 0.1), true);
        let mut world = World::new(run_of(scene), rapier, &[(0, ball)]);
        world.most_steps = most_steps;
        let momentum = |world: &World| -> DVec3 {
            let solver = world.run.solver().unwrap();
            let cloth = solver.vertex_mass().iter().zip(solver.velocities_f64());
            cloth.map(|(m, v)| *m * *v).sum::<DVec3>() + speed(world, ball) * 0.1
        };
        let start = momentum(&world);
        let begin = speed(&world, ball);
        let (mut steps, frames) = (0, rate as usize);
        for _ in 0..frames {
            world.step().unwrap();
            steps += world.steps();
        }
        let lost = (momentum(&world) - start).length() / start.length();
        let slowed = (speed(&world, ball) - begin).length() / begin.length();
        println!("{substeps}: lost {lost:.1e}, slowed by {slowed:.2}, {steps} steps of {frames}");
        assert!(slowed > 0.1, "{slowed}");
        assert!(lost < 1e-9, "{lost}");
    }
}

#[test]
fn a_sheet_at_rest_on_a_box_weighs_what_it_weighs() {
    let mut scene = lying(10, 0.02, &[9e-4], |_| false);
    let size = DVec3::new(0.5, 0.1, 0.5);
    scene.obstacles = vec![obstacle("box", bodies::cuboid(size), DVec3::Y * -0.05)];
    for substeps in [1, 4] {
        scene.physics.substeps = substeps;
        let mut run = run_of(scene.clone());
        for _ in 0..120 {
            run.step().unwrap();
        }
        let weight = GRAVITY * run.solver().unwrap().vertex_mass().iter().sum::<f64>();
        let force = 60.0 * -run.impulses()[0].linear.y;
        println!("{substeps}: {force} N, weight {weight} N");
        assert!((force / weight - 1.0).abs() < 0.01, "{force} {weight}");
        assert!(run.impulses()[0].angular.length() < 1e-4 * weight);
    }
}

#[test]
fn a_ball_bounces_on_a_trampoline_and_comes_to_rest_where_the_cloth_bears_it() {
    let edge = |p: DVec3| p.x.abs().max(p.z.abs()) > 0.39;
    let mut scene = lying(16, 0.05, &[0.0], edge);
    let at = DVec3::Y * 0.5;
    scene.obstacles = vec![obstacle("ball", bodies::sphere(0.1, 0.03), at)];
    let mut rapier = world(GRAVITY);
    let ball = dynamic(&mut rapier, ColliderBuilder::ball(0.1), 0.3, at);
    let mut world = World::new(run_of(scene), rapier, &[(0, ball)]);
    let targets = hold(&world.run);
    let (mut lowest, mut again, mut steps) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for _ in 0..360 {
        world.step_to(&targets).unwrap();
        steps += world.steps();
        let height = place(&world, ball).y;
        match speed(&world, ball).y < 0.0 && again == f64::NEG_INFINITY {
            true => lowest = lowest.min(height),
            false => again = again.max(height),
        }
    }
    let solver = world.run.solver().unwrap();
    assert_eq!(solver.intersection_count(), 0);
    let (height, speed) = (place(&world, ball).y, speed(&world, ball).length());
    let force = 60.0 * world.run.impulses()[0].linear.y;
    println!(
        "lowest {lowest:.3}, again {again:.3}, rests at {height:.3} m, {speed:.1e} m/s, {force:.3} N of {:.3}, {steps} steps of 360",
        0.3 * GRAVITY
    );
    assert!(again > lowest + 0.05, "{lowest} {again}");
    assert!((force / (0.3 * GRAVITY) - 1.0).abs() < 0.05, "{force}");
}

/// A board of this `mass` `[kg]` on so many layers, after two seconds: its height over what the curve of
/// the fabric has at the load of each layer, and how far it moved in the last 0.2 s `[m]`. In shorter
/// frames the barrier, whose push is mass over the square of a step, bears a part.
fn pressed(layers: u32, mass: f64) -> (f64, f64) {
    let rate = 480.0;
    // Nine by nine vertices of each layer below it, each with its own square.
    let spacing = 0.02;
    let side = 9.0 * spacing;
    let heights: Vec<f64> = (1..=layers).map(|k| f64::from(k) * 9e-4).collect();
    let mut scene = lying(12, spacing, &heights, |_| false);
    scene.physics.substeps = 1;
    scene.frame_rate = rate;
    let density = scene.material.density;
    let size = DVec3::new(side, 0.03, side);
    let at = DVec3::Y * (f64::from(layers + 1) * 9e-4 + 0.5 * size.y);
    scene.obstacles = vec![floor(), obstacle("board", bodies::cuboid(size), at)];
    let mut rapier = world(GRAVITY);
    let shape = ColliderBuilder::cuboid(0.5 * size.x, 0.5 * size.y, 0.5 * size.z);
    let board = dynamic(&mut rapier, shape, mass, at);
    let mut world = World::new(run_of(scene), rapier, &[(1, board)]);
    world.most_steps = 1;
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for frame in 0..2 * rate as u32 {
        world.step().unwrap();
        if f64::from(frame) > 1.8 * rate {
            low = low.min(place(&world, board).y);
            high = high.max(place(&world, board).y);
        }
    }
    let found = place(&world, board).y - 0.5 * size.y;
    let own = mass / (side * side);
    let gaps = (0..=layers).map(|above| {
        let load = GRAVITY * (own + f64::from(above) * density);
        1e-3 * Compression::default().gap(load)
    });
    let expected: f64 = gaps.sum();
    println!(
        "{layers} layers, {rate} frames per second: {:.0} Pa, {:.3} mm of {:.3}, moves by {:.1e} m",
        own * GRAVITY,
        found * 1e3,
        expected * 1e3,
        high - low
    );
    assert_eq!(world.run.solver().unwrap().intersection_count(), 0);
    (found / expected, high - low)
}

#[test]
fn a_book_on_a_towel_sinks_by_the_curve_and_lies_still() {
    let (height, moved) = pressed(4, 1.0);
    assert!(
        (height - 1.0).abs() < 0.05 && moved < 1e-5,
        "{height} {moved}"
    );
}

#[test]
fn ten_layers_under_a_board_stand_as_the_curve_has_each_at_its_load() {
    let (height, moved) = pressed(10, 0.2);
    assert!(
        (height - 1.0).abs() < 0.05 && moved < 1e-4,
        "{height} {moved}"
    );
}

#[test]
fn a_swinging_bar_pushes_a_curtain_and_is_slowed() {
    let swing = |curtain: bool| {
        let mut scene = lying(12, 0.05, &[0.0], |p| p.z > 0.29);
        // Hangs in the plane x = 0.
        let hung = scene.mesh.positions().iter();
        let hung = hung.map(|p| DVec3::new(0.0, p.z - 0.3, p.x));
        scene.mesh = scene.mesh.clone().with_positions(hung.collect()).unwrap();
        let aside = if curtain { 0.0 } else { 5.0 };
        let at = DVec3::new(0.25, -0.3, aside);
        let size = DVec3::new(0.03, 0.03, 0.3);
        scene.obstacles = vec![obstacle("bar", bodies::cuboid(size), at)];
        let mut rapier = world(GRAVITY);
        let shape = ColliderBuilder::cuboid(0.015, 0.015, 0.15);
        let bar = dynamic(&mut rapier, shape, 0.2, at);
        // A pendulum of 0.35 m about an axis along z.
        let (pivot, _) = rapier.insert(
            RigidBodyBuilder::fixed().translation(Vector::new(0.0, 0.0, aside)),
            ColliderBuilder::ball(0.001).sensor(true),
        );
        let arm = Vector::new(-at.x, -at.y, 0.0);
        let joint = RevoluteJointBuilder::new(Vector::Z).local_anchor2(arm);
        rapier.impulse_joints.insert(pivot, bar, joint, true);
        let mut world = World::new(run_of(scene), rapier, &[(0, bar)]);
        let targets = hold(&world.run);
        let (mut most, mut pushed) = (f64::INFINITY, 0.0_f64);
        for _ in 0..60 {
            world.step_to(&targets).unwrap();
            most = most.min(place(&world, bar).x);
            let all = world.run.positions().iter();
            pushed = all.fold(pushed, |most, p| most.min(f64::from(p.x)));
        }
        assert_eq!(world.run.solver().unwrap().intersection_count(), 0);
        (most, pushed)
    };
    let (free, still) = swing(false);
    let (slowed, pushed) = swing(true);
    println!("the bar goes to {free:.3} m, with the curtain to {slowed:.3}, that to {pushed:.3}");
    assert!(free < -0.2 && still > -0.01, "{free} {still}");
    assert!(pushed < -0.05 && slowed > free + 0.02, "{pushed} {slowed}");
}

/// Ways of two plates in m, of which a table-cloth is pulled away, at so many frames per second.
fn pulled_from_under_plates(rate: f64) -> [f64; 2] {
    let mut scene = lying(16, 0.04, &[9e-4], |p| p.x > 0.31);
    scene.frame_rate = rate;
    scene.material = toml::from_str(selvedge_assets::MATERIALS[2].1).unwrap();
    scene.contact = Some(ContactSettings {
        friction: 0.2,
        ..ContactSettings::default()
    });
    let places = [DVec3::new(-0.15, 0.0, 0.12), DVec3::new(-0.12, 0.0, -0.13)];
    let size = DVec3::new(0.12, 0.02, 0.12);
    let mut rapier = world(GRAVITY);
    rapier.insert(
        RigidBodyBuilder::fixed().translation(Vector::new(0.0, -0.05, 0.0)),
        ColliderBuilder::cuboid(2.0, 0.05, 2.0).friction(0.5),
    );
    scene.obstacles = vec![floor()];
    let mut plates = Vec::new();
    for (number, at) in (1..).zip(places) {
        let at = at + DVec3::Y * (1.8e-3 + 0.5 * size.y);
        let shape = ColliderBuilder::cuboid(0.06, 0.01, 0.06).friction(0.5);
        plates.push((number, dynamic(&mut rapier, shape, 0.4, at)));
        let name = format!("plate {number}");
        scene
            .obstacles
            .push(obstacle(&name, bodies::cuboid(size), at));
    }
    let mut world = World::new(run_of(scene), rapier, &plates);
    world.most_steps = 1;
    let held = world.run.handle_places();
    let (pull, mut way) = (15.0, 0.0);
    // What each was pushed up at rest, and along and up while it slides.
    let [mut rest, mut along, mut up, mut ways] = [[0.0; 2]; 4];
    for frame in 0..(0.55 * rate) as u32 {
        // Still for a moment, then faster and faster.
        let time = (f64::from(frame) / rate - 0.1).max(0.0);
        way = 0.5 * pull * time * time;
        let targets = held.iter().map(|p| *p + DVec3::X * way).collect();
        world
            .step_to(&HandleTargets::at_frame_end(targets).unwrap())
            .unwrap();
        for (k, (number, plate)) in plates.iter().enumerate() {
            let got = world.run.impulses()[*number].linear;
            if time == 0.0 && f64::from(frame) > 0.05 * rate {
                rest[k] += got.y;
            }
            if speed(&world, *plate).x > 0.05 {
                along[k] += got.x;
                up[k] += got.y;
            }
        }
    }
    for (k, ((_, plate), at)) in plates.iter().zip(places).enumerate() {
        let gone = place(&world, *plate) - at;
        // Friction takes it along until the cloth's end has passed it, and that of the floor stops it. A
        // cloth that stretches slides later and leaves sooner.
        let [drag, back] = [0.2 * GRAVITY, 0.5 * GRAVITY];
        let free = 2.0 * (at.x + 0.06 + 0.32) / (pull - drag);
        let most = 0.5 * drag * free * (1.0 + drag / back);
        let [weight, friction] = [rest[k] / (0.05 * 0.4 * GRAVITY), along[k] / up[k]];
        println!(
            "the cloth goes {way:.2} m, a plate {:.3} m of {most:.3}, it weighs {weight:.3} of its weight, friction {friction:.3}",
            gone.x
        );
        ways[k] = gone.x;
        assert!((0.4 * most..1.1 * most).contains(&gone.x), "{gone} {most}");
        assert!(gone.y.abs() < 0.03 && gone.z.abs() < 0.01, "{gone}");
        assert!((weight - 1.0).abs() < 0.1, "{weight}");
        assert!((friction / 0.2 - 1.0).abs() < 0.1, "{friction}");
    }
    let last = world
        .run
        .positions()
        .iter()
        .map(|p| p.x)
        .fold(f32::INFINITY, f32::min);
    assert!(last > 0.1, "{last}");
    ways
}

#[test]
fn a_table_cloth_is_pulled_from_under_plates_that_stay() {
    let [coarse, fine] = [0.5 * SHORT, SHORT].map(pulled_from_under_plates);
    for (coarse, fine) in coarse.iter().zip(fine) {
        assert!((coarse - fine).abs() < 3e-3, "{coarse} {fine}");
    }
}
