//! Reading what PyTorch computed: the one reader of the fixtures here and of those of
//! `selvedge-train`, which takes this file in by its path.

use safetensors::{Dtype, SafeTensors};

/// The tensor `name` of the file `bytes` in f64, row by row.
pub(crate) fn tensor(bytes: &[u8], name: &str) -> Vec<f64> {
    let file = SafeTensors::deserialize(bytes).expect("a fixture");
    let view = file.tensor(name).unwrap_or_else(|_| panic!("no {name}"));
    let data = view.data();
    let (wide, narrow) = (data.as_chunks::<8>().0, data.as_chunks::<4>().0);
    match view.dtype() {
        Dtype::F64 => wide.iter().map(|b| f64::from_le_bytes(*b)).collect(),
        Dtype::F32 => {
            let numbers = narrow.iter().map(|b| f32::from_le_bytes(*b));
            numbers.map(f64::from).collect()
        }
        Dtype::I32 => {
            let numbers = narrow.iter().map(|b| i32::from_le_bytes(*b));
            numbers.map(f64::from).collect()
        }
        other => panic!("{name} is {other:?}"),
    }
}
