//! A scene: what is run, where its motion begins, and what is to be known of it before.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use selvedge_cloth::Scene as Built;
#[cfg(feature = "files")]
use selvedge_data::{LoadedScene, SceneSpec, StartSpec};
use selvedge_sim::{Checkpoint, SaggedRest};

use crate::Error;
use crate::event::Listener;
#[cfg(feature = "files")]
use crate::fitting::{self, Making};
use crate::start::{self, Start};

/// A cloth with its material, what holds, moves and meets it, and where its motion begins.
///
/// A clone is the same scene, also with the rest pose that was found for it.
#[derive(Clone, Debug)]
pub struct Scene(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    built: Arc<Built>,
    begins: Begins,
    warnings: Vec<String>,
    rest: Mutex<Option<Arc<SaggedRest>>>,
    #[cfg(feature = "files")]
    spec: Option<SceneSpec>,
}

/// Where the motion begins.
#[derive(Debug)]
enum Begins {
    /// In the sagged rest pose.
    Rest,
    State(Box<Checkpoint>),
    /// At the mesh, made ready as its file says.
    #[cfg(feature = "files")]
    Made(Box<Making>),
}

impl Scene {
    fn begun(built: Built, begins: Begins) -> Self {
        Self(Arc::new(Inner {
            built: Arc::new(built),
            begins,
            warnings: Vec::new(),
            rest: Mutex::default(),
            #[cfg(feature = "files")]
            spec: None,
        }))
    }

    /// A scene made in code. Its motion begins in the sagged rest pose, in which it hangs from its
    /// handles; without handles where the mesh stands.
    pub fn of(built: Built) -> Self {
        if built.handles.is_empty() {
            let positions = built.mesh.positions().to_vec();
            Self::at(built, positions)
        } else {
            Self::begun(built, Begins::Rest)
        }
    }

    /// A scene made in code that begins at `positions` `[m]`, `[vertices]`, at rest.
    pub fn at(built: Built, positions: Vec<DVec3>) -> Self {
        Self::in_state(built, Checkpoint::at_rest(positions))
    }

    /// A scene made in code that begins in a state of the solver.
    pub fn in_state(built: Built, state: Checkpoint) -> Self {
        Self::begun(built, Begins::State(Box::new(state)))
    }

    /// A shipped scene by its name ("default", "tablecloth"), or a scene by the path of its file.
    ///
    /// # Errors
    /// [`Error::File`] names the scene, the field and what is wrong; an unknown name lists all.
    #[cfg(feature = "files")]
    pub fn named(name_or_path: &str) -> Result<Self, Error> {
        Ok(Self::from(selvedge_data::open_scene(name_or_path)?))
    }

    /// A scene by the text of its file; paths in it are relative to the current folder.
    ///
    /// # Errors
    /// As for [`Self::named`].
    #[cfg(feature = "files")]
    pub fn parse(text: &str) -> Result<Self, Error> {
        let loaded = selvedge_data::parse_scene(text, "".as_ref(), "the scene")?;
        Ok(Self::from(loaded))
    }

    /// What is run.
    pub fn built(&self) -> &Arc<Built> {
        &self.0.built
    }

    /// The resolved scene, as results carry it; none of a scene that was made in code.
    #[cfg(feature = "files")]
    pub fn spec(&self) -> Option<&SceneSpec> {
        self.0.spec.as_ref()
    }

    /// Warnings of what the scene asks for and cannot have, or hardly means.
    pub fn warnings(&self) -> &[String] {
        &self.0.warnings
    }

    /// The sagged rest pose, the static equilibrium in which the cloth hangs from its handles. It is
    /// searched for once.
    ///
    /// # Errors
    /// [`Error::Rest`].
    pub fn rest_pose(&self, on_event: &mut Listener<'_>) -> Result<Arc<SaggedRest>, Error> {
        let mut known = self.0.rest.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(rest) = &*known {
            return Ok(Arc::clone(rest));
        }
        let found = start::rest_pose(&self.0.built, on_event)?;
        Ok(Arc::clone(known.insert(Arc::new(found))))
    }

    /// Returns true where the motion begins in the sagged rest pose.
    pub fn begins_at_rest(&self) -> bool {
        matches!(self.0.begins, Begins::Rest)
    }

    /// The same scene, beginning in its sagged rest pose.
    pub fn at_rest(&self) -> Self {
        if self.begins_at_rest() {
            return self.clone();
        }
        Self(Arc::new(Inner {
            #[cfg(feature = "files")]
            spec: self.0.spec.clone().map(|spec| SceneSpec {
                start: StartSpec::Rest,
                ..spec
            }),
            ..self.beginning(Begins::Rest)
        }))
    }

    /// The same scene, beginning in a state of the solver.
    pub fn from_state(&self, state: Checkpoint) -> Self {
        Self(Arc::new(self.beginning(Begins::State(Box::new(state)))))
    }

    fn beginning(&self, begins: Begins) -> Inner {
        let inner = &*self.0;
        let rest = inner.rest.lock().unwrap_or_else(PoisonError::into_inner);
        Inner {
            built: Arc::clone(&inner.built),
            begins,
            warnings: inner.warnings.clone(),
            rest: Mutex::new(rest.clone()),
            #[cfg(feature = "files")]
            spec: inner.spec.clone(),
        }
    }

    /// Finds where the motion begins, as the scene says. Only a start in the rest pose waits for
    /// that.
    ///
    /// # Errors
    /// A rest pose or a fit that cannot be had; what helps is said.
    pub fn start(&self, on_event: &mut Listener<'_>) -> Result<Start, Error> {
        let built = &self.0.built;
        match &self.0.begins {
            Begins::State(state) => Ok(Start::at(Checkpoint::clone(state))),
            #[cfg(feature = "files")]
            Begins::Made(making) => {
                let fitted = fitting::fit(built, making, on_event)?;
                Ok(Start {
                    remarks: fitted.remarks,
                    warnings: fitted.warnings,
                    ..Start::at(Checkpoint::at_rest(fitted.positions))
                })
            }
            Begins::Rest if built.handles.is_empty() => Err(Error::Unheld {
                scene: built.name.clone(),
            }),
            Begins::Rest => {
                let rest = self.rest_pose(on_event).map_err(start::without_rest)?;
                Ok(Start {
                    rest: Some(Arc::clone(&rest)),
                    ..Start::at(Checkpoint::at_rest(rest.positions.clone()))
                })
            }
        }
    }
}

/// A listener that does nothing.
pub(crate) fn ignore_events(_: crate::Event<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[cfg(feature = "files")]
impl From<LoadedScene> for Scene {
    /// A scene that was read from a file.
    fn from(loaded: LoadedScene) -> Self {
        let spec = loaded.spec.clone();
        Self::of_loaded(loaded, Some(spec))
    }
}

#[cfg(feature = "files")]
impl Scene {
    /// A scene that was read, and changed since: `spec` is what results say of where they are from.
    pub fn of_loaded(loaded: LoadedScene, spec: Option<SceneSpec>) -> Self {
        let begins = match (loaded.state, loaded.spec.start) {
            (Some(state), _) => Begins::State(Box::new(state)),
            (None, StartSpec::Rest) => Begins::Rest,
            (None, start) => Begins::Made(Box::new(Making {
                start,
                dress: loaded.spec.dress,
                loose: loaded.loose,
            })),
        };
        Self(Arc::new(Inner {
            built: Arc::new(loaded.scene),
            begins,
            warnings: loaded.warnings,
            rest: Mutex::default(),
            spec,
        }))
    }
}
