//! Kernels of the features, with the definitions that say which columns a spec has.

use selvedge_model::{EdgeFeature, ModelSpec, NodeFeature};

use super::{Program, part};

part!("features.cu":
    NODE_FEATURES = "node_features",
    EDGE_FEATURES = "edge_features",
);

/// Adds the kernels and the definitions of a spec.
pub fn define(program: &mut Program, spec: &ModelSpec) {
    let mut column = 0;
    for feature in &spec.node_features {
        program.define(node_name(*feature), column);
        column += feature.width();
    }
    column = 0;
    for feature in &spec.edge_features {
        program.define(edge_name(*feature), column);
        column += feature.width();
    }
    program.add(&PART);
}

/// Name of the definition of a feature's first column.
pub(super) fn node_name(feature: NodeFeature) -> &'static str {
    match feature {
        NodeFeature::Velocity => "NODE_VELOCITY",
        NodeFeature::ExternalForce => "NODE_EXTERNAL_FORCE",
        NodeFeature::KineticEnergy => "NODE_KINETIC_ENERGY",
        NodeFeature::NodeType => "NODE_TYPE",
        NodeFeature::Acceleration => "NODE_ACCELERATION",
    }
}

/// Name of the definition of a feature's first column.
pub(super) fn edge_name(feature: EdgeFeature) -> &'static str {
    match feature {
        EdgeFeature::Vector => "EDGE_VECTOR",
        EdgeFeature::RestVector => "EDGE_REST_VECTOR",
        EdgeFeature::MaterialVector => "EDGE_MATERIAL_VECTOR",
        EdgeFeature::Elongation => "EDGE_ELONGATION",
        EdgeFeature::BendingAngle => "EDGE_BENDING_ANGLE",
    }
}
