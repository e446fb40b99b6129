//! Small irregular cloths for the tests of this crate, hanging and rippled, and models.

use glam::{DVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use selvedge_cloth::generate::square;
use selvedge_cloth::{BendTable, Cloth, Environment, Handles, Material, StretchTable};

use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;
use crate::network::Network;
use crate::rollout::{Model, Normalizers};
use crate::spec::ModelSpec;

/// A cloth and the air around it, of which a graph is made.
#[derive(Clone)]
pub(crate) struct Hanging {
    pub(crate) cloth: Cloth,
    pub(crate) environment: Environment,
}

impl Hanging {
    /// The graph of [`fabric`] at 60 frames per second.
    pub(crate) fn graph(&self) -> ClothGraph {
        let graph = ClothGraph::new(&self.cloth, self.environment, 60.0).expect("a graph");
        let faces = graph.topology().faces().len();
        let graph = graph.with_materials(&vec![&fabric(); faces]);
        graph.expect("a material per face")
    }

    /// The same with another rest pose `[m]`, `[vertices]`.
    pub(crate) fn at_rest(&self, positions: Vec<Vec3>) -> Self {
        let cloth = self.cloth.clone().with_rest_positions(positions);
        Self {
            cloth: cloth.expect("a rest pose"),
            ..*self
        }
    }
}

/// A fabric that stiffens, and whose directions differ.
pub(crate) fn fabric() -> Material {
    Material {
        name: "fabric".to_owned(),
        source: String::new(),
        density: 0.15,
        damping: 0.0,
        stretch: StretchTable([
            [17.0, -15.0, 34.0, 37.0],
            [46.0, 54.0, 261.0, -30.0],
            [49.0, 88.0, 206.0, 23.0],
            [124.0, 105.0, 366.0, 44.0],
            [140.0, 74.0, 414.0, 17.0],
            [127.0, 86.0, 406.0, 32.0],
        ]),
        bend: BendTable([
            [2.3e-5, 3.3e-5, 3.4e-5, 3.9e-5, 2.3e-5],
            [2.5e-5, 1.9e-5, 1.6e-5, 2.5e-5, 0.9e-5],
            [1.4e-5, 0.7e-5, 1.5e-5, 2.5e-5, 1.9e-5],
        ]),
        compression: selvedge_cloth::Compression::default(),
    }
}

/// A hanging square of `side`² vertices, its handles the upper corners (right one first), at rest
/// slightly rippled; the air moves.
pub(crate) fn parts(side: usize, seed: u64) -> Hanging {
    let vertices = side * side;
    let sheet = square(vertices, 1.0, seed).expect("a square");
    let [left, right] = sheet.labels["upper-corners"][..] else {
        panic!("two upper corners");
    };
    let handles = Handles::new(&[right, left], vertices).expect("two corners");
    let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).expect("a cloth");
    let ripple = |p: &DVec3| DVec3::new(0.05 * (9.0 * p.z).sin() * p.y, p.y, p.z);
    let positions = sheet.mesh.positions().iter();
    let flat = Hanging {
        cloth,
        environment: Environment {
            wind: DVec3::new(0.4, 0.1, -0.7),
            air_drag: 0.3,
            ..Environment::default()
        },
    };
    flat.at_rest(positions.map(|p| ripple(p).as_vec3()).collect())
}

/// A model of random weights.
pub(crate) fn model(spec: &ModelSpec, normalizers: Normalizers, training: &str) -> Model {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let network = Network::new(spec).expect("a valid spec");
    let weights = network.initialise(&mut || rng.random::<f64>());
    Model::new(spec, weights, normalizers, training.to_owned()).expect("a model")
}

/// `positions` moved at random by up to `size` `[m]` per coordinate.
pub(crate) fn shaken(positions: &[Vec3], size: f32, seed: u64) -> Vec<Vec3> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || size * (2.0 * rng.random::<f32>() - 1.0);
    positions
        .iter()
        .map(|&p| p + Vec3::new(draw(), draw(), draw()))
        .collect()
}

/// `positions` turned about the vertical and moved, rounded once.
pub(crate) fn turn(positions: &[Vec3], yaw: Yaw, by: Vec3) -> Vec<Vec3> {
    positions
        .iter()
        .map(|p| (yaw.to_world_f64(p.as_dvec3()) + by.as_dvec3()).as_vec3())
        .collect()
}
