//! Frames of video files, through OpenCV (FFmpeg on Linux).

use crate::ImagingError;
use opencv::core::{LogLevel, Mat, MatTraitConst, MatTraitConstManual, Vec3b, set_log_level};
use opencv::videoio::{self, VideoCapture, VideoCaptureTrait, VideoCaptureTraitConst};
use scene::Raster;
use std::path::{Path, PathBuf};

/// What a video file says about itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VideoInfo {
    /// Width after the rotation that the file asks for, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
    /// Frames a second (the mean, where they are not equally spaced).
    pub fps: f64,
    /// Number of frames as announced, often rounded from the duration; `None` where the file does not say.
    pub frame_count: Option<u64>,
    /// Duration, seconds; `None` where the file does not say.
    pub duration_secs: Option<f64>,
}

/// An opened video file.
pub struct Video {
    path: PathBuf,
    capture: VideoCapture,
    info: VideoInfo,
}

impl Video {
    /// Opens a video file and reads its header.
    ///
    /// # Errors
    /// [`ImagingError::Video`] for a file that is missing, empty, no file, or no video that the system's OpenCV decodes.
    pub fn open(path: &Path) -> Result<Self, ImagingError> {
        let failed = |detail: &str| ImagingError::Video { path: path.display().to_string(), detail: detail.to_owned() };
        // OpenCV says "cannot open" to all of these.
        let metadata = std::fs::metadata(path).map_err(|e| failed(&e.to_string()))?;
        if !metadata.is_file() {
            return Err(failed("is not a file"));
        }
        if metadata.len() == 0 {
            return Err(failed("empty file"));
        }
        std::fs::File::open(path).map_err(|e| failed(&e.to_string()))?;
        // OpenCV prints its failures on stderr; ours say more.
        let _ = set_log_level(LogLevel::LOG_LEVEL_SILENT);
        let mut capture = None;
        // The general search comes second: it takes a still image for a video of one frame, and file names with digits for a pattern.
        for backend in
            [videoio::CAP_FFMPEG, videoio::CAP_AVFOUNDATION, videoio::CAP_MSMF, videoio::CAP_GSTREAMER, videoio::CAP_OPENCV_MJPEG]
        {
            if let Ok(candidate) = VideoCapture::from_file(path, backend)
                && candidate.is_opened().unwrap_or(false)
            {
                capture = Some(candidate);
                break;
            }
        }
        let capture = capture.ok_or_else(|| failed("not a video, truncated, or of a codec that this system's OpenCV does not decode"))?;
        let property = |id| capture.get(id).ok().filter(|v| v.is_finite() && *v > 0.0);
        let (Some(width), Some(height)) = (property(videoio::CAP_PROP_FRAME_WIDTH), property(videoio::CAP_PROP_FRAME_HEIGHT)) else {
            return Err(failed("has no picture stream"));
        };
        let fps = property(videoio::CAP_PROP_FPS).ok_or_else(|| failed("does not state its frame rate"))?;
        let frame_count = property(videoio::CAP_PROP_FRAME_COUNT).filter(|n| *n < 1e12);
        let info = VideoInfo {
            width: width as u32,
            height: height as u32,
            fps,
            frame_count: frame_count.map(|n| n as u64),
            duration_secs: frame_count.map(|n| n / fps),
        };
        Ok(Self { path: path.to_owned(), capture, info })
    }

    /// What the header says.
    #[must_use]
    pub fn info(&self) -> &VideoInfo {
        &self.info
    }

    /// The frames nearest to `offset_secs`, `offset_secs + 1 / rate_hz`, ..., each at most once, with their own times in seconds from the first
    /// frame. A rate of the video's or above gives every frame from the offset on. The k-th frames of two cameras whose offsets align their
    /// clocks are then one exposure.
    ///
    /// The video is decoded from its start: seeking is not exact to the frame in all formats.
    ///
    /// # Errors
    /// [`ImagingError::Video`] for a rate that is not positive, and for an offset that is negative or beyond the end. While iterating, where the
    /// file ends well before its announced end; the frames until then are valid.
    pub fn frames(self, rate_hz: f64, offset_secs: f64) -> Result<Frames, ImagingError> {
        let failed = |detail: String| ImagingError::Video { path: self.path.display().to_string(), detail };
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(failed(format!("rate of {rate_hz} frames a second: must be positive")));
        }
        if !(offset_secs.is_finite() && offset_secs >= 0.0) {
            return Err(failed(format!("offset of {offset_secs} s: must not be negative")));
        }
        if let Some(duration) = self.info.duration_secs.filter(|d| offset_secs >= *d) {
            return Err(failed(format!("offset of {offset_secs} s is beyond its end at {duration:.3} s")));
        }
        Ok(Frames {
            video: self,
            rate_hz,
            offset_secs,
            sample: 0,
            read: 0,
            first_time: 0.0,
            last_time: -1.0,
            done: false,
            frame: Mat::default(),
        })
    }
}

/// Iterator over frames: (seconds from the first frame, sRGB image). See [`Video::frames`].
pub struct Frames {
    video: Video,
    rate_hz: f64,
    offset_secs: f64,
    /// Index of the next sample time.
    sample: u64,
    /// Number of frames read so far.
    read: u64,
    first_time: f64,
    last_time: f64,
    done: bool,
    frame: Mat,
}

impl Frames {
    fn failed(&self, detail: impl std::fmt::Display) -> ImagingError {
        ImagingError::Video { path: self.video.path.display().to_string(), detail: detail.to_string() }
    }

    /// Time of the frame just grabbed: the file's time stamp, or by the frame rate where stamps are missing or do not increase.
    fn time(&mut self) -> f64 {
        let nominal = (self.read - 1) as f64 / self.video.info.fps;
        let stamp = self.video.capture.get(videoio::CAP_PROP_POS_MSEC).map_or(f64::NAN, |ms| ms / 1000.0);
        if self.read == 1 {
            self.first_time = if stamp.is_finite() { stamp } else { 0.0 };
        }
        let time = stamp - self.first_time;
        self.last_time = if time > self.last_time { time } else { nominal.max(self.last_time) };
        self.last_time
    }

    fn image(&mut self) -> Result<Raster<[u8; 3]>, ImagingError> {
        let retrieved = self.video.capture.retrieve_def(&mut self.frame);
        if !matches!(retrieved, Ok(true)) {
            return Err(self.failed(format_args!("frame {} cannot be decoded", self.read)));
        }
        let (width, height) = (self.frame.cols().max(0) as usize, self.frame.rows().max(0) as usize);
        let mut pixels = Vec::with_capacity(width * height);
        for y in 0..height {
            let row = self.frame.at_row::<Vec3b>(y as i32).map_err(|e| self.failed(e.message))?;
            pixels.extend(row.iter().map(|bgr| [bgr[2], bgr[1], bgr[0]]));
        }
        Raster::from_vec(width, height, pixels).ok_or_else(|| self.failed("frame of a wrong size"))
    }

    /// At the end of the stream: an error where it comes too early. Announced counts are estimates, hence some slack.
    fn early_end(&self) -> Option<ImagingError> {
        let announced = self.video.info.frame_count?;
        let slack = announced / 50 + 5;
        (self.read + slack < announced)
            .then(|| self.failed(format_args!("ends after {} of {announced} frames: truncated or damaged", self.read)))
    }
}

impl Iterator for Frames {
    type Item = Result<(f64, Raster<[u8; 3]>), ImagingError>;

    fn next(&mut self) -> Option<Self::Item> {
        while !self.done {
            if !self.video.capture.grab().unwrap_or(false) {
                self.done = true;
                return self.early_end().map(Err);
            }
            self.read += 1;
            let time = self.time();
            // The first frame not more than half a period before the sample time is the nearest one.
            let reached = time + 0.5 / self.video.info.fps;
            if reached <= self.offset_secs + self.sample as f64 / self.rate_hz {
                continue;
            }
            // Sample times that fall before the next frame are served by this one.
            self.sample = ((reached - self.offset_secs) * self.rate_hz).floor() as u64 + 1;
            let image = self.image();
            self.done = image.is_err();
            return Some(image.map(|image| (time, image)));
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{Scalar, Size};
    use opencv::videoio::{VideoWriter, VideoWriterTrait};

    const FPS: f64 = 20.0;

    /// A video whose frame i has red 10 i, green 100, blue 30.
    fn video(folder: &Path, frames: usize) -> PathBuf {
        let path = folder.join("clip.avi");
        let fourcc = VideoWriter::fourcc('M', 'J', 'P', 'G').expect("a code");
        let mut writer = VideoWriter::new(&path, fourcc, FPS, Size::new(64, 48), true).expect("opens");
        for i in 0..frames {
            let bgr = Scalar::new(30.0, 100.0, 10.0 * i as f64, 0.0);
            writer.write(&Mat::new_rows_cols_with_default(48, 64, opencv::core::CV_8UC3, bgr).expect("a picture")).expect("writes");
        }
        writer.release().expect("closes");
        path
    }

    /// Indices and times of the frames that come out.
    fn sampled(path: &Path, rate_hz: f64, offset_secs: f64) -> Vec<(usize, f64)> {
        let frames = Video::open(path).expect("a video").frames(rate_hz, offset_secs).expect("valid");
        frames
            .map(|f| {
                let (time, image) = f.expect("whole");
                let [r, g, b] = image[(20, 20)];
                assert!(g.abs_diff(100) < 6 && b.abs_diff(30) < 6, "red, green, blue in this order: {r} {g} {b}");
                ((f64::from(r) / 10.0).round() as usize, time)
            })
            .collect()
    }

    #[test]
    fn frames_nearest_to_the_sample_times() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = video(folder.path(), 20);
        let info = *Video::open(&path).expect("a video").info();
        assert_eq!((info.width, info.height, info.frame_count), (64, 48, Some(20)));
        assert!((info.fps - FPS).abs() < 1e-9 && (info.duration_secs.expect("stated") - 1.0).abs() < 1e-9);

        let every = sampled(&path, 1e6, 0.0);
        assert_eq!(every.iter().map(|f| f.0).collect::<Vec<_>>(), (0..20).collect::<Vec<_>>());
        assert!(every.iter().all(|&(i, t)| (t - i as f64 / FPS).abs() < 1e-3), "{every:?}");
        let indices = |rate, offset| sampled(&path, rate, offset).iter().map(|f| f.0).collect::<Vec<_>>();
        assert_eq!(indices(5.0, 0.0), [0, 4, 8, 12, 16]);
        // 0.26 s is nearest to frame 5 (0.25 s); then 0.3 s further each.
        assert_eq!(indices(1.0 / 0.3, 0.26), [5, 11, 17]);
        // 8 Hz: 0, 0.125, 0.25, ... between frames at 0.05 s.
        let eight = sampled(&path, 8.0, 0.0);
        for (k, (_, time)) in eight.iter().enumerate() {
            assert!((time - k as f64 / 8.0).abs() <= 0.5 / FPS + 1e-9, "{eight:?}");
        }
    }

    #[test]
    fn errors_name_what_is_wrong() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = video(folder.path(), 20);
        let message = |path: &Path| Video::open(path).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message(&folder.path().join("missing.mp4")).contains("missing.mp4"));
        assert!(message(folder.path()).contains("is not a file"));
        let empty = folder.path().join("empty.mp4");
        std::fs::write(&empty, b"").expect("writes");
        assert!(message(&empty).contains("empty file"));
        let text = folder.path().join("text.mp4");
        std::fs::write(&text, b"dear diary").expect("writes");
        assert!(message(&text).contains("not a video"));
        for (rate, offset, word) in [(0.0, 0.0, "rate"), (f64::NAN, 0.0, "rate"), (1.0, -1.0, "negative"), (1.0, 7.0, "beyond its end")] {
            let error = Video::open(&path).expect("a video").frames(rate, offset).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(error.contains(word), "{error}");
        }
    }

    #[test]
    fn a_truncated_video_gives_its_frames_and_then_an_error() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = video(folder.path(), 25);
        let bytes = std::fs::read(&path).expect("readable");
        std::fs::write(&path, &bytes[..bytes.len() / 2]).expect("writes");
        match Video::open(&path) {
            Err(error) => assert!(error.to_string().contains("truncated")),
            Ok(video) => {
                let items: Vec<_> = video.frames(1e6, 0.0).expect("valid").collect();
                let (last, before) = items.split_last().expect("something");
                assert!(before.iter().all(Result::is_ok) && before.len() < 20);
                assert!(matches!(last, Err(ImagingError::Video { .. })), "{} frames and no error", items.len());
            }
        }
    }

    #[test]
    fn real_clips() {
        let Some(data) = std::env::var_os("SFM_DATA").map(PathBuf::from) else {
            eprintln!("skipped: SFM_DATA does not name the folder of test data");
            return;
        };
        for (name, size, count, fps) in
            [("reef-clip/reef_clip.mp4", (1920, 1080), 211, 29.97), ("aqualoc-clip/aqualoc_snippet.mp4", (968, 608), 80, 20.0)]
        {
            let video = Video::open(&data.join(name)).expect("a video");
            let info = *video.info();
            assert_eq!((info.width, info.height), size);
            assert!((info.fps - fps).abs() < 0.01, "{name}: {info:?}");
            let frames: Vec<_> = video.frames(2.0, 0.5).expect("valid").collect::<Result<_, _>>().expect("whole");
            let duration = count as f64 / info.fps;
            assert_eq!(frames.len(), ((duration - 0.5) * 2.0).ceil() as usize, "{name}");
            for (k, (time, image)) in frames.iter().enumerate() {
                assert!((time - 0.5 - k as f64 / 2.0).abs() <= 0.5 / info.fps + 1e-3, "{name}: {k} at {time}");
                assert_eq!((image.width() as u32, image.height() as u32), size);
            }
        }
    }
}
