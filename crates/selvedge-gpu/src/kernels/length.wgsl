// Norm of the gradient from the sums of squares of its pieces, and the factor that clips it to the
// limit, which is the first of the rates.
struct P { count: u32, squares: u32, rates: u32, out: u32 }

@compute @workgroup_size(64)
fn main(@builtin(local_invocation_index) lane: u32) {
    var sum = 0.0;
    for (var i = lane; i < p.count; i += 64u) { sum += m[p.squares + i]; }
    let norm = sqrt(total(sum, lane));
    let limit = m[p.rates];
    if lane == 0u {
        m[p.out] = norm;
        m[p.out + 1u] = select(1.0, limit / norm, norm > limit);
    }
}
