// Sum of squares of each piece of 4096 numbers of the gradient, one group per piece.
struct P { rows: u32, count: u32, gradient: u32, out: u32 }

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group.y * groups.x + group.x;
    if row >= p.rows { return; }
    var sum = 0.0;
    let end = min((row + 1u) * 4096u, p.count);
    for (var i = row * 4096u + lane; i < end; i += 64u) {
        let g = m[p.gradient + i];
        sum += g * g;
    }
    let whole = total(sum, lane);
    if lane == 0u { m[p.out + row] = whole; }
}
