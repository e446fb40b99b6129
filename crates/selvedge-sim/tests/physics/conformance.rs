//! The simulator keeps the contract of a stepper, whatever its physics settings.

use crate::stepper_checks::{HandlesEnd, check, check_stop};
use selvedge_cloth::{
    ConjugateGradients, HandleConstraint, Integrator, LinearSolver, PhysicsSettings,
};
use selvedge_sim::Simulator;

use crate::scenes::{BDF2, by_default, floating, hanging};

#[test]
fn the_simulator_conforms() {
    let usual = hanging(5);
    let with = |edit: fn(&mut PhysicsSettings)| {
        let mut scene = usual.clone();
        edit(&mut scene.physics);
        scene
    };
    let scenes = [
        usual.clone(),
        floating(4),
        with(|physics| {
            physics.solver = LinearSolver::ConjugateGradients(ConjugateGradients::default());
        }),
        with(|physics| physics.integrator = Integrator::Linearised),
        with(|physics| physics.integrator = BDF2),
        // Large enough for a press to come within a step.
        by_default(24),
    ];
    for scene in &scenes {
        let make = || Simulator::new(scene).unwrap();
        check(make, HandlesEnd::AtTargets);
        check_stop(make);
    }
    let springs = with(|physics| physics.handles = HandleConstraint::Spring);
    let make = || Simulator::new(&springs).unwrap();
    check(make, HandlesEnd::Elsewhere);
}
