//! Tests of meshes and their rest shapes.

use super::*;

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
    type Spoil = fn(&mut Vec<[u32; 3]>, &mut Vec<DVec2>, &mut Vec<DVec3>);
    let cases: [(&str, Spoil); 5] = [
        ("face 1 names vertex 2 twice", |faces, _, _| {
            faces[1] = [0, 2, 2]
        }),
        (
            "the list of material coordinates has 3 entries for 4 vertices",
            |_, uv, _| {
                uv.truncate(3);
            },
        ),
        ("the position of vertex 2 is not finite", |_, _, p| {
            p[2].y = f64::NAN
        }),
        ("the material coordinate of vertex 3", |_, uv, _| {
            uv[3].x = f64::INFINITY
        }),
        // Vertex 3 on the diagonal 0-2.
        ("face 1 has no area", |_, uv, _| {
            uv[3] = DVec2::new(1.0, 0.5)
        }),
    ];
    for (words, spoil) in cases {
        let (mut faces, mut uv, mut positions) = quad();
        spoil(&mut faces, &mut uv, &mut positions);
        let text = Mesh::new(&faces, uv, positions).unwrap_err().to_string();
        assert!(text.starts_with(words), "{text}");
    }
    let (faces, uv, positions) = quad();
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    assert!(mesh.clone().with_positions(vec![DVec3::ZERO; 3]).is_err());
    assert!(mesh.with_positions(vec![DVec3::NAN; 4]).is_err());
}

#[test]
fn fabrics_are_those_that_have_names() {
    let (faces, uv, positions) = quad();
    let mesh = Mesh::new(&faces, uv, positions).unwrap();
    let with = |of_face: &[Option<u32>]| {
        mesh.clone().with_fabrics(FaceFabrics {
            names: vec!["denim".to_owned()],
            of_face: of_face.to_vec(),
        })
    };
    assert!(with(&[None, Some(0)]).is_ok() && with(&[]).is_ok());
    for (of_face, words) in [
        (&[None, Some(1)][..], "face 1 has fabric 1 of 1 (from 0)"),
        (&[Some(0)], "the list of faces' fabrics has 1 entries for 2"),
    ] {
        let text = with(of_face).unwrap_err().to_string();
        assert!(text.starts_with(words), "{text}");
    }
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
