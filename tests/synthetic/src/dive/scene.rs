//! A dive before its frames are rendered.

use super::options::DiveOptions;
use super::render::DiveImage;
use super::rig::{DiveCamera, cameras, index_at};
use super::sky::Sky;
use crate::appearance::{Lamps, Water};
use crate::motion::Motion;
use crate::optics::RayTable;
use crate::trace::Tracer;
use crate::world::World;
use ::scene::Rigid3;
use nalgebra::{Vector2, Vector3};

/// A dive whose frames are rendered one by one.
pub struct DiveScene {
    /// What was asked for.
    pub options: DiveOptions,
    /// What stands in the scene.
    pub world: World,
    /// How the rig moves.
    pub motion: Motion,
    /// The cameras of the rig.
    pub cameras: Vec<DiveCamera>,
    pub(super) tables: Vec<RayTable>,
    pub(super) tracer: Tracer,
    pub(super) sky: Sky,
    pub(super) water: Option<Water>,
}

impl DiveScene {
    /// Builds the scene; nothing is rendered yet. The same options give the same scene, on any number of threads.
    ///
    /// # Errors
    /// What is not possible in the options, by key.
    pub fn new(options: &DiveOptions) -> Result<Self, String> {
        options.check()?;
        let world = World::new(&options.world);
        let motion = Motion::new(&options.motion, world.centre);
        Self::with_world(options, world, motion)
    }

    /// As [`DiveScene::new`], for a world and a path made by hand.
    ///
    /// # Errors
    /// As [`DiveScene::new`].
    pub fn with_world(options: &DiveOptions, world: World, motion: Motion) -> Result<Self, String> {
        options.check()?;
        // A calibration is made at the distance of the survey: that of the rig from what it looks at.
        let start = motion.rig_from_world(motion.frame_time_s(0)).centre();
        let distance_m = (start - world.centre).norm().clamp(0.5, 8.0);
        let tracer = Tracer::new(&world.parts);
        let (low, high) = structure_box(&world);
        let sky = Sky::new(&tracer, low, high);
        let cameras = cameras(options, distance_m)?;
        Ok(Self {
            tables: cameras.iter().map(|camera| RayTable::new(&camera.lens, options.rig.width, options.rig.height)).collect(),
            cameras,
            water: Water::new(&options.water),
            options: options.clone(),
            world,
            motion,
            tracer,
            sky,
        })
    }

    /// Number of exposures.
    #[must_use]
    pub fn exposures(&self) -> usize {
        self.options.motion.frames
    }

    /// Name of a frame: `C1/0000` for the first camera and exposure, and `extension` after a dot.
    #[must_use]
    pub fn name(camera: usize, exposure: usize, extension: &str) -> String {
        format!("C{}/{exposure:04}.{extension}", camera + 1)
    }

    /// The true pose of the rig at an exposure.
    #[must_use]
    pub fn rig_from_world(&self, exposure: usize) -> Rigid3 {
        self.motion.rig_from_world(self.motion.frame_time_s(exposure))
    }

    /// The true pose of a frame.
    ///
    /// # Panics
    /// When there is no such camera.
    #[must_use]
    pub fn cam_from_world(&self, camera: usize, exposure: usize) -> Rigid3 {
        self.cameras[camera].cam_from_rig * self.rig_from_world(exposure)
    }

    /// Refractive index of the water about the rig at an exposure.
    #[must_use]
    pub fn refractive_index(&self, exposure: usize) -> f64 {
        let height = self.rig_from_world(exposure).centre().z;
        index_at(&self.options, self.options.water.depth_m - height)
    }

    /// Where a point of the world is seen in a frame, hidden or not; `None` where the camera does not see its direction.
    ///
    /// # Panics
    /// As [`DiveScene::cam_from_world`].
    #[must_use]
    pub fn project(&self, point: &Vector3<f64>, camera: usize, exposure: usize) -> Option<Vector2<f64>> {
        let x_in_cam = self.cam_from_world(camera, exposure).apply(point);
        self.cameras[camera].project(&x_in_cam, self.refractive_index(exposure))
    }

    pub(super) fn lamps(&self, exposure: usize) -> Option<Lamps> {
        Lamps::new(&self.options.lamps, &self.rig_from_world(exposure))
    }
}

/// The box of all that stands on the bottom, with a margin in which it takes light away.
fn structure_box(world: &World) -> (Vector3<f64>, Vector3<f64>) {
    let standing = world.parts.iter().filter(|part| part.label == crate::world::Label::Structure);
    let points = standing.flat_map(|part| &part.mesh.vertices).map(|v| v.coords);
    let (low, high) =
        points.fold((Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)), |(low, high), p| (low.inf(&p), high.sup(&p)));
    if low.x > high.x {
        return (Vector3::zeros(), Vector3::zeros());
    }
    (low - Vector3::repeat(0.8), high + Vector3::new(0.8, 0.8, 0.3))
}

/// A rendered dive and its truth.
pub struct Dive {
    /// The scene, the cameras and their path.
    pub scene: DiveScene,
    /// Frames, camera after camera.
    pub images: Vec<DiveImage>,
}

/// Renders all frames of a [`DiveScene`]: for tests, which can hold them all.
///
/// # Errors
/// As [`DiveScene::new`].
pub fn render_dive(options: &DiveOptions) -> Result<Dive, String> {
    let scene = DiveScene::new(options)?;
    let all = (0..scene.cameras.len()).flat_map(|c| (0..scene.exposures()).map(move |e| (c, e)));
    let images = all.map(|(camera, exposure)| scene.render(camera, exposure)).collect();
    Ok(Dive { scene, images })
}
