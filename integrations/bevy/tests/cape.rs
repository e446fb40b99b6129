//! A cape on a walking character, without a window: 600 frames, with hitches and leaps.
#![allow(clippy::unwrap_used, reason = "a test fails by it")]

use std::time::{Duration, Instant};

use bevy_app::App;
use bevy_asset::Assets;
use bevy_ecs::prelude::*;
use bevy_mesh::{Mesh, Mesh3d};
use bevy_time::TimeUpdateStrategy;
use cpu_time::ProcessTime;
use selvedge::glam::Vec3;
use selvedge_bevy::Cloth;

#[allow(dead_code, reason = "its main is the example's")]
#[path = "../examples/cape.rs"]
mod cape;

fn app(scene: &str) -> (App, Entity) {
    let mut app = cape::app();
    let cape = cape::dress(app.world_mut(), scene).unwrap();
    (app, cape)
}

#[test]
fn a_cape_on_a_walking_character_meets_nothing_in_600_frames() {
    let (mut app, cape) = app(cape::CAPE);
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
    let cloth = app.world().get::<Cloth>(cape).unwrap();
    let Mesh3d(handle) = app.world().get::<Mesh3d>(cape).unwrap();
    let mesh = app.world().resource::<Assets<Mesh>>().get(handle).unwrap();
    let drawn = mesh.attribute(Mesh::ATTRIBUTE_POSITION).unwrap();
    let expected: Vec<[f32; 3]> = cloth.run.positions().iter().map(|p| p.to_array()).collect();
    assert_eq!(drawn.as_float3().unwrap(), expected);
    assert_eq!(mesh.attribute(Mesh::ATTRIBUTE_NORMAL).unwrap().len(), 1000);
    let frames = cloth.run.frame();
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
    let strict = cape::CAPE.replace("start = ", "physics = { max_strain = 0.5 }\nstart = ");
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
