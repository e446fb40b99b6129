//! Drawn cloths: within their bounds, of every kind, the same each time, and fit for a scene.

use std::collections::BTreeSet;

use super::*;
use crate::{BendTable, Handles, PhysicsSettings, SagSettings, Scene, StretchTable};

type Spoil = fn(&mut ClothRanges);

fn ranges() -> ClothRanges {
    ClothRanges {
        shapes: vec![Shape::Square, Shape::Diamond, Shape::Random],
        vertices: [100, 400],
        size: [0.5, 1.5],
        stiffness: [0.1, 10.0],
        density: [0.5, 2.0],
        isotropic: 0.2,
        handles: [0, 17],
        released: 0.3,
        speed: 2.0,
        wind: 8.0,
        gusts: 2.0,
        duration: 4.0,
    }
}

fn fabric() -> Material {
    Material {
        name: "felt".into(),
        source: String::new(),
        density: 0.2,
        damping: 0.001,
        stretch: StretchTable([[30.0, 12.5, 44.0, 30.0]; 6]),
        bend: BendTable([[2e-5, 3e-5, 3e-5, 2.5e-5, 1e-5]; 3]),
        strain_limits: None,
    }
}

fn draw(number: u32) -> DrawnCloth {
    DrawnCloth::draw(&ranges(), &[fabric()], 7, number).unwrap()
}

fn scene(cloth: &DrawnCloth) -> Scene {
    let vertices = cloth.sheet.mesh.topology().vertex_count();
    Scene {
        name: "drawn".into(),
        mesh: cloth.sheet.mesh.clone(),
        handles: Handles::new(&cloth.handles, vertices).unwrap(),
        schedule: cloth.schedule.clone(),
        material: cloth.material.clone(),
        fabrics: Default::default(),
        environment: cloth.environment,
        motion: cloth.motion.clone(),
        physics: PhysicsSettings::default(),
        sag: SagSettings::default(),
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}

#[test]
fn the_same_numbers_draw_the_same_cloth_and_others_another() {
    assert_eq!(draw(3), draw(3));
    assert_ne!(draw(3).spec, draw(4).spec);
    let other = DrawnCloth::draw(&ranges(), &[fabric()], 8, 3).unwrap();
    assert_ne!(draw(3).spec, other.spec);
}

#[test]
fn every_drawn_cloth_is_a_scene_within_the_bounds() {
    let within = |value: f64, low: f64, high: f64| (low - 1e-9..=high + 1e-9).contains(&value);
    for number in 0..300 {
        let cloth = draw(number);
        scene(&cloth).validate().unwrap();
        let vertices = cloth.sheet.mesh.topology().vertex_count();
        assert_eq!(vertices, cloth.spec.vertices);
        assert!((100..=400).contains(&vertices));
        assert!(within(cloth.spec.size, 0.5, 1.5));
        assert!(cloth.handles.len() <= 17);
        assert!(within(cloth.environment.wind.length(), 0.0, 8.0));
        assert!(within(cloth.material.density, 0.1, 0.4));
        assert!(within(cloth.material.damping, 1e-4, 1e-2));
    }
}

#[test]
fn of_many_cloths_there_are_all_kinds() {
    let cloths: Vec<DrawnCloth> = (0..120).map(draw).collect();
    let share = |is: fn(&DrawnCloth) -> bool| {
        cloths.iter().filter(|cloth| is(cloth)).count() as f64 / cloths.len() as f64
    };
    // Twice the standard deviation of 120 draws is below 0.1.
    for (expected, is) in [
        (
            0.5,
            (|c| c.environment.wind != DVec3::ZERO) as fn(&DrawnCloth) -> bool,
        ),
        (0.25, |c| c.environment.gust.is_some()),
        (0.2, |c| c.material.name.ends_with("isotropic")),
        (0.5, |c| c.handles.len() <= 2),
        (0.25, |c| !c.schedule.is_empty()),
        (0.33, |c| c.spec.shape == Shape::Random),
        (0.42, |c| matches!(c.motion, Motion::Keyframes(_))),
    ] {
        let found = share(is);
        assert!((found - expected).abs() < 0.13, "{found}, not {expected}");
    }
    let counts: BTreeSet<usize> = cloths.iter().map(|cloth| cloth.handles.len()).collect();
    assert!(counts.contains(&0) && counts.contains(&1) && counts.len() > 8);
}

#[test]
fn handles_are_led_neither_too_fast_nor_too_far_apart() {
    let (mut fastest, mut nearest) = (0.0_f64, f64::MAX);
    for number in 0..120 {
        let cloth = draw(number);
        let scene = scene(&cloth);
        let path = scene.handle_path().unwrap();
        let start = scene.handles.select(scene.mesh.positions());
        let mut before = start.clone();
        for frame in 0..path.frame_count() {
            let targets = path.targets(frame, 1).unwrap();
            let now = targets.end();
            for (now, before) in now.iter().zip(&before) {
                fastest = fastest.max(now.distance(*before) * 60.0);
            }
            for a in 0..start.len() {
                for b in 0..a {
                    let ratio = now[a].distance(now[b]) / start[a].distance(start[b]);
                    assert!(ratio < 1.0 + 1e-6, "{number}: {ratio}");
                    nearest = nearest.min(ratio);
                }
            }
            before = now.to_vec();
        }
    }
    // Moves that a block adds to a turn have half the speed each.
    assert!(fastest < 2.0 * TRAINED_SPEED * 1.01, "{fastest}");
    assert!(fastest > TRAINED_SPEED, "{fastest}");
    assert!(nearest < 0.7, "{nearest}");
}

#[test]
fn an_isotropic_sheet_is_as_stiff_as_its_fabric() {
    let sheet = alike(&fabric(), 0.3);
    let [along, coupled, across, shear] = sheet.stretch_table().0[0];
    assert!((along - 37.0).abs() < 1e-9 && (across - 37.0).abs() < 1e-9);
    assert!((coupled / along - 0.3).abs() < 1e-12 && (shear / along - 0.7).abs() < 1e-12);
    let bend = sheet.bend_table().0[0][0];
    assert!((bend - 2.3e-5).abs() < 1e-12, "{bend}");
}

#[test]
fn wrong_bounds_are_named() {
    let wrong: [(&str, Spoil); 9] = [
        ("shapes", |r| r.shapes.clear()),
        ("vertices", |r| r.vertices = [400, 100]),
        ("handles", |r| r.handles = [0, 18]),
        ("size", |r| r.size = [0.0, 1.0]),
        ("stiffness", |r| r.stiffness = [1.0, f64::INFINITY]),
        ("released", |r| r.released = 1.5),
        ("speed", |r| r.speed = f64::NAN),
        ("wind", |r| r.wind = -1.0),
        ("duration", |r| r.duration = 0.0),
    ];
    for (field, spoil) in wrong {
        let mut ranges = ranges();
        spoil(&mut ranges);
        let error = DrawnCloth::draw(&ranges, &[fabric()], 1, 0).unwrap_err();
        let text = error.to_string();
        assert!(text.starts_with(&format!("{field} must be")), "{text}");
    }
    let error = DrawnCloth::draw(&ranges(), &[], 1, 0).unwrap_err();
    assert!(error.to_string().starts_with("materials must be"));
}
