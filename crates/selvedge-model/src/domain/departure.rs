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
/// Acceleration that is none of a hand `[m/s²]`.
const SMALL_ACCELERATION: f64 = 2.0;

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
    /// Handles whose speed changes more from frame to frame.
    Acceleration,
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
            Self::Acceleration => "acceleration",
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
    /// The ways in which `scene` goes beyond this domain, the farthest beyond first: a kind of cloth or
    /// touch that no training had, then the largest ratio of a number to its bound, which the
    /// words end with.
    pub fn departures(&self, scene: &Self) -> Vec<Departure> {
        let mut found = Vec::new();
        let mut add = |aspect, excess: f64, words: fmt::Arguments<'_>| {
            if excess > 1.0 {
                let times = match excess {
                    f64::INFINITY => String::new(),
                    times => format!(" ({times:.1} times the bound)"),
                };
                let words = format!("{words}{times}");
                found.push((excess, Departure { aspect, words }));
            }
        };
        let over = |own: f64, most: f64, small: f64| own / (most * (1.0 + LOOSE) + small);
        let none = |beyond: bool| if beyond { f64::INFINITY } else { 0.0 };

        let (own, known) = (scene.frame_rate, self.frame_rate);
        let words = format_args!("{own} frames per second, trained at {known}");
        add(Aspect::FrameRate, known.excess(own, SAME_RATE), words);
        let (own, known) = (scene.vertices, self.vertices);
        let words = format_args!("{own} vertices, trained on {known}");
        add(Aspect::Vertices, known.excess(own, LOOSE_COUNT), words);
        let [own, known] = [scene.edge_length, self.edge_length].map(|b| b.times(1e3));
        let words = format_args!("edges of {own:.0} mm on average, trained on {known:.0} mm");
        add(Aspect::EdgeLength, known.excess(own, LOOSE), words);
        let words = format_args!("the cloth is sewn, trained on cloth in one piece");
        add(Aspect::Seams, none(scene.sewn && !self.sewn), words);

        let (own, known) = (scene.handles, self.handles);
        let plural = if own == Bounds::of(1.0) { "" } else { "s" };
        let words = format_args!("{own} handle{plural} held at once, trained with {known}");
        add(Aspect::Handles, known.excess(own, 0.0), words);
        let (own, most) = (scene.height_difference, self.height_difference);
        let words =
            format_args!("handles {own:.2} m apart in height, trained with at most {most:.2} m");
        add(Aspect::Heights, over(own, most, SMALL_DISTANCE), words);
        let (own, most) = (scene.moved_apart, self.moved_apart);
        let words = format_args!(
            "the distance between handles changes by {own:.2} m, trained with at most {most:.2} m"
        );
        add(Aspect::Apart, over(own, most, SMALL_DISTANCE), words);
        let (own, most) = (scene.handle_speed, self.handle_speed);
        let words = format_args!("handles at up to {own:.1} m/s, trained with up to {most:.1} m/s");
        add(Aspect::Speed, over(own, most, SMALL_SPEED), words);
        if let (Some(own), Some(most)) = (scene.handle_acceleration, self.handle_acceleration) {
            let words = format_args!(
                "handles accelerate by up to {own:.0} m/s², trained with up to {most:.0} m/s²"
            );
            let excess = over(own, most, SMALL_ACCELERATION);
            add(Aspect::Acceleration, excess, words);
        }

        let (own, most) = (scene.wind, self.wind);
        let words = if most > 0.0 {
            format_args!("wind of up to {own:.1} m/s, trained in wind of up to {most:.1} m/s")
        } else {
            format_args!("wind of up to {own:.1} m/s, trained in still air")
        };
        let excess = over(own, most, SMALL_SPEED);
        let excess = if most > 0.0 { excess } else { none(excess > 1.0) };
        add(Aspect::Wind, excess, words);
        let (own, known) = (scene.gravity, self.gravity);
        let words = format_args!("gravity of {own:.2} m/s², trained with {known:.2} m/s²");
        add(Aspect::Gravity, known.excess(own, LOOSE), words);
        if let (Some(own), Some(known)) = (&scene.fabrics, &self.fabrics) {
            let words = format_args!("the fabric {own}, trained on {known}");
            add(Aspect::Fabric, known.excess(own), words);
        }
        let words = format_args!(
            "the cloth touches itself or bodies, trained without: the network sees none"
        );
        add(Aspect::Contact, none(scene.contact && !self.contact), words);
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.into_iter().map(|(_, departure)| departure).collect()
    }
}

impl Bounds {
    /// How many times `other` is beyond these bounds widened by the part `loose`; at most 1 within.
    fn excess(self, other: Self, loose: f64) -> f64 {
        let ratio = |larger: f64, smaller: f64| match larger {
            0.0 => 0.0,
            _ => larger / smaller,
        };
        let below = ratio(self.least * (1.0 - loose), other.least);
        below.max(ratio(other.most, self.most * (1.0 + loose)))
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
    fn excess(&self, other: &Self) -> f64 {
        let pairs = [
            (self.density, other.density),
            (self.stretch, other.stretch),
            (self.bend, other.bend),
        ];
        let excesses = pairs.iter().map(|(own, other)| own.excess(*other, LOOSE));
        excesses.fold(0.0, f64::max)
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
