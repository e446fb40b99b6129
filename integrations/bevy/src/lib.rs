//! Cloth in Bevy: a cape, a coat, a flag that follows entities, at a fixed time step.
//!
//! The [`Cloth`] of an entity is a run of Selvedge. Its handles go with one entity, the bodies of its
//! scene each with theirs. [`ClothPlugin`] moves it after transforms are propagated, by as many
//! frames as the time has, and with the feature `mesh` puts it into the entity's `Mesh3d`. Positions
//! are in the world: the entity itself stays at the origin.

use bevy_app::{App, Plugin, PostUpdate};
use bevy_ecs::prelude::*;
use bevy_time::Time;
use bevy_transform::TransformSystems;
use bevy_transform::components::GlobalTransform;
use selvedge::glam::{DQuat, DVec3, Vec3};
use selvedge::{HandleTargets, Rigid, Run, StepError, Stepper};

/// Moves every [`Cloth`].
pub struct ClothPlugin;

impl Plugin for ClothPlugin {
    fn build(&self, app: &mut App) {
        app.add_systems(PostUpdate, follow.after(TransformSystems::Propagate));
        #[cfg(feature = "mesh")]
        app.add_systems(PostUpdate, mesh::show.after(follow));
    }
}

/// A cloth that is worn. When its first frame comes, the entities stand as the scene has the bodies.
#[derive(Component)]
pub struct Cloth {
    /// The run; its `positions` are to be drawn.
    pub run: Run,
    /// Frames of the cloth in one of the game, at most. What a longer one has more is left out: the
    /// cloth is set on by as much.
    pub most_frames: usize,
    /// Handles that move faster than this `[m/s]` are taken to be set elsewhere: the cloth goes along
    /// rigidly, and the bodies take a quarter of a second to where their entities are.
    pub fastest: f64,
    /// What could not be moved last; the cloth began anew then, where its entities stood.
    pub problem: Option<StepError>,
    entities: Vec<Entity>,
    held: Vec<DVec3>,
    begin: Vec<Rigid>,
    last: Vec<Rigid>,
    waiting: f64,
    /// Frames in which the bodies still go to where their entities are, after a jump.
    catching_up: usize,
    /// How the anchor went in the last frame, in its own axes.
    step: Rigid,
}

impl Cloth {
    /// A cloth whose handles go with `anchor`, and the bodies of whose scene go with `bodies`.
    #[must_use]
    pub fn new(run: Run, anchor: Entity, bodies: &[Entity]) -> Self {
        Self {
            held: run.handle_places(),
            run,
            most_frames: 4,
            fastest: 10.0,
            problem: None,
            entities: [&[anchor], bodies].concat(),
            begin: Vec::new(),
            last: Vec::new(),
            waiting: 0.0,
            catching_up: 0,
            step: Rigid::default(),
        }
    }

    /// Moves the cloth by the frames that fit into `seconds`; its entities are at these places.
    fn update(&mut self, seconds: f64, places: &[Rigid]) -> Result<(), StepError> {
        if self.begin.is_empty() {
            self.begin = places.iter().map(inverse).collect();
            self.last = vec![Rigid::default(); places.len()];
        }
        let begin = places.iter().zip(&self.begin);
        let now: Vec<Rigid> = begin.map(|(place, begin)| place.after(begin)).collect();
        let frame = 1.0 / self.run.scene().built().frame_rate;
        self.waiting += seconds;
        let frames = ((self.waiting / frame + 1e-6) as usize).min(self.most_frames);
        self.waiting -= frames as f64 * frame;
        let farthest = self.fastest * frames as f64 * frame;
        let way = |p: &DVec3| self.last[0].of(*p).distance(now[0].of(*p));
        let far = self.held.iter().map(way).fold(0.0, f64::max);
        let jumps = frames > 0 && (far > farthest || self.waiting > frame);
        if jumps {
            // Limbs that move as far within a frame would beat the cloth away.
            self.catching_up = (0.25 / frame) as usize;
            self.waiting = 0.0;
        }
        let moved = self.move_to(&now, frames, jumps);
        if moved.is_err() {
            self.run.reset()?;
            self.last.fill(Rigid::default());
            self.catching_up = (0.25 / frame) as usize;
            self.step = Rigid::default();
            self.carry(now[0])?;
        }
        moved
    }

    fn move_to(&mut self, now: &[Rigid], frames: usize, jumps: bool) -> Result<(), StepError> {
        if jumps {
            // Beyond the jump, or the time that is left out, the handles go on as fast as before.
            let back = inverse(&self.step);
            self.carry((0..frames).fold(now[0], |place, _| place.after(&back)))?;
        }
        for left in (1..=frames).rev() {
            // Bodies go with the anchor, and beside it to where they shall be.
            let (from, to) = (inverse(&self.last[0]), inverse(&now[0]));
            let anchor = between(&self.last[0], &now[0], left);
            for (last, now) in self.last[1..].iter_mut().zip(&now[1..]) {
                let (last_pose, pose) = (from.after(last), to.after(now));
                *last = anchor.after(&between(&last_pose, &pose, left.max(self.catching_up)));
            }
            self.step = from.after(&anchor);
            self.last[0] = anchor;
            self.catching_up = self.catching_up.saturating_sub(1);
            for (body, place) in self.last[1..].iter().enumerate() {
                self.run.lead_obstacle(body, *place)?;
            }
            let targets = self.held.iter().map(|p| anchor.of(*p)).collect();
            let frame = self.run.frame() + 1;
            let targets = HandleTargets::at_frame_end(targets);
            let targets = targets.map_err(|source| StepError::Handles { frame, source })?;
            self.run.step_to(&targets)?;
        }
        Ok(())
    }

    /// Carries cloth and bodies along with the anchor, rigidly.
    fn carry(&mut self, to: Rigid) -> Result<(), StepError> {
        let way = to.after(&inverse(&self.last[0]));
        let all: Vec<usize> = (0..self.last.len() - 1).collect();
        self.run.teleport(way, &all)?;
        for place in &mut self.last {
            *place = way.after(place);
        }
        Ok(())
    }
}

fn inverse(place: &Rigid) -> Rigid {
    let turn = place.turn.inverse();
    Rigid {
        turn,
        by: turn * -place.by,
    }
}

/// A frame's part of the way from `last` to `now`, of `left` frames.
fn between(last: &Rigid, now: &Rigid, left: usize) -> Rigid {
    let part = 1.0 / left as f64;
    Rigid {
        turn: last.turn.slerp(now.turn, part),
        by: last.by.lerp(now.by, part),
    }
}

fn place_of(transform: &GlobalTransform) -> Rigid {
    let (_, turn, by) = transform.to_scale_rotation_translation();
    Rigid {
        turn: DQuat::from_array(turn.to_array().map(f64::from)).normalize(),
        by: Vec3::from_array(by.to_array()).as_dvec3(),
    }
}

fn follow(time: Res<Time>, places: Query<&GlobalTransform>, mut cloths: Query<&mut Cloth>) {
    for mut cloth in &mut cloths {
        let found = cloth
            .entities
            .iter()
            .map(|entity| places.get(*entity).map(place_of));
        // An entity that is gone leads nothing: the cloth stays.
        let Ok(now) = found.collect::<Result<Vec<Rigid>, _>>() else {
            continue;
        };
        if let Err(error) = cloth.update(time.delta_secs_f64(), &now) {
            tracing::warn!("the cloth begins anew: {error}");
            cloth.problem = Some(error);
        }
    }
}

#[cfg(feature = "mesh")]
mod mesh {
    use bevy_asset::{Assets, RenderAssetUsages};
    use bevy_ecs::prelude::*;
    use bevy_mesh::{Indices, Mesh, Mesh3d, PrimitiveTopology};
    use selvedge::Stepper;

    use crate::Cloth;

    /// Puts positions and normals of the cloth into the mesh of its entity.
    pub(crate) fn show(
        mut meshes: ResMut<Assets<Mesh>>,
        shown: Query<(&Cloth, &Mesh3d), Changed<Cloth>>,
    ) {
        for (cloth, handle) in &shown {
            let positions: Vec<[f32; 3]> =
                cloth.run.positions().iter().map(|p| p.to_array()).collect();
            let faces = cloth.run.topology().face_indices().as_flattened().to_vec();
            let mesh = Mesh::new(
                PrimitiveTopology::TriangleList,
                RenderAssetUsages::default(),
            )
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
            .with_inserted_indices(Indices::U32(faces))
            .with_computed_smooth_normals();
            // A handle that is gone shows nothing.
            let _ = meshes.insert(handle.id(), mesh);
        }
    }
}
