//! The example of a stepper of one's own runs, does what it says, and keeps the promises of
//! steppers.

use crate::conformance::{HandlesEnd, check};

#[allow(dead_code, reason = "the example has a main function")]
#[path = "../../examples/custom_stepper.rs"]
mod custom_stepper;

use custom_stepper::{Follower, cloth, run};

#[test]
fn the_example_records_compares_and_exports() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("follower.usdc");
    let measures = run(&out).unwrap();
    assert_eq!(measures.frame_counts, [121, 121]);
    // Each edge between vertices that move alike keeps its length but for rounding.
    assert!(measures.edge_length_rmse < 1e-6);
    // After two seconds "forward" has brought the cloth a metre along x.
    assert!((measures.position_max - 1.0).abs() < 1e-5, "{measures:?}");
    assert!(std::fs::read(&out).unwrap().starts_with(b"PXR-USDC"));
}

#[test]
fn the_stepper_of_the_example_keeps_the_promises_of_steppers() {
    check(|| Follower::new(cloth().unwrap()), HandlesEnd::AtTargets);
}
