//! What can be said on the command line.

use crate::config::MaskStrategy;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

const EXIT_CODES: &str = "\
Exit codes:
  0  done; there may be warnings, which are counted at the end and listed in report.json
  1  failed: a file could not be read or written, the output folder is in use
  2  the command line or dive.toml is wrong
  3  the images give no result: none can be read, none overlap";

/// Oriented cameras, metric clouds and their quality from underwater photographs.
#[derive(Debug, Parser)]
#[command(name = "sfm", version, after_help = EXIT_CODES, disable_help_subcommand = true, arg_required_else_help = true)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Do what a dive.toml says, and skip what is done already.
    #[command(after_help = EXIT_CODES)]
    Run(RunArgs),
    /// Tell which stages are done, stale or missing, and why.
    Status(StatusArgs),
    /// Write a commented dive.toml for a folder of images or videos to stdout.
    Init(InitArgs),
    /// Render a dive whose truth is known: frames, dive.toml, truth.
    #[command(override_usage = "sfm synth [OPTIONS] [SCENE.toml] <FOLDER>")]
    Synth(SynthArgs),
    /// Write the masks of a dive by one strategy or several, to be compared.
    Mask(MaskArgs),
    /// Propose masks for the images that the classifier is least sure of, to be corrected and trained with.
    Label(LabelArgs),
    /// Train the classifier of masks with labelled images.
    Train(TrainArgs),
    /// Make the surface through a cloud with normals, and measure it.
    Surface(SurfaceArgs),
    /// Measure a cloud against a reference in the same frame.
    Eval(EvalArgs),
    /// Calibrate cameras and their rig from images of a chequerboard, or check whether a calibration still holds.
    #[command(override_usage = "sfm calibrate [OPTIONS] [CALIB.toml]\n       sfm calibrate [OPTIONS] --check <RIG.toml> <FOLDER>")]
    Calibrate(CalibrateArgs),
    /// Tell the refractive index of water, and what it does to the principal distance behind a flat port.
    Water(WaterArgs),
    /// Adjust a model that another program made with the rig, lengths, sensors and control points of a dive.toml.
    Orient(OrientArgs),
    /// Write a model in the form of another program.
    Export(ExportArgs),
    /// Adjust a bundle problem as it is: a file of "Bundle Adjustment in the Large" or a COLMAP model.
    Bundle(BundleArgs),
    /// Explain a command; `sfm help json` explains the keys of report.json.
    Help(HelpArgs),
}

/// Arguments of `sfm run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The configuration.
    #[arg(default_value = "dive.toml")]
    pub dive: PathBuf,
    /// Make STAGE and all after it anew.
    #[arg(long, value_name = "STAGE", value_parser = stage_name)]
    pub from: Option<String>,
    /// Stop after STAGE.
    #[arg(long, value_name = "STAGE", value_parser = stage_name)]
    pub until: Option<String>,
    /// Make STAGE anew, and after it only what changes.
    #[arg(long, value_name = "STAGE", value_parser = stage_name)]
    pub force: Option<String>,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the figures of the run, with the time of each stage, as JSON to stdout.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// The configuration.
    #[arg(default_value = "dive.toml")]
    pub dive: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm init`.
#[derive(Debug, Args)]
pub struct InitArgs {
    /// Folder of images, of one folder of images a camera, or of videos.
    pub folder: PathBuf,
}

/// Arguments of `sfm synth`.
#[derive(Debug, Args)]
pub struct SynthArgs {
    /// Optionally a file of settings (docs/synth.md lists them), then the folder to write: new or empty.
    #[arg(value_name = "FOLDER", num_args = 1..=2, required = true)]
    pub paths: Vec<PathBuf>,
    /// The dive that settings start from.
    #[arg(long, value_enum, default_value_t = Preset::Demo)]
    pub preset: Preset,
    /// What stands on the bottom, and a path that suits it.
    #[arg(long, value_enum)]
    pub scene: Option<Scene>,
    /// Instants at which all cameras are exposed.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(2..=9999))]
    pub frames: Option<u16>,
    /// Cameras of the rig: two look forward, the third backward and down.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=3))]
    pub cameras: Option<u8>,
    /// Width and height of an image, pixels.
    #[arg(long, value_name = "WxH", value_parser = image_size)]
    pub size: Option<(u32, u32)>,
    /// What lies between scene and camera.
    #[arg(long, value_enum)]
    pub water: Option<Water>,
    /// What the cameras look through.
    #[arg(long, value_enum)]
    pub port: Option<Port>,
    /// Standard deviation of the sensor noise, grey values of 255.
    #[arg(long, value_name = "GREY", value_parser = noise)]
    pub noise: Option<f32>,
    /// Seed of path, shapes, texture, noise and picks: another one is another dive.
    #[arg(long, value_name = "S", value_parser = clap::value_parser!(u64).range(..=9_007_199_254_740_992))]
    pub seed: Option<u64>,
    /// Number of threads; the bytes are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// A dive that is ready made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Preset {
    /// Half a round of a reef, two cameras, small frames: in a minute.
    Demo,
    /// Round a reef and up, three cameras, frames of 1920 x 1200.
    Survey,
    /// Grids of tags in a tank, from near and all sides.
    Calibration,
    /// Grids of tags in a tank, from above.
    Tank,
}

/// What stands on the bottom.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Scene {
    /// A cube of concrete slabs and beams.
    Reef,
    /// A wreck.
    Hull,
    /// A pipeline.
    Pipeline,
    /// Packed hemispheres of known radius.
    Hemispheres,
    /// Grids of tags in a tank.
    Tank,
}

/// What lies between scene and camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Water {
    /// Clear oceanic water (Jerlov IB).
    Clear,
    /// Coastal water (Jerlov 1).
    Coastal,
    /// Turbid coastal water (Jerlov 5).
    Turbid,
    /// Air.
    None,
}

/// What the cameras look through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Port {
    /// A flat acrylic window: rays are refracted.
    Flat,
    /// The same, and dive.toml describes it: orientation follows the refracted rays.
    Known,
    /// Nothing: pinhole cameras with lens distortion.
    None,
}

/// Arguments of `sfm mask`.
#[derive(Debug, Args)]
pub struct MaskArgs {
    /// The configuration.
    #[arg(default_value = "dive.toml")]
    pub dive: PathBuf,
    /// none, files, ip, ml or ip+ml, several with commas [default: that of the configuration].
    #[arg(long, value_name = "STRATEGIES", value_delimiter = ',', value_parser = mask_strategy)]
    pub strategy: Vec<MaskStrategy>,
    /// Folder for the masks, new or empty [default: masks-compared, in the output folder].
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Write preview.jpg as well: images beside their masks.
    #[arg(long)]
    pub preview: bool,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm label`.
#[derive(Debug, Args)]
pub struct LabelArgs {
    /// The configuration.
    #[arg(default_value = "dive.toml")]
    pub dive: PathBuf,
    /// How many images to propose.
    #[arg(long, value_name = "N", num_args = 0..=1, default_value_t = 20, default_missing_value = "20", value_parser = clap::value_parser!(u32).range(1..))]
    pub suggest: u32,
    /// Folder for images and masks, new or empty.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

/// Arguments of `sfm train`.
#[derive(Debug, Args)]
pub struct TrainArgs {
    /// Folders of images with masks or polygons (docs/masks.md tells how they lie).
    #[arg(value_name = "LABELS", required = true)]
    pub labels: Vec<PathBuf>,
    /// The model to write, .onnx; its card lies beside it.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Network with the feature maps s8, s16 and s32 that the head is set on [default: that of the model that comes with sfm].
    #[arg(long, value_name = "FILE")]
    pub backbone: Option<PathBuf>,
    /// A label of polygons that is structure; may be given again [default: all but water, background, fish, diver and the like].
    #[arg(long, value_name = "LABEL")]
    pub structure: Vec<String>,
    /// What the model is for, for the card [default: what it was made from].
    #[arg(long, value_name = "TEXT")]
    pub description: Option<String>,
    /// Licence, for the card.
    #[arg(long, value_name = "LICENCE")]
    pub licence: Option<String>,
    /// Which images are held out, which patches are taken.
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// The ONNX Runtime library [default: found].
    #[arg(long, value_name = "FILE")]
    pub onnxruntime: Option<PathBuf>,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the figures as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm surface`.
#[derive(Debug, Args)]
pub struct SurfaceArgs {
    /// The cloud: PLY with normals.
    pub cloud: PathBuf,
    /// The mesh to write: .ply, .obj or .glb.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Halve the cube around the points so many times [default: 8].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..=14), conflicts_with = "cell")]
    pub depth: Option<u32>,
    /// Edge of the finest cells, in the unit of the cloud; twice the GSD is as fine as a dense cloud carries.
    #[arg(long, value_name = "LENGTH")]
    pub cell: Option<f64>,
    /// Cut off the surface where the points are sparser than this share of their median density; 0: nowhere.
    #[arg(long, value_name = "SHARE", default_value_t = crate::surfacing::TRIM)]
    pub trim: f64,
    /// Weight of the points against their normals: less is smoother.
    #[arg(long, value_name = "WEIGHT")]
    pub screening: Option<f64>,
    /// Let points weigh by the inverse of their variance (property sigma).
    #[arg(long)]
    pub sigma_weights: bool,
    /// The points are those of a closed body: close all holes. Not for a sea floor; best with --trim 0.
    #[arg(long)]
    pub closed: bool,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the figures as JSON, with the keys of report.json below `surface`.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// The cloud: PLY, XYZ (text), or the vertices of an OBJ, OFF or STL.
    pub cloud: PathBuf,
    /// What it is compared with: a mesh (PLY, OBJ, OFF, STL) or a cloud (PLY, XYZ).
    #[arg(long, value_name = "FILE")]
    pub reference: PathBuf,
    /// Ground sample distance; the threshold is twice it where none is given.
    #[arg(long, value_name = "METRES")]
    pub gsd_m: Option<f64>,
    /// Largest distance of a point that is signal.
    #[arg(long, value_name = "METRES", required_unless_present = "gsd_m")]
    pub threshold_m: Option<f64>,
    /// Radius of the surface density [default: the threshold].
    #[arg(long, value_name = "METRES")]
    pub density_radius_m: Option<f64>,
    /// Cell of the integrity [default: the threshold].
    #[arg(long, value_name = "METRES")]
    pub grid_m: Option<f64>,
    /// Further thresholds of the curves of accuracy and completeness, with commas.
    #[arg(long, value_name = "METRES", value_delimiter = ',')]
    pub curve_m: Vec<f64>,
    /// Move the cloud onto the reference first, rigidly (icp) or with a scale (icp-scale).
    #[arg(long, value_enum)]
    pub align: Option<Align>,
    /// Corresponding points that move the cloud before anything else: lines of `x y z X Y Z`, from the cloud to the reference.
    #[arg(long, value_name = "FILE")]
    pub correspondences: Option<PathBuf>,
    /// Leave the scale free where corresponding points are given.
    #[arg(long, requires = "correspondences")]
    pub free_scale: bool,
    /// Measure only within this box, in the frame of the reference.
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = box_of_corners, allow_hyphen_values = true)]
    pub bounds: Option<[[f64; 3]; 2]>,
    /// Measure only within a polygon seen from above: lines of `x y`.
    #[arg(long, value_name = "FILE")]
    pub polygon: Option<PathBuf>,
    /// Write the cloud with its distances, coloured: .ply, or .csv without colours.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Write the figures as CSV: key, value.
    #[arg(long, value_name = "FILE")]
    pub csv: Option<PathBuf>,
    /// Compare height models with cells of this size (z up): volumes raised and lowered.
    #[arg(long, value_name = "METRES")]
    pub dem_cell_m: Option<f64>,
    /// M3C2 with cylinders of this diameter, normals over three times it; the reference has to be a cloud.
    #[arg(long, value_name = "METRES")]
    pub m3c2_m: Option<f64>,
    /// Error of the registration for the confidence of M3C2.
    #[arg(long, value_name = "METRES", default_value_t = 0.0, requires = "m3c2_m")]
    pub registration_m: f64,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// How a cloud is moved onto its reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Align {
    /// Rigidly.
    Icp,
    /// With a scale.
    IcpScale,
}

/// Arguments of `sfm calibrate`.
#[derive(Debug, Args)]
pub struct CalibrateArgs {
    /// What is calibrated (docs/calibrate.md lists the keys); with --check the folder of new images, one folder a camera in it.
    #[arg(default_value = "calib.toml")]
    pub input: PathBuf,
    /// Compare the calibration of this rig.toml, or calibration.json, with new images of its target.
    #[arg(long, value_name = "RIG.toml")]
    pub check: Option<PathBuf>,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print calibration.json, or the figures of the check, to stdout.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm water`.
#[derive(Debug, Args)]
pub struct WaterArgs {
    /// Depth, metres.
    #[arg(long, value_name = "METRES", allow_negative_numbers = true, required_unless_present = "log")]
    pub depth: Option<f64>,
    /// A log of the vehicle with a column depth_m, and perhaps salinity_ppt and temperature_degc: a table of all its lines is printed.
    #[arg(long, value_name = "CSV", conflicts_with_all = ["depth", "json"])]
    pub log: Option<PathBuf>,
    /// Practical salinity, parts per thousand: 0 is fresh water, 35 the sea.
    #[arg(long, value_name = "PPT", allow_negative_numbers = true)]
    pub salinity: f64,
    /// Temperature, degrees Celsius.
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true)]
    pub temperature: f64,
    /// Wavelength of the light, nanometres: 540 is the green that cameras see best.
    #[arg(long, value_name = "NM", default_value_t = 540.0, allow_negative_numbers = true)]
    pub wavelength: f64,
    /// Principal distance of a calibration in water, in any unit: its change from there to here is told.
    #[arg(long, value_name = "C")]
    pub principal_distance: Option<f64>,
    /// Depth at which it was calibrated, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.0, allow_negative_numbers = true)]
    pub calibrated_depth: f64,
    /// Salinity there [default: as here].
    #[arg(long, value_name = "PPT", allow_negative_numbers = true)]
    pub calibrated_salinity: Option<f64>,
    /// Temperature there [default: as here].
    #[arg(long, value_name = "DEGC", allow_negative_numbers = true)]
    pub calibrated_temperature: Option<f64>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm orient`.
#[derive(Debug, Args)]
pub struct OrientArgs {
    /// The configuration: its cameras name the images of the model.
    #[arg(default_value = "dive.toml")]
    pub dive: PathBuf,
    /// The model: folder of COLMAP files (binary or text), or Bundler's bundle.out with list.txt beside it.
    #[arg(long, value_name = "MODEL")]
    pub from: PathBuf,
    /// Folder for the adjusted model, new or empty [default: adjusted, in the output folder].
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print the figures as JSON, with the keys of report.json.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The model: folder of COLMAP files (`sparse` in the output of a run), transforms.json, or bundle.out with list.txt beside it.
    pub model: PathBuf,
    /// The form.
    #[arg(long, value_enum)]
    pub format: ExportFormat,
    /// Folder to write, new or empty.
    #[arg(long, value_name = "FOLDER")]
    pub out: PathBuf,
}

/// Form of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// COLMAP's text files.
    ColmapText,
    /// transforms.json: cameras for nerfstudio and what follows it.
    Nerfstudio,
    /// bundle.out and list.txt; cameras of one focal length and two radial terms only.
    Bundler,
}

/// Arguments of `sfm bundle`.
#[derive(Debug, Args)]
pub struct BundleArgs {
    /// A text file of Bundle Adjustment in the Large, or the folder of a COLMAP model.
    pub problem: PathBuf,
    /// Largest number of steps.
    #[arg(long, value_name = "N", default_value_t = 50, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub iterations: u32,
    /// Number of threads; the results are the same with any [default: one a processor].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

/// Arguments of `sfm help`.
#[derive(Debug, Args)]
pub struct HelpArgs {
    /// A command, or `json`.
    pub topic: Option<String>,
}

fn stage_name(text: &str) -> Result<String, String> {
    let names: Vec<&str> = crate::recipe::RECIPE.iter().map(|s| s.name).collect();
    if names.contains(&text) { Ok(text.to_owned()) } else { Err(format!("the stages are {}", names.join(", "))) }
}

fn mask_strategy(text: &str) -> Result<MaskStrategy, String> {
    let found = MaskStrategy::ALL.iter().find(|(name, _)| *name == text);
    found.map(|(_, strategy)| *strategy).ok_or_else(|| "the strategies are none, files, ip, ml, ip+ml".to_owned())
}

fn image_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    match sides {
        Some((width, height)) if (64..=8192).contains(&width) && (64..=8192).contains(&height) => Ok((width, height)),
        _ => Err("give width and height from 64 to 8192 pixels, for example 960x600".to_owned()),
    }
}

fn box_of_corners(text: &str) -> Result<[[f64; 3]; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) if x0 <= x1 && y0 <= y1 && z0 <= z1 => Ok([[x0, y0, z0], [x1, y1, z1]]),
        _ => Err("give the smallest x, y and z and then the largest, for example 0,0,-2,10,5,1".to_owned()),
    }
}

fn noise(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|v| (0.0..=100.0).contains(v));
    value.ok_or_else(|| "give a number from 0 to 100, for example 1.5".to_owned())
}
