//! One cloth that a program moves, frame by frame.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, HandleTargets, Scene, Stepper};
use selvedge_data::{LoadedScene, SavedState, open_scene, parse_scene};
use selvedge_guard::Correction;
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::physics::rounded;
use selvedge_lab::start::{self, simulator_of_run};
use wasm_bindgen::prelude::*;

use crate::told;

/// Targets of the handles per frame.
const SAMPLES: usize = 4;

/// A cloth of a scene, moved by the solver or by a learned model, as `selvedge run` moves it.
#[wasm_bindgen]
pub struct Cloth {
    scene: Arc<Scene>,
    warnings: Vec<String>,
    path: HandlePath,
    start: SavedState,
    model: Option<NamedModel>,
    stepper: Box<dyn Stepper>,
    frame: usize,
}

#[wasm_bindgen]
impl Cloth {
    /// The cloth of a scene: the name of a shipped one, or the text of a scene's file. It is moved
    /// by the shipped model of that name, or by the solver where there is none. Finding its rest
    /// pose may take a second.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, model: Option<String>) -> Result<Cloth, JsError> {
        let mut loaded = match scene.contains('\n') {
            true => parse_scene(scene, Path::new(""), "the scene").map_err(told)?,
            false => open_scene(scene).map_err(told)?,
        };
        let model = match model {
            Some(name) => Some(NamedModel::open(Some(name.as_ref())).map_err(told)?),
            None => None,
        };
        if model.is_some() {
            start::for_model(&mut loaded);
        }
        let found = start::find(&loaded, &mut |_| ControlFlow::Continue(())).map_err(told)?;
        let start = found.state;
        let LoadedScene {
            scene, warnings, ..
        } = loaded;
        let scene = Arc::new(scene);
        Ok(Self {
            path: scene.handle_path().map_err(told)?,
            stepper: stepper(&scene, &start, model.as_ref())?,
            frame: start.frame,
            scene,
            warnings,
            start,
            model,
        })
    }

    /// One frame on. The handles go to `targets` (x, y, z of each `[m]`), or without it along the
    /// scene's own motion.
    pub fn step(&mut self, targets: Option<Vec<f64>>) -> Result<(), JsError> {
        let targets = match targets {
            None => self.path.targets(self.frame, SAMPLES).map_err(told)?,
            Some(numbers) => {
                let wanted = 3 * self.scene.handles.len();
                if numbers.len() != wanted {
                    let count = numbers.len();
                    return Err(JsError::new(&format!(
                        "the targets are {count} numbers, not {wanted}: x, y and z of each handle"
                    )));
                }
                let (points, _) = numbers.as_chunks();
                let points = points.iter().map(|point| DVec3::from_array(*point));
                HandleTargets::at_frame_end(points.collect()).map_err(told)?
            }
        };
        self.stepper.step(&targets).map_err(told)?;
        self.frame += 1;
        Ok(())
    }

    /// Back to the start.
    pub fn reset(&mut self) -> Result<(), JsError> {
        self.stepper = stepper(&self.scene, &self.start, self.model.as_ref())?;
        self.frame = self.start.frame;
        Ok(())
    }

    /// Where the positions lie in the module's memory: `3 * vertexCount` numbers of 32 bits `[m]`.
    /// They lie elsewhere after a step.
    #[wasm_bindgen(js_name = positionsOffset)]
    pub fn positions_offset(&self) -> usize {
        self.stepper.positions().as_ptr().addr()
    }

    /// Vertices.
    #[wasm_bindgen(getter, js_name = vertexCount)]
    pub fn vertex_count(&self) -> usize {
        self.stepper.positions().len()
    }

    /// Corners of the faces, three vertices each.
    #[wasm_bindgen(getter)]
    pub fn faces(&self) -> Vec<u32> {
        self.stepper
            .topology()
            .face_indices()
            .as_flattened()
            .to_vec()
    }

    /// The held vertices.
    #[wasm_bindgen(getter)]
    pub fn handles(&self) -> Vec<u32> {
        let handles = self.scene.handles.vertices().iter();
        handles.map(|vertex| vertex.0).collect()
    }

    /// Frames per second.
    #[wasm_bindgen(getter, js_name = frameRate)]
    pub fn frame_rate(&self) -> f64 {
        self.scene.frame_rate
    }

    /// The number of the frame, along the scene's own motion.
    #[wasm_bindgen(getter)]
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Points of all bodies beside the cloth now `[m]`, x, y and z of each.
    #[wasm_bindgen(js_name = bodyPoints)]
    pub fn body_points(&self) -> Vec<f32> {
        let time = self.frame as f64 / self.scene.frame_rate;
        let bodies = self.scene.obstacles.iter();
        let points: Vec<DVec3> = bodies.flat_map(|body| body.positions_at(time)).collect();
        rounded(&points).iter().flat_map(Vec3::to_array).collect()
    }

    /// Corners of the bodies' faces, three points each, in the order of [`Self::body_points`].
    #[wasm_bindgen(getter, js_name = bodyFaces)]
    pub fn body_faces(&self) -> Vec<u32> {
        let mut first = 0;
        let mut faces = Vec::new();
        for body in &self.scene.obstacles {
            faces.extend(
                body.faces()
                    .as_flattened()
                    .iter()
                    .map(|point| first + point),
            );
            first += body.positions_at(0.0).count() as u32;
        }
        faces
    }

    /// Warnings of what the scene asks for and does not get, one a line; empty where there are none.
    #[wasm_bindgen(getter)]
    pub fn warnings(&self) -> String {
        self.warnings.join("\n")
    }
}

fn stepper(
    scene: &Arc<Scene>,
    start: &SavedState,
    model: Option<&NamedModel>,
) -> Result<Box<dyn Stepper>, JsError> {
    Ok(match model {
        None => Box::new(simulator_of_run(scene, start.clone()).map_err(told)?),
        Some(model) => {
            let settings = Correction::default();
            let rest = &start.positions;
            let stepper = start::guarded(scene, rest, model, &Machine::Cpu, settings);
            Box::new(stepper.map_err(told)?)
        }
    })
}
