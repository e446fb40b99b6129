//! Rest poses, found or known from before.
//!
//! A search may take a minute, and the same cloth is started again and again. [`keep_in`] names a
//! folder for the process, as one names the threads of a pool; without it nothing is kept. A pose
//! from the folder has the bytes that a search would find: it is known by all that decides them
//! ([`RestPoseContent`]), and by the version and the sources of the solver.

use std::ffi::OsString;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::OnceLock;
use web_time::Instant;

use selvedge_cloth::Scene;
use selvedge_data::{KeptRestPose, RestPoseFolder};
use selvedge_sim::{RestPoseContent, SagError, SagProgress, SaggedRest, sag_with_progress};

/// Seconds of a search from which its pose is worth a file.
const WORTH_KEEPING: f64 = 0.2;
/// Seconds of waiting that are spared and worth a word.
const WORTH_A_WORD: f64 = 2.0;

/// The solver that finds poses: its version, and a hash of its sources (`build.rs`).
const SOLVER: &str = concat!(env!("CARGO_PKG_VERSION"), " ", env!("SELVEDGE_SOLVER"));

static FOLDER: OnceLock<RestPoseFolder> = OnceLock::new();

/// Keeps rest poses in `folder` from now on, for the whole process. Only the first call counts.
pub fn keep_in(folder: RestPoseFolder) {
    // A second call asks for what is there.
    let _ = FOLDER.set(folder);
}

/// Variable that names the folder, or is "off".
const VARIABLE: &str = "SELVEDGE_CACHE";

/// Keeps rest poses in the user's cache folder from now on, for the whole process, if there is one.
pub fn keep_in_cache() {
    match cache_folder(|name| std::env::var_os(name)) {
        Some(folder) => keep_in(RestPoseFolder::new(folder.join("rest-poses"))),
        None => tracing::debug!("no cache: rest poses are found anew"),
    }
}

/// The cache folder that the environment asks for: of `SELVEDGE_CACHE`, of `XDG_CACHE_HOME`, in
/// the home, or where Windows has such folders. None where it asks for none, or has no place.
fn cache_folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(own) = variable(VARIABLE) {
        let is_off = own.is_empty() || own == "off";
        return (!is_off).then(|| PathBuf::from(own));
    }
    // A relative path would depend on where the program is started.
    let place = |name: &str| {
        let path = PathBuf::from(variable(name)?);
        path.is_absolute().then_some(path)
    };
    let shared = place("XDG_CACHE_HOME")
        .or_else(|| Some(place("HOME")?.join(".cache")))
        .or_else(|| place("LOCALAPPDATA"))?;
    Some(shared.join("selvedge"))
}

/// A rest pose, and the time that an earlier search for it took `[s]`; none where the search was this
/// one.
pub(crate) type Found = (SaggedRest, Option<f64>);

/// A line on a search that was spared, where it would have been waited for.
pub(crate) fn remark((rest, kept_seconds): &Found) -> Option<String> {
    let seconds = kept_seconds.filter(|seconds| *seconds >= WORTH_A_WORD)?;
    let vertices = rest.positions.len();
    Some(format!(
        "the rest pose of {vertices} vertices is known from before (a search of {seconds:.0} s)"
    ))
}

/// The sagged rest pose of `scene`: from the folder of [`keep_in`] where it is known, otherwise
/// searched for, and kept there if that took a while. `progress` is called at every solve and may
/// stop.
///
/// # Errors
/// As for [`sag_with_progress`]. A folder that cannot be used is warned of.
pub(crate) fn found(
    scene: &Scene,
    progress: &mut dyn FnMut(SagProgress) -> ControlFlow<()>,
) -> Result<Found, SagError> {
    match FOLDER.get() {
        Some(folder) => found_in((folder, SOLVER), WORTH_KEEPING, scene, progress),
        None => Ok((sag_with_progress(scene, progress)?, None)),
    }
}

/// As [`found`], in `folder` by this `solver`; searches from `worth_keeping` seconds on are kept.
fn found_in(
    (folder, solver): (&RestPoseFolder, &str),
    worth_keeping: f64,
    scene: &Scene,
    progress: &mut dyn FnMut(SagProgress) -> ControlFlow<()>,
) -> Result<Found, SagError> {
    let content = (solver, RestPoseContent::of(scene)?);
    let Ok(content) = serde_json::to_string(&content) else {
        return Ok((sag_with_progress(scene, progress)?, None));
    };
    match folder.find(&content, scene.mesh.positions().len()) {
        Ok(None) => {}
        Ok(Some(kept)) => {
            let rest = SaggedRest {
                positions: kept.positions,
                solves: kept.solves,
                residual: kept.residual,
            };
            return Ok((rest, Some(kept.seconds)));
        }
        Err(error) => tracing::warn!("a rest pose from before: {error}; it is searched for again"),
    }
    let began = Instant::now();
    let rest = sag_with_progress(scene, progress)?;
    let seconds = began.elapsed().as_secs_f64();
    if seconds >= worth_keeping {
        let kept = KeptRestPose {
            positions: rest.positions.clone(),
            solves: rest.solves,
            residual: rest.residual,
            seconds,
        };
        if let Err(error) = folder.keep(&content, &kept) {
            tracing::warn!("the rest pose is not kept for another time: {error}");
        }
    }
    Ok((rest, None))
}

#[cfg(all(test, feature = "learned"))]
mod tests {
    use selvedge_cloth::LinearSolver;

    use super::*;
    use crate::run::tests::hanging;

    /// The pose of `scene` by way of `folder`, and the solves that it took now.
    fn through(folder: &RestPoseFolder, scene: &Scene) -> (Found, u32) {
        by(SOLVER, folder, scene)
    }

    fn by(solver: &str, folder: &RestPoseFolder, scene: &Scene) -> (Found, u32) {
        let mut solves = 0;
        let found = found_in((folder, solver), 0.0, scene, &mut |now| {
            solves = now.solves;
            ControlFlow::Continue(())
        });
        (found.unwrap(), solves)
    }

    #[test]
    fn the_second_start_searches_no_more_and_has_the_same_bytes() {
        let place = tempfile::tempdir().unwrap();
        let folder = RestPoseFolder::new(place.path().join("poses"));
        let mut scene = hanging();
        let (first, solves) = through(&folder, &scene);
        let alone = sag_with_progress(&scene, &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(solves > 0);
        assert_eq!(first, (alone, None));
        // Settings of the motion are no part of a rest pose.
        scene.physics.substeps += 1;
        scene.physics.solver = LinearSolver::Cholesky;
        let (second, solves) = through(&folder, &scene);
        assert_eq!((&second.0, solves), (&first.0, 0));
        assert!(second.1.is_some());
        scene.material.density *= 1.01;
        let (other, solves) = through(&folder, &scene);
        assert!(solves > 0 && other.0 != first.0);
    }

    /// Another build may round otherwise: a motion that starts in its pose parts from one that starts
    /// in that of this build.
    #[test]
    fn a_pose_of_another_build_is_not_taken() {
        let place = tempfile::tempdir().unwrap();
        let folder = RestPoseFolder::new(place.path().to_owned());
        let scene = hanging();
        by("0.1.0 before", &folder, &scene);
        assert!(through(&folder, &scene).1 > 0);
        assert_eq!(through(&folder, &scene).1, 0);
        assert!(SOLVER.len() > "0.1.0 0123456789abcde".len());
    }

    #[test]
    fn a_damaged_file_is_searched_for_again_and_mended() {
        let place = tempfile::tempdir().unwrap();
        let folder = RestPoseFolder::new(place.path().to_owned());
        let scene = hanging();
        let (first, _) = through(&folder, &scene);
        let file = std::fs::read_dir(place.path()).unwrap().next();
        let file = file.unwrap().unwrap().path();
        std::fs::write(&file, b"not a pose").unwrap();
        let (again, solves) = through(&folder, &scene);
        assert!(solves > 0 && again == first);
        assert_eq!(through(&folder, &scene).1, 0);
    }

    #[test]
    fn a_folder_that_cannot_be_written_costs_the_search_only() {
        let place = tempfile::tempdir().unwrap();
        let file = place.path().join("a file");
        std::fs::write(&file, b"").unwrap();
        let folder = RestPoseFolder::new(file.join("poses"));
        let scene = hanging();
        let (first, _) = through(&folder, &scene);
        let (second, solves) = through(&folder, &scene);
        assert!(solves > 0 && second == first);
    }

    #[test]
    fn a_long_wait_that_is_spared_is_told() {
        let rest = SaggedRest {
            positions: Vec::new(),
            solves: 3,
            residual: 1e-4,
        };
        let remark = |kept_seconds| remark(&(rest.clone(), kept_seconds));
        assert_eq!((remark(None), remark(Some(1.9))), (None, None));
        assert!(remark(Some(36.0)).unwrap().contains("36 s"));
    }

    fn with(variables: &[(&str, &str)]) -> Option<PathBuf> {
        cache_folder(|name| {
            let found = variables.iter().find(|variable| variable.0 == name);
            found.map(|variable| OsString::from(variable.1))
        })
    }

    #[test]
    #[cfg(unix)]
    fn the_folder_is_where_the_environment_says() {
        let path = |path: &str| Some(PathBuf::from(path));
        let home = ("HOME", "/people/me");
        let shared = ("XDG_CACHE_HOME", "/var/cache/me");
        assert_eq!(with(&[home]), path("/people/me/.cache/selvedge"));
        assert_eq!(with(&[home, shared]), path("/var/cache/me/selvedge"));
        let own = (VARIABLE, "here");
        assert_eq!(with(&[home, shared, own]), path("here"));
        assert_eq!(with(&[home, (VARIABLE, "off")]), None);
        assert_eq!(with(&[home, (VARIABLE, "")]), None);
        assert_eq!(
            with(&[home, ("XDG_CACHE_HOME", "relative")]),
            path("/people/me/.cache/selvedge")
        );
        assert_eq!(with(&[]), None);
    }
}
