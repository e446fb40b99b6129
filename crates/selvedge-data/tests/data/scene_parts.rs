//! Materials of one's own, groups of handles, releases and gusts, as scene files say them; every
//! mistake is an error that names the file and the field.

use std::path::Path;

use glam::DVec3;
use selvedge_cloth::{Gust, Isotropic, Motion, Release};
use selvedge_data::{DatasetPreset, LoadedScene, SceneSpec, Split, materials, parse_scene};

use crate::help::{refuses, says};

const SCENE: &str = r#"
name = "s"
mesh = { generator = { kind = "square", vertices = 36, size = 1, seed = 1 } }
"#;
const CORNERS: &str = "handles = { label = \"upper-corners\" }\n";
const STILL: &str = "motion = { inline = { kind = \"blocks\", blocks = [{ duration = 1 }] } }\n";
const GRAY: &str = "material = \"gray-interlock\"\n";

fn parse_in(folder: &Path, parts: &[&str]) -> Result<LoadedScene, String> {
    let text = SCENE.to_owned() + &parts.concat();
    parse_scene(&text, folder, "s.toml").map_err(|error| {
        let text = error.to_string();
        assert!(text.starts_with("s.toml: "), "{text}");
        text
    })
}

fn parse(parts: &[&str]) -> Result<LoadedScene, String> {
    parse_in(Path::new(""), parts)
}

#[test]
fn a_material_can_change_another_or_be_isotropic() {
    let material = |text: &str| {
        let material = format!("material = {text}\n");
        let loaded = parse(&[&material, CORNERS, STILL]).unwrap();
        loaded.scene.material
    };
    let gray = material("\"gray-interlock\"");
    let changed = "stretch_multiplier = 2, bend_multiplier = 0.5, damping = 0.01";
    let changed = material(&format!("{{ from = \"gray-interlock\", {changed} }}"));
    let mut expected = gray.clone().multiplied(2.0, 0.5);
    expected.name = "gray-interlock, changed".to_owned();
    expected.damping = 0.01;
    assert_eq!(changed, expected);
    let constants = "{ youngs_modulus = 1e6, poissons_ratio = 0.3, thickness = 5e-4 }";
    let rubber = format!("{{ name = \"rubber\", density = 0.5, isotropic = {constants} }}");
    let rubber = material(&rubber);
    let lines = constants.trim_matches(['{', '}']).replace(',', "\n");
    let isotropic: Isotropic = toml::from_str(&lines).unwrap();
    assert_eq!(rubber.stretch, isotropic.stretch_table());
    assert_eq!(rubber.bend, isotropic.bend_table());
    assert_eq!((rubber.density, rubber.damping), (0.5, 0.0));
}

#[test]
fn a_material_file_has_the_same_keys() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let mine = materials()[2].1.replace("11oz-black-denim", "mine");
    write("mine.toml", &mine);
    let stiff = "from = \"mine.toml\"\nname = \"stiff\"\nbend_multiplier = 10\n";
    write("stiff.toml", stiff);
    write("loop.toml", "from = \"loop.toml\"\n");
    let material = |name: &str| {
        let material = format!("material = \"{name}\"\n");
        parse_in(folder.path(), &[&material, CORNERS, STILL]).map(|l| l.scene.material)
    };
    let mine = material("mine.toml").unwrap();
    assert_eq!((mine.name.as_str(), mine.density), ("mine", 0.324));
    let stiff = material("stiff.toml").unwrap();
    assert_eq!(stiff.name, "stiff");
    assert_eq!(stiff.bend, mine.clone().multiplied(1.0, 10.0).bend);
    says(material("loop.toml").unwrap_err(), &["is built on itself"]);
}

#[test]
fn wrong_materials_are_named() {
    let rubber = r#"material = { name = "r", density = 1, isotropic = { youngs_modulus = 1e6, poissons_ratio = 0.3, thickness = 1e-3 } }"#;
    let cases = r#"
        { name | 3 # { name | the name of a material, a TOML file, or a table
        { name | { density = 1 } # { name | material: needs exactly one of from
        density = 1 | density = 1, from = "gray-interlock" | material: needs exactly one of from
        0.3 | 0.7 | material: isotropic.poissons_ratio must be between
        density = 1, |  | material: density is missing
        density = 1 | density = 1, colour = 3 | unknown field `colour`
        density = 1 | density = 1, damping = -1 | damping must be between 0 and 100 s
        density = 1 | density = 1, stretch_multiplier = 0 | material: stretch_multiplier must be finite and positive, found 0
        { name | { from = "gray" } # { name | material: "gray" is neither
    "#;
    refuses(cases, |from, to| {
        parse(&[&rubber.replacen(from, to, 1), "\n", CORNERS, STILL])
    });
}

const GROUPS: &str = r#"
[[handles.groups]]
name = "left"
select = { vertices = [0, 1, 2] }
released = [{ from = 0.5, to = 0.75 }, { from = 1.5 }]
[[handles.groups]]
name = "right"
select = { box = { min = [-1, -0.001, 0.4], max = [1, 1, 2] } }
"#;
const MOVES: &str = r#"
[motion.groups]
duration = 2
[[motion.groups.moves]]
group = "right"
axis = [1, 0, 0]
keyframes = [{ time = 1, translation = [0, 0.2, 0], rotation_deg = 90 }]
"#;

#[test]
fn groups_of_handles_move_rigidly_and_let_go() {
    let loaded = parse(&[GRAY, GROUPS, MOVES]).unwrap();
    let scene = &loaded.scene;
    let count = scene.handles.len();
    assert_eq!(loaded.spec.setting.handles[..3], [0, 1, 2]);
    let release = |from, to| Release {
        handles: vec![0, 1, 2],
        from,
        to,
    };
    let releases = [release(0.5, Some(0.75)), release(1.5, None)];
    assert_eq!(scene.schedule.releases, releases);
    assert!(count > 3);
    let path = scene.handle_path().unwrap();
    assert_eq!(path.frame_count(), 120);
    let (start, end) = (path.at(0.0), path.at(1.0));
    assert_eq!(start[..3], end[..3]);
    let center = start[3..].iter().sum::<DVec3>() / (count - 3) as f64;
    for (from, to) in start[3..].iter().zip(&end[3..]) {
        let arm = *from - center;
        let expected = center + DVec3::new(arm.x, -arm.z + 0.2, arm.y);
        assert!(to.distance(expected) < 1e-15);
    }
    let targets = path.targets(30, 1).unwrap();
    assert!(!targets.holds(0) && targets.holds(3));
    // The resolved scene has it all.
    let json = loaded.spec.to_json().unwrap();
    assert_eq!(SceneSpec::from_json(&json).unwrap(), loaded.spec);
    // One without releases has no word of them, as before.
    let plain = parse(&[GRAY, CORNERS, STILL]).unwrap();
    let text = plain.spec.to_json().unwrap().to_string();
    for word in ["schedule", "gust"] {
        assert!(!text.contains(&format!("\"{word}\"")), "{word}");
    }
}

#[test]
fn wrong_groups_are_named() {
    let groups = |from: &str, to: &str| {
        assert!(GROUPS.contains(from) || MOVES.contains(from), "{from}");
        let edited = |text: &str| text.replace(from, to);
        parse(&[GRAY, &edited(GROUPS), &edited(MOVES)])
    };
    let cases = r#"
        to = 0.75 | to = 0.25 | handles.groups: "left": released[0].to must be
        from = 1.5 | from = -1 | released[1].from must be finite
        from = 1.5 | from = 0.7 | "left": released[1].from is 0.7, before released[0] of the same handle 0 has ended
        "right"\nsel | "left"\nsel | two groups are called "left"
        group = "right" | group = "top" | motion.groups.moves.group: no group of handles is called "top"; there are [left, right]
        axis = [1, 0, 0] | axis = [0, 0, 0] | groups[0].axis must be a direction
        duration = 2 | duration = 0.3337 | duration must be a whole number
        [0, 1, 2] | [0, 1, 36] | handles: handle 2 is vertex 36
        { vertices = [0, 1, 2] } | { groups = [] } | selects groups
        time = 1 | time = 3 | keyframes[0].time must be between
    "#;
    refuses(cases, groups);
}

#[test]
fn gusts_are_part_of_the_environment() {
    let windy = |text: &str| parse(&[GRAY, CORNERS, STILL, "[environment]\n", text, "\n"]);
    let loaded = windy("wind = [2, 0, 0]\ngust = { speed = [1, 0, 0.5], period = 3, seed = 7 }");
    let environment = loaded.unwrap().scene.environment;
    let gust = Gust {
        speed: DVec3::new(1.0, 0.0, 0.5),
        period: 3.0,
        seed: 7,
    };
    assert_eq!(environment.gust, Some(gust));
    let cases = r#"
        [1, 0, 0] | period = 0.001, seed = 1 | environment.gust.period must be at least a frame
        [1, 0, 0] | period = 0, seed = 1 | environment.gust.period
        [-1, 0, 0] | period = 1, seed = 1 | environment.gust.speed
        [1, 0, 0] | seed = 1 | missing field `period`
        1 | period = 1, seed = 1 | gust
    "#;
    refuses(cases, |speed, rest| {
        windy(&format!("gust = {{ speed = {speed}, {rest} }}"))
    });
}

#[test]
fn a_data_set_may_have_handles_that_let_go() {
    let preset = |groups: &str| {
        let setting = groups.replace("[[handles.groups]]", "[[setting.handles.groups]]");
        let text = format!(
            "name = \"p\"\nsections = \"whole\"\ntrain = [\"m\"]\ntest = []\n\
             [motions.m]{}\n[setting]\n{GRAY}{}{setting}",
            MOVES.replace("motion.groups", "motions.m.groups"),
            SCENE.replace("name = \"s\"", ""),
        );
        DatasetPreset::parse(&text, Path::new("")).map_err(|error| error.to_string())
    };
    let released = "released = [{ from = 0.5, to = 0.75 }, { from = 1.5 }]\n";
    let held = preset(&GROUPS.replace(released, "")).unwrap();
    let motion = &held.motions(Split::Train)[0].motion;
    assert!(matches!(motion, Motion::Keyframes(_)));
    assert!(held.config().setting.schedule.is_empty());
    let let_go = preset(GROUPS).unwrap();
    assert_eq!(let_go.config().setting.schedule.releases.len(), 2);
}

const BALL: &str = "contact = { thickness = 0.002, self = false }\n[[obstacles]]\nname = \"ball\"\n\
    sphere = { radius = 0.2 }\nmotion = { keyframes = [{ time = 1, translation = [1, 0, 0] }] }\n";

#[test]
fn obstacles_and_contact_are_read_and_written_back() {
    let folder = tempfile::tempdir().unwrap();
    let step = "v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 3 2\n";
    std::fs::write(folder.path().join("step.obj"), step).unwrap();
    let floor = "[[obstacles]]\nname = \"step\"\nmesh = \"step.obj\"\nfriction = 0.1\n";
    let loaded = parse_in(folder.path(), &[GRAY, CORNERS, STILL, BALL, floor]).unwrap();
    let contact = loaded.scene.contact.unwrap();
    assert_eq!((contact.thickness, contact.self_contact), (0.002, false));
    let names: Vec<&str> = loaded.scene.obstacles.iter().map(|o| o.name()).collect();
    assert_eq!(names, ["ball", "step"]);
    assert!(loaded.files.contains(&folder.path().join("step.obj")));
    assert_eq!(loaded.warnings, [""; 0]);
    // The spec makes the very scene, and so does what is kept with a run.
    let json = loaded.spec.to_json().unwrap();
    let spec = SceneSpec::from_json(&json).unwrap();
    assert_eq!(spec, loaded.spec);
    assert_eq!(spec.build(folder.path()).unwrap(), loaded.scene);
    // Without them nothing is written.
    let bare = parse(&[GRAY, CORNERS, STILL]).unwrap();
    let bare = &bare.spec.to_json().unwrap()["setting"];
    assert!(bare.get("contact").is_none() && bare.get("obstacles").is_none());
}

#[test]
fn wrong_obstacles_and_contact_are_named() {
    let alone = BALL.split_once('\n').unwrap().1;
    let make = |from: &str, to: &str| parse(&[GRAY, CORNERS, STILL, &BALL.replace(from, to)]);
    let cases = r#"
        { thickness = 0.002, self = false } | true | contact = {}
        { thickness = 0.002, self = false } | 1 | or false
        thickness = 0.002 | thickness = -1 | contact.thickness must be
        thickness | thickest | thickest
        radius = 0.2 | radius = -1 | obstacles["ball"].sphere.radius
    "#;
    refuses(cases, make);
    let twice = format!("{BALL}{alone}");
    let error = parse(&[GRAY, CORNERS, STILL, &twice]).unwrap_err();
    says(error, &["obstacles.name: two are called \"ball\""]);
}
