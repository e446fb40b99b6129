// Layer normalisation, one group per row; `x` takes the normalised row and `inverse` one over the
// deviation. The update, normal times weight plus shift, is added to `before` where that is given.
//
// For messages a group has a vertex, and its rows are the arcs into it: their updates are also
// added up, arc after arc, in `incoming`.
struct P {
    rows: u32, width: u32, x: u32, inverse: u32, weight: u32, shift: u32,
    before: u32, after: u32, first_arc: u32, incoming: u32,
}

fn normalise(row: u32, to: u32, lane: u32) {
    let first = p.x + row * p.width;
    var sum = 0.0;
    for (var k = lane; k < p.width; k += 64u) { sum += m[first + k]; }
    let mean = total(sum, lane) / f32(p.width);
    var squares = 0.0;
    for (var k = lane; k < p.width; k += 64u) {
        let off = m[first + k] - mean;
        squares += off * off;
    }
    let scale = 1.0 / sqrt(total(squares, lane) / f32(p.width) + 1e-5);
    for (var k = lane; k < p.width; k += 64u) {
        let normal = (m[first + k] - mean) * scale;
        let update = normal * m[p.weight + k] + m[p.shift + k];
        m[first + k] = normal;
        let at = row * p.width + k;
        var old = 0.0;
        if p.before != NONE { old = m[p.before + at]; }
        m[p.after + at] = old + update;
        ADD_UP
    }
    if lane == 0u { m[p.inverse + row] = scale; }
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group.y * groups.x + group.x;
    if row >= p.rows { return; }
    ROWS
}
