//! A linear, isotropic, elastic sheet as the tables of the data-driven laws: every row and column
//! the same, so that the look-up changes nothing.
//!
//! In the plane: Saint Venant-Kirchhoff in plane stress, exactly. Out of the plane a hinge has one
//! stiffness ke and no Poisson's ratio of its own. ke = 4 D gives a sheet that is rolled up in one
//! direction the bending energy of a plate of stiffness D: exactly on equilateral triangles,
//! whatever the direction, and nearly on irregular ones. With a second curvature across the first,
//! hinges on equilateral triangles act like a plate of Poisson's ratio -1/3 (W = D/2 [κ₁² + κ₂² - ⅔
//! κ₁κ₂]), whatever that of the material, so that a strip whose edges are free to curl is 8/9 as
//! stiff.

use serde::{Deserialize, Serialize};

use crate::error::{SceneError, require, require_positive};
use crate::{BendTable, Compression, Material, StretchTable};

/// The constants of an isotropic sheet.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Isotropic {
    /// Young's modulus E `[Pa]`.
    pub youngs_modulus: f64,
    /// Poisson's ratio ν, 0 to 0.5.
    pub poissons_ratio: f64,
    /// Thickness h `[m]`.
    pub thickness: f64,
}

/// The law doubles what it reads in the table of stretching.
const LAW_FACTOR: f64 = 2.0;

impl Isotropic {
    /// A fabric of such a sheet with `density` `[kg/m²]`.
    pub fn material(&self, name: &str, density: f64) -> Material {
        Material {
            name: name.to_owned(),
            source: String::new(),
            density,
            damping: 0.0,
            stretch: self.stretch_table(),
            bend: self.bend_table(),
            compression: Compression::default(),
        }
    }

    /// Checks that modulus and thickness are positive and Poisson's ratio is between 0 and 0.5 (the
    /// laws read no negative stiffness, so that auxetic sheets are not possible).
    ///
    /// # Errors
    /// Names the field and the value.
    pub fn validate(&self) -> Result<(), SceneError> {
        require_positive("isotropic.youngs_modulus", self.youngs_modulus)?;
        require_positive("isotropic.thickness", self.thickness)?;
        let holds = (0.0..=0.5).contains(&self.poissons_ratio);
        let field = "isotropic.poissons_ratio";
        require(holds, field, "between 0 and 0.5", self.poissons_ratio)
    }

    /// Membrane stiffness C = E h/(1 - ν²) `[N/m]`.
    pub fn membrane_stiffness(&self) -> f64 {
        self.youngs_modulus * self.thickness / (1.0 - self.poissons_ratio.powi(2))
    }

    /// Bending stiffness of a plate D = E h³/(12 (1 - ν²)) `[N·m]`. `[eq:plate-stiffness]`
    pub fn plate_stiffness(&self) -> f64 {
        self.membrane_stiffness() * self.thickness.powi(2) / 12.0
    }

    /// The table of stretching: k0 = k2 = C, k1 = ν C, k3 = (1 - ν) C, for the energy
    /// a C/2 (G00² + G11² + 2 ν G00 G11 + 2 (1 - ν) G01²) of a face. `[eq:isotropic-stretch]`
    pub fn stretch_table(&self) -> StretchTable {
        let (stiffness, ratio) = (self.membrane_stiffness() / LAW_FACTOR, self.poissons_ratio);
        StretchTable(
            [[
                stiffness,
                ratio * stiffness,
                stiffness,
                (1.0 - ratio) * stiffness,
            ]; 6],
        )
    }

    /// The table of bending: ke = 4 D. With the Hessian of the deflection H, the edge's unit normal
    /// n and direction t, a hinge of equilateral triangles of side l opens by
    /// θ = l/(2√3) (3 H_nn - H_tt); its energy ke l² θ²/(8 (a_A + a_B)), summed over the three
    /// directions of edges, is ke κ²/8 per area for one curvature κ in any direction.
    /// `[eq:isotropic-bend]`
    pub fn bend_table(&self) -> BendTable {
        BendTable([[4.0 * self.plate_stiffness(); 5]; 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::refuses;

    const RUBBER: Isotropic = Isotropic {
        youngs_modulus: 1e6,
        poissons_ratio: 0.45,
        thickness: 1e-3,
    };

    #[test]
    fn wrong_constants_are_named() {
        refuses(
            &RUBBER,
            Isotropic::validate,
            &[
                ("isotropic.youngs_modulus must", |i| i.youngs_modulus = 0.0),
                ("isotropic.thickness must", |i| i.thickness = -1e-3),
                ("isotropic.thickness must", |i| i.thickness = f64::NAN),
                ("isotropic.poissons_ratio must", |i| i.poissons_ratio = -0.1),
                ("isotropic.poissons_ratio must", |i| i.poissons_ratio = 0.51),
            ],
        );
    }

    #[test]
    fn a_uniaxial_pull_meets_youngs_modulus() {
        // With no stress across, G11 = -ν G00, the stress along is E h G00 per width.
        let [k0, k1, k2, _] = RUBBER.stretch_table().0[0].map(|k| LAW_FACTOR * k);
        let (along, across) = (1.0, -RUBBER.poissons_ratio);
        let membrane = RUBBER.youngs_modulus * RUBBER.thickness;
        assert!((k2 * across + k1 * along).abs() < 1e-12 * membrane);
        assert!((k0 * along + k1 * across - membrane).abs() < 1e-12 * membrane);
    }
}
