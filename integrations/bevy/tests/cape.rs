//! A cape on a walking character, without a window: 600 frames, with hitches and leaps.
#![allow(clippy::unwrap_used, reason = "a test fails by it")]

use std::time::{Duration, Instant};

use bevy_app::{App, Update};
use bevy_ecs::prelude::*;
use bevy_time::{Time, TimePlugin, TimeUpdateStrategy};
use bevy_transform::TransformPlugin;
use bevy_transform::components::Transform;
use cpu_time::ProcessTime;
use selvedge::glam::Vec3;
use selvedge::{Run, Scene};
use selvedge_bevy::{Cloth, ClothPlugin};

/// A bone, by its number in the scene, and the joint at which it turns against the character.
#[derive(Component)]
struct Bone {
    number: usize,
    joint: [f32; 3],
}

#[derive(Component)]
struct Character;

const JOINTS: [[f32; 3]; 5] = [
    [0.0, 0.95, 0.0],
    [0.1, 0.9, 0.0],
    [-0.1, 0.9, 0.0],
    [0.1, 0.49, 0.0],
    [-0.1, 0.49, 0.0],
];

/// Walks along a circle at 1.3 m/s, and leaps to its other side every 200 frames.
fn walk(
    time: Res<Time>,
    mut character: Query<&mut Transform, With<Character>>,
    mut bones: Query<(&Bone, &mut Transform), Without<Character>>,
) {
    let now = time.elapsed_secs();
    // At first all stand as the scene has them.
    if now == 0.0 {
        return;
    }
    let angle = 0.65 * now + if (now / 3.3) as u32 % 2 == 1 { 3.0 } else { 0.0 };
    for mut place in &mut character {
        *place = Transform::from_xyz(2.0 * angle.sin(), 0.0, 2.0 * angle.cos());
        place.rotate_y(angle + std::f32::consts::FRAC_PI_2);
    }
    let swing = |phase: f32| (5.5 * now + phase).sin();
    let begun = (now / 0.5).min(1.0);
    for (bone, mut place) in &mut bones {
        let side = if bone.number % 2 == 1 { 0.0 } else { std::f32::consts::PI };
        let lean = begun
            * match bone.number {
                0 => 0.05 * swing(0.0),
                1 | 2 => 0.45 * swing(side),
                _ => 0.3 * (1.0 + swing(side + 1.0)),
            };
        *place = Transform::from_translation(bone.joint.into());
        place.rotate_x(lean);
        if bone.number > 2 {
            // The knee goes with the thigh.
            let hip = begun * 0.45 * swing(side);
            place.translation.z -= 0.41 * hip.sin();
            place.translation.y += 0.41 * (1.0 - hip.cos());
        }
    }
}

const CAPE: &str = include_str!("../../../web/npm/cape.toml");

fn app(scene: &str) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((TimePlugin, TransformPlugin, ClothPlugin));
    #[cfg(feature = "mesh")]
    app.init_resource::<bevy_asset::Assets<bevy_mesh::Mesh>>();
    app.add_systems(Update, walk);
    let world = app.world_mut();
    let body = world.spawn((Character, Transform::default())).id();
    let bones: Vec<Entity> = (0..5)
        .map(|number| {
            world
                .spawn((
                    Bone {
                        number,
                        joint: JOINTS[number],
                    },
                    Transform::from_translation(JOINTS[number].into()),
                    ChildOf(body),
                ))
                .id()
        })
        .collect();
    let run = Run::new(&Scene::parse(scene).unwrap()).unwrap();
    let cape = world.spawn(Cloth::new(run, bones[0], &bones)).id();
    (app, cape)
}

#[test]
fn a_cape_on_a_walking_character_meets_nothing_in_600_frames() {
    let (mut app, cape) = app(CAPE);
    let mut times = Vec::new();
    for frame in 0..600 {
        // Hitches: a tenth of a second every hundred frames, and a second once.
        let seconds = match frame {
            0 => 0.0,
            350 => 1.0,
            _ if frame % 100 == 50 => 0.1,
            _ => 1.0 / 60.0,
        };
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(
            seconds,
        )));
        let began = (Instant::now(), ProcessTime::now());
        app.update();
        if seconds < 0.02 {
            times.push([began.0.elapsed(), began.1.elapsed()]);
        }
        let cloth = app.world().get::<Cloth>(cape).unwrap();
        assert!(
            cloth.problem.is_none(),
            "frame {frame}: {:?}",
            cloth.problem
        );
        assert_eq!(
            cloth.run.solver().unwrap().intersection_count(),
            0,
            "frame {frame}"
        );
        assert!(
            cloth.run.frame_warnings().is_empty(),
            "{:?}",
            cloth.run.frame_warnings()
        );
    }
    let frames = app.world().get::<Cloth>(cape).unwrap().run.frame();
    assert!((600..640).contains(&frames), "{frames}");
    for (k, of) in ["time", "processor time"].iter().enumerate() {
        let worst = times.iter().map(|one| one[k]).max().unwrap();
        let mean = times.iter().map(|one| one[k]).sum::<Duration>() / times.len() as u32;
        println!("{frames} frames of the cape: {of} at most {worst:.1?}, mean {mean:.1?}");
    }
}

#[test]
fn what_cannot_be_moved_begins_anew_and_is_said() {
    // A cape that is refused where it would only be warned of.
    let strict = CAPE.replace("start = ", "physics = { max_strain = 0.5 }\nstart = ");
    let (mut app, cape) = app(&strict.replace("vertices = 1000", "vertices = 150"));
    let step = |app: &mut App| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(
            1.0 / 60.0,
        )));
        app.update();
    };
    (0..10).for_each(|_| step(&mut app));
    // With a bound of speed that is none, a leap tears it.
    app.world_mut().get_mut::<Cloth>(cape).unwrap().fastest = f64::INFINITY;
    (0..220).for_each(|_| step(&mut app));
    let cloth = app.world().get::<Cloth>(cape).unwrap();
    assert!(cloth.problem.is_some());
    assert_eq!(cloth.run.solver().unwrap().intersection_count(), 0);
    // It goes on, and where the character is: on its circle of 2 m.
    let far = |p: &Vec3| (p.x.hypot(p.z) - 2.0).abs();
    let farthest = cloth.run.positions().iter().map(far).fold(0.0, f32::max);
    assert!(farthest < 1.2, "{farthest}");
}
