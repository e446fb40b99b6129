//! The body of an obstacle: numbers of a simple one, a shipped one, or a file with its hash.
//!
//! Errors in this module, as in all of obstacles, are the field and its problem, and get the name of
//! the obstacle where they leave.

use std::f64::consts::TAU;
use std::fmt::Display;
use std::path::Path;

use glam::{DQuat, DVec3};
use selvedge_cloth::bodies::{self, Body};
use serde::{Deserialize, Serialize};

use super::read;
use crate::formats::file_error::Problem;
use crate::formats::input::{ending_of, hash};

/// Extent of simple bodies `[m]`.
const SIZES: std::ops::RangeInclusive<f64> = 1e-4..=1e5;

/// Edges of round bodies in units of their radius, where nothing else is said.
const SPHERE_EDGE: f64 = 0.15;
const TUBE_EDGE: f64 = 0.25;

/// A body before it is placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum BodySpec {
    /// A square or a rectangle of a plane.
    Plane(Plane),
    /// A sphere about the origin.
    Sphere(Sphere),
    /// A capsule along y about the origin.
    Capsule(Tube),
    /// A cylinder along y about the origin.
    Cylinder(Tube),
    /// A box about the origin.
    Box(Cuboid),
    /// A mesh, closed or open.
    Mesh {
        /// Path of the file relative to the scene's folder, or the name of a shipped body.
        path: String,
        /// BLAKE3 hash of its bytes, in hexadecimal.
        blake3: String,
    },
}

/// A square or a rectangle of a plane.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Direction across it; need not have length one.
    #[serde(default = "crate::formats::up_axis::up")]
    pub normal: DVec3,
    /// Distance of the plane from the origin along the normal `[m]`.
    #[serde(default)]
    pub height: f64,
    /// Its sides about the point nearest to the origin.
    #[serde(default = "far")]
    pub size: Sides,
}

/// Sides of a piece of a plane `[m]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected one number of metres, or two in brackets"
)]
pub enum Sides {
    /// All of a square.
    Square(f64),
    /// Along x and along z, where the plane is level; turned with it otherwise.
    Rectangle([f64; 2]),
}

/// A sphere about the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sphere {
    /// Radius `[m]`.
    pub radius: f64,
    /// Longest edge of the mesh that is drawn `[m]`; 0.15 of the radius where none is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<f64>,
}

/// A capsule or a cylinder along y about the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tube {
    /// Radius `[m]`.
    pub radius: f64,
    /// Length of its axis, without round ends `[m]`.
    pub length: f64,
    /// Edges of its mesh `[m]`; 0.25 of the radius where none are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub edge: Option<f64>,
}

/// A box about the origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cuboid {
    /// Its sides along x, y and z `[m]`.
    pub size: DVec3,
}

fn far() -> Sides {
    Sides::Square(10.0)
}

impl BodySpec {
    /// The mesh in the file at `path`, as it is now, for the obstacle of this name.
    pub(crate) fn mesh(path: String, folder: &Path, name: &str) -> Result<Self, Problem> {
        Self::mesh_now(path, folder).map_err(problem_of(name))
    }

    /// The mesh in the file at `path`, as it is now.
    pub(super) fn mesh_now(path: String, folder: &Path) -> Result<Self, String> {
        let blake3 = hash(&read::bytes_of("mesh", &path, folder)?);
        Ok(Self::Mesh { path, blake3 })
    }

    /// The file of a mesh, if it is one.
    pub(super) fn file(&self) -> Option<&str> {
        match self {
            Self::Mesh { path, .. } if read::shipped(path).is_none() => Some(path),
            _ => None,
        }
    }

    /// Returns true where the file's format splits points along seams.
    pub(super) fn is_split(&self) -> bool {
        matches!(self, Self::Mesh { path, .. } if ending_of(Path::new(path)) != "obj")
    }

    /// Makes the body, which `is_still` or moves as the scene says; what of its file is left out is
    /// said in `warnings`.
    pub(super) fn build(
        &self,
        folder: &Path,
        is_still: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Body, String> {
        match self {
            Self::Plane(plane) => plane.build(),
            &Self::Sphere(Sphere { radius, edge }) => {
                check("sphere.radius", radius)?;
                let edge = edge.unwrap_or(SPHERE_EDGE * radius);
                check_edge("sphere.edge", edge, bodies::FINEST_SPHERE * radius)?;
                Ok(bodies::sphere(radius, edge))
            }
            Self::Capsule(tube) => {
                let edge = tube.check("capsule", true)?;
                Ok(bodies::capsule(tube.radius, tube.length, edge))
            }
            Self::Cylinder(tube) => {
                let edge = tube.check("cylinder", false)?;
                Ok(bodies::cylinder(tube.radius, tube.length, edge))
            }
            Self::Box(Cuboid { size }) => {
                for side in size.to_array() {
                    check("box.size", side)?;
                }
                Ok(bodies::cuboid(*size))
            }
            Self::Mesh { path, blake3 } => {
                let bytes = read::unchanged("mesh", path, blake3, folder)?;
                if is_still {
                    warnings.extend(read::own_motion(path, &bytes));
                }
                read::mesh(path, &bytes, warnings)
            }
        }
    }
}

impl Plane {
    fn build(&self) -> Result<Body, String> {
        let normal = self.normal.try_normalize();
        let normal = normal.ok_or_else(|| wrong("plane.normal", "a direction", self.normal))?;
        let sides = match self.size {
            Sides::Square(side) => [side; 2],
            Sides::Rectangle(sides) => sides,
        };
        for side in sides {
            check("plane.size", side)?;
        }
        if !self.height.is_finite() {
            return Err(wrong("plane.height", "finite", self.height));
        }
        let turn = DQuat::from_rotation_arc(DVec3::Y, normal);
        let mut body = bodies::plane(sides);
        for point in &mut body.points {
            *point = turn * *point + self.height * normal;
        }
        Ok(body)
    }
}

impl Tube {
    /// The edges of its mesh, of a body of this `kind` that may have a length of zero or not.
    fn check(&self, kind: &str, may_be_round: bool) -> Result<f64, String> {
        check(&format!("{kind}.radius"), self.radius)?;
        if self.length != 0.0 || !may_be_round {
            check(&format!("{kind}.length"), self.length)?;
        }
        let edge = self.edge.unwrap_or(TUBE_EDGE * self.radius);
        let shortest = TAU * self.radius / bodies::MOST_PIECES as f64;
        check_edge(&format!("{kind}.edge"), edge, shortest)?;
        Ok(edge)
    }
}

fn check(field: &str, value: f64) -> Result<(), String> {
    if SIZES.contains(&value) {
        Ok(())
    } else {
        Err(wrong(field, "between 0.0001 and 100000 m", value))
    }
}

/// Checks the longest edge of a round body that has edges of `shortest` `[m]` at best.
fn check_edge(field: &str, edge: f64, shortest: f64) -> Result<(), String> {
    check(field, edge)?;
    if edge >= shortest {
        return Ok(());
    }
    let micrometres = (1e6 * shortest).ceil();
    let expected = format!("at least {} m for this radius", micrometres / 1e6);
    Err(wrong(field, &expected, edge))
}

fn wrong(field: &str, expected: &str, found: impl Display) -> String {
    format!("{field}: must be {expected}, found {found}")
}

/// Adds the name of the obstacle to the problem of a field.
pub(super) fn problem_of(name: &str) -> impl Fn(String) -> Problem {
    move |problem| Problem(format!("obstacles[{name:?}].{problem}"))
}
