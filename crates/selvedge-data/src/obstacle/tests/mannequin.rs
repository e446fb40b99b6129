//! The shipped mannequin: clear of itself, and on the ground in all that it does.

use glam::DVec3;
use selvedge_cloth::{Obstacle, Topology};
use selvedge_contact::{Candidates, CollisionMesh, Intersection};

use super::{TestFolder, at};
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
    TestFolder::new().read(&text).unwrap()
}

/// Pairs of faces without a common point that meet.
fn crossings(surface: &CollisionMesh, points: &[DVec3]) -> usize {
    let met = Candidates::new(surface, points, true).intersections(surface, points);
    let is_apart = |pair: &&Intersection| {
        let [one, other] = pair.faces.map(|face| surface.faces()[face as usize]);
        !one.iter().any(|point| other.contains(point))
    };
    met.iter().filter(is_apart).count()
}

#[test]
fn it_stands_on_the_ground_and_is_clear_of_itself_in_all_that_it_does() {
    let check = |animation: &str| {
        let moving = doing(animation);
        let topology = Topology::new(moving.point_count(), moving.faces()).unwrap();
        let surface = CollisionMesh::new(&topology, &[]);
        let mut seen = Vec::new();
        for k in 0..=20 {
            let time = 16.0 * f64::from(k) / 60.0;
            let points = at(&moving, time);
            if points == seen {
                continue;
            }
            let lowest = points.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
            // Single precision, once in the key and once in each point.
            assert!(lowest.abs() < 1e-6, "{animation} at {time}: {lowest}");
            let found = crossings(&surface, &points);
            assert_eq!(found, 0, "{animation} at {time} s");
            seen = points;
        }
    };
    std::thread::scope(|threads| {
        for animation in ANIMATIONS {
            threads.spawn(|| check(animation));
        }
    });
}

#[test]
fn what_it_does_is_chosen_by_name() {
    let problem = |motion: &str| {
        let text = format!("name = \"m\"\nmesh = \"mannequin\"\nmotion = {motion}");
        TestFolder::new().problem(&text)
    };
    let flying = problem("{ animation = \"fly\" }");
    says(flying, &["no animation called \"fly\"; there are [stand"]);
    let words = ["several animations: choose one by `animation`"];
    says(problem("\"mannequin\""), &words);
}
