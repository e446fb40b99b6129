//! A tube of cloth: a rectangle whose sides are sewn together.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use glam::{DVec2, DVec3};

use super::boundary::spacing;
use super::outline::{sheet_from_outline, too_few};
use super::{Cut, Sheet, SheetSpec};
use crate::Mesh;
use crate::error::SceneError;
use crate::geometry::sin_cos;

/// Fewest segments around: with three or four, faces could lie on one another.
const FEWEST_AROUND: usize = 6;

/// The tube of `spec`, `width` `[m]` around.
pub(super) fn tube(spec: &SheetSpec, width: f64) -> Result<Sheet, SceneError> {
    let height = spec.size;
    let (around, sides) = segments(spec, width)?;
    // Every point of the boundary is a corner, so that the two sides are alike. The flat rectangle
    // has its right one in addition.
    let at = |k: usize, segments: usize| k as f64 / segments as f64;
    let top = (0..around).map(|k| DVec2::new(width * at(k, around), height));
    let right = (0..sides).map(|k| DVec2::new(width, height * at(sides - k, sides)));
    let bottom = (0..around).map(|k| DVec2::new(width * at(around - k, around), 0.0));
    let left_side = (0..sides).map(|k| DVec2::new(0.0, height * at(k, sides)));
    let outline: Vec<DVec2> = top.chain(right).chain(bottom).chain(left_side).collect();
    let cut = Cut::of(outline, DVec2::ZERO, Vec::new());
    let flat = sheet_from_outline(&cut, spec.vertices + sides + 1, spec.seed)?;
    let (left, upper) = (0, around);
    let (lower, lower_left) = (around + sides, 2 * around + sides);
    // The boundary runs along the top, down the right side, along the bottom and up the left one.
    let sewn = |v: usize| match v {
        v if v < upper => v,
        v if v == upper => left,
        // The left side ends where the boundary began.
        v if v <= lower => lower_left + (lower - v),
        v => v,
    };
    let number = |v: u32| {
        let v = sewn(v as usize);
        // Those of the right side are gone.
        (if v > lower { v - (sides + 1) } else { v }) as u32
    };
    let coordinates = &flat.points;
    let faces: Vec<[u32; 3]> = flat.faces.iter().map(|face| face.map(number)).collect();
    let material = |face: &[u32; 3]| face.map(|v| coordinates[v as usize]);
    let material: Vec<[DVec2; 3]> = flat.faces.iter().map(material).collect();
    let radius = width / TAU;
    let kept = coordinates.iter().enumerate();
    let kept = kept.filter(|(v, _)| !(upper..=lower).contains(v));
    let rolled = kept.map(|(_, c)| {
        let (sine, cosine) = sin_cos(c.x / radius);
        DVec3::new(radius * sine, c.y - height, radius * cosine)
    });
    let positions: Vec<DVec3> = rolled.collect();
    let ring = |from: usize, to: usize| (from..to).map(|v| number(v as u32)).collect::<Vec<_>>();
    let (top, bottom) = (ring(left, upper), ring(lower + 1, lower_left + 1));
    let labels = BTreeMap::from([
        ("boundary".to_owned(), [&top[..], &bottom].concat()),
        ("upper-edge".to_owned(), top),
        ("lower-edge".to_owned(), bottom),
    ]);
    Ok(Sheet {
        mesh: Mesh::sewn(&faces, &material, positions)?,
        labels,
    })
}

/// Segments around a tube, and along its side.
fn segments(spec: &SheetSpec, width: f64) -> Result<(usize, usize), SceneError> {
    let height = spec.size;
    // The boundary of the tube is its two rings.
    let mut spacing = spacing(width * height, width, spec.vertices.max(1));
    loop {
        let segments = |length: f64| (length / spacing).round().max(1.0) as usize;
        let (around, sides) = (segments(width).max(FEWEST_AROUND), segments(height));
        let needed = 2 * around + sides - 1;
        if needed <= spec.vertices {
            return Ok((around, sides));
        }
        if (around, sides) == (FEWEST_AROUND, 1) {
            return Err(too_few(spec.vertices, needed));
        }
        spacing *= 1.05;
    }
}
