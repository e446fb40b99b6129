//! Settings of the reference simulator. They are nouns of a scene; the laws are in
//! `selvedge-sim`.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, require, require_positive};

/// Settings of the reference simulator.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsSettings {
    /// Implicit solves per frame.
    pub substeps: u32,
    /// Constraint by which handles hold the cloth.
    pub handles: HandleConstraint,
    /// Elastic law: what a material's tables of stretching and bending mean.
    pub law: ElasticLaw,
    /// True for hinges whose stiffness is evened out over the mesh: a cloth of irregular triangles
    /// then bends alike in every direction and along its border, as a plate does. Not as ARCSim.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub even_bending: bool,
    /// Law of the air within a substep.
    pub air: AirLaw,
    /// Formula of a substep, and the accuracy to which its equations are solved.
    pub integrator: Integrator,
    /// Stiffness-proportional damping that every material has at least `[s]`. None takes
    /// [`Self::damping`]'s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_damping: Option<f64>,
    /// Largest strain l/l₀ - 1 of an edge at the end of a frame, edges between handles apart. An
    /// edge that is beyond it already may only become shorter. A frame beyond it is computed again
    /// with more substeps, as far as [`Self::most_substeps`], and is then an error.
    #[serde(skip_serializing_if = "is_default_strain")]
    pub max_strain: f64,
    /// Solver of linear systems.
    pub solver: LinearSolver,
}

/// Strain beyond what fabrics reach before they tear, with room for the edges at a single held
/// vertex: measured, a light knit held by two corners reaches 1.0 in wind of 20 m/s and 1.3 at
/// 30 m/s.
const DEFAULT_MAX_STRAIN: f64 = 1.5;

/// Substeps to which frames are divided that need more than the scene asks for; and the part of a
/// substep to which they are at least, where it asks for many.
const MOST_SUBSTEPS: u32 = 64;
const MOST_PARTS: u32 = 8;

/// Files made before there was a bound do not name it.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_default_strain(strain: &f64) -> bool {
    *strain == DEFAULT_MAX_STRAIN
}

/// A name for all settings of the physics at once.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PhysicsMode {
    /// The defaults.
    #[default]
    Selvedge,
    /// As ARCSim has them, for comparisons with it: spring handles, its bending law, its grid,
    /// explicit air, one linear solve per substep by a complete factorisation.
    Arcsim,
}

/// Constraint by which handles hold the cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum HandleConstraint {
    /// The vertex is where its target is.
    #[default]
    Exact,
    /// An implicit spring of 1000 N/m per axis to the target, as in ARCSim.
    Spring,
}

/// Elastic law of a cloth: the resistance to stretching and bending that it has by its material's
/// measured tables.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ElasticLaw {
    /// The gradient of an energy that is fitted to the tables: convex in the strain of stretching,
    /// a function of the angle in bending. Nothing gains energy from it.
    #[default]
    Energy,
    /// The tables as they are: a stiffness that is looked up at the strain, in ARCSim's 30³ samples
    /// of the table, times the strain. It is the gradient of no energy; three of the four shipped
    /// fabrics can gain from it. A fold is as stiff to either side. The law of data sets and models
    /// from before there was an energy.
    Measured,
    /// As [`Self::Measured`], with bending as ARCSim has it: column 0 of its table is extrapolated
    /// for folds away from the normals.
    Arcsim,
}

/// Law of the air within a substep.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AirLaw {
    /// A force of the velocities at the start of the substep, as in ARCSim. Where these are very
    /// fast or the substep long, it can turn a face round and add energy. Not for the integrators
    /// of second order.
    Explicit,
    /// The force of the velocities at the end of the substep: it takes energy from whatever moves
    /// through the air, never adds any. Integrators of first order take |v_n| of the substep's
    /// start.
    #[default]
    Implicit,
}

/// Formula of a substep, and the accuracy to which its equations are solved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrator {
    /// Backward Euler by one linear solve at the start of the substep, as in ARCSim: first order.
    Linearised,
    /// The generalised-α method by one linear solve at a predicted state: second order for the
    /// same price.
    GeneralisedAlpha(GeneralisedAlpha),
}

impl Integrator {
    /// Order of the error in the substep.
    pub fn order(self) -> u32 {
        match self {
            Self::Linearised => 1,
            Self::GeneralisedAlpha(_) => 2,
        }
    }
}

/// Settings of the generalised-α method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GeneralisedAlpha {
    /// Part of the fastest vibrations that a substep leaves, from 0 to 0.9. With 0 the method is
    /// BDF2. None is [`Self::radius`]'s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spectral_radius: Option<f64>,
}

impl GeneralisedAlpha {
    /// The spectral radius: 0.1 where none is given. With contact 0: there 0.1 leaves a cloth that
    /// lies on a ball jittering by a tenth of a millimetre.
    pub fn radius(self, has_contact: bool) -> f64 {
        let usual = if has_contact { 0.0 } else { 0.1 };
        self.spectral_radius.unwrap_or(usual)
    }
}

/// Solver of linear systems.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LinearSolver {
    /// Conjugate gradients with a tolerance that suits the scene: 1e-7 m/s, in second order with
    /// contact 3e-7 m/s.
    #[default]
    Automatic,
    /// A complete factorisation: exact up to rounding.
    Cholesky,
    /// Preconditioned conjugate gradients from the last solution.
    ConjugateGradients(ConjugateGradients),
}

/// When conjugate gradients end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ConjugateGradients {
    /// Root mean square error of the velocities, by mass `[m/s]`.
    pub tolerance: f64,
    /// An error after this many iterations of one solve.
    pub max_iterations: u32,
}

/// Settings of the search for the sagged rest pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SagSettings {
    /// Height of the smooth bulge that the flat start is given along its normals `[m]`. Its sign
    /// decides to which side the cloth buckles, so that all data lie on one branch.
    pub bulge: f64,
    /// The pose is at rest when no free vertex is accelerated by more than this `[m/s²]`.
    pub tolerance: f64,
    /// Give up after this many solves.
    pub max_steps: u32,
}

impl Default for PhysicsSettings {
    fn default() -> Self {
        Self {
            substeps: 2,
            handles: HandleConstraint::default(),
            law: ElasticLaw::default(),
            even_bending: false,
            air: AirLaw::default(),
            integrator: Integrator::default(),
            least_damping: None,
            max_strain: DEFAULT_MAX_STRAIN,
            solver: LinearSolver::default(),
        }
    }
}

impl Default for Integrator {
    fn default() -> Self {
        Self::GeneralisedAlpha(GeneralisedAlpha::default())
    }
}

impl Default for ConjugateGradients {
    fn default() -> Self {
        Self {
            tolerance: 1e-7,
            max_iterations: 10_000,
        }
    }
}

impl Default for SagSettings {
    fn default() -> Self {
        Self {
            bulge: 0.02,
            tolerance: 1e-3,
            max_steps: 20_000,
        }
    }
}

impl PhysicsSettings {
    /// The settings of a mode.
    pub fn in_mode(mode: PhysicsMode) -> Self {
        match mode {
            PhysicsMode::Selvedge => Self::default(),
            PhysicsMode::Arcsim => Self {
                substeps: 4,
                handles: HandleConstraint::Spring,
                law: ElasticLaw::Arcsim,
                even_bending: false,
                air: AirLaw::Explicit,
                integrator: Integrator::Linearised,
                least_damping: Some(0.0),
                max_strain: DEFAULT_MAX_STRAIN,
                solver: LinearSolver::ConjugateGradients(ConjugateGradients {
                    tolerance: 1e-10,
                    ..ConjugateGradients::default()
                }),
            },
        }
    }

    /// Damping of a material of `damping` `[s]` in this physics `[s]`.
    ///
    /// The measurements of fabrics say nothing of how they damp. With 1 ms, the least that is taken
    /// if nothing is said, a vibration of 3 Hz loses 1 % of critical, a cloth that swings comes to
    /// rest within a minute, and waves too short for the substeps do not ring. Backward Euler damps
    /// more than that by itself and has none. The measured law, which is no gradient of an energy,
    /// has 0.2 ms as it had before there was an energy.
    pub fn damping(&self, damping: f64) -> f64 {
        let least = self
            .least_damping
            .unwrap_or(match (self.integrator.order(), self.law) {
                (1, _) => 0.0,
                (_, ElasticLaw::Energy) => 1e-3,
                (_, ElasticLaw::Measured | ElasticLaw::Arcsim) => 2e-4,
            });
        damping.max(least)
    }

    /// Largest number of substeps of a frame.
    pub fn most_substeps(&self) -> u32 {
        MOST_SUBSTEPS.max(MOST_PARTS * self.substeps)
    }

    /// Checks the numbers of substeps and iterations, tolerances and bounds.
    ///
    /// # Errors
    /// Names the field and the value.
    pub fn validate(&self) -> Result<(), SceneError> {
        let (substeps, expected) = (self.substeps, "between 1 and 1000");
        let holds = (1..=1000).contains(&substeps);
        require(holds, "physics.substeps", expected, substeps)?;
        require_positive("physics.max_strain", self.max_strain)?;
        if let Integrator::GeneralisedAlpha(alpha) = self.integrator
            && let Some(radius) = alpha.spectral_radius
        {
            let field = "physics.integrator.generalised-alpha.spectral_radius";
            let holds = (0.0..=0.9).contains(&radius);
            require(holds, field, "between 0 and 0.9", radius)?;
        }
        if let Some(least) = self.least_damping {
            let (holds, field) = (least.is_finite() && least >= 0.0, "physics.least_damping");
            require(holds, field, "finite and not negative", least)?;
        }
        let holds = self.integrator.order() == 1 || self.air == AirLaw::Implicit;
        let expected = "\"implicit\" with an integrator of second order";
        require(holds, "physics.air", expected, "\"explicit\"")?;
        if let LinearSolver::ConjugateGradients(settings) = &self.solver {
            let field = |key: &str| format!("physics.solver.conjugate-gradients.{key}");
            require_positive(field("tolerance"), settings.tolerance)?;
            let most = settings.max_iterations;
            require(most > 0, field("max_iterations"), "at least 1", most)?;
        }
        Ok(())
    }
}

impl SagSettings {
    /// Checks that the numbers are finite, the tolerance and the number of solves positive.
    ///
    /// # Errors
    /// Names the field and the value.
    pub fn validate(&self) -> Result<(), SceneError> {
        require(self.bulge.is_finite(), "sag.bulge", "finite", self.bulge)?;
        require_positive("sag.tolerance", self.tolerance)?;
        let most = self.max_steps;
        require(most > 0, "sag.max_steps", "at least 1", most)
    }
}

#[cfg(test)]
mod tests;
