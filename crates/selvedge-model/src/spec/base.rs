//! The physics whose frames a network corrects.

use serde::{Deserialize, Serialize};

/// Deviations to which inputs and outputs are cut where a network corrects physics of cloth.
pub const MOST_DEVIATIONS: f32 = 10.0;

/// Least latent width of a network that corrects physics: that of its outputs.
pub(crate) const LEAST_LATENT: usize = 8;

/// Cheap physics that predicts a frame, BDF2, to which the network adds what truncation lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhysicsBase {
    /// Implicit solves per frame, at least 1.
    pub substeps: u32,
}

/// Lengths of a frame and of a substep.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameTimes {
    /// That of a frame `[s]`.
    pub frame: f64,
    /// That of a substep `[s]`.
    pub substep: f64,
}

impl PhysicsBase {
    /// Lengths of a frame and a substep where there are `frame_rate` frames per second.
    #[must_use]
    pub fn times(&self, frame_rate: f64) -> FrameTimes {
        FrameTimes {
            frame: 1.0 / frame_rate,
            substep: 1.0 / (frame_rate * f64::from(self.substeps)),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::spec::{EdgeFeature, Encoder, ModelSpec, NodeFeature};

    fn spec() -> ModelSpec {
        let text = r#"{"encoder": {"kind": "mlp"}, "latent": 8, "blocks": 0,
            "base": {"substeps": 1}}"#;
        serde_json::from_str(text).expect("a spec")
    }

    #[test]
    fn a_base_fixes_columns_and_outputs() {
        let spec = spec();
        assert_eq!(spec.validate(), Ok(()));
        assert_eq!(
            (spec.node_width(), spec.edge_width(), spec.outputs()),
            (109, 0, 6)
        );
        let text = serde_json::to_string(&spec).expect("JSON");
        assert_eq!(serde_json::from_str::<ModelSpec>(&text).ok(), Some(spec));
        for (instead, expected) in [
            ("\"steps\"", "unknown field `steps`, expected `substeps`"),
            ("\"forgets\": true, \"substeps\"", "unknown field `forgets`"),
            (
                "\"differences\": \"frames\", \"substeps\"",
                "unknown field `differences`",
            ),
        ] {
            let text = r#"{"encoder": {"kind": "mlp"}, "latent": 8, "blocks": 0,
                "base": {"substeps": 1}}"#;
            let text = text.replace("\"substeps\"", instead);
            let error = serde_json::from_str::<ModelSpec>(&text).expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }

    #[test]
    fn a_spec_with_a_base_that_says_more_names_the_field() {
        type Edit = fn(&mut ModelSpec);
        let edits: [(&str, Edit); 6] = [
            ("model.blocks must be between 0 and 0, found 1", |spec| {
                spec.blocks = 1
            }),
            (
                "model.base.substeps must be between 1 and 1000, found 0",
                |spec| {
                    spec.base.as_mut().expect("a base").substeps = 0;
                },
            ),
            ("model.latent must be between 8 and 4096, found 7", |spec| {
                spec.latent = 7
            }),
            ("model.node_features must be left out", |spec| {
                spec.node_features.insert(NodeFeature::Velocity);
            }),
            ("model.edge_features must be left out", |spec| {
                spec.edge_features.insert(EdgeFeature::Vector);
            }),
            ("model.encoder must be left out", |spec| {
                spec.encoder = Encoder::Gru { window: 2 };
            }),
        ];
        for (expected, edit) in edits {
            let mut spec = spec();
            edit(&mut spec);
            let error = spec.validate().expect_err(expected).to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
