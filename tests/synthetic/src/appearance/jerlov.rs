//! Optical water types.

use serde::{Deserialize, Serialize};

/// Optical water types of Jerlov: oceanic from clear (I) to murky (III), coastal from 1 to 9; or air.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[allow(missing_docs, reason = "the names are Jerlov's")]
pub enum Jerlov {
    I,
    IA,
    IB,
    II,
    III,
    #[serde(rename = "1")]
    C1,
    #[serde(rename = "3")]
    C3,
    #[serde(rename = "5")]
    C5,
    #[serde(rename = "7")]
    C7,
    #[serde(rename = "9")]
    C9,
    /// No water: nothing is absorbed, scattered or refracted.
    #[serde(rename = "air")]
    Air,
}

impl Jerlov {
    /// Diffuse attenuation of downward light at 600, 525 and 450 nm, where the channels of a colour camera are most sensitive, per
    /// metre: Jerlov, *Marine Optics*, 1976, table XXVII.
    #[must_use]
    pub fn diffuse_per_m(self) -> [f32; 3] {
        match self {
            Self::I => [0.235, 0.043, 0.019],
            Self::IA => [0.240, 0.048, 0.026],
            Self::IB => [0.245, 0.054, 0.036],
            Self::II => [0.260, 0.076, 0.068],
            Self::III => [0.295, 0.116, 0.135],
            Self::C1 => [0.30, 0.13, 0.25],
            Self::C3 => [0.33, 0.20, 0.39],
            Self::C5 => [0.40, 0.31, 0.56],
            Self::C7 => [0.48, 0.49, 0.89],
            Self::C9 => [0.60, 0.78, 1.60],
            Self::Air => [0.0; 3],
        }
    }

    /// Scattering at 525 nm, per metre. Petzold (1972) measured 0.037 in clear ocean, 0.219 in coastal water and 1.824 in a turbid
    /// harbour at 514 nm (in Mobley, *Light and Water*, 1994, table 3.10); the types between are interpolated on their diffuse attenuation.
    #[must_use]
    pub fn scattering_per_m(self) -> f32 {
        match self {
            Self::I => 0.02,
            Self::IA => 0.028,
            Self::IB => 0.037,
            Self::II => 0.08,
            Self::III => 0.17,
            Self::C1 => 0.219,
            Self::C3 => 0.38,
            Self::C5 => 0.65,
            Self::C7 => 1.1,
            Self::C9 => 1.824,
            Self::Air => 0.0,
        }
    }
}
