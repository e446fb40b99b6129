//! The passes of the projection, backwards.

use glam::DVec3;

use super::{BAND, EdgeProjection};

/// What a pass began from, and what it asked for.
struct Pass {
    places: Vec<DVec3>,
    shifts: Vec<DVec3>,
    weight: f64,
}

impl EdgeProjection {
    /// Turns `by`, derivatives by the projected places, into those by the `predicted` ones, and adds
    /// those by the `start` to `by_start`, all `[vertices]`, and those by lengths in the pattern to
    /// `by_lengths`, `[edges]`. Edges that asked for nothing count as
    /// asking for nothing.
    pub(crate) fn pull_back(
        &mut self,
        start: &[DVec3],
        predicted: &[DVec3],
        by: &mut Vec<DVec3>,
        by_start: &mut [DVec3],
        by_lengths: &mut Vec<f64>,
    ) {
        let mut places = predicted.to_vec();
        let mut passes = Vec::new();
        self.project_telling(start, &mut places, |places, shifts, weight| {
            passes.push(Pass {
                places: places.to_vec(),
                shifts: shifts.to_vec(),
                weight,
            });
        });
        let mut by_bands = vec![[0.0; 2]; self.edges.len()];
        // Derivatives by the places before the pass, from passes after it.
        let mut by_before = vec![DVec3::ZERO; by.len()];
        for pass in passes.iter().rev() {
            let mut by_places = by_before;
            by_before = vec![DVec3::ZERO; by.len()];
            let mut by_shifts = vec![DVec3::ZERO; by.len()];
            for (v, by) in by.iter().enumerate() {
                if pass.shifts[v] == DVec3::ZERO {
                    by_places[v] += *by;
                } else {
                    by_places[v] += *by * pass.weight;
                    by_before[v] += *by * (1.0 - pass.weight);
                    by_shifts[v] = *by * (pass.weight * self.factors[v]);
                }
            }
            let bands = self.bands.iter().zip(&mut by_bands);
            for (edge, ([least, greatest], by_bands)) in self.edges.iter().zip(bands) {
                let [a, b] = edge.ends;
                let way = pass.places[b] - pass.places[a];
                let squared = way.length_squared();
                let limit = squared.clamp(*least, *greatest);
                if limit == squared || squared == 0.0 {
                    continue;
                }
                let by_excess = by_shifts[a] * edge.parts[0] - by_shifts[b] * edge.parts[1];
                let (sum, along) = (squared + limit, by_excess.dot(way));
                let by_square = 2.0 * limit / (sum * sum) * along;
                let by_way = by_excess * ((squared - limit) / sum) + way * (2.0 * by_square);
                by_places[a] -= by_way;
                by_places[b] += by_way;
                by_bands[usize::from(limit == *greatest)] -= 2.0 * squared / (sum * sum) * along;
            }
            *by = by_places;
        }
        for (by, before) in by.iter_mut().zip(by_before) {
            *by += before;
        }
        for (edge, by_bands) in self.edges.iter().zip(by_bands) {
            let [a, b] = edge.ends;
            let way = start[b] - start[a];
            let length = way.length();
            let band = BAND * edge.length;
            let [least, greatest] = [-band, band].map(|side| (length + side).max(0.0));
            let by_length = 2.0 * (least * by_bands[0] + greatest * by_bands[1]);
            by_lengths.resize(by_lengths.len().max(edge.number + 1), 0.0);
            by_lengths[edge.number] += 2.0 * BAND * (greatest * by_bands[1] - least * by_bands[0]);
            if by_length != 0.0 {
                let by_way = way * (by_length / length);
                by_start[a] -= by_way;
                by_start[b] += by_way;
            }
        }
    }
}
