//! The ways in which one domain goes beyond another, in words.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{Bounds, Domain, FabricBounds};

/// Part by which a frame rate may be off: rounding.
const SAME_RATE: f64 = 1e-6;
/// Part by which lengths, speeds and gravity may be beyond their bounds.
const LOOSE: f64 = 0.1;
/// Part by which the number of vertices may be: at the same length of edges a cloth of another
/// size is not another cloth.
const LOOSE_COUNT: f64 = 0.5;
/// Distance that is no difference `[m]`.
const SMALL_DISTANCE: f64 = 0.01;
/// Speed that is no wind and no motion `[m/s]`.
const SMALL_SPEED: f64 = 0.1;

/// One way in which a scene goes beyond what a model was trained on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Departure {
    /// The aspect of the scene.
    pub aspect: Aspect,
    /// Both numbers, in words.
    pub words: String,
}

/// An aspect of a scene that can be unlike the training's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Aspect {
    /// Frames per second.
    FrameRate,
    /// Number of vertices.
    Vertices,
    /// Mean length of edges.
    EdgeLength,
    /// Panels that are sewn.
    Seams,
    /// Handles that hold at once.
    Handles,
    /// Handles at different heights.
    Heights,
    /// Handles that do not move as one body.
    Apart,
    /// Handles that are faster.
    Speed,
    /// Air that is faster.
    Wind,
    /// Gravity.
    Gravity,
    /// Density or stiffness.
    Fabric,
    /// Bodies, and the cloth itself.
    Contact,
}

impl Aspect {
    /// The name, as tables have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::FrameRate => "frame-rate",
            Self::Vertices => "vertices",
            Self::EdgeLength => "edge-length",
            Self::Seams => "seams",
            Self::Handles => "handles",
            Self::Heights => "heights",
            Self::Apart => "apart",
            Self::Speed => "speed",
            Self::Wind => "wind",
            Self::Gravity => "gravity",
            Self::Fabric => "fabric",
            Self::Contact => "contact",
        }
    }
}

impl fmt::Display for Departure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.words)
    }
}

impl Domain {
    /// The ways in which `scene` goes beyond this domain, in the order of [`Aspect`].
    pub fn departures(&self, scene: &Self) -> Vec<Departure> {
        let all = [
            self.of_rate(scene),
            self.of_count(scene),
            self.of_edges(scene),
            found(Aspect::Seams, scene.sewn && !self.sewn, || {
                "the cloth is sewn, trained on cloth in one piece".to_owned()
            }),
            self.of_handles(scene),
            self.of_heights(scene),
            self.of_distances(scene),
            self.of_speed(scene),
            self.of_wind(scene),
            self.of_gravity(scene),
            self.of_fabric(scene),
            found(Aspect::Contact, scene.contact && !self.contact, || {
                "the cloth touches itself or bodies, trained without: the network sees none"
                    .to_owned()
            }),
        ];
        all.into_iter().flatten().collect()
    }

    fn of_rate(&self, scene: &Self) -> Option<Departure> {
        let bounds = self.frame_rate;
        found(
            Aspect::FrameRate,
            !bounds.hold(scene.frame_rate, SAME_RATE),
            || {
                format!(
                    "{} frames per second, trained at {}",
                    scene.frame_rate, bounds
                )
            },
        )
    }

    fn of_count(&self, scene: &Self) -> Option<Departure> {
        let bounds = self.vertices;
        found(
            Aspect::Vertices,
            !bounds.hold(scene.vertices, LOOSE_COUNT),
            || format!("{} vertices, trained on {}", scene.vertices, bounds),
        )
    }

    fn of_edges(&self, scene: &Self) -> Option<Departure> {
        let [own, bounds] = [scene.edge_length, self.edge_length].map(|b| b.times(1e3));
        found(Aspect::EdgeLength, !bounds.hold(own, LOOSE), || {
            format!("edges of {own:.0} mm on average, trained on {bounds:.0} mm")
        })
    }

    fn of_handles(&self, scene: &Self) -> Option<Departure> {
        let (own, bounds) = (scene.handles, self.handles);
        found(Aspect::Handles, !bounds.hold(own, 0.0), || {
            let plural = if own == Bounds::of(1.0) { "" } else { "s" };
            format!("{own} handle{plural} held at once, trained with {bounds}")
        })
    }

    fn of_heights(&self, scene: &Self) -> Option<Departure> {
        let (own, most) = (scene.height_difference, self.height_difference);
        found(
            Aspect::Heights,
            own > most * (1.0 + LOOSE) + SMALL_DISTANCE,
            || format!("handles {own:.2} m apart in height, trained with at most {most:.2} m"),
        )
    }

    fn of_distances(&self, scene: &Self) -> Option<Departure> {
        let (own, most) = (scene.moved_apart, self.moved_apart);
        found(
            Aspect::Apart,
            own > most * (1.0 + LOOSE) + SMALL_DISTANCE,
            || {
                format!(
                    "the distance between handles changes by {own:.2} m, trained with at most {most:.2} m"
                )
            },
        )
    }

    fn of_speed(&self, scene: &Self) -> Option<Departure> {
        let (own, most) = (scene.handle_speed, self.handle_speed);
        found(
            Aspect::Speed,
            own > most * (1.0 + LOOSE) + SMALL_SPEED,
            || format!("handles at up to {own:.1} m/s, trained with up to {most:.1} m/s"),
        )
    }

    fn of_wind(&self, scene: &Self) -> Option<Departure> {
        let (own, most) = (scene.wind, self.wind);
        found(
            Aspect::Wind,
            own > most * (1.0 + LOOSE) + SMALL_SPEED,
            || {
                let trained = match most > 0.0 {
                    true => format!("in wind of up to {most:.1} m/s"),
                    false => "in still air".to_owned(),
                };
                format!("wind of up to {own:.1} m/s, trained {trained}")
            },
        )
    }

    fn of_gravity(&self, scene: &Self) -> Option<Departure> {
        let (own, bounds) = (scene.gravity, self.gravity);
        found(Aspect::Gravity, !bounds.hold(own, LOOSE), || {
            format!("gravity of {own:.2} m/s², trained with {bounds:.2} m/s²")
        })
    }

    fn of_fabric(&self, scene: &Self) -> Option<Departure> {
        let (own, known) = (scene.fabrics.as_ref()?, self.fabrics.as_ref()?);
        found(Aspect::Fabric, !known.hold(own), || {
            format!(
                "the fabric {} ({}), trained on {} ({})",
                own.names.join(", "),
                own.numbers(),
                known.names.join(", "),
                known.numbers()
            )
        })
    }
}

impl Bounds {
    /// Returns true if `other` is within, but for the part `loose` of the bounds.
    fn hold(self, other: Self, loose: f64) -> bool {
        other.least >= self.least * (1.0 - loose) && other.most <= self.most * (1.0 + loose)
    }

    fn times(self, factor: f64) -> Self {
        Self {
            least: self.least * factor,
            most: self.most * factor,
        }
    }
}

impl fmt::Display for Bounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.least, f)?;
        if self.most > self.least {
            f.write_str(" to ")?;
            fmt::Display::fmt(&self.most, f)?;
        }
        Ok(())
    }
}

impl FabricBounds {
    fn hold(&self, other: &Self) -> bool {
        let pairs = [
            (self.density, other.density),
            (self.stretch, other.stretch),
            (self.bend, other.bend),
        ];
        pairs.iter().all(|(own, other)| own.hold(*other, LOOSE))
    }

    fn numbers(&self) -> String {
        format!(
            "{:.3} kg/m², {:.0} N/m, {:.1} µN m",
            self.density,
            self.stretch,
            self.bend.times(1e6)
        )
    }
}

fn found(aspect: Aspect, is: bool, words: impl FnOnce() -> String) -> Option<Departure> {
    is.then(|| Departure {
        aspect,
        words: words(),
    })
}
