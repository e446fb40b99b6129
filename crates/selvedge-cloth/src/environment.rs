//! Gravity and air, which may come in gusts.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::Gust;
use crate::setting::{SettingError, require, require_positive};

/// Fastest wind `[m/s]`, some ten hurricanes, and its gusts.
const FASTEST_WIND: f64 = 1e3;
/// Strongest gravity `[m/s²]`.
const STRONGEST_GRAVITY: f64 = 1e6;

/// Gravity, air and wind around the cloth. Defaults: gravity (0, -9.8, 0), still air of density 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Acceleration of gravity `[m/s²]`.
    pub gravity: DVec3,
    /// Velocity of the wind `[m/s]`.
    pub wind: DVec3,
    /// Density of the air `[kg/m³]`: drag along a face's normal.
    pub air_density: f64,
    /// Drag along a face `[kg/(m² s)]`.
    pub air_drag: f64,
    /// Gusts, which are added to the constant wind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gust: Option<Gust>,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            gravity: DVec3::new(0.0, -9.8, 0.0),
            wind: DVec3::ZERO,
            air_density: 1.0,
            air_drag: 0.0,
            gust: None,
        }
    }
}

impl Environment {
    /// The environment during the step from `frame` to the next, at `frame_rate` frames per
    /// second: its wind is constant, wind + gust at the middle of the step. Held over a step, so
    /// that who sees a frame knows the air that acts until the next.
    #[must_use]
    pub fn during_step(&self, frame: usize, frame_rate: f64) -> Self {
        match self.gust {
            None => *self,
            Some(gust) => Self {
                wind: self.wind + gust.velocity((frame as f64 + 0.5) / frame_rate),
                gust: None,
                ..*self
            },
        }
    }

    /// Checks that every value is finite and within reason, no density negative, and a gust's
    /// period positive.
    ///
    /// # Errors
    /// Names the field, what it must be and what was found.
    pub fn validate(&self) -> Result<(), SettingError> {
        let within = |vector: DVec3, most: f64| (0.0..=most).contains(&vector.length());
        let holds = within(self.gravity, STRONGEST_GRAVITY);
        let expected = "finite, of at most 1e6 m/s²";
        require(holds, "environment.gravity", expected, self.gravity)?;
        let holds = within(self.wind, FASTEST_WIND);
        let expected = "finite, of at most 1000 m/s";
        require(holds, "environment.wind", expected, self.wind)?;
        for (field, value) in [
            ("environment.air_density", self.air_density),
            ("environment.air_drag", self.air_drag),
        ] {
            let holds = value.is_finite() && value >= 0.0;
            require(holds, field, "finite and not negative", value)?;
        }
        let Some(gust) = &self.gust else {
            return Ok(());
        };
        require(
            within(gust.speed, FASTEST_WIND) && gust.speed.min_element() >= 0.0,
            "environment.gust.speed",
            "finite, not negative along each axis, and of at most 1000 m/s",
            gust.speed,
        )?;
        require_positive("environment.gust.period", gust.period)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Spoil = fn(&mut Environment);

    fn gusty(speed: DVec3, period: f64) -> Option<Gust> {
        Some(Gust {
            speed,
            period,
            seed: 1,
        })
    }

    #[test]
    fn wrong_values_are_named() {
        Environment::default().validate().unwrap();
        let wrong: [(&str, Spoil); 11] = [
            ("environment.gravity", |e| e.gravity.y = f64::NAN),
            ("environment.gravity", |e| e.gravity.x = 1e7),
            ("environment.wind", |e| e.wind.x = f64::INFINITY),
            ("environment.wind", |e| e.wind.x = -1001.0),
            ("environment.gust.speed", |e| {
                e.gust = gusty(DVec3::X * 1e4, 1.0);
            }),
            ("environment.air_density", |e| e.air_density = -1.0),
            ("environment.air_density", |e| e.air_density = f64::NAN),
            ("environment.air_drag", |e| e.air_drag = -0.1),
            ("environment.gust.speed", |e| {
                e.gust = gusty(DVec3::NEG_X, 1.0)
            }),
            ("environment.gust.period", |e| e.gust = gusty(DVec3::X, 0.0)),
            ("environment.gust.period", |e| {
                e.gust = gusty(DVec3::X, f64::NAN);
            }),
        ];
        for (field, spoil) in wrong {
            let mut environment = Environment::default();
            spoil(&mut environment);
            let text = environment.validate().unwrap_err().to_string();
            assert!(text.starts_with(field), "{text}");
        }
    }

    #[test]
    fn toml_keeps_defaults_and_names_unknown_keys() {
        let environment: Environment = toml::from_str("wind = [1, 0, 0.5]").unwrap();
        assert_eq!(environment.wind, DVec3::new(1.0, 0.0, 0.5));
        assert_eq!(environment.gravity, DVec3::new(0.0, -9.8, 0.0));
        let text = toml::to_string(&environment).unwrap();
        assert_eq!(toml::from_str::<Environment>(&text).unwrap(), environment);
        let error = toml::from_str::<Environment>("gravty = [0, 0, 0]").unwrap_err();
        assert!(error.to_string().contains("gravty"), "{error}");
    }

    #[test]
    fn a_step_has_the_wind_of_its_middle() {
        let still = Environment::default();
        assert_eq!(still.during_step(30, 60.0), still);
        let windy = Environment {
            wind: DVec3::new(3.0, 0.0, 0.0),
            gust: gusty(DVec3::ONE, 2.0),
            ..still
        };
        let gust = windy.gust.unwrap();
        let step = windy.during_step(30, 60.0);
        assert_eq!(step.wind, windy.wind + gust.velocity(30.5 / 60.0));
        assert_eq!((step.gust, step.gravity), (None, still.gravity));
        // A file without gusts stays as it was.
        assert!(!toml::to_string(&still).unwrap().contains("gust"));
        let text = toml::to_string(&windy).unwrap();
        assert_eq!(toml::from_str::<Environment>(&text).unwrap(), windy);
    }
}
