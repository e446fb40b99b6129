//! What of a USD stage is a body, and what is said of the rest.

use super::Desk;
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
fn read(desk: &Desk, prims: &str) -> Result<(usize, Vec<String>), String> {
    let stage = format!("#usda 1.0\n(\n    metersPerUnit = 1\n)\n{prims}");
    desk.write("leaf.usda", stage);
    let spec = desk.spec("name = \"leaf\"\nmesh = \"leaf.usda\"")?;
    let mut warnings = Vec::new();
    let made = spec.build(desk.0.path(), 60.0, &mut warnings);
    let made = made.map_err(|error| error.to_string())?;
    Ok((made.point_count(), warnings))
}

#[test]
fn what_is_not_seen_is_no_body_and_is_said() {
    let desk = Desk::new();
    let leaf = prim("leaf", "", "");
    assert_eq!(read(&desk, &leaf).unwrap(), (3, Vec::new()));
    let inner = prim("inner", "", "");
    let hidden = [
        prim("inner", "", "token visibility = \"invisible\""),
        prim("inner", "", "uniform token purpose = \"guide\""),
        around(
            &inner,
            "def Xform \"a\"",
            "token visibility = \"invisible\"",
        ),
        around(
            &inner,
            "def Scope \"a\"",
            "uniform token purpose = \"guide\"",
        ),
    ];
    for hidden in hidden {
        let (points, warnings) = read(&desk, &format!("{leaf}{hidden}")).unwrap();
        assert_eq!((points, warnings.len()), (3, 1), "{hidden}");
        says(
            &warnings[0],
            &[
                "obstacles[\"leaf\"].mesh: leaf.usda: 1 meshes are invisible",
                "\"inner\"",
            ],
        );
        // Alone it leaves nothing, and the error says why.
        let problem = read(&desk, &hidden).unwrap_err();
        says(&problem, &["has no mesh; 1 meshes are invisible"]);
    }
    for inner in [
        prim("inner", "active = false", ""),
        around(&inner, "def \"a\" (active = false)", ""),
    ] {
        let (points, warnings) = read(&desk, &format!("{leaf}{inner}")).unwrap();
        assert_eq!((points, warnings.len()), (3, 1), "{inner}");
        says(
            &warnings[0],
            &["1 meshes are inactive (active = false)", "\"inner\""],
        );
    }
    let over = around(&inner, "over \"a\"", "");
    let (points, warnings) = read(&desk, &format!("{leaf}{over}")).unwrap();
    assert_eq!((points, warnings.len()), (3, 1));
    says(
        &warnings[0],
        &["1 meshes are in an over of what this file does not define"],
    );
    says(
        read(&desk, &over).unwrap_err(),
        &["has no mesh; 1 meshes are in an over"],
    );
    let class = around(&inner, "class Xform \"a\"", "");
    assert_eq!(
        read(&desk, &format!("{leaf}{class}")).unwrap(),
        (3, Vec::new())
    );
    let shown = "token visibility = \"inherited\"\n    uniform token purpose = \"render\"";
    let shown = prim("shown", "", shown);
    let proxy = prim("stand", "", "uniform token purpose = \"proxy\"");
    assert_eq!(read(&desk, &proxy).unwrap().0, 3);
    let (points, warnings) = read(&desk, &format!("{proxy}{shown}")).unwrap();
    assert_eq!(points, 3);
    says(&warnings[0], &["the first is \"stand\""]);
}

#[test]
fn what_comes_from_elsewhere_is_an_error_that_names_it() {
    let desk = Desk::new();
    let leaf = prim("leaf", "", "");
    let cases = r#"
        prepend references = @./a.usda@</body> | references
        references = [</leaf>, </leaf>] | references
        prepend references = @other.usda@</x> (offset = 2; scale = 0.5) | references
        prepend references = </leaf> (offset = 2) | references
        payload = @a.usdc@ | payload
        prepend inherits = </leaf> | inherits
        specializes = </leaf> | specializes
        prepend variantSets = "size" | variantSets
    "#;
    for [meta, named] in table(cases) {
        let other = format!("def Xform \"other\" ({meta})\n{{\n}}\n");
        for stage in [&other, &format!("{leaf}{other}")] {
            says(
                read(&desk, stage).unwrap_err(),
                &[
                    "node \"other\"",
                    &format!("has {named}"),
                    "usdcat --flatten",
                ],
            );
        }
        // What is not seen, or is of looks alone, brings no body.
        let unseen = around(
            &other,
            "def Xform \"a\"",
            "token visibility = \"invisible\"",
        );
        let inactive = other.replace(meta, &format!("{meta}\nactive = false"));
        let material = other.replace("Xform", "Material");
        for stage in [unseen, inactive, material] {
            assert_eq!(read(&desk, &format!("{leaf}{stage}")).unwrap().0, 3);
        }
    }
    let instancer = "def PointInstancer \"many\"\n{\n    int[] protoIndices = [0]\n}\n";
    says(
        read(&desk, &format!("{leaf}{instancer}")).unwrap_err(),
        &["node \"many\": its instances are not read"],
    );
}

#[test]
fn instances_within_the_file_are_bodies_of_their_own() {
    let desk = Desk::new();
    let original = around(
        &around(&prim("leaf", "", ""), "def Xform \"twig\"", ""),
        "over \"Flattened_Prototype_1\"",
        "",
    );
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
    desk.write("tree.usda", stage);
    let made = desk.read("name = \"t\"\nmesh = \"tree.usda\"").unwrap();
    let mut found: Vec<f64> = super::at(&made, 0.0).iter().map(|p| p.x).collect();
    found.sort_by(f64::total_cmp);
    assert_eq!(found, [5.0, 5.0, 6.0, 27.0, 27.0, 28.0]);
    assert_eq!(read(&desk, &format!("{original}{one}")).unwrap().1, [""; 0]);
    // What cannot be followed: nothing there, itself, or with prims of its own.
    let own = instance("one", 5.0, path).replace("]\n}", "]\n    over \"twig\"\n    {\n    }\n}");
    for one in [
        instance("one", 0.0, "/Gone"),
        instance("one", 0.0, "/one"),
        own,
    ] {
        says(
            read(&desk, &format!("{original}{one}")).unwrap_err(),
            &[
                "node \"one\": its reference to </",
                "instanceable = false",
                "export .glb",
            ],
        );
    }
}

/// A crate of two instances of a triangle, a cage whose visibility changes in time, beside a prim
/// that is inactive, one that is an over, and one that is empty; written with Sdf of OpenUSD.
const CRATE: &[u8] = include_bytes!("../../../tests/fixtures/caches/instances.usdc");

#[test]
fn a_crate_says_what_text_says() {
    let desk = Desk::new();
    desk.write("tree.usdc", CRATE);
    let spec = desk.spec("name = \"t\"\nmesh = \"tree.usdc\"").unwrap();
    let mut warnings = Vec::new();
    let made = spec.build(desk.0.path(), 60.0, &mut warnings).unwrap();
    let mut found: Vec<f64> = super::at(&made, 0.0).iter().map(|p| p.x).collect();
    found.sort_by(f64::total_cmp);
    assert_eq!(found, [5.0, 5.0, 6.0, 7.0, 7.0, 8.0]);
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
    let desk = Desk::new();
    let mut stage = prim("leaf0", "", "");
    for level in 1..40 {
        let to = level - 1;
        let pair = format!(
            "def \"a\" (references = </leaf{to}>)\n{{\n}}\ndef \"b\" (references = </leaf{to}>)\n{{\n}}\n"
        );
        stage.push_str(&around(&pair, &format!("def \"leaf{level}\""), ""));
    }
    says(
        read(&desk, &stage).unwrap_err(),
        &["make more than 100000 prims"],
    );
}

#[test]
fn cages_holes_and_empty_meshes_are_said() {
    let desk = Desk::new();
    let leaf = prim("leaf", "", "");
    let cage = leaf.replace("\"none\"", "\"catmullClark\"");
    let silent = leaf.replace("uniform token subdivisionScheme = \"none\"", "");
    for cage in [cage, silent] {
        let (points, warnings) = read(&desk, &cage).unwrap();
        assert_eq!((points, warnings.len()), (3, 1), "{cage}");
        says(
            &warnings[0],
            &["1 meshes are subdivision surfaces", "cages", "\"none\""],
        );
    }
    let blinks = prim(
        "leaf",
        "",
        "token visibility.timeSamples = { 0: \"inherited\", 5: \"invisible\" }",
    );
    let (points, warnings) = read(&desk, &blinks).unwrap();
    assert_eq!((points, warnings.len()), (3, 1));
    says(&warnings[0], &["visibility that changes in time"]);
    let two = "int[] faceVertexCounts = [3, 3]\n    int[] faceVertexIndices = [0, 1, 2, 3, 1, 0]\n    \
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]\n    uniform token subdivisionScheme = \"none\"\n";
    let holed = format!("def Mesh \"a\"\n{{\n    {two}    int[] holeIndices = [1]\n}}\n");
    assert_eq!(read(&desk, &holed).unwrap(), (3, Vec::new()));
    // A mesh without points, or with one in place of many, counts beside good ones.
    let empty = "def Mesh \"nothing\"\n{\n}\n".to_owned();
    let one = leaf.replace(
        "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
        "point3f points = (0, 0, 0)",
    );
    for empty in [empty, one] {
        let (points, warnings) = read(&desk, &format!("{empty}{leaf}")).unwrap();
        assert_eq!(points, 3);
        says(
            warnings.last().unwrap(),
            &["1 meshes have no points or no faces"],
        );
        says(
            read(&desk, &empty).unwrap_err(),
            &["its mesh has no points"],
        );
    }
}

#[test]
fn a_motion_that_nobody_asks_for_is_said() {
    let desk = Desk::new();
    let moves = "double3 xformOp:translate.timeSamples = { 24: (0, 0, 0), 72: (1, 0, 0) }\n    \
        uniform token[] xformOpOrder = [\"xformOp:translate\"]";
    let (_, warnings) = read(&desk, &prim("leaf", "", moves)).unwrap();
    says(
        warnings.first().unwrap(),
        &[
            "leaf.usda: it moves from 1.000 s to 3.000 s",
            "motion = \"leaf.usda\" plays it",
        ],
    );
    let asked = desk
        .spec("name = \"leaf\"\nmesh = \"leaf.usda\"\nmotion = \"leaf.usda\"")
        .unwrap();
    let mut warnings = Vec::new();
    asked.build(desk.0.path(), 60.0, &mut warnings).unwrap();
    assert!(warnings.is_empty(), "{warnings:?}");
}

#[test]
fn skeletons_blend_shapes_and_shapes_are_warned_of() {
    let desk = Desk::new();
    for with in [
        "rel skel:skeleton = </body/skel>",
        "int[] primvars:skel:jointIndices = [0, 0, 0] (\n        elementSize = 1\n    )",
        "uniform token[] skel:blendShapes = [\"nose\"]",
    ] {
        let (points, warnings) = read(&desk, &prim("leaf", "", with)).unwrap();
        assert_eq!((points, warnings.len()), (3, 1), "{with}");
        says(
            &warnings[0],
            &["skeleton or blend shapes, which are not read", "\"leaf\""],
        );
        // A motion that it would give says the same.
        let moving = "name = \"leaf\"\nmesh = \"leaf.usda\"\nmotion = \"leaf.usda\"";
        says(
            desk.problem(moving),
            &["nothing in it moves", "skeleton or blend shapes"],
        );
    }
    let ball = "def Sphere \"ball\"\n{\n    double radius = 1\n}\n";
    let leaf = prim("leaf", "", "");
    let (points, warnings) = read(&desk, &format!("{leaf}{ball}")).unwrap();
    assert_eq!(points, 3);
    says(&warnings[0], &["shapes without a mesh", "\"ball\""]);
    says(read(&desk, ball).unwrap_err(), &["has no mesh; 1 prims"]);
}

#[test]
fn a_body_in_another_unit_is_warned_of() {
    let desk = Desk::new();
    for scale in [0.001, 200.0] {
        let scale = format!(
            "float3 xformOp:scale = ({scale}, {scale}, {scale})\n    \
            uniform token[] xformOpOrder = [\"xformOp:scale\"]"
        );
        let (_, warnings) = read(&desk, &prim("leaf", "", &scale)).unwrap();
        says(
            &warnings[0],
            &["m long: is its file in metres? transform.scale"],
        );
    }
}
