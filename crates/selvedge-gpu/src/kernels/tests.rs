//! Sources that devices compile, and files of kernels read by themselves.

use selvedge_model::{EdgeFeature, NodeFeature};

use super::*;
use crate::test_graphs::full_specs;

/// All files of kernels.
const PARTS: [&Part; 7] = [
    &adam::PART,
    &backward::PART,
    &features::PART,
    &features_backward::PART,
    &layers::PART,
    &losses::PART,
    &motion::PART,
];

/// A program of all kernels for a spec with all features.
fn whole_program() -> Program {
    let spec = full_specs().pop().expect("a spec");
    let mut program = Program::new(Sizes::of(&spec));
    program.add(&layers::PART);
    features::define(&mut program, &spec);
    program.add(&losses::PART);
    program.add(&backward::PART);
    program.add(&features_backward::PART);
    adam::define(&mut program);
    program.add(&motion::PART);
    program
}

#[test]
fn every_kernel_of_a_file_is_declared_and_has_one_entry() {
    let program = whole_program();
    for part in PARTS {
        let line = |name: &str| format!("KERNEL({name},");
        let bodies = part.text.lines().filter(|l| l.starts_with("KERNEL("));
        assert_eq!(bodies.count(), part.kernels.len(), "{}", part.name);
        for kernel in part.kernels {
            let count = part.text.matches(&line(kernel.name)).count();
            assert_eq!(count, 1, "{}", kernel.name);
        }
    }
    for (dialect, entry) in [
        (Dialect::Cuda, "(unsigned count, "),
        (Dialect::Host, "(void **arguments, unsigned count)"),
    ] {
        let text = program.text(dialect);
        for kernel in PARTS.iter().flat_map(|part| part.kernels) {
            let entry = format!("run_{}{entry}", kernel.name);
            assert_eq!(text.matches(&entry).count(), 1, "{entry}");
        }
    }
}

/// True where the columns depend on positions that are predicted.
fn node_has_gradient(feature: NodeFeature) -> bool {
    match feature {
        NodeFeature::NodeType => false,
        NodeFeature::Velocity
        | NodeFeature::ExternalForce
        | NodeFeature::KineticEnergy
        | NodeFeature::Acceleration => true,
    }
}

/// As [`node_has_gradient`]; rest poses are given.
fn edge_has_gradient(feature: EdgeFeature) -> bool {
    match feature {
        EdgeFeature::RestVector | EdgeFeature::MaterialVector => false,
        EdgeFeature::Vector | EdgeFeature::Elongation | EdgeFeature::BendingAngle => true,
    }
}

#[test]
fn every_feature_is_in_the_kernels_there_and_back() {
    let spec = full_specs().pop().expect("a spec");
    assert_eq!((spec.node_features.len(), spec.edge_features.len()), (5, 5));
    let nodes = spec.node_features.iter();
    let nodes = nodes.map(|f| (features::node_name(*f), node_has_gradient(*f)));
    let edges = spec.edge_features.iter();
    let edges = edges.map(|f| (features::edge_name(*f), edge_has_gradient(*f)));
    let has = |part: &Part, name: &str| {
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        part.text.split(|c| !is_word(c)).any(|word| word == name)
    };
    for (name, has_gradient) in nodes.chain(edges) {
        assert!(has(&features::PART, name), "{name}");
        assert_eq!(has(&features_backward::PART, name), has_gradient, "{name}");
    }
}

#[test]
fn the_example_for_editors_is_a_program_of_today() {
    let expected = format!(
        "// Definitions for one network, with which compile_flags.txt lets editors read a file of kernels by\n\
         // itself. Devices get those of their own network from the program.\n{}",
        whole_program().definitions()
    );
    assert_eq!(
        include_str!("example.h"),
        expected,
        "example.h should be:\n{expected}"
    );
}

#[test]
fn every_file_is_read_by_itself() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/kernels");
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_owned());
    for part in PARTS {
        let answer = std::process::Command::new(&compiler)
            .args(include_str!("compile_flags.txt").lines())
            .args(["-fsyntax-only", part.name])
            .current_dir(folder)
            .output()
            .expect("a C compiler");
        let messages = String::from_utf8_lossy(&answer.stderr);
        assert!(answer.status.success(), "{}:\n{messages}", part.name);
    }
}
