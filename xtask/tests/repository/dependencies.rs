//! Forbidden arrows between packages. An arrow counts however long: a path through any number of
//! packages is found and printed.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::graph::Graph;
use crate::violation::Violation;

/// From whom no path of normal dependencies may lead to whom.
const FORBIDDEN: [&str; 10] = [
    "selvedge-contact -> selvedge-sim selvedge-data selvedge-model selvedge-cluster",
    "selvedge-sim -> selvedge-model selvedge-data selvedge-cluster",
    "selvedge-model -> selvedge-sim selvedge-data selvedge-cluster",
    "selvedge-data -> selvedge-sim selvedge-model",
    "selvedge-guard -> selvedge-model selvedge-data selvedge-cluster",
    "selvedge-view -> selvedge-sim selvedge-model selvedge-train selvedge-gpu selvedge-cluster",
    "selvedge-live -> selvedge-sim selvedge-model selvedge-train selvedge-gpu",
    "selvedge-lab -> selvedge-live clap ctrlc indicatif",
    "selvedge-gpu -> selvedge-sim",
    "selvedge-run -> selvedge-lab selvedge-live selvedge-view clap",
];

/// Pairs that not even a test may join.
const FORBIDDEN_IN_TESTS: [(&str, &str); 2] = [
    ("selvedge-sim", "selvedge-model"),
    ("selvedge-model", "selvedge-sim"),
];

/// The packages that depend on nothing of ours: what ships, the nouns, and the ranks of a job.
const LEAVES: [&str; 3] = ["selvedge-assets", "selvedge-cloth", "selvedge-cluster"];

/// The command line and the library for C, on which nothing depends.
const ENDS: [&str; 2] = ["selvedge", "selvedge-c"];

/// The way to GPUs, and the members that may reach it: the engine, and its users above.
const GPUS: &str = "wgpu";
const KNOW_GPUS: [&str; 7] = [
    "selvedge",
    "selvedge-c",
    "selvedge-gpu",
    "selvedge-lab",
    "selvedge-run",
    "selvedge-trials",
    "selvedge-workshop",
];

/// The runtime that others embed, and what it must do without.
const RUNTIME: &str = "selvedge-model";
const TENSOR_FRAMEWORKS: [&str; 9] = [
    "burn",
    "burn-core",
    "candle-core",
    "dfdx",
    "ndarray",
    "ort",
    "tch",
    "tensorflow",
    "tract-core",
];

/// The pairs of [`FORBIDDEN`].
fn forbidden() -> impl Iterator<Item = (&'static str, &'static str)> {
    let rows = FORBIDDEN.iter().filter_map(|row| row.split_once(" -> "));
    rows.flat_map(|(from, to)| to.split(' ').map(move |to| (from, to)))
}

/// Every forbidden path in `graph`.
pub(crate) fn check(graph: &Graph) -> Vec<Violation> {
    let mut pairs: Vec<(&str, &str)> = forbidden().collect();
    for member in graph.members.iter().map(String::as_str) {
        let ends = ENDS.into_iter().filter(|end| *end != member);
        pairs.extend(ends.map(|end| (member, end)));
        let leaves = LEAVES.into_iter().filter(|leaf| *leaf != member);
        pairs.extend(leaves.map(|leaf| (leaf, member)));
        if !KNOW_GPUS.contains(&member) {
            pairs.push((member, GPUS));
        }
    }
    pairs.extend(TENSOR_FRAMEWORKS.map(|framework| (RUNTIME, framework)));
    pairs.sort_unstable();
    pairs.dedup();

    let mut found = Vec::new();
    for (from, to) in pairs {
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
        let members = ["selvedge", "selvedge-cloth", "selvedge-data", "xtask"];
        let graph = Graph {
            members: members.map(str::to_owned).into(),
            normal: arrows(normal),
            development: arrows(development),
        };
        check(&graph).iter().map(|v| v.what.clone()).collect()
    }

    #[test]
    fn every_forbidden_pair_is_found_alone() {
        assert_eq!(forbidden().count(), 33);
        for (from, to) in forbidden() {
            assert_eq!(
                check_of(&[(from, to)], &[]),
                [format!("a forbidden dependency, {from} -> {to}")]
            );
        }
    }

    #[test]
    fn a_path_through_others_is_printed() {
        let normal = [("selvedge-view", "a"), ("a", "b"), ("b", "selvedge-sim")];
        assert_eq!(
            check_of(&normal, &[]),
            ["a forbidden dependency, selvedge-view -> a -> b -> selvedge-sim"]
        );
    }

    #[test]
    fn leaves_ends_the_runtime_and_gpus_have_rules_of_their_own() {
        let cases: [(&[(&str, &str)], usize); 8] = [
            (
                &[
                    ("selvedge", "selvedge-data"),
                    ("selvedge-data", "selvedge-cloth"),
                ],
                0,
            ),
            // A circle of packages ends the search.
            (&[("selvedge-sim", "a"), ("a", "b"), ("b", "a")], 0),
            (&[("selvedge-cloth", "selvedge-data")], 1),
            (&[("xtask", "selvedge")], 1),
            (&[("selvedge-model", "gemm"), ("gemm", "ndarray")], 1),
            (&[("selvedge-train", "ndarray")], 0),
            (&[("selvedge-data", "wgpu")], 1),
            (&[("selvedge", "gpu"), ("gpu", "wgpu")], 0),
        ];
        for (normal, found) in cases {
            assert_eq!(check_of(normal, &[]).len(), found, "{normal:?}");
        }
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
