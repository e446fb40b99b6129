//! What is exported says what the formats ask for. That positions come back is in the tests of
//! `foreign` and `export::take`.

mod caches;
pub(crate) mod gltf;

use std::ops::ControlFlow;
use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_data::export::{
    ExportEnd, ExportFormat, ExportOptions, FrameSpan, export, planned_bytes,
};
use selvedge_data::{Provenance, Trajectory, UpAxis, read_obj};
use serde_json::Value;

use crate::help::{says, sheet};

const VERTICES: usize = 5;
const FRAMES: usize = 7;

/// A fan of four triangles around a middle, that sways and swells in awkward numbers.
fn trajectory() -> Trajectory {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
    let flat: Vec<Vec2> = corners.map(Vec2::from_array).to_vec();
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let at = |frame: usize, c: &Vec2| {
        let t = frame as f32 / 7.0;
        Vec3::new(0.1 * t + 0.01 * c.x.sin(), c.y * (1.0 + t), 1e-7 * t - c.x) + 0.3 * t * Vec3::Z
    };
    let positions =
        (0..FRAMES).flat_map(|k| flat.iter().map(move |c| at(k, c)).collect::<Vec<_>>());
    let rest: Vec<Vec3> = flat.iter().map(|c| at(0, c)).collect();
    let cloth = sheet(&rest, &flat, &faces, &[3, 2]);
    let provenance = Provenance {
        frame_rate: 60.0,
        scene: Value::Null,
        made_by: "a \"test\" \\ 1".to_owned(),
    };
    Trajectory::new(cloth, positions.collect(), provenance).unwrap()
}

fn write(trajectory: &Trajectory, path: &Path, options: &ExportOptions) {
    let mut beats = 0;
    let end = export(trajectory, path, options, &mut || {
        beats += 1;
        ControlFlow::Continue(())
    });
    assert_eq!(end.unwrap(), ExportEnd::Complete);
    assert_eq!(
        beats,
        options.frames.of(trajectory.frame_count()).unwrap().len()
    );
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
    let error = of("1..4").unwrap_err().to_string();
    assert_eq!(
        error,
        "frame 4 was asked for, but the run has the frames 0 to 3"
    );
    assert!(of("3..2").unwrap_err().to_string().contains("3..2"));
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
    let after = text
        .split(&format!("{name}.timeSamples = {{"))
        .nth(1)
        .unwrap();
    let body = after.split('}').next().unwrap();
    let lines = body.lines().map(str::trim).filter(|line| !line.is_empty());
    lines
        .map(|line| {
            let (code, values) = line.split_once(':').unwrap();
            (code.parse().unwrap(), points(&numbers(values)))
        })
        .collect()
}

#[test]
fn usd_has_every_position_at_its_time_code() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.usda");
    let all = ExportOptions {
        normals: true,
        ..ExportOptions::plain(ExportFormat::Usda)
    };
    write(&trajectory, &path, &all);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("#usda 1.0\n"));
    for said in [
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
    ] {
        assert!(text.contains(said), "{said}");
    }
    let written = samples(&text, "point3f[] points");
    assert_eq!(written.len(), FRAMES);
    for (number, (code, positions)) in written.iter().enumerate() {
        assert_eq!(*code, number as f64);
        assert_eq!(positions, trajectory.frame(number));
    }
    let written = samples(&text, "normal3f[] normals");
    assert_eq!(written.len(), FRAMES);
    for (number, (_, normals)) in written.iter().enumerate() {
        assert_eq!(normals.len(), VERTICES);
        // Rounded to single precision three times.
        assert!(
            normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-6),
            "{number}"
        );
        let [a, b, c] = [0, 1, 4].map(|v| trajectory.frame(number)[v]);
        // Each face of this fan is seen from the same side as the middle vertex.
        assert!(normals[4].dot((b - a).cross(c - a)) > 0.0);
    }
    let written = samples(&text, "float3[] extent");
    assert_eq!(written.len(), FRAMES);
    for (number, (_, corners)) in written.iter().enumerate() {
        let frame = trajectory.frame(number);
        let low = frame.iter().copied().reduce(Vec3::min).unwrap();
        let high = frame.iter().copied().reduce(Vec3::max).unwrap();
        assert_eq!(corners, &[low, high]);
    }
    let handle = text.split("\"handle_1\"").nth(1).unwrap();
    let path: Vec<Vec3> = samples(handle, "xformOp:translate")
        .iter()
        .map(|s| s.1[0])
        .collect();
    let expected: Vec<Vec3> = (0..FRAMES).map(|k| trajectory.frame(k)[2]).collect();
    assert_eq!(path, expected);
}

#[test]
fn frames_left_out_leave_time_as_it_is_and_z_can_point_up() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.usda");
    let thin = ExportOptions {
        frames: odd(),
        up: UpAxis::Z,
        ..ExportOptions::plain(ExportFormat::Usda)
    };
    write(&trajectory, &path, &thin);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.contains("upAxis = \"Z\"") && text.contains("endTimeCode = 4\n"));
    let written = samples(&text, "point3f[] points");
    let expected = [(0.0, 1), (2.0, 3), (4.0, 5)];
    assert_eq!(written.len(), expected.len());
    for ((code, positions), (expected, frame)) in written.iter().zip(expected) {
        assert_eq!(*code, expected);
        let turned = trajectory
            .frame(frame)
            .iter()
            .map(|p| Vec3::new(p.x, -p.z, p.y));
        assert!(turned.eq(positions.iter().copied()));
    }
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

#[test]
fn meshes_in_a_folder_are_the_frames() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("frames");
    let all = ExportOptions {
        normals: true,
        frames: odd(),
        ..ExportOptions::plain(ExportFormat::ObjSequence)
    };
    write(&trajectory, &path, &all);
    for (number, frame) in [1, 3, 5].into_iter().enumerate() {
        let file = path.join(format!("cloth_{number:04}.obj"));
        let text = std::fs::read_to_string(&file).unwrap();
        assert_eq!(
            text.lines().filter(|line| line.starts_with("vn ")).count(),
            VERTICES
        );
        let mesh = read_obj(&file).unwrap().mesh;
        assert!(
            mesh.positions()
                .iter()
                .map(|p| p.as_vec3())
                .eq(trajectory.frame(frame).iter().copied())
        );
        assert_eq!(mesh.topology().faces(), trajectory.topology().faces());
    }
    assert_eq!(std::fs::read_dir(&path).unwrap().count(), 3);
    // The mesh beside a cache is its first frame.
    let cache = ExportOptions {
        frames: odd(),
        ..ExportOptions::plain(ExportFormat::Pc2)
    };
    write(&trajectory, &folder.path().join("a.pc2"), &cache);
    let mesh = read_obj(&folder.path().join("a.obj")).unwrap().mesh;
    let places = mesh.positions().iter().map(|p| p.as_vec3());
    assert!(places.eq(trajectory.frame(1).iter().copied()));
    let again = export(&trajectory, &path, &all, &mut || ControlFlow::Continue(()));
    assert!(again.unwrap_err().to_string().contains("not empty"));
}

#[test]
fn arrays_for_numpy_come_back() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let path = folder.path().join("a.npz");
    for up in [UpAxis::Y, UpAxis::Z] {
        let options = ExportOptions {
            up,
            normals: true,
            ..ExportOptions::plain(ExportFormat::Npz)
        };
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
        let end = export(
            &trajectory,
            &folder.path().join(name),
            &ExportOptions::plain(format),
            &mut || {
                beats += 1;
                if beats == 3 {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        );
        assert_eq!(end.unwrap(), ExportEnd::Stopped, "{name}");
        assert_eq!(
            std::fs::read_dir(folder.path()).unwrap().count(),
            0,
            "{name}"
        );
    }
}

#[test]
fn what_a_format_does_not_have_is_refused() {
    let (trajectory, folder) = (trajectory(), tempfile::tempdir().unwrap());
    let attempt = |options: &ExportOptions, name: &str| {
        let path = folder.path().join(name);
        export(&trajectory, &path, options, &mut || {
            ControlFlow::Continue(())
        })
        .unwrap_err()
    };
    let turned = ExportOptions {
        up: UpAxis::Z,
        ..ExportOptions::plain(ExportFormat::Glb)
    };
    says(attempt(&turned, "a.glb"), &["glTF has y up"]);
    let all = ExportOptions::plain(ExportFormat::Obj);
    says(attempt(&all, "a.obj"), &["one frame, and 7 were asked for"]);
    let beyond = ExportOptions {
        frames: span("5..9"),
        ..ExportOptions::plain(ExportFormat::Npz)
    };
    says(attempt(&beyond, "a.npz"), &["frame 9 was asked for"]);
    for format in [ExportFormat::Glb, ExportFormat::Pc2] {
        let with = ExportOptions {
            velocities: true,
            ..ExportOptions::plain(format)
        };
        says(attempt(&with, "a"), &["the format has no velocities"]);
    }
    for format in [ExportFormat::Usda, ExportFormat::ObjSequence] {
        says(
            attempt(&ExportOptions::plain(format), "none/such"),
            &["none/such"],
        );
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
