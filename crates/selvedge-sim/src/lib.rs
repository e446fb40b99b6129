//! Reference cloth physics: measured stiffness (Wang, O'Brien and Ramamoorthi 2011) under a
//! linearly implicit integrator (Baraff and Witkin 1998), in the form in which ARCSim (Narain et
//! al. 2012, 2013) solves it, without remeshing.
//!
//! The input is a [`Scene`](selvedge_cloth::Scene), which decides every result: mesh, **handles**
//! (the vertices that are held), material, air, motion and physics settings. The **rest pose** is
//! the static equilibrium in which the cloth hangs from its handles; [`sag`] finds it. A
//! [`Simulator`] moves the cloth. It is a [`Stepper`](selvedge_cloth::Stepper): each **step** takes
//! targets for the handles and leads to the next **frame**. A step consists of **substeps**, each
//! with one linear **solve**. The **laws** of stretching,
//! bending and air, with their derivatives, are in [`laws`].
//!
//! ```
//! use glam::DVec3;
//! use selvedge_cloth::generate::square;
//! use selvedge_cloth::{
//!     Compression, Environment, HandleSchedule, HandleTargets, Handles, Isotropic, Material, Motion,
//!     PhysicsSettings, SagSettings, Scene, Stepper,
//! };
//! use selvedge_sim::{Simulator, sag};
//!
//! // A sheet of 49 vertices, 1 m wide, held at its upper corners.
//! let sheet = square(49, 1.0, 1)?;
//! let elastic = Isotropic { youngs_modulus: 1e6, poissons_ratio: 0.3, thickness: 5e-4 };
//! let rubber = Material {
//!     name: "rubbery".to_owned(),
//!     source: String::new(),
//!     density: 0.2, // kg/m²
//!     damping: 0.0,
//!     stretch: elastic.stretch_table(),
//!     bend: elastic.bend_table(),
//!     compression: Compression::default(),
//! };
//! let handles = Handles::new(&sheet.labels["upper-corners"], 49)?;
//! let scene = Scene::of("a first cloth", sheet.mesh, handles, rubber);
//!
//! // The rest pose, then ten frames in which both handles move sideways by 1 cm each.
//! let rest = sag(&scene)?;
//! assert!(rest.residual <= scene.sag.tolerance);
//! let start = scene.handles.select(&rest.positions);
//! let still = vec![DVec3::ZERO; rest.positions.len()];
//! let mut simulator = Simulator::with_state(&scene, rest.positions, still)?;
//! for frame in 1..=10 {
//!     let aside = DVec3::X * 0.01 * f64::from(frame);
//!     let targets = start.iter().map(|handle| *handle + aside).collect();
//!     simulator.step(&HandleTargets::at_frame_end(targets)?)?;
//! }
//! assert_eq!(simulator.frame(), 10);
//! assert!(simulator.kinetic_energy() > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Units are SI throughout. The state is f64; [`Stepper::positions`](selvedge_cloth::Stepper) gives
//! f32 copies. The same scene and targets give the same bytes with any number of threads.
//!
//! Where a scene has `contact`, the cloth touches obstacles and itself, and no frame intersects.
//! There is no remeshing and no plasticity. The crate reads and writes no files.

mod active_handles;
mod contact;
mod edges;
mod fit;
mod integrator;
pub mod laws;
mod lists;
mod rest_pose;
mod sew;
mod simulator;
mod solver;
mod state;
mod stop;
mod threads;

pub use contact::{
    ContactCounts, ContactGauge, FAR, FrameContact, Led, ObstacleSlope, YieldedContact,
};
pub use fit::{
    Dressed, FitError, FitProgress, Fitted, Untangled, dress, fit, sew_and_fit, untangle,
};
pub use integrator::SubstepCounts;
pub use rest_pose::{
    RestGradient, RestPoseContent, SagError, SagProgress, SaggedRest, sag, sag_gradient,
    sag_with_progress,
};
pub use simulator::{
    Checkpoint, DividedFrames, Gradient, GradientError, GradientSettings, Simulator,
    SimulatorError, StateGradient, StepStats,
};
pub use solver::MaterialGradient;
pub use threads::Threads;
