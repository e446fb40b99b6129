//! The statements of an OBJ file, with indices resolved and nothing interpreted.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use super::error::ObjError;

/// Statements of a file.
#[derive(Debug, Default)]
pub(super) struct Statements {
    pub(super) positions: Vec<DVec3>,
    pub(super) texture: Vec<DVec2>,
    pub(super) polygons: Vec<Polygon>,
    /// Vertices by the names of their objects and groups.
    pub(super) labels: BTreeMap<String, BTreeSet<u32>>,
}

/// A face.
#[derive(Debug)]
pub(super) struct Polygon {
    /// Line in the file, from 1.
    pub(super) line: usize,
    pub(super) corners: Vec<Corner>,
}

/// A corner of a face: indices from 0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) vertex: u32,
    pub(super) texture: Option<usize>,
}

pub(super) fn parse(text: &str) -> Result<Statements, ObjError> {
    // Some programs put a byte-order mark before the first line.
    let text = text.trim_start_matches('\u{feff}');
    let mut statements = Statements::default();
    let mut object: Option<String> = None;
    let mut groups: Vec<String> = Vec::new();
    for (line, content) in logical_lines(text) {
        let content = content.split('#').next().unwrap_or_default();
        let mut words = content.split_whitespace();
        let Some(keyword) = words.next() else {
            continue;
        };
        let rest: Vec<&str> = words.collect();
        let error = |problem| ObjError::Line { line, problem };
        match keyword {
            "v" => {
                let [x, y, z] = numbers(&rest).map_err(error)?;
                statements.positions.push(DVec3::new(x, y, z));
            }
            "vt" => {
                let [u, v] = numbers(&rest).map_err(error)?;
                statements.texture.push(DVec2::new(u, v));
            }
            "f" => {
                let corners = corners(&rest, &statements).map_err(error)?;
                for name in object.iter().chain(&groups) {
                    let label = statements.labels.entry(name.clone()).or_default();
                    label.extend(corners.iter().map(|corner| corner.vertex));
                }
                statements.polygons.push(Polygon { line, corners });
            }
            "o" => object = (!rest.is_empty()).then(|| rest.join(" ")),
            "g" => groups = rest.iter().map(|name| (*name).to_owned()).collect(),
            "vn" | "vp" | "s" | "usemtl" | "mtllib" => {}
            other => {
                let problem = format!("{other:?} is no statement that a mesh of faces has");
                return Err(error(problem));
            }
        }
    }
    Ok(statements)
}

/// Lines with their numbers from 1; one that ends in a backslash is joined with the next.
fn logical_lines(text: &str) -> impl Iterator<Item = (usize, String)> {
    let mut lines = text.lines().enumerate();
    std::iter::from_fn(move || {
        let (number, first) = lines.next()?;
        let mut joined = first.to_owned();
        while let Some(open) = joined.trim_end().strip_suffix('\\') {
            joined = format!("{open} {}", lines.next().map_or("", |next| next.1));
        }
        Some((number + 1, joined))
    })
}

/// The first `N` numbers; what follows (a weight, colours) is passed over.
fn numbers<const N: usize>(words: &[&str]) -> Result<[f64; N], String> {
    if words.len() < N {
        return Err(format!("expected {N} numbers, found {}", words.len()));
    }
    let mut values = [0.0; N];
    for (value, word) in values.iter_mut().zip(words) {
        *value = match word.parse::<f64>() {
            Ok(number) if number.is_finite() => number,
            _ => return Err(format!("{word:?} is no finite number")),
        };
    }
    Ok(values)
}

fn corners(words: &[&str], statements: &Statements) -> Result<Vec<Corner>, String> {
    if words.len() < 3 {
        return Err(format!("a face needs 3 corners, found {}", words.len()));
    }
    words.iter().map(|word| corner(word, statements)).collect()
}

fn corner(word: &str, statements: &Statements) -> Result<Corner, String> {
    let mut parts = word.split('/');
    let vertex = parts.next().unwrap_or_default();
    let vertex = index(vertex, statements.positions.len(), "vertex")?;
    let texture = match parts.next() {
        None | Some("") => None,
        Some(text) => Some(index(text, statements.texture.len(), "texture coordinate")?),
    };
    let vertex = u32::try_from(vertex).map_err(|_| "there are too many vertices".to_owned())?;
    Ok(Corner { vertex, texture })
}

/// An index from 0: a number from 1, or one counted back from the last so far.
fn index(text: &str, count: usize, what: &str) -> Result<usize, String> {
    let number: i64 = text
        .parse()
        .map_err(|_| format!("{text:?} is no number of a {what}"))?;
    let place = match number {
        1.. => number - 1,
        0 => -1,
        _ => count as i64 + number,
    };
    match usize::try_from(place) {
        Ok(place) if place < count => Ok(place),
        _ => Err(format!(
            "there is no {what} {number} (there are {count} so far)"
        )),
    }
}
