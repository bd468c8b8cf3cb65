//! The keys of report.json. Others script against them: a key keeps its name and meaning.

/// Every key and what it means.
pub const REPORT_KEYS: &[(&str, &str)] = &[
    ("dive", "name of the dive"),
    ("version", "version of sfm"),
    ("images.found", "files and video frames that were looked at"),
    ("images.total", "images that could be used"),
    ("images.oriented", "images with a pose in the model"),
    ("frames.total", "instants at which one camera or several were exposed"),
    ("cameras[].name", "name of the camera"),
    ("cameras[].images", "its usable images"),
    ("cameras[].size", "their width and height, pixels"),
    ("cameras[].exif_focal_px", "their median focal length according to EXIF, pixels"),
    ("masks.strategy", "how masks were made: none, files, ip"),
    ("masks.masks", "number of masks"),
    ("masks.empty", "masks without any structure"),
    ("masks.masked_ratio", "mean share of the pixels that masks take away, 0 to 1"),
    ("warnings[].stage", "the stage that warns"),
    ("warnings[].about", "what it warns of: an image, a camera"),
    ("warnings[].message", "what is the matter, and what was done"),
    ("stages.*.seconds", "time on the wall when the stage was last done; only in --json and timings.json"),
    ("stages.*.cpu_seconds", "time of all processors likewise"),
];
