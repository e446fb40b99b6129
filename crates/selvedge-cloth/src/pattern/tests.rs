//! Tests of patterns: numbering, seams, panels and lengths.

use super::*;
use crate::Mesh;
use glam::DVec3;

/// Two squares of two faces each, sewn along the edge 1-2, apart in the pattern: the second is
/// turned by a quarter.
fn two_panels() -> Mesh {
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let at = [
        (0.0, 0.0),
        (1.0, 0.0),
        (1.0, 1.0),
        (0.0, 1.0),
        (2.0, 0.0),
        (2.0, 1.0),
    ];
    let positions: Vec<DVec3> = at.map(|(x, y)| DVec3::new(x, y, 0.0)).to_vec();
    let corners: Vec<[DVec2; 3]> = faces
        .iter()
        .enumerate()
        .map(|(number, face)| {
            face.map(|v: u32| {
                let flat = positions[v as usize].truncate();
                if number < 2 { flat } else { DVec2::new(5.0 - flat.y, flat.x) }
            })
        })
        .collect();
    Mesh::sewn(&faces, &corners, positions).unwrap()
}

#[test]
fn vertices_of_a_seam_have_a_point_for_each_side() {
    let mesh = two_panels();
    let pattern = mesh.pattern();
    assert!(pattern.is_sewn());
    // Six vertices; 1 and 2 have a second point each, in the order of the faces.
    assert_eq!(pattern.points().len(), 8);
    assert_eq!(pattern.vertices(), [0, 1, 2, 3, 4, 5, 1, 2]);
    assert_eq!(pattern.corner_points(FaceId(3)), [6, 5, 7]);
    assert_eq!(pattern.points()[1], DVec2::X);
    assert_eq!(pattern.points()[6], DVec2::new(5.0, 1.0));
    let edges = mesh.topology().edges().iter();
    let seams = edges.filter(|edge| pattern.is_seam(edge));
    let seams: Vec<[u32; 2]> = seams.map(|edge| edge.vertices.map(|v| v.0)).collect();
    assert_eq!(seams, [[1, 2]]);
    assert_eq!(pattern.panels(), [0, 0, 1, 1]);
}

#[test]
fn a_sheet_without_seams_is_one_panel_of_points_that_are_vertices() {
    let faces = [[0, 1, 2], [0, 2, 3]];
    let flat = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    let positions: Vec<DVec3> = flat.map(|p| p.extend(0.0)).to_vec();
    let corners = faces.map(|face| face.map(|v: u32| flat[v as usize]));
    let sewn = Mesh::sewn(&faces, &corners, positions.clone()).unwrap();
    let plain = Mesh::new(&faces, flat.to_vec(), positions).unwrap();
    assert_eq!(sewn, plain);
    assert!(!plain.pattern().is_sewn());
    assert_eq!(plain.pattern().panels(), [0, 0]);
    assert_eq!(plain.pattern().corners(), faces);
}

#[test]
fn a_seam_is_as_long_as_its_sides_in_the_mean() {
    // The right side of the seam 1-2 is drawn a tenth longer: eased in.
    let faces = [[0, 1, 2], [1, 3, 2]];
    let positions: Vec<DVec3> = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (2.0, 0.5)]
        .map(|(x, y)| DVec3::new(x, y, 0.0))
        .to_vec();
    let corners = [
        [DVec2::ZERO, DVec2::X, DVec2::ONE],
        [DVec2::ZERO, DVec2::new(1.0, 0.55), DVec2::new(0.0, 1.1)],
    ];
    let mesh = Mesh::sewn(&faces, &corners, positions).unwrap();
    let edges = mesh.topology().edges();
    let mut each = edges.iter();
    let seam = each.position(|edge| mesh.pattern().is_seam(edge)).unwrap();
    assert!((mesh.pattern().edge_lengths()[seam] - 1.05).abs() < 1e-15);
    let (left, right) = mesh.pattern().sides(&edges[seam]);
    let right = right.unwrap();
    assert_eq!([left.length(), right.length()], [1.0, 1.1]);
    assert_eq!([left.area(), right.area()], [0.5, 0.55]);
}

#[test]
fn faces_of_a_pattern_that_do_not_fit_are_named() {
    let mesh = two_panels();
    let (topology, good) = (mesh.topology(), mesh.pattern().corners());
    let message = |points: usize, edit: fn(&mut Vec<[u32; 3]>)| {
        let mut corners = good.clone();
        edit(&mut corners);
        let checked = check_corners(topology, points, &corners);
        checked.unwrap_err().to_string()
    };
    type Edit = fn(&mut Vec<[u32; 3]>);
    let cases: [(usize, Edit, &str); 5] = [
        (8, |c| c.truncate(3), "the pattern has 3 faces, the cloth 4"),
        (
            7,
            |_| {},
            "face 3 names point 7 of the pattern, which has 7 points",
        ),
        (
            8,
            |c| c[2][1] = 0,
            "point 0 of the pattern belongs to vertices 0 and 4",
        ),
        (9, |_| {}, "point 8 of the pattern belongs to no face"),
        (
            8,
            |c| {
                // Points 1 and 6 of vertex 1 are fine in either order; 4 and 6 are not.
                c[2] = [4, 6, 5];
                c[3] = [4, 5, 7];
            },
            "point 4 of the pattern must belong to vertex 4",
        ),
    ];
    for (points, edit, expected) in cases {
        let found = message(points, edit);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn a_mirrored_panel_is_a_panel() {
    let faces = [[0, 1, 2], [0, 2, 3]];
    let flat = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    let positions: Vec<DVec3> = flat.map(|p| p.extend(0.0)).to_vec();
    let mirrored = flat.map(|p| DVec2::new(-p.x, p.y)).to_vec();
    let rest = Mesh::new(&faces, mirrored, positions)
        .unwrap()
        .rest_shape(1.0);
    assert_eq!(rest.face_area, [0.5, 0.5]);
    assert!(rest.vertex_mass.iter().all(|&m| m > 0.0));
}
