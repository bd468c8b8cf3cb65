//! The model while it grows: poses, points and who sees what.

use crate::graph::CorrespondenceGraph;
use crate::input::MapInput;
use crate::visibility::Visibility;
use nalgebra::{Vector2, Vector3};
use scene::{Camera, Frame, FrameId, Image, ImageId, KeypointIndex, Observation, PointId, Rig, Rigid3};

/// A scene point.
#[derive(Clone, Debug)]
pub(crate) struct MapPoint {
    pub xyz: Vector3<f64>,
    /// Observations in the order in which they were found; at most one an image.
    pub track: Vec<Observation>,
}

impl MapPoint {
    pub(crate) fn sees(&self, image: ImageId) -> bool {
        self.track.iter().any(|o| o.image == image)
    }
}

/// Everything that changes while a model grows. Points keep their id for life; a removed one leaves a gap.
#[derive(Clone)]
pub(crate) struct Model<'a> {
    pub input: &'a MapInput,
    pub graph: &'a CorrespondenceGraph,
    pub cameras: Vec<Camera>,
    pub rigs: Vec<Rig>,
    pub frames: Vec<Frame>,
    pub images: Vec<Image>,
    /// Images of each frame.
    pub frame_images: Vec<Vec<ImageId>>,
    points: Vec<Option<MapPoint>>,
    point_of: Vec<Vec<Option<PointId>>>,
    visibility: Vec<Visibility>,
    point_count: usize,
    observation_count: usize,
}

impl<'a> Model<'a> {
    /// A model in which nothing is oriented.
    pub(crate) fn new(
        input: &'a MapInput,
        graph: &'a CorrespondenceGraph,
        cameras: Vec<Camera>,
        rigs: Vec<Rig>,
        frames: Vec<Frame>,
        images: Vec<Image>,
    ) -> Self {
        let mut frame_images = vec![Vec::new(); frames.len()];
        for (i, image) in images.iter().enumerate() {
            frame_images[image.frame.index()].push(ImageId::new(i));
        }
        let visibility = images
            .iter()
            .zip(&input.keypoints)
            .map(|(image, keypoints)| {
                let camera = &cameras[image.camera.index()];
                Visibility::new(camera.width(), camera.height(), keypoints.len())
            })
            .collect();
        let point_of = input.keypoints.iter().map(|k| vec![None; k.len()]).collect();
        Self {
            input,
            graph,
            cameras,
            rigs,
            frames,
            images,
            frame_images,
            points: Vec::new(),
            point_of,
            visibility,
            point_count: 0,
            observation_count: 0,
        }
    }

    /// Pose of an image, or `None` while its frame is not oriented.
    pub(crate) fn cam_from_world(&self, image: ImageId) -> Option<Rigid3> {
        let rig_from_world = self.frames[self.images[image.index()].frame.index()].rig_from_world?;
        Some(self.cam_from_rig(image) * rig_from_world)
    }

    /// Pose of an image's camera in its rig.
    pub(crate) fn cam_from_rig(&self, image: ImageId) -> Rigid3 {
        let image = &self.images[image.index()];
        let rig = &self.rigs[self.frames[image.frame.index()].rig.index()];
        rig.cam_from_rig(image.camera).expect("frames are built from the cameras of their rig")
    }

    pub(crate) fn is_oriented(&self, image: ImageId) -> bool {
        self.frames[self.images[image.index()].frame.index()].rig_from_world.is_some()
    }

    pub(crate) fn camera(&self, image: ImageId) -> &Camera {
        &self.cameras[self.images[image.index()].camera.index()]
    }

    /// Oriented frames, in order of id.
    pub(crate) fn oriented_frames(&self) -> Vec<FrameId> {
        (0..self.frames.len()).map(FrameId::new).filter(|f| self.frames[f.index()].rig_from_world.is_some()).collect()
    }

    /// Images of oriented frames, in order of id.
    pub(crate) fn oriented_images(&self) -> Vec<ImageId> {
        (0..self.images.len()).map(ImageId::new).filter(|&i| self.is_oriented(i)).collect()
    }

    pub(crate) fn position(&self, o: Observation) -> [f32; 2] {
        self.input.keypoints[o.image.index()][o.keypoint.index()]
    }

    pub(crate) fn pixel(&self, o: Observation) -> Vector2<f64> {
        let [x, y] = self.position(o);
        Vector2::new(f64::from(x), f64::from(y))
    }

    /// Standard deviation of a keypoint, pixels.
    pub(crate) fn sigma_px(&self, o: Observation) -> f64 {
        self.input.sigmas_px.get(o.image.index()).and_then(|s| s.get(o.keypoint.index())).map_or(1.0, |&s| f64::from(s))
    }

    /// Whether a reprojection error is small enough to be one: `max_error_px`, and less for keypoints better than a pixel. NaN is not.
    pub(crate) fn is_inlier(&self, o: Observation, error_px: f64, max_error_px: f64) -> bool {
        error_px <= max_error_px * self.sigma_px(o).min(1.0)
    }

    /// Every keypoint of an image.
    pub(crate) fn keypoints_of(&self, image: ImageId) -> impl Iterator<Item = Observation> + use<> {
        (0..self.point_of[image.index()].len()).map(move |k| Observation { image, keypoint: KeypointIndex::new(k) })
    }

    pub(crate) fn point_of(&self, o: Observation) -> Option<PointId> {
        self.point_of[o.image.index()][o.keypoint.index()]
    }

    /// A point; `None` when it was removed.
    pub(crate) fn point(&self, id: PointId) -> Option<&MapPoint> {
        self.points[id.index()].as_ref()
    }

    /// Points that exist, in order of id.
    pub(crate) fn points(&self) -> impl Iterator<Item = (PointId, &MapPoint)> {
        self.points.iter().enumerate().filter_map(|(i, p)| Some((PointId::new(i), p.as_ref()?)))
    }

    /// One past the largest point id ever given.
    pub(crate) fn point_slots(&self) -> usize {
        self.points.len()
    }

    pub(crate) fn point_count(&self) -> usize {
        self.point_count
    }

    pub(crate) fn observation_count(&self) -> usize {
        self.observation_count
    }

    pub(crate) fn visibility(&self, image: ImageId) -> &Visibility {
        &self.visibility[image.index()]
    }

    /// Number of keypoints of an image that belong to a point.
    pub(crate) fn observations_in(&self, image: ImageId) -> usize {
        self.point_of[image.index()].iter().flatten().count()
    }

    pub(crate) fn set_xyz(&mut self, id: PointId, xyz: Vector3<f64>) {
        if let Some(point) = &mut self.points[id.index()] {
            point.xyz = xyz;
        }
    }

    /// Adds a point. The observations must be free, and in different images.
    pub(crate) fn add_point(&mut self, xyz: Vector3<f64>, track: &[Observation]) -> PointId {
        let id = PointId::new(self.points.len());
        self.points.push(Some(MapPoint { xyz, track: Vec::with_capacity(track.len()) }));
        self.point_count += 1;
        for &o in track {
            self.add_observation(id, o);
        }
        id
    }

    /// Adds an observation, which must be free, to a point that exists and is not yet seen in that image.
    pub(crate) fn add_observation(&mut self, id: PointId, o: Observation) {
        debug_assert!(self.point_of(o).is_none(), "{o:?} belongs to a point already");
        let point = self.points[id.index()].as_mut().expect("observations are only added to points that exist");
        debug_assert!(!point.sees(o.image), "point {id} is seen in image {} already", o.image);
        point.track.push(o);
        self.point_of[o.image.index()][o.keypoint.index()] = Some(id);
        self.observation_count += 1;
        for &link in self.graph.of(o) {
            let position = self.input.keypoints[link.image.index()][link.keypoint.index()];
            self.visibility[link.image.index()].add(link.keypoint.index(), position);
        }
    }

    fn release(&mut self, o: Observation) {
        self.point_of[o.image.index()][o.keypoint.index()] = None;
        self.observation_count -= 1;
        for &link in self.graph.of(o) {
            let position = self.input.keypoints[link.image.index()][link.keypoint.index()];
            self.visibility[link.image.index()].remove(link.keypoint.index(), position);
        }
    }

    /// Removes an observation; a point with fewer than two left goes with it.
    pub(crate) fn remove_observation(&mut self, o: Observation) {
        let Some(id) = self.point_of(o) else { return };
        let point = self.points[id.index()].as_mut().expect("an observation belongs to a point that exists");
        point.track.retain(|&other| other != o);
        let too_few = point.track.len() < 2;
        self.release(o);
        if too_few {
            self.remove_point(id);
        }
    }

    /// Removes a point and frees its observations.
    pub(crate) fn remove_point(&mut self, id: PointId) -> Option<MapPoint> {
        let point = self.points[id.index()].take()?;
        for &o in &point.track {
            self.release(o);
        }
        self.point_count -= 1;
        Some(point)
    }

    /// Takes the pose from a frame, and its observations from the points.
    pub(crate) fn unorient(&mut self, frame: FrameId) {
        for image in self.frame_images[frame.index()].clone() {
            for o in self.keypoints_of(image) {
                self.remove_observation(o);
            }
        }
        self.frames[frame.index()].rig_from_world = None;
    }

    /// Distance between an observation and the projection of `xyz`, pixels; `None` behind the camera or where the image
    /// is not oriented.
    pub(crate) fn reprojection_error(&self, xyz: &Vector3<f64>, o: Observation) -> Option<f64> {
        let x_in_cam = self.cam_from_world(o.image)?.apply(xyz);
        Some((self.camera(o.image).project(&x_in_cam)? - self.pixel(o)).norm())
    }
}
