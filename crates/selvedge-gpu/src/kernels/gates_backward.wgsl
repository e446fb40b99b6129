// One step of a gated recurrent unit backward. `state` holds the gradient of the state after, and
// then the part of the gradient of the state before that does not pass through the gates. `out`
// takes the gradients of r, z, the input part of n and its recurrent part, [rows, 4 width].
struct P { count: u32, width: u32, kept: u32, before: u32, state: u32, out: u32 }

fn element(i: u32) {
    let first = i / p.width * 4u * p.width + i % p.width;
    let r = m[p.kept + first];
    let z = m[p.kept + first + p.width];
    let n = m[p.kept + first + 2u * p.width];
    let recurrent = m[p.kept + first + 3u * p.width];
    let g = m[p.state + i];
    var before = 0.0;
    if p.before != NONE { before = m[p.before + i]; }
    let by_n = g * (1.0 - z) * (1.0 - n * n);
    m[p.out + first] = by_n * recurrent * r * (1.0 - r);
    m[p.out + first + p.width] = g * (before - n) * z * (1.0 - z);
    m[p.out + first + 2u * p.width] = by_n;
    m[p.out + first + 3u * p.width] = by_n * r;
    m[p.state + i] = g * z;
}
