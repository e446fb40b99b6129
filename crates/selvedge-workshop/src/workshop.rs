//! Makes cloths ready for the viewer: a scene, perhaps with another mesh or material, its rest
//! pose, and a model.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{anyhow, bail, ensure};
use selvedge::machine::Machine;
use selvedge::start::Start;
use selvedge::{Error, Event, cause, domain};
use selvedge_assets::MODELS;
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::motion::named;
use selvedge_cloth::{Cloth, HandleSchedule, Motion, Scene};
use selvedge_data::{
    LoadedScene, MeshSpec, StartSpec, materials, open_material, open_scene, shipped_scenes,
};
use selvedge_live::{Catalogue, LiveError, MeshOrder, Order, ReadyCloth, Workshop};
use selvedge_model::Model;
use selvedge_sim::{Checkpoint, SagError};

use super::bodies;
use super::cloth::SceneMovers;
use super::movers::ModelOnMachine;

/// Numbers of vertices to choose from; the shipped model's is among them.
const VERTICES: [usize; 5] = [150, 289, 400, 600, 1024];
/// Numbers of vertices that may be asked for.
const VERTICES_ALLOWED: std::ops::RangeInclusive<usize> = 20..=4096;

/// Knows the scenes and models that may be shown.
pub struct SceneWorkshop {
    scenes: Vec<String>,
    models: Vec<selvedge::Model>,
    machine: Machine,
}

impl SceneWorkshop {
    /// A workshop for `scene`, the shipped ones, and models from files beside the shipped
    /// ones, which run on `machine`.
    pub fn new(scene: &str, models: &[PathBuf], machine: Machine) -> anyhow::Result<Self> {
        // What cannot be opened is said here, and not in a page that begins empty.
        open_scene(scene)?;
        let mut scenes = vec![scene.to_owned()];
        let shipped = shipped_scenes().iter().map(|(name, _)| (*name).to_owned());
        scenes.extend(shipped.filter(|name| name != scene));
        let mut opened: Vec<selvedge::Model> = Vec::new();
        for file in models {
            opened.push(selvedge::Model::open(Some(file))?);
        }
        for (name, _) in MODELS {
            if opened.iter().any(|model| model.name == *name) {
                continue;
            }
            opened.push(selvedge::Model::open(Some(name.as_ref()))?);
        }
        Ok(Self {
            scenes,
            models: opened,
            machine,
        })
    }

    /// The order that is shown at first.
    pub fn first_order(&self) -> Order {
        Order {
            scene: self.scenes[0].clone(),
            mesh: None,
            material: None,
            model: self.models[0].name.clone(),
            touches: false,
        }
    }

    fn make_ready(
        &self,
        order: &Order,
        progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    ) -> anyhow::Result<ReadyCloth> {
        // Only what was named at the start may be opened, whatever a page asks for.
        if !self.scenes.contains(&order.scene) {
            bail!("there is no scene {:?} here", order.scene);
        }
        let model = self.models.iter().find(|model| model.name == order.model);
        let model = model.ok_or_else(|| anyhow!("there is no model {:?} here", order.model))?;
        let (name, model) = (model.name.clone(), Arc::clone(&model.model));
        let mut loaded = open_scene(&order.scene)?;
        let mut remarks = std::mem::take(&mut loaded.warnings);
        change(&mut loaded, order, &mut remarks)?;
        bodies::put(&mut loaded, order)?;
        let start = beginning(&loaded, progress, &mut remarks)?;
        let rest = match loaded.spec.start {
            StartSpec::Rest => &start.positions[..],
            // Of a rest pose that is not needed for the start the mesh takes the place.
            _ => loaded.scene.mesh.positions(),
        };
        let rest = selvedge::rounded(rest);
        let LoadedScene { spec, scene, .. } = loaded;
        let led = Scene {
            motion: Motion::still(1.0),
            schedule: HandleSchedule::default(),
            ..scene.clone()
        };
        remarks.extend(beyond_training(&name, &model, &led)?);
        let cloth = Arc::new(Cloth::of_scene(&scene, rest)?);
        Ok(ReadyCloth {
            cloth: Arc::clone(&cloth),
            frame_rate: scene.frame_rate,
            environment: scene.environment,
            scene_path: scene.handle_path()?,
            start_frame: start.frame,
            remarks,
            bodies: bodies::of(&scene),
            movers: Box::new(SceneMovers {
                spec,
                scene,
                led: Arc::new(led),
                cloth,
                start,
                model_name: name,
                model: ModelOnMachine {
                    model,
                    machine: self.machine.clone(),
                },
            }),
        })
    }
}

/// Where the scene begins. A cloth that nothing holds has no rest pose: its mesh takes the place.
fn beginning(
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    remarks: &mut Vec<String>,
) -> anyhow::Result<Checkpoint> {
    let scene = selvedge::Scene::from(loaded.clone());
    let is_held = !loaded.scene.handles.is_empty();
    if !is_held {
        remarks.push("nothing holds this cloth: it falls".to_owned());
    }
    let found = if !is_held && scene.begins_at_rest() {
        None
    } else {
        match start(&scene, progress) {
            Err(error) if is_without_rest(&error) => {
                let problem = cause::chain(&error);
                remarks.push(format!("{problem}: its mesh takes the place"));
                None
            }
            found => Some(found?),
        }
    };
    let Some(found) = found else {
        let mesh = loaded.scene.mesh.positions().to_vec();
        return Ok(Checkpoint::at_rest(mesh));
    };
    remarks.extend(found.remarks);
    remarks.extend(found.warnings);
    Ok(found.state)
}

/// The start of a scene; `progress` hears of its task and how far that is.
fn start(
    scene: &selvedge::Scene,
    progress: &mut dyn FnMut(String) -> ControlFlow<()>,
) -> Result<Start, Error> {
    let vertices = scene.built().mesh.positions().len();
    let (mut task, mut flow) = (String::new(), ControlFlow::Continue(()));
    scene.start(&mut |event| {
        match event {
            Event::Begun { task: begun, .. } => task = format!("{begun}, {vertices} vertices"),
            Event::Noted(now) => flow = progress(format!("{task}: {now}")),
            _ => {}
        }
        flow
    })
}

impl Workshop for SceneWorkshop {
    fn catalogue(&self) -> Catalogue {
        let names = |of: &[&str]| of.iter().map(|name| (*name).to_owned()).collect();
        Catalogue {
            scenes: self.scenes.clone(),
            meshes: named_sheets().iter().map(|s| s.name.to_owned()).collect(),
            vertices: VERTICES.to_vec(),
            materials: materials()
                .iter()
                .map(|(name, _)| (*name).to_owned())
                .collect(),
            models: self.models.iter().map(|model| model.name.clone()).collect(),
            motions: names(&named::names()),
        }
    }

    fn prepare(
        &mut self,
        order: &Order,
        progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    ) -> Result<Box<ReadyCloth>, LiveError> {
        let made = self.make_ready(order, progress);
        made.map(Box::new)
            .map_err(|error| LiveError::new(cause::chain(error.as_ref())))
    }
}

/// Returns `true` where there is no rest pose to find: of a cloth whose handles have all let go.
fn is_without_rest(error: &Error) -> bool {
    match error {
        Error::NoRest(cause) => is_without_rest(cause),
        Error::Rest { source, .. } => matches!(source, SagError::NoHandles),
        _ => false,
    }
}

/// Puts the mesh and the material that are ordered into the scene.
fn change(
    loaded: &mut LoadedScene,
    order: &Order,
    remarks: &mut Vec<String>,
) -> anyhow::Result<()> {
    if order.mesh.is_none() && order.material.is_none() {
        return Ok(());
    }
    if let Some(name) = &order.material {
        let is_known = materials().iter().any(|(known, _)| known == name);
        ensure!(is_known, "there is no material {name:?} here");
        loaded.spec.setting.material = open_material(name)?;
    }
    if let Some(mesh) = &order.mesh {
        put_mesh(loaded, mesh)?;
    }
    // A mesh file stands beside the scene's own file.
    let folder = Path::new(&order.scene).parent().unwrap_or(Path::new(""));
    loaded.scene = match loaded.spec.build(folder) {
        Ok(scene) => scene,
        Err(_) if order.mesh.is_some() => {
            loaded.spec.motion = Motion::still(10.0);
            remarks.push("the scene's own motion does not fit this mesh".to_owned());
            loaded.spec.build(folder)?
        }
        Err(error) => return Err(error.into()),
    };
    Ok(())
}

fn put_mesh(loaded: &mut LoadedScene, order: &MeshOrder) -> anyhow::Result<()> {
    let (name, vertices) = (&order.name, order.vertices);
    let sheet = NamedSheet::by_name(name);
    let sheet = sheet.ok_or_else(|| anyhow!("there is no mesh {name:?} here"))?;
    if !VERTICES_ALLOWED.contains(&vertices) {
        bail!(
            "a mesh has {} to {} vertices here, not {vertices}",
            VERTICES_ALLOWED.start(),
            VERTICES_ALLOWED.end()
        );
    }
    let spec = MeshSpec::from(sheet.of(vertices, 1));
    let made = spec.build(Path::new(""))?;
    let handles = made.labels.get(sheet.handles);
    let handles = handles.ok_or_else(|| anyhow!("mesh {name} has no {}", sheet.handles))?;
    let setting = &mut loaded.spec.setting;
    setting.handles.clone_from(handles);
    setting.mesh = spec;
    setting.schedule = HandleSchedule::default();
    loaded.spec.start = StartSpec::Rest;
    loaded.state = None;
    Ok(())
}

/// A remark where `model` meets a cloth that it was not trained on; none where its file does not
/// say what it was trained on.
fn beyond_training(name: &str, model: &Model, scene: &Scene) -> anyhow::Result<Option<String>> {
    let Some(beyond) = domain::of_scene(model, scene, 1)? else {
        return Ok(None);
    };
    let words: Vec<&str> = beyond.departures.iter().map(|d| d.words.as_str()).collect();
    Ok((!words.is_empty()).then(|| {
        format!(
            "the model {name} was not trained on such a cloth: {}; what it makes of it is a guess",
            words.join("; ")
        )
    }))
}
