//! Obstacles of scenes and of runs: their size, and when they move.

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Obstacle, ObstaclePath};
use selvedge_data::ObstacleTrack;
use selvedge_lab::physics;
use serde_json::{Value, json};

use super::{box_of, shortest_mean_longest, sides};
use crate::output::{Facts, length};

/// Adds the contact of a scene and its obstacles.
pub(super) fn scene_facts(
    facts: &mut Facts,
    contact: Option<&ContactSettings>,
    obstacles: &[Obstacle],
) {
    if let Some(contact) = contact {
        let with_itself = if contact.self_contact { "with itself" } else { "not with itself" };
        facts.add(
            "contact",
            format!(
                "{with_itself}, thickness {}, friction {}",
                length(contact.thickness),
                contact.friction
            ),
        );
    }
    let reports = obstacles.iter().map(|obstacle| of_scene(facts, obstacle));
    let reports: Vec<Value> = reports.collect();
    facts.note("obstacles", reports);
}

/// Adds lines for an obstacle; the same for JSON.
fn of_scene(facts: &mut Facts, obstacle: &Obstacle) -> Value {
    let (kind, seconds) = motion_of(obstacle);
    let (name, points, faces) = (obstacle.name(), obstacle.point_count(), obstacle.faces());
    let motion = match seconds {
        Some(seconds) => format!("moves {kind} for {seconds:.2} s"),
        None => "still".to_owned(),
    };
    let friction = match obstacle.friction() {
        friction if friction.is_finite() => format!(", friction {friction}"),
        _ => String::new(),
    };
    facts.add(
        "obstacle",
        format!(
            "{name}: {points} points, {} faces, {motion}{friction}",
            faces.len()
        ),
    );
    let places: Vec<DVec3> = obstacle.positions_at(0.0).collect();
    let (low, high) = box_of(&physics::rounded(&places));
    let edges = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let lengths = edges.map(|ends| {
        let [a, b] = ends.map(|p| places[p as usize]);
        a.distance(b)
    });
    let sides = sides(low, high);
    facts.add("its size", format!("{sides}, from {low} to {high} m"));
    facts.add("its edges", shortest_mean_longest(lengths));
    json!({
        "name": name,
        "points": points,
        "faces": faces.len(),
        "motion": kind,
        "seconds": seconds,
        "lowest_corner": low.to_array(),
        "highest_corner": high.to_array(),
    })
}

/// Kind of a motion, and how long it lasts `[s]`.
fn motion_of(obstacle: &Obstacle) -> (&'static str, Option<f64>) {
    match obstacle.path() {
        _ if obstacle.is_still() => ("still", None),
        ObstaclePath::Still => ("still", None),
        ObstaclePath::Rigid(keys) => ("rigidly", keys.last().map(|key| key.time)),
        ObstaclePath::Points { frame_rate, frames } => (
            "by its points",
            Some((frames.len() - 1) as f64 / frame_rate),
        ),
    }
}

/// Adds the obstacles of a run.
pub(super) fn run_facts(facts: &mut Facts, obstacles: &[ObstacleTrack]) {
    let mut reports = Vec::new();
    for obstacle in obstacles {
        let (points, faces) = (obstacle.point_count(), obstacle.faces().len());
        let motion = if obstacle.is_still() { "still" } else { "moves" };
        let name = obstacle.name();
        facts.add(
            "obstacle",
            format!("{name}: {points} points, {faces} faces, {motion}"),
        );
        reports.push(json!({
            "name": name,
            "points": points,
            "faces": faces,
            "motion": motion,
        }));
    }
    facts.note("obstacles", reports);
}
