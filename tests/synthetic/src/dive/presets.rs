//! Dives that are ready made.

use super::options::{DiveOptions, PortKind, ResponseOptions, RigOptions};
use crate::appearance::{Jerlov, LampOptions, WaterOptions};
use crate::motion::{MotionKind, MotionOptions};
use crate::world::{SceneKind, WorldOptions};

/// A dive that is ready made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Preset {
    /// Half a round of a reef with two cameras, small frames: in a minute.
    Demo,
    /// Round the reef and up with three cameras, frames of full size.
    Survey,
    /// A tank with grids of tags, seen from near and from all sides.
    Calibration,
    /// The same tank, seen from above by a camera pair that hardly moves.
    Tank,
}

/// Waters that are ready made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WaterKind {
    /// Clear oceanic water (Jerlov IB).
    Clear,
    /// Coastal water (Jerlov 1).
    Coastal,
    /// Turbid coastal water (Jerlov 5).
    Turbid,
    /// Air.
    None,
}

impl WaterKind {
    /// Changes the optical type; depth, temperature and the like stay.
    pub fn apply(self, water: &mut WaterOptions) {
        water.jerlov = match self {
            Self::Clear => Jerlov::IB,
            Self::Coastal => Jerlov::C1,
            Self::Turbid => Jerlov::C5,
            Self::None => Jerlov::Air,
        };
        if self == Self::Turbid {
            water.snow_per_m3 = 120.0;
        }
    }
}

impl DiveOptions {
    /// A dive that is ready made.
    #[must_use]
    pub fn preset(preset: Preset) -> Self {
        let rig = |width, height, cameras: usize| {
            let mut rig = RigOptions { width, height, ..RigOptions::default() };
            rig.cameras.truncate(cameras);
            rig
        };
        let mut options = match preset {
            Preset::Demo => Self {
                rig: rig(640, 400, 2),
                motion: MotionOptions { frames: 60, arc_deg: 200.0, ..MotionOptions::default() },
                ..Self::default()
            },
            Preset::Survey => Self {
                rig: rig(1920, 1200, 3),
                motion: MotionOptions { frames: 200, arc_deg: 560.0, ..MotionOptions::default() },
                water: WaterOptions { depth_m: 25.0, ..WaterOptions::default() },
                ..Self::default()
            },
            Preset::Calibration | Preset::Tank => Self {
                rig: rig(1920, 1200, 2),
                water: WaterOptions { depth_m: 1.4, salinity_ppt: 0.0, snow_per_m3: 0.0, ..WaterOptions::default() },
                lamps: LampOptions { power: 0.0, ..LampOptions::default() },
                ..Self::default()
            },
        };
        match preset {
            Preset::Demo | Preset::Survey => {}
            Preset::Calibration => options.set_scene(SceneKind::Tank),
            Preset::Tank => {
                options.set_scene(SceneKind::Tank);
                let motion = MotionOptions {
                    kind: MotionKind::Lanes,
                    height_m: [1.2, 1.25],
                    length_m: 0.3,
                    spacing_m: 0.15,
                    lanes: 3,
                    ..options.motion
                };
                options.motion = motion;
            }
        }
        options.reseed(7);
        options
    }

    /// Another scene, and a path that suits it; the number of frames stays.
    pub fn set_scene(&mut self, scene: SceneKind) {
        self.world.scene = scene;
        let (frames, seed) = (self.motion.frames, self.motion.seed);
        let near = MotionOptions { current_m: 0.03, push_m: 0.005, ..MotionOptions::default() };
        self.motion = match scene {
            SceneKind::Reef => MotionOptions { arc_deg: self.motion.arc_deg, ..MotionOptions::default() },
            SceneKind::Hull => {
                MotionOptions { kind: MotionKind::Line, radius_m: 4.5, length_m: 11.0, height_m: [1.2, 2.0], ..MotionOptions::default() }
            }
            SceneKind::Pipeline => {
                MotionOptions { kind: MotionKind::Line, radius_m: 1.8, length_m: 12.0, height_m: [1.6, 1.6], ..MotionOptions::default() }
            }
            SceneKind::Hemispheres => MotionOptions { radius_m: 0.9, height_m: [0.5, 0.9], ..near },
            SceneKind::Tank => MotionOptions { frames: 30, radius_m: 0.7, height_m: [0.7, 1.1], ..near },
        };
        (self.motion.frames, self.motion.seed) = (frames, seed);
    }

    /// Another dive of the same kind: seeds of scene, path and noise alike.
    pub fn reseed(&mut self, seed: u64) {
        self.seed = seed;
        self.motion.seed = seed;
        self.world.seed = seed as u32;
    }

    /// A small dive for tests: two cameras without windows on a quarter round of a coarse reef without anything that moves.
    #[must_use]
    pub fn small(frames: usize, width: u32, height: u32) -> Self {
        let mut options = Self {
            motion: MotionOptions { frames, arc_deg: 100.0, ..MotionOptions::default() },
            world: WorldOptions { detail_m: 0.05, fish: 0, tether: false, vehicle: false, ..WorldOptions::default() },
            response: ResponseOptions { noise: 1.5, ..ResponseOptions::default() },
            ..Self::preset(Preset::Demo)
        };
        (options.rig.width, options.rig.height, options.rig.port.kind) = (width, height, PortKind::None);
        // Without a window the field of view stays what it is behind one.
        options.rig.cameras.iter_mut().for_each(|camera| camera.focal_mm *= 1.34);
        options.water.snow_per_m3 = 0.0;
        options
    }
}
