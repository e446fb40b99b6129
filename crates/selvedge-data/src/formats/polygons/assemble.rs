//! From polygons to a mesh with a rest shape for each triangle.

use glam::{DVec2, DVec3, Vec2};
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::{FaceFabrics, FaceId, LoosePanels, Mesh, MeshError, TopologyError, VertexId};

use super::fit::fit;
use super::orient::orient;
use super::shape::{own_shape, planar_coordinates};
use super::slits::warn_of_slits;
use super::triangulate::{triangles_in_space, triangulate};
use super::weld::{check_corners, drop_unused, weld};
use super::{
    Corner, MeshFileError, MeshOptions, PatternSource, Place, Polygon, Polygons, ReadMesh, Seams,
    TextureUnit,
};

/// Makes a mesh as `options` say.
pub(crate) fn assemble(
    mut polygons: Polygons,
    options: MeshOptions,
) -> Result<ReadMesh, MeshFileError> {
    if polygons.polygons.is_empty() {
        return Err(MeshFileError::content(match polygons.positions.len() {
            0 => "has no faces and no vertices: it is empty, or no mesh of the kind that its name says".to_owned(),
            some => format!(
                "has no faces, only {some} vertices: a cloth needs at least one; export it as a mesh, not as points, lines or curves"
            ),
        }));
    }
    if let Some(tolerance) = options.weld {
        weld(&mut polygons, tolerance)?;
        if polygons.polygons.is_empty() {
            return Err(MeshFileError::content(format!(
                "has no faces left once vertices within {tolerance} of each other are one: give a smaller mesh.weld, in the file's own unit of length"
            )));
        }
    }
    check_corners(&polygons)?;
    drop_unused(&mut polygons);
    orient(&mut polygons);
    warn_of_slits(&mut polygons);
    let thread = options.thread.unwrap_or(DVec3::Y);
    if thread.try_normalize().is_none() {
        let problem = format!("mesh.thread must be a direction, found {thread}");
        return Err(MeshFileError::Content(problem));
    }
    let flat = rest_coordinates(&mut polygons, options)?;
    let triangles = split(&polygons, flat.as_deref(), thread)?;
    let is_other = options.pattern == PatternSource::Shape || options.texture == TextureUnit::Fit;
    finish(polygons, &triangles, flat.is_none(), is_other)
}

/// A triangle with its rest shape and where it comes from.
struct Triangle {
    corners: [u32; 3],
    shape: [DVec2; 3],
    fabric: Option<u32>,
    place: Place,
    /// Corners' places before the panels were sewn, where they were.
    loose: Option<[u32; 3]>,
    /// Texture coordinates of the corners, where there are some.
    texture: Option<[Vec2; 3]>,
}

/// Material coordinates of each polygon's corners `[m]`, `[polygons][corners]`; none where the rest
/// shape is the form in space.
fn rest_coordinates(
    polygons: &mut Polygons,
    options: MeshOptions,
) -> Result<Option<Vec<Vec<DVec2>>>, MeshFileError> {
    if options.pattern == PatternSource::Shape {
        return Ok(None);
    }
    if !has_texture(polygons) {
        let flat = planar_coordinates(polygons);
        return Ok(flat.map(|flat| {
            let at = |corner: &Corner| flat[corner.vertex as usize];
            let of = |p: &Polygon| p.corners.iter().map(at).collect();
            polygons.polygons.iter().map(of).collect()
        }));
    }
    if options.seams == Seams::Cut {
        cut(polygons);
    }
    let mut coordinates = texture_coordinates(polygons)?;
    if options.texture == TextureUnit::Fit {
        fit(polygons, &mut coordinates)?;
    }
    Ok(Some(coordinates))
}

/// Returns true where the texture coordinates say something of the cloth: some writers give all
/// corners the same one, which is warned of.
fn has_texture(polygons: &mut Polygons) -> bool {
    let mut corners = polygons.polygons.iter().flat_map(|p| &p.corners);
    let mut used = corners.clone().filter_map(|corner| corner.texture);
    let Some(first) = used.next() else {
        return false;
    };
    let is_one = |texture: usize| polygons.texture[texture] == polygons.texture[first];
    if corners.any(|corner| corner.texture.is_none()) || !used.all(is_one) {
        return true;
    }
    polygons.warnings.push(
        "all texture coordinates are the same point, which says nothing of the cloth: it is read as a cloth without any"
            .to_owned(),
    );
    false
}

/// Gives every further texture coordinate of a vertex a vertex of its own at the same place, with
/// the same labels and velocity.
fn cut(polygons: &mut Polygons) {
    // What stands for vertex v with a coordinate: v itself for the first, then the copies.
    let mut versions: Vec<Vec<(DVec2, u32)>> = vec![Vec::new(); polygons.positions.len()];
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        let Some(texture) = corner.texture else {
            continue;
        };
        let value = polygons.texture[texture];
        let known = &mut versions[corner.vertex as usize];
        if let Some((_, version)) = known.iter().find(|(other, _)| *other == value) {
            corner.vertex = *version;
            continue;
        }
        let original = corner.vertex;
        if !known.is_empty() {
            corner.vertex = polygons.positions.len() as u32;
            polygons
                .positions
                .push(polygons.positions[original as usize]);
            if let Some(number) = polygons.numbers.get(original as usize).copied() {
                polygons.numbers.push(number);
            }
            if let Some(velocity) = polygons.velocities.get(&original).copied() {
                polygons.velocities.insert(corner.vertex, velocity);
            }
            for label in polygons.labels.values_mut() {
                if label.contains(&original) {
                    label.insert(corner.vertex);
                }
            }
        }
        known.push((value, corner.vertex));
    }
}

fn texture_coordinates(polygons: &Polygons) -> Result<Vec<Vec<DVec2>>, MeshFileError> {
    let of_polygon = |polygon: &Polygon| {
        let corners = polygon.corners.iter();
        let places = corners.map(|corner| Some(polygons.texture[corner.texture?]));
        let places: Option<Vec<DVec2>> = places.collect();
        places.ok_or_else(|| {
            MeshFileError::content(format!(
                "{}: this face has no texture coordinates, but others have: give it some, or take the rest shape from the form in space with mesh.pattern = \"shape\"",
                polygon.place
            ))
        })
    };
    polygons.polygons.iter().map(of_polygon).collect()
}

/// Cuts every polygon into triangles, whose rest shapes are those of the corners' `coordinates`,
/// `[polygons][corners]`, or else their own with the wale axis along `thread`.
fn split(
    polygons: &Polygons,
    coordinates: Option<&[Vec<DVec2>]>,
    thread: DVec3,
) -> Result<Vec<Triangle>, MeshFileError> {
    let mut made = Vec::new();
    for (number, polygon) in polygons.polygons.iter().enumerate() {
        let corners = polygon.corners.len();
        let place = polygon.place;
        let own = coordinates.map(|coordinates| &coordinates[number]);
        let at = |corner: &Corner| polygons.positions[corner.vertex as usize];
        let in_space = || triangles_in_space(&polygons.places(polygon));
        let triangles = match own {
            Some(flat) => triangulate(flat),
            None => in_space(),
        };
        let crossed = || {
            let is_whole_in_space = own.is_some() && in_space().is_some();
            let (what, remedy) = if is_whole_in_space {
                (
                    "in its texture coordinates this face",
                    "take the shape in space with mesh.pattern = \"shape\", or give it a pattern",
                )
            } else {
                ("this face", "mend it, or triangulate it")
            };
            MeshFileError::content(format!(
                "{place}: {what} of {corners} corners crosses itself or has no area, so that it cannot be cut into triangles: {remedy}"
            ))
        };
        for triangle in triangles.ok_or_else(crossed)? {
            let corners = triangle.map(|k| &polygon.corners[k]);
            let point = |corner: &Corner| Some(polygons.texture[corner.texture?].as_vec2());
            made.push(Triangle {
                corners: corners.map(|corner| corner.vertex),
                shape: match own {
                    Some(flat) => triangle.map(|k| flat[k]),
                    None => own_shape(corners.map(at), thread),
                },
                fabric: polygon.fabric,
                place,
                loose: all(corners.map(|corner| corner.loose)),
                texture: all(corners.map(point)),
            });
        }
    }
    Ok(made)
}

fn all<T>(values: [Option<T>; 3]) -> Option<[T; 3]> {
    let [Some(a), Some(b), Some(c)] = values else {
        return None;
    };
    Some([a, b, c])
}

/// The mesh of these triangles; `is_own_shape` where their shapes are no pattern, and
/// `is_other_texture` where the texture coordinates of the file are not those of the pattern.
fn finish(
    mut polygons: Polygons,
    triangles: &[Triangle],
    is_own_shape: bool,
    is_other_texture: bool,
) -> Result<ReadMesh, MeshFileError> {
    let positions = polygons.positions.clone();
    let faces: Vec<[u32; 3]> = triangles.iter().map(|t| t.corners).collect();
    let shapes: Vec<[DVec2; 3]> = triangles.iter().map(|t| t.shape).collect();
    let mesh = Mesh::sewn(&faces, &shapes, positions);
    let mut mesh = mesh.map_err(|error| placed(error, &polygons, triangles, is_own_shape))?;
    let texture: Option<Vec<_>> = triangles.iter().map(|t| t.texture).collect();
    match texture {
        Some(texture) if is_other_texture => mesh = mesh.with_texture(Some(&texture)),
        _ if is_own_shape => mesh = mesh.with_texture(None),
        _ => {}
    }
    if triangles.iter().any(|t| t.fabric.is_some()) {
        mesh = mesh.with_fabrics(FaceFabrics {
            names: std::mem::take(&mut polygons.fabrics),
            of_face: triangles.iter().map(|t| t.fabric).collect(),
        })?;
    }
    let has_rest_angles = !polygons.angles.is_empty();
    if has_rest_angles {
        mesh = rest_angles(mesh, &mut polygons)?;
    }
    let labels = polygons.labels.into_iter();
    let labels = labels.map(|(name, vertices)| (name, vertices.into_iter().collect()));
    let loose: Vec<[u32; 3]> = triangles.iter().filter_map(|t| t.loose).collect();
    let loose = (!loose.is_empty()).then(|| LoosePanels::new(&loose, &polygons.loose));
    let vertices = 0..mesh.positions().len() as u32;
    let given = &polygons.velocities;
    let velocity = |v: u32| given.get(&v).copied().unwrap_or_default();
    let velocities = (!given.is_empty()).then(|| vertices.map(velocity).collect());
    Ok(ReadMesh {
        sheet: Sheet {
            mesh,
            labels: labels.collect(),
        },
        velocities,
        has_rest_angles,
        loose: loose.flatten(),
        is_own_shape,
        warnings: polygons.warnings,
    })
}

/// The mesh with the rest angles of its file; an angle of what is no edge is warned of.
fn rest_angles(mesh: Mesh, polygons: &mut Polygons) -> Result<Mesh, MeshFileError> {
    let mut given = std::mem::take(&mut polygons.angles);
    let edges = mesh.topology().edges().iter();
    let angles = edges.map(|edge| {
        let [a, b] = edge.vertices.map(|v| v.0);
        given.remove(&[a.min(b), a.max(b)]).unwrap_or_default()
    });
    let angles = angles.collect();
    if let Some([a, b]) = given.keys().next() {
        polygons.warnings.push(format!(
            "{} rest angles (ea) are of edges that no face has and are passed over, the first from vertex {} to vertex {}",
            given.len(),
            polygons.number(*a),
            polygons.number(*b)
        ));
    }
    Ok(mesh.with_rest_angles(angles)?)
}

/// The error with the places of its faces and the file's own numbers of its vertices.
fn placed(
    error: MeshError,
    polygons: &Polygons,
    triangles: &[Triangle],
    is_own_shape: bool,
) -> MeshFileError {
    let place = |face: FaceId| triangles[face.index()].place;
    let number = |vertex: VertexId| polygons.number(vertex.0);
    match error {
        MeshError::ZeroArea { face, .. }
            if is_own_shape || triangles[face.index()].texture.is_none() =>
        {
            let mut numbers = triangles[face.index()].corners.map(|v| polygons.number(v));
            numbers.sort_unstable();
            MeshFileError::content(format!(
                "{}: this face has no area in space, its vertices are {}: remove it, or where two of them are one let mesh.weld join them (mesh.weld = 1e-6)",
                place(face),
                numbers.map(|number| number.to_string()).join(", ")
            ))
        }
        MeshError::ZeroArea { face, area } => MeshFileError::content(format!(
            "{}: this face has no area in the pattern ({area:e} m²): mend its texture coordinates, remove it, or take the rest shape from the form in space with mesh.pattern = \"shape\"",
            place(face)
        )),
        MeshError::Topology(TopologyError::NonManifoldEdge { vertices, faces }) => {
            let faces = faces
                .into_iter()
                .map(|face| place(FaceId(face)).to_string());
            let [a, b] = vertices.map(number);
            polygons.no_sheet(format!(
                "{}: the edge from vertex {a} to vertex {b} belongs to more than two faces (the mesh is not manifold there): separate the layers, each with vertices of its own",
                faces.collect::<Vec<_>>().join(", ")
            ))
        }
        MeshError::Topology(TopologyError::InconsistentOrientation {
            vertices,
            first,
            second,
        }) => {
            let [a, b] = vertices.map(number);
            polygons.no_sheet(format!(
                "{} and {}: these faces run through the edge from vertex {a} to vertex {b} in the same direction, and no turning of faces mends it: the sheet is twisted into itself (as a Möbius strip is); cut it open there",
                place(first),
                place(second)
            ))
        }
        MeshError::Topology(TopologyError::DuplicateFace { first, second }) => {
            polygons.no_sheet(format!(
                "{} and {}: these faces have the same three vertices: remove one of them",
                place(first),
                place(second)
            ))
        }
        other => other.into(),
    }
}
