//! Settings of a bench from its command line, and the threads that they ask for.

use std::collections::BTreeMap;

/// The `keys` with their defaults, changed by `KEY=VALUE` on the command line. Rayon's pool has as many
/// threads as the key `threads` says.
pub(crate) fn read<const N: usize>(
    keys: [(&'static str, &str); N],
) -> BTreeMap<&'static str, String> {
    let mut settings = BTreeMap::from(keys.map(|(key, value)| (key, value.to_owned())));
    for argument in std::env::args().skip(1).filter(|a| a != "--bench") {
        let Some((key, value)) = argument.split_once('=') else {
            panic!("expected KEY=VALUE, found {argument:?}")
        };
        let Some(setting) = settings.get_mut(key) else {
            let keys: Vec<&str> = settings.keys().copied().collect();
            panic!("{key:?} is none of {}", keys.join(", "))
        };
        value.clone_into(setting);
    }
    let threads = settings["threads"].parse().unwrap();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    pool.build_global().unwrap();
    settings
}
