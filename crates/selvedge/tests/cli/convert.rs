//! `selvedge model convert`: models in half precision.

use crate::common::{TestFolder, number};

#[test]
fn a_model_in_half_precision_is_a_model_of_half_the_size() {
    let dir = TestFolder::new();
    let shipped = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../assets/models/paper.safetensors"
    );
    std::fs::copy(shipped, dir.path("paper.safetensors")).unwrap();
    let report = dir.json("model convert paper.safetensors --weights f32 -o wide.safetensors");
    assert_eq!(report["change_rms"], 0.0);
    // The shipped model was f16 before.
    for (name, most) in [("f16", 0.0), ("bf16", 4e-3)] {
        let call = format!("model convert wide.safetensors --weights {name} -o {name}.safetensors");
        let report = dir.json(&call);
        let [bytes, before, change] =
            ["/bytes", "/bytes_before", "/change_rms"].map(|at| number(&report, at));
        assert!(bytes < 0.55 * before, "{bytes} of {before}");
        assert!(change <= most, "{name}: {change}");
        assert_eq!(change > 0.0, name == "bf16");
        dir.json(&format!("info {name}.safetensors"));
    }
    let again = dir.run("model convert f16.safetensors --weights f16 -o again.safetensors");
    assert!(again.out.contains("like this already"), "{}", again.out);
}
