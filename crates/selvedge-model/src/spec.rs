//! The spec of a network: features, encoder, sizes. Its enums are closed, so that a combination
//! without meaning cannot be written.

use std::collections::BTreeSet;

use serde::{Deserialize, Deserializer, Serialize};
use thiserror::Error;

/// Columns of the output of a vertex: its acceleration.
pub const OUTPUTS: usize = 3;

/// The full description of a learned simulator, as it stands in a training configuration and in
/// the metadata of a weight file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelSpec {
    /// Features of a node.
    #[serde(deserialize_with = "each_once")]
    pub node_features: BTreeSet<NodeFeature>,
    /// Features of an arc.
    #[serde(deserialize_with = "each_once")]
    pub edge_features: BTreeSet<EdgeFeature>,
    /// Encoder of features to latent vectors.
    pub encoder: Encoder,
    /// Width of every latent vector.
    pub latent: usize,
    /// Number of message-passing blocks.
    pub blocks: usize,
    /// Motion of the cloth without the network.
    #[serde(default)]
    pub integration: Integration,
}

/// A group of columns of a vertex, in the order in which they stand in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NodeFeature {
    /// p^t - p^{t-1} `[m/frame]`, 3 columns.
    Velocity,
    /// Gravity and air `[N]`, 3 columns.
    ExternalForce,
    /// m |v|² / 2 `[kg m²/frame²]`, 1 column.
    KineticEnergy,
    /// One-hot of 9: free vertex = 0, handle = 1.
    NodeType,
    /// Gravity and air over mass `[m/frame²]`, 3 columns.
    ExternalAcceleration,
    /// What a handle is about to be accelerated by, p^{t+1} - 2 p^t + p^{t-1} `[m/frame²]`, 3 columns: its
    /// target is known. 0 of free vertices.
    HandleAcceleration,
    /// Unit direction from the nearest body, or the nearest other layer, times 1 - gap / reach, 3 columns: 0
    /// where nothing is within reach.
    Nearness,
    /// What keeps a vertex at the thickness of contact from there if it and the body go on as they do
    /// `[m/frame²]`, 3 columns: the body's next place is known.
    ContactAcceleration,
    /// Velocity of the nearest point there against the vertex, times 1 - gap / reach `[m/frame]`, 3 columns.
    ContactVelocity,
}

/// A group of columns of an arc, in the order in which they stand in the input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeFeature {
    /// p_sender - p_receiver and its length `[m]`, 4 columns.
    Vector,
    /// The same in the sagged rest pose `[m]`, 4 columns.
    RestVector,
    /// The same in material space `[m]`, 3 columns (the baseline's rest feature).
    MaterialVector,
    /// Elongation against the sagged rest pose `[m]`, 1 column.
    Elongation,
    /// Signed bending angle of an edge between two faces `[rad]`, 1 column: the negative of
    /// [`selvedge_cloth::geometry::dihedral_angle`], 0 on the boundary.
    BendingAngle,
    /// Length in the pattern `[m]`, 1 column.
    PatternLength,
    /// Strain against the pattern, 1 column.
    Strain,
    /// What the receiver is accelerated by if its fabric pulls along the edge `[m/frame²]`, 3 columns.
    StretchAcceleration,
    /// What a wing is accelerated by as its fabric bends back about the edge, with the sign of the bending angle
    /// `[m/frame²]`, 1 column: the mass is the receiver's.
    BendAcceleration,
}

/// Motion of a cloth without its network, to which the network adds its acceleration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Integration {
    /// Uniform motion, as in the paper.
    Inertial {},
}

impl Default for Integration {
    fn default() -> Self {
        Self::Inertial {}
    }
}

/// Encoder of features to latent vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Encoder {
    /// A multi-layer perceptron on the current frame, as in MeshGraphNets.
    Mlp {
        /// Frames in the window: 1, the current one.
        #[serde(default = "one")]
        window: usize,
    },
    /// A recurrent network of two layers of gated recurrent units over a window of frames, the
    /// current one last.
    Gru {
        /// Frames in the window, at least 1.
        window: usize,
    },
}

/// The window of an encoder that sees the current frame alone.
fn one() -> usize {
    1
}

/// Reads a list without repetitions.
fn each_once<'de, D, T>(list: D) -> Result<BTreeSet<T>, D::Error>
where
    D: Deserializer<'de>,
    T: Deserialize<'de> + Serialize + Ord,
{
    let mut set = BTreeSet::new();
    for feature in Vec::<T>::deserialize(list)? {
        let name = serde_json::to_string(&feature).map_err(serde::de::Error::custom)?;
        if !set.insert(feature) {
            let message = format!("{name} stands twice in a list of features: once is enough");
            return Err(serde::de::Error::custom(message));
        }
    }
    Ok(set)
}

impl Encoder {
    /// A perceptron on the current frame, as in MeshGraphNets.
    pub const MLP: Self = Self::Mlp { window: 1 };

    /// Frames in its window.
    pub fn window(self) -> usize {
        match self {
            Self::Mlp { window } | Self::Gru { window } => window,
        }
    }

    /// Returns true for a recurrent network.
    pub fn is_recurrent(self) -> bool {
        !matches!(self, Self::Mlp { .. })
    }
}

/// A spec that no network can be built from, or parts that do not fit it.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct SpecError(pub(crate) String);

impl ModelSpec {
    /// The paper's features (Libao et al. 2023) with the given encoder and sizes.
    pub fn physical(encoder: Encoder, latent: usize, blocks: usize) -> Self {
        Self {
            node_features: BTreeSet::from([
                NodeFeature::Velocity,
                NodeFeature::ExternalForce,
                NodeFeature::KineticEnergy,
                NodeFeature::NodeType,
            ]),
            edge_features: BTreeSet::from([
                EdgeFeature::Vector,
                EdgeFeature::RestVector,
                EdgeFeature::Elongation,
                EdgeFeature::BendingAngle,
            ]),
            encoder,
            latent,
            blocks,
            integration: Integration::default(),
        }
    }

    /// The baseline's features and encoder (MeshGraphNets, Pfaff et al. 2021).
    pub fn mesh_graph_nets(latent: usize, blocks: usize) -> Self {
        Self {
            node_features: BTreeSet::from([NodeFeature::Velocity, NodeFeature::NodeType]),
            edge_features: BTreeSet::from([EdgeFeature::Vector, EdgeFeature::MaterialVector]),
            encoder: Encoder::MLP,
            latent,
            blocks,
            integration: Integration::default(),
        }
    }

    /// Checks the sizes, and the features without which nothing can be predicted.
    ///
    /// # Errors
    /// Names the field.
    pub fn validate(&self) -> Result<(), SpecError> {
        self.check_sizes()?;
        self.check_features()
    }

    fn check_sizes(&self) -> Result<(), SpecError> {
        if let Encoder::Mlp { window } = self.encoder
            && window != 1
        {
            return Err(SpecError(format!(
                "model.encoder.window of the kind \"mlp\" must be 1, found {window}: choose the kind \"gru\" for several frames"
            )));
        }
        for (field, found, least, most) in [
            ("latent", self.latent, 4, 4096),
            ("blocks", self.blocks, 1, 256),
            ("encoder.window", self.window(), 1, 64),
        ] {
            if !(least..=most).contains(&found) {
                return Err(SpecError(format!(
                    "model.{field} must be between {least} and {most}, found {found}"
                )));
            }
        }
        Ok(())
    }

    fn check_features(&self) -> Result<(), SpecError> {
        let (nodes, edges) = (&self.node_features, &self.edge_features);
        let velocity = nodes.contains(&NodeFeature::Velocity);
        let node_type = nodes.contains(&NodeFeature::NodeType);
        let vector = edges.contains(&EdgeFeature::Vector);
        for (is_there, field, needed) in [
            (velocity, "node_features", "velocity"),
            (node_type, "node_features", "node-type"),
            (vector, "edge_features", "vector"),
        ] {
            if !is_there {
                let problem = format!("model.{field} must contain \"{needed}\"");
                return Err(SpecError(problem));
            }
        }
        let of_newest = nodes.contains(&NodeFeature::HandleAcceleration) || self.sees_bodies();
        if of_newest && self.window() > 1 {
            return Err(SpecError(
                "model.node_features contains \"handle-acceleration\" or what is near, known of the newest frame alone: choose an encoder of the kind \"mlp\"".to_owned(),
            ));
        }
        Ok(())
    }

    /// True where a feature is made from what the cloth could touch.
    pub fn sees_bodies(&self) -> bool {
        use NodeFeature::{ContactAcceleration, ContactVelocity, Nearness};
        [Nearness, ContactAcceleration, ContactVelocity]
            .iter()
            .any(|feature| self.node_features.contains(feature))
    }

    /// True where a feature is made from the fabric's stiffness or the pattern's lengths
    /// ([`ClothGraph::with_materials`](crate::ClothGraph::with_materials)).
    pub fn needs_fabric(&self) -> bool {
        use EdgeFeature::{BendAcceleration, PatternLength, Strain, StretchAcceleration};
        [PatternLength, Strain, StretchAcceleration, BendAcceleration]
            .iter()
            .any(|feature| self.edge_features.contains(feature))
    }

    /// Frames that the encoder sees, the current one included.
    pub fn window(&self) -> usize {
        self.encoder.window()
    }

    /// Frames of positions that the features of a window are made from: the window and the frame
    /// before it.
    pub fn history(&self) -> usize {
        self.window() + 1
    }

    /// Columns of a vertex.
    pub fn node_width(&self) -> usize {
        self.node_features.iter().map(|f| f.width()).sum()
    }

    /// Columns of an arc.
    pub fn edge_width(&self) -> usize {
        self.edge_features.iter().map(|f| f.width()).sum()
    }
}
