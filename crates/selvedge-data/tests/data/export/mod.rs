//! What is exported says what the formats ask for. That positions come back is in the tests of
//! `foreign` and `export::take`.

pub(crate) mod gltf;

use std::ops::ControlFlow;
use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use selvedge_cloth::Mesh;
use selvedge_data::export::{ExportFormat, ExportOptions, FrameSpan, export, planned_bytes};
use selvedge_data::{MeshOptions, Trajectory, UpAxis, read_mesh};
use serde_json::Value;

use crate::help::{options, provenance, says, sheet};
use crate::sewn;

const VERTICES: usize = 5;
const FRAMES: usize = 7;

/// A fan of four triangles around a middle, that sways and swells in awkward numbers.
fn trajectory() -> Trajectory {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
    let flat = corners.map(Vec2::from_array);
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let at = |frame: usize, c: &Vec2| {
        let t = frame as f32 / 7.0;
        Vec3::new(0.1 * t + 0.01 * c.x.sin(), c.y * (1.0 + t), 1e-7 * t - c.x) + 0.3 * t * Vec3::Z
    };
    let frame = |k: usize| flat.iter().map(move |c| at(k, c));
    let positions = (0..FRAMES).flat_map(frame).collect();
    let rest: Vec<Vec3> = frame(0).collect();
    let cloth = sheet(&rest, &flat, &faces, &[3, 2]);
    let provenance = provenance(60.0, "a \"test\" \\ 1");
    Trajectory::new(cloth, positions, provenance).unwrap()
}

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

/// The text that `options` make of [`trajectory`].
fn text_of(options: &ExportOptions) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    write(&trajectory(), &path, options);
    std::fs::read_to_string(path).unwrap()
}

/// Frames 1, 3 and 5.
fn odd() -> FrameSpan {
    FrameSpan {
        every: 2,
        ..span("1..6")
    }
}

fn span(text: &str) -> FrameSpan {
    text.parse().unwrap()
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

/// The numbers in a text, in order.
fn numbers(text: &str) -> Vec<f32> {
    text.split(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c)))
        .filter(|word| !word.is_empty())
        .map(|word| word.parse().unwrap())
        .collect()
}

fn points(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

/// The samples of an attribute of USD text by time code.
fn samples(text: &str, name: &str) -> Vec<(f64, Vec<Vec3>)> {
    let start = format!("{name}.timeSamples = {{");
    let (_, after) = text.split_once(&start).unwrap();
    let lines = after.split('}').next().unwrap().lines();
    let samples = lines.filter_map(|line| line.split_once(':'));
    samples
        .map(|(code, values)| (code.trim().parse().unwrap(), points(&numbers(values))))
        .collect()
}

#[test]
fn usd_has_every_position_at_its_time_code() {
    let trajectory = trajectory();
    let text = text_of(&options(ExportFormat::Usda, |o| o.normals = true));
    assert!(text.starts_with("#usda 1.0\n"));
    let words = [
        "upAxis = \"Y\"",
        "metersPerUnit = 1\n",
        "timeCodesPerSecond = 60\n",
        "framesPerSecond = 60\n",
        "startTimeCode = 0\n",
        "endTimeCode = 6\n",
        "doubleSided = 1",
        "doc = \"a \\\"test\\\" \\\\ 1\"",
        "primvars:handle = [-1, -1, 1, 0, -1]",
        "faceVertexCounts = [3, 3, 3, 3]\n",
        "faceVertexIndices = [0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4]\n",
        "primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)]",
        // What binds the mesh to a material.
        "prepend apiSchemas = [\"MaterialBindingAPI\"]",
        "rel material:binding = </cloth/materials/matte>",
        "token outputs:surface.connect = </cloth/materials/matte/surface.outputs:surface>",
        "uniform token info:id = \"UsdPreviewSurface\"",
        "color3f inputs:diffuseColor = (0.08, 0.13, 0.4)",
    ];
    says(&text, &words);
    let positions = samples(&text, "point3f[] points");
    let all_normals = samples(&text, "normal3f[] normals");
    let extents = samples(&text, "float3[] extent");
    for number in 0..FRAMES {
        let (time, frame) = (number as f64, trajectory.frame(number));
        assert_eq!(positions[number], (time, frame.to_vec()));
        let normals = &all_normals[number].1;
        assert_eq!(normals.len(), VERTICES);
        // Rounded to single precision three times.
        let is_unit = |n: &Vec3| (n.length() - 1.0).abs() < 1e-6;
        assert!(normals.iter().all(is_unit), "{number}");
        let [a, b, c] = [0, 1, 4].map(|v| frame[v]);
        // Each face of this fan is seen from the same side as the middle vertex.
        assert!(normals[4].dot((b - a).cross(c - a)) > 0.0);
        let low = frame.iter().copied().reduce(Vec3::min).unwrap();
        let high = frame.iter().copied().reduce(Vec3::max).unwrap();
        assert_eq!(extents[number], (time, vec![low, high]));
    }
    let counts = [&positions, &all_normals, &extents].map(Vec::len);
    assert_eq!(counts, [FRAMES; 3]);
    let handle = text.split("\"handle_1\"").nth(1).unwrap();
    let path = samples(handle, "xformOp:translate");
    let path: Vec<Vec3> = path.iter().map(|sample| sample.1[0]).collect();
    let expected: Vec<Vec3> = (0..FRAMES).map(|k| trajectory.frame(k)[2]).collect();
    assert_eq!(path, expected);
}

#[test]
fn frames_left_out_leave_time_as_it_is_and_z_can_point_up() {
    let text = text_of(&options(ExportFormat::Usda, |o| {
        o.frames = odd();
        o.up = UpAxis::Z;
    }));
    says(&text, &["upAxis = \"Z\"", "endTimeCode = 4\n"]);
    let turned = |frame: usize| -> Vec<Vec3> {
        let trajectory = trajectory();
        let places = trajectory.frame(frame).iter();
        places.map(|p| Vec3::new(p.x, -p.z, p.y)).collect()
    };
    let expected = [(0.0, 1), (2.0, 3), (4.0, 5)].map(|(code, frame)| (code, turned(frame)));
    assert_eq!(samples(&text, "point3f[] points"), expected);
}

/// The velocity of vertex `v` in `frame` by differences of the positions, as far as they are good
/// to the second order.
fn slope(trajectory: &Trajectory, frame: usize, v: usize) -> DVec3 {
    let at = |frame: usize| trajectory.frame(frame)[v].as_dvec3();
    let last = FRAMES - 1;
    let twice = match frame {
        0 => 4.0 * at(1) - 3.0 * at(0) - at(2),
        f if f == last => 3.0 * at(last) - 4.0 * at(last - 1) + at(last - 2),
        f => at(f + 1) - at(f - 1),
    };
    30.0 * twice
}

#[test]
fn velocities_are_differences_of_positions_whichever_frames_are_taken() {
    let trajectory = trajectory();
    for (frames, taken) in [
        (FrameSpan::default(), (0..FRAMES).collect::<Vec<_>>()),
        (odd(), vec![1, 3, 5]),
        (span("6"), vec![6]),
    ] {
        for up in [UpAxis::Y, UpAxis::Z] {
            let text = text_of(&options(ExportFormat::Usda, |o| {
                o.frames = frames;
                o.up = up;
                o.velocities = true;
            }));
            let found = samples(&text, "vector3f[] velocities");
            assert_eq!(found.len(), taken.len());
            for ((_, velocities), &frame) in found.iter().zip(&taken) {
                for (v, velocity) in velocities.iter().enumerate() {
                    let expected = slope(&trajectory, frame, v).as_vec3();
                    let turned = match up {
                        UpAxis::Y => expected,
                        UpAxis::Z => Vec3::new(expected.x, -expected.z, expected.y),
                    };
                    // Rounded once, after sums in double precision.
                    let apart = (*velocity - turned).abs().max_element();
                    assert!(apart <= 1e-6, "{frame} {v}: {apart}");
                }
            }
        }
    }
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
        ("a.usda", ExportFormat::Usda),
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
    for format in [ExportFormat::Usda, ExportFormat::ObjSequence] {
        refused(ExportOptions::plain(format), "none/such", "none/such");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
