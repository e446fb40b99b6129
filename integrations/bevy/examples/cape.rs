//! A cape behind a character that walks, in a mesh, without a window: 600 frames of a game, then where it hangs.
//!
//! In a game `use bevy::prelude::*` stands for the lines of `bevy_…`, and `DefaultPlugins` for the plugins
//! of time and transforms and the meshes.

use std::time::Duration;

use bevy_app::{App, Update};
use bevy_asset::{Assets, RenderAssetUsages};
use bevy_ecs::prelude::*;
use bevy_mesh::{Mesh, Mesh3d, PrimitiveTopology};
use bevy_time::{Time, TimePlugin, TimeUpdateStrategy};
use bevy_transform::TransformPlugin;
use bevy_transform::components::Transform;
use selvedge::{Run, Scene};
use selvedge_bevy::{Cloth, ClothPlugin};

pub(crate) const CAPE: &str = include_str!("../../../web/npm/cape.toml");

#[derive(Component)]
pub(crate) struct Character;

/// A bone, by its number in the scene.
#[derive(Component)]
pub(crate) struct Bone(pub(crate) usize);

/// Joints at which torso, thighs and shins turn against the character.
const JOINTS: [[f32; 3]; 5] = [
    [0.0, 0.95, 0.0],
    [0.1, 0.9, 0.0],
    [-0.1, 0.9, 0.0],
    [0.1, 0.49, 0.0],
    [-0.1, 0.49, 0.0],
];

fn main() -> Result {
    let mut app = app();
    let cape = dress(app.world_mut(), CAPE)?;
    let step = TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0));
    app.insert_resource(step);
    (0..600).for_each(|_| app.update());
    let cloth = app.world().get::<Cloth>(cape).ok_or("no cape")?;
    let hem = cloth.run.positions().iter().map(|p| p.y);
    println!(
        "the hem is {:.2} m above the ground",
        hem.fold(f32::INFINITY, f32::min)
    );
    Ok(())
}

pub(crate) fn app() -> App {
    let mut app = App::new();
    app.add_plugins((TimePlugin, TransformPlugin, ClothPlugin))
        .init_resource::<Assets<Mesh>>()
        .add_systems(Update, walk);
    app
}

/// Spawns a character of an entity per bone, where the scene has its bodies, and its cape.
pub(crate) fn dress(world: &mut World, scene: &str) -> Result<Entity> {
    let body = world.spawn((Character, Transform::default())).id();
    let mut bone = |(number, joint): (usize, [f32; 3])| {
        let place = Transform::from_translation(joint.into());
        world.spawn((Bone(number), place, ChildOf(body))).id()
    };
    let bones: Vec<Entity> = JOINTS.into_iter().enumerate().map(&mut bone).collect();
    let run = Run::new(&Scene::parse(scene)?)?;
    let empty = Mesh::new(
        PrimitiveTopology::TriangleList,
        RenderAssetUsages::default(),
    );
    let mesh = Mesh3d(world.resource_mut::<Assets<Mesh>>().add(empty));
    Ok(world.spawn((Cloth::new(run, bones[0], &bones), mesh)).id())
}

/// Walks along a circle at 1.3 m/s, and leaps to its other side every 200 frames.
pub(crate) fn walk(
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
    for (&Bone(number), mut place) in &mut bones {
        let side = if number % 2 == 1 { 0.0 } else { std::f32::consts::PI };
        let lean = begun
            * match number {
                0 => 0.05 * swing(0.0),
                1 | 2 => 0.45 * swing(side),
                _ => 0.3 * (1.0 + swing(side + 1.0)),
            };
        *place = Transform::from_translation(JOINTS[number].into());
        place.rotate_x(lean);
        if number > 2 {
            // The knee goes with the thigh.
            let hip = begun * 0.45 * swing(side);
            place.translation.z -= 0.41 * hip.sin();
            place.translation.y += 0.41 * (1.0 - hip.cos());
        }
    }
}
