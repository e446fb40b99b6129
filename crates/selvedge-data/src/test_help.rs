//! Help for tests: tables of cases, words of errors, a cloth and its runs.

use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};
use selvedge_data::export::{ExportFormat, ExportOptions, FrameSpan, export};
use selvedge_data::{Provenance, Trajectory};
use tempfile::TempDir;

/// A cloth of these rest positions, material coordinates, faces and handles.
pub(crate) fn sheet(rest: &[Vec3], flat: &[Vec2], faces: &[[u32; 3]], handles: &[u32]) -> Cloth {
    let arrays = ClothArrays {
        rest_positions: rest.to_vec(),
        material_coordinates: flat.to_vec(),
        vertex_mass: vec![0.1; rest.len()],
        face_area: vec![0.5; faces.len()],
    };
    let topology = Topology::new(rest.len(), faces).unwrap();
    Cloth::new(topology, Handles::new(handles, rest.len()).unwrap(), arrays).unwrap()
}

/// Two squares sewn along 1-2, the second mirrored and apart in the pattern.
pub(crate) fn sewn_squares() -> Cloth {
    let faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]];
    let at = [0.0, 1.0, 1.0, 0.0, 2.0, 2.0].into_iter();
    let at = at.zip([0.0, 0.0, 1.0, 1.0, 0.0, 1.0]);
    let flat: Vec<Vec2> = at.map(Vec2::from).collect();
    let mirrored = |v: usize| Vec2::new(10.0 - flat[v].x, flat[v].y);
    let second = [4, 5, 1, 2].map(mirrored);
    let arrays = ClothArrays {
        rest_positions: flat.iter().map(|p| p.extend(0.25)).collect(),
        material_coordinates: [&flat[..4], &second].concat(),
        vertex_mass: vec![0.1; 6],
        face_area: vec![0.5; 4],
    };
    let corners = vec![[0, 1, 2], [0, 2, 3], [6, 4, 5], [6, 5, 7]];
    let topology = Topology::new(6, &faces).unwrap();
    Cloth::sewn(topology, Handles::new(&[3], 6).unwrap(), arrays, corners).unwrap()
}

/// Of a run without a scene.
pub(crate) fn provenance(frame_rate: f64, made_by: &str) -> Provenance {
    Provenance {
        frame_rate,
        scene: serde_json::Value::Null,
        made_by: made_by.to_owned(),
    }
}

/// A run of `cloth`, without a scene.
pub(crate) fn run(cloth: Cloth, frame_rate: f64, positions: Vec<Vec3>) -> Trajectory {
    Trajectory::new(cloth, positions, provenance(frame_rate, "tests")).unwrap()
}

/// A fan of four triangles around a middle, that sways and swells in awkward numbers: seven frames.
pub(crate) fn fan() -> Trajectory {
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]];
    let flat = corners.map(Vec2::from_array);
    let faces = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let at = |frame: usize, c: &Vec2| {
        let t = frame as f32 / 7.0;
        Vec3::new(0.1 * t + 0.01 * c.x.sin(), c.y * (1.0 + t), 1e-7 * t - c.x) + 0.3 * t * Vec3::Z
    };
    let frame = |k: usize| flat.iter().map(move |c| at(k, c));
    let positions = (0..7).flat_map(frame).collect();
    let rest: Vec<Vec3> = frame(0).collect();
    let cloth = sheet(&rest, &flat, &faces, &[3, 2]);
    let provenance = provenance(60.0, "a \"test\" \\ 1");
    Trajectory::new(cloth, positions, provenance).unwrap()
}

/// Frames 1, 3 and 5, of [`fan`].
pub(crate) fn odd() -> FrameSpan {
    FrameSpan {
        every: 2,
        ..span("1..6")
    }
}

/// A span of frames, by its text.
pub(crate) fn span(text: &str) -> FrameSpan {
    text.parse().unwrap()
}

/// Writes what `options` choose of a run.
pub(crate) fn write(trajectory: &Trajectory, path: &Path, options: &ExportOptions) {
    let mut go_on = || ControlFlow::Continue(());
    export(trajectory, path, options, &mut go_on).unwrap();
}

/// The plain options of a format, as `edit` changes them.
pub(crate) fn options(
    format: ExportFormat,
    edit: impl FnOnce(&mut ExportOptions),
) -> ExportOptions {
    let mut options = ExportOptions::plain(format);
    edit(&mut options);
    options
}

/// A new folder, and in it the file of this name that [`options`] make of a run.
pub(crate) fn exported(
    trajectory: &Trajectory,
    format: ExportFormat,
    name: &str,
    edit: impl FnOnce(&mut ExportOptions),
) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write(trajectory, &path, &options(format, edit));
    (folder, path)
}

/// A file of tensors with its header replaced by `edit` of it.
pub(crate) fn with_header(bytes: &[u8], edit: impl Fn(&str) -> String) -> Vec<u8> {
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header = edit(std::str::from_utf8(&bytes[8..8 + length]).unwrap());
    let length_now = (header.len() as u64).to_le_bytes();
    [&length_now, header.as_bytes(), &bytes[8 + length..]].concat()
}

/// Checks that `text` has all of these words.
#[track_caller]
pub(crate) fn says(text: impl Display, words: &[&str]) {
    let text = text.to_string();
    for word in words {
        assert!(text.contains(word), "{text} lacks {word}");
    }
}

/// The cells of the lines of a table, ` | ` between them; `\n` in a cell is a new line.
pub(crate) fn table<const N: usize>(text: &str) -> Vec<[&'static str; N]> {
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let cell = |cell: &str| -> &'static str { cell.replace("\\n", "\n").leak() };
    let cells = lines.map(|line| {
        let cells: Vec<&'static str> = line.split(" | ").map(cell).collect();
        let count = cells.len();
        cells
            .try_into()
            .unwrap_or_else(|_| panic!("{count} cells for {N}: {line}"))
    });
    cells.collect()
}

/// Checks that what is made of each line but its last cell is refused with the words in that.
#[track_caller]
pub(crate) fn refuses<T>(cases: &str, make: impl Fn(&str, &str) -> Result<T, String>) {
    for [first, second, words] in table(cases) {
        let error = make(first, second).err();
        says(error.as_deref().unwrap_or("nothing"), &[words]);
    }
}
