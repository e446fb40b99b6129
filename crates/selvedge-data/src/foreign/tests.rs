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
