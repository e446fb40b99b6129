//! `selvedge export`, `--export`, and rigs that drive the cloth, from outside: what is written
//! comes back, a motion goes to another program's format and back again, and bad calls leave
//! nothing.

use crate::common::{PUSH, PUSH_FRAMES, TestFolder, names_in, number};
use selvedge_data::Trajectory;
use serde_json::json;

/// A folder with a simulated [`PUSH`] in `run.safetensors`.
fn pushed() -> (TestFolder, Trajectory) {
    let dir = TestFolder::with_push();
    dir.json("run push.toml -o run.safetensors");
    let run = dir.trajectory("run.safetensors");
    (dir, run)
}

/// [`PUSH`] with another motion.
fn with_motion(motion: &str) -> String {
    let own = PUSH.find("[motion.inline]").unwrap();
    format!("{}motion = {motion}\n", &PUSH[..own])
}

#[test]
fn a_run_goes_to_other_programs_and_its_handles_come_back() {
    let (dir, run) = pushed();
    for (to, motion) in [
        ("cloth.npz", r#"{ recorded = "cloth.npz" }"#),
        ("turned.npz --up z", r#"{ recorded = "turned.npz" }"#),
        ("cloth.usdc", r#"{ rig = { file = "cloth.usdc" } }"#),
        ("cloth.usdz --up z", r#"{ rig = { file = "cloth.usdz" } }"#),
        (
            "cloth.glb",
            r#"{ rig = { file = "cloth.glb", nodes = ["handle_0", "handle_1"] } }"#,
        ),
    ] {
        let said = dir.json(&format!("export run.safetensors -o {to}"));
        assert_eq!(number(&said, "/frames"), (PUSH_FRAMES + 1) as f64);
        dir.write("again.toml", with_motion(motion));
        dir.json("run again.toml -o again.safetensors");
        let again = dir.trajectory("again.safetensors");
        assert_eq!(again.frame_count(), run.frame_count(), "{to}");
        for frame in 0..run.frame_count() {
            for vertex in run.handles().vertices() {
                let [a, b] = [&run, &again].map(|t| t.frame(frame)[vertex.index()]);
                // Written in single precision, by numbers below 2.
                assert!(a.distance(b) < 1e-6, "{to}: frame {frame}, {a} {b}");
            }
        }
        // The motions differ by roundings, and so do the runs of the cloth that they drive.
        let pairs = again.positions().iter().zip(run.positions());
        let apart = pairs.map(|(a, b)| a.distance(*b));
        assert!(apart.fold(0.0, f32::max) < 1e-3, "{to}");
    }
    let said = dir.json("info cloth.glb");
    assert_eq!(said["nodes"][1]["name"], "handle_0");
    assert_eq!(number(&said, "/nodes/1/moves/1"), 0.5);
    assert_eq!(dir.json("info cloth.npz")["vertices"], 36);
}

#[test]
fn an_artists_rig_drives_groups_of_handles() {
    let dir = TestFolder::new();
    let label = r#"handles = { label = "upper-corners" }"#;
    let groups = "\n[[handles.groups]]\nname = \"left\"\nselect = { vertices = [0] }\n[[handles.groups]]\nname = \"right\"\nselect = { vertices = [5] }\n";
    let scene = with_motion(r#"{ rig = { file = "hands.usda" } }"#).replace(label, "");
    dir.write("scene.toml", format!("{scene}{groups}"));
    // In a world of centimetres with z up: the right hand rises by 30 cm in half a second.
    dir.write(
        "hands.usda",
        r#"#usda 1.0
(
    metersPerUnit = 0.01
    timeCodesPerSecond = 30
    upAxis = "Z"
)
def Xform "hands"
{
    def Xform "left"
    {
    }
    def Xform "right"
    {
        double3 xformOp:translate.timeSamples = { 1: (5, 5, 5), 16: (5, 5, 35) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"#,
    );
    dir.json("run scene.toml -o run.safetensors");
    let run = dir.trajectory("run.safetensors");
    assert_eq!(run.frame_count(), 31);
    for frame in 0..31 {
        let [left, right] = [0, 5].map(|vertex| run.frame(frame)[vertex] - run.frame(0)[vertex]);
        assert!(left.length() < 1e-6, "{left}");
        // Rounded to single precision, at places below 2 m.
        let rise = 0.3 * frame as f32 / 30.0 * glam::Vec3::Y;
        assert!(right.distance(rise) < 1e-6, "{right}");
    }
    dir.write("hands.usda", "#usda 1.0\ndef Xform \"left\" { }\n");
    let words = "scene.toml | motion.rig | hands.usda | \"right\" | [left]";
    dir.refuses(&format!("1 | run scene.toml -o x.safetensors | {words}"));
}

#[test]
fn simulate_and_rollout_export_as_they_go() {
    let dir = TestFolder::with_push();
    let said =
        dir.json("run push.toml -o run.safetensors --frames 4 --export a.glb --export a.pc2");
    assert_eq!(said["exported"], json!(["a.glb", "a.pc2", "a.obj"]));
    let names = ["a.glb", "a.obj", "a.pc2", "push.toml", "run.safetensors"];
    assert_eq!(dir.names(), names);
    dir.json("export run.safetensors -o b.pc2");
    assert_eq!(dir.read("a.pc2"), dir.read("b.pc2"));
    assert_eq!(dir.read("a.pc2").len(), 32 + 12 * 36 * 5);
}

/// As Windows and cameras write them: every reader and writer takes them.
#[test]
fn endings_may_be_capitals() {
    let (dir, run) = pushed();
    for name in [
        "A.GLB", "B.USDC", "C.USDZ", "D.NPZ", "E.ABC", "F.GIF", "G.PC2",
    ] {
        dir.json(&format!("export run.safetensors -o {name} --frames ..4"));
    }
    dir.json("export run.safetensors -o H.OBJ --frames 0");
    for name in ["A.GLB", "B.USDC", "C.USDZ", "D.NPZ", "H.OBJ"] {
        dir.json(&format!("info {name}"));
    }
    dir.json("export run.safetensors -o whole.NPZ");
    let motions = [
        "{ rig = { file = \"B.USDC\" } }",
        "{ rig = { file = \"A.GLB\", nodes = [\"handle_0\", \"handle_1\"] } }",
        "{ recorded = \"whole.NPZ\" }",
    ];
    for motion in motions {
        dir.write("again.toml", with_motion(motion));
        dir.json("run again.toml -o AGAIN.SAFETENSORS --frames 4");
        let again = dir.trajectory("AGAIN.SAFETENSORS");
        assert!(
            again.frame(4)[0].distance(run.frame(4)[0]) < 1e-4,
            "{motion}"
        );
    }
}

#[test]
fn nothing_is_overwritten_that_was_not_named() {
    let (dir, _) = pushed();
    dir.write("shirt.obj", "mine");
    std::fs::create_dir(dir.path("films")).unwrap();
    dir.write("films/clip.gif", "mine");
    dir.refuses(
        "1 | export run.safetensors -o shirt.pc2 | shirt.obj | move it away
         1 | run push.toml -o x.safetensors --export shirt.pc2 | shirt.obj | move it away
         1 | run push.toml --model paper --frames 2 -o films | films/clip.gif | move it away
         2 | export --normals run.safetensors -o a.glb | run.safetensors | yes, no",
    );
    // A default name is ours: an earlier run is replaced, and that is said before.
    let said = |call: &str| dir.run(call).err.contains("run.safetensors is replaced");
    assert!(said("run push.toml --frames 2"));
    assert!(!said("run push.toml --frames 2 -o run.safetensors"));
    std::fs::remove_file(dir.path("run.safetensors")).unwrap();
    assert!(!said("run push.toml --frames 2"));
}

#[test]
fn pictures_are_one_per_frame() {
    let (dir, _) = pushed();
    dir.json("export run.safetensors -o pictures --format png --frames 0..20 --every 10");
    let names = ["cloth_0000.png", "cloth_0001.png", "cloth_0002.png"];
    assert_eq!(names_in(&dir.path("pictures")), names);
    dir.json("export run.safetensors -o one.png --frames 20");
    for picture in [dir.read("one.png"), dir.read("pictures/cloth_0002.png")] {
        assert_eq!(&picture[1..4], b"PNG");
        // Width and height stand in the first chunk.
        assert_eq!(picture[16..24], [0, 0, 3, 192, 0, 0, 2, 208]);
    }
    dir.json("export run.safetensors -o clip.gif --frames ..20");
    assert_eq!(&dir.read("clip.gif")[..6], b"GIF89a");
}

#[test]
fn a_format_that_is_named_takes_any_other_ending_for_a_folder() {
    let (dir, _) = pushed();
    dir.json("export run.safetensors -o frames.v2 --format obj --frames ..1");
    let names = ["cloth_0000.obj", "cloth_0001.obj"];
    assert_eq!(names_in(&dir.path("frames.v2")), names);
    dir.json("export run.safetensors -o one.obj --format obj --frames 1");
    assert!(dir.path("one.obj").is_file());
}

#[test]
fn a_rollout_exports_into_the_folder_that_it_makes() {
    let dir = TestFolder::with_push();
    dir.json(
        "run --model paper push.toml --frames 2 --no-clip --export out/a.glb --trust out/t.csv",
    );
    let names = ["a.glb", "rollout.safetensors", "sheet.png", "t.csv"];
    assert_eq!(names_in(&dir.path("out")), names);
}

#[test]
fn bad_calls_are_told_and_leave_nothing() {
    let (dir, _) = pushed();
    std::fs::create_dir(dir.path("full")).unwrap();
    dir.write("full/mine.txt", "mine");
    let export = "export run.safetensors -o";
    let wish = "run push.toml -o x.safetensors --export";
    let rollout = "run --model paper --compare push.toml -o deep/other --export";
    dir.refuses(&format!(
        "2 | {export} cloth.fbx | cloth.fbx | .usdc | .glb
         2 | {export} cloth | --format
         2 | {export} cloth.obj | one frame | 31 | --frames
         2 | {export} cloth.glb --up z | --up z | glTF
         2 | {export} cloth.gif --normals yes | --normals
         2 | {export} cloth.usdc --frames 31 | frame 31 | 0 to 30
         2 | {export} cloth.usdc --frames 9..3 | 9..3
         2 | {export} cloth.usdc --frames a..b | 20..80
         2 | {export} cloth.usdc --frames -1 | 20..80
         1 | {export} none/cloth.usdc | there is no folder none
         1 | {export} full --format obj | full | not empty
         1 | {export} full --format glb | full | is a folder
         1 | {export} push.toml --format png | file of this name
         2 | {export} cloth.obj --format pc2 | point cache
         2 | {export} cloth.glb --velocities yes | --velocities | USD
         2 | {export} cloth.gif --velocities no | --velocities
         2 | {export} cloth.glb --camera 90,20 | --camera | .png
         2 | {export} cloth.png --frames 1 --camera 90 | 90,20
         2 | {export} cloth.png --frames 1 --size 3x3 | 1280x720
         2 | {export} cloth.png --frames 1 --colour blue | #1f4e79
         2 | {wish} a.fbx | a.fbx | .usdc
         2 | {wish} a.png | a.png | one frame
         1 | {wish} none/a.glb | none
         2 | {rollout} deep/other/a.png | a.png | one frame",
    ));
}

#[test]
fn every_file_can_be_looked_at() {
    let dir = TestFolder::with_push();
    dir.json(
        "run push.toml -o run.safetensors --frames 6 --states states.safetensors --export run.npz",
    );
    dir.json("run --rest push.toml -o rest.obj");
    dir.model();
    for (file, kind) in [
        ("run.safetensors", "trajectory"),
        ("run.npz", "trajectory"),
        ("rest.obj", "mesh"),
        ("push.toml", "scene"),
    ] {
        let said = dir.json(&format!("info {file} --picture a.png"));
        assert_eq!(said["picture"], "a.png");
        assert_eq!(said["kind"], kind);
        // Euler: V - E + F = 1 for a sheet without holes.
        if let Some(edges) = said["edges"].as_u64() {
            assert_eq!(36 + said["faces"].as_u64().unwrap(), edges + 1);
        }
        assert!(dir.read("a.png").starts_with(b"\x89PNG"), "{file}");
    }
    for (file, kind) in [
        ("run/checkpoint.safetensors", "checkpoint"),
        ("states.safetensors", "states"),
        ("run/model.safetensors", "model"),
        ("run", "training-folder"),
        ("tiny", "dataset"),
    ] {
        assert_eq!(dir.json(&format!("info {file}"))["kind"], kind);
    }
    dir.refuses(
        "1 | info states.safetensors --picture x.png | states | nothing to draw
         1 | info run/model.safetensors --picture x.png | model | nothing to draw
         2 | info run.safetensors --picture x.jpg | x.jpg | .png",
    );
}
