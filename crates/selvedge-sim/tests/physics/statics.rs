//! Rest poses against closed forms: a cantilever, the energy of a rolled sheet,
//! meshes that are refined.

use glam::{DVec2, DVec3};
use selvedge_cloth::{ElasticLaw, Isotropic, Mesh};
use selvedge_sim::laws::bend::BendElement;
use selvedge_sim::sag;

use crate::scenes::largest_distance;
use crate::sheets::{elastic, grid, isotropic, scene, slope, triangle_strip};

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

/// A strip clamped at its first two triangles, horizontal along x, its tip's height at rest.
fn cantilever(sheet: Isotropic, density: f64, length: f64, count: usize) -> (Mesh, Vec<DVec3>) {
    // The first hinge is the far edge of the second triangle, half a side beyond the clamped ones.
    let side = 2.0 * length / (count as f64 + 1.0);
    let mesh = triangle_strip(count + 2, side, |c| DVec3::new(c.x, 0.0, -c.y));
    let mut scene = scene(mesh.clone(), isotropic(sheet, density), &[0, 1, 2, 3]);
    scene.sag.tolerance = 1e-5;
    let rest = sag(&scene).unwrap();
    (mesh, rest.positions)
}

#[test]
fn a_cantilever_carries_its_weight_hinge_by_hinge() {
    // A chain of triangles is statically determinate: at every hinge, stiffness times angle is the
    // moment of all weight beyond it about the hinge, however far it has bent.
    let sheet = elastic(1e8, 0.3, 3e-4);
    let density = 0.3;
    let (mesh, positions) = cantilever(sheet, density, 0.08, 15);
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
fn a_cantilever_bends_like_a_beam() {
    // Small deflections under its own weight q = ρ g: w = q L⁴/(8 D'), with D' = 8/9 D, since the
    // edges of a narrow strip are free to curl (see `Isotropic`). The chain's own error is first
    // order in its side: hinges and lumped masses half a side off, 4 of L's powers.
    let sheet = elastic(1e9, 0.3, 3e-4);
    let (density, length) = (0.3, 0.08_f64);
    let expected = density * GRAVITY * length.powi(4) / (8.0 * 8.0 / 9.0 * sheet.plate_stiffness());
    assert!(expected < 0.1 * length);
    let mut points = Vec::new();
    for count in [11_usize, 23, 47] {
        let (_, positions) = cantilever(sheet, density, length, count);
        let tip = positions.len() - 2;
        let found = -0.5 * (positions[tip].y + positions[tip + 1].y);
        let error = (found / expected - 1.0).abs();
        points.push(((count as f64).ln(), error.max(1e-12).ln()));
        assert!(error < 5.0 / count as f64, "{count}: {error}");
    }
    let order = -slope(&points);
    assert!(order > 0.8, "{order}");
}

#[test]
fn finer_meshes_come_nearer_to_each_other() {
    // A square hanging by its upper edge, which cannot narrow there. Elements are linear and the
    // solution is smooth except at the upper corners: between first and second order. The 25
    // vertices that all meshes have are compared.
    let sheet = elastic(2e4, 0.3, 1e-3);
    let poses: Vec<Vec<DVec3>> = [4_usize, 8, 16, 32]
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
    assert!(
        changes[1] < 0.6 * changes[0] && changes[2] < 0.6 * changes[1],
        "{changes:?}"
    );
}
