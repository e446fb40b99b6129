//! Names of meshes: words for the mesh of a trajectory that no other mesh has.

use selvedge_data::Trajectory;

/// The meshes met so far, in the order of the data.
#[derive(Default)]
pub(super) struct Meshes {
    known: Vec<(blake3::Hash, String)>,
}

impl Meshes {
    /// Words for the mesh of `truth`: its source, its vertices and its handles. A number follows
    /// where another mesh, or the same with other handles, has these words already.
    pub(super) fn name(&mut self, truth: &Trajectory) -> String {
        let identity = identity(truth);
        if let Some((_, name)) = self.known.iter().find(|known| known.0 == identity) {
            return name.clone();
        }
        let words = words(truth);
        let is_known = |name: &String| self.known.iter().any(|known| known.1 == *name);
        let numbered = (2..).map(|number| format!("{words} ({number})"));
        let mut names = std::iter::once(words.clone()).chain(numbered);
        let name = names.find(|name| !is_known(name)).unwrap_or(words);
        self.known.push((identity, name.clone()));
        name
    }
}

/// Of faces, material coordinates and handles.
fn identity(truth: &Trajectory) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let cloth = truth.cloth();
    for vertex in cloth.topology().faces().iter().flatten() {
        hasher.update(&vertex.index().to_le_bytes());
    }
    for coordinate in cloth
        .material_coordinates()
        .iter()
        .flat_map(|p| p.to_array())
    {
        hasher.update(&coordinate.to_le_bytes());
    }
    for point in cloth.pattern().corners().iter().flatten() {
        hasher.update(&point.to_le_bytes());
    }
    for vertex in cloth.handles().vertices() {
        hasher.update(&vertex.index().to_le_bytes());
    }
    hasher.finalize()
}

fn words(truth: &Trajectory) -> String {
    let source = truth.provenance().scene.pointer("/setting/mesh/source");
    let text = |pointer| Some(source?.pointer(pointer)?.as_str()?.to_owned());
    let vertices = truth.vertex_count();
    let handles = match truth.cloth().handles().vertices().len() {
        1 => "1 handle".to_owned(),
        count => format!("{count} handles"),
    };
    match text("/generator/kind").or_else(|| text("/obj/path")) {
        Some(kind) => format!("{kind}, {vertices} vertices, {handles}"),
        None => format!("{vertices} vertices, {handles}"),
    }
}
