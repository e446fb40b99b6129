//! Makes cloths ready for the viewer: a scene, perhaps with another mesh or material, its rest
//! pose, and a model.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, anyhow, bail};
use glam::DVec3;
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::motion::named;
use selvedge_cloth::{Cloth, HandleSchedule, Motion, Scene};
use selvedge_data::{
    LoadedScene, MeshSpec, SavedState, StartSpec, materials, open_scene, shipped_scenes,
};
use selvedge_lab::cause;
use selvedge_lab::fitting;
use selvedge_lab::machine::Machine;
use selvedge_lab::models::NamedModel;
use selvedge_lab::{assets, domain, physics, rest_pose};
use selvedge_live::{Catalogue, LiveError, MeshOrder, Order, ReadyCloth, Workshop};
use selvedge_model::Model;
use selvedge_sim::{FitProgress, SagError};

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
    models: Vec<NamedModel>,
    machine: Machine,
}

impl SceneWorkshop {
    /// A workshop for `scene`, the shipped ones, and models from files beside the shipped
    /// ones, which run on `machine`.
    pub fn new(scene: &str, models: &[PathBuf], machine: Machine) -> anyhow::Result<Self> {
        let mut scenes = vec![scene.to_owned()];
        let shipped = shipped_scenes().iter().map(|(name, _)| (*name).to_owned());
        scenes.extend(shipped.filter(|name| name != scene));
        let mut opened: Vec<NamedModel> = Vec::new();
        for file in models {
            opened.push(NamedModel::open(Some(file))?);
        }
        for (name, _) in assets::MODELS {
            if opened.iter().any(|model| model.name == *name) {
                continue;
            }
            opened.push(NamedModel::open(Some(name.as_ref()))?);
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
        let (rest, start) = rest_and_start(&loaded, progress, &mut remarks)?;
        let LoadedScene { spec, scene, .. } = loaded;
        let led = Scene {
            motion: Motion::still(1.0),
            schedule: HandleSchedule::default(),
            ..scene.clone()
        };
        remarks.extend(beyond_training(&name, &model, &led)?);
        let cloth = Arc::new(Cloth::of_scene(&scene, physics::rounded(&rest))?);
        Ok(ReadyCloth {
            cloth: Arc::clone(&cloth),
            frame_rate: scene.frame_rate,
            environment: scene.environment,
            scene_path: Arc::new(scene.handle_path()?),
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

/// The rest pose and where the scene starts, both `[m]`. A cloth that nothing holds has no rest
/// pose: its mesh takes the place, also of a rest pose that is not needed for the start, which
/// nobody waits for.
fn rest_and_start(
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    remarks: &mut Vec<String>,
) -> anyhow::Result<(Vec<DVec3>, SavedState)> {
    let scene = &loaded.scene;
    let is_held = !scene.handles.is_empty();
    if !is_held {
        remarks.push("nothing holds this cloth: it falls".to_owned());
    }
    let starts_in_it = loaded.spec.start == StartSpec::Rest && loaded.state.is_none();
    let rest = if !is_held || !starts_in_it {
        scene.mesh.positions().to_vec()
    } else {
        match rest(loaded, progress) {
            Ok(rest) => rest,
            Err(error) if !is_without_rest(&error) => return Err(error),
            Err(error) => {
                let problem = cause::chain(error.as_ref());
                remarks.push(format!("{problem}: its mesh takes the place"));
                scene.mesh.positions().to_vec()
            }
        }
    };
    let start = match (&loaded.state, &loaded.spec.start) {
        (Some(state), _) => state.clone(),
        (None, StartSpec::Rest) => SavedState::at_rest(rest.clone()),
        (None, _) => made_ready(loaded, progress, remarks)?,
    };
    Ok((rest, start))
}

/// The rest pose of a scene `[m]`.
fn rest(
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(String) -> ControlFlow<()>,
) -> anyhow::Result<Vec<DVec3>> {
    let vertices = loaded.scene.mesh.positions().len();
    let found = rest_pose::found(&loaded.scene, &mut |now| {
        progress(format!(
            "{vertices} vertices sag to rest: {:.1e} of {:.0e} m/s² left",
            now.residual, now.tolerance
        ))
    });
    let context = || format!("the rest pose of scene {:?}", loaded.scene.name);
    Ok(found.with_context(context)?.0.positions)
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

/// The cloth where its motion begins, made ready from its mesh, with remarks on what was done.
fn made_ready(
    loaded: &LoadedScene,
    progress: &mut dyn FnMut(String) -> ControlFlow<()>,
    remarks: &mut Vec<String>,
) -> anyhow::Result<SavedState> {
    let mut listener = |what: &str, now: FitProgress| {
        let done = 100.0 * now.done;
        progress(format!("{what}: {done:.0} % done, {}", fitting::state(now)))
    };
    let fitted = fitting::fit_told(loaded, &mut listener)?;
    remarks.extend(fitted.remarks);
    remarks.extend(fitted.warning);
    Ok(SavedState::at_rest(fitted.positions))
}

/// Returns `true` where there is no rest pose to find: of a cloth whose handles have all let go.
fn is_without_rest(error: &anyhow::Error) -> bool {
    let error = error.downcast_ref::<SagError>();
    matches!(error, Some(SagError::NoHandles))
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
        let known = materials().iter().find(|(known, _)| known == name);
        let (_, text) = known.ok_or_else(|| anyhow!("there is no material {name:?} here"))?;
        loaded.spec.setting.material =
            toml::from_str(text).with_context(|| format!("material {name}"))?;
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
