//! What is exported says what the formats ask for. That positions come back is in the tests of
//! `foreign` and `export::take`.

pub(crate) mod gltf;

use std::ops::ControlFlow;
use std::path::Path;

use glam::Vec3;
use selvedge_cloth::Mesh;
use selvedge_data::export::{ExportFormat, ExportOptions, FrameSpan, export, planned_bytes};
use selvedge_data::{MeshOptions, Trajectory, UpAxis, read_mesh};
use serde_json::Value;

use crate::help::{fan as trajectory, odd, options, says, span};
use crate::sewn;

const VERTICES: usize = 5;
const FRAMES: usize = 7;

fn write(trajectory: &Trajectory, path: &Path, options: &ExportOptions) {
    let mut beats = 0;
    let end = export(trajectory, path, options, &mut || {
        beats += 1;
        ControlFlow::Continue(())
    });
    assert!(end.unwrap());
    let frames = options.frames.of(trajectory.frame_count()).unwrap();
    assert_eq!(beats, frames.len());
}

#[test]
fn spans_of_frames_are_read_and_checked() {
    assert_eq!(odd().of(FRAMES).unwrap(), [1, 3, 5]);
    let of = |text: &str| text.parse::<FrameSpan>().unwrap().of(4);
    assert_eq!(of("2").unwrap(), [2]);
    assert_eq!(of("..1").unwrap(), [0, 1]);
    assert_eq!(of("2..").unwrap(), [2, 3]);
    assert_eq!(of("..").unwrap(), [0, 1, 2, 3]);
    let words = ["frame 4 was asked for, but the run has the frames 0 to 3"];
    says(of("1..4").unwrap_err(), &words);
    says(of("3..2").unwrap_err(), &["3..2"]);
    for text in ["", "a", "1-2", "-1", "1..2..3", "1.5"] {
        assert!(text.parse::<FrameSpan>().is_err(), "{text}");
    }
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

#[test]
fn meshes_in_a_folder_are_the_frames() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("frames");
    let all = options(ExportFormat::ObjSequence, |o| {
        o.normals = true;
        o.frames = odd();
    });
    write(&trajectory, &path, &all);
    let read = |file: &Path| read_mesh(file, MeshOptions::default()).unwrap().sheet.mesh;
    let assert_frame = |mesh: &Mesh, frame: usize| {
        let places = mesh.positions().iter().map(|p| p.as_vec3());
        assert!(places.eq(trajectory.frame(frame).iter().copied()));
    };
    for (number, frame) in [1, 3, 5].into_iter().enumerate() {
        let file = path.join(format!("cloth_{number:04}.obj"));
        let text = std::fs::read_to_string(&file).unwrap();
        assert_eq!(text.matches("\nvn ").count(), VERTICES);
        let mesh = read(&file);
        assert_frame(&mesh, frame);
        assert_eq!(mesh.topology().faces(), trajectory.topology().faces());
    }
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 3);
    // The mesh beside a cache is its first frame.
    let cache = options(ExportFormat::Pc2, |o| o.frames = odd());
    write(&trajectory, &folder.path().join("a.pc2"), &cache);
    assert_frame(&read(&folder.path().join("a.obj")), 1);
    let again = export(&trajectory, &path, &all, &mut || ControlFlow::Continue(()));
    says(again.unwrap_err(), &["not empty"]);
}

#[test]
fn arrays_for_numpy_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    for (trajectory, up) in [
        (trajectory(), UpAxis::Y),
        (trajectory(), UpAxis::Z),
        (sewn::trajectory(), UpAxis::Y),
    ] {
        let options = options(ExportFormat::Npz, |o| {
            o.up = up;
            o.normals = true;
        });
        write(&trajectory, &path, &options);
        let bytes = std::fs::read(&path).unwrap();
        let read = Trajectory::from_npz(&bytes).unwrap();
        assert_eq!(read.cloth(), trajectory.cloth());
        assert_eq!(read.positions(), trajectory.positions());
        assert_eq!(read.frame_rate(), 60.0);
        for cut in 0..bytes.len() {
            assert!(Trajectory::from_npz(&bytes[..cut]).is_err(), "{cut}");
        }
    }
}

#[test]
fn what_is_interrupted_leaves_nothing() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let formats = [
        ("a.glb", ExportFormat::Glb),
        ("a.pc2", ExportFormat::Pc2),
        ("a.usdc", ExportFormat::Usdc),
        ("a.usdz", ExportFormat::Usdz),
        ("a.abc", ExportFormat::Abc),
        ("a", ExportFormat::ObjSequence),
        ("a.npz", ExportFormat::Npz),
    ];
    for (name, format) in formats {
        let mut beats = 0;
        let mut third = || {
            beats += 1;
            match beats {
                3 => ControlFlow::Break(()),
                _ => ControlFlow::Continue(()),
            }
        };
        let path = folder.path().join(name);
        let options = ExportOptions::plain(format);
        let end = export(&trajectory, &path, &options, &mut third);
        assert!(!end.unwrap(), "{name}");
        let left = std::fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "{name}");
    }
}

#[test]
fn what_a_format_does_not_have_is_refused() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let refused = |options: ExportOptions, name: &str, words: &str| {
        let path = folder.path().join(name);
        let mut go_on = || ControlFlow::Continue(());
        let end = export(&trajectory, &path, &options, &mut go_on);
        says(end.unwrap_err(), &[words]);
    };
    let turned = options(ExportFormat::Glb, |o| o.up = UpAxis::Z);
    refused(turned, "a.glb", "glTF has y up");
    let all = ExportOptions::plain(ExportFormat::Obj);
    refused(all, "a.obj", "one frame, and 7 were asked for");
    let beyond = options(ExportFormat::Npz, |o| o.frames = span("5..9"));
    refused(beyond, "a.npz", "frame 9 was asked for");
    for format in [ExportFormat::Glb, ExportFormat::Pc2] {
        let with = options(format, |o| o.velocities = true);
        refused(with, "a", "the format has no velocities");
    }
    for format in [ExportFormat::Usdc, ExportFormat::ObjSequence] {
        refused(ExportOptions::plain(format), "none/such", "none/such");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
