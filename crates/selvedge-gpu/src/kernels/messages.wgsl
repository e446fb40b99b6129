// Gradient of a message: those of its arc and of the sum of its receiver, which both contain it.
struct P { count: u32, width: u32, arcs: u32, incoming: u32, receivers: u32, out: u32 }

fn element(i: u32) {
    let receiver = index[p.receivers + i / p.width];
    m[p.out + i] = m[p.arcs + i] + m[p.incoming + receiver * p.width + i % p.width];
}
