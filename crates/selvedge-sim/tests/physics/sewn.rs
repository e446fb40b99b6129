//! Sewn cloth: seams that are none, mirrored panels, and a tube under its own weight.

use glam::{DVec2, DVec3};
use selvedge_cloth::{FaceId, Mesh, Scene, Stepper};
use selvedge_sim::{Simulator, sag};

use crate::scenes::{self, at_rest, crumpled, hanging, largest_distance, steps};
use crate::sheets::{elastic, isotropic, scene};
use crate::touching::none;

/// `mesh` with the material coordinates of faces whose middle lies beyond the line u = `line`
/// replaced by what `place` makes of them: cut along the line, and sewn again.
fn cut_and_sewn(mesh: &Mesh, line: f64, place: impl Fn(DVec2) -> DVec2) -> Mesh {
    let pattern = mesh.pattern();
    let corners: Vec<[DVec2; 3]> = (0..mesh.topology().faces().len() as u32)
        .map(|face| {
            let shape = pattern.face(FaceId(face));
            let middle = shape.iter().sum::<DVec2>() / 3.0;
            if middle.x > line { shape.map(&place) } else { shape }
        })
        .collect();
    Mesh::sewn(
        &mesh.topology().face_indices(),
        &corners,
        mesh.positions().to_vec(),
    )
    .unwrap()
}

fn seams(mesh: &Mesh) -> usize {
    let edges = mesh.topology().edges().iter();
    edges.filter(|edge| mesh.pattern().is_seam(edge)).count()
}

/// Positions after `frames` frames in which the handles go sideways, from a crumpled start.
fn moved(scene: &Scene, frames: usize) -> Vec<DVec3> {
    let mut simulator = at_rest(scene, crumpled(scene, 0.004));
    for frame in 1..=frames {
        let shift = DVec3::new(0.3, 0.0, 0.1) * (frame as f64 / 60.0);
        simulator.step(&scenes::moved(scene, shift)).unwrap();
    }
    simulator.positions_f64().to_vec()
}

#[test]
fn a_sheet_that_is_cut_moved_or_mirrored_and_sewn_again_is_the_uncut_sheet() {
    let mut uncut = hanging(13);
    uncut.physics.even_bending = true;
    let evened = moved(&uncut, 30);
    uncut.physics.even_bending = false;
    let before = moved(&uncut, 30);
    assert!(largest_distance(&before, uncut.mesh.positions()) > 0.15);
    type Place = fn(DVec2) -> DVec2;
    let places: [(&str, Place); 4] = [
        ("shifted", |p| p + DVec2::new(3.0, -0.7)),
        ("mirrored along u", |p| DVec2::new(-p.x, p.y)),
        ("mirrored along v", |p| DVec2::new(p.x, 2.0 - p.y)),
        ("turned by a half", |p| DVec2::new(5.0, 3.0) - p),
    ];
    for (name, place) in places {
        // The whole sheet, and one panel of two.
        for line in [-1.0, 0.4] {
            let mut sewn = uncut.clone();
            sewn.mesh = cut_and_sewn(&uncut.mesh, line, place);
            let seams = seams(&sewn.mesh);
            assert_eq!(seams >= 12, line > 0.0, "{name}, line {line}: {seams}");
            let distance = largest_distance(&before, &moved(&sewn, 30));
            assert!(distance <= 1e-9, "{name}, line {line}: {distance:e} m");
            // Each panel is evened by itself.
            sewn.physics.even_bending = true;
            let distance = largest_distance(&evened, &moved(&sewn, 30));
            let bound = if seams > 0 { 2e-3 } else { 1e-9 };
            assert!(distance <= bound, "{name}, line {line}: {distance:e} m");
        }
    }
    // A panel whose threads run across is another cloth.
    let mut turned = uncut.clone();
    turned.mesh = cut_and_sewn(&uncut.mesh, 0.4, |p| p.perp());
    assert!(largest_distance(&before, &moved(&turned, 30)) > 1e-4);
}

/// A tube of `columns` flat sides and `rows`, hanging down from y = 0, its pattern a rectangle that
/// is sewn along one line. Its rest angles are those of the prism.
pub(crate) fn tube(columns: usize, rows: usize, side: f64) -> Mesh {
    let radius = 0.5 * side / (std::f64::consts::PI / columns as f64).sin();
    let positions: Vec<DVec3> = (0..=rows)
        .flat_map(|row| (0..columns).map(move |column| (row, column)))
        .map(|(row, column)| {
            let angle = std::f64::consts::TAU * column as f64 / columns as f64;
            let (sine, cosine) = angle.sin_cos();
            DVec3::new(radius * cosine, -(row as f64) * side, radius * sine)
        })
        .collect();
    let (mut faces, mut corners) = (Vec::new(), Vec::new());
    for row in 0..rows {
        for column in 0..columns {
            let vertex = |r: usize, c: usize| ((row + r) * columns + (column + c) % columns) as u32;
            let place = |r: usize, c: usize| {
                DVec2::new((column + c) as f64, (rows - row - r) as f64) * side
            };
            // One diagonal, so that all vertices of a ring are alike.
            let triangles = [[(0, 0), (0, 1), (1, 1)], [(0, 0), (1, 1), (1, 0)]];
            for triangle in triangles {
                faces.push(triangle.map(|(r, c)| vertex(r, c)));
                corners.push(triangle.map(|(r, c)| place(r, c)));
            }
        }
    }
    let mesh = Mesh::sewn(&faces, &corners, positions).unwrap();
    mesh.with_rest_angles_of_start()
}

#[test]
fn a_sewn_tube_is_as_long_as_its_weight_makes_it() {
    // With ν = 0 every ring sinks without changing its shape, and each row of the tube has one
    // stretch: E h (λ³ - λ)/2 around the tube carries the lumped masses below the row.
    let sheet = elastic(2e4, 0.0, 1e-3);
    let (columns, rows, spacing) = (12, 10, 0.05);
    let mesh = tube(columns, rows, spacing);
    assert_eq!(seams(&mesh), rows);
    let top: Vec<u32> = (0..columns as u32).collect();
    let mut scene = scene(mesh, isotropic(sheet, 0.3), &top);
    scene.sag.tolerance = 1e-7;
    let rest = sag(&scene).unwrap().positions;
    let mass = scene.rest_shape().vertex_mass;
    let around = sheet.youngs_modulus * sheet.thickness * columns as f64 * spacing;
    let gravity = -scene.environment.gravity.y;
    let mut y = 0.0;
    for row in 1..=rows {
        let load: f64 = mass[row * columns..].iter().sum::<f64>() * gravity;
        let stretch = (0..50).fold(1.5_f64, |x, _| {
            x - (x.powi(3) - x - 2.0 * load / around) / (3.0 * x * x - 1.0)
        });
        y -= stretch * spacing;
        for column in 0..columns {
            let found = rest[row * columns + column];
            // Residual of 1e-7 m/s² on a tube that gives 0.1 m to 9.8 m/s²: 1e-9 m.
            assert!((found.y - y).abs() < 2e-8, "row {row}: {} {y}", found.y);
            let start = scene.mesh.positions()[row * columns + column];
            let off = found.with_y(0.0).distance(start.with_y(0.0));
            assert!(off < 2e-7, "row {row}");
        }
    }
    assert!(y < -0.5 * 1.03, "{y}");
}

#[test]
fn a_cloth_whose_rest_angles_are_those_of_its_start_stays_as_it_is() {
    let sheet = elastic(2e4, 0.3, 1e-3);
    let mut scene = scene(tube(9, 6, 0.05), isotropic(sheet, 0.3), &[]);
    scene.environment.gravity = DVec3::ZERO;
    let moved = |scene: &Scene| {
        let mut simulator = Simulator::new(scene).unwrap();
        steps(&mut simulator, &none(), 60);
        largest_distance(simulator.positions_f64(), scene.mesh.positions())
    };
    assert!(moved(&scene) < 1e-12);
    // Flat rest angles unroll it.
    let flat = vec![0.0; scene.mesh.topology().edges().len()];
    scene.mesh = scene.mesh.clone().with_rest_angles(flat).unwrap();
    assert!(moved(&scene) > 1e-6);
}
