//! Obstacles of scenes and of runs: their size, and when they move.

use selvedge_cloth::{ContactSettings, Obstacle, ObstaclePath};
use selvedge_data::ObstacleTrack;
use serde_json::{Value, json};

use crate::output::Facts;

/// Adds the contact of a scene and a line for each of its obstacles; the same for JSON.
pub(super) fn scene_facts(
    facts: &mut Facts,
    contact: Option<&ContactSettings>,
    obstacles: &[Obstacle],
) -> Value {
    if let Some(contact) = contact {
        let with_itself = match contact.self_contact {
            true => "with itself",
            false => "not with itself",
        };
        facts.add(
            "contact",
            format!(
                "{with_itself}, thickness {} m, friction {}",
                contact.thickness, contact.friction
            ),
        );
    }
    let mut reports = Vec::new();
    for obstacle in obstacles {
        let (kind, seconds) = motion_of(obstacle);
        let (points, faces) = (obstacle.point_count(), obstacle.faces().len());
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
                "{}: {points} points, {faces} faces, {motion}{friction}",
                obstacle.name()
            ),
        );
        reports.push(json!({
            "name": obstacle.name(),
            "points": points,
            "faces": faces,
            "motion": kind,
            "seconds": seconds,
        }));
    }
    Value::Array(reports)
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

/// Adds a line for each obstacle of a run; the same for JSON.
pub(super) fn run_facts(facts: &mut Facts, obstacles: &[ObstacleTrack]) -> Value {
    let mut reports = Vec::new();
    for obstacle in obstacles {
        let (points, faces) = (obstacle.point_count(), obstacle.faces().len());
        let motion = if obstacle.is_still() {
            "still"
        } else {
            "moves"
        };
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
    Value::Array(reports)
}
