//! One cloth that a program moves, frame by frame.

use std::ops::ControlFlow;
use std::path::Path;

use glam::DVec3;
use selvedge_cloth::{HandlePath, HandleTargets};
use selvedge_data::{open_scene, parse_scene};
use selvedge_lab::machine::Machine;
use selvedge_live::{
    Hold, LiveStepper, MoverKind, Order, ReadyCloth, SceneWorkshop, Start, Workshop,
};
use wasm_bindgen::prelude::*;

use crate::told;

/// Targets of the handles per frame.
const SAMPLES: usize = 4;

/// A cloth of a scene, moved by the solver or by a learned model.
#[wasm_bindgen]
pub struct Cloth {
    ready: Box<dyn ReadyCloth>,
    path: HandlePath,
    hold: Hold,
    stepper: Box<dyn LiveStepper>,
    kind: MoverKind,
    frame: usize,
}

#[wasm_bindgen]
impl Cloth {
    /// The cloth of a scene: the name of a shipped one, or the text of a scene's file. It is moved
    /// by the shipped model of that name, or by the solver where there is none. Finding its rest
    /// pose may take a second.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, model: Option<String>) -> Result<Cloth, JsError> {
        let loaded = match scene.contains('\n') {
            true => parse_scene(scene, Path::new(""), "the scene").map_err(told)?,
            false => open_scene(scene).map_err(told)?,
        };
        let mut workshop = SceneWorkshop::with(loaded, Machine::Cpu).map_err(told)?;
        let first = workshop.first_order();
        let (kind, order) = match model {
            Some(model) => (MoverKind::Model, Order { model, ..first }),
            None => (MoverKind::Physics, first),
        };
        let ready = workshop
            .prepare(&order, &mut |_| ControlFlow::Continue(()))
            .map_err(told)?;
        let hold = Hold {
            handles: ready.cloth().handles().clone(),
            environment: ready.environment(),
        };
        let stepper = ready.start(kind, Start::Beginning, &hold).map_err(told)?;
        Ok(Self {
            path: ready.scene_path().map_err(told)?,
            frame: ready.start_frame(),
            ready,
            hold,
            stepper,
            kind,
        })
    }

    /// One frame on. The handles go to `targets` (x, y, z of each `[m]`), or without it along the
    /// scene's own motion.
    pub fn step(&mut self, targets: Option<Vec<f64>>) -> Result<(), JsError> {
        let targets = match targets {
            None => self.path.targets(self.frame, SAMPLES).map_err(told)?,
            Some(numbers) => {
                let wanted = 3 * self.hold.handles.len();
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
        let start = self.ready.start(self.kind, Start::Beginning, &self.hold);
        self.stepper = start.map_err(told)?;
        self.frame = self.ready.start_frame();
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
        let cloth = self.ready.cloth();
        cloth.topology().face_indices().as_flattened().to_vec()
    }

    /// The held vertices.
    #[wasm_bindgen(getter)]
    pub fn handles(&self) -> Vec<u32> {
        let handles = self.hold.handles.vertices().iter();
        handles.map(|vertex| vertex.0).collect()
    }

    /// Frames per second.
    #[wasm_bindgen(getter, js_name = frameRate)]
    pub fn frame_rate(&self) -> f64 {
        self.ready.frame_rate()
    }

    /// The number of the frame, along the scene's own motion.
    #[wasm_bindgen(getter)]
    pub fn frame(&self) -> usize {
        self.frame
    }

    /// Points of all bodies beside the cloth `[m]`, x, y and z of each.
    #[wasm_bindgen(js_name = bodyPoints)]
    pub fn body_points(&self) -> Vec<f32> {
        let points = self.stepper.body_points();
        points.iter().flat_map(|point| point.to_array()).collect()
    }

    /// Corners of the bodies' faces, three points each, in the order of [`Self::body_points`].
    #[wasm_bindgen(getter, js_name = bodyFaces)]
    pub fn body_faces(&self) -> Vec<u32> {
        let mut first = 0;
        let mut faces = Vec::new();
        for body in self.ready.bodies() {
            faces.extend(body.faces.as_flattened().iter().map(|point| first + point));
            first += body.points as u32;
        }
        faces
    }

    /// Remarks on the scene, one a line; empty where there are none.
    #[wasm_bindgen(getter)]
    pub fn remarks(&self) -> String {
        self.ready.remarks().join("\n")
    }
}
