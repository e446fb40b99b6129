//! Closed forms of the metrics: displacements, scalings and speeds whose measures are known.

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, Topology};
use selvedge_data::Frames;
use selvedge_data::metrics::{
    compare, edge_length_rmse, final_speed, largest_strain, mean_edge_length, mean_vertex_error,
    per_frame_rmse, position_rmse, speeds,
};

use crate::help::{says, sheet};

/// A unit square of two triangles; four edges of length 1 and a diagonal.
fn square() -> (Topology, Vec<Vec3>, Vec<Vec2>) {
    let topology = Topology::new(4, &[[0, 1, 2], [0, 2, 3]]).unwrap();
    let coordinates = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let positions = coordinates.map(|(x, y)| Vec3::new(x, y, 0.0)).to_vec();
    (topology, positions, coordinates.map(Vec2::from).to_vec())
}

fn repeated(positions: &[Vec3], frames: usize, shift: impl Fn(usize) -> Vec3) -> Vec<Vec3> {
    (0..frames)
        .flat_map(|f| positions.iter().map(move |&p| (f, p)))
        .map(|(f, p)| p + shift(f))
        .collect()
}

fn frames(run: &[Vec3]) -> Frames<'_> {
    Frames::new(run, 4).unwrap()
}

/// Sums of numbers that are exact in binary: only the division and the root round.
const ROUNDING: f64 = 1e-15;

/// A square of this pattern.
fn cloth(coordinates: &[Vec2]) -> Cloth {
    let rest: Vec<Vec3> = coordinates.iter().map(|c| c.extend(0.0)).collect();
    sheet(&rest, coordinates, &[[0, 1, 2], [0, 2, 3]], &[])
}

#[test]
fn a_shift_of_3_4_5_is_5_everywhere_and_leaves_edges_alone() {
    let (topology, positions, _) = square();
    let a = repeated(&positions, 3, |_| Vec3::ZERO);
    let b = repeated(&positions, 3, |_| Vec3::new(3.0, 0.0, 4.0));
    let measures = compare(frames(&a), frames(&b), &topology).unwrap();
    assert_eq!((measures.frames, measures.frame_counts), (3, [3, 3]));
    let means = [measures.position_rmse, measures.mean_vertex_error];
    assert_eq!((means, measures.position_max), ([5.0; 2], 5.0));
    assert_eq!(measures.per_frame_rmse, [5.0; 3]);
    assert_eq!(measures.edge_length_rmse, 0.0);
}

#[test]
fn one_displaced_vertex_of_four_counts_a_quarter_of_its_square() {
    let (_, positions, _) = square();
    let a = repeated(&positions, 2, |_| Vec3::ZERO);
    let mut b = a.clone();
    b[6].z += 2.0; // Frame 1, vertex 2.
    let [a, b] = [&a, &b].map(|run| frames(run));
    // 4 m² over 8 vertices; over the 4 of its frame.
    assert!((position_rmse(a, b).unwrap() - 0.5_f64.sqrt()).abs() < ROUNDING);
    assert_eq!(per_frame_rmse(a, b).unwrap(), [0.0, 1.0]);
    assert_eq!(mean_vertex_error(a, b).unwrap(), 0.25);
}

#[test]
fn scaling_by_s_changes_every_edge_by_its_share() {
    let (topology, positions, coordinates) = square();
    let doubled: Vec<Vec3> = positions.iter().map(|p| 2.0 * *p).collect();
    let [a, b] = [&positions, &doubled].map(|run| frames(run));
    // l̂ - l = l: the RMS of the lengths 1, 1, 1, 1, √2.
    let expected = ((4.0 + 2.0) / 5.0_f64).sqrt();
    assert!((edge_length_rmse(a, b, &topology).unwrap() - expected).abs() < ROUNDING);
    let mean = (4.0 + 2.0_f64.sqrt()) / 5.0;
    assert!((mean_edge_length(a, &topology).unwrap() - mean).abs() < ROUNDING);
    let rest = cloth(&coordinates).pattern().edge_lengths();
    assert_eq!(largest_strain(a, &topology, &rest).unwrap(), [0.0]);
    assert_eq!(largest_strain(b, &topology, &rest).unwrap(), [1.0]);
}

#[test]
fn speeds_of_a_cloth_that_moves_and_then_rests() {
    let (_, positions, _) = square();
    // 0.5 m per frame for 4 frames at 2 frames per second: 1 m/s; then 4 frames of rest.
    let run = repeated(&positions, 9, |f| Vec3::X * 0.5 * f.min(4) as f32);
    let frames = frames(&run);
    let all = speeds(frames, 2.0).unwrap();
    assert_eq!((all.mean, all.max), (0.5, 1.0));
    assert_eq!(final_speed(frames, 2.0).unwrap(), 0.0);
    assert_eq!(final_speed(frames.first(5), 2.0).unwrap(), 1.0);
    assert_eq!(speeds(frames.first(1), 2.0).unwrap().max, 0.0);
}

#[test]
fn runs_of_different_length_are_compared_over_the_shorter() {
    let (topology, positions, _) = square();
    let a = repeated(&positions, 3, |_| Vec3::ZERO);
    let b = repeated(&positions, 5, |f| Vec3::X * f.saturating_sub(2) as f32);
    let [a, b] = [&a, &b].map(|run| frames(run));
    let measures = compare(a, b, &topology).unwrap();
    assert_eq!((measures.frames, measures.position_rmse), (3, 0.0));
    assert_eq!(measures.frame_counts, [3, 5]);
}

#[test]
fn a_position_that_is_not_finite_is_never_left_out() {
    let (topology, positions, coordinates) = square();
    let mut broken = positions.clone();
    broken[1].y = f32::NAN;
    let [a, b] = [&positions, &broken].map(|run| frames(run));
    let measures = compare(a, b, &topology).unwrap();
    assert!(measures.position_rmse.is_nan() && measures.position_max.is_nan());
    let rest = cloth(&coordinates).pattern().edge_lengths();
    assert!(largest_strain(b, &topology, &rest).unwrap()[0].is_nan());
}

#[test]
fn what_does_not_fit_is_an_error() {
    let (topology, positions, _) = square();
    let four = Frames::new(&positions, 4).unwrap();
    let two = Frames::new(&positions, 2).unwrap();
    assert!(Frames::new(&positions, 3).is_err());
    assert!(Frames::new(&positions, 0).is_err());
    let different = compare(four, two, &topology).unwrap_err();
    says(different, &["different meshes: 4 and 2 vertices"]);
    let none = compare(four, four.first(0), &topology).unwrap_err();
    says(none, &["no frame to measure"]);
    let short = largest_strain(four, &topology, &[1.0]).unwrap_err();
    says(short, &["rest lengths for 1 edges, the mesh has 5"]);
}
