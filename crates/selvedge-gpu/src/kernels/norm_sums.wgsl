// Sums over a chunk of rows for the gradients of a layer normalisation's weight and shift: part s of
// [parts, 2 width]. Element i is column i % width of part i / width.
struct P { count: u32, rows: u32, width: u32, chunk: u32, gradient: u32, normal: u32, out: u32 }

fn element(i: u32) {
    let k = i % p.width;
    let part = i / p.width;
    var weight = 0.0;
    var shift = 0.0;
    for (var row = part * p.chunk; row < min((part + 1u) * p.chunk, p.rows); row++) {
        let g = m[p.gradient + row * p.width + k];
        weight += g * m[p.normal + row * p.width + k];
        shift += g;
    }
    let first = p.out + part * 2u * p.width + k;
    m[first] = weight;
    m[first + p.width] = shift;
}
