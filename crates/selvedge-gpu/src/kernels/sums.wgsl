// The sum of 64 lanes, the same in each of them and always in the same order.
var<workgroup> sums_of: array<f32, 64>;

fn total(value: f32, lane: u32) -> f32 {
    sums_of[lane] = value;
    workgroupBarrier();
    for (var step = 32u; step > 0u; step /= 2u) {
        if lane < step { sums_of[lane] += sums_of[lane + step]; }
        workgroupBarrier();
    }
    let sum = sums_of[0];
    workgroupBarrier();
    return sum;
}
