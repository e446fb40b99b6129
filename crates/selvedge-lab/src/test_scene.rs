//! The small scene of this crate's tests.

use std::path::Path;

use selvedge_cloth::Scene;
use selvedge_data::parse_scene;

/// A square of 36 vertices that hangs flat from its upper corners.
pub(crate) fn hanging() -> Scene {
    let text = r#"
        name = "hanging"
        material = "gray-interlock"
        mesh = { generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 } }
        handles = { label = "upper-corners" }
        motion = { inline = { kind = "blocks", blocks = [{ duration = 1.0 }] } }
    "#;
    parse_scene(text, Path::new(""), "hanging").unwrap().scene
}
