// Memory of a session: numbers, indices that do not change during a pass, and the parameters of
// this launch. NONE stands for an array that is not there.
@group(0) @binding(0) var<storage, read_write> m: array<f32>;
@group(0) @binding(1) var<storage, read> index: array<u32>;
@group(0) @binding(2) var<uniform> p: P;

const NONE = 0xffffffffu;
