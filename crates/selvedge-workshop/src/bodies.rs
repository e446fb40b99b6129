//! Bodies of the viewer: the obstacles of a scene, and a floor and a ball that are put beside a
//! cloth that touches.

use std::path::Path;

use glam::{DVec3, Vec3};
use selvedge::rounded;
use selvedge_cloth::{ContactSettings, Obstacle, Scene};
use selvedge_data::{
    BodySpec, LoadedScene, ObstacleMotion, ObstacleSpec, Placement, Plane, Sides, Sphere,
};
use selvedge_live::{Body, BodyKind, Order, kind_of};

/// The name of the ball, which no scene has.
const BALL: &str = "the viewer's ball";
/// Radius of the ball `[m]`.
const RADIUS: f64 = 0.12;
/// Place of the ball before it is thrown `[m]`.
const AWAY: DVec3 = DVec3::new(0.0, -1000.0, 0.0);
/// Distance of the floor below the cloth in units of its height, which counts as this at least
/// `[m]`.
const BELOW: f64 = 0.3;
const LEAST_HEIGHT: f64 = 0.5;

/// Puts a ball beside a cloth that touches, and contact and a floor where the order asks for them.
pub(super) fn put(loaded: &mut LoadedScene, order: &Order) -> anyhow::Result<()> {
    let setting = &mut loaded.spec.setting;
    if setting.contact.is_none() && !order.touches {
        return Ok(());
    }
    let has_contact = setting.contact.is_some();
    if !has_contact {
        let lengths = loaded.scene.mesh.pattern().edge_lengths();
        let shortest = lengths.into_iter().fold(f64::INFINITY, f64::min);
        setting.contact = Some(ContactSettings::for_edges(shortest));
        let heights = loaded.scene.mesh.positions().iter().map(|p| p.y);
        let low = heights.clone().fold(f64::INFINITY, f64::min);
        let high = heights.fold(f64::NEG_INFINITY, f64::max);
        let height = low - BELOW * (high - low).max(LEAST_HEIGHT);
        setting.obstacles.push(still(
            "floor",
            BodySpec::Plane(Plane {
                normal: DVec3::Y,
                height,
                size: Sides::Square(20.0),
            }),
            DVec3::ZERO,
        ));
    }
    let ball = BodySpec::Sphere(Sphere {
        radius: RADIUS,
        edge: None,
    });
    setting.obstacles.push(still(BALL, ball, AWAY));
    let folder = Path::new(&order.scene).parent().unwrap_or(Path::new(""));
    loaded.scene = loaded.spec.build(folder)?;
    Ok(())
}

fn still(name: &str, body: BodySpec, translation: DVec3) -> ObstacleSpec {
    ObstacleSpec {
        name: name.to_owned(),
        body,
        transform: Placement {
            translation,
            ..Placement::default()
        },
        motion: ObstacleMotion::Still,
        friction: None,
        thickness: None,
    }
}

/// The bodies of a scene.
pub(super) fn of(scene: &Scene) -> Vec<Body> {
    scene.obstacles.iter().map(body).collect()
}

fn body(obstacle: &Obstacle) -> Body {
    let points: Vec<DVec3> = obstacle.positions_at(0.0).collect();
    let points: Vec<Vec3> = rounded(&points);
    Body {
        name: obstacle.name().to_owned(),
        kind: match obstacle.name() {
            BALL => BodyKind::Ball,
            _ => kind_of(obstacle.faces(), &points),
        },
        points: points.len(),
        faces: obstacle.faces().to_vec(),
    }
}
