//! The cape of `cape.rs` in a window, on a character of capsules: `cargo run --release --features window --example window`.
//!
//! With `-- FILE.png` it steps by 1/60 s a frame however long drawing takes, writes the 190th frame there and ends.

use std::time::Duration;

use bevy::camera::visibility::NoFrustumCulling;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use selvedge_bevy::ClothPlugin;

#[allow(dead_code, reason = "its main and its plugins are without a window")]
mod cape;

/// Middle, radius and length of the capsule of each bone, from its joint `[m]`.
const CAPSULES: [[f32; 3]; 5] = [
    [0.21, 0.14, 0.38],
    [-0.20, 0.08, 0.40],
    [-0.20, 0.08, 0.40],
    [-0.21, 0.06, 0.38],
    [-0.21, 0.06, 0.38],
];

/// The file of the picture, and the frame that is drawn.
#[derive(Resource)]
struct Picture(String, u32);

fn main() {
    let picture = std::env::args().nth(1);
    let render = RenderPlugin {
        // A picture is of all that is there.
        synchronous_pipeline_compilation: picture.is_some(),
        ..default()
    };
    let mut app = App::new();
    app.add_plugins((DefaultPlugins.set(render), ClothPlugin))
        .insert_resource(ClearColor(Color::srgb(0.92, 0.9, 0.87)))
        .add_systems(Startup, (dress, light))
        .add_systems(Update, (cape::walk, accompany).chain());
    if let Some(file) = picture {
        let step = TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0));
        app.insert_resource(step)
            .insert_resource(Picture(file, 190))
            .add_systems(Update, take);
    }
    app.run();
}

/// Draws nothing but the frames around that of the picture, which a driver without a graphics card takes seconds for.
fn take(
    mut frame: Local<u32>,
    picture: Res<Picture>,
    mut commands: Commands,
    mut camera: Single<&mut Camera>,
) {
    *frame += 1;
    camera.is_active = *frame + 5 > picture.1;
    if *frame == picture.1 {
        commands
            .spawn(Screenshot::primary_window())
            .observe(save_to_disk(picture.0.clone()))
            .observe(
                |_: On<ScreenshotCaptured>, mut exit: MessageWriter<AppExit>| {
                    exit.write(AppExit::Success);
                },
            );
    }
}

fn dress(world: &mut World) -> Result {
    let cape = cape::dress(world, cape::CAPE)?;
    let mut materials = world.resource_mut::<Assets<StandardMaterial>>();
    let red = materials.add(StandardMaterial {
        base_color: Color::srgb(0.55, 0.18, 0.22),
        perceptual_roughness: 0.9,
        double_sided: true,
        cull_mode: None,
        ..default()
    });
    let grey = materials.add(Color::srgb(0.62, 0.6, 0.57));
    // Its mesh changes in each frame, the box that Bevy culls by does not.
    world
        .entity_mut(cape)
        .insert((MeshMaterial3d(red), NoFrustumCulling));
    // What hangs on them is seen where they are.
    let mut parts = world.query_filtered::<Entity, Or<(With<cape::Character>, With<cape::Bone>)>>();
    for part in parts.iter(world).collect::<Vec<_>>() {
        world.entity_mut(part).insert(Visibility::default());
    }
    let mut bones = world.query::<(Entity, &cape::Bone)>();
    let bones: Vec<_> = bones
        .iter(world)
        .map(|(entity, bone)| (entity, bone.0))
        .collect();
    for (bone, number) in bones {
        let [middle, radius, length] = CAPSULES[number];
        let mut meshes = world.resource_mut::<Assets<Mesh>>();
        let mut parts = vec![(meshes.add(Capsule3d::new(radius, length)), middle)];
        if number == 0 {
            parts.push((meshes.add(Sphere::new(0.1)), 0.68));
        }
        for (mesh, height) in parts {
            let place = Transform::from_xyz(0.0, height, 0.0);
            world.spawn((
                Mesh3d(mesh),
                MeshMaterial3d(grey.clone()),
                place,
                ChildOf(bone),
            ));
        }
    }
    Ok(())
}

fn light(
    mut commands: Commands,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<StandardMaterial>>,
) {
    commands.spawn((
        Mesh3d(meshes.add(Plane3d::default().mesh().size(60.0, 60.0))),
        MeshMaterial3d(materials.add(Color::srgb(0.8, 0.77, 0.72))),
    ));
    commands.spawn((
        DirectionalLight {
            shadow_maps_enabled: true,
            ..default()
        },
        Transform::from_xyz(1.5, 4.0, 1.0).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    commands.spawn((
        Camera3d::default(),
        Tonemapping::AcesFitted,
        AmbientLight {
            brightness: 1500.0,
            ..default()
        },
    ));
}

/// The camera goes along behind the character.
fn accompany(
    character: Single<&Transform, With<cape::Character>>,
    mut camera: Single<&mut Transform, (With<Camera3d>, Without<cape::Character>)>,
) {
    let behind = character.rotation * Vec3::new(1.2, 1.7, -2.3);
    let at = character.translation;
    **camera = Transform::from_translation(at + behind).looking_at(at + Vec3::Y * 0.95, Vec3::Y);
}
