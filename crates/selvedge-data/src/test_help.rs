//! Help for tests: tables of cases, words of errors, and a cloth.

use std::fmt::Display;

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};

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
