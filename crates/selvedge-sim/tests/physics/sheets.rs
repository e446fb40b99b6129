//! Meshes and scenes for closed forms: regular strips and sheets of isotropic material, in vacuum.

use glam::{DVec2, DVec3};
use selvedge_cloth::{Handles, Isotropic, LinearSolver, Material, Mesh, Scene};

use crate::scenes::squares;

/// A material of this Young's modulus `[Pa]`, Poisson's ratio and thickness `[m]`.
pub(crate) const fn elastic(youngs_modulus: f64, poissons_ratio: f64, thickness: f64) -> Isotropic {
    Isotropic {
        youngs_modulus,
        poissons_ratio,
        thickness,
    }
}

/// A sheet of thickness 1 mm made of `isotropic`, of `density` [kg/m²].
pub(crate) fn isotropic(isotropic: Isotropic, density: f64) -> Material {
    isotropic.validate().unwrap();
    Material {
        name: "isotropic".to_owned(),
        source: String::new(),
        density,
        damping: 0.0,
        stretch: isotropic.stretch_table(),
        bend: isotropic.bend_table(),
        compression: selvedge_cloth::Compression::default(),
    }
}

/// `mesh` of `material` held at `handles`, under gravity, without air, without a bulge.
pub(crate) fn scene(mesh: Mesh, material: Material, handles: &[u32]) -> Scene {
    let vertices = mesh.positions().len();
    let handles = Handles::new(handles, vertices).unwrap();
    let mut scene = Scene::of("closed form", mesh, handles, material);
    scene.environment.air_density = 0.0;
    scene.physics.solver = LinearSolver::Cholesky;
    scene.sag.bulge = 0.0;
    scene
}

/// A rectangle of `columns` × `rows` squares of side `spacing`, u to the right and v up, placed by
/// `place`; vertices row by row from the top.
pub(crate) fn grid(
    columns: usize,
    rows: usize,
    spacing: f64,
    place: impl Fn(DVec2) -> DVec3,
) -> Mesh {
    let coordinates: Vec<DVec2> = (0..(columns + 1) * (rows + 1))
        .map(|k| {
            let (row, column) = (k / (columns + 1), k % (columns + 1));
            DVec2::new(column as f64, (rows - row) as f64) * spacing
        })
        .collect();
    let positions = coordinates.iter().map(|c| place(*c)).collect();
    Mesh::new(&squares(columns, rows), coordinates, positions).unwrap()
}

/// A strip of `count` equilateral triangles of side `side` along u, placed by `place`; vertices in
/// order along the strip, lower and upper in turn.
pub(crate) fn triangle_strip(count: usize, side: f64, place: impl Fn(DVec2) -> DVec3) -> Mesh {
    let height = 0.75_f64.sqrt() * side;
    let coordinates: Vec<DVec2> = (0..count + 2)
        .map(|k| DVec2::new(0.5 * side * k as f64, if k % 2 == 0 { 0.0 } else { height }))
        .collect();
    let faces: Vec<[u32; 3]> = (0..count as u32)
        .map(
            |k| {
                if k % 2 == 0 { [k, k + 2, k + 1] } else { [k, k + 1, k + 2] }
            },
        )
        .collect();
    let positions = coordinates.iter().map(|c| place(*c)).collect();
    Mesh::new(&faces, coordinates, positions).unwrap()
}

/// Slope of the line of least squares through (x, y).
pub(crate) fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (x, y) = points
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + x / count, b + y / count));
    let products = points.iter().map(|p| (p.0 - x) * (p.1 - y));
    let squares = points.iter().map(|p| (p.0 - x).powi(2));
    products.sum::<f64>() / squares.sum::<f64>()
}
