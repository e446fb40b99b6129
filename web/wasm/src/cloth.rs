//! One cloth that a program moves, frame by frame.

use glam::{DVec3, Vec3};
use selvedge::{HandleTargets, Model, Rigid, Run, Scene, Snapshot, Stepper, rounded};
use wasm_bindgen::prelude::*;

use crate::js_error;

/// A cloth of a scene, moved by the solver or by a learned model, as `selvedge run` moves it.
#[wasm_bindgen]
pub struct Cloth {
    run: Run,
}

/// A state of a cloth, to go back to.
#[wasm_bindgen]
pub struct ClothSnapshot(Snapshot);

#[wasm_bindgen]
impl Cloth {
    /// The cloth of a scene: the name of a shipped one, or the text of a scene's file. It is moved
    /// by the shipped model of that name, or by the solver where there is none. Finding its rest
    /// pose may take a second.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, model: Option<String>) -> Result<Cloth, JsError> {
        let scene = if scene.contains('\n') { Scene::parse(scene) } else { Scene::named(scene) };
        let scene = scene.map_err(js_error)?;
        let run = match model {
            None => Run::new(&scene),
            Some(name) => {
                Model::open(Some(name.as_ref())).and_then(|model| Run::of_model(&scene, &model))
            }
        };
        Ok(Self {
            run: run.map_err(js_error)?,
        })
    }

    /// One frame on. The handles go to `targets` (x, y, z of each `[m]`), or without it along the
    /// scene's own motion.
    pub fn step(&mut self, targets: Option<Vec<f64>>) -> Result<(), JsError> {
        let Some(numbers) = targets else {
            return self.run.step().map_err(js_error);
        };
        let wanted = 3 * self.run.handles().len();
        if numbers.len() != wanted {
            let count = numbers.len();
            return Err(JsError::new(&format!(
                "the targets are {count} numbers, not {wanted}: x, y and z of each handle"
            )));
        }
        let (points, _) = numbers.as_chunks();
        let points = points.iter().map(|point| DVec3::from_array(*point));
        let targets = HandleTargets::at_frame_end(points.collect()).map_err(js_error)?;
        self.run.step_to(&targets).map_err(js_error)
    }

    /// Leads a body, of its number in the scene, in the next frame away from its own path, by the
    /// rigid motion of a 4×4 matrix, by columns.
    #[wasm_bindgen(js_name = leadBody)]
    pub fn lead_body(&mut self, body: usize, matrix: &[f64]) -> Result<(), JsError> {
        let away = Rigid::try_from(matrix).map_err(js_error)?;
        self.run.lead_obstacle(body, away).map_err(js_error)
    }

    /// Sets the cloth elsewhere, and with it the bodies of these numbers, by such a matrix.
    pub fn teleport(&mut self, matrix: &[f64], bodies: &[usize]) -> Result<(), JsError> {
        let to = Rigid::try_from(matrix).map_err(js_error)?;
        self.run.teleport(to, bodies).map_err(js_error)
    }

    /// Back to the start.
    pub fn reset(&mut self) -> Result<(), JsError> {
        self.run.reset().map_err(js_error)
    }

    /// The state now, for [`Self::restore`].
    pub fn snapshot(&self) -> Option<ClothSnapshot> {
        self.run.snapshot().map(ClothSnapshot)
    }

    /// Back to a snapshot of this cloth.
    pub fn restore(&mut self, snapshot: &ClothSnapshot) -> Result<(), JsError> {
        self.run.restore(&snapshot.0).map_err(js_error)
    }

    /// Where the positions lie in the module's memory: `3 * vertexCount` numbers of 32 bits `[m]`.
    /// They lie elsewhere after a step.
    #[wasm_bindgen(js_name = positionsOffset)]
    pub fn positions_offset(&self) -> usize {
        self.run.positions().as_ptr().addr()
    }

    /// Vertices.
    #[wasm_bindgen(getter, js_name = vertexCount)]
    pub fn vertex_count(&self) -> usize {
        self.run.positions().len()
    }

    /// Corners of the faces, three vertices each.
    #[wasm_bindgen(getter)]
    pub fn faces(&self) -> Vec<u32> {
        self.run.topology().face_indices().as_flattened().to_vec()
    }

    /// The held vertices.
    #[wasm_bindgen(getter)]
    pub fn handles(&self) -> Vec<u32> {
        let handles = self.run.handles().vertices().iter();
        handles.map(|vertex| vertex.0).collect()
    }

    /// Targets of the handles per frame along the scene's own motion: the substeps of the solver.
    #[wasm_bindgen(getter)]
    pub fn samples(&self) -> usize {
        self.run.samples()
    }

    /// Frames per second.
    #[wasm_bindgen(getter, js_name = frameRate)]
    pub fn frame_rate(&self) -> f64 {
        self.run.scene().built().frame_rate
    }

    /// The number of the frame, along the scene's own motion.
    #[wasm_bindgen(getter)]
    pub fn frame(&self) -> usize {
        self.run.frame()
    }

    /// Points of all bodies beside the cloth now `[m]`, x, y and z of each.
    #[wasm_bindgen(js_name = bodyPoints)]
    pub fn body_points(&self) -> Vec<f32> {
        rounded(&self.run.obstacle_points())
            .iter()
            .flat_map(Vec3::to_array)
            .collect()
    }

    /// Corners of the bodies' faces, three points each, in the order of [`Self::body_points`].
    #[wasm_bindgen(getter, js_name = bodyFaces)]
    pub fn body_faces(&self) -> Vec<u32> {
        let mut first = 0;
        let mut faces = Vec::new();
        for body in &self.run.scene().built().obstacles {
            let corners = body.faces().as_flattened().iter();
            faces.extend(corners.map(|point| first + point));
            first += body.positions_at(0.0).count() as u32;
        }
        faces
    }

    /// All that is to be known of this run so far, one warning a line; empty where there is none.
    #[wasm_bindgen(getter)]
    pub fn warnings(&self) -> String {
        self.run.warnings().join("\n")
    }
}
