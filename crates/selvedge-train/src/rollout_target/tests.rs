//! What is left of an offset: closed forms of both rules, and what is taken for smooth.

use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::{Sheet, SquareSpec, square};
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles};
use selvedge_data::SectionRule;
use selvedge_model::Encoder;

use super::*;
use crate::test_data::{config, swinging};

#[test]
fn a_swinging_offset_is_a_damped_oscillation() {
    let (damping, stiffness, kept) = (0.1, 0.02, 0.8);
    let (e, u, w) = (
        DVec3::new(0.01, -0.02, 0.0),
        DVec3::X * 1e-3,
        DVec3::Y * 0.005,
    );
    let mut target = RolloutTarget {
        rule: Rule::Swinging {
            damping,
            stiffness,
            kept,
            smooth: vec![e],
            velocity: vec![u],
            wrinkles: vec![w],
        },
        now: vec![e + w],
    };
    // e(k+1) = (2 - d - s) e(k) - (1 - d) e(k-1): r^k (a cos kθ + b sin kθ).
    let radius = f64::sqrt(1.0 - damping);
    let angle = ((2.0 - damping - stiffness) / (2.0 * radius)).acos();
    let before = e - u;
    let b = (e * angle.cos() - radius * before) / angle.sin();
    for k in 1..=100 {
        let turn = f64::from(k) * angle;
        let swing = radius.powi(k) * (e * turn.cos() + b * turn.sin());
        let expected = swing + kept.powi(k) * w;
        assert!(target.next_offset()[0].distance(expected) < 1e-14, "{k}");
    }
}

#[test]
fn a_decaying_offset_keeps_its_part_of_what_is_smooth() {
    let start = vec![DVec3::new(0.01, 0.0, -0.03)];
    let mut target = RolloutTarget {
        now: start.clone(),
        rule: Rule::Decaying {
            start: start.clone(),
            kept: 0.9,
            frames: 0,
        },
    };
    for k in 1..=20 {
        assert!(target.next_offset()[0].distance(0.9_f64.powi(k) * start[0]) < 1e-17);
    }
}

/// A slot in the middle of a run that is `now` off the truth, and was `before` a frame earlier.
#[test]
fn an_offset_and_its_velocity_are_seen_from_the_truth() {
    let data = swinging(&[("a", 12, 20)], SectionRule::Whole);
    let mut cfg = config(Encoder::MLP);
    let set = TrainingSet::load(&data.dataset).expect("a set");
    let (_, section) = set.sample(0);
    let motion = set.motion(section.trajectory);
    let (now, before) = (Vec3::new(0.01, 0.0, 0.02), Vec3::new(0.004, 0.0, 0.0));
    let shifted = |frame: i64, by: Vec3| {
        let frame = motion.frame(frame).iter();
        Arc::new(frame.map(|p| *p + by).collect::<Vec<Vec3>>())
    };
    let mut slot = Slot::new();
    slot.section = *section;
    slot.current = 6;
    slot.run = 3;
    slot.history = vec![shifted(5, before), shifted(6, now)];
    assert_eq!(slot.history.len(), cfg.model.history());
    let yaw = Yaw::from_angle(0.7);
    let is_close = |found: &[DVec3], expected: Vec3| {
        let expected = yaw.to_local_f64(expected.as_dvec3());
        // Sums of f32 positions of about a metre.
        found.iter().all(|e| e.distance(expected) < 3e-7)
    };
    assert!(is_close(&slot.offset(&set, yaw), now));
    assert!(is_close(&slot.offset_velocity(&set, yaw), now - before));
    // Wrinkles and what is smooth are all of it.
    cfg.scheduled_sampling.offset = OffsetRule::Swinging {
        damping: 0.0,
        stiffness: 0.0,
        wrinkles: 0.0,
    };
    let mut target = RolloutTarget::of_slot(&cfg, &set, &slot, yaw);
    let Rule::Swinging { velocity, .. } = &target.rule else {
        unreachable!("it swings")
    };
    let moved: Vec<DVec3> = velocity.clone();
    let next = target.next_offset();
    for ((e, u), offset) in next.iter().zip(moved).zip(slot.offset(&set, yaw)) {
        assert!(e.distance(offset + u) < 1e-15);
    }
    // What is shown from the truth has no velocity, whatever its noise.
    slot.run = 0;
    assert!(
        slot.offset_velocity(&set, yaw)
            .iter()
            .all(|u| *u == DVec3::ZERO)
    );
}

#[test]
fn smoothing_takes_wrinkles_and_leaves_a_swing() {
    let mesh = square(&SquareSpec {
        vertices: 289,
        size: 1.0,
        seed: 1,
    });
    let sheet = mesh.expect("a square");
    let graph = cloth(&sheet);
    let height = |v: usize| sheet.mesh.positions()[v].y;
    let root = |offset: &[DVec3]| {
        let squares: f64 = offset.iter().map(|e| e.length_squared()).sum();
        (squares / offset.len() as f64).sqrt()
    };
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let mut wrinkles: Vec<DVec3> = (0..289)
        .map(|_| DVec3::splat(2.0 * rng.random::<f64>() - 1.0))
        .collect();
    let before = root(&wrinkles);
    smoothen(&graph, &mut wrinkles);
    // Each vertex ends as a mean over about π/4 · 16 · 2 · 7 neighbours: white noise falls to a
    // tenth or so of itself.
    assert!(root(&wrinkles) < 0.15 * before, "{}", root(&wrinkles));
    // Aside in proportion to how far below the handles.
    let swing: Vec<DVec3> = (0..289).map(|v| DVec3::X * -height(v)).collect();
    let mut kept = swing.clone();
    smoothen(&graph, &mut kept);
    let change: Vec<DVec3> = kept.iter().zip(&swing).map(|(a, b)| *a - *b).collect();
    assert!(root(&change) < 0.15 * root(&swing), "{}", root(&change));
    for v in graph.handles().vertices() {
        assert_eq!(kept[v.index()], DVec3::ZERO);
    }
}

fn cloth(sheet: &Sheet) -> ClothGraph {
    let rest = sheet.mesh.rest_shape(0.15);
    let positions: Vec<Vec3> = sheet.mesh.positions().iter().map(|p| p.as_vec3()).collect();
    let corners = Handles::new(&sheet.labels["upper-corners"], positions.len()).expect("corners");
    let arrays = ClothArrays {
        vertex_mass: rest.vertex_mass.iter().map(|&m| m as f32).collect(),
        face_area: rest.face_area.iter().map(|&a| a as f32).collect(),
        material_coordinates: vec![Vec2::ZERO; positions.len()],
        rest_positions: positions,
    };
    let cloth = Cloth::new(sheet.mesh.topology().clone(), corners, arrays).expect("a cloth");
    ClothGraph::new(&cloth, Environment::default(), 60.0).expect("a graph")
}
