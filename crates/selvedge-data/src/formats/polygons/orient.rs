//! Turning faces so that all of a sheet are counter-clockwise from the same side.

use std::collections::HashMap;

use super::Polygons;

/// A face's side of an edge, and true where it runs from the smaller vertex to the larger.
type Sides = Vec<(usize, bool)>;

/// Turns faces that run against most of their sheet. A sheet that cannot be turned one way (a
/// Möbius strip) is left to the checks of the mesh.
pub(super) fn orient(polygons: &mut Polygons) {
    let sides = sides(polygons);
    let count = polygons.polygons.len();
    let mut flips: Vec<Option<bool>> = vec![None; count];
    let mut places = Vec::new();
    for first in 0..count {
        if flips[first].is_some() {
            continue;
        }
        let sheet = turn_sheet(polygons, &sides, &mut flips, first);
        // Most faces are right.
        let is_turned = |&face: &usize| flips[face] == Some(true);
        let (turned, kept): (Vec<usize>, Vec<usize>) = sheet.into_iter().partition(is_turned);
        let against = if turned.len() <= kept.len() { turned } else { kept };
        turn_angles(polygons, &against);
        for face in against {
            polygons.polygons[face].corners.reverse();
            places.push(polygons.polygons[face].place);
        }
    }
    if let Some(first) = places.first() {
        polygons.warnings.push(format!(
            "{} faces are turned round, so that all of a sheet are counter-clockwise from the same side; the first at {first}",
            places.len()
        ));
    }
}

/// Changes the sign of the rest angles of edges whose two faces are turned: where only one is, the
/// angle was that of no sheet.
fn turn_angles(polygons: &mut Polygons, faces: &[usize]) {
    let mut turned: HashMap<[u32; 2], u32> = HashMap::new();
    for &face in faces {
        for [a, b] in polygons.polygons[face].sides() {
            *turned.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    for (edge, angle) in &mut polygons.angles {
        if turned.get(edge).is_some_and(|count| *count > 1) {
            *angle = -*angle;
        }
    }
}

fn sides(polygons: &Polygons) -> HashMap<[u32; 2], Sides> {
    let mut sides: HashMap<[u32; 2], Sides> = HashMap::new();
    for (face, polygon) in polygons.polygons.iter().enumerate() {
        for [a, b] in polygon.sides() {
            let key = [a.min(b), a.max(b)];
            sides.entry(key).or_default().push((face, a < b));
        }
    }
    sides
}

/// Decides for the sheet of face `first` which of its faces run against it; gives its faces.
fn turn_sheet(
    polygons: &Polygons,
    sides: &HashMap<[u32; 2], Sides>,
    flips: &mut [Option<bool>],
    first: usize,
) -> Vec<usize> {
    let mut sheet = vec![first];
    flips[first] = Some(false);
    let mut next = 0;
    while let Some(&face) = sheet.get(next) {
        next += 1;
        let flip = flips[face] == Some(true);
        for [a, b] in polygons.polygons[face].sides() {
            // Edges of more than two faces say nothing; the mesh names them.
            let Some([one, two]) = sides.get(&[a.min(b), a.max(b)]).map(Vec::as_slice) else {
                continue;
            };
            let other = if one.0 == face { two.0 } else { one.0 };
            if flips[other].is_none() {
                flips[other] = Some(flip ^ (one.1 == two.1));
                sheet.push(other);
            }
        }
    }
    sheet
}
