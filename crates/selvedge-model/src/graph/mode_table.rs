//! The modes of the cloths of a graph, and what heat leaves of each of them after some times: what
//! a filter over the whole cloth is made of `[eq:mode-filter]`.

use selvedge_cloth::{Cloth, Modes};

/// Times after which a filter looks at the heat `[m²]`, its diffusivity 1: waves as long as the
/// square root of such a time times 2π, or longer, are left of it. Without a unit of time heat
/// spreads by area.
pub(crate) const TIMES: [f64; 6] = [0.0, 0.003, 0.01, 0.03, 0.1, 0.3];

/// Number of times at which a filter looks at the heat.
pub const FILTER_TIMES: usize = TIMES.len();

/// Modes of one or several cloths, the same number of each.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ModeTable {
    /// Modes of each cloth; 0 where none were asked for.
    pub(crate) count: usize,
    /// Modes at the vertices, `[vertices, count]`.
    pub(crate) values: Vec<f32>,
    /// The same times the share of the vertex in the area of its cloth, `[vertices, count]`.
    pub(crate) weighted: Vec<f32>,
    /// Part of each mode that is left at each time, `[cloths, count, times]`.
    pub(crate) decays: Vec<f32>,
}

impl ModeTable {
    /// The `count` longest modes of a cloth; a cloth with fewer vertices has zeros in place of the
    /// others.
    pub(crate) fn of(cloth: &Cloth, count: usize) -> Self {
        if count == 0 {
            return Self::default();
        }
        let modes = Modes::of(cloth, count);
        let found = modes.count();
        let mut table = Self {
            count,
            values: Vec::with_capacity(count * cloth.vertex_count()),
            weighted: Vec::with_capacity(count * cloth.vertex_count()),
            decays: Vec::with_capacity(count * TIMES.len()),
        };
        for (row, share) in modes.values.chunks_exact(found.max(1)).zip(&modes.shares) {
            let padded = (0..count).map(|k| row.get(k).copied().unwrap_or(0.0));
            table
                .values
                .extend(padded.clone().map(|value| value as f32));
            table
                .weighted
                .extend(padded.map(|value| (share * value) as f32));
        }
        for k in 0..count {
            let value = modes.eigenvalues.get(k).copied().unwrap_or(f64::INFINITY);
            // Modes of equal eigenvalues, any turn of which is as good, go all or none.
            let kept = 1.0 - (value / modes.next).min(1.0).powi(2);
            let left = TIMES.map(|time| (kept * (-value * time).exp()) as f32);
            table
                .decays
                .extend(if k < found { left } else { [0.0; TIMES.len()] });
        }
        table
    }

    /// Adds the table of one more cloth.
    ///
    /// # Panics
    /// When the tables have other numbers of modes.
    pub(crate) fn append(&mut self, other: &Self) {
        let is_first = self.values.is_empty();
        assert!(is_first || self.count == other.count, "modes of each cloth");
        self.count = other.count;
        self.values.extend(&other.values);
        self.weighted.extend(&other.weighted);
        self.decays.extend(&other.decays);
    }
}
