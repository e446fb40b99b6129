//! Bodies of .glb: morph targets, skins, points split along seams, and damage.

use std::f64::consts::FRAC_PI_2;

use glam::{DQuat, DVec3};
use serde_json::{Value, json};

use super::{TestFolder, assert_near, at, frames};
use crate::rig::glb::tests::Glb;
use crate::test_help::{says, table};

/// A .glb of a node with a mesh of these points and morph targets, whose weights are `weights` at
/// the times 1 s and 2 s.
fn leaf(points: &[f32], targets: &[&[f32]], interpolation: &str, weights: &[f32]) -> (Glb, Value) {
    let mut glb = Glb::default();
    let points = glb.floats("VEC3", 3, points);
    let targets = targets.iter().map(|target| glb.floats("VEC3", 3, target));
    let targets: Vec<Value> = targets.map(|t| json!({ "POSITION": t })).collect();
    let times = glb.floats("SCALAR", 1, &[1.0, 2.0]);
    let output = glb.floats("SCALAR", 1, weights);
    let json = json!({
        "nodes": [{ "name": "leaf", "mesh": 0 }],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": points }, "targets": targets,
        }] }],
        "animations": [{
            "name": "rise",
            "samplers": [{ "input": times, "output": output, "interpolation": interpolation }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "weights" } }],
        }],
    });
    (glb, json)
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// A triangle whose third point rises by two targets, under a node at x = 5.
fn morphed(interpolation: &str, weights: &[f32], edit: impl Fn(&mut Value)) -> Vec<u8> {
    let up = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let aside = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0];
    let (glb, mut json) = leaf(&TRIANGLE, &[&up, &aside], interpolation, weights);
    json["nodes"][0]["translation"] = json!([5, 0, 0]);
    json["nodes"][0]["weights"] = json!([0.5, 0.25]);
    edit(&mut json);
    glb.finish(json)
}

const STILL: &str = "name = \"leaf\"\nmesh = \"leaf.glb\"";
const MOVING: &str = "name = \"leaf\"\nmesh = \"leaf.glb\"\nmotion = \"leaf.glb\"";

#[test]
fn morph_targets_add_up_by_their_weights() {
    let dir = TestFolder::new();
    dir.write("leaf.glb", morphed("LINEAR", &[0.0, 0.0, 1.0, 0.5], |_| {}));
    let leaf = dir.read(MOVING).unwrap();
    let (rate, moved) = frames(&leaf);
    // The first key is the start.
    assert_eq!((rate, moved.len()), (60.0, 61));
    for (time, share) in [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0), (3.0, 1.0)] {
        let third = DVec3::new(5.0 + 2.0 * share, 1.0, share);
        let expected = [DVec3::X * 5.0, DVec3::X * 6.0, third];
        assert_near(&at(&leaf, time), &expected, 1e-12);
    }
    // Standing, it has the weights of its node.
    let still = dir.read(STILL).unwrap();
    assert_near(&at(&still, 0.0)[2..], &[DVec3::new(6.0, 1.0, 0.5)], 1e-12);
    let named = MOVING.replace(
        "motion = \"leaf.glb\"",
        "motion = { animation = \"rise\", from = 0.5 }",
    );
    let named = dir.read(&named).unwrap();
    assert_near(&at(&named, 0.0)[2..], &[DVec3::new(6.0, 1.0, 0.5)], 1e-12);
    // Level tangents: the cubic is halfway at half the time and at 5/32 at a quarter.
    let splines = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0];
    dir.write("leaf.glb", morphed("CUBICSPLINE", &splines, |_| {}));
    let leaf = dir.read(MOVING).unwrap();
    assert!((at(&leaf, 0.25)[2].z - 0.15625).abs() < 1e-12);
    dir.write("leaf.glb", morphed("STEP", &[0.0, 0.0, 1.0, 0.5], |_| {}));
    assert_eq!(at(&dir.read(MOVING).unwrap(), 0.9)[2].z, 0.0);
}

#[test]
fn sparse_accessors_are_zeros_but_for_the_elements_they_name() {
    let dir = TestFolder::new();
    let sparse = |place: u8| {
        let mut glb = Glb::default();
        let points = glb.floats("VEC3", 3, &TRIANGLE);
        let places = glb.store("SCALAR", 5121, 1, &[place]);
        let up = glb.floats("VEC3", 3, &[0.0, 0.0, 1.0]);
        // The accessors themselves are of no use: what is sparse names views.
        let target = glb.accessors.len();
        let mut moved = json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": {
            "count": 1,
            "indices": { "bufferView": places, "componentType": 5121 },
            "values": { "bufferView": up },
        }});
        glb.accessors.push(moved.clone());
        // Where there is a view, its elements are those of the others.
        moved["bufferView"] = json!(points);
        glb.accessors.push(moved);
        // Neither a view nor what is sparse: Blender's key that moves nothing.
        let none = json!({ "componentType": 5126, "count": 3, "type": "VEC3" });
        glb.accessors.push(none);
        glb.finish(json!({
            "nodes": [{ "name": "leaf", "mesh": 0, "weights": [0.5, 1.0] }],
            "meshes": [{ "primitives": [{
                "attributes": { "POSITION": target + 1 },
                "targets": [{ "POSITION": target }, { "POSITION": target + 2 }],
            }] }],
        }))
    };
    dir.write("leaf.glb", sparse(2));
    let leaf = dir.read(STILL).unwrap();
    let expected = [DVec3::ZERO, DVec3::X, DVec3::Z * 1.5];
    assert_near(&at(&leaf, 0.0), &expected, 1e-12);
    dir.write("leaf.glb", sparse(3));
    says(dir.problem(STILL), &["with an element 3 of 3"]);
}

/// A strip of two quads along x, split along its middle as a seam splits it, bound to an upper and
/// a lower joint; the second turns by 90° about z, through x = 1.
fn skinned(edit: impl Fn(&mut Value)) -> Vec<u8> {
    let mut glb = Glb::default();
    let xs = [0.0_f32, 1.0, 1.0, 2.0];
    let places = xs.map(|x| [x, 0.0, 0.0, x, 0.0, 1.0]);
    let points = glb.floats("VEC3", 3, places.as_flattened());
    let faces = [0, 1, 2, 2, 1, 3, 4, 5, 6, 6, 5, 7];
    let indices = glb.store("SCALAR", 5121, 12, &faces);
    let joints = glb.store("VEC4", 5121, 8, &[0, 1, 0, 0].repeat(8));
    // Left points go with the first, right ones with the second, the middle with both.
    let shares = [[1.0, 0.0], [0.5, 0.5], [0.5, 0.5], [0.0, 1.0]];
    let weights = shares.map(|[a, b]| [a, b, 0.0, 0.0, a, b, 0.0, 0.0]);
    let weights = glb.floats("VEC4", 4, weights.as_flattened());
    // The bind: the first joint at the origin, the second at x = 1.
    let mut binds = [0.0_f32; 32];
    for k in [0, 5, 10, 15] {
        binds[k] = 1.0;
        binds[16 + k] = 1.0;
    }
    binds[28] = -1.0;
    let binds = glb.floats("MAT4", 16, &binds);
    let times = glb.floats("SCALAR", 1, &[0.0, 1.0]);
    let half = 0.5_f32.sqrt();
    let turns = glb.floats("VEC4", 4, &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]);
    let mut json = json!({
        "nodes": [
            // The place of a node with a skin does not count.
            { "name": "strip", "mesh": 0, "skin": 0, "translation": [7, 7, 7] },
            { "name": "upper", "children": [2], "translation": [0, 3, 0] },
            { "name": "lower", "translation": [1, 0, 0] },
        ],
        "meshes": [{ "primitives": [{
            "attributes": { "POSITION": points, "JOINTS_0": joints, "WEIGHTS_0": weights },
            "indices": indices,
        }] }],
        "skins": [{ "joints": [1, 2], "inverseBindMatrices": binds }],
        "animations": [{
            "name": "bend",
            "samplers": [{ "input": times, "output": turns }],
            "channels": [{ "sampler": 0, "target": { "node": 2, "path": "rotation" } }],
        }],
    });
    edit(&mut json);
    glb.finish(json)
}

#[test]
fn skins_go_with_their_joints_and_seams_are_closed() {
    let dir = TestFolder::new();
    dir.write("leaf.glb", skinned(|_| {}));
    let strip = dir.read(MOVING).unwrap();
    assert_eq!((strip.point_count(), strip.faces().len()), (6, 4));
    for (time, share) in [(0.0, 0.0), (0.5, 0.5), (1.0, 1.0)] {
        let turn = DQuat::from_rotation_z(share * FRAC_PI_2);
        let second = |p: DVec3| DVec3::X + turn * (p - DVec3::X);
        let place = |x: f64, z: f64| {
            let p = DVec3::new(x, 0.0, z);
            let moved = match x {
                0.0 => p,
                1.0 => 0.5 * p + 0.5 * second(p),
                _ => second(p),
            };
            moved + DVec3::Y * 3.0
        };
        let expected = [0.0, 1.0, 2.0].map(|x| [place(x, 0.0), place(x, 1.0)]);
        assert_near(&at(&strip, time), expected.as_flattened(), 1e-6);
    }
}

#[test]
fn points_that_part_are_not_welded() {
    let dir = TestFolder::new();
    // Two triangles that share a side at the start; the second rises.
    let mut points = TRIANGLE.repeat(2);
    points[17] = 1.0;
    let mut rise = [0.0; 18];
    for height in [11, 14, 17] {
        rise[height] = 2.0;
    }
    let (glb, json) = leaf(&points, &[&rise], "LINEAR", &[0.0, 1.0]);
    dir.write("leaf.glb", glb.finish(json));
    assert_eq!(dir.read(MOVING).unwrap().point_count(), 6);
    assert_eq!(dir.read(STILL).unwrap().point_count(), 4);
}

#[test]
fn what_is_damaged_is_named() {
    let dir = TestFolder::new();
    let two = |json: &mut Value| {
        let first = json["animations"][0].clone();
        json["animations"].as_array_mut().unwrap().push(first);
    };
    let unweighted = |json: &mut Value| {
        let attributes = &mut json["meshes"][0]["primitives"][0]["attributes"];
        attributes.as_object_mut().unwrap().remove("WEIGHTS_0");
    };
    let targets = |json: &mut Value| {
        json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(3);
    };
    let several = "several animations: choose one by `animation`, of [bend, bend]";
    let short = morphed("LINEAR", &[0.0, 1.0, 0.0], |_| {});
    let scalars = morphed("LINEAR", &[0.0; 4], targets);
    let others = [
        (skinned(two), several),
        (skinned(unweighted), "joints and weights for 0 points of 8"),
        (
            short,
            "mesh 0: the animation of its weights has another number of values",
        ),
        (scalars, "accessor 3: expected VEC3"),
    ];
    let edits = r#"
        /animations | [] | nothing in it moves
        /skins/0/joints | [1] | skin 0: has 2 matrices for 1 joints
        /skins/0/joints | [1, 9] | skin 0: its joint is node 9, of 3
        /nodes/0/skin | 4 | skin 4: there is none
        /meshes/0/primitives/0/attributes/WEIGHTS_0 | 9 | accessor 9
    "#;
    let edited = table(edits).into_iter().map(|[place, value, named]| {
        let value: Value = serde_json::from_str(value).unwrap();
        let edit = |json: &mut Value| *json.pointer_mut(place).unwrap() = value.clone();
        (skinned(edit), named)
    });
    let cases = others.into_iter().chain(edited);
    for (bytes, named) in cases {
        dir.write("leaf.glb", bytes);
        let problem = dir.problem(MOVING);
        assert!(problem.starts_with("obstacles[\"leaf\"]"), "{problem}");
        says(problem, &["leaf.glb", named]);
    }
}
