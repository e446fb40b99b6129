//! Springs and torques of a sheet whose stiffness is known in closed form.

use glam::{DVec2, DVec3};
use selvedge_cloth::{BendTable, Handles, Mesh, StretchTable};

use super::*;
use crate::graph::ClothGraph;
use crate::test_cloth::fabric;

/// An isotropic sheet of `stiffness` `[N/m]` and `bending` `[N·m]`, the same at all strains.
fn plain(stiffness: f64, bending: f64) -> Material {
    let half = 0.5 * stiffness;
    Material {
        stretch: StretchTable([[half, 0.0, half, half]; 6]),
        bend: BendTable([[bending; 5]; 3]),
        compression: selvedge_cloth::Compression::default(),
        ..fabric()
    }
}

/// Two equilateral triangles of side 1 m in a rhombus, turned by `angle` in their pattern.
fn rhombus(angle: f64, material: &Material) -> ClothGraph {
    let height = 0.75_f64.sqrt();
    let at = [[0.0, 0.0], [1.0, 0.0], [0.5, height], [0.5, -height]].map(DVec2::from);
    let turn = DVec2::from_angle(angle);
    let faces = [[0, 1, 2], [1, 0, 3]];
    let pattern = at.map(|p| turn.rotate(p)).to_vec();
    let positions = at.map(|p| DVec3::new(p.x, p.y, 0.0)).to_vec();
    let mesh = Mesh::new(&faces, pattern, positions).expect("a mesh");
    let handles = Handles::new(&[0], 4).expect("a handle");
    let cloth = Cloth::of_mesh(&mesh, 0.2, handles).expect("a cloth");
    let graph = ClothGraph::new(&cloth, selvedge_cloth::Environment::default(), 60.0);
    let graph = graph.expect("a graph").with_materials(&[material; 2]);
    graph.expect("two materials")
}

#[test]
fn a_spring_has_the_stiffness_of_its_faces_in_every_direction() {
    for angle in [0.0, 0.3, 1.1, 2.5] {
        let graph = rhombus(angle, &plain(100.0, 1e-5));
        for (edge, spring) in graph.topology().edges().iter().zip(&graph.weave().springs) {
            // Per face √3/4 m² over 1 m².
            let faces = if edge.is_boundary() { 1.0 } else { 2.0 };
            let expected = 100.0 * faces * 0.75_f32.sqrt() / 2.0;
            for length in [0.9, 1.1, 1.4] {
                let [pull, growth] = spring.pull(length);
                assert!((pull - expected * (length - 1.0)).abs() < 1e-4 * expected);
                assert!((growth - expected).abs() < 1e-3 * expected);
            }
        }
    }
}

#[test]
fn a_wing_is_pushed_by_its_hinge_over_its_height() {
    let graph = rhombus(0.4, &plain(100.0, 2e-5));
    let [torque] = graph.weave().torques[..] else {
        panic!("one hinge")
    };
    // The solver's torque ke l²/(4 A) θ over the mean height A/l.
    let area = f32::sqrt(0.75);
    let expected = 2e-5 / (4.0 * area * area);
    for angle in [-1.2, 0.0, 0.5, 3.0] {
        let [push, growth] = torque.push(angle);
        assert!((push - expected * angle).abs() < 1e-5 * expected);
        assert!((growth - expected).abs() < 1e-5 * expected);
    }
}

#[test]
fn a_fabric_that_stiffens_pulls_by_its_tables() {
    let graph = rhombus(0.0, &fabric());
    let along = graph.topology().edges().iter().zip(&graph.weave().springs);
    // The edge along the course axis: k_uu of the first row, and of that at 0°.
    let (_, spring) = along
        .clone()
        .find(|(edge, _)| !edge.is_boundary())
        .expect("the hinge");
    let [first, second] = [0, 1].map(|row| 2.0 * fabric().stretch.0[row][0] as f32);
    let faces = 0.75_f32.sqrt();
    for (length, stiffness) in [
        (0.95, first),
        (1.0 + 1.0 / 12.0, 0.5 * (first + second)),
        (7.0 / 6.0, second),
        (1.5, second),
    ] {
        let [pull, _] = spring.pull(length);
        let expected = faces * stiffness * (length - 1.0);
        assert!(
            (pull - expected).abs() < 1e-3 * stiffness,
            "{length}: {pull} {expected}"
        );
    }
}

#[test]
fn another_number_of_materials_is_named() {
    let material = fabric();
    let graph = rhombus(0.0, &material);
    let error = graph.with_materials(&[&material]).expect_err("one for two");
    assert_eq!(
        error.to_string(),
        "materials: the cloth has 2 faces, found 1 materials"
    );
}
