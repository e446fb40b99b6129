//! Scenes as people write them: TOML, in which an unknown key is an error, and everything that is
//! named (a mesh, a material, a motion) is looked up and checked at once. All keys are described in
//! docs/src/reference/scene.md. A file whose name ends in `.json` is read as a scene of ARCSim.

use super::arcsim::parse_arcsim;
use super::loaded::LoadedScene;
use super::material_source::materials;
use super::motion_source::Stand;
use super::problem::{field, parse_toml, read_text, unknown};
use super::setting_file::{ResolvedSetting, SettingFile, usual_contact};
use super::spec::{SceneSpec, Setting, StartFile};
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::ending_of;
use selvedge_assets::SCENES;
use selvedge_cloth::Mesh;
use std::path::{Path, PathBuf};

/// The shipped scenes: names and TOML texts.
pub fn shipped_scenes() -> &'static [(&'static str, &'static str)] {
    SCENES
}

/// Opens a scene by the path of its file, by the name of a shipped one, or by a mesh that is to hang
/// (.obj, .glb, USD): from the two ends of its upper edge, made of the default fabric.
///
/// # Errors
/// [`FileError`] names the scene, the field and what is wrong.
pub fn open_scene(path_or_name: &str) -> Result<LoadedScene, FileError<Problem>> {
    let path = Path::new(path_or_name);
    let ending = ending_of(path);
    let has_ending = |of: &[&str]| of.contains(&ending.as_str());
    match SCENES.iter().find(|scene| scene.0 == path_or_name) {
        Some((_, text)) => parse_scene(text, Path::new(""), path_or_name),
        None if path.exists() && has_ending(&MESHES) => hung(path),
        None if path.exists() && has_ending(&OTHERS) => {
            let problem = "is neither a scene (.toml) nor a mesh that is read: export .obj, .glb or USD (.usda, .usdc, .usdz, .usd)";
            Err(FileError::new(path, problem))
        }
        None if path.exists() => read_scene(path),
        None => Err(FileError::new(path, unknown("scene", SCENES))),
    }
}

/// Endings of files with a mesh.
const MESHES: [&str; 6] = ["obj", "glb", "usda", "usdc", "usdz", "usd"];
/// Endings of files that are taken for scenes or meshes, and are neither.
const OTHERS: [&str; 14] = [
    "ply",
    "stl",
    "gltf",
    "fbx",
    "dae",
    "blend",
    "off",
    "msh",
    "vtk",
    "seg",
    "npz",
    "abc",
    "mdd",
    "safetensors",
];
/// Part of the height of a cloth that counts as its upper edge.
const UPPER: f64 = 0.05;

/// The mesh of a file, hung up by the two ends of its upper edge, along the longer of x and z.
fn hung(path: &Path) -> Result<LoadedScene, FileError<Problem>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let material = materials()[0].0;
    let parse = |handles: &[usize]| {
        let text = format!(
            "name = {}\nmaterial = \"{material}\"\nmesh = {{ file = {} }}\nstart = \"mesh\"\nhandles = {{ vertices = {handles:?} }}\n",
            toml::Value::String(name.to_string()),
            toml::Value::String(file.to_string()),
        );
        parse_scene(&text, folder, &path.display().to_string())
    };
    let free = parse(&[])?;
    let places = free.scene.mesh.positions();
    let [low, high] = [f64::min, f64::max].map(|of| places.iter().map(|p| p.y).reduce(of));
    let (low, high) = (low.unwrap_or(0.0), high.unwrap_or(0.0));
    let upper = (0..places.len()).filter(|v| places[*v].y >= high - UPPER * (high - low));
    let upper: Vec<usize> = upper.collect();
    let ends = |axis: usize| {
        let along = |a: &&usize, b: &&usize| places[**a][axis].total_cmp(&places[**b][axis]);
        let (least, greatest) = (upper.iter().min_by(along), upper.iter().max_by(along));
        least.zip(greatest).map(|(a, b)| [*a, *b])
    };
    let length = |axis: usize| ends(axis).map_or(0.0, |[a, b]| places[b][axis] - places[a][axis]);
    let axis = if length(0) > length(2) { 0 } else { 2 };
    let mut handles = ends(axis).map_or_else(Vec::new, |ends| ends.to_vec());
    handles.dedup();
    parse(&handles)
}

/// Reads a scene file: TOML, or ARCSim's JSON where the name ends in `.json`.
///
/// # Errors
/// [`FileError`] names the file, the field and what is wrong.
pub fn read_scene(path: &Path) -> Result<LoadedScene, FileError<Problem>> {
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    let loaded = read_text(path).and_then(|text| {
        if ending_of(path) != "json" {
            return resolve(&text, &folder);
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        let json: Option<serde_json::Map<String, serde_json::Value>> =
            serde_json::from_str(&text).ok();
        if json.is_some_and(|json| !["cloths", "frame_time"].iter().any(|key| json.contains_key(*key))) {
            let problem = "is JSON, but not a scene of ARCSim, which has cloths and a frame_time; scenes of Selvedge are TOML (.toml), meshes .obj, .glb or USD";
            return Err(Problem(problem.to_owned()));
        }
        parse_arcsim(&text, &folder, &name)
    });
    let mut loaded = loaded.map_err(FileError::at(path))?;
    loaded.files.push(path.to_owned());
    Ok(loaded)
}

/// Reads a scene from the text of its file; paths in it are relative to `folder`, and errors
/// begin with `origin`.
///
/// # Errors
/// [`FileError`] names the origin, the field and what is wrong.
pub fn parse_scene(
    text: &str,
    folder: &Path,
    origin: &str,
) -> Result<LoadedScene, FileError<Problem>> {
    resolve(text, folder).map_err(FileError::at(origin.as_ref()))
}

fn resolve(text: &str, folder: &Path) -> Result<LoadedScene, Problem> {
    let mut file: SettingFile = parse_toml(text)?;
    let name = file.name.take();
    let name = name.ok_or_else(|| field("name", "is missing"))?;
    let motion_source = file.motion.take().unwrap_or_default();
    let (start, dress) = (file.start.take(), file.dress.take());
    let mut files = Vec::new();
    let ResolvedSetting {
        mut setting,
        mut read,
        groups,
        leaves_contact_open,
    } = file.resolve(folder, &mut files)?;
    if leaves_contact_open && layers_can_meet(&read.sheet.mesh, &setting) {
        setting.contact = Some(usual_contact(&mut read));
    }
    let stand = Stand::of(&setting, &read.sheet.mesh, &groups);
    let motion = motion_source.resolve(folder, &stand)?;
    files.extend(motion_source.file().map(|file| folder.join(file)));
    // What nothing holds has no rest pose.
    let has_rest = !setting.handles.is_empty() && dress.is_none();
    let start = start.unwrap_or(if has_rest { StartFile::Rest } else { StartFile::Mesh });
    if let Some(body) = &dress {
        check_dress(body, &start, &setting)?;
    }
    let vertices = read.sheet.mesh.topology().vertex_count();
    let (start, state) = start.resolve(folder, vertices, setting.frame_rate)?;
    let remedy = setting.mesh.remedy();
    let spec = SceneSpec {
        name,
        setting,
        motion,
        start,
        dress,
    };
    LoadedScene::of(spec, read, state, files, folder, &remedy)
}

/// Checks that a scene has the body that the cloth is to be put onto. With a body it has contact.
fn check_dress(body: &str, start: &StartFile, setting: &Setting) -> Result<(), Problem> {
    let wrong = |problem: String| Err(field("dress", problem));
    if matches!(start, StartFile::Rest | StartFile::State { .. }) {
        let problem = "puts the cloth onto a body from where the mesh stands: write start = \"mesh\", \"untangle\" or \"fit\"";
        return wrong(problem.to_owned());
    }
    let names: Vec<&str> = setting.obstacles.iter().map(|o| o.name.as_str()).collect();
    if !names.contains(&body) {
        let known = if names.is_empty() {
            "there is none".to_owned()
        } else {
            format!("there are {}", names.join(", "))
        };
        return wrong(format!("there is no obstacle {body:?}: {known}"));
    }
    Ok(())
}

/// Returns true where a cloth without contact would pass through something: an obstacle, another
/// piece, or the other side of what is sewn.
fn layers_can_meet(mesh: &Mesh, setting: &Setting) -> bool {
    let has_pieces = mesh.topology().sheets().iter().any(|sheet| *sheet > 0);
    !setting.obstacles.is_empty() || has_pieces || mesh.pattern().is_sewn()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::npz::tests::{archive, floats};
    use crate::scene::StartSpec;
    use crate::test_help::says;
    use selvedge_cloth::VertexId;

    /// A scene of this mesh of about 100 vertices, with these lines.
    fn parse(mesh: &str, rest: &str) -> Result<LoadedScene, String> {
        let text = format!(
            "name = \"s\"\nmaterial = \"gray-interlock\"\nmesh = {{ generator = {{ {mesh}, seed = 1 }} }}\n{rest}\n"
        );
        parse_scene(&text, Path::new(""), "s").map_err(|error| error.to_string())
    }

    const SQUARE: &str = "kind = \"square\", size = 1.0, vertices = 100";
    const TUBE: &str = "kind = \"tube\", width = 1.0, size = 0.5, vertices = 100";
    const BALL: &str = "obstacles = [{ name = \"post\", sphere = { radius = 0.1 } }]";
    const HELD: &str = "handles = { vertices = [0] }\n";

    #[test]
    fn what_is_not_said_hangs_still_or_falls() {
        let sheet = "kind = \"rectangle\", width = 2.0, size = 1.0, density = 50";
        let free = parse(sheet, "").unwrap();
        assert_eq!(free.scene.mesh.topology().vertex_count(), 100);
        assert!(free.scene.handles.vertices().is_empty());
        assert_eq!(free.spec.start, StartSpec::Mesh);
        assert_eq!(free.warnings.len(), 1, "{:?}", free.warnings);
        let onto = parse(sheet, BALL).unwrap();
        assert!(onto.warnings.is_empty(), "{:?}", onto.warnings);
        let hung = parse(sheet, "handles = { label = \"upper-corners\" }").unwrap();
        assert!(hung.warnings.is_empty());
        let path = hung.scene.handle_path().unwrap();
        assert_eq!(path.at(0.0), path.at(5.0));
    }

    #[test]
    fn contact_is_on_where_layers_can_meet_unless_it_is_said_to_be_off() {
        let contact = |mesh: &str, rest: &str| {
            let loaded = parse(mesh, &format!("{HELD}{rest}")).unwrap();
            (loaded.scene.contact, loaded.warnings.len())
        };
        for (mesh, rest, thickness) in [
            (SQUARE, "", None),
            (TUBE, "", Some(1e-3)),
            (TUBE, "contact = false", None),
            (TUBE, "contact = { thickness = 0.002 }", Some(2e-3)),
            (SQUARE, BALL, Some(1e-3)),
        ] {
            let (found, warnings) = contact(mesh, rest);
            assert_eq!(found.map(|contact| contact.thickness), thickness, "{rest}");
            assert_eq!(warnings, 0, "{rest}");
        }
        // What is not said of contact is chosen by the edges, too.
        let small = "kind = \"tube\", width = 0.01, size = 0.005, vertices = 100";
        let (usual, warnings) = contact(small, "");
        let usual = usual.unwrap().thickness;
        assert!(usual < 2e-4 && warnings > 0);
        for (said, expected) in [("", usual), ("thickness = 5e-5", 5e-5)] {
            let (found, _) = contact(small, &format!("contact = {{ friction = 0.5, {said} }}"));
            let found = found.unwrap();
            assert_eq!((found.thickness, found.friction), (expected, 0.5));
            found.validate().unwrap();
        }
        for (rest, words) in [
            ("contact = { thicknes = 1 }", ["thicknes", "line"]),
            (&format!("contact = false\n{BALL}"), ["no contact", "write"]),
        ] {
            says(parse(SQUARE, rest).unwrap_err(), &words);
        }
    }

    #[test]
    fn a_cloth_is_put_onto_an_obstacle_from_where_the_mesh_stands() {
        let parse = |rest: &str| parse(TUBE, &format!("{HELD}{BALL}\ndress = {rest}"));
        let spec = parse("\"post\"").unwrap().spec;
        assert_eq!(spec.start, StartSpec::Mesh);
        assert_eq!(spec.dress.as_deref(), Some("post"));
        let again = SceneSpec::from_json(&spec.to_json().unwrap()).unwrap();
        assert_eq!(again, spec);
        // It begins without the velocities of its file.
        let folder = tempfile::tempdir().unwrap();
        let mesh = "v 0 1 0\nnv 0 1 0\nv 1 1 0\nnv 0 0 0\nv 0 2 0\nnv 0 0 0\nf 1 2 3\n";
        std::fs::write(folder.path().join("m.obj"), mesh).unwrap();
        for (dress, has_state) in [("", true), ("dress = \"post\"\n", false)] {
            let text = format!(
                "name = \"s\"\nmaterial = \"gray-interlock\"\nmesh = {{ file = \"m.obj\" }}\nstart = \"mesh\"\nhandles = {{ vertices = [] }}\n{BALL}\n{dress}"
            );
            let loaded = parse_scene(&text, folder.path(), "s").unwrap();
            assert_eq!(loaded.state.is_some(), has_state);
        }
        let spec = parse("\"post\"\nstart = \"untangle\"").unwrap().spec;
        assert_eq!(spec.start, StartSpec::Untangle);
        for (rest, said) in [
            ("\"pole\"", "there are post"),
            ("\"post\"\nstart = \"rest\"", "start = \"mesh\""),
        ] {
            says(parse(rest).unwrap_err(), &[said]);
        }
    }

    #[test]
    fn a_mesh_is_hung_by_the_ends_of_its_upper_edge() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my \"sheet\".obj");
        let text = "v 0 0 0\nv 0 0 1\nv 0 1 1.2\nv 0 1 0.5\nv 0 1.01 -0.1\nf 1 2 3 4 5\n";
        std::fs::write(&path, text).unwrap();
        let loaded = open_scene(&path.to_string_lossy()).unwrap();
        assert_eq!(loaded.scene.handles.vertices(), [4, 2].map(VertexId));
        assert_eq!(loaded.scene.name, "my \"sheet\"");
        assert_eq!(loaded.spec.start, StartSpec::Mesh);
        assert!(loaded.warnings.is_empty(), "{:?}", loaded.warnings);
    }

    #[test]
    fn a_file_that_is_no_scene_is_named_for_what_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let problem = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            open_scene(&path.to_string_lossy()).unwrap_err().to_string()
        };
        for name in ["a.ply", "a.STL", "a.abc"] {
            let found = problem(name, &[0xff, 0, 1]);
            let words = "is neither a scene (.toml) nor a mesh that is read: export .obj";
            says(found, &[words]);
        }
        let found = problem("a.json", b"{\"pattern\": {}}");
        says(found, &["not a scene of ARCSim"]);
        // A mesh by any of its endings.
        let found = problem("a.usd", b"#usda 1.0\ndef \"a\" {\n}\n");
        says(found, &["has no mesh"]);
    }

    #[test]
    fn a_scene_knows_every_file_that_it_was_read_from() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let write = |name: &str, bytes: &[u8]| std::fs::write(at(name), bytes).unwrap();
        write("sheet.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
        write("mine.toml", b"from = \"gray-interlock\"\n");
        write("stiff.toml", b"from = \"mine.toml\"\nbend_multiplier = 2\n");
        let still = b"kind = \"blocks\"\nblocks = [{ duration = 1.0 }]\n";
        write("still.toml", still);
        let zeros = floats("(3, 3)", &[0.0; 9]);
        let state = archive(&[("positions", zeros.clone()), ("velocities", zeros)]);
        write("run.npz", &state);
        let scene = "name = \"s\"\nmaterial = \"stiff.toml\"\nmesh = { obj = \"sheet.obj\" }\n\
            handles = { vertices = [0] }\nmotion = { file = \"still.toml\" }\n\
            start = { state = { file = \"run.npz\" } }\n";
        write("scene.toml", scene.as_bytes());
        let mut files = read_scene(&at("scene.toml")).unwrap().files;
        files.sort();
        let names = "mine.toml run.npz scene.toml sheet.obj stiff.toml still.toml";
        assert!(files.into_iter().eq(names.split(' ').map(at)));
        assert!(open_scene("default").unwrap().files.is_empty());
    }
}
