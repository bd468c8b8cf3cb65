//! What can be set of a scene.

use serde::{Deserialize, Serialize};

/// What stands on the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SceneKind {
    /// A cube of concrete slabs and beams, 3 m wide, as deployed off Western Australia.
    #[default]
    Reef,
    /// A wreck: the skin and frames of a hull, 12 m long.
    Hull,
    /// A pipeline, 0.5 m thick, with joints, a free span and mattresses.
    Pipeline,
    /// A plate with packed hemispheres of known radius (as Li et al. 2018 measured).
    Hemispheres,
    /// A tank with grids of AprilTags.
    Tank,
}

/// A scene. Metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WorldOptions {
    /// What stands on the bottom.
    pub scene: SceneKind,
    /// Spacing of the true mesh on structure.
    pub detail_m: f64,
    /// Largest thickness of the growth on structure.
    pub growth_m: f64,
    /// Half the side of the bottom; beyond it is only water.
    pub bottom_half_m: f64,
    /// Stones on the bottom.
    pub stones: u32,
    /// Two scale bars.
    pub bars: bool,
    /// Fish.
    pub fish: u32,
    /// A second vehicle that carries a scale bar with coded targets.
    pub vehicle: bool,
    /// Its tether.
    pub tether: bool,
    /// Radius of the hemispheres.
    pub hemisphere_radius_m: f64,
    /// Seed of shapes and textures.
    pub seed: u32,
}

impl Default for WorldOptions {
    fn default() -> Self {
        Self {
            scene: SceneKind::Reef,
            detail_m: 0.02,
            growth_m: 0.05,
            bottom_half_m: 8.0,
            stones: 60,
            bars: true,
            fish: 12,
            vehicle: true,
            tether: true,
            hemisphere_radius_m: 0.05,
            seed: 1,
        }
    }
}

impl WorldOptions {
    /// Says what is not possible.
    ///
    /// # Errors
    /// The key and what it may be.
    pub fn check(&self) -> Result<(), String> {
        let within = |key: &str, value: f64, low: f64, high: f64| {
            if (low..=high).contains(&value) { Ok(()) } else { Err(format!("world.{key} = {value} must be from {low} to {high}")) }
        };
        within("detail_m", self.detail_m, 0.008, 0.2)?;
        within("growth_m", self.growth_m, 0.0, 0.15)?;
        within("bottom_half_m", self.bottom_half_m, 1.0, 50.0)?;
        if self.bottom_half_m > 1200.0 * self.detail_m {
            return Err(format!(
                "world.bottom_half_m = {} is too large for world.detail_m = {}: at most 1200 times as large",
                self.bottom_half_m, self.detail_m
            ));
        }
        within("stones", f64::from(self.stones), 0.0, 2000.0)?;
        within("fish", f64::from(self.fish), 0.0, 500.0)?;
        within("hemisphere_radius_m", self.hemisphere_radius_m, 0.01, 0.5)
    }
}
