//! Motions of obstacles: keyframes, nodes, and points of files.

use glam::{DQuat, DVec3};
use selvedge_cloth::ObstaclePath;

use super::{TestFolder, assert_near, at, frames};
use crate::formats::npz::tests::{archive, floats};
use crate::test_help::{says, table};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// The triangle `height` higher.
fn raised(height: f64) -> Vec<DVec3> {
    moved(&[DVec3::ZERO, DVec3::X, DVec3::Y], DVec3::Z * height)
}

/// These points, shifted.
fn moved(points: &[DVec3], by: DVec3) -> Vec<DVec3> {
    points.iter().map(|p| *p + by).collect()
}

fn numbers(frames: &[Vec<DVec3>]) -> Vec<f64> {
    frames.iter().flatten().flat_map(|p| p.to_array()).collect()
}

#[test]
fn keyframes_move_a_body_smoothly_and_then_it_rests() {
    let dir = TestFolder::new();
    let text = "name = \"b\"\nbox = { size = [1, 1, 1] }\ntransform = { translation = [0, 1, 0] }\n\
        motion = { keyframes = [{ time = 1.0, translation = [2, 0, 0], rotation_deg = 90 }] }";
    let cube = dir.read(text).unwrap();
    let start = at(&cube, 0.0);
    // Halfway in time is halfway; at a quarter the cubic is at 5/32.
    for (time, share) in [(0.5, 0.5), (0.25, 0.15625), (1.0, 1.0), (7.0, 1.0)] {
        let centre = DVec3::Y;
        let turn = DQuat::from_rotation_y(share * std::f64::consts::FRAC_PI_2);
        let place = |p: &DVec3| centre + turn * (*p - centre) + DVec3::X * 2.0 * share;
        let expected: Vec<DVec3> = start.iter().map(place).collect();
        assert_near(&at(&cube, time), &expected, 1e-12);
    }
    let about = "axis = [0, 0, 2], centre = [0, 0, 0], keyframes =";
    let text = text.replace("keyframes =", about);
    let about = dir.read(&text).unwrap();
    let turn = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    let expected: Vec<DVec3> = start.iter().map(|p| turn * *p + DVec3::X * 2.0).collect();
    assert_near(&at(&about, 1.0), &expected, 1e-12);
    let cases = r#"
        time = 1.0 | time = -1.0 | time must be
        translation = [2 | translation = [2e9 | translation must be
        }] } | }], file = "a.pc2" } | keep one
    "#;
    for [from, to, named] in table(cases) {
        says(dir.problem(&text.replace(from, to)), &[named]);
    }
}

#[test]
fn a_cache_and_an_archive_move_points_alike() {
    let dir = TestFolder::new();
    dir.write("t.obj", TRIANGLE);
    let expected = [raised(0.0), raised(0.5), raised(2.0)];
    let mut cache = b"POINTCACHE2\0".to_vec();
    cache.extend([1_i32, 3].iter().flat_map(|n| n.to_le_bytes()));
    cache.extend([0_f32, 1.0].iter().flat_map(|n| n.to_le_bytes()));
    cache.extend(3_i32.to_le_bytes());
    let singles = numbers(&expected).into_iter().map(|n| n as f32);
    cache.extend(singles.flat_map(f32::to_le_bytes));
    dir.write("t.pc2", &cache);
    let points = floats("(3, 3, 3)", &numbers(&expected));
    dir.write("t.npz", archive(&[("points", points.clone())]));
    let rate = floats("(1,)", &[24.0]);
    let rated = archive(&[("positions", points), ("fps", rate)]);
    dir.write("rated.npz", rated);
    let moving = |motion: &str| {
        let text = format!("name = \"t\"\nmesh = \"t.obj\"\nmotion = {motion}");
        dir.read(&text).unwrap()
    };
    for (motion, rate) in [
        ("\"t.pc2\"", 60.0),
        ("\"t.npz\"", 60.0),
        ("\"rated.npz\"", 24.0),
        ("{ file = \"t.pc2\", rate = 30 }", 30.0),
    ] {
        let moving = moving(motion);
        assert_eq!(frames(&moving), (rate, &expected[..]), "{motion}");
        assert_near(&at(&moving, 1.5 / rate), &raised(1.25), 1e-15);
    }
    let late = moving("{ file = \"t.npz\", rate = 10, from = 0.1 }");
    assert_eq!(frames(&late).1, &expected[1..]);
    let placed = moving("\"t.npz\"\ntransform = { scale = 2 }");
    let twice: Vec<DVec3> = raised(2.0).iter().map(|p| *p * 2.0).collect();
    assert_eq!(at(&placed, 9.0), twice);
}

#[test]
fn motions_that_do_not_fit_are_named() {
    let dir = TestFolder::new();
    dir.write("t.obj", TRIANGLE);
    let mut wild = numbers(&[raised(0.0)]);
    wild[4] = f64::INFINITY;
    for (name, shape, values) in [
        ("quad.npz", "(1, 4, 3)", &[0.5; 12][..]),
        ("wild.npz", "(1, 3, 3)", &wild),
        ("flat.npz", "(1, 3, 3)", &[0.5; 9]),
    ] {
        dir.write(name, archive(&[("positions", floats(shape, values))]));
    }
    dir.write("short.pc2", b"POINTCACHE2\0");
    dir.write("x.fbx", b"");
    dir.write("leaf.usda", STAGE);
    let cases = r#"
        "u.pc2" | u.pc2 could not be read
        "quad.npz" | frame 0 has 4 points, but the mesh has 3
        "wild.npz" | point 1 of frame 0 is not finite
        "flat.npz" | face 0 has no area
        "short.pc2" | short.pc2: ends at byte 12
        "x.fbx" | must end in .pc2
        "t.obj" | must end in .pc2
        { file = "quad.npz", rate = 0 } | rate must be
        { file = "quad.npz", from = -1.0 } | from must not
        { file = "quad.npz", from = 9.0 } | from is after its end
        { file = "quad.npz", animation = "w" } | only a .glb has
        { node = "a" } | names a node but no file
        { file = "leaf.usda", node = "roof" } | no node called "roof"
        { file = "quad.npz", axis = [0, 1, 0] } | axis and centre are for
    "#;
    for [motion, named] in table(cases) {
        let text = format!("name = \"t\"\nmesh = \"t.obj\"\nmotion = {motion}");
        let problem = dir.problem(&text);
        assert!(problem.starts_with("obstacle"), "{problem}");
        says(problem, &[named]);
    }
}

const STAGE: &str = "#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Y\"\n    \
    timeCodesPerSecond = 24\n)\ndef Xform \"root\"\n{\n    \
    double3 xformOp:translate.timeSamples = {\n        0: (0, 0, 0),\n        24: (1, 0, 0),\n    }\n    \
    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n    \
    def Mesh \"leaf\"\n    {\n        int[] faceVertexCounts = [3]\n        \
    int[] faceVertexIndices = [0, 1, 2]\n        \
    point3f[] points.timeSamples = {\n            0: [(0, 0, 0), (1, 0, 0), (0, 1, 0)],\n            \
    12: [(0, 0, 2), (1, 0, 2), (0, 1, 2)],\n        }\n    }\n}\n";

#[test]
fn samples_of_a_stage_move_points_with_their_prims() {
    let dir = TestFolder::new();
    dir.write("leaf.usda", STAGE);
    let text = "name = \"leaf\"\nmesh = \"leaf.usda\"\nmotion = \"leaf.usda\"";
    let leaf = dir.read(text).unwrap();
    let (rate, made) = frames(&leaf);
    assert_eq!((rate, made.len()), (60.0, 61));
    for (time, height) in [(0.0, 0.0), (0.25, 1.0), (0.5, 2.0), (1.0, 2.0)] {
        let expected = moved(&raised(height), DVec3::X * time);
        assert_near(&at(&leaf, time), &expected, 1e-12);
    }
    let still = dir.read("name = \"leaf\"\nmesh = \"leaf.usda\"").unwrap();
    assert!(still.is_still());
    dir.write("leaf.usda", STAGE.replace("(1, 0, 2), ", ""));
    let problem = dir.problem(text);
    says(&problem, &["2 points at time code 12 and 3 at the first"]);
    dir.write("leaf.usda", STAGE.replace("12: [", "0: ["));
    says(dir.problem(text), &["times that do not ascend"]);
}

#[test]
fn what_follows_a_node_that_begins_later_than_its_file_rests_until_then() {
    let dir = TestFolder::new();
    let late = STAGE.split_once("def ").unwrap().1;
    let late = late
        .replace("24: (1", "48: (1")
        .replace(" 0: (0", " 24: (0");
    let late = late.replace("12: [", "36: [").replace(" 0: [", " 24: [");
    let late = format!("def {}", late.replace("root", "late"));
    let both = format!("{STAGE}{late}");
    let (header, _) = STAGE.split_once("def ").unwrap();
    let alone = format!("{header}{late}");
    let begun = alone.replacen("(\n", "(\n    startTimeCode = 0\n", 1);
    let ball = "name = \"b\"\nsphere = { radius = 0.2 }\nmotion = { file = \"leaf.usda\", node = \"late\" }";
    for (stage, wait) in [(&both, 1.0), (&begun, 1.0), (&alone, 0.0)] {
        dir.write("leaf.usda", stage);
        let ball = dir.read(ball).unwrap();
        assert!(matches!(ball.path(), ObstaclePath::Rigid(_)));
        let rest = at(&ball, 0.0);
        assert_near(&at(&ball, wait), &rest, 1e-12);
        let expected = moved(&rest, DVec3::X * 0.5);
        assert_near(&at(&ball, wait + 0.5), &expected, 1e-12);
    }
    dir.write("leaf.usda", begun);
    let leaf = dir.read("name = \"leaf\"\nmesh = \"leaf.usda\"\nmotion = \"leaf.usda\"");
    let leaf = leaf.unwrap();
    assert_near(&at(&leaf, 1.0), &raised(0.0), 1e-12);
    let placed = moved(&raised(1.0), DVec3::X * 0.25);
    assert_near(&at(&leaf, 1.25), &placed, 1e-12);
}
