//! What of a USD stage is a body, and what is said of the rest.

use super::{TestFolder, at};
use crate::test_help::{says, table};

/// A prim of a triangle; `with` is in its brackets, `meta` in its parentheses.
fn prim(name: &str, meta: &str, with: &str) -> String {
    format!(
        "def Mesh \"{name}\" ({meta})\n{{\n    int[] faceVertexCounts = [3]\n    \
        int[] faceVertexIndices = [0, 1, 2]\n    \
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n    \
        uniform token subdivisionScheme = \"none\"\n    {with}\n}}\n"
    )
}

/// A prim with others in it.
fn around(inner: &str, first: &str, with: &str) -> String {
    format!("{first}\n{{\n    {with}\n    {inner}}}\n")
}

/// Points of the body in these prims, and the warnings.
fn read(dir: &TestFolder, prims: &str) -> Result<(usize, Vec<String>), String> {
    let stage = format!("#usda 1.0\n(\n    metersPerUnit = 1\n)\n{prims}");
    dir.write("leaf.usda", stage);
    let (made, warnings) = dir.warned("name = \"leaf\"\nmesh = \"leaf.usda\"")?;
    Ok((made.point_count(), warnings))
}

/// Checks that these prims make one triangle, with one warning of these words, or none of none.
#[track_caller]
fn warns(prims: &str, words: &[&str]) {
    let (points, warnings) = read(&TestFolder::new(), prims).unwrap();
    let expected = usize::from(!words.is_empty());
    assert_eq!(
        (points, warnings.len()),
        (3, expected),
        "{warnings:?} {prims}"
    );
    says(warnings.concat(), words);
}

/// Checks that there is no body in these prims, and that the error has these words.
#[track_caller]
fn refuses(prims: &str, words: &[&str]) {
    says(read(&TestFolder::new(), prims).unwrap_err(), words);
}

#[test]
fn what_is_not_seen_is_no_body_and_is_said() {
    let leaf = prim("leaf", "", "");
    warns(&leaf, &[]);
    let inner = prim("inner", "", "");
    let invisible = "token visibility = \"invisible\"";
    let guide = "uniform token purpose = \"guide\"";
    let unseen = "1 meshes are invisible";
    let inactive = "1 meshes are inactive (active = false)";
    let undefined = "1 meshes are in an over of what this file does not define";
    for (hidden, said) in [
        (prim("inner", "", invisible), unseen),
        (prim("inner", "", guide), unseen),
        (around(&inner, "def Xform \"a\"", invisible), unseen),
        (around(&inner, "def Scope \"a\"", guide), unseen),
        (prim("inner", "active = false", ""), inactive),
        (around(&inner, "def \"a\" (active = false)", ""), inactive),
        (around(&inner, "over \"a\"", ""), undefined),
    ] {
        let warning = format!("obstacles[\"leaf\"].mesh: leaf.usda: {said}");
        warns(&format!("{leaf}{hidden}"), &[&warning, "\"inner\""]);
        // Alone it leaves nothing, and the error says why.
        refuses(&hidden, &[&format!("has no mesh; {said}")]);
    }
    let class = around(&inner, "class Xform \"a\"", "");
    warns(&format!("{leaf}{class}"), &[]);
    let shown = "token visibility = \"inherited\"\n    uniform token purpose = \"render\"";
    let shown = prim("shown", "", shown);
    let proxy = prim("stand", "", "uniform token purpose = \"proxy\"");
    warns(&proxy, &[]);
    warns(&format!("{proxy}{shown}"), &["the first is \"stand\""]);
}

#[test]
fn what_comes_from_elsewhere_is_an_error_that_names_it() {
    let leaf = prim("leaf", "", "");
    let cases = r#"
        prepend references = @./a.usda@</body> | has references
        references = [</leaf>, </leaf>] | has references
        prepend references = @other.usda@</x> (offset = 2; scale = 0.5) | has references
        prepend references = </leaf> (offset = 2) | has references
        payload = @a.usdc@ | has payload
        prepend inherits = </leaf> | has inherits
        specializes = </leaf> | has specializes
        prepend variantSets = "size" | has variantSets
    "#;
    for [meta, named] in table(cases) {
        let other = format!("def Xform \"other\" ({meta})\n{{\n}}\n");
        for stage in [&other, &format!("{leaf}{other}")] {
            refuses(stage, &["node \"other\"", named, "usdcat --flatten"]);
        }
        // What is not seen, or is of looks alone, brings no body.
        let invisible = "token visibility = \"invisible\"";
        let unseen = around(&other, "def Xform \"a\"", invisible);
        let inactive = other.replace(meta, &format!("{meta}\nactive = false"));
        let material = other.replace("Xform", "Material");
        for stage in [unseen, inactive, material] {
            let found = read(&TestFolder::new(), &format!("{leaf}{stage}")).unwrap();
            assert_eq!(found.0, 3, "{stage}");
        }
    }
    let instancer = "def PointInstancer \"many\"\n{\n    int[] protoIndices = [0]\n}\n";
    let words = ["node \"many\": its instances are not read"];
    refuses(&format!("{leaf}{instancer}"), &words);
}

#[test]
fn instances_within_the_file_are_bodies_of_their_own() {
    let dir = TestFolder::new();
    let twig = around(&prim("leaf", "", ""), "def Xform \"twig\"", "");
    let original = around(&twig, "over \"Flattened_Prototype_1\"", "");
    let instance = |name: &str, x: f64, path: &str| {
        format!(
            "def Xform \"{name}\" (\n    instanceable = true\n    prepend references = <{path}>\n)\n{{\n    \
            double3 xformOp:translate = ({x}, 0, 0)\n    \
            uniform token[] xformOpOrder = [\"xformOp:translate\"]\n}}\n"
        )
    };
    let path = "/Flattened_Prototype_1";
    let [one, two] = [instance("one", 5.0, path), instance("two", 7.0, path)];
    // Within an original, too.
    let tree = around(&two, "over \"Flattened_Prototype_2\"", "");
    let three = instance("three", 20.0, "/Flattened_Prototype_2");
    let stage = format!("#usda 1.0\n(\n    metersPerUnit = 1\n)\n{one}{three}{original}{tree}");
    dir.write("tree.usda", stage);
    let (xs, _) = sorted_xs(&dir, "tree.usda");
    assert_eq!(xs, [5.0, 5.0, 6.0, 27.0, 27.0, 28.0]);
    warns(&format!("{original}{one}"), &[]);
    // What cannot be followed: nothing there, itself, or with prims of its own.
    let gone = instance("one", 0.0, "/Gone");
    let itself = instance("one", 0.0, "/one");
    let own = instance("one", 5.0, path).replace("]\n}", "]\n    over \"twig\"\n    {\n    }\n}");
    for one in [gone, itself, own] {
        let named = "node \"one\": its reference to </";
        let remedies = [named, "instanceable = false", "export .glb"];
        refuses(&format!("{original}{one}"), &remedies);
    }
}

/// The places of the points of a body along x, in order, and the warnings.
fn sorted_xs(dir: &TestFolder, file: &str) -> (Vec<f64>, Vec<String>) {
    let text = format!("name = \"t\"\nmesh = \"{file}\"");
    let (made, warnings) = dir.warned(&text).unwrap();
    let mut xs: Vec<f64> = at(&made, 0.0).iter().map(|p| p.x).collect();
    xs.sort_by(f64::total_cmp);
    (xs, warnings)
}

/// A crate of two instances of a triangle, a cage whose visibility changes in time, beside a prim
/// that is inactive, one that is an over, and one that is empty; written with Sdf of OpenUSD.
const CRATE: &[u8] = include_bytes!("../../../tests/fixtures/caches/instances.usdc");

#[test]
fn a_crate_says_what_text_says() {
    let dir = TestFolder::new();
    dir.write("tree.usdc", CRATE);
    let (xs, warnings) = sorted_xs(&dir, "tree.usdc");
    assert_eq!(xs, [5.0, 5.0, 6.0, 7.0, 7.0, 8.0]);
    let words = [
        "1 meshes are inactive",
        "1 meshes are in an over",
        "2 meshes are subdivision surfaces",
        "2 meshes have a visibility that changes in time",
        "1 meshes have no points or no faces",
    ];
    assert_eq!(warnings.len(), words.len(), "{warnings:?}");
    for (warning, words) in warnings.iter().zip(words) {
        says(warning, &[words]);
    }
}

#[test]
fn references_that_multiply_are_refused() {
    let mut stage = prim("leaf0", "", "");
    for level in 1..40 {
        let to = level - 1;
        let pair = format!(
            "def \"a\" (references = </leaf{to}>)\n{{\n}}\ndef \"b\" (references = </leaf{to}>)\n{{\n}}\n"
        );
        stage.push_str(&around(&pair, &format!("def \"leaf{level}\""), ""));
    }
    refuses(&stage, &["make more than 100000 prims"]);
}

#[test]
fn cages_holes_and_empty_meshes_are_said() {
    let leaf = prim("leaf", "", "");
    let cage = leaf.replace("\"none\"", "\"catmullClark\"");
    let silent = leaf.replace("uniform token subdivisionScheme = \"none\"", "");
    for cage in [cage, silent] {
        let words = ["1 meshes are subdivision surfaces", "cages", "\"none\""];
        warns(&cage, &words);
    }
    let blinks = "token visibility.timeSamples = { 0: \"inherited\", 5: \"invisible\" }";
    let blinks = prim("leaf", "", blinks);
    warns(&blinks, &["visibility that changes in time"]);
    let two = "int[] faceVertexCounts = [3, 3]\n    int[] faceVertexIndices = [0, 1, 2, 3, 1, 0]\n    \
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]\n    uniform token subdivisionScheme = \"none\"\n";
    let holed = format!("def Mesh \"a\"\n{{\n    {two}    int[] holeIndices = [1]\n}}\n");
    warns(&holed, &[]);
    // A mesh without points, or with one in place of many, counts beside good ones.
    let empty = "def Mesh \"nothing\"\n{\n}\n".to_owned();
    let one = leaf.replace(
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
        "point3f points = (0, 0, 0)",
    );
    for empty in [empty, one] {
        let (points, warnings) = read(&TestFolder::new(), &format!("{empty}{leaf}")).unwrap();
        assert_eq!(points, 3);
        let words = ["1 meshes have no points or no faces"];
        says(warnings.last().unwrap(), &words);
        refuses(&empty, &["its mesh has no points"]);
    }
}

const MOVING: &str = "name = \"leaf\"\nmesh = \"leaf.usda\"\nmotion = \"leaf.usda\"";

#[test]
fn a_motion_that_nobody_asks_for_is_said() {
    let dir = TestFolder::new();
    let moves = "double3 xformOp:translate.timeSamples = { 24: (0, 0, 0), 72: (1, 0, 0) }\n    \
        uniform token[] xformOpOrder = [\"xformOp:translate\"]";
    let (_, warnings) = read(&dir, &prim("leaf", "", moves)).unwrap();
    let from = "leaf.usda: it moves from 1.000 s to 3.000 s";
    says(&warnings[0], &[from, "motion = \"leaf.usda\" plays it"]);
    assert_eq!(dir.warned(MOVING).unwrap().1, [""; 0]);
}

#[test]
fn skeletons_blend_shapes_and_shapes_are_warned_of() {
    let leaf = prim("leaf", "", "");
    for with in [
        "rel skel:skeleton = </body/skel>",
        "int[] primvars:skel:jointIndices = [0, 0, 0] (\n        elementSize = 1\n    )",
        "uniform token[] skel:blendShapes = [\"nose\"]",
    ] {
        let bound = prim("leaf", "", with);
        let said = "skeleton or blend shapes, which are not read";
        warns(&bound, &[said, "\"leaf\""]);
        // A motion that it would give says the same.
        let dir = TestFolder::new();
        read(&dir, &bound).unwrap();
        let words = ["nothing in it moves", "skeleton or blend shapes"];
        says(dir.problem(MOVING), &words);
    }
    let ball = "def Sphere \"ball\"\n{\n    double radius = 1\n}\n";
    let words = ["shapes without a mesh", "\"ball\""];
    warns(&format!("{leaf}{ball}"), &words);
    refuses(ball, &["has no mesh; 1 prims"]);
}

#[test]
fn a_body_in_another_unit_is_warned_of() {
    for scale in [0.001, 200.0] {
        let scale = format!(
            "float3 xformOp:scale = ({scale}, {scale}, {scale})\n    \
            uniform token[] xformOpOrder = [\"xformOp:scale\"]"
        );
        let words = ["m long: is its file in metres? transform.scale"];
        warns(&prim("leaf", "", &scale), &words);
    }
}
