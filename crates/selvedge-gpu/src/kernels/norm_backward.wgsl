// Layer normalisation backward, one group per row. With the normalised row n and h = g weight, the
// gradient of the input is (h - mean of h - n times mean of h n) / deviation.
struct P { rows: u32, width: u32, gradient: u32, normal: u32, inverse: u32, weight: u32, out: u32 }

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let row = group.y * groups.x + group.x;
    if row >= p.rows { return; }
    let first = row * p.width;
    var sum = 0.0;
    var along = 0.0;
    for (var k = lane; k < p.width; k += 64u) {
        let h = m[p.gradient + first + k] * m[p.weight + k];
        sum += h;
        along += h * m[p.normal + first + k];
    }
    let mean = total(sum, lane) / f32(p.width);
    let part = total(along, lane) / f32(p.width);
    let scale = m[p.inverse + row];
    for (var k = lane; k < p.width; k += 64u) {
        let h = m[p.gradient + first + k] * m[p.weight + k];
        m[p.out + first + k] = (h - mean - m[p.normal + first + k] * part) * scale;
    }
}
