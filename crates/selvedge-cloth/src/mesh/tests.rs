//! Tests of meshes and their rest shapes.

use super::*;
use crate::generate::square;

/// A quad of two triangles, 2 m wide and 1 m high, flat at z = 0.
fn quad() -> (Vec<[u32; 3]>, Vec<DVec2>, Vec<DVec3>) {
    let uv: Vec<DVec2> = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (0.0, 1.0)]
        .map(|(u, v)| DVec2::new(u, v))
        .to_vec();
    let positions = uv.iter().map(|c| c.extend(0.0)).collect();
    (vec![[0, 1, 2], [0, 2, 3]], uv, positions)
}

#[test]
fn a_quad_has_its_masses_and_lengths() {
    let (faces, uv, positions) = quad();
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    let rest = mesh.rest_shape(0.3);
    assert_eq!(rest.face_area, [1.0, 1.0]);
    // Edges by (smaller, larger) vertex: 0-1, 0-2, 0-3, 1-2, 2-3.
    let diagonal = 5.0_f64.sqrt();
    assert_eq!(rest.edge_length, [2.0, diagonal, 1.0, 1.0, 2.0]);
    // A third of 0.3 kg per incident face: one or two of them.
    for (mass, faces) in rest.vertex_mass.iter().zip([2.0, 1.0, 2.0, 1.0]) {
        assert!((mass - 0.1 * faces).abs() < 1e-16);
    }
}

#[test]
fn masses_sum_to_density_times_area() {
    for (size, density) in [(1.0, 0.187), (0.4, 2.0)] {
        let rest = square(200, size, 4).unwrap().mesh.rest_shape(density);
        let mass: f64 = rest.vertex_mass.iter().sum();
        let expected = density * size * size;
        // 600 additions, each rounded to 1e-16 of the sum at most.
        assert!((mass / expected - 1.0).abs() < 1e-13, "{mass}");
        assert!(rest.vertex_mass.iter().all(|&m| m > 0.0));
    }
}

#[test]
fn the_rest_shape_does_not_depend_on_the_pose() {
    let (faces, uv, positions) = quad();
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    let crumpled = vec![DVec3::ONE; 4];
    let moved = mesh.clone().with_positions(crumpled.clone()).unwrap();
    assert_eq!(moved.positions(), crumpled);
    assert_eq!(moved.rest_shape(1.0), mesh.rest_shape(1.0));
}

#[test]
fn coordinates_that_no_cloth_has_are_named() {
    for (size, is_taken) in [(1e15, true), (1.1e15, false), (1e160, false)] {
        let (faces, uv, positions) = quad();
        let wide: Vec<DVec2> = uv.iter().map(|c| *c * 0.5 * size).collect();
        let far = positions.iter().map(|p| *p * 0.5 * size).collect();
        let pattern = Mesh::new(&faces, wide, positions.clone());
        let placed = Mesh::new(&faces, uv.clone(), far);
        let mesh = || Mesh::new(&faces, uv.clone(), positions.clone()).unwrap();
        let scaled = mesh().with_pattern_scaled(0.5 * size);
        let moved = mesh().with_positions(vec![DVec3::splat(size); 4]);
        for (made, what) in [
            (pattern, "the material coordinate of vertex 1"),
            (placed, "the position of vertex 1"),
            (scaled, "the material coordinate of vertex 1"),
            (moved, "the position of vertex 0"),
        ] {
            let problem = made.err().map(|error| error.to_string());
            assert_eq!(problem.is_none(), is_taken, "{size}, {what}: {problem:?}");
            if let Some(text) = problem {
                assert!(text.contains(what) && text.contains("1e15 m"), "{text}");
            }
        }
    }
}

#[test]
fn defects_are_named() {
    let build = |spoil: fn(&mut Vec<[u32; 3]>, &mut Vec<DVec2>, &mut Vec<DVec3>)| {
        let (mut faces, mut uv, mut positions) = quad();
        spoil(&mut faces, &mut uv, &mut positions);
        Mesh::new(&faces, uv, positions).unwrap_err()
    };
    let topology = build(|faces, _, _| faces[1] = [0, 2, 2]);
    assert!(matches!(topology, MeshError::Topology(_)));
    assert_eq!(
        build(|_, uv, _| uv.truncate(3)).to_string(),
        "the list of material coordinates has 3 entries for 4 vertices"
    );
    let text = build(|_, _, p| p[2].y = f64::NAN).to_string();
    assert!(
        text.starts_with("the position of vertex 2 is not finite"),
        "{text}"
    );
    let text = build(|_, uv, _| uv[3].x = f64::INFINITY).to_string();
    assert!(
        text.starts_with("the material coordinate of vertex 3"),
        "{text}"
    );
    // Vertex 3 on the diagonal 0-2: face 1 has no area.
    let flat = build(|_, uv, _| uv[3] = DVec2::new(1.0, 0.5));
    assert!(
        matches!(
            flat,
            MeshError::ZeroArea {
                face: FaceId(1),
                ..
            }
        ),
        "{flat}"
    );
    let (faces, uv, positions) = quad();
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    assert!(mesh.clone().with_positions(vec![DVec3::ZERO; 3]).is_err());
    assert!(mesh.with_positions(vec![DVec3::NAN; 4]).is_err());
}

#[test]
fn rest_angles_are_those_of_the_start_or_those_that_are_given() {
    let (faces, uv, mut positions) = quad();
    positions[3].z = 1.0;
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    assert!(mesh.rest_angles().is_empty());
    let bent = mesh.clone().with_rest_angles_of_start();
    let angles = bent.rest_angles();
    // Edge 0-2 is the only hinge; vertex 3 is 1 m above the plane and 2/√5 m from the edge.
    assert_eq!(angles[0], 0.0);
    let expected = 1.0_f64.atan2(2.0 / 5.0_f64.sqrt());
    assert!((angles[1] - expected).abs() < 1e-15, "{}", angles[1]);
    let given = mesh.clone().with_rest_angles(angles.to_vec()).unwrap();
    assert_eq!(given, bent);
    assert_eq!(mesh.clone().with_rest_angles(vec![0.0; 5]).unwrap(), mesh);
    assert!(mesh.clone().with_rest_angles(vec![0.0; 4]).is_err());
    let beyond = mesh.clone().with_rest_angles(vec![0.0, 4.0, 0.0, 0.0, 0.0]);
    let text = beyond.unwrap_err().to_string();
    assert!(text.starts_with("the rest angle of edge 2-0"), "{text}");
    assert!(mesh.with_seam_stiffness(-1.0).is_err());
}
