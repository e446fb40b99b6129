//! Caches that are learned from: what we write comes back, handles are numbered or named, and what
//! is missing is said.

use super::*;
use crate::export::ExportFormat;
use crate::test_help::{exported, says};
use crate::trajectory::test_square::moving_square;
use tempfile::TempDir;

fn cache(format: ExportFormat, ending: &str) -> TempDir {
    let name = format!("a.{ending}");
    exported(&moving_square(30.0), format, &name, |_| {}).0
}

fn options(rate: f64) -> ImportOptions {
    ImportOptions {
        name: None,
        density: 0.2,
        frame_rate: rate,
        handles: HandleSource::Vertices(vec![3, 2]),
        object: None,
        rest: RestSource::FirstFrame,
        flat: None,
        up: UpAxis::Y,
        test: Vec::new(),
    }
}

fn import(folder: &Path, rate: f64) -> Result<Trajectory, FileError<Problem>> {
    let source = ForeignSource::open(folder, &options(rate))?;
    source.read(&source.runs()[0])
}

#[test]
fn every_cache_that_is_written_can_be_learned_from() {
    let expected = moving_square(30.0);
    for (up, format, ending) in [
        (UpAxis::Y, ExportFormat::Usda, "usda"),
        (UpAxis::Z, ExportFormat::Usda, "usda"),
        (UpAxis::Y, ExportFormat::Usdc, "usdc"),
        (UpAxis::Z, ExportFormat::Usdc, "usdc"),
        (UpAxis::Y, ExportFormat::Usdz, "usdz"),
        (UpAxis::Y, ExportFormat::Glb, "glb"),
        (UpAxis::Y, ExportFormat::Pc2, "pc2"),
    ] {
        let name = format!("a.{ending}");
        let (folder, _) = exported(&expected, format, &name, |o| o.up = up);
        let read = import(folder.path(), 30.0).unwrap();
        assert_eq!(read.frame_count(), 5, "{ending}");
        assert_eq!(read.frame_rate(), 30.0);
        for (a, b) in read.positions().iter().zip(expected.positions()) {
            assert!(a.distance(*b) < 1e-6, "{ending}: {a} {b}");
        }
        let [found, faces] = [&read, &expected].map(|run| run.topology().faces());
        assert_eq!(found, faces, "{ending}");
        assert_eq!(read.handles().vertices(), expected.handles().vertices());
        let [found, flat] = [&read, &expected].map(|run| run.cloth().material_coordinates());
        assert_eq!(found, flat, "{ending}");
        let mass: f32 = read.cloth().vertex_mass().iter().sum();
        assert!((mass - 0.2).abs() < 1e-6, "{ending}: {mass} kg");
    }
}

#[test]
fn frames_are_taken_at_the_rate_that_is_asked_for() {
    for (format, ending) in [(ExportFormat::Glb, "glb"), (ExportFormat::Usdc, "usdc")] {
        let folder = cache(format, ending);
        let twice = import(folder.path(), 60.0).unwrap();
        assert_eq!(twice.frame_count(), 9, "{ending}");
        for vertex in 0..4 {
            let [a, b] = [0, 1].map(|frame| moving_square(30.0).frame(frame)[vertex]);
            let apart = twice.frame(1)[vertex].distance(a.midpoint(b));
            assert!(apart < 1e-5, "{ending}: {apart}");
        }
    }
}

#[test]
fn what_is_missing_is_named() {
    let folder = cache(ExportFormat::Pc2, "pc2");
    std::fs::remove_file(folder.path().join("a.obj")).unwrap();
    says(import(folder.path(), 30.0).unwrap_err(), &["a.obj"]);
    let light = ImportOptions {
        density: 0.0,
        ..options(1.0)
    };
    for (options, word) in [(light, "density"), (options(f64::NAN), "frame_rate")] {
        let error = ForeignSource::open(folder.path(), &options);
        says(error.unwrap_err(), &[word]);
    }
    let empty = tempfile::tempdir().unwrap();
    says(import(empty.path(), 30.0).unwrap_err(), &["no cache"]);
    std::fs::write(empty.path().join("a.fbx"), "").unwrap();
    says(import(empty.path(), 30.0).unwrap_err(), &["a.fbx"]);
}

fn handles(folder: &Path, options: &ImportOptions) -> Result<Vec<u32>, String> {
    let read = ForeignSource::open(folder, options);
    let read = read.and_then(|source| source.read(&source.runs()[0]));
    let read = read.map_err(|error| error.to_string())?;
    Ok(read.handles().vertices().iter().map(|v| v.0).collect())
}

fn named(names: &[&str]) -> ImportOptions {
    ImportOptions {
        handles: HandleSource::Nodes(names.iter().map(|&n| n.to_owned()).collect()),
        ..options(30.0)
    }
}

#[test]
fn handles_are_those_that_go_with_nodes() {
    for (format, ending) in [
        (ExportFormat::Usda, "usda"),
        (ExportFormat::Usdc, "usdc"),
        (ExportFormat::Glb, "glb"),
    ] {
        let folder = cache(format, ending);
        let found = |names: &[&str]| handles(folder.path(), &named(names));
        assert_eq!(
            found(&["handle_0", "handle_1"]).unwrap(),
            [3, 2],
            "{ending}"
        );
        assert_eq!(found(&["handle_1"]).unwrap(), [2], "{ending}");
        says(found(&["hand"]).unwrap_err(), &["\"hand\"", "handle_1"]);
    }
    let folder = cache(ExportFormat::Pc2, "pc2");
    let none = handles(folder.path(), &named(&["handle_0"]));
    says(none.unwrap_err(), &["a.pc2", "without nodes"]);
}

/// Two triangles, of which the one called `left` is moved by its vertices 0 and 2.
const TWO: &str = r#"#usda 1.0
(
    metersPerUnit = 1
    timeCodesPerSecond = 30
    upAxis = "Y"
)
def Mesh "right"
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points.timeSamples = {
        0: [(5, 0, 0), (6, 0, 0), (5, 1, 0)],
        3: [(5, 0, 1), (6, 0, 1), (5, 1, 1)],
    }
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] ( interpolation = "vertex" )
}
def Mesh "left"
{
    int[] faceVertexCounts = [3, 3]
    int[] faceVertexIndices = [0, 1, 3, 1, 2, 3]
    point3f[] points.timeSamples = {
        0: [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
        2: [(0, 0, 1), (1, 0, 0.2), (1, 1, 1), (0, 1, 0.4)],
        3: [(0, 0, 2), (1, 0, 1.1), (1, 1, 2), (0, 1, 1.2)],
    }
    texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "vertex" )
}
"#;

#[test]
fn one_cloth_of_several_is_named() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("two.usda"), TWO).unwrap();
    let of = |object: Option<&str>| {
        let options = ImportOptions {
            handles: HandleSource::Vertices(vec![0, 2]),
            object: object.map(str::to_owned),
            ..options(30.0)
        };
        handles(folder.path(), &options)
    };
    assert_eq!(of(Some("left")).unwrap(), [0, 2]);
    says(of(None).unwrap_err(), &["[left, right]", "`object`"]);
    let words = ["\"middle\"", "[left, right]"];
    says(of(Some("middle")).unwrap_err(), &words);
}

/// A garment has no flat mesh of the same vertices: its faces rest as they stand at first, or as a mesh
/// has them, and a mesh that is not flat is refused with that remedy.
#[test]
fn a_garment_without_a_pattern_can_be_learned_from() {
    let (rings, around) = (3, 6);
    let places = (0..rings * around).map(|k: usize| {
        let angle = std::f64::consts::TAU * (k % around) as f64 / around as f64;
        [angle.cos(), (k / around) as f64, angle.sin()]
    });
    let places: Vec<[f64; 3]> = places.collect();
    let faces = (0..(rings - 1) * around).flat_map(|a| {
        let b = a / around * around + (a + 1) % around;
        [[a, a + around, b + around], [a, b + around, b]]
    });
    let lines = places.iter().map(|[x, y, z]| format!("v {x} {y} {z}\n"));
    let corners = faces.map(|f| format!("f {} {} {}\n", f[0] + 1, f[1] + 1, f[2] + 1));
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("a.obj");
    std::fs::write(&mesh, lines.chain(corners).collect::<String>()).unwrap();
    let mut cache = b"POINTCACHE2\0".to_vec();
    let numbers = [1, places.len() as u32, 0, 1_f32.to_bits(), 2];
    cache.extend(numbers.into_iter().flat_map(u32::to_le_bytes));
    for wider in [1.0, 1.25] {
        let frame = places.iter().flat_map(|[x, y, z]| [x * wider, *y, *z]);
        cache.extend(frame.flat_map(|x| (x as f32).to_le_bytes()));
    }
    std::fs::write(folder.path().join("a.pc2"), cache).unwrap();
    let read = |flat, rest| {
        let options = ImportOptions {
            flat,
            rest,
            ..options(30.0)
        };
        let source = ForeignSource::open(folder.path(), &options)?;
        source.read(&source.runs()[0])
    };
    let made = read(Some(FlatSource::Shape), RestSource::FirstFrame).unwrap();
    let area: f32 = made.cloth().face_area().iter().sum();
    assert!(
        (area - 12.0).abs() < 1e-5,
        "{area} m²: each side is as wide as the radius"
    );
    let edges = made
        .topology()
        .edges()
        .iter()
        .zip(made.cloth().pattern().edge_lengths());
    for (edge, length) in edges {
        let [a, b] = edge.vertices.map(|v| made.frame(0)[v.index()]);
        assert!((f64::from(a.distance(b)) - length).abs() < 1e-6);
    }
    for flat in [None, Some(FlatSource::Obj(mesh))] {
        says(
            read(flat, RestSource::FirstFrame).unwrap_err(),
            &["`flat` shape"],
        );
    }
    let error = read(Some(FlatSource::Shape), RestSource::Flat);
    says(error.unwrap_err(), &["`rest`", "`flat`"]);
}
