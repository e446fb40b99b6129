// Gradient of a vertex's products, [vertices, 2 width]: the sums of the gradients of the arcs that
// leave it, which are the reverses of those that arrive, and of the arcs that arrive.
struct P { count: u32, width: u32, arcs: u32, first_arc: u32, reverse_arcs: u32, out: u32 }

fn element(i: u32) {
    let vertex = i / p.width;
    let k = i % p.width;
    var leaving = 0.0;
    var arriving = 0.0;
    for (var arc = index[p.first_arc + vertex]; arc < index[p.first_arc + vertex + 1u]; arc++) {
        leaving += m[p.arcs + index[p.reverse_arcs + arc] * p.width + k];
        arriving += m[p.arcs + arc * p.width + k];
    }
    m[p.out + vertex * 2u * p.width + k] = leaving;
    m[p.out + (2u * vertex + 1u) * p.width + k] = arriving;
}
