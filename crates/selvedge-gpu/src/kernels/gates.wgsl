// One step of a layer of gated recurrent units, products and gates together: tiles of 32 rows and
// 32 hidden units. n = tanh(input + r (recurrent)), after = (1 - z) n + z before; `before` is zero
// where it is NONE. `kept` takes r, z, n and the recurrent part of n, [rows, 4 hidden].
struct P {
    rows: u32, hidden: u32, width: u32,
    input: u32, before: u32, after: u32, kept: u32,
    weight_ih: u32, weight_hh: u32, bias_ih: u32, bias_hh: u32,
}

var<workgroup> a_tile: array<array<vec2<f32>, 17>, 16>;
var<workgroup> b_tile: array<array<array<vec2<f32>, 17>, 16>, 3>;

fn weight(first: u32, ld: u32, gate: u32, unit: u32, k: u32) -> f32 {
    if unit >= p.hidden || k >= ld { return 0.0; }
    return m[first + (gate * p.hidden + unit) * ld + k];
}

fn at(first: u32, ld: u32, row: u32, k: u32) -> f32 {
    if row >= p.rows || k >= ld { return 0.0; }
    return m[first + row * ld + k];
}

// e^(-x) overflows to infinity where x is very negative, and the quotient is 0 then.
fn sigmoid(x: f32) -> f32 { return 1.0 / (1.0 + exp(-x)); }
fn tanh_of(x: f32) -> f32 { return 1.0 - 2.0 / (1.0 + exp(2.0 * x)); }

fn put(row: u32, unit: u32, r_sum: f32, z_sum: f32, n_input: f32, n_state: f32) {
    if row >= p.rows || unit >= p.hidden { return; }
    let of_z = p.hidden + unit;
    let of_n = 2u * p.hidden + unit;
    let r = sigmoid(r_sum + m[p.bias_ih + unit] + m[p.bias_hh + unit]);
    let z = sigmoid(z_sum + m[p.bias_ih + of_z] + m[p.bias_hh + of_z]);
    let recurrent = n_state + m[p.bias_hh + of_n];
    let n = tanh_of(n_input + m[p.bias_ih + of_n] + r * recurrent);
    var old = 0.0;
    if p.before != NONE { old = m[p.before + row * p.hidden + unit]; }
    m[p.after + row * p.hidden + unit] = (1.0 - z) * n + z * old;
    if p.kept != NONE {
        let first = p.kept + row * 4u * p.hidden + unit;
        m[first] = r;
        m[first + p.hidden] = z;
        m[first + 2u * p.hidden] = n;
        m[first + 3u * p.hidden] = recurrent;
    }
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let low = lane % 16u;
    let high = lane / 16u;
    let row0 = group.y * 32u;
    let unit0 = group.x * 32u;
    // Sums of the rows 0 and 1 of a thread.
    var r: array<vec2<f32>, 2>;
    var z: array<vec2<f32>, 2>;
    var n: array<vec2<f32>, 2>;
    var n_input: array<vec2<f32>, 2>;
    for (var part = 0u; part < 2u; part++) {
        let is_state = part == 1u;
        let first = select(p.input, p.before, is_state);
        let weights = select(p.weight_ih, p.weight_hh, is_state);
        let depth = select(p.width, p.hidden, is_state);
        if is_state {
            n_input = n;
            n = array<vec2<f32>, 2>();
            if p.before == NONE { break; }
        }
        for (var k0 = 0u; k0 < depth; k0 += 16u) {
            let k = k0 + low;
            let row = row0 + 2u * high;
            let unit = unit0 + 2u * high;
            a_tile[low][high] = vec2(at(first, depth, row, k), at(first, depth, row + 1u, k));
            for (var gate = 0u; gate < 3u; gate++) {
                b_tile[gate][low][high] = vec2(
                    weight(weights, depth, gate, unit, k),
                    weight(weights, depth, gate, unit + 1u, k),
                );
            }
            workgroupBarrier();
            for (var i = 0u; i < 16u; i++) {
                let a = a_tile[i][high];
                let b_r = b_tile[0][i][low];
                let b_z = b_tile[1][i][low];
                let b_n = b_tile[2][i][low];
                r[0] = fma(vec2(a.x), b_r, r[0]);
                r[1] = fma(vec2(a.y), b_r, r[1]);
                z[0] = fma(vec2(a.x), b_z, z[0]);
                z[1] = fma(vec2(a.y), b_z, z[1]);
                n[0] = fma(vec2(a.x), b_n, n[0]);
                n[1] = fma(vec2(a.y), b_n, n[1]);
            }
            workgroupBarrier();
        }
    }
    let row = row0 + 2u * high;
    let unit = unit0 + 2u * low;
    put(row, unit, r[0].x, z[0].x, n_input[0].x, n[0].x);
    put(row, unit + 1u, r[0].y, z[0].y, n_input[0].y, n[0].y);
    put(row + 1u, unit, r[1].x, z[1].x, n_input[1].x, n[1].x);
    put(row + 1u, unit + 1u, r[1].y, z[1].y, n_input[1].y, n[1].y);
}
