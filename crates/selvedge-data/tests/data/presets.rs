//! Presets of data sets: the counts of the paper, every mesh in every motion, and every mistake an
//! error that names the field.

use std::path::Path;

use selvedge_cloth::generate::named_sheets;
use selvedge_cloth::motion::named;
use selvedge_data::{
    DatasetConfig, DatasetPreset, Forecast, PlannedRun, SectionRule, Split, shipped_presets,
};

use crate::help::{refuses, says, table};

/// The trajectories of a split.
fn of_split(forecast: &Forecast, split: Split) -> impl Iterator<Item = &PlannedRun> {
    forecast.runs.iter().filter(move |run| run.split == split)
}

/// A preset with these lists, sections, frame rate and own motions.
fn preset(lists: &str, rule: &str, rate: &str, own: &str) -> Result<DatasetPreset, String> {
    let setting = "material = \"gray-interlock\"\nhandles = { label = \"upper-corners\" }\n\
        mesh = { generator = { kind = \"square\", vertices = 36, size = 1.0, seed = 1 } }";
    let text = format!(
        "name = \"p\"\nsections = \"{rule}\"\n{lists}\n[setting]\nframe_rate = {rate}\n{setting}\n{own}"
    );
    DatasetPreset::parse(&text, Path::new("")).map_err(|error| error.to_string())
}

#[test]
fn presets_resolve_to_scenes_and_a_plan() {
    let first = DatasetPreset::open("first").unwrap();
    // The paper's 16 and 40 drawn at random.
    assert_eq!(first.motions(Split::Train).len(), 56);
    assert_eq!(first.motions(Split::Test).len(), 15);
    assert_eq!(first.config().sections, SectionRule::Whole);
    let tiny = DatasetPreset::open("tiny").unwrap();
    let push = &tiny.motions(Split::Train)[0];
    let scene = tiny.scene(push).unwrap();
    assert_eq!(scene.spec.name, "tiny/push");
    assert_eq!(scene.scene.frame_count().unwrap(), 90);
    let plan = tiny.plan().unwrap();
    assert_eq!(plan.train, ["push", "turn"]);
    // What is written in the configuration makes the same scenes.
    for name in ["tiny", "generalisation-small"] {
        let preset = DatasetPreset::open(name).unwrap();
        let config = preset.plan().unwrap().config.to_string();
        let config: DatasetConfig = serde_json::from_str(&config).unwrap();
        assert_eq!(&config, preset.config());
    }
}

#[test]
fn mistakes_in_a_preset_are_named() {
    let (_, tiny) = shipped_presets().iter().find(|p| p.0 == "tiny").unwrap();
    let cases = r#"
        ["lift"] | ["lift", "nope"] | test: no motion is called "nope"
        ["lift"] | "everything" | expected a list of motions
        "whole" | "half" | unknown variant `half`
        [setting] | [settings] | unknown field `settings`
        duration = 0.25 } | duration = -1 } | duration
        ["lift"] | ["lift", "turn"] | test: "turn" is the motion "turn" of train
        test = ["lift"] | test = [] | motions: "lift" is neither in train nor in test
        train = ["push", "turn"] | train = [] | train: is empty: name at least one motion
    "#;
    refuses(cases, |from, to| {
        let preset = DatasetPreset::parse(&tiny.replacen(from, to, 1), Path::new(""));
        preset.map_err(|error| error.to_string())
    });
    let error = DatasetPreset::open("none").unwrap_err();
    assert_eq!(
        error.to_string(),
        "none: is neither a file nor a shipped preset; shipped are first, tiny, small, square-100, square-400, paper, generalisation, generalisation-small, speeds-400, cloths-400, fine-400"
    );
}

#[test]
fn a_motion_under_another_name_is_still_in_both_splits() {
    let own = "[motions.mine]\nnamed = \"forward\"\n";
    let still = |name: &str| {
        let blocks = "kind = \"blocks\"\nblocks = [{ duration = 5.0 }]";
        format!("[motions.{name}.inline]\n{blocks}\n")
    };
    let lists = |train: &str, test: &str| format!("train = [{train}]\ntest = [{test}]");
    let cases = r#"
        "forward" | "mine" | test: "mine" is the motion "forward" of train: test on others
        "forward" |  | motions: "forward" is the name of a shipped motion: choose another
        "mine" |  | sections: trajectory mine has 301 frames, but the section rule needs at least 802
    "#;
    let owns = [
        ("whole", own),
        ("whole", &still("forward")),
        ("paper", &still("mine")),
    ];
    for ([train, test, expected], (rule, own)) in table(cases).into_iter().zip(owns) {
        let error = preset(&lists(train, test), rule, "60", own).unwrap_err();
        assert!(error.starts_with(expected), "{error}");
    }
    let other = preset(&lists("\"mine\"", "\"side\""), "whole", "60", own);
    let plan = other.unwrap().plan().unwrap();
    assert_eq!([plan.train, plan.test], [["mine"], ["side"]]);
}

#[test]
fn the_sections_of_the_paper_are_for_its_frame_rate() {
    let lists = "train = [\"forward\"]\ntest = []";
    let papers = preset(lists, "paper", "60", "").unwrap();
    assert_eq!(papers.config().sections, SectionRule::Paper);
    let whole = preset(lists, "whole", "30", "").unwrap();
    assert_eq!(whole.config().setting.frame_rate, 30.0);
    let words = ["sections: \"paper\" counts frames of 1/60 s, but setting.frame_rate is 30"];
    says(preset(lists, "paper", "30", "").unwrap_err(), &words);
}

#[test]
fn the_paper_and_the_small_preset_have_the_counts_of_the_paper() {
    for (name, vertices) in [("paper", 1024), ("small", 400)] {
        let preset = DatasetPreset::open(name).unwrap();
        let forecast = preset.forecast();
        let counts = [Split::Train, Split::Test].map(|split| of_split(forecast, split).count());
        assert_eq!(counts, [16, 15], "{name}");
        let is_right = |run: &PlannedRun| (run.vertices, run.frames) == (vertices, 1261);
        assert!(forecast.runs.iter().all(is_right), "{name}");
        let sections = &forecast.sections;
        assert_eq!((sections.len(), forecast.samples()), (42, 6550), "{name}");
        assert!(sections.is_sorted_by_key(|s| (s.trajectory, s.start)));
        assert_eq!(preset.plan().unwrap().train.len(), 16);
    }
}

#[test]
fn generalisation_is_every_mesh_in_every_motion() {
    let preset = DatasetPreset::open("generalisation-small").unwrap();
    let forecast = preset.forecast();
    let meshes = named_sheets();
    // The twelve motions with a name and half and twice the trained speed.
    let motions = named::generalisation().len() + 2;
    assert_eq!((meshes.len(), motions), (12, 14));
    assert_eq!(of_split(forecast, Split::Train).count(), 0);
    assert_eq!(
        of_split(forecast, Split::Test).count(),
        meshes.len() * motions
    );
    assert_eq!(forecast.samples(), 0);
    for sheet in meshes {
        let prefix = format!("{}.", sheet.name);
        let runs = forecast.runs.iter();
        let runs = runs.filter(|run| run.name.starts_with(&prefix));
        let vertices: Vec<usize> = runs.map(|run| run.vertices).collect();
        assert_eq!(vertices, vec![sheet.vertices(400.0); motions], "{prefix}");
    }
    let run = |name: &str| preset.motions(Split::Test).iter().find(|m| m.name == name);
    let wide = preset.scene(run("wide-3.apart").unwrap()).unwrap();
    assert_eq!(wide.spec.setting.handles.len(), 3);
    assert_eq!(wide.spec.build(Path::new("")).unwrap(), wide.scene);
    // Three handles 0.75 m apart come to 0.45 m, the middle one where it was.
    let path = wide.scene.handle_path().unwrap();
    let (start, near) = (path.at(0.0), path.at(1.5));
    assert!((start[1].distance(start[0]) - 0.75).abs() < 1e-12);
    assert!((near[1].distance(near[0]) - 0.45).abs() < 1e-12);
    assert!(near[1].distance(start[1]) < 1e-12);
}

#[test]
fn mistakes_in_meshes_are_named() {
    let preset = |meshes: &str| {
        let lists = "train = []\ntest = [\"bouncy\"]";
        preset(lists, "whole", "60", &format!("[meshes]\n{meshes}\n"))
    };
    let two = preset("names = [\"disc\", \"quarter\"]\ndensity = 60.0\nseed = 1").unwrap();
    let forecast = two.forecast();
    let names: Vec<&String> = forecast.runs.iter().map(|run| &run.name).collect();
    assert_eq!(names, ["disc.bouncy", "quarter.bouncy"]);
    let cases = r#"
        names = ["cube"] | density = 60.0\nseed = 1 | no mesh is called "cube"; known are square,
        names = [] | density = 60.0\nseed = 1 | meshes.names: is empty
        names = ["disc", "disc"] | density = 60.0\nseed = 1 | has "disc" twice
        names = "some" | density = 60.0\nseed = 1 | expected a list of meshes, or "all"
        names = "all" | density = 0.0\nseed = 1 | meshes.density: must be finite and positive
        names = "all" | density = 2.0\nseed = 1 | needs at least
        names = "all" | density = 60.0 | missing field `seed`
    "#;
    refuses(cases, |names, rest| preset(&format!("{names}\n{rest}")));
}

#[test]
fn a_set_can_be_asked_for_at_another_speed() {
    let lists = "train = [\"side\"]\ntest = [\"all-test@1.15\", \"side@2\"]";
    let fast = preset(lists, "whole", "60", "").unwrap();
    let test = fast.motions(Split::Test);
    assert_eq!(test.len(), 16);
    assert_eq!(test[0].name, "test-x-minus-z@1.15");
    let own = named::by_name("test-x-minus-z").unwrap();
    assert_eq!(Some(&test[0].motion), own.at_speed(1.15).as_ref());
    for (wrong, name) in [("all-test@0", "test-x-minus-z@0"), ("apart@2", "apart@2")] {
        let lists = format!("train = [\"side\"]\ntest = [\"{wrong}\"]");
        let error = preset(&lists, "whole", "60", "").unwrap_err();
        let expected = format!("test: no motion is called {name:?}, here or by name");
        assert_eq!(error, expected);
    }
}

#[test]
fn cloths_of_the_file_run_every_test_motion() {
    let lists = "train = []\ntest = [\"side\", \"updown\"]";
    let mesh = "mesh = { generator = { kind = \"square\", vertices = 25, size = 1.0, seed = 1 } }";
    let cloth = |name: &str, handles: &str| {
        format!("[[cloths]]\nname = {name:?}\n{mesh}\nhandles = {handles}\n")
    };
    let own = cloth("one", "{ vertices = [0] }") + &cloth("row", "{ label = \"upper-edge\" }");
    let both = preset(lists, "whole", "60", &own).unwrap();
    let names = both.plan().unwrap().test;
    assert_eq!(names, ["one.side", "one.updown", "row.side", "row.updown"]);
    let held = |number: usize| {
        let scene = both.scene(&both.motions(Split::Test)[number]);
        let scene = scene.unwrap().scene;
        (scene.mesh.topology().vertex_count(), scene.handles.len())
    };
    assert_eq!([held(0), held(2)], [(25, 1), (25, 5)]);
    let corner = "{ vertices = [0] }";
    let part = "becomes part of the name of a file";
    for (own, expected) in [
        (
            cloth("a/b", corner),
            &*format!("cloths.name: \"a/b\" {part}"),
        ),
        (cloth("", corner), &format!("cloths.name: \"\" {part}")),
        (
            cloth("a", corner).repeat(2),
            "cloths.name: two are called \"a\"",
        ),
    ] {
        let error = preset(lists, "whole", "60", &own).unwrap_err();
        says(error, &[expected]);
    }
}

#[test]
fn a_cloth_with_training_motions_is_learned_from_and_not_tested_on() {
    let own = |train: &str| {
        format!(
            "[motions.mine.inline]\nkind = \"blocks\"\nblocks = [{{ duration = 1.5 }}]\n\
             [[cloths]]\nname = \"half\"\ntrain = {train}\nhandles = {{ vertices = [0, 3] }}\n\
             mesh = {{ generator = {{ kind = \"square\", vertices = 20, size = 1.0, seed = 2 }} }}"
        )
    };
    let lists = "train = [\"forward\"]\ntest = [\"side\"]";
    let preset = |train: &str| preset(lists, "whole", "60", &own(train));
    let found = preset("[\"mine\", \"random-3\"]").unwrap();
    let forecast = found.forecast();
    let names = |split| -> Vec<(&str, usize)> {
        let runs = of_split(forecast, split);
        runs.map(|run| (run.name.as_str(), run.vertices)).collect()
    };
    let learned = [("forward", 36), ("half.mine", 20), ("half.random-3", 20)];
    assert_eq!(names(Split::Train), learned);
    assert_eq!(names(Split::Test), [("side", 36)]);
    let cases = r#"
        "side", "mine" | test: "side" is the motion "side" of train
        "none", "mine" | cloths.train: no motion is called "none"
        "forward" | motions: "mine" is neither in train nor in test
    "#;
    for [train, expected] in table(cases) {
        says(preset(&format!("[{train}]")).unwrap_err(), &[expected]);
    }
}

#[test]
fn a_cloth_may_have_a_material_air_and_releases_of_its_own() {
    let own = |material: &str| {
        format!(
            "[[cloths]]\nname = \"half\"\nmaterial = {material}\n\
             handles = {{ groups = [{{ name = \"a\", select = {{ vertices = [0] }}, released = [{{ from = 1 }}] }}] }}\n\
             environment = {{ wind = [3.0, 0.0, 1.0] }}\n\
             mesh = {{ generator = {{ kind = \"square\", vertices = 20, size = 1.0, seed = 2 }} }}\n\
             train = [\"updown\"]"
        )
    };
    let lists = "train = [\"forward\"]\ntest = [\"side\"]";
    let preset = |material: &str| preset(lists, "whole", "60", &own(material));
    let found = preset("{ from = \"gray-interlock\", density = 0.3 }").unwrap();
    // What is kept in the index makes the same scenes.
    let kept = found.plan().unwrap().config.to_string();
    let kept: DatasetConfig = serde_json::from_str(&kept).unwrap();
    assert_eq!(&kept, found.config());
    let of = |number: usize| {
        let scene = found.scene(&found.motions(Split::Train)[number]).unwrap();
        assert_eq!(scene.spec.setting.material, scene.scene.material);
        let releases = scene.scene.schedule.releases.len();
        (
            scene.scene.material.density,
            scene.scene.environment.wind.x,
            releases,
        )
    };
    assert_eq!([of(0), of(1)], [(0.187, 0.0, 0), (0.3, 3.0, 1)]);
    let error = preset("\"satin\"").unwrap_err();
    says(error, &["material", "satin"]);
}

#[test]
fn what_is_measured_on_square_400_is_not_learned_from() {
    for (name, runs) in [("speeds-400", 45), ("cloths-400", 28), ("fine-400", 15)] {
        let preset = DatasetPreset::open(name).unwrap();
        assert_eq!(preset.motions(Split::Train).len(), 0, "{name}");
        assert_eq!(preset.motions(Split::Test).len(), runs, "{name}");
    }
}
