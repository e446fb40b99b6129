//! Pairs that push as in ARCSim, for comparisons with it: of those within twice its thickness the
//! nearest of each vertex, face and edge, on each side as its normals have it, and of each vertex
//! and edge at the boundary. A pair that is the nearest of both its features pushes twice.
//! `[eq:contact-arcsim]`

use glam::DVec3;
use selvedge_cloth::Scene;
use selvedge_contact::{Gap, Kind, Pair, Surface, SurfaceEdge};

/// Stiffness per area, ARCSim's own where a scene is silent `[N/m³]`.
const STIFFNESS: f64 = 1e9;
/// Rounding of weights that count as within a feature.
const WITHIN: f64 = -1e-6;
/// Square of the sine of the angle of two edges, or of two sides of a face, that have no direction
/// across.
const FLAT: [f64; 2] = [1e-6, 1e-8];

pub(super) struct Law {
    /// Area of a vertex: a third of its faces' `[m²]`.
    points: Vec<f64>,
    faces: Vec<f64>,
    edges: Vec<Side>,
    /// Number of each of a face's edges, from corner k on.
    face_edges: Vec<[u32; 3]>,
    /// True for a vertex at a boundary.
    is_bounding: Vec<bool>,
}

/// An edge as the first face that has it runs through it.
#[derive(Clone, Copy)]
struct Side {
    ends: [u32; 2],
    /// That face, and the one that runs the other way.
    faces: [Option<u32>; 2],
    area: f64,
}

pub(super) struct Bodies<'a> {
    pub(super) surface: &'a Surface,
    /// Points `[m]`.
    pub(super) places: &'a [DVec3],
    /// Pairs that may be within twice the thickness.
    pub(super) pairs: &'a [Pair],
    /// Of each body with the cloth `[m]`.
    pub(super) thickness: &'a [f64],
}

pub(super) struct Nearby {
    pub(super) pair: Pair,
    pub(super) gap: Gap,
    /// `[N/m]`.
    pub(super) stiffness: f64,
}

/// A pair and its distance `[m]`.
#[derive(Clone, Copy)]
struct Offer {
    distance: f64,
    pair: Pair,
}

/// The nearest feature on each side, if one was near enough.
type Nearest = [Option<Offer>; 2];

/// Directions of a step.
struct Normals {
    faces: Vec<DVec3>,
    points: Vec<DVec3>,
}

impl Law {
    pub(super) fn new(scene: &Scene, surface: &Surface) -> Self {
        let mut places = scene.mesh.positions().to_vec();
        for obstacle in &scene.obstacles {
            places.extend(obstacle.positions_at(0.0));
        }
        let faces = scene.mesh.pattern().faces();
        let pattern: Vec<f64> = faces
            .map(|[a, b, c]| 0.5 * (b - a).perp_dot(c - a).abs())
            .collect();
        let area = |(number, face): (usize, &[u32; 3])| {
            let [a, b, c] = face.map(|p| places[p as usize]);
            let lies = 0.5 * (b - a).cross(c - a).length();
            pattern.get(number).copied().unwrap_or(lies)
        };
        let faces: Vec<f64> = surface.faces().iter().enumerate().map(area).collect();
        let unseen = |edge: &SurfaceEdge| Side {
            ends: edge.ends,
            faces: [None; 2],
            area: 0.0,
        };
        let mut law = Self {
            points: vec![0.0; places.len()],
            edges: surface.edges().iter().map(unseen).collect(),
            face_edges: Vec::new(),
            is_bounding: vec![false; places.len()],
            faces,
        };
        for (number, face) in surface.faces().iter().enumerate() {
            law.see(surface, number as u32, *face);
        }
        for edge in law.edges.iter().filter(|edge| edge.faces[1].is_none()) {
            for end in edge.ends {
                law.is_bounding[end as usize] = true;
            }
        }
        law
    }

    fn see(&mut self, surface: &Surface, number: u32, face: [u32; 3]) {
        let third = self.faces[number as usize] / 3.0;
        let body = surface.body_of(face[0]);
        let edges = surface.bodies()[body].edges.clone();
        let mut own = [0; 3];
        for (k, own) in own.iter_mut().enumerate() {
            self.points[face[k] as usize] += third;
            let runs = [face[k], face[(k + 1) % 3]];
            let ends = [runs[0].min(runs[1]), runs[0].max(runs[1])];
            let all = &surface.edges()[edges.start as usize..edges.end as usize];
            let found = all.partition_point(|edge| edge.ends < ends) as u32 + edges.start;
            *own = found;
            let edge = &mut self.edges[found as usize];
            edge.area += third;
            match edge.faces[0] {
                None => (edge.ends, edge.faces[0]) = (runs, Some(number)),
                Some(_) => edge.faces[1] = Some(number),
            }
        }
        self.face_edges.push(own);
    }

    pub(super) fn nearest(&self, bodies: &Bodies<'_>) -> Vec<Nearby> {
        let normals = self.normals(bodies.surface, bodies.places);
        let mut found = Found::new(self, bodies);
        for pair in bodies.pairs {
            match pair.kind {
                Kind::VertexFace => found.vertex_face(pair, &normals),
                Kind::EdgeEdge => found.edges(pair, &normals),
            }
        }
        let nearby = found.pairs().filter_map(|pair| {
            let corners = pair.places(bodies.places);
            Some(Nearby {
                gap: apart(pair.kind, corners, is_edge_of_vertex(&pair))?,
                stiffness: STIFFNESS * self.least_area(&pair),
                pair,
            })
        });
        nearby.collect()
    }

    fn least_area(&self, pair: &Pair) -> f64 {
        let (first, second) = (pair.first as usize, pair.second as usize);
        match pair.kind {
            Kind::EdgeEdge => self.edges[first].area.min(self.edges[second].area),
            Kind::VertexFace if is_edge_of_vertex(pair) => {
                self.points[first].min(self.edges[second].area)
            }
            Kind::VertexFace => self.points[first].min(self.faces[second]),
        }
    }

    fn normals(&self, surface: &Surface, places: &[DVec3]) -> Normals {
        let mut points = vec![DVec3::ZERO; places.len()];
        let mut faces = Vec::with_capacity(surface.faces().len());
        for face in surface.faces() {
            let corners = face.map(|p| places[p as usize]);
            for k in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|next| corners[(k + next) % 3]);
                let (u, v) = (b - a, c - a);
                let weight = 2.0 * u.length_squared() * v.length_squared();
                points[face[k] as usize] += u.cross(v) / weight;
            }
            let [a, b, c] = corners;
            faces.push((b - a).cross(c - a).normalize_or_zero());
        }
        let points = points.into_iter().map(DVec3::normalize_or_zero).collect();
        Normals { faces, points }
    }
}

/// Kinds of the cloth's features that have a nearest: also a vertex at the boundary, to which an edge
/// is, and such an edge.
const POINTS: usize = 0;
const RIM_POINTS: usize = 1;
const EDGES: usize = 2;
const RIM_EDGES: usize = 3;
const FACES: usize = 4;

/// The nearest of each feature of the cloth so far.
struct Found<'a> {
    law: &'a Law,
    bodies: &'a Bodies<'a>,
    /// By kind and number.
    nearest: [Vec<Nearest>; 5],
}

impl<'a> Found<'a> {
    fn new(law: &'a Law, bodies: &'a Bodies<'a>) -> Self {
        let cloth = &bodies.surface.bodies()[0];
        let (points, edges) = (cloth.points.end, cloth.edges.end);
        let counts = [points, points, edges, edges, cloth.faces.end];
        Self {
            law,
            bodies,
            nearest: counts.map(|count| vec![[None; 2]; count as usize]),
        }
    }

    /// All that are near enough.
    fn pairs(&self) -> impl Iterator<Item = Pair> {
        let all = self.nearest.iter().flatten().flatten().flatten();
        let near = all.filter(|offer| offer.distance < self.reach(&offer.pair));
        near.map(|offer| offer.pair)
    }

    /// Keeps the nearer one; obstacles have no slots.
    fn take(&mut self, kind: usize, number: u32, side: usize, offer: Offer) {
        if let Some(slots) = self.nearest[kind].get_mut(number as usize) {
            let slot = &mut slots[side];
            if slot.is_none_or(|last| offer.distance < last.distance) {
                *slot = Some(offer);
            }
        }
    }

    fn reach(&self, pair: &Pair) -> f64 {
        let [first, .., last] = pair.corners.map(|p| self.bodies.surface.body_of(p));
        2.0 * self.bodies.thickness[first.max(last)]
    }

    fn vertex_face(&mut self, pair: &Pair, normals: &Normals) {
        let places = self.bodies.places;
        let (vertex, face) = (pair.first, pair.second);
        if let Some((normal, distance, weights)) = of_plane(pair.places(places))
            && weights[1..].iter().all(|w| -w >= WITHIN)
        {
            let offer = Offer {
                distance: distance.abs(),
                pair: *pair,
            };
            let side = usize::from(normal.dot(normals.points[vertex as usize]) < 0.0);
            self.take(POINTS, vertex, side, offer);
            let side = usize::from(-normal.dot(normals.faces[face as usize]) < 0.0);
            self.take(FACES, face, side, offer);
        }
        if self.law.is_bounding[vertex as usize] {
            for edge in self.law.face_edges[face as usize] {
                self.rim(vertex, edge, normals);
            }
        }
    }

    /// A vertex and an edge at boundaries, beyond the edge.
    fn rim(&mut self, vertex: u32, number: u32, normals: &Normals) {
        let edge = self.law.edges[number as usize];
        let [Some(face), None] = edge.faces else {
            return;
        };
        if self.bodies.surface.faces()[face as usize].contains(&vertex) {
            return;
        }
        let places = self.bodies.places;
        let [a, b] = edge.ends.map(|end| places[end as usize]);
        let at = places[vertex as usize];
        // Counter-clockwise in its face, the edge has the outside on its right.
        let outwards = (b - a).cross(normals.faces[face as usize]);
        let part = (at - a).dot(b - a) / (b - a).length_squared();
        if (at - a).dot(outwards) < 0.0 || !(0.0..=1.0).contains(&part) {
            return;
        }
        let [from, to] = edge.ends;
        let pair = Pair::vertex_face(vertex, number, [vertex, from, to, to]);
        let offer = Offer {
            distance: at.distance(a.lerp(b, part)),
            pair,
        };
        self.take(RIM_POINTS, vertex, 0, offer);
        self.take(RIM_EDGES, number, 0, offer);
    }

    fn edges(&mut self, pair: &Pair, normals: &Normals) {
        let numbers = [pair.first, pair.second];
        let sides = numbers.map(|number| self.law.edges[number as usize]);
        let [[a, b], [c, d]] = sides.map(|side| side.ends);
        let pair = Pair::edge_edge(pair.first, pair.second, [a, b, c, d]);
        let places = self.bodies.places;
        let Some((normal, distance, w)) = of_edges(pair.places(places)) else {
            return;
        };
        let is_within = w[0].min(w[1]).min(-w[2]).min(-w[3]) >= WITHIN;
        let between = |from: u32, to: u32, part: f64| {
            places[from as usize] * (1.0 - part) + places[to as usize] * part
        };
        if !(is_within
            && is_beyond(sides[1], between(a, b, w[1]), places, normals)
            && is_beyond(sides[0], between(c, d, -w[3]), places, normals))
        {
            return;
        }
        let offer = Offer {
            distance: distance.abs(),
            pair,
        };
        for (number, sign) in numbers.into_iter().zip([1.0, -1.0]) {
            let [from, to] = self.law.edges[number as usize].ends;
            let own = normals.points[from as usize] + normals.points[to as usize];
            let side = usize::from(sign * normal.dot(own) < 0.0);
            self.take(EDGES, number, side, offer);
        }
    }
}

/// Returns true if `place` is on the outer side of both faces of an edge, across the edge.
fn is_beyond(edge: Side, place: DVec3, places: &[DVec3], normals: &Normals) -> bool {
    let [a, b] = edge.ends;
    let runs = [[a, b], [b, a]].into_iter().zip(edge.faces);
    let mut sides = runs.filter_map(|(ends, face)| Some((ends, face?)));
    sides.all(|([from, to], face)| {
        let from = places[from as usize];
        let along = places[to as usize] - from;
        along.cross(normals.faces[face as usize]).dot(place - from) >= 0.0
    })
}

/// True for a vertex and an edge: their last two corners are one.
fn is_edge_of_vertex(pair: &Pair) -> bool {
    pair.kind == Kind::VertexFace && pair.corners[2] == pair.corners[3]
}

/// The gap of a pair, as it pushes; none where it has no direction.
fn apart(kind: Kind, corners: [DVec3; 4], is_rim: bool) -> Option<Gap> {
    let (normal, distance, weights) = match kind {
        Kind::EdgeEdge => of_edges(corners)?,
        Kind::VertexFace if is_rim => {
            let [at, a, b, _] = corners;
            let part = (at - a).dot(b - a) / (b - a).length_squared();
            let out = at - a.lerp(b, part);
            let weights = [1.0, part - 1.0, -part, 0.0];
            (out.try_normalize()?, out.length(), weights)
        }
        Kind::VertexFace => of_plane(corners)?,
    };
    Some(Gap {
        distance: distance.abs(),
        normal: normal * if distance < 0.0 { -1.0 } else { 1.0 },
        weights,
    })
}

/// Direction, signed distance `[m]` and weights of a vertex against the plane of a face.
fn of_plane(corners: [DVec3; 4]) -> Option<(DVec3, f64, [f64; 4])> {
    let [x, a, b, c] = corners;
    let across = (b - a)
        .normalize_or_zero()
        .cross((c - a).normalize_or_zero());
    if across.length_squared() < FLAT[0] {
        return None;
    }
    let normal = across.normalize();
    let part = |p: DVec3, q: DVec3| (p - x).cross(q - x).dot(normal);
    let parts = [part(b, c), part(c, a), part(a, b)];
    let sum: f64 = parts.iter().sum();
    let [p, q, r] = parts.map(|part| -part / sum);
    Some((normal, (x - a).dot(normal), [1.0, p, q, r]))
}

/// Direction, signed distance `[m]` and weights of the lines of two edges.
fn of_edges(corners: [DVec3; 4]) -> Option<(DVec3, f64, [f64; 4])> {
    let [a, b, c, d] = corners;
    let across = (b - a)
        .normalize_or_zero()
        .cross((d - c).normalize_or_zero());
    if across.length_squared() < FLAT[1] {
        return None;
    }
    let normal = across.normalize();
    let turn = |p: DVec3, q: DVec3| p.cross(q).dot(normal);
    let (a0, a1) = (turn(d - b, c - b), turn(c - a, d - a));
    let (b0, b1) = (turn(a - d, b - d), turn(b - c, a - c));
    let weights = [
        a0 / (a0 + a1),
        a1 / (a0 + a1),
        -b0 / (b0 + b1),
        -b1 / (b0 + b1),
    ];
    Some((normal, (a - c).dot(normal), weights))
}
