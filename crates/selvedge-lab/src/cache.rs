//! The user's cache folder, where rest poses are kept from one start to the next.

use std::ffi::OsString;
use std::path::PathBuf;

use selvedge_data::RestPoseFolder;

use crate::rest_pose;

/// Variable that names the folder, or is "off".
const VARIABLE: &str = "SELVEDGE_CACHE";

/// Keeps rest poses in the user's cache folder from now on, for the whole process, if there is one.
pub fn open() {
    match folder(|name| std::env::var_os(name)) {
        Some(folder) => rest_pose::keep_in(RestPoseFolder::new(folder.join("rest-poses"))),
        None => tracing::debug!("no cache: rest poses are found anew"),
    }
}

/// The cache folder that the environment asks for: of `SELVEDGE_CACHE`, of `XDG_CACHE_HOME`, in
/// the home, or where Windows has such folders. None where it asks for none, or has no place.
fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn with(variables: &[(&str, &str)]) -> Option<PathBuf> {
        folder(|name| {
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
