//! The cloth of this crate's tests, inside it and from outside: two triangles.

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Handles, Topology};
/// Where the vertices of the mesh are `[m]`; the first two are handles.
pub(crate) const CORNERS: [Vec3; 4] = [
    Vec3::ZERO,
    Vec3::new(0.0, 0.0, 1.0),
    Vec3::new(0.0, -1.0, 0.0),
    Vec3::new(0.0, -1.0, 1.0),
];

/// The cloth.
pub(crate) fn cloth() -> Cloth {
    let arrays = ClothArrays {
        rest_positions: CORNERS.to_vec(),
        material_coordinates: CORNERS.map(|p| Vec2::new(p.z, p.y)).to_vec(),
        vertex_mass: vec![0.1; 4],
        face_area: vec![0.5; 2],
    };
    let topology = Topology::new(4, &[[0, 2, 1], [1, 2, 3]]).unwrap();
    Cloth::new(topology, Handles::new(&[0, 1], 4).unwrap(), arrays).unwrap()
}
