//! Scene files and presets: what is shipped is usable, what is resolved survives JSON, and every
//! mistake is an error that names the file and the field.

use std::path::Path;

use glam::{DVec2, DVec3};
use selvedge_cloth::motion::named;
use selvedge_cloth::{Motion, RecordedMotion};
use selvedge_data::{
    DatasetPreset, LoadedScene, SceneSpec, materials, open_material, open_scene, parse_scene,
    read_scene, shipped_presets, shipped_scenes,
};

use crate::help::{refuses, says};

const SCENE: &str = r#"
name = "s"
material = "gray-interlock"
frame_rate = 30
mesh = { generator = { kind = "square", vertices = 36, size = 1, seed = 1 } }
handles = { label = "upper-corners" }
motion = { named = "forward" }
physics = { substeps = 2 }
"#;

fn parse(text: &str) -> Result<LoadedScene, String> {
    parse_scene(text, Path::new(""), "s.toml").map_err(|error| {
        let text = error.to_string();
        assert!(text.starts_with("s.toml: "), "{text}");
        text
    })
}

/// The scene with `from` replaced.
fn edited(from: &str, to: &str) -> Result<LoadedScene, String> {
    assert!(SCENE.contains(from), "{from}");
    parse(&SCENE.replace(from, to))
}

#[test]
fn shipped_materials_scenes_and_presets_are_usable() {
    for (name, _) in materials() {
        let material = open_material(name).unwrap();
        assert_eq!(material.name, *name);
        assert!(!material.source.is_empty(), "{name}");
    }
    for (name, _) in shipped_scenes() {
        assert_eq!(open_scene(name).unwrap().scene.name, *name);
    }
    for (name, _) in shipped_presets() {
        let preset = DatasetPreset::open(name).unwrap();
        assert_eq!(preset.config().name, *name);
    }
    let scene = open_scene("default").unwrap().scene;
    assert_eq!(scene.mesh.topology().vertex_count(), 400);
    assert_eq!(scene.frame_count().unwrap(), 1260);
}

#[test]
fn a_cloth_in_another_unit_is_warned_of_with_the_remedy() {
    let sized = |size: &str, transform: &str| {
        let text = SCENE.replace("size = 1,", &format!("size = {size},"));
        let scaled = format!("seed = 1 }}, transform = {{ {transform} }} }}");
        parse(&text.replace("seed = 1 } }", &scaled))
    };
    for (size, transform, expected) in [
        ("600", "", "600.0000 m long, more than 20 m"),
        ("0.005", "", "less than 1 cm"),
        ("1", "scale = 0.001", "less than 1 cm"),
    ] {
        let warnings = sized(size, transform).unwrap().warnings;
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        says(&warnings[0], &[expected, "mesh.transform.scale"]);
    }
    let meant = sized("600", "scale = 0.001").unwrap();
    assert_eq!(meant.warnings, [""; 0]);
    let both = sized("600", "scale = 0.001, material_scale = 0.001");
    let words = ["scale scales the pattern too", "leave material_scale out"];
    says(both.unwrap_err(), &words);
}

#[test]
fn handles_are_chosen_by_number_label_or_box() {
    let chosen = |handles: &str| {
        let scene = edited("{ label = \"upper-corners\" }", handles)?;
        Ok::<_, String>(scene.spec.setting.handles)
    };
    assert_eq!(chosen("{ vertices = [3, 0] }").unwrap(), [3, 0]);
    let corners = chosen("{ label = \"upper-corners\" }").unwrap();
    let upper = chosen("{ box = { min = [-1, -0.001, -2], max = [1, 1, 2] } }").unwrap();
    assert_eq!(upper, chosen("{ label = \"upper-edge\" }").unwrap());
    assert!(corners.iter().all(|corner| upper.contains(corner)));
    let cases = r#"
        label = "upper-corners" | vertices = [36] | handles: handle 0 is vertex 36
        label = "upper-corners" | vertices = [1, 1] | vertex 1 is named twice
        label = "upper-corners" | label = "top" | handles.label: the mesh has no label "top"; it has [boundary,
        label = "upper-corners" | box = { min = [5, 5, 5], max = [6, 6, 6] } | handles.box: no vertex
        label = "upper-corners" | vertices = [1], label = "boundary" | handles
    "#;
    refuses(cases, edited);
}

#[test]
fn every_shape_can_be_asked_for_by_vertices_or_by_density() {
    let square = "{ kind = \"square\", vertices = 36, size = 1, seed = 1 }";
    let shape = |numbers: &str| edited(square, numbers);
    // 200 vertices/m² on 0.75 · 1.2² m².
    let by_density = shape("{ kind = \"l-shape\", density = 200, size = 1.2, seed = 4 }").unwrap();
    assert_eq!(by_density.scene.mesh.topology().vertex_count(), 216);
    let by_count = shape("{ kind = \"l-shape\", vertices = 216, size = 1.2, seed = 4 }").unwrap();
    assert_eq!(by_density, by_count);
    let json = by_density.spec.to_json().unwrap();
    assert_eq!(SceneSpec::from_json(&json).unwrap(), by_density.spec);
    let cases = r#"
        vertices = 36, |  | `vertices` or `density`
        vertices = 36 | vertices = 9, density = 9 | not both
        vertices = 36 | density = -1 | density must be finite and positive, found -1
        vertices = 36 | density = 1e300 | vertices must be at most 1000000
    "#;
    refuses(cases, edited);
}

#[test]
fn mistakes_are_errors_that_name_file_and_field() {
    let cases = r#"
        frame_rate = 30 | framerate = 30 | unknown field `framerate`
        substeps = 2 | substep = 2 | unknown field `substep`
        substeps = 2 | substeps = 0 | physics.substeps must be between 1 and 1000
        frame_rate = 30 | frame_rate = 0 | frame_rate must be between
        seed = 1 | sead = 1 | unknown field `sead`
        "square" | "cube" | unknown variant `cube`
        vertices = 36 | vertices = 2 | mesh.generator: a sheet of this shape needs at least
        generator = { | obj = "a.obj", generator = { | has both a generator and a file
        "gray-interlock" | "gray" | material: "gray" is neither a .toml file nor one of
        "gray-interlock" | "no.toml" | material: no.toml: could not be read
        "forward" | "forwards" | motion.named: no motion is called "forwards"
        named = "forward" | file = "no.toml" | motion.file: no.toml: could not be read
        named = "forward" | recorded = "no.csv" | motion.recorded: no.csv: could not
        name = "s" |  | name: is missing
        label = "upper-corners" | label = "upper-corners", vertices = [3] | which vertices are handles in exactly one way: vertices, label, box or groups
        label = "upper-corners" |  | in exactly one way
        label = "upper-corners" | label = "upper-corners", released = [{ from = 1.0 }] | released belongs to a group: groups = [{
        label = "upper-corners" | lable = "upper-corners" | unknown field `lable`
    "#;
    refuses(cases, edited);
    let words = ["shipped are default, drape, poncho, square-1024, tablecloth"];
    says(open_scene("no-such-scene").unwrap_err(), &words);
    says(open_scene("").unwrap_err(), &["\"\": is neither"]);
}

/// A 2 m by 1 m rectangle in centimetres, texture coordinates from 0 to 1, in two groups.
const RECTANGLE: &str = "v 0 0 0\nv 200 0 0\nv 200 100 0\nv 0 100 0\n\
    vt 0 0\nvt 1 0\nvt 1 0.5\nvt 0 0.5\ng lower\nf 1/1 2/2 3/3\ng upper\nf 1/1 3/3 4/4\n";

#[test]
fn files_beside_the_scene_are_found_and_their_changes_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("sheet.obj", RECTANGLE);
    let mine = materials()[0].1.replace("gray-interlock", "mine");
    write("my.toml", &mine);
    let still = "kind = \"blocks\"\nblocks = [{ duration = 1.0 }]\n";
    write("still.toml", still);
    let scene = "name = \"r\"\nmaterial = \"my.toml\"\nhandles = { vertices = [3, 2] }\n\
        motion = { file = \"still.toml\" }\n[mesh]\nobj = \"sheet.obj\"\n[mesh.transform]\n\
        scale = 0.01\nmaterial_scale = 200\ntranslation = [0, 0, 5]\n\
        rotation = { axis = [0, 2, 0], angle_deg = -90 }\n";
    write("scene.toml", scene);
    let path = folder.path().join("scene.toml");
    let loaded = read_scene(&path).unwrap();
    assert_eq!(loaded.scene.material.name, "mine");
    assert_eq!(loaded.scene.motion, Motion::still(1.0));
    let mesh = &loaded.scene.mesh;
    // Rounding of a turn by a quarter on numbers of size 7.
    assert!(mesh.positions()[2].distance(DVec3::new(0.0, 1.0, 7.0)) < 1e-14);
    assert!(mesh.material_coordinates()[2].distance(DVec2::new(2.0, 1.0)) < 1e-14);
    assert_eq!(loaded.spec.build(folder.path()).unwrap(), loaded.scene);

    let cases = r#"
        material_scale = 200\n |  | mesh.pattern = "shape"
        material_scale = 200\n |  | mesh.transform.material_scale
        scale = 0.01 | scale = 0.0 | mesh.transform.scale must be finite and positive
    "#;
    refuses(cases, |from, to| {
        write("scene.toml", &scene.replace(from, to));
        read_scene(&path).map_err(|error| error.to_string())
    });
    write("sheet.obj", &(RECTANGLE.to_owned() + "# changed\n"));
    let built = loaded.spec.build(folder.path());
    let words = ["has changed since the scene was resolved"];
    says(built.unwrap_err(), &words);
}

#[test]
fn recorded_motion_drives_the_handles() {
    let folder = tempfile::tempdir().unwrap();
    let loaded = parse(SCENE).unwrap();
    let start = loaded.scene.handles.select(loaded.scene.mesh.positions());
    let mut csv = "frame,handle,x,y,z\n".to_owned();
    for frame in 0..4 {
        for (handle, p) in start.iter().enumerate() {
            let p = *p + DVec3::X * f64::from(frame);
            csv += &format!("{frame},{handle},{},{},{}\n", p.x, p.y, p.z);
        }
    }
    std::fs::write(folder.path().join("r.csv"), csv).unwrap();
    let text = SCENE.replace("named = \"forward\"", "recorded = \"r.csv\"");
    let scene = parse_scene(&text, folder.path(), "s").unwrap().scene;
    assert_eq!(scene.frame_count().unwrap(), 3);
    let path = scene.handle_path().unwrap();
    assert_eq!(path.at(3.0 / 30.0)[1], start[1] + DVec3::X * 3.0);
}

#[test]
fn every_f64_of_a_resolved_scene_comes_back_bit_for_bit() {
    let loaded = parse(SCENE).unwrap();
    let mut spec = loaded.spec;
    assert_eq!(spec.build(Path::new("")).unwrap(), loaded.scene);
    let setting = &spec.setting;
    assert_eq!((setting.physics.substeps, setting.frame_rate), (2, 30.0));
    assert_eq!(spec.motion, named::by_name("forward").unwrap());
    // Numbers of all sizes whose digits fill the mantissa: a reader that is off by one unit in the
    // last place for one in ten of them cannot pass 2400.
    let number = |k: u32| f64::from(k).sqrt().mul_add(0.7, 1.0 / 3.0) * 10_f64.powi(k as i32 % 9);
    let positions: Vec<Vec<DVec3>> = (0..400_u32)
        .map(|frame| {
            let at = |h: u32| [0, 1, 2].map(|axis| number(6 * frame + 3 * h + axis));
            vec![DVec3::from(at(0)), DVec3::from(at(1))]
        })
        .collect();
    spec.motion = Motion::Recorded(RecordedMotion { positions });
    spec.setting.material.density = 0.1 + 0.2;
    let text = serde_json::to_string(&spec.to_json().unwrap()).unwrap();
    let read = SceneSpec::from_json(&serde_json::from_str(&text).unwrap()).unwrap();
    let bits = |spec: &SceneSpec| -> Vec<u64> {
        let Motion::Recorded(motion) = &spec.motion else {
            return Vec::new();
        };
        let numbers = motion.positions.iter().flatten().flat_map(|p| p.to_array());
        let density = std::iter::once(spec.setting.material.density);
        numbers.chain(density).map(f64::to_bits).collect()
    };
    assert_eq!(bits(&read).len(), 2401);
    assert_eq!(bits(&read), bits(&spec));
    assert_eq!(read, spec);
    let misspelt = text.replace("\"substeps\"", "\"substep\"");
    assert!(SceneSpec::from_json(&serde_json::from_str(&misspelt).unwrap()).is_err());
}

#[test]
fn a_number_that_is_not_finite_is_null_in_json_and_refused() {
    let mut spec = parse(SCENE).unwrap().spec;
    spec.setting.frame_rate = f64::NAN;
    assert!(spec.build(Path::new("")).is_err());
    let json = spec.to_json().unwrap();
    assert!(json["setting"]["frame_rate"].is_null());
    says(SceneSpec::from_json(&json).unwrap_err(), &["null"]);
}
