//! Small files written here by hand, placements that are known in closed form, and damage.

use glam::{DMat4, DQuat, DVec3};
use serde_json::{Value, json};

use super::*;
use crate::rig::glb::tests::Glb;
use crate::test_help::{refuses, says, table};

fn parse_glb(bytes: &[u8]) -> Result<Rig, RigError> {
    Rig::parse(bytes, RigFormat::Glb, Wanted::Nodes(None))
}

fn parse_usd(bytes: &[u8]) -> Result<Rig, RigError> {
    Rig::parse(bytes, RigFormat::Usd, Wanted::Nodes(None))
}

fn named(nodes: &[&str]) -> Vec<String> {
    nodes.iter().map(|&name| name.to_owned()).collect()
}

/// Handles at `start` that follow `nodes`, in every frame.
fn follow(rig: &Rig, nodes: &[&str], start: &[DVec3], frame_rate: f64) -> Vec<Vec<DVec3>> {
    let frames = rig.motion(&named(nodes), frame_rate).unwrap();
    let moved = |frame: &Vec<DMat4>| {
        let pairs = frame.iter().zip(start);
        pairs.map(|(node, p)| node.transform_point3(*p)).collect()
    };
    frames.iter().map(moved).collect()
}

fn problem(rig: &Rig, nodes: &[&str]) -> String {
    rig.motion(&named(nodes), 60.0).unwrap_err().to_string()
}

/// An arm of length 2 whose shoulder turns by half a turn about y in a second while it rises by 1
/// m; a hand at its end, and a lamp that stands.
fn arm() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "nodes": [
            { "name": "shoulder", "children": [1], "translation": [9, 9, 9] },
            { "name": "hand", "translation": [2, 0, 0] },
            { "name": "lamp", "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 5,6,7,1] },
        ],
        "animations": [{
            "name": "swing",
            "samplers": [
                { "input": 0, "output": 1, "interpolation": "LINEAR" },
                { "input": 0, "output": 2 },
            ],
            "channels": [
                { "sampler": 0, "target": { "node": 0, "path": "translation" } },
                { "sampler": 1, "target": { "node": 0, "path": "rotation" } },
                { "sampler": 1, "target": { "node": 2, "path": "weights" } },
            ],
        }],
    })
}

/// The .glb of the arm, as `edit` changes it, with times, heights, and quarter turns about y as
/// normalised 16-bit numbers.
fn arm_bytes(edit: impl FnOnce(&mut Value)) -> Vec<u8> {
    let mut glb = Glb::default();
    glb.floats("SCALAR", 1, &[0.5, 1.0, 1.5]);
    glb.floats("VEC3", 3, &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, 0.0]);
    let unit = |value: f64| (value * 32767.0).round() as i16;
    let turns = [0.0, 0.25, 0.5].map(|turns: f64| {
        let half = turns * std::f64::consts::PI;
        [0, unit(half.sin()), 0, unit(half.cos())]
    });
    let turns = turns.map(|turn| turn.map(i16::to_le_bytes));
    let turns = turns.as_flattened().as_flattened();
    let turns = glb.store("VEC4", 5122, 3, turns);
    glb.accessors[turns]["normalized"] = json!(true);
    glb.finish_as(arm(), edit)
}

#[test]
fn handles_move_rigidly_with_a_node_within_a_node() {
    let rig = parse_glb(&arm_bytes(|_| {})).unwrap();
    assert_eq!(rig.span(1), Some([0.5, 1.5]));
    assert_eq!(rig.span(2), None);
    // A handle 1 m beyond the hand, seen from the axis of the shoulder at the origin.
    let frames = follow(&rig, &["hand"], &[DVec3::new(3.0, 0.0, 0.0)], 8.0);
    assert_eq!(frames.len(), 9);
    for (number, frame) in frames.iter().enumerate() {
        let share = number as f64 / 8.0;
        let angle = std::f64::consts::PI * share;
        let expected = DVec3::new(3.0 * angle.cos(), share, -3.0 * angle.sin());
        // The turns are rounded to 1/32767, on an arm of 3 m.
        let apart = frame[0].distance(expected);
        assert!(apart < 3.0 * 2.0 / 32767.0, "{number}: {apart}");
    }
}

#[test]
fn nodes_of_several_animations_are_followed_by_the_one_that_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hero.glb");
    let second = |json: &mut Value| {
        let mut other = json["animations"][0].clone();
        other["name"] = json!("run");
        json["animations"].as_array_mut().unwrap().push(other);
    };
    std::fs::write(&path, arm_bytes(second)).unwrap();
    let nodes = named(&["hand"]);
    let motion = |name| Rig::read_motion(&path, name, &nodes, 8.0);
    let alone = parse_glb(&arm_bytes(|_| {})).unwrap();
    let expected = alone.motion(&nodes, 8.0).unwrap();
    assert_eq!(motion(Some("run")).unwrap(), expected);
    says(
        motion(None).unwrap_err(),
        &["choose one by `animation`, of [swing, run]"],
    );
    says(
        motion(Some("walk")).unwrap_err(),
        &["there are [swing, run]"],
    );
}

#[test]
fn a_node_that_stands_may_be_followed_beside_one_that_moves() {
    let rig = parse_glb(&arm_bytes(|_| {})).unwrap();
    let frames = follow(&rig, &["lamp", "shoulder"], &[DVec3::X, DVec3::ZERO], 2.0);
    assert!(frames.iter().all(|frame| frame[0] == DVec3::X));
    assert_eq!(frames[2][1], DVec3::Y);
    let still = "none of the nodes [lamp] is animated";
    assert_eq!(problem(&rig, &["lamp"]), still);
}

#[test]
fn a_node_whose_keys_begin_later_than_the_file_rests_until_then() {
    // The second and the third time of the others, with their first two heights.
    let late = |json: &mut Value| {
        for (from, place, form) in [(0, 4, "SCALAR"), (1, 0, "VEC3")] {
            json["accessors"].as_array_mut().unwrap().push(json!({
                "bufferView": from, "byteOffset": place, "componentType": 5126, "count": 2, "type": form,
            }));
        }
        json["animations"].as_array_mut().unwrap().push(json!({
            "samplers": [{ "input": 3, "output": 4 }],
            "channels": [{ "sampler": 0, "target": { "node": 2, "path": "translation" } }],
        }));
    };
    let rig = parse_glb(&arm_bytes(late)).unwrap();
    let frames = follow(&rig, &["lamp"], &[DVec3::ZERO], 8.0);
    let heights: Vec<f64> = frames.iter().map(|frame| frame[0].y).collect();
    assert_eq!(heights, [0.0, 0.0, 0.0, 0.0, 0.0, 0.125, 0.25, 0.375, 0.5]);
}

#[test]
fn what_a_gltf_file_lacks_is_named() {
    let parsed = |place: &str, to: Value| {
        let edit = |json: &mut Value| *json.pointer_mut(place).unwrap() = to;
        parse_glb(&arm_bytes(edit))
    };
    let rig = parse_glb(&arm_bytes(|_| {})).unwrap();
    let none = "there is no node called \"hnad\"; there are [shoulder, hand, lamp]";
    assert_eq!(problem(&rig, &["hnad"]), none);
    let twice = parsed("/nodes/2/name", json!("hand")).unwrap();
    says(problem(&twice, &["hand"]), &["2 nodes are called"]);
    let cases = r#"
        /nodes/0/children | [7] | no child 7
        /nodes/1 | { "children": [0] } | within itself
        /accessors/1/count | 4 | reaches beyond
        /accessors/1/count | 2 | as many values as times
        /accessors/0/byteOffset | 40 | reaches beyond
        /accessors/1/type | "VEC2" | expected VEC3, found VEC2
        /accessors/1/componentType | 5121 | type
        /animations/0/samplers/0/interpolation | "SMOOTH" | SMOOTH
        /animations/0/channels/1/target/path | "translation" | keep one
    "#;
    for [place, to, named] in table(cases) {
        let error = parsed(place, serde_json::from_str(to).unwrap());
        says(error.unwrap_err(), &[named]);
    }
    let whole = arm_bytes(|_| {});
    for end in 0..whole.len() - 4 {
        assert!(parse_glb(&whole[..end]).is_err(), "{end}");
    }
    for at in 0..whole.len() {
        let mut spoilt = whole.clone();
        spoilt[at] ^= 0x55;
        // No panic; most of the bytes are numbers or names, which may be others.
        let _ = parse_glb(&spoilt);
    }
}

#[test]
fn gltf_splines_go_through_their_keys() {
    let mut json = arm();
    json["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE");
    json["animations"][0]["channels"] = json!([
        { "sampler": 0, "target": { "node": 0, "path": "translation" } }
    ]);
    // A Hermite piece is exact for any cubic: a tangent, the value, and the tangent again.
    let x = |t: f32| t * t * t - 2.0 * t + 1.0;
    let slope = |t: f32| 3.0 * t * t - 2.0;
    let times = [0.0, 0.5, 2.0];
    let key = |t: f32| [slope(t), 0.0, 0.0, x(t), 0.0, 0.0, slope(t), 0.0, 0.0];
    let mut glb = Glb::default();
    glb.floats("SCALAR", 1, &times);
    glb.floats("VEC3", 3, times.map(key).as_flattened());
    let rig = parse_glb(&glb.finish(json)).unwrap();
    let frames = follow(&rig, &["shoulder"], &[DVec3::ZERO], 10.0);
    assert_eq!(frames.len(), 21);
    for (number, frame) in frames.iter().enumerate() {
        let t = number as f64 / 10.0;
        // The handle is where the node has gone from its first frame, at 1 m. A dozen roundings of
        // numbers below 10.
        let expected = (t * t * t - 2.0 * t) * DVec3::X;
        assert!(frame[0].distance(expected) < 1e-13, "{number}: {frame:?}");
    }
}

/// As Blender writes: z up, centimetres here, a rotated root, and much that has nothing to do with
/// it.
const STAGE: &str = r#"#usda 1.0
(
    defaultPrim = "world"
    doc = """Blender "4.2" """
    metersPerUnit = 0.01
    timeCodesPerSecond = 24
    customLayerData = { string a = "}" }
    upAxis = "Z"
)

def Xform "world" (
    customData = {
        dictionary Blender = { bool generated = 1 }
    }
    kind = 'component'
)
{
    custom string userProperties:a = "def Xform \"none\" {"
    rel material:binding = </world/x>
    float3 xformOp:rotateXYZ = (0, 0, 90)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]

    def Xform "hand" # { a comment
    {
        double3 xformOp:translate.timeSamples = {
            12: (100, 0, 0),
            24: (100, 0, 50.5),
        }
        double3 xformOp:translate = (7, 7, 7) (
            doc = "not this one"
        )
        quatf xformOp:orient = (1, 0, 0, 0)
        double3 xformOp:translate:pivot = (3, 2, 1)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:translate:pivot", "xformOp:orient", "!invert!xformOp:translate:pivot"]

        def Mesh "sheet"
        {
            point3f[] points = [(1, 2, 3), (4, 5, 6)] (interpolation = "vertex")
            asset inputs:file = @a]b.png@</x>
            token visibility.timeSamples = { 0: "inherited", 5: None }
            rel proxyPrim
            token outputs:surface.connect = </world/x.outputs:surface>
        }
    }

    over "ghost" (
        references = @other.usda@</hand>
    )
    {
    }
}
"#;

#[test]
fn usd_text_is_read_with_its_axes_units_and_time() {
    let rig = parse_usd(STAGE.as_bytes()).unwrap();
    let names: Vec<&str> = rig.nodes().iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["world", "hand", "sheet", "ghost"]);
    assert_eq!(rig.span(2), Some([0.5, 1.0]));
    // Turned by 90° about z, (100, 0, 0) cm is (0, 1, 0) m with z up, and (0, 0, -1) with y up.
    let place = rig.placement(1, 0.5).transform_point3(DVec3::ZERO);
    assert!(place.distance(DVec3::NEG_Z) < 1e-12, "{place}");
    let frames = follow(&rig, &["hand"], &[DVec3::new(1.0, 2.0, 3.0)], 24.0);
    assert_eq!(frames.len(), 13);
    for (number, frame) in frames.iter().enumerate() {
        let expected = DVec3::new(1.0, 2.0 + 0.505 * number as f64 / 12.0, 3.0);
        // A dozen roundings of numbers below 10.
        assert!(frame[0].distance(expected) < 1e-13, "{number}: {frame:?}");
    }
}

#[test]
fn a_stage_begins_at_its_start_code() {
    let start = |range: &str| {
        let stage = STAGE.replacen("defaultPrim", &format!("{range}\n defaultPrim"), 1);
        24.0 * parse_usd(stage.as_bytes()).unwrap().start
    };
    // The keys are at 12 and 24; ranges that say nothing are passed over.
    for (range, code) in [
        ("", 12.0),
        ("startTimeCode = 18", 18.0),
        ("startTimeCode = -3", -3.0),
        ("startTimeCode = 18\n endTimeCode = 40", 18.0),
        ("startTimeCode = 18\n endTimeCode = 1", 12.0),
        ("startTimeCode = 30", 12.0),
    ] {
        assert_eq!(start(range), code, "{range}");
    }
}

#[test]
fn every_order_of_turns_is_the_product_of_its_three() {
    let angles = DVec3::new(20.0, -35.0, 50.0);
    let about = |axis: usize| DQuat::from_axis_angle(DVec3::AXES[axis], angles[axis].to_radians());
    for order in [
        [0, 1, 2],
        [0, 2, 1],
        [1, 0, 2],
        [1, 2, 0],
        [2, 0, 1],
        [2, 1, 0],
    ] {
        let name: String = order.map(|axis| ['X', 'Y', 'Z'][axis]).iter().collect();
        let text = format!(
            "#usda 1.0\n(\n metersPerUnit = 1\n)\ndef Xform \"a\"\n{{\n float3 xformOp:rotate{name} = (20, -35, 50)\n uniform token[] xformOpOrder = [\"xformOp:rotate{name}\"]\n}}\n"
        );
        let rig = parse_usd(text.as_bytes()).unwrap();
        // The first axis turns first.
        let expected = about(order[2]) * about(order[1]) * about(order[0]);
        let point = DVec3::new(1.0, 2.0, 3.0);
        let found = rig.placement(0, 0.0).transform_point3(point);
        assert!(found.distance(expected * point) < 1e-14, "{name}");
    }
}

#[test]
fn a_matrix_of_usd_has_its_translation_in_the_last_row() {
    let text = r#"#usda 1.0
(
    metersPerUnit = 1
)
def "parent"
{
    double3 xformOp:translate = (100, 0, 0)
    uniform token[] xformOpOrder = ["xformOp:translate"]
    def "a"
    {
        matrix4d xformOp:transform = ( (0, 1, 0, 0), (-1, 0, 0, 0), (0, 0, 1, 0), (5, 6, 7, 1) )
        uniform token[] xformOpOrder = ["!resetXformStack!", "xformOp:transform"]
    }
}
"#;
    let rig = parse_usd(text.as_bytes()).unwrap();
    // x is turned into y; the parent does not count.
    let found = rig.placement(1, 0.0).transform_point3(DVec3::X);
    assert_eq!(found, DVec3::new(5.0, 7.0, 7.0));
}

#[test]
fn what_is_not_understood_is_named_with_its_line() {
    let cases = r#"
        #usda 1.0 | #sdf 1 | line 1: expected #usda 1.0
        "Z" | "X" | line 8: upAxis
        metersPerUnit = 0.01 | metersPerUnit = 0 | line 5: metersPerUnit
        (100, 0, 0) | (100, nan, 0) | expected a finite number, found nan
        defaultPrim | subLayers = [@a.usda@]\n defaultPrim | sublayers
        def Xform "hand" | deff Xform "hand" | hand
    "#;
    refuses(cases, |from, to| {
        assert!(STAGE.contains(from), "{from}");
        let parsed = parse_usd(STAGE.replacen(from, to, 1).as_bytes());
        parsed.map_err(|error| error.to_string())
    });
    let rig = parse_usd(STAGE.as_bytes()).unwrap();
    let ghost = problem(&rig, &["ghost"]);
    says(ghost, &["it is an over of what this file does not define"]);
    says(problem(&rig, &["none"]), &["[world, hand, sheet, ghost]"]);
    let shear = STAGE.replace("xformOp:orient", "xformOp:shear");
    let rig = parse_usd(shear.as_bytes()).unwrap();
    let words = ["xformOp:shear (line 32)", "not understood"];
    says(problem(&rig, &["hand"]), &words);
    says(parse_usd(b"PXR-USDC\0\0").unwrap_err(), &["version 0.0"]);
}

#[test]
fn damaged_usd_text_is_no_panic() {
    for (end, _) in STAGE.char_indices() {
        let _ = parse_usd(&STAGE.as_bytes()[..end]);
    }
    for at in 0..STAGE.len() {
        for sign in [b'(', b'}', b'"', b'@', b' ', 0xff] {
            let mut spoilt = STAGE.as_bytes().to_vec();
            spoilt[at] = sign;
            let _ = parse_usd(&spoilt);
        }
    }
    let deep = format!("#usda 1.0\n{}", "def \"a\" {\n".repeat(100_000));
    assert!(parse_usd(deep.as_bytes()).is_err());
    let brackets = format!("#usda 1.0\ndef \"a\" {{ int a = {}", "[".repeat(100_000));
    assert!(parse_usd(brackets.as_bytes()).is_err());
}

#[test]
fn a_mesh_that_is_compressed_is_refused_by_the_name_of_its_compression() {
    let bytes = arm_bytes(|json| {
        json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    });
    let read = Rig::parse(&bytes, RigFormat::Glb, Wanted::Meshes);
    let words = ["KHR_draco_mesh_compression", "without compression"];
    says(read.unwrap_err(), &words);
}
