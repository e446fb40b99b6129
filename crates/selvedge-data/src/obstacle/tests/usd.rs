//! What of a USD stage is a body, and what is said of the rest.

use super::Desk;
use crate::test_help::{says, table};

/// A prim of a triangle; `with` is in its brackets, `meta` in its parentheses.
fn prim(name: &str, meta: &str, with: &str) -> String {
    format!(
        "def Mesh \"{name}\" ({meta})\n{{\n    int[] faceVertexCounts = [3]\n    \
        int[] faceVertexIndices = [0, 1, 2]\n    \
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n    {with}\n}}\n"
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
        instanceable = true\nprepend references = </leaf> | references
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
        let material = other.replace("Xform", "Material");
        for stage in [unseen, material] {
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
