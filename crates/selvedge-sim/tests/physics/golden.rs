//! Numbers that must not change.
//!
//! `arcsim_lookups.txt`: stiffness look-ups of ARCSim itself. `substeps.txt`: three solves on a
//! small mesh as this crate computed them when it agreed with 18 of ARCSim's own substeps to 4.5e-9
//! m, with the look-ups as they now are. Setting `SELVEDGE_UPDATE_GOLDENS` writes
//! it anew, which needs a reason.

use std::fmt::Write as _;

use glam::DVec2;
use selvedge_cloth::{LinearSolver, Material, PhysicsMode, PhysicsSettings};
use selvedge_sim::Simulator;
use selvedge_sim::laws::bend::BendElement;
use selvedge_sim::laws::stretch::Strain;
use selvedge_sim::laws::stretch_table::GridStiffness;

use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, crumpled, hanging, material, noise};

fn fabric(name: &str) -> Material {
    [GRAY, CAMEL, DENIM, NAVY]
        .map(material)
        .into_iter()
        .find(|material| material.name == name)
        .unwrap()
}

/// The name and the numbers of the lines of this kind.
fn rows<'a>(text: &'a str, kind: &'a str) -> impl Iterator<Item = (&'a str, Vec<f64>)> {
    text.lines().filter_map(move |line| {
        let (name, numbers) = line.strip_prefix(kind)?.trim_start().split_once(' ')?;
        let numbers = numbers.split(' ').map(|word| word.parse().unwrap());
        Some((name, numbers.collect()))
    })
}

/// Rounding of some ten operations and of the file's 17 digits.
fn assert_close(found: f64, expected: f64, what: &str) {
    let error = (found - expected).abs();
    assert!(
        error <= 1e-13 * expected.abs(),
        "{what}: {found} instead of {expected}"
    );
}

#[test]
fn look_ups_are_arcsims() {
    let text = include_str!("arcsim_lookups.txt");
    let mut checked = [0, 0];
    for (name, numbers) in rows(text, "stretch") {
        let law = GridStiffness::new(fabric(name).stretch);
        let [uu, vv, uv] = [0, 1, 2].map(|k| numbers[k]);
        let found = law.stiffness(Strain { uu, vv, uv });
        for (found, expected) in found.into_iter().zip(&numbers[3..]) {
            assert_close(found, *expected, &format!("{name} at {uu} {vv} {uv}"));
        }
        checked[0] += 1;
    }
    for (name, numbers) in rows(text, "bend") {
        let [degrees, curvature, expected] = numbers[..] else {
            panic!("{name}: {numbers:?}")
        };
        let along = DVec2::from_angle(degrees.to_radians());
        let corners = [DVec2::ZERO, along, along.perp(), -along.perp()];
        let found = BendElement::new(&fabric(name).bend, corners).stiffness_at(curvature);
        let what = format!("{name} at {degrees}°, {curvature}");
        assert_close(found, expected.max(0.0), &what);
        checked[1] += 1;
    }
    assert!(checked[0] == 48 && checked[1] >= 4 * 20, "{checked:?}");
}

#[test]
fn substeps_are_as_they_were() {
    let mut scene = hanging(5);
    scene.physics = PhysicsSettings::in_mode(PhysicsMode::Arcsim);
    scene.physics.solver = LinearSolver::Cholesky;
    let mut text = String::from(
        "# Positions [m] of a 5 x 5 cloth after each of three solves; made by golden.rs.\n",
    );
    let mut simulator =
        Simulator::with_state(&scene, crumpled(&scene, 0.02), noise(25, 0.5)).unwrap();
    let targets = scene.handles.select(scene.mesh.positions());
    for _ in 0..3 {
        simulator.substep(1.0 / 240.0, &targets).unwrap();
        for x in simulator.positions_f64() {
            writeln!(text, "x substeps {:e} {:e} {:e}", x.x, x.y, x.z).unwrap();
        }
    }
    if std::env::var_os("SELVEDGE_UPDATE_GOLDENS").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/physics/substeps.txt");
        std::fs::write(path, &text).unwrap();
        return;
    }
    let [golden, found] = [include_str!("substeps.txt"), &text]
        .map(|text| rows(text, "x").map(|row| row.1).collect::<Vec<_>>());
    assert_eq!((golden.len(), found.len()), (75, 75));
    for (found, golden) in found.iter().flatten().zip(golden.iter().flatten()) {
        // Rounding that differs between machines is 1e-15 m, grown by three solves.
        assert!(
            (found - golden).abs() < 1e-11,
            "{found} instead of {golden}"
        );
    }
}
