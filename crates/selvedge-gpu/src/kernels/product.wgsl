// c = a b, then an epilogue: tiles of 16 T rows and columns in workgroup memory, summed over k in
// ascending order by fused multiply-add, so that no result depends on the size of a tile.
//
// The columns of `a` in memory, and the columns n of `b`, may be in two pieces. `ones` is a column
// of `b` that is 1 everywhere: the sums for a bias. k is cut into chunks, one per group in z, whose
// results lie `c_part` apart.
struct P {
    rows: u32, columns: u32, k: u32, chunk: u32,
    a: u32, a_ld: u32, a_split: u32, a2: u32, a2_ld: u32,
    b: u32, b_ld: u32, b_split: u32, b2: u32, b2_ld: u32, ones: u32,
    c: u32, c_ld: u32, c_part: u32,
    bias: u32, mask: u32, ends: u32, senders: u32, receivers: u32,
}

var<workgroup> a_tile: array<array<VEC, 17>, 16>;
var<workgroup> b_tile: array<array<VEC, 17>, 16>;

fn a_memory(row: u32, column: u32) -> f32 {
    if column < p.a_split { return m[p.a + row * p.a_ld + column]; }
    return m[p.a2 + row * p.a2_ld + column - p.a_split];
}

fn a_at(row: u32, k: u32, end: u32) -> f32 {
    if row >= p.rows || k >= end { return 0.0; }
    return A_LOAD;
}

fn b_at(k: u32, column: u32, end: u32) -> f32 {
    if column >= p.columns || k >= end { return 0.0; }
    if column == p.ones { return 1.0; }
    if column < p.b_split {
        let n = column;
        let first = p.b;
        let ld = p.b_ld;
        return B_LOAD;
    }
    let n = column - p.b_split;
    let first = p.b2;
    let ld = p.b2_ld;
    return B_LOAD;
}

fn put(value: f32, row: u32, n: u32, part: u32) {
    if row >= p.rows || n >= p.columns { return; }
    let at = p.c + part * p.c_part + row * p.c_ld + n;
    m[at] = EPILOGUE;
}

@compute @workgroup_size(256)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let low = lane % 16u;
    let high = lane / 16u;
    let begin = group.z * p.chunk;
    let end = min(begin + p.chunk, p.k);
    let row0 = group.y * 16u * SIZE;
    let column0 = group.x * 16u * SIZE;
    var sum: array<VEC, SIZE>;
    for (var k0 = begin; k0 < end; k0 += 16u) {
        let a_k = k0 + A_DEEP;
        let a_row = row0 + SIZE * A_WIDE;
        a_tile[A_DEEP][A_WIDE] = VEC(A_ROWS);
        let b_k = k0 + B_DEEP;
        let b_column = column0 + SIZE * B_WIDE;
        b_tile[B_DEEP][B_WIDE] = VEC(B_COLUMNS);
        workgroupBarrier();
        for (var k = 0u; k < 16u; k++) {
            let a = a_tile[k][high];
            let b = b_tile[k][low];
            SUMS
        }
        workgroupBarrier();
    }
    let row = row0 + SIZE * high;
    let column = column0 + SIZE * low;
    PUTS
}
