//! Products against plain sums, in shapes with whole and partial vectors, panels and tiles.

use super::*;
use crate::kernels::outer::{Sums, add_outer};

fn numbers(count: usize, seed: u64) -> Vec<f64> {
    (0..count as u64)
        .map(|k| ((k * 7919 + seed * 104_729) % 1009) as f64 / 1009.0 - 0.5)
        .collect()
}

/// Rows, columns and depth. Miri takes a hundred times as long and has the small ones: whole and
/// partial tiles of rows, panels and vectors are among them too.
const SHAPES: &[(usize, usize, usize)] = if cfg!(miri) {
    &[(1, 1, 1), (5, 3, 4), (9, 21, 2), (7, 70, 3)]
} else {
    &[
        (1, 1, 1),
        (5, 3, 4),
        (17, 33, 9),
        (30, 64, 65),
        (13, 48, 16),
        (96, 128, 10),
        (7, 100, 3),
    ]
};

fn packed<T: Real>(using: Instructions, matrix: &[T], columns: usize) -> Vec<T> {
    let slot = Slot {
        offset: 0,
        depth: matrix.len() / columns,
        columns,
    };
    let mut out = vec![T::from_f64(f64::NAN); slot.length()];
    let entry = |l: usize, j: usize| matrix[l * columns + j];
    pack(using, slot, entry, &mut out);
    out
}

#[test]
fn products_are_the_sums_they_stand_for_however_they_end() {
    for using in [Instructions::Detected, Instructions::Plain] {
        for &(rows, columns, depth) in SHAPES {
            let (a, b) = (numbers(rows * depth, 1), numbers(rows * (depth + 2), 2));
            let [p, q] = [3, 4].map(|seed| numbers(depth * columns, seed));
            let (packed_p, packed_q) = (packed(using, &p, columns), packed(using, &q, columns));
            let terms = [
                Term {
                    rows: Columns::all(&a, depth),
                    packed: &packed_p,
                },
                Term {
                    rows: Columns::all(&b, depth + 2).part(1, depth),
                    packed: &packed_q,
                },
            ];
            let sum = |i: usize, j: usize| {
                let of = |l| {
                    a[i * depth + l] * p[l * columns + j]
                        + b[i * (depth + 2) + 1 + l] * q[l * columns + j]
                };
                (0..depth).map(of).sum::<f64>()
            };
            let before = numbers(rows * columns, 5);
            let bias = numbers(columns, 6);
            let at = numbers(9 * 2 * columns, 7);
            let senders: Vec<u32> = (0..rows as u32).map(|i| i * 5 % 9).collect();
            let receivers: Vec<u32> = (0..rows as u32).map(|i| i * 4 % 9).collect();
            let ends = Epilogue::EndpointsRelu {
                products: &at,
                senders: &senders,
                receivers: &receivers,
            };
            let gathered = |i: usize, j: usize| {
                let (s, r) = (senders[i] as usize, receivers[i] as usize);
                at[s * 2 * columns + j] + at[r * 2 * columns + columns + j]
            };
            type Expected<'a> = &'a dyn Fn(usize, usize) -> f64;
            let half = |j: usize| (j >= columns / 2).then(|| bias[j - columns / 2]);
            let cases: [(Epilogue<'_, f64>, Expected<'_>); 7] = [
                (Epilogue::Set, &sum),
                (Epilogue::Add, &|i, j| before[i * columns + j] + sum(i, j)),
                (Epilogue::Bias(&bias), &|i, j| sum(i, j) + bias[j]),
                (Epilogue::BiasRelu(&bias), &|i, j| {
                    (sum(i, j) + bias[j]).max(0.0)
                }),
                (Epilogue::SecondHalfBias(&bias), &|i, j| {
                    sum(i, j) + half(j).unwrap_or(0.0)
                }),
                (ends, &|i, j| (sum(i, j) + gathered(i, j)).max(0.0)),
                (Epilogue::Mask(&before), &|i, j| {
                    if before[i * columns + j] > 0.0 { sum(i, j) } else { 0.0 }
                }),
            ];
            for (number, (epilogue, expected)) in cases.into_iter().enumerate() {
                if number == 4 && columns % 2 == 1 {
                    continue;
                }
                let mut out = before.clone();
                multiply(using, &terms, columns, epilogue, &mut out);
                for (k, found) in out.iter().enumerate() {
                    let expected = expected(k / columns, k % columns);
                    // Up to 130 products below 1/4, each rounded: far below 1e-12.
                    assert!(
                        (found - expected).abs() < 1e-12,
                        "{using:?} {rows}x{columns}x{depth}, case {number}, {k}: {found} {expected}"
                    );
                }
            }
        }
    }
}

#[test]
fn a_row_does_not_depend_on_the_rows_beside_it() {
    // See [`SHAPES`].
    let (count, depth, columns) = if cfg!(miri) { (9, 5, 70) } else { (29, 33, 70) };
    let using = Instructions::Detected;
    let narrow = |values: Vec<f64>| values.into_iter().map(|x| x as f32).collect::<Vec<_>>();
    let rows = narrow(numbers(count * depth, 1));
    let matrix = narrow(numbers(depth * columns, 2));
    let packed = packed(using, &matrix, columns);
    let times = |rows: &[f32]| {
        let mut out = vec![0.0; rows.len() / depth * columns];
        let term = Term {
            rows: Columns::all(rows, depth),
            packed: &packed,
        };
        multiply(using, &[term], columns, Epilogue::Set, &mut out);
        out
    };
    let together = times(&rows);
    for from in 0..count {
        let alone = times(&rows[from * depth..]);
        assert_eq!(alone, together[from * columns..], "rows from {from} on");
    }
}

#[test]
fn outer_products_add_the_sums_they_stand_for() {
    for using in [Instructions::Detected, Instructions::Plain] {
        for &(rows, left, right) in SHAPES {
            let (a, b) = (
                numbers(rows * (left + 3), 1),
                numbers(rows * (right + 1), 2),
            );
            let before = numbers(left * (right + 2), 3);
            let mut to = before.clone();
            let sums = Sums {
                rows: &mut to,
                stride: right + 2,
                first: 1,
            };
            let columns = [
                Columns::all(&a, left + 3).part(2, left),
                Columns::all(&b, right + 1).part(1, right),
            ];
            add_outer(using, sums, columns[0], columns[1]);
            for i in 0..left {
                for j in 0..right + 2 {
                    let mut expected = before[i * (right + 2) + j];
                    if (1..=right).contains(&j) {
                        expected += (0..rows)
                            .map(|r| a[r * (left + 3) + 2 + i] * b[r * (right + 1) + j])
                            .sum::<f64>();
                    }
                    let found = to[i * (right + 2) + j];
                    // As above.
                    assert!((found - expected).abs() < 1e-12, "{rows}x{left}x{right}");
                }
            }
        }
    }
}
