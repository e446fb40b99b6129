use super::*;
use crate::closest;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_cloth::{Obstacle, bodies};

/// All pairs without a common vertex, of the cloth with all.
fn every_pair(mesh: &CollisionMesh) -> Vec<Pair> {
    let bodies = mesh.bodies();
    let (cloth, all) = (bodies[0].points.end, bodies[bodies.len() - 1].points.end);
    let mut pairs = Vec::new();
    for vertex in 0..all {
        for (number, face) in (0..).zip(mesh.faces()) {
            if !face.contains(&vertex) && (vertex < cloth || face[0] < cloth) {
                let corners = [vertex, face[0], face[1], face[2]];
                pairs.push(Pair::vertex_face(vertex, number, corners));
            }
        }
    }
    for (first, left) in (0..).zip(mesh.edges()) {
        for (second, right) in (0..).zip(mesh.edges()) {
            let apart = left.ends.iter().all(|end| !right.ends.contains(end));
            if first < second && apart && left.ends[0] < cloth {
                let corners = [left.ends[0], left.ends[1], right.ends[0], right.ends[1]];
                pairs.push(Pair::edge_edge(first, second, corners));
            }
        }
    }
    pairs
}

/// A sheet of so many vertices, three faces over six `corners` `[m]` and `round` bodies, with all points.
fn scene(vertices: usize, corners: Vec<DVec3>, round: &[Obstacle]) -> (CollisionMesh, Vec<DVec3>) {
    let sheet = square(vertices, 1.0, 1).unwrap();
    let body = Obstacle::new("body", corners, vec![[0, 1, 2], [3, 4, 5], [1, 2, 3]]).unwrap();
    let mut start = sheet.mesh.positions().to_vec();
    let all = [&[body][..], round].concat();
    start.extend(
        all.iter()
            .flat_map(|body| CollisionMesh::places_of(body, 0.0)),
    );
    let mesh = CollisionMesh::new(sheet.mesh.topology(), &all);
    (mesh, start)
}

/// A ball and a capsule.
fn round() -> [Obstacle; 2] {
    let to = DVec3::new(0.1, -0.2, 0.1);
    let ball = bodies::sphere(0.1, 0.1).placed(1.0, |p| p - to);
    let capsule = bodies::capsule(0.03, 0.4, 0.1).placed(1.0, |p| p + to);
    let round = [("ball", ball), ("capsule", capsule)];
    round.map(|(name, body)| Obstacle::of(name, body).unwrap())
}

fn ordered(pair: &Pair) -> Pair {
    let [a, b, c, d] = pair.corners;
    match pair.kind {
        Kind::EdgeEdge if pair.first > pair.second => {
            Pair::edge_edge(pair.second, pair.first, [c, d, a, b])
        }
        _ => *pair,
    }
}

/// Asserts that `found`, in order, has all pairs that come nearer than `gap` `[m]` on the way
/// between two states.
fn assert_none_is_missed(
    mesh: &CollisionMesh,
    every: &[Pair],
    found: &[Pair],
    way: [&[DVec3]; 2],
    gap: f64,
) {
    for pair in every {
        let [a, b] = way.map(|points| pair.places(points));
        let nearest = (0..=20)
            .map(|k| {
                let part = f64::from(k) / 20.0;
                let corners = std::array::from_fn(|c| a[c].lerp(b[c], part));
                closest::gap(pair.kind, corners).distance
            })
            .fold(f64::INFINITY, f64::min);
        if nearest - mesh.radius_of(pair) < gap {
            assert!(found.binary_search(pair).is_ok(), "{pair:?} at {nearest}");
        }
    }
}

#[test]
fn no_near_pair_is_missed_none_comes_twice_and_a_wider_search_keeps_what_there_is() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
    let (mesh, start) = scene(36, (0..6).map(|_| point(0.7)).collect(), &round());
    let mut candidates = Candidates::new(&mesh, &start, true);
    let reach = Reach {
        gap: 0.02,
        slack: 0.02,
        own_slack: 0.02,
    };
    let every = every_pair(&mesh);
    let in_order = |pairs: &[Pair]| {
        let mut found: Vec<Pair> = pairs.iter().map(ordered).collect();
        found.sort_unstable();
        found.dedup();
        assert!(found.len() == pairs.len() && found.len() < every.len());
        found
    };
    let mut added = 0;
    for _ in 0..20 {
        let crumpled = |p: &DVec3, by: DVec3| DVec3::new(0.0, p.y * 0.5, p.z * 0.5) + by;
        let from: Vec<DVec3> = start.iter().map(|p| crumpled(p, point(0.1))).collect();
        let ways = |to| Ways {
            from: &from,
            to,
            later: to,
        };
        let to: Vec<DVec3> = from.iter().map(|p| *p + point(0.05)).collect();
        candidates.find(&mesh, ways(&to), reach);
        let first = candidates.pairs().to_vec();
        // A path that strays less than the slack along each axis.
        let mut strayed = |from: &[DVec3]| from.iter().map(|p| *p + point(0.015)).collect();
        let [begin, end]: [Vec<DVec3>; 2] = [strayed(&from), strayed(&to)];
        assert!(candidates.cover(&from, &to) && candidates.cover(&begin, &end));
        assert_none_is_missed(&mesh, &every, &in_order(&first), [&begin, &end], reach.gap);
        // Some points end elsewhere.
        let mut other = to.clone();
        for _ in 0..8 {
            other[(point(1.0).x.abs() * 41.0) as usize] += point(0.3);
        }
        assert!(!candidates.cover(&from, &other));
        candidates.widen(&mesh, ways(&other), reach);
        assert!(candidates.cover(&from, &other) && candidates.cover(&from, &to));
        let pairs = candidates.pairs();
        assert_eq!(pairs[..first.len()], first);
        added += pairs.len() - first.len();
        let found = in_order(pairs);
        for end in [&to, &other] {
            assert_none_is_missed(&mesh, &every, &found, [&from, end], reach.gap);
        }
        // Nothing new for points that stay within their boxes.
        candidates.widen(&mesh, ways(&to), reach);
        assert_eq!(candidates.pairs().len(), found.len());
    }
    assert!(added > 1000, "{added}");
}

#[test]
fn a_cloth_that_moves_as_a_whole_keeps_its_own_pairs_and_looks_for_others_alone() {
    let body = [DVec3::ZERO, DVec3::X, DVec3::Z].map(|p| p * 0.5 + DVec3::Y * 3.0);
    let (mesh, start) = scene(36, body.into_iter().chain(body).collect(), &[]);
    let cloth = mesh.bodies()[0].points.len();
    let mut candidates = Candidates::new(&mesh, &start, true);
    let reach = Reach {
        gap: 0.3,
        slack: 0.01,
        own_slack: 0.01,
    };
    let moved = |by: DVec3| -> Vec<DVec3> {
        let ways = (0..start.len()).map(|p| if p < cloth { by } else { DVec3::ZERO });
        start.iter().zip(ways).map(|(p, way)| *p + way).collect()
    };
    assert_eq!(candidates.find(&mesh, Ways::still(&start), reach), 0);
    let own = candidates.pairs().to_vec();
    assert!(own.len() > 100 && candidates.own_count() == own.len());
    let (from, to) = (moved(DVec3::Y), moved(DVec3::Y * 3.0));
    assert!(!candidates.cover(&from, &to));
    let ways = Ways {
        from: &from,
        to: &to,
        later: &to,
    };
    assert_eq!(candidates.find(&mesh, ways, reach), own.len());
    assert_eq!(candidates.pairs()[..own.len()], own);
    let met = &candidates.pairs()[own.len()..];
    assert!(
        !met.is_empty()
            && met
                .iter()
                .all(|pair| pair.corners.iter().any(|p| *p as usize >= cloth))
    );
    assert!(candidates.cover(&from, &to));
    // What goes against the middle is looked for anew.
    let mut other = to.clone();
    other[0] += DVec3::X * 0.1;
    assert_eq!(candidates.find(&mesh, Ways::still(&other), reach), 0);
}
