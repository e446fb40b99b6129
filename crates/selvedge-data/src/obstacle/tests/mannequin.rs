//! The shipped mannequin: clear of itself, and on the ground in all that it does.

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
fn what_it_does_is_chosen_by_name() {
    let problem = |motion: &str| {
        let text = format!("name = \"m\"\nmesh = \"mannequin\"\nmotion = {motion}");
        Desk::new().problem(&text)
    };
    let flying = problem("{ animation = \"fly\" }");
    says(flying, &["no animation called \"fly\"; there are [stand"]);
    let words = ["several animations: choose one by `animation`"];
    says(problem("\"mannequin\""), &words);
}
