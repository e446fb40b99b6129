// Adds the parts of a sum, in order, to a gradient: rows of `columns`, of which column `ones` goes
// to a bias.
struct P {
    count: u32, columns: u32, ones: u32, parts: u32, source: u32, to: u32, to_ld: u32, bias: u32,
}

fn element(i: u32) {
    var sum = 0.0;
    for (var part = 0u; part < p.parts; part++) { sum += m[p.source + part * p.count + i]; }
    let row = i / p.columns;
    let column = i % p.columns;
    if column == p.ones {
        m[p.bias + row] += sum;
    } else {
        m[p.to + row * p.to_ld + column] += sum;
    }
}
