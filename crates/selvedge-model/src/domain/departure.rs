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
        let mut found = Vec::new();
        let mut add = |aspect, is_beyond: bool, words: fmt::Arguments<'_>| {
            if is_beyond {
                let words = words.to_string();
                found.push(Departure { aspect, words });
            }
        };
        let beyond = |own: f64, most: f64, small: f64| own > most * (1.0 + LOOSE) + small;

        let (own, known) = (scene.frame_rate, self.frame_rate);
        let words = format_args!("{own} frames per second, trained at {known}");
        add(Aspect::FrameRate, !known.hold(own, SAME_RATE), words);
        let (own, known) = (scene.vertices, self.vertices);
        let words = format_args!("{own} vertices, trained on {known}");
        add(Aspect::Vertices, !known.hold(own, LOOSE_COUNT), words);
        let [own, known] = [scene.edge_length, self.edge_length].map(|b| b.times(1e3));
        let words = format_args!("edges of {own:.0} mm on average, trained on {known:.0} mm");
        add(Aspect::EdgeLength, !known.hold(own, LOOSE), words);
        let words = format_args!("the cloth is sewn, trained on cloth in one piece");
        add(Aspect::Seams, scene.sewn && !self.sewn, words);

        let (own, known) = (scene.handles, self.handles);
        let plural = if own == Bounds::of(1.0) { "" } else { "s" };
        let words = format_args!("{own} handle{plural} held at once, trained with {known}");
        add(Aspect::Handles, !known.hold(own, 0.0), words);
        let (own, most) = (scene.height_difference, self.height_difference);
        let words =
            format_args!("handles {own:.2} m apart in height, trained with at most {most:.2} m");
        add(Aspect::Heights, beyond(own, most, SMALL_DISTANCE), words);
        let (own, most) = (scene.moved_apart, self.moved_apart);
        let words = format_args!(
            "the distance between handles changes by {own:.2} m, trained with at most {most:.2} m"
        );
        add(Aspect::Apart, beyond(own, most, SMALL_DISTANCE), words);
        let (own, most) = (scene.handle_speed, self.handle_speed);
        let words = format_args!("handles at up to {own:.1} m/s, trained with up to {most:.1} m/s");
        add(Aspect::Speed, beyond(own, most, SMALL_SPEED), words);

        let (own, most) = (scene.wind, self.wind);
        let words = if most > 0.0 {
            format_args!("wind of up to {own:.1} m/s, trained in wind of up to {most:.1} m/s")
        } else {
            format_args!("wind of up to {own:.1} m/s, trained in still air")
        };
        add(Aspect::Wind, beyond(own, most, SMALL_SPEED), words);
        let (own, known) = (scene.gravity, self.gravity);
        let words = format_args!("gravity of {own:.2} m/s², trained with {known:.2} m/s²");
        add(Aspect::Gravity, !known.hold(own, LOOSE), words);
        if let (Some(own), Some(known)) = (&scene.fabrics, &self.fabrics) {
            let words = format_args!("the fabric {own}, trained on {known}");
            add(Aspect::Fabric, !known.hold(own), words);
        }
        let words = format_args!(
            "the cloth touches itself or bodies, trained without: the network sees none"
        );
        add(Aspect::Contact, scene.contact && !self.contact, words);
        found
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
}

impl fmt::Display for FabricBounds {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (names, bend) = (self.names.join(", "), self.bend.times(1e6));
        let (density, stretch) = (self.density, self.stretch);
        write!(
            f,
            "{names} ({density:.3} kg/m², {stretch:.0} N/m, {bend:.1} µN m)"
        )
    }
}
