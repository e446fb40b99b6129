//! Foreign data, written by programs that are not ours (`fixtures/foreign/generate.py`): what is
//! read is what was written, what is missing or contradicts itself is named, and no damage is a
//! panic.

mod contents;

use std::fs;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use selvedge_data::UpAxis;
use selvedge_data::foreign::{
    ForeignFormat, ForeignSource, HandleSource, ImportOptions, RestSource,
};
use selvedge_data::{Dataset, DatasetWriter, Split, Trajectory};
use tempfile::TempDir;

fn fixture(name: &str) -> PathBuf {
    let fixtures = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/foreign");
    fixtures.join(name)
}

/// A copy of a fixture that may be damaged.
fn copy_of(name: &str) -> TempDir {
    fn copy(from: &Path, to: &Path) {
        for entry in fs::read_dir(from).unwrap() {
            let path = entry.unwrap().path();
            let target = to.join(path.file_name().unwrap());
            if path.is_dir() {
                fs::create_dir(&target).unwrap();
                copy(&path, &target);
            } else {
                fs::copy(&path, &target).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    copy(&fixture(name), folder.path());
    folder
}

fn flag_options() -> ImportOptions {
    ImportOptions {
        density: Some(0.5),
        ..ImportOptions::default()
    }
}

fn released_options() -> ImportOptions {
    ImportOptions {
        handles: Some(HandleSource::Vertices(vec![6, 8])),
        ..ImportOptions::default()
    }
}

fn open_flag(folder: &Path) -> Result<ForeignSource, String> {
    open(ForeignFormat::FlagSimple, folder, &flag_options())
}

fn open(
    format: ForeignFormat,
    folder: &Path,
    options: &ImportOptions,
) -> Result<ForeignSource, String> {
    ForeignSource::open(format, folder, options).map_err(|error| error.to_string())
}

/// All trajectories of a source.
fn read_all(source: &ForeignSource) -> Result<Vec<Trajectory>, String> {
    let runs = source.runs().iter();
    runs.map(|run| source.read(run).map_err(|error| error.to_string()))
        .collect()
}

/// The positions that `generate.py` states, in our axes: x out of the plane, y up, z = -across.
fn expected(number: usize) -> Vec<Vec3> {
    let place = |t: usize, vertex: usize| {
        let (i, j) = ((vertex % 3) as f32, (vertex / 3) as f32);
        let t = t as f32;
        Vec3::new(t / 8.0 + number as f32, j / 2.0 - t * i / 16.0, -i / 2.0)
    };
    let frames = 0..3;
    frames
        .flat_map(|t| (0..9).map(move |vertex| place(t, vertex)))
        .collect()
}

/// Positions turned from the flag's axes, (across, -out, up) with z up, to (across, up, out).
fn expected_flag(number: usize) -> Vec<Vec3> {
    let turn = |p: Vec3| Vec3::new(-p.z, p.y, p.x);
    expected(number).into_iter().map(turn).collect()
}

#[test]
fn flag_simple_is_read_as_it_was_written() {
    let source = open_flag(&fixture("flag_simple")).unwrap();
    let names: Vec<(&str, Split)> = source
        .runs()
        .iter()
        .map(|run| (run.name.as_str(), run.split))
        .collect();
    let expected_names = [
        ("train-0000", Split::Train),
        ("train-0001", Split::Train),
        ("valid-0000", Split::Test),
    ];
    assert_eq!(names, expected_names);
    for (number, trajectory) in read_all(&source).unwrap().iter().enumerate() {
        assert_eq!(trajectory.positions(), expected_flag(number));
        assert_eq!(trajectory.frame_rate(), 50.0);
        let cloth = trajectory.cloth();
        let handles: Vec<u32> = cloth.handles().vertices().iter().map(|v| v.0).collect();
        assert_eq!(handles, [6, 8]);
        assert_eq!(cloth.material_coordinates()[5], Vec2::new(1.0, 0.5));
        assert_eq!(cloth.face_area(), [0.125; 8]);
        // Half a kilogram in all; the middle vertex has six of the eight faces.
        assert!((cloth.vertex_mass().iter().sum::<f32>() - 0.5).abs() < 1e-6);
        assert!((cloth.vertex_mass()[4] - 6.0 * 0.125 * 0.5 / 3.0).abs() < 1e-7);
        // Flat, hanging from y = 0 with u along z; the clockwise record is turned round.
        assert_eq!(cloth.rest_positions()[5], Vec3::new(0.0, -0.5, 0.5));
        cloth.mesh().unwrap();
    }
}

#[test]
fn the_rest_pose_and_the_axes_of_flag_simple_can_be_chosen() {
    let folder = fixture("flag_simple");
    let read = |options: &ImportOptions| {
        let source = open(ForeignFormat::FlagSimple, &folder, options)?;
        Ok::<_, String>(read_all(&source)?.remove(0))
    };
    let first = ImportOptions {
        rest: Some(RestSource::FirstFrame),
        ..flag_options()
    };
    let rest = read(&first).unwrap().cloth().rest_positions().to_vec();
    assert_eq!(rest, expected_flag(0)[..9]);
    let raw = ImportOptions {
        up: Some(UpAxis::Y),
        ..flag_options()
    };
    let turned = expected_flag(0)[26];
    let expected = Vec3::new(turned.x, -turned.z, turned.y);
    assert_eq!(read(&raw).unwrap().positions()[26], expected);
    let obj = |path: PathBuf| ImportOptions {
        rest: Some(RestSource::Obj(path)),
        ..flag_options()
    };
    let rest = read(&obj(fixture("released/forward/rest.obj"))).unwrap();
    let rest = rest.cloth().rest_positions()[8];
    assert_eq!(rest, Vec3::new(0.125, 1.0, -1.0));
    let other = tempfile::tempdir().unwrap();
    let path = other.path().join("other.obj");
    fs::write(&path, "v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\n").unwrap();
    let error = read(&obj(path)).unwrap_err();
    assert!(
        error.contains("other.obj is for 3 vertices, but there are 9"),
        "{error}"
    );
}

#[test]
fn released_folders_are_read_as_they_were_written() {
    let mut options = released_options();
    options.test = vec!["side".to_owned()];
    let folder = fixture("released");
    let source = open(ForeignFormat::Released, &folder, &options).unwrap();
    let plan = source.plan();
    assert_eq!(
        (plan.name.as_str(), plan.train, plan.test),
        (
            "released",
            vec!["forward".to_owned()],
            vec!["side".to_owned()],
        )
    );
    let trajectories = read_all(&source).unwrap();
    // The first has no meta.json and takes the paper's rate, the second says 0.02 s.
    for (number, (trajectory, rate)) in trajectories.iter().zip([60.0, 50.0]).enumerate() {
        assert_eq!(trajectory.positions(), expected(number));
        assert_eq!(trajectory.frame_rate(), rate);
        let cloth = trajectory.cloth();
        assert_eq!(cloth.rest_positions()[8], Vec3::new(0.125, 1.0, -1.0));
        assert_eq!(cloth.material_coordinates()[8], Vec2::ONE);
        assert_eq!(cloth.face_area(), [0.125; 8]);
        assert_eq!(cloth.vertex_mass()[4], 0.125);
        cloth.mesh().unwrap();
    }
}

/// The numbers of the corners of `faces` faces of face.npy in `folder`, each turned round.
fn turn_faces(folder: &Path, faces: usize) {
    let path = folder.join("face.npy");
    let mut bytes = fs::read(&path).unwrap();
    let first = bytes.len() - 8 * 3 * 8;
    for face in bytes[first..].chunks_exact_mut(24).take(faces) {
        let (second, third) = face[8..].split_at_mut(8);
        second.swap_with_slice(third);
    }
    fs::write(&path, bytes).unwrap();
}

#[test]
fn released_folders_that_are_clockwise_throughout_are_turned_round_and_mixed_ones_refused() {
    let read = |folder: &TempDir| {
        let source = open(ForeignFormat::Released, folder.path(), &released_options())?;
        Ok::<_, String>(read_all(&source)?.remove(0))
    };
    let straight = read(&copy_of("released")).unwrap();
    let clockwise = copy_of("released");
    let forward = clockwise.path().join("forward");
    turn_faces(&forward, 8);
    // The faces of rest.obj are turned round, too, as a program that has y down writes them.
    let rest = fs::read_to_string(forward.join("rest.obj")).unwrap();
    let turned = rest.lines().map(|line| match line.strip_prefix("f ") {
        Some(corners) => {
            let corners: Vec<&str> = corners.split_whitespace().collect();
            format!("f {} {} {}\n", corners[0], corners[2], corners[1])
        }
        None => format!("{line}\n"),
    });
    for text in [rest.clone(), turned.collect()] {
        fs::write(forward.join("rest.obj"), text).unwrap();
        assert_eq!(read(&clockwise).unwrap(), straight);
    }
    turn_faces(&forward, 3);
    let error = read(&clockwise).unwrap_err();
    assert!(error.contains("clockwise"), "{error}");
}

#[test]
fn a_sagged_rest_pose_without_texture_takes_its_coordinates_from_a_flat_mesh() {
    let folder = copy_of("released");
    let flat = folder.path().join("flat.obj");
    let rest = folder.path().join("forward/rest.obj");
    let text = fs::read_to_string(&rest).unwrap();
    fs::write(&flat, &text).unwrap();
    let bare: String = text
        .lines()
        .filter(|line| !line.starts_with("vt"))
        .map(|line| match line.strip_prefix("f ") {
            Some(corners) => {
                let vertices = corners
                    .split_whitespace()
                    .map(|c| c.split('/').next().unwrap());
                format!("f {}\n", vertices.collect::<Vec<_>>().join(" "))
            }
            None => format!("{line}\n"),
        })
        .collect();
    fs::write(&rest, bare).unwrap();
    let mut options = released_options();
    let read = |options: &ImportOptions| {
        let source = open(ForeignFormat::Released, folder.path(), options)?;
        Ok::<_, String>(read_all(&source)?.remove(0))
    };
    let error = read(&options).unwrap_err();
    assert!(
        error.contains("rest.obj: has no texture coordinates"),
        "{error}"
    );
    options.flat = Some(flat.clone());
    let trajectory = read(&options).unwrap();
    assert_eq!(trajectory.cloth().material_coordinates()[8], Vec2::ONE);
    fs::write(&flat, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let error = read(&options).unwrap_err();
    assert!(
        error.contains("flat.obj: the flat mesh is for 3 vertices, but there are 9"),
        "{error}"
    );
}

#[test]
fn what_the_data_lack_must_be_said_and_what_they_have_must_not() {
    use ForeignFormat::{FlagSimple, Released};
    type Change = fn(&mut ImportOptions);
    let cases: [(ForeignFormat, Change, &str); 12] = [
        (
            FlagSimple,
            |o| o.density = None,
            "do not say what the cloth weighs: give --density",
        ),
        (
            FlagSimple,
            |o| o.density = Some(-1.0),
            "--density must be finite and positive, found -1",
        ),
        (
            FlagSimple,
            |o| o.frame_rate = Some(60.0),
            "say the time step themselves: leave --frame-rate out",
        ),
        (
            FlagSimple,
            |o| o.handles = Some(HandleSource::Vertices(vec![0])),
            "leave --handles out",
        ),
        (
            FlagSimple,
            |o| o.flat = Some("x.obj".into()),
            "leave --flat out",
        ),
        (
            FlagSimple,
            |o| o.test = vec!["a".to_owned()],
            "leave --test out",
        ),
        (
            Released,
            |o| o.handles = None,
            "do not say which vertices are held: give --handles",
        ),
        (Released, |o| o.density = Some(1.0), "leave --density out"),
        (
            Released,
            |o| o.rest = Some(RestSource::Flat),
            "leave --rest out",
        ),
        (
            Released,
            |o| o.frame_rate = Some(0.0),
            "--frame-rate must be finite and positive",
        ),
        (
            Released,
            |o| o.handles = Some(HandleSource::Vertices(vec![9])),
            "handle 0 is vertex 9",
        ),
        (
            Released,
            |o| o.test = vec!["back".to_owned()],
            "--test names \"back\", which is not there",
        ),
    ];
    for (format, change, expected) in cases {
        let (folder, mut options) = match format {
            FlagSimple => ("flag_simple", flag_options()),
            Released => ("released", released_options()),
            ForeignFormat::Cache => unreachable!("caches have tests of their own"),
        };
        change(&mut options);
        let result = open(format, &fixture(folder), &options);
        let error = result.and_then(|source| read_all(&source)).unwrap_err();
        assert!(error.contains(expected), "{error} lacks {expected}");
        assert!(error.contains(folder), "{error}");
    }
}

#[test]
fn defects_of_released_folders_are_named() {
    let side = |name: &str| format!("side/{name}");
    let forward = |name: &str| fixture(&format!("released/forward/{name}"));
    let cut = |name: &str| {
        let bytes = fs::read(fixture(&format!("released/forward/{name}"))).unwrap();
        bytes[..bytes.len() - 1].to_vec()
    };
    let text = |name: &str| fs::read_to_string(forward(name)).unwrap();
    // File, what it is replaced by, what is said.
    let cases: Vec<(&str, Vec<u8>, &str)> = vec![
        (
            "cloth_pos.npy",
            cut("cloth_pos.npy"),
            "has 323 bytes of data, but its shape needs 324",
        ),
        (
            "cloth_pos.npy",
            fs::read(forward("face.npy")).unwrap(),
            "elements of type \"<i8\"",
        ),
        (
            "cloth_m.npy",
            fs::read(forward("cloth_f_area.npy")).unwrap(),
            "has the shape [8, 1], expected [9, 1]",
        ),
        (
            "face.npy",
            fs::read(forward("cloth_m.npy")).unwrap(),
            "elements of type \"<f4\", expected little-endian integers",
        ),
        (
            "cloth_f_area.npy",
            fs::read(forward("cloth_m.npy")).unwrap(),
            "has the shape [9, 1], expected [8, 1]",
        ),
        (
            "rest.obj",
            b"v 0 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\n".to_vec(),
            "the rest pose is for 3 vertices, but there are 9",
        ),
        (
            "rest.obj",
            text("rest.obj").replace("vt 1.0", "vt 3.0").into_bytes(),
            "texture coordinates must be in metres",
        ),
        (
            "meta.json",
            b"{\"dt\": -1}".to_vec(),
            "dt must be a positive time step, found -1",
        ),
        ("meta.json", b"{".to_vec(), "is no JSON"),
    ];
    for (name, bytes, expected) in cases {
        let folder = copy_of("released");
        fs::write(folder.path().join(side(name)), bytes).unwrap();
        let source = open(ForeignFormat::Released, folder.path(), &released_options());
        let error = source.and_then(|source| read_all(&source)).unwrap_err();
        assert!(error.contains(expected), "{error} lacks {expected}");
        assert!(error.contains("side"), "{error}");
    }
    let empty = tempfile::tempdir().unwrap();
    let error = open(ForeignFormat::Released, empty.path(), &released_options()).unwrap_err();
    assert!(
        error.contains("has no folder with a cloth_pos.npy"),
        "{error}"
    );
}

#[test]
fn defects_of_meta_json_are_named() {
    for (from, to, expected) in [
        (
            "\"dt\": 0.02",
            "\"dt\": 0",
            "dt must be a positive time step",
        ),
        ("\"dt\"", "\"step\"", "missing field `dt`"),
        (
            "\"trajectory_length\": 3",
            "\"trajectory_length\": 0",
            "trajectory_length is 0",
        ),
        ("\"cells\": {", "\"faces\": {", "features has no cells"),
        (
            "\"dynamic\"",
            "\"static\"",
            "world_pos is static float32, expected dynamic float32",
        ),
        (
            "\"int32\"",
            "\"int64\"",
            "cells is static int64, expected static int32",
        ),
        (
            "\"trajectory_length\": 3",
            "\"trajectory_length\": 4",
            "has 27 rows, but mesh_pos and trajectory_length give 36",
        ),
        (
            "\"trajectory_length\": 3",
            "\"trajectory_length\": 18446744073709551615",
            "feature world_pos: has 27 rows",
        ),
    ] {
        let folder = copy_of("flag_simple");
        let path = folder.path().join("meta.json");
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{from}");
        fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = open_flag(folder.path())
            .and_then(|s| read_all(&s))
            .unwrap_err();
        assert!(error.contains(expected), "{error} lacks {expected}");
    }
}

/// Reads damaged bytes of train.tfrecord: the trajectories or an error.
fn read_damaged(folder: &Path, bytes: &[u8]) -> Result<Vec<Trajectory>, String> {
    fs::write(folder.join("train.tfrecord"), bytes).unwrap();
    read_all(&open_flag(folder)?)
}

#[test]
fn every_truncation_is_an_error_but_one_that_leaves_whole_records() {
    let folder = copy_of("flag_simple");
    fs::remove_file(folder.path().join("valid.tfrecord")).unwrap();
    let bytes = fs::read(folder.path().join("train.tfrecord")).unwrap();
    let whole = read_damaged(folder.path(), &bytes).unwrap();
    let first_record = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize + 16;
    for end in 0..bytes.len() {
        let result = read_damaged(folder.path(), &bytes[..end]);
        if end == first_record {
            // The format has no end mark: what is there is right.
            assert_eq!(result.unwrap(), whole[..1]);
            continue;
        }
        let error = result.unwrap_err();
        let (record, offset) = match end {
            0 => (None, 0),
            end if end < first_record => (Some(0), if end < 12 { 0 } else { 12 }),
            end => {
                let inside = end - first_record;
                (Some(1), first_record + if inside < 12 { 0 } else { 12 })
            }
        };
        let expected = match record {
            Some(record) => {
                format!("train.tfrecord: record {record}, byte {offset}: the file ends within")
            }
            None => "train.tfrecord: has no record".to_owned(),
        };
        assert!(error.contains(&expected), "{end}: {error} lacks {expected}");
    }
}

#[test]
fn every_flipped_byte_is_found_by_its_checksum() {
    let folder = copy_of("flag_simple");
    fs::remove_file(folder.path().join("valid.tfrecord")).unwrap();
    let bytes = fs::read(folder.path().join("train.tfrecord")).unwrap();
    for at in 0..bytes.len() {
        let mut damaged = bytes.clone();
        damaged[at] ^= 1 << (at % 8);
        let error = read_damaged(folder.path(), &damaged).unwrap_err();
        assert!(error.contains("train.tfrecord: record "), "{at}: {error}");
        assert!(error.contains("checksum of its"), "{at}: {error}");
    }
}

#[test]
fn an_import_is_a_data_set_like_any_other() {
    let folder = tempfile::tempdir().unwrap();
    let options = ImportOptions {
        limit: Some(1),
        name: Some("flags".to_owned()),
        ..flag_options()
    };
    let source = open(ForeignFormat::FlagSimple, &fixture("flag_simple"), &options).unwrap();
    let mut writer = DatasetWriter::open(folder.path(), source.plan()).unwrap();
    for run in source.runs() {
        let trajectory = source.read(run).unwrap();
        writer.add(run.split, &run.name, &trajectory).unwrap();
    }
    writer.finish().unwrap();
    let dataset = Dataset::open(folder.path()).unwrap();
    dataset.verify_hashes().unwrap();
    let index = dataset.index();
    assert_eq!(index.name, "flags");
    assert_eq!(index.config["import"]["density"], 0.5);
    assert_eq!(index.config["import"]["rest"], "flat");
    assert_eq!(
        (
            dataset.entries(Split::Train).len(),
            dataset.entries(Split::Test).len()
        ),
        (1, 1)
    );
    assert_eq!(dataset.samples().count(), 1);
    let read = dataset.read(&dataset.entries(Split::Test)[0]).unwrap();
    assert_eq!(read.positions(), expected_flag(2));
}

#[test]
fn an_import_goes_on_only_with_the_same_files_and_frame_rates() {
    let [released, flag] = ["released", "flag_simple"].map(copy_of);
    let obj = fs::read(fixture("released/forward/rest.obj")).unwrap();
    let another = [&obj[..], b"# another\n"].concat();
    let [flat, rest] = [&released, &flag].map(|folder| folder.path().join("mesh.obj"));
    for path in [&flat, &rest] {
        fs::write(path, &obj).unwrap();
    }
    let with_flat = ImportOptions {
        flat: Some(flat.clone()),
        ..released_options()
    };
    let with_rest = ImportOptions {
        rest: Some(RestSource::Obj(rest.clone())),
        ..flag_options()
    };
    let [out, flag_out] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let begin = |options: &ImportOptions| {
        let (format, folder, out) = match options.density {
            None => (ForeignFormat::Released, &released, &out),
            Some(_) => (ForeignFormat::FlagSimple, &flag, &flag_out),
        };
        let plan = open(format, folder.path(), options)?.plan();
        let writer = DatasetWriter::open(out.path(), plan);
        writer.map(drop).map_err(|error| error.to_string())
    };
    let is_refused = |options: &ImportOptions| {
        begin(options).is_err_and(|error| error.contains("another configuration"))
    };
    for (options, path) in [(&with_flat, &flat), (&with_rest, &rest)] {
        begin(options).unwrap();
        begin(options).unwrap();
        fs::write(path, &another).unwrap();
        assert!(is_refused(options));
        fs::write(path, &obj).unwrap();
        begin(options).unwrap();
    }
    assert!(is_refused(&released_options()));
    assert!(is_refused(&flag_options()));
    // One of two frame rates, neither of which is said.
    fs::write(released.path().join("side/meta.json"), "{\"dt\": 0.01}").unwrap();
    assert!(is_refused(&with_flat));
}
