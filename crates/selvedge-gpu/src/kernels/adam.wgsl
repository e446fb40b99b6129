// One step of Adam on a clipped gradient, and of the running mean of the weights. Nothing changes
// where the norm is not finite. The rates are the limit of the norm; for both moments the part that
// is kept and the part of the gradient that is taken; the corrected rate, the correction of the
// root, epsilon, and the part of the way to the weights that the mean goes.
struct P {
    count: u32, weights: u32, gradient: u32, first: u32, second: u32, mean: u32, rates: u32, norm: u32,
}

fn element(i: u32) {
    // Of an infinity and of what is no number all bits of the exponent are set. Comparisons may be
    // compiled as if there were neither.
    if (bitcast<u32>(m[p.norm]) & 0x7f800000u) == 0x7f800000u { return; }
    let g = m[p.gradient + i] * m[p.norm + 1u];
    let first = m[p.rates + 1u] * m[p.first + i] + m[p.rates + 2u] * g;
    let second = m[p.rates + 3u] * m[p.second + i] + m[p.rates + 4u] * g * g;
    let step = m[p.rates + 5u] * first / (m[p.rates + 6u] * sqrt(second) + m[p.rates + 7u]);
    let weight = m[p.weights + i] - step;
    m[p.first + i] = first;
    m[p.second + i] = second;
    m[p.weights + i] = weight;
    m[p.mean + i] += m[p.rates + 8u] * (weight - m[p.mean + i]);
}
