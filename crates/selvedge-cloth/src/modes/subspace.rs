//! The smallest eigenvalues of a sparse symmetric matrix and their eigenvectors: iteration of a
//! subspace under a Chebyshev polynomial that damps all larger ones (Zhou and Saad 2007), with the
//! Rayleigh-Ritz procedure after each application. Small matrices are diagonalised as a whole.

use crate::long_work::Underway;

/// Largest residual of an eigenvector, as a part of the largest eigenvalue that is wanted.
const TOLERANCE: f64 = 1e-7;

/// Applications of the polynomial at most: each gains a factor of about seven.
const MOST_ROUNDS: usize = 60;

/// A sparse symmetric matrix.
pub(super) struct Symmetric {
    diagonal: Vec<f64>,
    /// The other entries of each row, with their columns.
    rows: Vec<Vec<(usize, f64)>>,
}

/// Eigenvalues, ascending, and unit eigenvectors.
pub(super) struct Pairs {
    /// `[pairs]`.
    pub(super) values: Vec<f64>,
    /// `[size, pairs]`.
    pub(super) vectors: Vec<f64>,
    /// The eigenvalue after the last one; infinite where there is none.
    pub(super) next: f64,
}

/// A square matrix in one array, row by row.
struct Dense {
    size: usize,
    values: Vec<f64>,
}

impl Symmetric {
    pub(super) fn zeros(size: usize) -> Self {
        Self {
            diagonal: vec![0.0; size],
            rows: vec![Vec::new(); size],
        }
    }

    pub(super) fn add_to_diagonal(&mut self, row: usize, value: f64) {
        self.diagonal[row] += value;
    }

    /// Sets the entry of this row and column, and its mirror image.
    pub(super) fn put(&mut self, place: [usize; 2], value: f64) {
        let [a, b] = place;
        self.rows[a].push((b, value));
        self.rows[b].push((a, value));
    }

    fn size(&self) -> usize {
        self.diagonal.len()
    }

    /// A bound of all eigenvalues: the largest sum of a row (Gershgorin).
    fn bound(&self) -> f64 {
        let sums = self.rows.iter().zip(&self.diagonal).map(|(row, diagonal)| {
            diagonal.abs() + row.iter().map(|(_, value)| value.abs()).sum::<f64>()
        });
        sums.fold(0.0, f64::max)
    }

    /// y ← (A - shift) x for `width` vectors side by side.
    fn apply(&self, shift: f64, width: usize, x: &[f64], y: &mut [f64]) {
        for (number, out) in y.chunks_exact_mut(width).enumerate() {
            let own = &x[number * width..][..width];
            let factor = self.diagonal[number] - shift;
            out.iter_mut().zip(own).for_each(|(y, x)| *y = factor * x);
            for &(column, value) in &self.rows[number] {
                let other = &x[column * width..][..width];
                out.iter_mut().zip(other).for_each(|(y, x)| *y += value * x);
            }
        }
    }

    fn to_dense(&self) -> Dense {
        let size = self.size();
        let mut dense = Dense::zeros(size);
        for (row, entries) in self.rows.iter().enumerate() {
            dense.values[row * size + row] = self.diagonal[row];
            for &(column, value) in entries {
                dense.values[row * size + column] += value;
            }
        }
        dense
    }
}

/// The `count` smallest eigenvalues and their eigenvectors, or all of a smaller matrix.
pub(super) fn lowest(matrix: &Symmetric, count: usize) -> Pairs {
    let size = matrix.size();
    // A few more than wanted, so that the last one wanted converges too.
    let width = (count + 1 + (count / 4).max(8)).min(size);
    if size <= 3 * width {
        return dense_lowest(matrix.to_dense(), count);
    }
    let mut block = Block::start(size, width);
    let underway = Underway::begin("finding the modes of the cloth", MOST_ROUNDS);
    let upper = matrix.bound();
    let mut found = block.rotate(matrix);
    for _ in 0..MOST_ROUNDS {
        let lower = found[width - 1].min(0.9 * upper);
        block.filter(matrix, lower, upper);
        found = block.rotate(matrix);
        // Whoever asks for an end is heard where the work that needs the modes asks.
        if block.converged(matrix, &found, count + 1) || underway.advance().is_break() {
            break;
        }
    }
    let rows = block.vectors.chunks_exact(width);
    Pairs {
        values: found[..count].to_vec(),
        vectors: rows.flat_map(|row| &row[..count]).copied().collect(),
        next: found[count],
    }
}

fn dense_lowest(mut matrix: Dense, count: usize) -> Pairs {
    let size = matrix.size;
    let all = matrix.diagonalise();
    let values: Vec<f64> = all.order.iter().map(|&k| matrix.at(k, k)).collect();
    let count = count.min(size);
    let wanted = &all.order[..count];
    let rows = all.vectors.chunks_exact(size.max(1));
    Pairs {
        vectors: rows
            .flat_map(|row| wanted.iter().map(|&k| row[k]))
            .collect(),
        next: values.get(count).copied().unwrap_or(f64::INFINITY),
        values: values[..count].to_vec(),
    }
}

/// Vectors side by side, `[size, width]`.
struct Block {
    width: usize,
    vectors: Vec<f64>,
    image: Vec<f64>,
    last: Vec<f64>,
}

impl Block {
    /// Numbers without order, the same at each start.
    fn start(size: usize, width: usize) -> Self {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut next = || {
            // splitmix64 (Steele et al. 2014).
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        Self {
            width,
            vectors: (0..size * width).map(|_| next()).collect(),
            image: vec![0.0; size * width],
            last: vec![0.0; size * width],
        }
    }

    /// Applies the polynomial that is small on `lower..upper` and grows below.
    fn filter(&mut self, matrix: &Symmetric, lower: f64, upper: f64) {
        let (half, centre) = (0.5 * (upper - lower), 0.5 * (upper + lower));
        // cosh(6) = 200 at 0.
        let degree = (3.0 * (upper / lower).sqrt()).clamp(8.0, 1000.0) as usize;
        let first = -half / centre;
        let mut sigma = first;
        matrix.apply(centre, self.width, &self.vectors, &mut self.image);
        let scale = sigma / half;
        self.image.iter_mut().for_each(|value| *value *= scale);
        for _ in 1..degree {
            std::mem::swap(&mut self.last, &mut self.vectors);
            std::mem::swap(&mut self.vectors, &mut self.image);
            let next = 1.0 / (2.0 / first - sigma);
            matrix.apply(centre, self.width, &self.vectors, &mut self.image);
            let (now, before) = (2.0 * next / half, sigma * next);
            for (image, last) in self.image.iter_mut().zip(&self.last) {
                *image = now * *image - before * last;
            }
            sigma = next;
        }
        std::mem::swap(&mut self.vectors, &mut self.image);
    }

    /// Rotates the vectors to the approximate eigenvectors in their span, whose eigenvalues it
    /// returns, ascending.
    fn rotate(&mut self, matrix: &Symmetric) -> Vec<f64> {
        let width = self.width;
        for _ in 0..2 {
            // The second time removes what rounding left of the first.
            let factor = self.products(&self.vectors).cholesky();
            self.vectors
                .chunks_exact_mut(width)
                .for_each(|row| factor.solve_row(row));
        }
        matrix.apply(0.0, width, &self.vectors, &mut self.image);
        let mut small = self.products(&self.image);
        let all = small.diagonalise();
        let mut turned = vec![0.0; width];
        for row in self.vectors.chunks_exact_mut(width) {
            for (out, &k) in turned.iter_mut().zip(&all.order) {
                let column = all.vectors.iter().skip(k).step_by(width);
                *out = row.iter().zip(column).map(|(x, q)| x * q).sum();
            }
            row.copy_from_slice(&turned);
        }
        all.order.iter().map(|&k| small.at(k, k)).collect()
    }

    /// Products of each vector with each of `others`, made symmetric.
    fn products(&self, others: &[f64]) -> Dense {
        let width = self.width;
        let mut out = Dense::zeros(width);
        let rows = self.vectors.chunks_exact(width);
        for (x, y) in rows.zip(others.chunks_exact(width)) {
            for (sums, x) in out.values.chunks_exact_mut(width).zip(x) {
                sums.iter_mut().zip(y).for_each(|(sum, y)| *sum += x * y);
            }
        }
        for i in 0..width {
            for j in 0..i {
                let mean = 0.5 * (out.at(i, j) + out.at(j, i));
                out.values[i * width + j] = mean;
                out.values[j * width + i] = mean;
            }
        }
        out
    }

    /// True where the residuals |A x - λ x| of the first `count` vectors are small.
    fn converged(&mut self, matrix: &Symmetric, values: &[f64], count: usize) -> bool {
        let width = self.width;
        matrix.apply(0.0, width, &self.vectors, &mut self.image);
        let mut residuals = vec![0.0; count];
        let rows = self.vectors.chunks_exact(width);
        for (x, y) in rows.zip(self.image.chunks_exact(width)) {
            for (k, residual) in residuals.iter_mut().enumerate() {
                *residual += (y[k] - values[k] * x[k]).powi(2);
            }
        }
        let allowed = TOLERANCE * values[count - 1];
        residuals.iter().all(|residual| residual.sqrt() <= allowed)
    }
}

/// The eigenvectors of a dense matrix.
struct Diagonal {
    /// One in each column, `[size, size]`.
    vectors: Vec<f64>,
    /// Columns by ascending eigenvalue.
    order: Vec<usize>,
}

impl Dense {
    fn zeros(size: usize) -> Self {
        Self {
            size,
            values: vec![0.0; size * size],
        }
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.values[row * self.size + column]
    }

    /// The lower factor L with L Lᵀ the matrix. A pivot that rounding made too small is replaced.
    fn cholesky(&self) -> Self {
        let size = self.size;
        let mut factor = Self::zeros(size);
        for i in 0..size {
            for j in 0..=i {
                let [left, right] = [i, j].map(|row| &factor.values[row * size..][..j]);
                let rest = self.at(i, j) - left.iter().zip(right).map(|(a, b)| a * b).sum::<f64>();
                factor.values[i * size + j] = if i == j {
                    rest.max(1e-14 * self.at(i, i))
                        .max(f64::MIN_POSITIVE)
                        .sqrt()
                } else {
                    rest / factor.at(j, j)
                };
            }
        }
        factor
    }

    /// row ← row L^-ᵀ for this lower factor L.
    fn solve_row(&self, row: &mut [f64]) {
        for i in 0..self.size {
            let before = &self.values[i * self.size..][..i];
            let known: f64 = before.iter().zip(&*row).map(|(l, x)| l * x).sum();
            row[i] = (row[i] - known) / self.at(i, i);
        }
    }

    /// Leaves the eigenvalues on the diagonal, by rotations of pairs of rows and columns (Jacobi's
    /// method, cyclic).
    fn diagonalise(&mut self) -> Diagonal {
        let size = self.size;
        let mut vectors = Self::zeros(size);
        (0..size).for_each(|k| vectors.values[k * size + k] = 1.0);
        let scale = self
            .values
            .iter()
            .fold(0.0, |most: f64, v| most.max(v.abs()));
        for _ in 0..50 {
            let mut largest = 0.0_f64;
            for p in 0..size {
                for q in p + 1..size {
                    largest = largest.max(self.at(p, q).abs());
                    self.annihilate(&mut vectors, p, q);
                }
            }
            if largest <= 1e-15 * scale {
                break;
            }
        }
        let mut order: Vec<usize> = (0..size).collect();
        order.sort_by(|&a, &b| self.at(a, a).total_cmp(&self.at(b, b)));
        Diagonal {
            vectors: vectors.values,
            order,
        }
    }

    /// Turns rows and columns p and q so that their common entry is 0.
    fn annihilate(&mut self, vectors: &mut Self, p: usize, q: usize) {
        let (size, entry) = (self.size, self.at(p, q));
        if entry == 0.0 {
            return;
        }
        let ratio = (self.at(q, q) - self.at(p, p)) / (2.0 * entry);
        let tangent = ratio.signum() / (ratio.abs() + (1.0 + ratio * ratio).sqrt());
        let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
        let sine = tangent * cosine;
        let turn = |a: &mut f64, b: &mut f64| {
            (*a, *b) = (cosine * *a - sine * *b, sine * *a + cosine * *b);
        };
        for matrix in [&mut *self, vectors] {
            for row in matrix.values.chunks_exact_mut(size) {
                let (left, right) = row.split_at_mut(q);
                turn(&mut left[p], &mut right[0]);
            }
        }
        let (above, below) = self.values.split_at_mut(q * size);
        let rows = above[p * size..][..size].iter_mut().zip(&mut below[..size]);
        rows.for_each(|(a, b)| turn(a, b));
    }
}
