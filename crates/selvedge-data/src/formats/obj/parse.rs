//! The statements of an OBJ file as polygons: indices resolved, nothing interpreted.
//!
//! Lines (`l`) of a group give the group's name to their vertices. Read beyond the standard are
//! ARCSim's velocities of vertices (`nv`), rest angles of edges (`e`, `ea`), and labels of faces
//! (`fl`, `tl`), which are taken for names of fabrics.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use crate::formats::polygons::{Corner, MeshFileError, Place, Polygon, Polygons};

/// Statements that say nothing of the shape: normals, points of curves, smoothing, libraries of
/// materials.
const SILENT: [&str; 4] = ["vn", "vp", "s", "mtllib"];

/// State of reading: what the statements so far have set.
#[derive(Default)]
struct Reader {
    polygons: Polygons,
    object: Option<String>,
    groups: Vec<String>,
    /// True where the next face is the first of these names.
    is_new_part: bool,
    fabric: Option<u32>,
    /// The edge of the last `e`.
    edge: Option<[u32; 2]>,
    /// Corners whose texture coordinates are passed over, as none come before them, and the line of
    /// the first.
    untextured: Option<(usize, usize)>,
    /// Statements that are passed over, with the first line and the number of each.
    unknown: BTreeMap<String, (usize, usize)>,
}

pub(super) fn parse(text: &str) -> Result<Polygons, MeshFileError> {
    // Some programs put a byte-order mark before the first line.
    let text = text.trim_start_matches('\u{feff}');
    let mut reader = Reader::default();
    for (line, content) in logical_lines(text) {
        let mut words = content.split_whitespace();
        let Some(keyword) = words.next() else {
            continue;
        };
        let rest: Vec<&str> = words.collect();
        let read = reader.read(line, keyword, &rest);
        read.map_err(|problem| MeshFileError::content(format!("line {line}: {problem}")))?;
    }
    reader.finish()
}

impl Reader {
    fn read(&mut self, line: usize, keyword: &str, rest: &[&str]) -> Result<(), String> {
        let polygons = &mut self.polygons;
        match keyword {
            "v" => {
                let [x, y, z] = numbers(rest)?;
                polygons.positions.push(DVec3::new(x, y, z));
                polygons.numbers.push(polygons.positions.len());
            }
            "vt" => {
                let [u, v] = numbers(rest)?;
                polygons.texture.push(DVec2::new(u, v));
            }
            "nv" => {
                let [x, y, z] = numbers(rest)?;
                let last = polygons.positions.len().checked_sub(1);
                let last = last.ok_or("a velocity stands before the first vertex")?;
                polygons.velocities.insert(last as u32, DVec3::new(x, y, z));
            }
            "f" => self.read_face(line, rest)?,
            "e" if rest.len() == 2 => self.read_edge(rest)?,
            "ea" => self.read_rest_angle(rest)?,
            // A line of a group names a border, as seams need it.
            "l" if !self.groups.is_empty() => self.read_line(rest)?,
            "fl" | "tl" => {
                let label = rest.first().ok_or("a label of a face is missing")?;
                let fabric = polygons.fabric_of(label);
                let last = polygons.polygons.last_mut();
                last.ok_or("a label stands before the first face")?.fabric = Some(fabric);
            }
            "o" => {
                self.object = (!rest.is_empty()).then(|| rest.join(" "));
                self.is_new_part = true;
            }
            "g" => {
                self.groups = rest.iter().map(|name| (*name).to_owned()).collect();
                self.is_new_part = true;
            }
            "usemtl" => {
                self.fabric =
                    if rest.is_empty() { None } else { Some(polygons.fabric_of(&rest.join(" "))) };
            }
            known if SILENT.contains(&known) => {}
            other => {
                let entry = self.unknown.entry(other.to_owned()).or_insert((line, 0));
                entry.1 += 1;
            }
        }
        Ok(())
    }

    /// Gives the vertices of a line the names of its groups.
    fn read_line(&mut self, rest: &[&str]) -> Result<(), String> {
        let polygons = &mut self.polygons;
        for word in rest {
            let vertex = index(word, polygons.positions.len(), "vertex")? as u32;
            for name in &self.groups {
                let label = polygons.labels.entry(name.clone()).or_default();
                label.insert(vertex);
            }
        }
        Ok(())
    }

    fn read_edge(&mut self, rest: &[&str]) -> Result<(), String> {
        let end = |k: usize| index(rest[k], self.polygons.positions.len(), "vertex");
        let [a, b] = [end(0)? as u32, end(1)? as u32];
        self.edge = Some([a.min(b), a.max(b)]);
        Ok(())
    }

    fn read_rest_angle(&mut self, rest: &[&str]) -> Result<(), String> {
        let [angle] = numbers(rest)?;
        let edge = self.edge;
        let edge = edge.ok_or("a rest angle stands before the first edge")?;
        if angle.abs() > std::f64::consts::PI {
            return Err(format!("a rest angle is between -π and π, found {angle}"));
        }
        self.polygons.angles.insert(edge, angle);
        Ok(())
    }

    fn read_face(&mut self, line: usize, rest: &[&str]) -> Result<(), String> {
        let mut corners = Vec::with_capacity(rest.len());
        for word in rest {
            let (corner, is_untextured) = corner(word, &self.polygons)?;
            corners.push(corner);
            if is_untextured {
                self.untextured.get_or_insert((line, 0)).1 += 1;
            }
        }
        if corners.len() < 3 {
            return Err(format!("a face needs 3 corners, found {}", corners.len()));
        }
        for name in self.object.iter().chain(&self.groups) {
            let label = self.polygons.labels.entry(name.clone()).or_default();
            label.extend(corners.iter().map(|corner| corner.vertex));
        }
        if self.is_new_part || self.polygons.parts.is_empty() {
            let names = self.object.iter().chain(&self.groups).cloned();
            self.polygons.parts.push(names.collect());
            self.is_new_part = false;
        }
        self.polygons.polygons.push(Polygon {
            place: Place::Line(line),
            corners,
            fabric: self.fabric,
            part: self.polygons.parts.len() - 1,
        });
        Ok(())
    }

    fn finish(self) -> Result<Polygons, MeshFileError> {
        let mut polygons = self.polygons;
        match self.untextured {
            None => {}
            Some((line, count)) if polygons.texture.is_empty() => polygons.warnings.push(format!(
                "{count} texture corners without coordinates (vt) are passed over, the first in line {line}: the pattern comes from the shape"
            )),
            Some((line, _)) => {
                return Err(MeshFileError::content(format!(
                    "line {line}: this face names a texture coordinate, but the first (vt) comes later in the file"
                )));
            }
        }
        if !self.unknown.is_empty() {
            let count: usize = self.unknown.values().map(|(_, count)| count).sum();
            let each: Vec<String> = self
                .unknown
                .iter()
                .map(|(name, (line, count))| format!("{count} × {name:?} (first in line {line})"))
                .collect();
            let is_sewing = |name: &String| ["l", "seam", "stitch"].contains(&name.as_str());
            polygons.warnings.push(format!(
                "{count} statements that no mesh of faces has are passed over: {}{}",
                each.join(", "),
                if self.unknown.keys().any(is_sewing) { "; what is to be sewn is given by seams in the scene, between borders, not by lines" } else { "" }
            ));
        }
        Ok(polygons)
    }
}

/// Lines with their numbers from 1, without comments; one that ends in a backslash is joined with the
/// next. A comment ends with its line, whatever it ends in.
fn logical_lines<'a>(text: &'a str) -> impl Iterator<Item = (usize, String)> + use<'a> {
    let bare = |line: &'a str| line.split('#').next().unwrap_or_default();
    let mut lines = text.lines().map(bare).enumerate();
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

/// A corner, and true where it names a texture coordinate before there is any.
fn corner(word: &str, polygons: &Polygons) -> Result<(Corner, bool), String> {
    let mut parts = word.split('/');
    let vertex = parts.next().unwrap_or_default();
    let vertex = index(vertex, polygons.positions.len(), "vertex")?;
    let texture = parts.next().filter(|text| !text.is_empty());
    let is_untextured = texture.is_some() && polygons.texture.is_empty();
    let texture = match texture.filter(|_| !is_untextured) {
        None => None,
        Some(text) => Some(index(text, polygons.texture.len(), "texture coordinate")?),
    };
    let vertex = u32::try_from(vertex).map_err(|_| "there are too many vertices".to_owned())?;
    let corner = Corner {
        vertex,
        texture,
        loose: None,
    };
    Ok((corner, is_untextured))
}

/// An index from 0: a number from 1, or one counted back from the last so far.
fn index(text: &str, count: usize, what: &str) -> Result<usize, String> {
    let number = text.parse();
    let number: i64 = number.map_err(|_| format!("{text:?} is no number of a {what}"))?;
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
