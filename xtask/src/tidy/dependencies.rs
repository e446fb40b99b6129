//! Arrows between packages: each of ours depends on no other of ours than the table allows, and what
//! others bring along does not reach where it must not, however long the path.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::metadata::Graph;
use crate::violation::Violation;

/// The packages of ours, and those of ours that each may name among its dependencies: the diagram
/// of ARCHITECTURE.md, without the prefix `selvedge-`.
const MAY_USE: [(&str, &str); 18] = [
    ("assets", ""),
    ("cloth", ""),
    ("cluster", ""),
    ("contact", "cloth"),
    ("sim", "cloth contact"),
    ("model", "cloth"),
    ("guard", "cloth sim"),
    ("data", "assets cloth cluster"),
    ("view", "cloth"),
    ("live", "cloth data"),
    ("train", "cloth cluster data model"),
    ("gpu", "cloth model train"),
    (
        "lab",
        "assets cloth cluster data gpu guard model sim train view",
    ),
    ("workshop", "cloth data guard lab live model sim"),
    ("trials", "cloth data guard lab live model sim train"),
    ("c", "cloth data guard lab sim"),
    (
        "selvedge",
        "cloth cluster data guard lab live model sim train view workshop",
    ),
    ("xtask", ""),
];

/// Packages of others that some of ours must not reach: a runtime that others embed does without
/// tensor frameworks, and the laboratory prints nothing.
const FORBIDDEN: [(&str, &[&str]); 2] = [
    (
        "selvedge-model",
        &[
            "burn",
            "burn-core",
            "candle-core",
            "dfdx",
            "ndarray",
            "ort",
            "tch",
            "tensorflow",
            "tract-core",
        ],
    ),
    ("selvedge-lab", &["clap", "ctrlc", "indicatif"]),
];

/// The way to GPUs, and the members that may reach it: the engine, and its users above.
const GPUS: &str = "wgpu";
const KNOW_GPUS: [&str; 6] = [
    "selvedge",
    "selvedge-c",
    "selvedge-gpu",
    "selvedge-lab",
    "selvedge-trials",
    "selvedge-workshop",
];

/// Pairs that not even a test may join.
const FORBIDDEN_IN_TESTS: [(&str, &str); 2] = [
    ("selvedge-sim", "selvedge-model"),
    ("selvedge-model", "selvedge-sim"),
];

/// Every arrow in `graph` that is not allowed, and every forbidden path.
pub(crate) fn check(graph: &Graph) -> Vec<Violation> {
    let mut found = Vec::new();
    for member in &graph.members {
        let short = |name: &str| name.trim_start_matches("selvedge-").to_owned();
        let row = MAY_USE.iter().find(|row| row.0 == short(member));
        let allowed: Vec<&str> = row.map_or("", |row| row.1).split(' ').collect();
        for other in neighbours(&graph.normal, member) {
            if graph.members.contains(other) && !allowed.contains(&&*short(other)) {
                found.push(violation("a forbidden dependency", member, &[other]));
            }
        }
    }
    let frameworks = FORBIDDEN.iter();
    let pairs = frameworks.flat_map(|(from, all)| all.iter().map(move |to| (*from, *to)));
    let members = graph.members.iter().map(String::as_str);
    let without = members.filter(|member| !KNOW_GPUS.contains(member));
    for (from, to) in pairs.chain(without.map(|member| (member, GPUS))) {
        if let Some(path) = shortest_path(&graph.normal, neighbours(&graph.normal, from), to) {
            found.push(violation("a forbidden dependency", from, &path));
        }
    }
    for (from, to) in FORBIDDEN_IN_TESTS {
        let first = neighbours(&graph.development, from);
        if let Some(path) = shortest_path(&graph.normal, first, to) {
            found.push(violation(
                "a forbidden dependency of its tests",
                from,
                &path,
            ));
        }
    }
    found
}

fn violation(what: &str, from: &str, path: &[&str]) -> Violation {
    Violation::new(
        &format!("crates/{from}/Cargo.toml"),
        0,
        format!("{what}, {from} -> {}", path.join(" -> ")),
        "cut one of these arrows, and let the crate above compose the two",
    )
}

type Arrows = BTreeMap<String, BTreeSet<String>>;

fn neighbours<'a>(arrows: &'a Arrows, from: &str) -> Vec<&'a str> {
    let targets = arrows.get(from).into_iter().flatten();
    targets.map(String::as_str).collect()
}

/// The shortest path that begins at one of `first` and ends at `to`, by breadth-first search.
fn shortest_path<'a>(arrows: &'a Arrows, first: Vec<&'a str>, to: &str) -> Option<Vec<&'a str>> {
    let mut seen: BTreeSet<&str> = first.iter().copied().collect();
    let mut queue: VecDeque<Vec<&str>> = first.into_iter().map(|name| vec![name]).collect();
    while let Some(path) = queue.pop_front() {
        let end = *path.last()?;
        if end == to {
            return Some(path);
        }
        for next in neighbours(arrows, end) {
            if seen.insert(next) {
                let mut longer = path.clone();
                longer.push(next);
                queue.push_back(longer);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrows(pairs: &[(&str, &str)]) -> Arrows {
        let mut arrows = Arrows::new();
        for (from, to) in pairs {
            let targets = arrows.entry((*from).to_owned()).or_default();
            targets.insert((*to).to_owned());
        }
        arrows
    }

    fn check_of(normal: &[(&str, &str)], development: &[(&str, &str)]) -> Vec<String> {
        let members = ["cloth", "data", "live", "model", "sim", "view"];
        let members = members.map(|name| format!("selvedge-{name}"));
        let graph = Graph {
            members: members
                .into_iter()
                .chain(["selvedge", "xtask"].map(str::to_owned))
                .collect(),
            normal: arrows(normal),
            development: arrows(development),
        };
        check(&graph).iter().map(|v| v.what.clone()).collect()
    }

    #[test]
    fn the_intended_arrows_pass_and_all_others_are_named() {
        let normal = [
            ("selvedge", "selvedge-data"),
            ("selvedge-data", "selvedge-cloth"),
            ("selvedge-live", "selvedge-data"),
            ("selvedge-cloth", "glam"),
        ];
        assert_eq!(check_of(&normal, &[]), Vec::<String>::new());
        for (from, to) in [
            ("selvedge-view", "selvedge-sim"),
            ("selvedge-live", "selvedge-model"),
            ("selvedge-cloth", "selvedge-data"),
            ("xtask", "selvedge"),
        ] {
            assert_eq!(
                check_of(&[(from, to)], &[]),
                [format!("a forbidden dependency, {from} -> {to}")]
            );
        }
    }

    #[test]
    fn what_is_reached_through_others_is_found_with_its_path() {
        let normal = [("selvedge-model", "gemm"), ("gemm", "ndarray")];
        assert_eq!(
            check_of(&normal, &[]),
            ["a forbidden dependency, selvedge-model -> gemm -> ndarray"]
        );
        assert!(check_of(&[("selvedge-data", "ndarray")], &[]).is_empty());
        assert_eq!(check_of(&[("selvedge-data", "wgpu")], &[]).len(), 1);
        assert!(check_of(&[("selvedge", "gpu"), ("gpu", "wgpu")], &[]).is_empty());
        // A circle of packages ends the search.
        let normal = [("selvedge-sim", "a"), ("a", "b"), ("b", "a")];
        assert!(check_of(&normal, &[]).is_empty());
    }

    #[test]
    fn tests_may_not_join_simulator_and_model_but_may_use_data() {
        let through_data = [("selvedge-data", "selvedge-cloth")];
        let development = [("selvedge-sim", "selvedge-data")];
        assert!(check_of(&through_data, &development).is_empty());
        let development = [("selvedge-model", "helper")];
        assert_eq!(
            check_of(&[("helper", "selvedge-sim")], &development),
            ["a forbidden dependency of its tests, selvedge-model -> helper -> selvedge-sim"]
        );
    }
}
