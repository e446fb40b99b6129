//! Caches that are learned from: what we write comes back, handles are numbered or named, and what
//! is missing is said.

use super::*;
use crate::export::{ExportFormat, ExportOptions};
use crate::test_help::{says, write};
use crate::trajectory::test_square::moving_square;

fn trajectory() -> Trajectory {
    moving_square(30.0)
}

fn exported(format: ExportFormat, ending: &str) -> tempfile::TempDir {
    exported_with(UpAxis::Y, format, ending)
}

fn exported_with(up: UpAxis, format: ExportFormat, ending: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let options = ExportOptions {
        up,
        ..ExportOptions::plain(format)
    };
    let path = folder.path().join(format!("a.{ending}"));
    write(&trajectory(), &path, &options);
    folder
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
    let expected = trajectory();
    for (up, format, ending) in [
        (UpAxis::Y, ExportFormat::Usda, "usda"),
        (UpAxis::Z, ExportFormat::Usda, "usda"),
        (UpAxis::Y, ExportFormat::Usdc, "usdc"),
        (UpAxis::Z, ExportFormat::Usdc, "usdc"),
        (UpAxis::Y, ExportFormat::Usdz, "usdz"),
        (UpAxis::Y, ExportFormat::Glb, "glb"),
        (UpAxis::Y, ExportFormat::Pc2, "pc2"),
    ] {
        let folder = exported_with(up, format, ending);
        let read = import(folder.path(), 30.0).unwrap();
        assert_eq!(read.frame_count(), 5, "{ending}");
        assert_eq!(read.frame_rate(), 30.0);
        for (a, b) in read.positions().iter().zip(expected.positions()) {
            assert!(a.distance(*b) < 1e-6, "{ending}: {a} {b}");
        }
        assert_eq!(
            read.topology().faces(),
            expected.topology().faces(),
            "{ending}"
        );
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
        let folder = exported(format, ending);
        let twice = import(folder.path(), 60.0).unwrap();
        assert_eq!(twice.frame_count(), 9, "{ending}");
        for vertex in 0..4 {
            let [a, b] = [0, 1].map(|frame| trajectory().frame(frame)[vertex]);
            assert!(
                twice.frame(1)[vertex].distance(a.midpoint(b)) < 1e-5,
                "{ending}"
            );
        }
    }
}

#[test]
fn what_is_missing_is_named() {
    let folder = exported(ExportFormat::Pc2, "pc2");
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
    let source = ForeignSource::open(folder, options);
    let source = source.map_err(|error| error.to_string())?;
    let read = source
        .read(&source.runs()[0])
        .map_err(|error| error.to_string())?;
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
        let folder = exported(format, ending);
        let found = handles(folder.path(), &named(&["handle_0", "handle_1"]));
        assert_eq!(found.unwrap(), [3, 2], "{ending}");
        let found = handles(folder.path(), &named(&["handle_1"]));
        assert_eq!(found.unwrap(), [2], "{ending}");
        says(
            handles(folder.path(), &named(&["hand"])).unwrap_err(),
            &["\"hand\"", "handle_1"],
        );
    }
    let folder = exported(ExportFormat::Pc2, "pc2");
    says(
        handles(folder.path(), &named(&["handle_0"])).unwrap_err(),
        &["a.pc2", "without nodes"],
    );
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
    let of = |object: Option<&str>| ImportOptions {
        handles: HandleSource::Vertices(vec![0, 2]),
        object: object.map(str::to_owned),
        ..options(30.0)
    };
    assert_eq!(handles(folder.path(), &of(Some("left"))).unwrap(), [0, 2]);
    says(
        handles(folder.path(), &of(None)).unwrap_err(),
        &["[left, right]", "`object`"],
    );
    says(
        handles(folder.path(), &of(Some("middle"))).unwrap_err(),
        &["\"middle\"", "[left, right]"],
    );
}
