//! The shipped mannequin: closed, clear of itself, and on the ground in all that it does.

use std::collections::BTreeMap;

use glam::DVec3;
use selvedge_cloth::{Obstacle, Topology};
use selvedge_contact::{Candidates, Intersection, Surface};

use super::{Desk, at};
use crate::test_help::says;

const ANIMATIONS: [&str; 6] = [
    "stand",
    "turn",
    "walk",
    "raise-arms",
    "hold-arms-out",
    "wear",
];

fn doing(animation: &str) -> Obstacle {
    let text =
        format!("name = \"m\"\nmesh = \"mannequin\"\nmotion = {{ animation = \"{animation}\" }}");
    Desk::new().read(&text).unwrap()
}

/// Pairs of faces without a common point that meet.
fn crossings(points: &[DVec3], faces: &[[u32; 3]]) -> usize {
    let topology = Topology::new(points.len(), faces).unwrap();
    let surface = Surface::new(&topology, &[]);
    let met = Candidates::new(&surface, points, true).intersections(&surface, points);
    let is_apart = |pair: &&Intersection| {
        let [one, other] = pair.faces.map(|face| faces[face as usize]);
        !one.iter().any(|point| other.contains(point))
    };
    met.iter().filter(is_apart).count()
}

#[test]
fn it_is_closed_and_as_large_as_a_person() {
    let still = Desk::new()
        .read("name = \"m\"\nmesh = \"mannequin\"")
        .unwrap();
    let mut sides = BTreeMap::new();
    for face in still.faces() {
        for k in 0..3 {
            *sides.entry([face[k], face[(k + 1) % 3]]).or_insert(0) += 1;
        }
    }
    assert!(
        sides
            .iter()
            .all(|([a, b], n)| *n == 1 && sides.contains_key(&[*b, *a]))
    );
    // One piece without a hole.
    assert_eq!(
        still.point_count() + still.faces().len(),
        sides.len() / 2 + 2
    );
    let points = at(&still, 0.0);
    let of = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|p| points[p as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    let volume: f64 = still.faces().iter().map(of).sum();
    assert!((0.04..0.09).contains(&volume), "{volume} m³");
    let tallest = points.iter().map(|p| p.y).fold(0.0, f64::max);
    assert!((1.65..1.80).contains(&tallest), "{tallest}");
}

#[test]
fn it_stands_on_the_ground_and_is_clear_of_itself_in_all_that_it_does() {
    for animation in ANIMATIONS {
        let moving = doing(animation);
        for k in 0..=20 {
            let time = 16.0 * f64::from(k) / 60.0;
            let points = at(&moving, time);
            let lowest = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
            // Single precision, once in the key and once in each point.
            assert!(lowest.abs() < 1e-6, "{animation} at {time}: {lowest}");
            let found = crossings(&points, moving.faces());
            assert_eq!(found, 0, "{animation} at {time} s");
        }
    }
}

#[test]
fn it_begins_and_ends_in_one_stance_and_moves_between() {
    let stance = at(&doing("stand"), 0.0);
    for (animation, farthest) in [("turn", 0.5), ("walk", 0.1), ("raise-arms", 0.5)] {
        let moving = doing(animation);
        for time in [0.0, 9.0] {
            let points = at(&moving, time);
            let apart = points.iter().zip(&stance).map(|(a, b)| a.distance(*b));
            assert!(apart.fold(0.0, f64::max) < 1e-5, "{animation} at {time}");
        }
        let apart = at(&moving, 2.25);
        let most = apart.iter().zip(&stance).map(|(a, b)| a.distance(*b));
        assert!(most.fold(0.0, f64::max) > farthest, "{animation}");
    }
    let problem =
        Desk::new().problem("name = \"m\"\nmesh = \"mannequin\"\nmotion = { animation = \"fly\" }");
    says(&problem, &["no animation called \"fly\"; there are [stand"]);
    let problem = Desk::new().problem("name = \"m\"\nmesh = \"mannequin\"\nmotion = \"mannequin\"");
    says(&problem, &["several animations: choose one by `animation`"]);
}
