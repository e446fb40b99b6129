//! A scene: mesh, handles, material, environment and motion, checked against each other.

use std::collections::BTreeMap;

use crate::error::{SceneError, require};
use crate::{
    ContactSettings, Environment, FaceId, HandlePath, HandleSchedule, Handles, Material, Mesh,
    Motion, Obstacle, PhysicsSettings, RestShape, SagSettings,
};

/// Frames per second of a scene that does not say otherwise.
pub const DEFAULT_FRAME_RATE: f64 = 60.0;

/// Everything that decides the motion of a cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the scene.
    pub name: String,
    /// The cloth in its start positions.
    pub mesh: Mesh,
    /// The held vertices.
    pub handles: Handles,
    /// Times at which handles let go.
    pub schedule: HandleSchedule,
    /// The material of the cloth.
    pub material: Material,
    /// Materials of faces whose fabric has a name in the mesh, by these names; all other faces have
    /// `material`.
    pub fabrics: BTreeMap<String, Material>,
    /// Gravity, air and wind.
    pub environment: Environment,
    /// Motion of the handles.
    pub motion: Motion,
    /// Settings of the reference simulator.
    pub physics: PhysicsSettings,
    /// Settings of the search for the sagged rest pose.
    pub sag: SagSettings,
    /// Frames per second.
    pub frame_rate: f64,
    /// Contact with obstacles and of the cloth with itself; none lets everything pass.
    pub contact: Option<ContactSettings>,
    /// The bodies that the cloth touches, if it has `contact`.
    pub obstacles: Vec<Obstacle>,
}

impl Scene {
    /// A cloth that is held still for a second, by the default settings in all else, without contact.
    pub fn of(name: &str, mesh: Mesh, handles: Handles, material: Material) -> Self {
        Self {
            name: name.to_owned(),
            mesh,
            handles,
            schedule: HandleSchedule::default(),
            material,
            fabrics: BTreeMap::new(),
            environment: Environment::default(),
            motion: Motion::still(1.0),
            physics: PhysicsSettings::default(),
            sag: SagSettings::default(),
            frame_rate: DEFAULT_FRAME_RATE,
            contact: None,
            obstacles: Vec::new(),
        }
    }

    /// Checks every part, and that the motion can drive these handles.
    ///
    /// # Errors
    /// The first part that cannot be used.
    pub fn validate(&self) -> Result<(), SceneError> {
        self.handles
            .check_range(self.mesh.topology().vertex_count())?;
        let schedule = self.schedule.validate(self.handles.len());
        schedule.map_err(|error| error.of("handles"))?;
        self.material.validate()?;
        self.validate_fabrics()?;
        self.environment.validate()?;
        self.physics.validate()?;
        self.sag.validate()?;
        self.validate_contact()?;
        let (rate, expected) = (self.frame_rate, "between 1 and 100000 frames per second");
        require((1.0..=1e5).contains(&rate), "frame_rate", expected, rate)?;
        if let Some(gust) = self.environment.gust {
            let least = 1.0 / rate;
            if gust.period < least {
                let found = gust.period;
                return Err(SceneError(format!(
                    "environment.gust.period must be at least a frame, {least} s, because the wind is held over each; found {found} s"
                )));
            }
        }
        self.handle_path()?;
        Ok(())
    }

    fn validate_contact(&self) -> Result<(), SceneError> {
        match &self.contact {
            Some(contact) => {
                contact.validate()?;
                self.obstacles.iter().try_for_each(|obstacle| {
                    let thickness = obstacle.thickness().unwrap_or(contact.thickness);
                    let holds = thickness >= 10.0 * contact.floor;
                    let expected = format!("at least ten times contact.floor, {}", contact.floor);
                    let field = format!("obstacle {:?}: thickness", obstacle.name());
                    require(holds, field, &expected, thickness)
                })
            }
            None if self.obstacles.is_empty() => Ok(()),
            None => Err(SceneError(
                "the scene has obstacles but no contact: write `contact = {}`, or remove them"
                    .to_owned(),
            )),
        }
    }

    fn validate_fabrics(&self) -> Result<(), SceneError> {
        let names = &self.mesh.fabrics().names;
        for (name, material) in &self.fabrics {
            material.validate()?;
            if !names.contains(name) {
                let known = names.join(", ");
                return Err(SceneError(format!(
                    "fabrics: no face of the mesh has a fabric named {name:?}; it has [{known}], the names of its usemtl statements"
                )));
            }
        }
        Ok(())
    }

    /// The materials of the cloth, its own first, and the number of each face's, `[faces]`.
    pub fn materials(&self) -> (Vec<&Material>, Vec<usize>) {
        let fabrics = self.mesh.fabrics();
        let mut materials = vec![&self.material];
        let numbers: Vec<usize> = fabrics
            .names
            .iter()
            .map(|name| match self.fabrics.get(name) {
                Some(material) => {
                    materials.push(material);
                    materials.len() - 1
                }
                None => 0,
            })
            .collect();
        let faces = 0..self.mesh.topology().faces().len() as u32;
        let of = |face| fabrics.of(FaceId(face)).map_or(0, |name| numbers[name]);
        (materials, faces.map(of).collect())
    }

    /// Areas, lengths and masses of the cloth's rest shape.
    pub fn rest_shape(&self) -> RestShape {
        let (materials, of_face) = self.materials();
        self.mesh
            .rest_shape_of(|face| materials[of_face[face.index()]].density)
    }

    /// The path of the handles, from where they start.
    ///
    /// # Errors
    /// [`SceneError`] when the motion cannot drive these handles.
    pub fn handle_path(&self) -> Result<HandlePath, SceneError> {
        let start = self.handles.select(self.mesh.positions());
        let path = self.motion.bind(&start, self.frame_rate)?;
        Ok(path.scheduled(self.schedule.clone()))
    }

    /// Frames after the start that the motion lasts; a run has one position more.
    ///
    /// # Errors
    /// [`SceneError`] when the motion cannot drive these handles.
    pub fn frame_count(&self) -> Result<usize, SceneError> {
        Ok(self.handle_path()?.frame_count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses;
    use crate::generate::square;
    use crate::{BendTable, ContactSettings, Gust, Obstacle, Release, StretchTable};
    use glam::DVec3;

    fn scene() -> Scene {
        let sheet = square(30, 1.0, 0).unwrap();
        let material = Material {
            name: "felt".into(),
            source: String::new(),
            density: 0.2,
            damping: 0.0,
            stretch: StretchTable([[30.0; 4]; 6]),
            bend: BendTable([[2e-5; 5]; 3]),
            compression: crate::Compression::default(),
        };
        let handles = Handles::new(&sheet.labels["upper-corners"], 30).unwrap();
        Scene {
            motion: Motion::still(2.0),
            ..Scene::of("square", sheet.mesh, handles, material)
        }
    }

    #[test]
    fn a_body_is_as_thick_as_ten_floors_at_least() {
        let mut scene = scene();
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
        let thin = Obstacle::new("card", points, vec![[0, 1, 2]]).unwrap();
        scene.contact = Some(ContactSettings::default());
        scene.obstacles = vec![thin.clone().with_thickness(3e-4).unwrap()];
        scene.validate().unwrap();
        scene.obstacles = vec![thin.with_thickness(1e-5).unwrap()];
        let text = scene.validate().unwrap_err().to_string();
        assert!(
            text.contains("\"card\": thickness must be at least ten times"),
            "{text}"
        );
    }

    #[test]
    fn the_path_starts_at_the_handles() {
        let scene = scene();
        scene.validate().unwrap();
        assert_eq!(scene.frame_count(), Ok(120));
        let corners = scene.handle_path().unwrap().at(0.0);
        assert_eq!(corners, scene.handles.select(scene.mesh.positions()));
    }

    #[test]
    fn each_part_is_checked() {
        let scene = scene();
        refuses(
            &scene,
            Scene::validate,
            &[
                ("handle 0 is vertex 40", |s| {
                    s.handles = Handles::new(&[40], 50).unwrap();
                }),
                ("handles: released[0] names handle 2", |s| {
                    s.schedule.releases = vec![Release {
                        handles: vec![2],
                        from: 0.0,
                        to: None,
                    }];
                }),
                ("material felt: density", |s| s.material.density = 0.0),
                ("environment.air_drag", |s| s.environment.air_drag = -1.0),
                ("environment.gust.period must be at least a frame", |s| {
                    s.environment.gust = Some(Gust {
                        speed: DVec3::X,
                        period: 1.0 / 61.0,
                        seed: 0,
                    });
                }),
                ("motion: blocks[0].duration", |s| {
                    s.motion = Motion::still(0.0)
                }),
                ("physics.substeps", |s| s.physics.substeps = 0),
                ("sag.tolerance", |s| s.sag.tolerance = 0.0),
                ("frame_rate must be between 1", |s| s.frame_rate = 0.5),
            ],
        );
    }
}
