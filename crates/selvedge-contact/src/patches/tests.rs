//! Patches against brute force: what is left out stays apart, and what could meet is not left out.

use glam::{DVec2, DVec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::Topology;

use super::layout::Layout;
use crate::candidates::{Candidates, Reach, Ways};
use crate::closest::gap;
use crate::collision_mesh::CollisionMesh;
use crate::pair::Pair;

/// A sheet of squares, each of two triangles, as it lies in its pattern.
struct Sheet {
    faces: Vec<[u32; 3]>,
    points: Vec<DVec2>,
}

impl Sheet {
    /// Squares of 1 m where `is_there`, of `columns` by `rows`.
    fn new(columns: u32, rows: u32, is_there: impl Fn(u32, u32) -> bool) -> Self {
        let at = |i: u32, j: u32| j * (columns + 1) + i;
        let mut faces = Vec::new();
        for (i, j) in (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))) {
            if is_there(i, j) {
                let [a, b] = [at(i, j), at(i + 1, j)];
                let [c, d] = [at(i, j + 1), at(i + 1, j + 1)];
                faces.extend([[a, b, c], [b, d, c]]);
            }
        }
        let places = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j)));
        let points = places.map(|(i, j)| DVec2::new(f64::from(i), f64::from(j)));
        let all: Vec<DVec2> = points.collect();
        // Only points that a face has.
        let mut numbers = vec![u32::MAX; all.len()];
        let mut points = Vec::new();
        for p in faces.iter_mut().flatten() {
            let number = &mut numbers[*p as usize];
            if *number == u32::MAX {
                *number = points.len() as u32;
                points.push(all[*p as usize]);
            }
            *p = *number;
        }
        Self { faces, points }
    }

    fn corners(&self) -> Vec<[DVec2; 3]> {
        let place = |p: u32| self.points[p as usize];
        self.faces.iter().map(|face| face.map(place)).collect()
    }

    fn mesh(&self) -> CollisionMesh {
        CollisionMesh::new(&Topology::new(self.points.len(), &self.faces).unwrap(), &[])
    }

    /// Its mesh and candidates with patches, without pairs yet.
    fn candidates(&self) -> (CollisionMesh, Candidates) {
        let mesh = self.mesh();
        let plain = Candidates::new(&mesh, &self.laid(flat), true);
        let with = plain.with_pattern(&mesh, &self.corners());
        (mesh, with)
    }

    /// The points where `place` has them.
    fn laid(&self, place: impl Fn(DVec2) -> DVec3) -> Vec<DVec3> {
        self.points.iter().map(|p| place(*p)).collect()
    }
}

fn flat(p: DVec2) -> DVec3 {
    DVec3::new(p.x, p.y, 0.0)
}

/// A roll of this radius around the second axis.
fn rolled(radius: f64) -> impl Fn(DVec2) -> DVec3 {
    move |p| {
        let (sine, cosine) = (p.x / radius).sin_cos();
        DVec3::new(radius * sine, p.y, radius * (1.0 - cosine))
    }
}

/// Pairs of a search with patches, and of one without.
fn found(sheet: &Sheet, ways: Ways<'_>, reach: Reach) -> [Vec<Pair>; 2] {
    let mesh = sheet.mesh();
    let start = sheet.laid(flat);
    let plain = Candidates::new(&mesh, &start, true);
    let with = plain.clone().with_pattern(&mesh, &sheet.corners());
    [with, plain].map(|mut candidates| {
        candidates.find(&mesh, ways, reach);
        let mut pairs = candidates.pairs().to_vec();
        pairs.sort_unstable();
        pairs
    })
}

#[test]
fn what_is_left_out_stays_apart_on_the_whole_way() {
    let sheet = Sheet::new(12, 12, |_, _| true);
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let reach = Reach {
        gap: 0.08,
        slack: 0.1,
        own_slack: 0.1,
    };
    let (mut left_out, mut searched, mut nearest) = (0, 0, f64::INFINITY);
    for _ in 0..60 {
        let mut number = |most: f64| rng.random_range(-most..most);
        // Waves of all kinds, some of which fold the sheet over, and noise.
        let size = 1.5 * number(1.0);
        let shape: [f64; 6] = std::array::from_fn(|_| number(1.0));
        let wave = |p: DVec2, t: f64| {
            let phase = shape[0] * p.x + shape[1] * p.y + 3.0 * shape[2] + t;
            let lift = DVec3::new(0.6 * shape[4], 0.6 * shape[5], 1.0);
            flat(p) + lift * size * phase.sin() + DVec3::X * shape[3] * t
        };
        let from = sheet.laid(|p| wave(p, 0.0));
        let noise: Vec<DVec3> = from
            .iter()
            .map(|_| DVec3::from_array([0; 3].map(|_| number(0.08))))
            .collect();
        let to: Vec<DVec3> = sheet.laid(|p| wave(p, 0.4));
        let to: Vec<DVec3> = to.iter().zip(noise).map(|(p, n)| *p + n).collect();
        let ways = Ways {
            from: &from,
            to: &to,
            later: &to,
        };
        let [with, without] = found(&sheet, ways, reach);
        searched += with.len();
        for pair in &without {
            if with.binary_search(pair).is_ok() {
                continue;
            }
            left_out += 1;
            let (a, b) = (pair.places(&from), pair.places(&to));
            for k in 0..=10 {
                let corners = std::array::from_fn(|c| a[c].lerp(b[c], f64::from(k) / 10.0));
                nearest = nearest.min(gap(pair.kind, corners).distance);
            }
        }
        assert!(with.iter().all(|pair| without.binary_search(pair).is_ok()));
    }
    assert!(nearest > reach.gap, "{nearest}");
    // Both happen often.
    assert!(
        left_out > 10_000 && searched > 10_000,
        "{left_out} {searched}"
    );
}

#[test]
fn a_patch_that_folds_is_searched_again() {
    let sheet = Sheet::new(10, 10, |_, _| true);
    let (mesh, mut candidates) = sheet.candidates();
    let [start, bent] = [sheet.laid(flat), sheet.laid(rolled(30.0))];
    let folded = sheet.laid(rolled(1.0));
    let reach = Reach {
        gap: 0.01,
        slack: 20.0,
        own_slack: 20.0,
    };
    candidates.find(&mesh, Ways::still(&start), reach);
    assert!(candidates.cover(&start, &bent));
    // The points are within their boxes, and the patches are not smooth.
    assert!(!candidates.cover(&start, &folded));
    let undone = sheet.laid(|p| -flat(p));
    assert!(!candidates.cover(&start, &undone));
    let mut lost = start.clone();
    lost[7] = DVec3::splat(f64::NAN);
    assert!(!candidates.cover(&start, &lost));
    candidates.clear();
    assert!(!candidates.cover(&start, &start));
}

#[test]
fn a_wider_search_takes_up_patches_that_fold() {
    let sheet = Sheet::new(10, 10, |_, _| true);
    let (start, folded) = (sheet.laid(flat), sheet.laid(rolled(1.0)));
    let reach = Reach {
        gap: 0.01,
        slack: 20.0,
        own_slack: 20.0,
    };
    let [smooth, every] = found(&sheet, Ways::still(&start), reach);
    assert!(smooth.len() + 1000 < every.len());
    let (mesh, mut candidates) = sheet.candidates();
    candidates.find(&mesh, Ways::still(&start), reach);
    // All within their boxes: what is new is what was left out.
    candidates.widen(&mesh, Ways::still(&folded), reach);
    assert!(candidates.cover(&start, &folded));
    let mut pairs = candidates.pairs().to_vec();
    pairs.sort_unstable();
    assert_eq!(pairs, every);
}

/// Numbers of the groups that have something close, with the faces of each group.
fn usable(sheet: &Sheet) -> Vec<(Vec<u32>, bool)> {
    let (_, candidates) = sheet.candidates();
    let patches = candidates.patches().unwrap();
    let groups = patches.groups.iter();
    groups
        .map(|group| (group.faces.clone(), !group.close.is_empty()))
        .collect()
}

#[test]
fn every_face_has_a_group_and_a_whole_sheet_has_no_corner_in_the_way() {
    let sheet = Sheet::new(9, 7, |_, _| true);
    let groups = usable(&sheet);
    let mut faces: Vec<u32> = groups.iter().flat_map(|(faces, _)| faces.clone()).collect();
    faces.sort_unstable();
    assert_eq!(faces, (0..126).collect::<Vec<_>>());
    assert!(
        groups
            .iter()
            .all(|(faces, usable)| *usable && faces.len() <= 16)
    );
}

#[test]
fn a_hole_and_a_notch_leave_no_patch_around_their_corners() {
    // Across the hole the cloth may meet itself whatever its gradients are.
    let sheet = Sheet::new(16, 16, |i, j| !((7..9).contains(&i) && (7..9).contains(&j)));
    let middle = DVec2::splat(8.0);
    let (mut near, mut far) = (0, 0);
    for (faces, usable) in usable(&sheet) {
        let corners = faces.iter().flat_map(|f| sheet.faces[*f as usize]);
        let distance = corners.map(|p| (sheet.points[p as usize] - middle).abs().max_element());
        let distance = distance.fold(f64::INFINITY, f64::min);
        match distance {
            d if d <= 2.0 => {
                assert!(!usable, "{distance}");
                near += 1;
            }
            d if d >= 6.0 => {
                assert!(usable, "{distance}");
                far += 1;
            }
            _ => {}
        }
    }
    assert!(near > 3 && far > 3, "{near} {far}");
}

#[test]
fn seams_flipped_faces_and_branches_are_boundaries() {
    let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
    let faces = [[0, 1, 2], [0, 2, 3]];
    let corners = |third: DVec2, shift: DVec2| {
        [
            [square[0], square[1], square[2]],
            [square[0] + shift, square[2] + shift, third],
        ]
    };
    let joined = |third: DVec2, shift: DVec2| {
        let corners = corners(third, shift);
        let groups = Layout::new(&faces, &corners).groups(vec![vec![0, 1]]);
        !groups[0].close.is_empty()
    };
    assert!(joined(square[3], DVec2::ZERO));
    assert!(!joined(square[3], DVec2::new(1e-9, 0.0)));
    assert!(!joined(DVec2::new(2.0, 0.5), DVec2::ZERO));
    // Two turns around a vertex.
    let mut fan = Vec::new();
    let mut points = Vec::new();
    let at = |k: u32| [DVec2::X, DVec2::Y, DVec2::NEG_X, DVec2::NEG_Y][k as usize % 4];
    for k in 0..8 {
        fan.push([8, k, (k + 1) % 8]);
        points.push([DVec2::ZERO, at(k), at(k + 1)]);
    }
    let groups = Layout::new(&fan, &points).groups(vec![(0..8).collect()]);
    assert!(groups[0].close.is_empty());
    // One of them.
    for face in fan.iter_mut().flatten() {
        *face = if *face == 8 { 4 } else { *face % 4 };
    }
    let groups = Layout::new(&fan[..4], &points[..4]).groups(vec![(0..4).collect()]);
    assert_eq!(groups[0].close, [0]);
    let half = std::f64::consts::FRAC_1_SQRT_2;
    assert!((groups[0].clearance - half).abs() < 1e-12);
}
