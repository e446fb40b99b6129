//! Scenes as ARCSim writes them, and every way in which they can be wrong.

use std::path::PathBuf;

use glam::DVec3;
use selvedge_cloth::{HandleConstraint, PhysicsMode, PhysicsSettings, VertexId};
use tempfile::TempDir;

use super::super::file::read_scene;
use super::super::loaded::LoadedScene;
use super::super::spec::StartSpec;
use crate::test_help::{refuses, says, table};

/// A unit square of two faces, its upper edge held.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";

const SCENE: &str = r#"// A comment, as ARCSim's own scenes have them.
{
    "frame_time": 0.04,
    "frame_steps": 8, /* dt = 5 ms */
    "end_time": 2,
    "cloths": [{
        "mesh": "square.obj",
        "transform": {"scale": 0.5, "rotate": [-90, 0, 1, 0], "translate": [0, 0, -0.5]},
        "materials": [{"data": "felt.json", "thicken": 2, "density_mult": 1.5, "stretching_mult": 3,
            "bending_mult": 5, "damping": 0.001}],
        "remeshing": {"refine_angle": 0.3, "size": [0.01, 0.2]}
    }],
    "handles": [{"nodes": [3]}, {"nodes": [2], "motion": 0, "end_time": 70}],
    "motions": [[
        {"time": 0, "transform": {"translate": [0, 0, 0]}},
        {"time": 1, "transform": {"translate": [1, 0, 0], "rotate": [90, 0, 1, 0]}}
    ]],
    "gravity": [0, -9.8, 0],
    "wind": {"velocity": [0, 0, 1], "density": 1.2, "drag": 0.1},
    "disable": ["proximity", "collision", "strainlimiting", "remeshing", "separation", "popfilter", "plasticity"],
    "magic": {"repulsion_thickness": 1e-3},
    "friction": 0.6
}"#;

const FELT: &str = r#"{"density": 0.2,
    "stretching": [[1,2,3,4],[5,6,7,8],[9,10,11,12],[13,14,15,16],[17,18,19,20],[21,22,23,-24]],
    "bending": [[1e-6,2e-6,3e-6,4e-6,5e-6],[1e-6,2e-6,3e-6,4e-6,5e-6],[1e-6,2e-6,3e-6,4e-6,6e-6]]}"#;

struct TestFolder(TempDir);

impl TestFolder {
    fn new() -> Self {
        let dir = Self(tempfile::tempdir().unwrap());
        dir.write("square.obj", SQUARE);
        dir.write("felt.json", FELT);
        dir
    }

    fn write(&self, name: &str, text: &str) -> PathBuf {
        let path = self.0.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    }

    fn read(&self, text: &str) -> Result<LoadedScene, String> {
        read_scene(&self.write("swing.json", text)).map_err(|error| {
            let text = error.to_string();
            assert!(text.contains("swing.json"), "{text}");
            text
        })
    }

    /// `text` with `to` in the place of `from`.
    fn edited(&self, text: &str, from: &str, to: &str) -> Result<LoadedScene, String> {
        let edited = text.replacen(from, to, 1);
        assert_ne!(edited, text, "{from}");
        self.read(&edited)
    }
}

#[test]
fn everything_of_a_scene_is_read() {
    let dir = TestFolder::new();
    let LoadedScene {
        spec,
        scene,
        warnings,
        files,
        ..
    } = dir.read(SCENE).unwrap();
    assert_eq!(warnings, [""; 0]);
    let names = ["felt.json", "square.obj", "swing.json"];
    assert_eq!(files, names.map(|name| dir.0.path().join(name)));
    assert_eq!((scene.name.as_str(), scene.frame_rate), ("swing", 25.0));
    assert_eq!(spec.start, StartSpec::Mesh);
    let physics = PhysicsSettings {
        substeps: 8,
        ..PhysicsSettings::in_mode(PhysicsMode::Arcsim)
    };
    assert_eq!(scene.physics, physics);
    assert_eq!(scene.physics.handles, HandleConstraint::Spring);
    assert_eq!(scene.frame_count(), Ok(50));
    // Half as large, x to z, moved; the material coordinates shrink too.
    let corner = scene.mesh.positions()[2];
    assert!(corner.distance(DVec3::Y * 0.5) < 1e-15, "{corner}");
    assert_eq!(scene.mesh.material_coordinates()[2].x, 0.5);
    let (density, damping) = (scene.material.density, scene.material.damping);
    assert!((density - 0.2 * 2.0 * 1.5).abs() < 1e-15 && damping == 0.001);
    assert_eq!(scene.material.stretch.0[5][3], -24.0 * 6.0);
    assert!((scene.material.bend.0[2][4] - 6e-5).abs() < 1e-19);
    let air = scene.environment;
    assert_eq!((air.gravity.y, air.wind.z), (-9.8, 1.0));
    assert_eq!((air.air_density, air.air_drag), (1.2, 0.1));
    assert_eq!(scene.handles.vertices(), [3, 2].map(VertexId));
    assert_eq!(spec.build(dir.0.path()).unwrap(), scene);
}

#[test]
fn a_run_starts_with_the_velocities_of_its_mesh() {
    let dir = TestFolder::new();
    let moving = SQUARE.replace("v 1 0 0\n", "v 1 0 0\nnv 0 0 2\n");
    dir.write("square.obj", &moving);
    let loaded = dir.read(SCENE).unwrap();
    // Half as large and turned by -90° about y: +z becomes -x.
    let state = loaded.state.unwrap();
    assert!(state.velocities[1].distance(DVec3::new(-1.0, 0.0, 0.0)) < 1e-15);
    assert_eq!(state.velocities[0], DVec3::ZERO);
    assert_eq!(state.positions, loaded.scene.mesh.positions());
}

#[test]
fn handles_go_with_their_motions_from_the_first_solve() {
    let dir = TestFolder::new();
    let scene = dir.read(SCENE).unwrap().scene;
    let path = scene.handle_path().unwrap();
    let start = scene.handles.select(scene.mesh.positions());
    let first = path.at(0.005);
    assert!(first[1].distance(start[1]) < 1e-15);
    for time in [0.3, 1.0, 2.0] {
        assert_eq!(path.at(time)[0], start[0]);
    }
    // At the end T(1) T(0.005)⁻¹: what the transform of the first solve is, by the formula of the
    // spline between level ends, s = 0.005.
    let share = 0.005 * 0.005 * (3.0 - 2.0 * 0.005);
    let half = std::f64::consts::FRAC_PI_4;
    let turned = |angle: f64, p: DVec3| {
        let (sine, cosine) = angle.sin_cos();
        DVec3::new(p.x * cosine + p.z * sine, p.y, p.z * cosine - p.x * sine)
    };
    // The quaternion's parts, (1, 0) to (cos, sin) of 45°, are blended and normalised.
    let angle = 2.0 * (share * half.sin()).atan2(1.0 - share + share * half.cos());
    let taken_back = turned(-angle, start[1] - DVec3::X * share);
    let expected = turned(2.0 * half, taken_back) + DVec3::X;
    assert!(path.at(2.0)[1].distance(expected) < 1e-14);
}

#[test]
fn handles_let_go() {
    let dir = TestFolder::new();
    let scene = dir.edited(SCENE, "70", "1.2").unwrap().scene;
    let path = scene.handle_path().unwrap();
    for (frame, holds) in [(0, true), (29, true), (30, false)] {
        let targets = path.targets(frame, 8).unwrap();
        let found = [targets.holds(0), targets.holds(1)];
        assert_eq!(found, [true, holds], "{frame}");
    }
}

#[test]
fn what_has_no_effect_is_named() {
    let dir = TestFolder::new();
    // A sheet of two metres whose texture coordinates run from 0 to 1.
    let double = SQUARE.replace("v 1", "v 2").replace(" 1 0\n", " 2 0\n");
    dir.write("double.obj", &double.replace("vt 2 0", "vt 1 0"));
    let cases = r#"
        "remeshing", "sep | "sep | remeshing is not disabled
        "proximity",  |  | disable: collision has no effect
        "friction" | "obstacles": [{"mesh": "a"}, {"mesh": "b"}], "friction" | obstacles are left out, 2 of them: proximity and collision are disabled
        "end_time": 2, |  | neither end_time nor end_frame
        square.obj | double.obj | half of the edges start at 2.000 × their material length or more
        felt.json | materials/11oz-black-denim.json | the shipped material 11oz-black-denim
    "#;
    for [from, to, warning] in table(cases) {
        let warnings = dir.edited(SCENE, from, to).unwrap().warnings;
        let is_told = warnings.len() == 1 && warnings[0].contains(warning);
        assert!(is_told, "{to}: {warnings:?}");
    }
    let keys = [
        ("plasticity", "\"yield_curv\": 200, \"weakening\": 2"),
        ("strainlimiting", "\"strain_limits\": [0.95, 1.05]"),
    ];
    for (part, key) in keys {
        let used = format!("{key}, \"thicken\"");
        let edited = |text| dir.edited(text, "\"thicken\"", &used).unwrap().warnings;
        assert_eq!(edited(SCENE).len(), 0);
        let text = SCENE.replace(&format!("\"{part}\""), "\"fracture\"");
        let warnings = edited(&text);
        assert!(warnings[0].contains(&format!("{part} is not disabled")));
    }
}

#[test]
fn unknown_keys_and_wrong_values_are_errors_that_name_file_and_key() {
    let dir = TestFolder::new();
    let cases = r#"
        "gravity" | "glow": 1, "gravity" | unknown field `glow`
        "thicken" | "sheen": 1, "thicken" | cloths[0].materials[0].sheen: unknown field `sheen`
        "nodes": [3] | "nodes": [3], "start_time": 2 | handles[0].start_time: unknown field `start_time`
        "time": 1, | "time": 1, "velocity": {}, | motions[0][1].velocity: unknown field `velocity`
        "repulsion_thickness" | "handle_stiffness": 1e6, "repulsion_thickness" | magic.handle_stiffness: unknown field
        "popfilter" | "poppfilter" | disable[5]: unknown variant `poppfilter`, expected one of
        "frame_time": 0.04, |  | missing field `frame_time`
        0.04 | -1 | frame_time: must be between 0.00001 and 1, found -1
        "frame_steps": 8 | "frame_steps": 0 | frame_steps: must be between 1 and 1000, found 0
        "frame_steps": 8 | "frame_steps": "four" | frame_steps: invalid type: string "four"
        "stretching_mult": 3 | "stretching_mult": -3 | cloths[0].materials[0].stretching_mult: must be between 0.000001 and 1000000, found -3
        "bending_mult": 5 | "bending_mult": -5 | cloths[0].materials[0].bending_mult: must be
        "thicken": 2 | "thicken": 0 | cloths[0].materials[0].thicken: must be
        "density_mult": 1.5 | "density_mult": 1e300 | cloths[0].materials[0].density_mult: must be
        "damping": 0.001 | "damping": 1e9 | cloths[0].materials[0].damping: must be between 0 and 100, found 1000000000
        "velocity": [0, 0, 1] | "velocity": [0, 0, 1e7] | the length of wind.velocity: must be between 0 and 1000
        "density": 1.2 | "density": -1.2 | wind.density: must be
        "end_time": 70 | "end_time": 0 | handles[1].end_time: must be later than the start, or the handle never holds, found 0
        "friction": 0.6 | "friction": 0.6, "wind": {} | duplicate field `wind`
        "thicken": 2 | "thicken": 2, "thicken": 3 | duplicate field `thicken`
        square.obj | cube.obj | cloths[0].mesh: must be an OBJ file
        felt.json | silk.json | cloths[0].materials[0].data: there is no file silk.json
        "thicken": 2 | "thicken": "two" | cloths[0].materials[0].thicken: invalid type: string "two"
        "damping": 0.001}], | "damping": 0.001}, {"data": "felt.json"}], | cloths[0].materials: must have one material, that of all faces, found 2
        [-90, 0, 1, 0] | [-90, 0, 1] | cloths[0].transform.rotate: invalid length 3
        [-90, 0, 1, 0] | [-90, 0, 0, 0] | cloths[0].transform.rotate: must be degrees and an axis
        "nodes": [2] | "nodes": [2.5] | handles[1].nodes[0]: invalid type: floating point `2.5`
        "nodes": [2] | "nodes": [9] | vertex 9
        "motion": 0 | "motion": 1 | handles[1].motion: must be one of the 1 motions
        "time": 1, | "time": 0, | groups[0].keyframes[1].time must be later
        [0, -9.8, 0] | -9.8 | gravity: invalid type: floating point `-9.8`
        "friction": 0.6 | "friction": 0.6, | is no JSON
    "#;
    refuses(cases, |from, to| dir.edited(SCENE, from, to));
    for (from, to, named) in [
        (",4e-6,6e-6]", "]", "bending[2]: invalid length 3"),
        ("0.2", "-0.2", "density: must be between"),
    ] {
        dir.write("felt.json", &FELT.replace(from, to));
        let named = format!("materials[0].data: felt.json: {named}");
        says(dir.read(SCENE).unwrap_err(), &[&named]);
    }
}

/// The scene with contact and two obstacles.
fn with_bodies() -> String {
    let bodies = r#""obstacles": [
        {"mesh": "square.obj", "transform": {"translate": [0, -1, 0]}},
        {"mesh": "square.obj", "transform": {"scale": 2}, "motion": 0}
    ], "obs_friction": 0.2, "friction""#;
    SCENE
        .replace("\"proximity\", \"collision\", ", "")
        .replace("\"friction\"", bodies)
        .replace("_thickness\": 1e-3", "_thickness\": 2e-3")
}

#[test]
fn obstacles_move_with_their_motions_and_contact_has_their_numbers() {
    let dir = TestFolder::new();
    let loaded = dir.read(&with_bodies()).unwrap();
    let scene = &loaded.scene;
    let contact = scene.contact.unwrap();
    assert_eq!((contact.thickness, contact.friction), (2e-3, 0.6));
    assert!(contact.self_contact);
    let [still, moving] = scene.obstacles.as_slice() else {
        panic!("{:?}", scene.obstacles);
    };
    assert!(still.is_still() && still.friction() == 0.2);
    let first: Vec<DVec3> = still.positions_at(0.0).collect();
    assert_eq!(first[2], DVec3::new(1.0, 0.0, 0.0));
    // Twice as large, then turned by a quarter about y and moved: T(1) p, not relative to a start.
    let end: Vec<DVec3> = moving.positions_at(1.0).collect();
    let expected = DVec3::new(1.0, 2.0, -2.0);
    assert!(end[2].distance(expected) < 1e-12, "{}", end[2]);
    let start: Vec<DVec3> = moving.positions_at(0.0).collect();
    assert!(start[2].distance(DVec3::new(2.0, 2.0, 0.0)) < 1e-12);
    assert_eq!(loaded.warnings, [""; 0]);
    assert_eq!(loaded.spec.build(dir.0.path()).unwrap(), loaded.scene);
    // One that grows moves point by point.
    let moved = "\"translate\": [1, 0, 0],";
    let grows = format!("{moved} \"scale\": 3,");
    let loaded = dir.edited(&with_bodies(), moved, &grows).unwrap();
    let end: Vec<DVec3> = loaded.scene.obstacles[1].positions_at(2.0).collect();
    let expected = DVec3::new(1.0, 6.0, -6.0);
    assert!(end[2].distance(expected) < 1e-12, "{}", end[2]);
}

#[test]
fn obstacles_and_contact_that_cannot_be_read_are_named() {
    let dir = TestFolder::new();
    let wrong = r#"
        "square.obj", "transform": {"scale": 2} | "gone.obj" | obstacles[1].mesh: must be an OBJ
        "scale": 2}, "motion": 0 | "scale": 2}, "motion": 4 | obstacles[1].motion: must be one of the 1 motions
        "scale": 2}, | "scale": 2}, "end_time": 1, | obstacles[1].end_time: unknown field `end_time`
        "scale": 2} | "scale": -2} | obstacles["obstacle 1"].transform: scale must be
        "obs_friction": 0.2 | "obs_friction": -1 | obs_friction: must be between 0 and 100
        2e-3 | 2e3 | magic.repulsion_thickness: must be between
    "#;
    refuses(wrong, |from, to| dir.edited(&with_bodies(), from, to));
    let cases = r#"
        "repulsion_thickness" | "collision_stiffness": 1e6, "repulsion_thickness" | magic.collision_stiffness has no effect
        "obs_friction": 0.2 | "obs_friction": 0.9 | a pair has the lesser of two
    "#;
    for [from, to, warning] in table(cases) {
        let warnings = dir.edited(&with_bodies(), from, to).unwrap().warnings;
        let is_told = warnings.iter().any(|w| w.contains(warning));
        assert!(is_told, "{to}: {warnings:?}");
    }
}

#[test]
fn comments_are_blanks_and_strings_are_left_alone() {
    let text = "{\"a//b\": /* \"x\n */ \"c\\\" /*\", // end\n\"d\": 1}";
    let plain = "{\"a//b\":      \n    \"c\\\" /*\",       \n\"d\": 1}";
    assert_eq!(super::without_comments(text), plain);
}
