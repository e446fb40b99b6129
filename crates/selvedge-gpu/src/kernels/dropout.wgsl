// Dropout with the masks of the processor: a value becomes 0 where the upper half of the hash
// (SplitMix64) of seed + (row steps + step) width + column is below `threshold`. Rows are counted
// within their cloth. Numbers of 64 bits are pairs of halves, the lower first.
struct P {
    count: u32, width: u32, steps: u32, step: u32, threshold: u32, scale: f32,
    source: u32, to: u32, cloths: u32, rows: u32, seeds: u32, adds: u32,
}

fn multiply(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let middle = a1 * b0 + (a0 * b0 >> 16u);
    let other = a0 * b1 + (middle & 0xffffu);
    return vec2(a * b, a1 * b1 + (middle >> 16u) + (other >> 16u));
}

fn times(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = multiply(a.x, b.x);
    return vec2(low.x, low.y + a.x * b.y + a.y * b.x);
}

fn plus(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// x ^ (x >> by), for by from 1 to 31.
fn fold(x: vec2<u32>, by: u32) -> vec2<u32> {
    return x ^ vec2((x.x >> by) | (x.y << (32u - by)), x.y >> by);
}

fn element(i: u32) {
    let row = i / p.width;
    let cloth = index[p.cloths + row];
    let seed = vec2(index[p.seeds + 2u * cloth], index[p.seeds + 2u * cloth + 1u]);
    let number = multiply(index[p.rows + row] * p.steps + p.step, p.width);
    let z = times(plus(seed, plus(number, vec2(i % p.width, 0u))), vec2(0x7F4A7C15u, 0x9E3779B9u));
    let y = times(fold(z, 30u), vec2(0x1CE4E5B9u, 0xBF58476Du));
    let x = times(fold(y, 27u), vec2(0x133111EBu, 0x94D049BBu));
    let hash = fold(x, 31u).y;
    let value = m[p.source + i] * select(0.0, p.scale, hash >= p.threshold);
    m[p.to + i] = value + select(0.0, m[p.to + i], p.adds == 1u);
}
