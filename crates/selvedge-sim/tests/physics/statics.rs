//! Rest poses against closed forms: a cantilever, the energy of a rolled sheet,
//! meshes that are refined.

use glam::{DVec2, DVec3};
use selvedge_cloth::ElasticLaw;
use selvedge_sim::laws::bend::BendElement;
use selvedge_sim::sag;

use crate::scenes::largest_distance;
use crate::sheets::{elastic, grid, isotropic, scene, triangle_strip};

const GRAVITY: f64 = 9.8;

#[test]
fn a_rolled_sheet_has_the_energy_of_a_plate() {
    // Rolled up with radius R in any direction, equilateral triangles have the energy D/(2 R²) per
    // area: the three edges of which there is one each for every two faces.
    let sheet = elastic(2e6, 0.3, 5e-4);
    let side = 0.01;
    for degrees in [0.0_f64, 10.0, 30.0, 45.0, 77.0] {
        let radius = 10.0;
        let direction = DVec2::from_angle(degrees.to_radians());
        let energy: f64 = [0.0_f64, 60.0, 120.0]
            .iter()
            .map(|turn| {
                let along = DVec2::from_angle(turn.to_radians()) * side;
                let wing = DVec2::from_angle((turn + 60.0).to_radians()) * side;
                let rest = [DVec2::ZERO, along, wing, along - wing];
                let place = |c: DVec2| {
                    let c = c - 0.5 * along;
                    let (sine, cosine) = (c.dot(direction) / radius).sin_cos();
                    let across = c.perp_dot(direction);
                    DVec3::new(radius * sine, -across, radius * (1.0 - cosine))
                };
                let element = BendElement::new(&sheet.bend_table(), rest);
                let response = element.respond(ElasticLaw::Energy, rest.map(place));
                0.5 * response.stiffness * response.angle.powi(2)
            })
            .sum();
        let cell = 0.75_f64.sqrt() * side.powi(2);
        let expected = 0.5 * sheet.plate_stiffness() / radius.powi(2) * cell;
        // Chords for arcs: (l/R)² = 1e-6.
        assert!((energy / expected - 1.0).abs() < 2e-6, "{degrees}°");
    }
}

#[test]
fn a_cantilever_carries_its_weight_hinge_by_hinge() {
    // A chain of triangles is statically determinate: at every hinge, stiffness times angle is the
    // moment of all weight beyond it about the hinge, however far it has bent.
    let sheet = elastic(1e8, 0.3, 3e-4);
    let density = 0.3;
    // Clamped at its first two triangles; the far edge of the second is the first hinge.
    let mesh = triangle_strip(17, 0.01, |c| DVec3::new(c.x, 0.0, -c.y));
    let mut scene = scene(mesh.clone(), isotropic(sheet, density), &[0, 1, 2, 3]);
    scene.physics.even_bending = false;
    scene.sag.tolerance = 1e-5;
    let positions = sag(&scene).unwrap().positions;
    let mass = mesh.rest_shape(density).vertex_mass;
    let uv = mesh.material_coordinates();
    // From, to, left, right.
    let chain = mesh.topology().edges().iter().filter_map(|edge| {
        let [from, to] = edge.vertices;
        let corners = [from, to, edge.opposite.0, edge.opposite.1?];
        Some(corners.map(|v| v.index()))
    });
    let mut tested = 0;
    for corners in chain {
        let [from, to, ..] = corners;
        // Beyond the edge of vertices k and k + 1 are those after.
        let beyond = from.max(to) + 1;
        if from.min(to) < 2 {
            continue;
        }
        let element = BendElement::new(&sheet.bend_table(), corners.map(|v| uv[v]));
        let response = element.respond(ElasticLaw::Energy, corners.map(|v| positions[v]));
        let axis = (positions[to] - positions[from]).normalize();
        let weight = |v: usize| DVec3::new(0.0, -GRAVITY * mass[v], 0.0);
        let moment: f64 = (beyond..positions.len())
            .map(|v| (positions[v] - positions[from]).cross(weight(v)).dot(axis))
            .sum();
        // Unbalanced: 1e-5 m/s² of 9.8; a tip has no moment to compare with but its own.
        let torque = (response.stiffness * response.angle).abs();
        assert!(
            (torque - moment.abs()).abs() < 1e-4 * moment.abs() + 1e-12,
            "{corners:?}"
        );
        tested += 1;
    }
    assert_eq!(tested, 15);
}

#[test]
fn finer_meshes_come_nearer_to_each_other() {
    // A square hanging by its upper edge, which cannot narrow there. Elements are linear and the
    // solution is smooth except at the upper corners: between first and second order. The 25
    // vertices that all meshes have are compared.
    let sheet = elastic(2e4, 0.3, 1e-3);
    let poses: Vec<Vec<DVec3>> = [4_usize, 8, 16]
        .into_iter()
        .map(|side| {
            let place = |c: DVec2| DVec3::new(0.0, c.y - 1.0, c.x - 0.5);
            let mesh = grid(side, side, 1.0 / side as f64, place);
            let upper: Vec<u32> = (0..=side as u32).collect();
            let mut scene = scene(mesh, isotropic(sheet, 0.3), &upper);
            scene.sag.tolerance = 1e-5;
            let rest = sag(&scene).unwrap().positions;
            let step = side / 4;
            let common = |k: usize| rest[(k / 5) * step * (side + 1) + (k % 5) * step];
            (0..25).map(common).collect()
        })
        .collect();
    let changes: Vec<f64> = poses
        .windows(2)
        .map(|pair| largest_distance(&pair[0], &pair[1]))
        .collect();
    assert!(changes[1] < 0.6 * changes[0], "{changes:?}");
}
