//! Obstacles that were exported come back as obstacles of a scene, frame by frame.

use std::path::Path;

use glam::{DQuat, DVec3, Vec2, Vec3};
use selvedge_cloth::{Obstacle, ObstaclePath, RigidKey, bodies};
use tempfile::TempDir;

use crate::UpAxis;
use crate::export::{ExportFormat, ExportOptions, export, files_beside};
use crate::formats::arrays::ArrayFile;
use crate::obstacle::ObstacleFile;
use crate::test_help::{exported, run, says, sheet};
use crate::trajectory::Trajectory;
use crate::trajectory::obstacles::ObstacleTrack;

const FRAMES: usize = 5;
const RATE: f64 = 30.0;

fn triangle(name: &str, at: f64) -> Obstacle {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Z].map(|p| p + DVec3::X * at);
    Obstacle::new(name, points.to_vec(), vec![[0, 2, 1]]).unwrap()
}

/// A cloth that moves beside one that stands, one that turns as it rises, and one that bends.
fn trajectory() -> Trajectory {
    let key = |time: f64| RigidKey {
        time,
        rotation: DQuat::from_rotation_y(3.0 * time),
        translation: DVec3::new(1.0, time, 0.0),
    };
    let turning = ObstaclePath::Rigid(vec![key(0.0), key(0.1)]);
    let lower = |p: DVec3| p - DVec3::Y * 3.0;
    let frame = |y: f64| [DVec3::Y * y, DVec3::X, DVec3::Z].map(lower).to_vec();
    let bending = ObstaclePath::Points {
        frame_rate: RATE,
        frames: [0.0, 1.0, 0.5, 2.0, 4.0].map(frame).to_vec(),
    };
    let obstacles = [
        triangle("a still-one", 5.0),
        triangle("sheet", 7.0).moving(turning).unwrap(),
        triangle("bending", 9.0).moving(bending).unwrap(),
    ];
    let flat = [Vec2::ZERO, Vec2::X, Vec2::Y];
    let corners = flat.map(|c| c.extend(0.0));
    let cloth = sheet(&corners, &flat, &[[0, 1, 2]], &[0]);
    let at = |frame: usize| corners.map(|p| p + Vec3::Z * frame as f32);
    let positions = (0..FRAMES).flat_map(at).collect();
    let made = run(cloth, RATE, positions);
    let track = |o: &Obstacle| ObstacleTrack::of(o, RATE, 0, FRAMES);
    let tracks = obstacles.iter().map(track).collect();
    made.with_obstacles(tracks).unwrap()
}

fn written(format: ExportFormat, name: &str, up: UpAxis) -> TempDir {
    let written = exported(&trajectory(), format, name, |o| {
        o.up = up;
        if format == ExportFormat::Obj {
            o.frames = "2".parse().unwrap();
        }
    });
    written.0
}

fn read(folder: &Path, text: &str) -> Obstacle {
    let file: ObstacleFile = toml::from_str(&format!("name = \"o\"\n{text}")).unwrap();
    let spec = file.resolve(folder).unwrap();
    spec.build(folder, RATE, &mut Vec::new()).unwrap()
}

/// Checks that the points of every obstacle are among those that were read, in every frame.
fn assert_among(found: &Obstacle) {
    let trajectory = trajectory();
    for obstacle in trajectory.obstacles() {
        for frame in 0..FRAMES {
            let points: Vec<DVec3> = found.positions_at(frame as f64 / RATE).collect();
            for expected in obstacle.frame(frame).iter() {
                let nearest = points.iter().map(|p| p.distance(expected.as_dvec3()));
                let nearest = nearest.fold(f64::INFINITY, f64::min);
                // Below 16 m, rounded to single precision some times.
                assert!(nearest < 1e-5, "{} {frame}: {nearest}", obstacle.name());
            }
        }
    }
}

fn assert_is(found: &Obstacle, number: usize, frames: std::ops::Range<usize>) {
    let trajectory = trajectory();
    for frame in frames.clone() {
        let expected = trajectory.obstacles()[number].frame(frame);
        let time = (frame - frames.start) as f64 / RATE;
        let points = found.positions_at(time).zip(expected.iter());
        for (found, expected) in points {
            assert!(found.distance(expected.as_dvec3()) < 1e-6, "{frame}");
        }
    }
}

#[test]
fn scenes_of_other_programs_have_them_in_the_same_file() {
    for (format, name) in [
        (ExportFormat::Glb, "x.glb"),
        (ExportFormat::Usdc, "x.usdc"),
        (ExportFormat::Usdz, "x.usdz"),
    ] {
        let folder = written(format, name, UpAxis::Y);
        let text = format!("mesh = \"{name}\"\nmotion = \"{name}\"");
        let found = read(folder.path(), &text);
        assert_eq!(found.point_count(), 12, "{name}");
        assert_among(&found);
    }
    // Turned by the writer and back by the reader.
    let folder = written(ExportFormat::Usdc, "z.usdc", UpAxis::Z);
    let moving = "mesh = \"z.usdc\"\nmotion = \"z.usdc\"";
    assert_among(&read(folder.path(), moving));
}

/// A round body is smooth; one with edges would be smeared, and has none: programs then take the faces'.
#[test]
fn round_bodies_alone_have_normals() {
    let bodies = [bodies::sphere(0.1, 0.03), bodies::cuboid(DVec3::ONE)];
    let tracks = bodies.into_iter().zip(["ball", "box"]).map(|(body, name)| {
        let body = Obstacle::new(name, body.points, body.faces).unwrap();
        ObstacleTrack::of(&body, RATE, 0, FRAMES)
    });
    let made = trajectory().with_obstacles(tracks.collect()).unwrap();
    let (_folder, path) = exported(&made, ExportFormat::Glb, "x.glb", |o| o.normals = true);
    let bytes = std::fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    for (name, has) in [("ball", true), ("box", false)] {
        let meshes = json["meshes"].as_array().unwrap();
        let mesh = meshes.iter().find(|mesh| mesh["name"] == name);
        let attributes = &mesh.unwrap()["primitives"][0]["attributes"];
        assert_eq!(attributes.get("NORMAL").is_some(), has, "{name}");
    }
}

/// Alembic is written and not read: its bytes are those that Blender read (guides/export.md).
#[test]
fn an_archive_of_alembic_is_as_it_was_when_others_read_it() {
    let bytes = |up| {
        let folder = written(ExportFormat::Abc, "x.abc", up);
        std::fs::read(folder.path().join("x.abc")).unwrap()
    };
    let [y, z] = [UpAxis::Y, UpAxis::Z].map(bytes);
    assert_eq!(&crate::formats::input::hash(&y)[..16], "e95ba3e1ebc2f064");
    // Turned, and otherwise the same.
    assert!(y != z && y.len() == z.len());
}

#[test]
fn other_formats_have_them_in_files_of_their_own() {
    let folder = written(ExportFormat::Pc2, "x.pc2", UpAxis::Y);
    let of = |text: &str| read(folder.path(), text);
    assert_is(&of("mesh = \"x.a_still_one.obj\""), 0, 0..FRAMES);
    let turning = "mesh = \"x.obstacle_sheet_1.obj\"\nmotion = \"x.obstacle_sheet_1.pc2\"";
    assert_is(&of(turning), 1, 0..FRAMES);
    let bending = "mesh = \"x.bending.obj\"\nmotion = \"x.bending.pc2\"";
    assert_is(&of(bending), 2, 0..FRAMES);
    assert!(!folder.path().join("x.a_still_one.pc2").exists());

    let folder = written(ExportFormat::ObjSequence, "all", UpAxis::Y);
    let of = |text: &str| read(folder.path(), text);
    assert_is(&of("mesh = \"all/a_still_one.obj\""), 0, 0..FRAMES);
    for frame in 0..FRAMES {
        let bending = format!("mesh = \"all/bending_{frame:04}.obj\"");
        assert_is(&of(&bending), 2, frame..frame + 1);
    }

    let folder = written(ExportFormat::Obj, "x.obj", UpAxis::Y);
    assert_is(&read(folder.path(), "mesh = \"x.bending.obj\""), 2, 2..3);
}

#[test]
fn files_beside_are_all_that_is_written_but_the_file_itself() {
    for (format, name) in [
        (ExportFormat::Pc2, "x.pc2"),
        (ExportFormat::Obj, "x.obj"),
        (ExportFormat::Npz, "x.npz"),
    ] {
        let folder = written(format, name, UpAxis::Y);
        let path = folder.path().join(name);
        let mut expected = files_beside(&trajectory(), format, &path);
        assert_eq!(expected.is_empty(), format == ExportFormat::Npz);
        expected.push(path);
        expected.sort();
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut found: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
        found.sort();
        assert_eq!(found, expected);
    }
}

/// `ball` and `ball_faces`: the faces of one would have the name of the other.
#[test]
fn names_of_obstacles_and_of_what_belongs_to_them_are_apart() {
    let names = ["ball", "ball_faces", "Ball", "ball_mesh"];
    let tracks = names.map(|name| ObstacleTrack::of(&triangle(name, 5.0), RATE, 0, FRAMES));
    let made = trajectory().with_obstacles(tracks.to_vec()).unwrap();
    let (_folder, path) = exported(&made, ExportFormat::Npz, "x.npz", |_| ());
    let bytes = std::fs::read(path).unwrap();
    let archive = ArrayFile::npz(&bytes).unwrap();
    for name in [
        "ball",
        "obstacle_ball_faces_1",
        "obstacle_Ball_1",
        "obstacle_ball_mesh_1",
    ] {
        assert_eq!(
            archive.floats(&format!("obstacle_{name}")).unwrap().shape,
            [1, 3, 3]
        );
        assert!(
            archive.wholes(&format!("obstacle_{name}_faces")).is_ok(),
            "{name}"
        );
    }
    let beside = files_beside(&made, ExportFormat::Obj, Path::new("x.obj"));
    let lower = beside
        .iter()
        .map(|path| path.to_string_lossy().to_lowercase());
    assert_eq!(
        lower.collect::<std::collections::BTreeSet<_>>().len(),
        names.len()
    );
}

/// The mesh beside a cache and the files of obstacles were not named: whatever has their names stays.
#[test]
fn nothing_that_was_not_named_is_overwritten() {
    for (format, name, beside) in [
        (ExportFormat::Pc2, "x.pc2", "x.obj"),
        (ExportFormat::Pc2, "x.pc2", "x.bending.pc2"),
        (ExportFormat::Obj, "x.obj", "x.a_still_one.obj"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let [path, mine] = [name, beside].map(|name| folder.path().join(name));
        std::fs::write(&path, "named").unwrap();
        std::fs::write(&mine, "mine").unwrap();
        let mut options = ExportOptions::plain(format);
        options.frames = "2".parse().unwrap();
        let go_on = &mut || std::ops::ControlFlow::Continue(());
        let error = export(&trajectory(), &path, &options, go_on).unwrap_err();
        says(error, &[beside, "move it away"]);
        assert_eq!(std::fs::read(&mine).unwrap(), b"mine");
        assert_eq!(std::fs::read(&path).unwrap(), b"named");
        std::fs::remove_file(&mine).unwrap();
        assert!(export(&trajectory(), &path, &options, go_on).unwrap());
    }
}

#[test]
fn an_archive_has_them_as_arrays() {
    let folder = written(ExportFormat::Npz, "x.npz", UpAxis::Y);
    let bytes = std::fs::read(folder.path().join("x.npz")).unwrap();
    let archive = ArrayFile::npz(&bytes).unwrap();
    let trajectory = trajectory();
    let names = ["a_still_one", "obstacle_sheet_1", "bending"];
    for (track, name) in trajectory.obstacles().iter().zip(names) {
        let frames = if track.is_still() { 1 } else { FRAMES };
        let array = archive.floats(&format!("obstacle_{name}")).unwrap();
        assert_eq!(array.shape, [frames, 3, 3]);
        let expected = (0..frames).flat_map(|frame| track.frame(frame).into_owned());
        let expected: Vec<f64> = expected.flat_map(|p| p.as_dvec3().to_array()).collect();
        assert_eq!(array.values, expected);
        let faces = archive.wholes(&format!("obstacle_{name}_faces")).unwrap();
        assert_eq!(faces.values, [0, 2, 1]);
    }
}
