//! The word of a model's guard on every frame, summed up and written; and when a run diverges.

use std::io::Write;
use std::path::Path;

use selvedge_data::{WriteError, metrics, write_atomically};
pub use selvedge_guard::GuardSummary;
use selvedge_guard::{Replacement, Trust};
use selvedge_model::Aspect;

use crate::domain::Beyond;
use crate::report::csv_of;

/// Strain (l - l₀)/l₀ of an edge, against the material, over which a run diverges ...
const DIVERGED_STRAIN: f64 = 0.3;
/// ... and over this many times the ground truth's largest (a fine sheet that hangs by two corners
/// strains by 43 % there) ...
const DIVERGED_OVER_TRUTH: f64 = 1.5;
/// ... where it lasts for more frames in a row.
const DIVERGED_FRAMES: usize = 10;

/// The frame from which on a run diverges, counted from its start: more than 10 frames in a row in
/// which some edge strains over 30 %, and over 1.5 times `true_largest`, the largest strain of the
/// ground truth (0 where none is known). `strains` are the largest after each step.
pub fn diverged_frame(strains: &[f64], true_largest: f64) -> Option<usize> {
    let limit = DIVERGED_STRAIN.max(DIVERGED_OVER_TRUTH * true_largest);
    // The first strain is that after the first step.
    metrics::diverged_frame(strains, limit, DIVERGED_FRAMES).map(|frame| frame + 1)
}

/// The words of a guard summed up.
pub fn summary(log: &[Trust]) -> GuardSummary {
    let mut summary = GuardSummary::default();
    log.iter().for_each(|trust| summary.add(trust));
    summary
}

/// Writes a line per frame with the guard's verdict, measures and correction, and the aspects of
/// the scene that are beyond the training (.csv). SI units; strains have none.
pub fn write_trust(path: &Path, log: &[Trust], beyond: Option<&Beyond>) -> Result<(), WriteError> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |x| x.to_string());
    let rows = log.iter().enumerate().map(|(frame, trust)| {
        let beyond = match beyond {
            Some(beyond) => names(beyond.by_frame.get(frame).map_or(&[], Vec::as_slice)),
            None => "unknown".to_owned(),
        };
        let replaced = trust.verdict.replaced_by();
        let mut row = vec![trust.frame.to_string(), trust.verdict.name().to_owned()];
        row.extend(trust.numbers().map(|(_, value)| number(value)));
        row.extend([
            replaced.map_or("", Replacement::name).to_owned(),
            trust.physics_failed.to_string(),
            trust.contact.name().to_owned(),
            beyond,
        ]);
        row
    });
    let numbers = Trust::default().numbers().map(|(name, _)| name);
    let last = ["replaced_by", "physics_failed", "contact", "beyond"];
    let head = [&["frame", "verdict"][..], &numbers, &last].concat();
    let text = csv_of(head, rows);
    write_atomically(path, |out| out.write_all(&text))
}

fn names(aspects: &[Aspect]) -> String {
    let names: Vec<&str> = aspects.iter().map(|aspect| aspect.name()).collect();
    names.join(" ")
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use crate::conformance::{HandlesEnd, check};
    use glam::DVec3;
    use selvedge_cloth::{ContactSettings, HandleTargets, Obstacle, Scene, Stepper, bodies};
    use selvedge_guard::{Correction, Guard};
    use selvedge_sim::Simulator;

    use super::*;
    use crate::machine::{Machine, Mover};
    use crate::test_scene::hanging;
    use selvedge::start;

    /// The shipped network on the cloth of a scene, under a guard.
    fn guarded(scene: Scene, correction: Correction) -> Guard<Mover> {
        let (scene, settings) = (Arc::new(scene), correction);
        let model = selvedge::Model::open(Some("paper".as_ref())).unwrap();
        let rest = scene.mesh.positions();
        start::guarded(&scene, rest, &model, &Machine::Cpu, settings).unwrap()
    }

    #[test]
    fn a_run_may_strain_as_far_as_the_ground_truth() {
        let strains = [0.4; 20];
        assert_eq!(diverged_frame(&strains, 0.0), Some(1));
        assert_eq!(diverged_frame(&strains, 0.26), Some(1));
        assert_eq!(diverged_frame(&strains, 0.27), None);
    }

    #[test]
    fn a_guarded_model_conforms() {
        for correction in [Correction::None, Correction::default()] {
            let make = || guarded(hanging(), correction);
            check(make, HandlesEnd::AtTargets);
        }
    }

    /// A ball beside the small square, towards which it is led.
    fn with_ball() -> Scene {
        let mut scene = hanging();
        let positions = scene.mesh.positions();
        let middle = positions.iter().sum::<DVec3>() / positions.len() as f64;
        let body = bodies::sphere(0.15, 0.05);
        let points = body.points.iter().map(|p| *p + middle + 0.3 * DVec3::X);
        let ball = Obstacle::new("ball", points.collect(), body.faces).unwrap();
        scene.obstacles = vec![ball];
        scene.contact = Some(ContactSettings::default());
        scene
    }

    /// Handles that go by 0.72 m/s towards the ball, and past it.
    fn led(scene: &Scene, frame: usize) -> HandleTargets {
        let start = scene.handles.select(scene.mesh.positions()).into_iter();
        let shift = 0.012 * frame as f64 * DVec3::X;
        HandleTargets::at_frame_end(start.map(|p| p + shift).collect()).unwrap()
    }

    #[test]
    fn a_network_led_through_a_ball_writes_no_frame_that_intersects() {
        let scene = with_ball();
        let oracle = Simulator::new(&scene).unwrap();
        let mut free = guarded(scene.clone(), Correction::None);
        let mut held = guarded(scene.clone(), Correction::default());
        let (mut intersect, mut logs) = (0, [Vec::new(), Vec::new()]);
        for frame in 1..=60 {
            let targets = led(&scene, frame);
            free.step(&targets).unwrap();
            held.step(&targets).unwrap();
            logs[0].push(*free.trust());
            logs[1].push(*held.trust());
            oracle.check_apart(frame, held.positions()).unwrap();
            intersect += usize::from(oracle.check_apart(frame, free.positions()).is_err());
        }
        let [alone, summary] = logs.map(|log| summary(&log));
        // Frames of a network are pushed apart before a guard sees them.
        assert_eq!(intersect, 0);
        let mended = summary.pushed_apart + summary.lost_to_contact;
        assert!(mended < 6, "{summary:?}");
        assert_eq!(summary.contact_in_words().is_some(), mended > 0);
        assert_eq!(alone.contact_in_words(), None);
    }
}
