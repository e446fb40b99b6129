//! Borders of panels: the lines of vertices along which seams run.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};

use super::{Corner, MeshFileError, Polygons};

/// A side of a polygon, by the corner at which it begins in the polygon's own sense.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Side {
    polygon: usize,
    corner: usize,
}

impl Side {
    /// Its two corners.
    fn ends(self, polygons: &Polygons) -> [Corner; 2] {
        let corners = &polygons.polygons[self.polygon].corners;
        [self.corner, self.corner + 1].map(|k| corners[k % corners.len()])
    }
}

/// A border line, end to end.
pub(super) struct Border {
    /// Its vertices.
    pub(super) line: Vec<u32>,
    /// The side of a polygon that each of its edges is.
    sides: Vec<Side>,
    /// Length in the pattern from the start to each vertex, as part of the whole.
    parts: Vec<f64>,
    /// Length of the whole in the pattern, in the unit of its coordinates.
    pub(super) length: f64,
}

/// Largest number of times that one border may be as finely cut as the other: a name that was
/// mixed up makes no thousands of vertices.
const MOST_FINER: usize = 20;

impl Border {
    /// The border whose vertices bear `name`, which all of them must.
    pub(super) fn named(polygons: &Polygons, name: &str) -> Result<Self, MeshFileError> {
        let label = polygons.label(name, "seams")?;
        let sides = open_edges(polygons);
        let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for [a, b] in sides.keys() {
            if label.contains(a) && label.contains(b) {
                next.entry(*a).or_default().push(*b);
                next.entry(*b).or_default().push(*a);
            }
        }
        let wrong = || {
            MeshFileError::content(format!(
                "seams: the vertices of {name:?} are not one line along the border of a panel, from one end to another: name the vertices of one line without gaps (l statements of a group); a border that is closed is two lines"
            ))
        };
        let end = next.iter().find(|(_, to)| to.len() == 1);
        let (&start, _) = end.ok_or_else(wrong)?;
        let mut line = vec![start];
        let mut before = None;
        let mut at = start;
        while let Some(&to) = next[&at].iter().find(|to| Some(**to) != before) {
            if line.len() > label.len() || next[&to].len() > 2 {
                return Err(wrong());
            }
            line.push(to);
            before = Some(at);
            at = to;
        }
        if line.len() != label.len() {
            return Err(wrong());
        }
        let side = |pair: &[u32]| sides[&[pair[0].min(pair[1]), pair[0].max(pair[1])]];
        let sides: Vec<Side> = line.windows(2).map(side).collect();
        Ok(Self::of(polygons, line, sides))
    }

    fn of(polygons: &Polygons, line: Vec<u32>, sides: Vec<Side>) -> Self {
        let mut parts = vec![0.0];
        let mut length = 0.0;
        for side in &sides {
            let ends = side.ends(polygons).map(|end| place(polygons, end));
            length += ends[0].distance(ends[1]);
            parts.push(length);
        }
        let whole = if length > 0.0 { length } else { 1.0 };
        parts.iter_mut().for_each(|part| *part /= whole);
        Self {
            line,
            sides,
            parts,
            length,
        }
    }

    /// Runs the other way.
    pub(super) fn reverse(&mut self) {
        self.line.reverse();
        self.sides.reverse();
        self.parts.reverse();
        self.parts.iter_mut().for_each(|part| *part = 1.0 - *part);
    }

    /// Cuts the edges of this border so that it has the vertices of a `finer` one that runs along
    /// it: each of its own vertices is the partner of the nearest of the other, in order, and
    /// between them lie new ones. All move along this border to the same part of its length as
    /// their partners, so that nothing is eased. Returns nothing where the other is more than
    /// [`MOST_FINER`] times as fine.
    pub(super) fn refined(&self, finer: &Self, polygons: &mut Polygons) -> Option<Vec<u32>> {
        if finer.line.len() > MOST_FINER * self.line.len() {
            return None;
        }
        let partners = self.partners(finer);
        let track = Track::of(self, polygons);
        let mut line = vec![self.line[0]];
        // From the last side to the first, so that numbers of a polygon's corners before the cut
        // stay; two sides may be of one polygon.
        let mut order: Vec<usize> = (0..self.sides.len()).collect();
        order.sort_by_key(|&side| std::cmp::Reverse(self.sides[side]));
        let mut inner: Vec<Vec<u32>> = vec![Vec::new(); self.sides.len()];
        for side in order {
            let [from, to] = [side, side + 1].map(|k| finer.parts[partners[k]]);
            let between = partners[side] + 1..partners[side + 1];
            let share = |k: usize| (finer.parts[k] - from) / (to - from);
            let shares: Vec<f64> = between.map(share).collect();
            inner[side] = cut(polygons, self.sides[side], self.line[side], &shares);
        }
        for (side, between) in inner.into_iter().enumerate() {
            line.extend(between);
            line.push(self.line[side + 1]);
        }
        for (&vertex, &part) in line.iter().zip(&finer.parts) {
            if let (position, Some(texture)) = track.at(part) {
                slide(polygons, vertex, position, texture);
            }
        }
        Some(line)
    }

    /// The vertex of `finer` beside each of this border's, first beside first and last beside last.
    fn partners(&self, finer: &Self) -> Vec<usize> {
        let (count, all) = (self.line.len(), finer.line.len());
        let mut partners = vec![0];
        for k in 1..count {
            let least = partners[k - 1] + 1;
            let most = all - (count - k);
            let gap = |&j: &usize| (finer.parts[j] - self.parts[k]).abs();
            let nearest = (least..=most).min_by(|a, b| gap(a).total_cmp(&gap(b)));
            partners.push(if k + 1 == count { all - 1 } else { nearest.unwrap_or(least) });
        }
        partners
    }
}

/// A border's course before it is cut: places in space and, where its panel is in one piece along
/// it, in the pattern.
struct Track {
    parts: Vec<f64>,
    positions: Vec<DVec3>,
    texture: Option<Vec<DVec2>>,
}

impl Track {
    fn of(border: &Border, polygons: &Polygons) -> Self {
        let positions = border.line.iter();
        let mut texture: Option<Vec<DVec2>> = Some(Vec::new());
        for (k, side) in border.sides.iter().enumerate() {
            let mut ends = side.ends(polygons);
            if ends[0].vertex != border.line[k] {
                ends.reverse();
            }
            let ends = ends.map(|end| end.texture.map(|t| polygons.texture[t]));
            texture = match (texture, ends) {
                (Some(mut known), [Some(from), Some(to)])
                    if known.last().is_none_or(|last| *last == from) =>
                {
                    if known.is_empty() {
                        known.push(from);
                    }
                    known.push(to);
                    Some(known)
                }
                _ => None,
            };
        }
        Self {
            parts: border.parts.clone(),
            positions: positions.map(|v| polygons.positions[*v as usize]).collect(),
            texture,
        }
    }

    /// The place at a part of the length.
    fn at(&self, part: f64) -> (DVec3, Option<DVec2>) {
        let last = self.parts.len() - 2;
        let after = self.parts.partition_point(|known| *known <= part);
        let k = after.saturating_sub(1).min(last);
        let [from, to] = [self.parts[k], self.parts[k + 1]];
        let share = if to > from { ((part - from) / (to - from)).min(1.0) } else { 0.0 };
        let texture = self.texture.as_ref();
        (
            self.positions[k].lerp(self.positions[k + 1], share),
            texture.map(|texture| texture[k].lerp(texture[k + 1], share)),
        )
    }
}

/// Moves a vertex of a border to a place along it, where the pattern has it once.
fn slide(polygons: &mut Polygons, vertex: u32, position: DVec3, texture: DVec2) {
    let corners = polygons.polygons.iter().flat_map(|p| &p.corners);
    let own = corners.filter(|corner| corner.vertex == vertex);
    let own = own.map(|corner| corner.texture.map(|t| polygons.texture[t]));
    let mut own = own.collect::<Vec<_>>();
    own.dedup();
    if own.len() != 1 {
        return;
    }
    polygons.positions[vertex as usize] = position;
    polygons.texture.push(texture);
    let moved = Some(polygons.texture.len() - 1);
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        if corner.vertex == vertex {
            corner.texture = moved;
        }
    }
}

fn place(polygons: &Polygons, corner: Corner) -> DVec2 {
    let vertex = polygons.positions[corner.vertex as usize];
    let texture = corner.texture.map(|texture| polygons.texture[texture]);
    texture.unwrap_or(vertex.truncate())
}

/// Edges of one polygon only, with their polygon and its corner.
pub(super) fn open_edges(polygons: &Polygons) -> BTreeMap<[u32; 2], Side> {
    let mut edges: BTreeMap<[u32; 2], Option<Side>> = BTreeMap::new();
    for (polygon, of) in polygons.polygons.iter().enumerate() {
        for (corner, [a, b]) in of.sides().enumerate() {
            let side = Some(Side { polygon, corner });
            let known = edges.entry([a.min(b), a.max(b)]);
            known.and_modify(|known| *known = None).or_insert(side);
        }
    }
    let open = edges.into_iter();
    open.filter_map(|(edge, side)| Some((edge, side?)))
        .collect()
}

/// Puts new vertices on a side of a polygon, at these shares of its length as seen from vertex
/// `from`.
fn cut(polygons: &mut Polygons, side: Side, from: u32, shares: &[f64]) -> Vec<u32> {
    let [one, two] = side.ends(polygons);
    let is_along = one.vertex == from;
    let ends = [one, two].map(|corner| polygons.positions[corner.vertex as usize]);
    let textures = [one, two].map(|corner| corner.texture.map(|t| polygons.texture[t]));
    let mut made = Vec::new();
    for &share in shares {
        let along = if is_along { share } else { 1.0 - share };
        let vertex = polygons.positions.len() as u32;
        polygons.positions.push(ends[0].lerp(ends[1], along));
        let known = polygons.number(one.vertex);
        polygons.numbers.push(known);
        let texture = match textures {
            [Some(a), Some(b)] => {
                polygons.texture.push(a.lerp(b, along));
                Some(polygons.texture.len() - 1)
            }
            _ => None,
        };
        for label in polygons.labels.values_mut() {
            if label.contains(&one.vertex) && label.contains(&two.vertex) {
                label.insert(vertex);
            }
        }
        made.push(Corner {
            vertex,
            texture,
            loose: None,
        });
    }
    let line = made.iter().map(|corner| corner.vertex).collect();
    if !is_along {
        made.reverse();
    }
    let after = side.corner + 1;
    let corners = &mut polygons.polygons[side.polygon].corners;
    corners.splice(after..after, made);
    line
}
