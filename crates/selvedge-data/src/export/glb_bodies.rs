//! Obstacles in the text of a .glb: a node and a mesh each, and their part of the animation.

use glam::Vec3;
use serde_json::{Value, json};

use super::glb_json::{Accessors, Part, channel};
use super::obstacles::TakenObstacle;
use super::take::{Take, extent};

/// Nodes and meshes of obstacles.
#[derive(Default)]
pub(super) struct Bodies {
    pub(super) nodes: Vec<Value>,
    pub(super) meshes: Vec<Value>,
}

/// An obstacle, its number among them, and that of its node.
struct BodyAt<'a, 'b> {
    take: &'a Take<'b>,
    obstacle: &'a TakenObstacle<'b>,
    number: usize,
    node: usize,
}

impl Bodies {
    /// The obstacles of `take`, whose nodes are numbered from `first`; their motion becomes part of
    /// the animation.
    pub(super) fn of(
        take: &Take<'_>,
        first: usize,
        accessors: &mut Accessors<'_>,
        mut animation: Option<&mut Value>,
    ) -> Self {
        let mut bodies = Self::default();
        for (number, obstacle) in take.obstacles().iter().enumerate() {
            let node = first + number;
            let at = BodyAt {
                take,
                obstacle,
                number,
                node,
            };
            bodies.add(&at, accessors, animation.as_deref_mut());
        }
        bodies
    }

    fn add(
        &mut self,
        at: &BodyAt<'_, '_>,
        accessors: &mut Accessors<'_>,
        animation: Option<&mut Value>,
    ) {
        let &BodyAt {
            take,
            obstacle,
            number,
            ..
        } = at;
        let name = &obstacle.name;
        let corners = 3 * obstacle.faces().len();
        let indices = accessors.add(Part::BodyIndices(number), 0, corners);
        let is_rigid = obstacle.rigid_points().is_some();
        let frames = if is_rigid {
            1
        } else {
            obstacle.frame_count(take)
        };
        let first = match obstacle.rigid_points() {
            Some(points) => points.to_vec(),
            None => obstacle.positions(take, 0),
        };
        let mut shapes = shapes(at, &first, frames, accessors);
        let mut primitive = json!({
            "attributes": shapes.remove(0), "indices": indices, "material": 1,
        });
        let mut mesh = json!({ "name": name });
        if !shapes.is_empty() {
            mesh["weights"] = json!(vec![0; shapes.len()]);
            primitive["targets"] = json!(shapes);
        }
        mesh["primitives"] = json!([primitive]);
        let mut json = json!({ "name": name, "mesh": 1 + number });
        if let Some((turn, place)) = obstacle.pose(take, 0) {
            json["rotation"] = json!(turn.to_array());
            json["translation"] = json!(place.to_array());
        }
        if let Some(animation) = animation.filter(|_| !obstacle.is_still()) {
            animate(animation, at, accessors);
        }
        self.nodes.push(json);
        self.meshes.push(mesh);
    }
}

/// Adds the motion of an obstacle to the animation, whose first sampler has the times and weights
/// of the cloth.
fn animate(animation: &mut Value, at: &BodyAt<'_, '_>, accessors: &mut Accessors<'_>) {
    let keys = at.take.len();
    let times = animation["samplers"][0]["input"].clone();
    let mut samplers = animation["samplers"]
        .as_array()
        .cloned()
        .unwrap_or_default();
    let mut channels = animation["channels"]
        .as_array()
        .cloned()
        .unwrap_or_default();
    if at.obstacle.rigid_points().is_some() {
        let turns = accessors.add(Part::BodyTurns(at.number), 0, keys);
        let places = accessors.add(Part::BodyPlaces(at.number), 0, keys);
        for (output, path) in [(turns, "rotation"), (places, "translation")] {
            channels.push(channel(samplers.len(), at.node, path));
            samplers.push(json!({
                "input": times, "output": output, "interpolation": "LINEAR",
            }));
        }
    } else {
        channels.push(channel(0, at.node, "weights"));
    }
    animation["samplers"] = json!(samplers);
    animation["channels"] = json!(channels);
}

/// The first frame as the attributes of a mesh, and the further ones as its morph targets.
fn shapes(
    at: &BodyAt<'_, '_>,
    first: &[Vec3],
    frames: usize,
    accessors: &mut Accessors<'_>,
) -> Vec<Value> {
    let count = first.len();
    let shape = |frame: usize| {
        let part = Part::BodyPoints(at.number);
        let position = accessors.add(part, 12 * count * frame, count);
        let mut moved = first.to_vec();
        if frame > 0 {
            moved = at.obstacle.positions(at.take, frame);
            moved.iter_mut().zip(first).for_each(|(p, f)| *p -= *f);
        }
        let [low, high] = extent(&moved);
        accessors.bound(position, &low.to_array(), &high.to_array());
        json!({ "POSITION": position })
    };
    (0..frames).map(shape).collect()
}
