//! A mesh as a node of a rig has it.

use glam::{DVec2, DVec3};

#[derive(Debug, Default)]
pub(super) struct NodeMesh {
    pub(super) node: usize,
    /// Positions in the space of the node.
    pub(super) positions: Vec<DVec3>,
    /// Faces by their vertices.
    pub(super) faces: Vec<Vec<u32>>,
    /// Texture coordinates of the faces' corners, v upwards; none where there are none.
    pub(super) texture: Option<Vec<Vec<DVec2>>>,
    /// Name of each face's material.
    pub(super) fabrics: Vec<Option<String>>,
}

impl NodeMesh {
    /// Leaves out the faces of these numbers, which are holes.
    pub(super) fn without(&mut self, holes: &[f64]) {
        let mut stays = vec![true; self.faces.len()];
        for &hole in holes {
            if let Some(face) = stays.get_mut(hole as usize) {
                *face = false;
            }
        }
        let kept = || {
            let mut stays = stays.iter();
            move || stays.next().copied().unwrap_or_default()
        };
        let mut stay = kept();
        self.faces.retain(|_| stay());
        let mut stay = kept();
        self.fabrics.retain(|_| stay());
        let mut stay = kept();
        if let Some(texture) = &mut self.texture {
            texture.retain(|_| stay());
        }
    }
}

/// Texture coordinates of the corners of `faces`, from `values` per corner or per point of
/// `points`; their number says which of the two they are.
pub(super) fn texture_by_corner(
    values: &[DVec2],
    faces: &[Vec<u32>],
    points: usize,
) -> Result<Vec<Vec<DVec2>>, String> {
    let corners: usize = faces.iter().map(Vec::len).sum();
    if values.len() == corners {
        let mut values = values.iter().copied();
        let of = |face: &Vec<u32>| values.by_ref().take(face.len()).collect();
        return Ok(faces.iter().map(of).collect());
    }
    if values.len() != points {
        return Err(format!(
            "it has {} texture coordinates, for {corners} corners of faces and {points} points",
            values.len()
        ));
    }
    let at = |&v: &u32| values.get(v as usize).copied().unwrap_or_default();
    let of = |face: &Vec<u32>| face.iter().map(at).collect();
    Ok(faces.iter().map(of).collect())
}
