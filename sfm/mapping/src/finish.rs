//! The last adjustments: the unit, the place in the world, known lengths and their tests.

use crate::attempt::Made;
use crate::error::MapError;
use crate::incremental::{finish, settle};
use crate::input::MapInput;
use crate::lengths::{Known, LengthId, rescale};
use crate::model::Model;
use crate::options::OrientOptions;
use crate::quality::{CRITICAL, Quality, quality};
use crate::register::Registration;
use crate::ties::tie;
use scene::Scale;
use solve::adjust::{AdjustSummary, CovarianceError};

/// A length is wrong, and not another, when the square of its normalised residual is larger by this than that of the next: by so much more
/// its removal lowers the sum of squares, as it would by chance once in e^10 times.
const CLEARLY: f64 = 20.0;

/// Standard deviations by which the bend of the baselines may displace a model before that is told: below, the mean squares of its errors
/// are at most a quarter larger than stated.
const MAX_BEND: f64 = 0.5;

/// A finished model.
pub(crate) struct Done<'a> {
    pub model: Model<'a>,
    /// How the last try of each image's frame went.
    pub outcomes: Vec<Option<Registration>>,
    pub adjustment: AdjustSummary,
    pub scale: Scale,
    pub known: Known,
    pub quality: Result<Quality, CovarianceError>,
    pub rejected: Vec<(LengthId, f64)>,
    pub made: Option<Made>,
}

impl Done<'_> {
    /// Whether nothing is oriented.
    pub(crate) fn is_empty(&self) -> bool {
        self.model.oriented_frames().is_empty()
    }
}

/// Finishes a model that grew here: brings it to metres and into the world as far as that is known, completes it, and adjusts it for the
/// last time.
pub(crate) fn finish_grown<'a>(
    model: Model<'a>,
    outcomes: Vec<Option<Registration>>,
    scale: Scale,
    options: &OrientOptions,
) -> Result<Done<'a>, MapError> {
    with_known(model, outcomes, scale, options, finish)
}

/// Finishes a model that nobody grew here: nothing is added to it.
pub(crate) fn finish_start<'a>(model: Model<'a>, scale: Scale, options: &OrientOptions) -> Result<Done<'a>, MapError> {
    let outcomes = vec![None; model.images.len()];
    with_known(model, outcomes, scale, options, settle)
}

/// Adjusts with all that is known. Lengths that contradict the others are taken out one by one, the worst first.
fn with_known<'a>(
    mut model: Model<'a>,
    outcomes: Vec<Option<Registration>>,
    mut scale: Scale,
    options: &OrientOptions,
    last: impl Fn(&mut Model, Option<&Known>, &OrientOptions) -> Result<AdjustSummary, MapError>,
) -> Result<Done<'a>, MapError> {
    if scale == Scale::Arbitrary
        && let Some(factor) = Known::lengths_of(&model).scale(&model)
    {
        rescale(&mut model, factor);
        scale = Scale::Metric;
    }
    let ties = tie(&mut model, &mut scale);
    let mut known = if scale == Scale::Metric { Known::lengths_of(&model) } else { Known::default() };
    known.ties = ties;
    let mut adjustment = last(&mut model, Some(&known), options)?;
    let mut rejected = Vec::new();
    loop {
        known.keep_oriented(&model);
        known.update_picked(&model);
        let quality = if model.oriented_frames().is_empty() {
            Err(CovarianceError::Singular)
        } else {
            quality(&model, &known, scale, &adjustment, options)
        };
        let wrong = quality.as_ref().ok().and_then(|q| wrong_length(&q.lengths));
        let Some(wrong) = wrong else { return Ok(Done { model, outcomes, adjustment, scale, known, quality, rejected, made: None }) };
        rejected.push(wrong);
        known = known.without(wrong.0);
        adjustment = settle(&mut model, Some(&known), options)?;
    }
}

/// The length that the others contradict, where there are enough of them to tell which is wrong.
fn wrong_length(lengths: &[(LengthId, Option<f64>)]) -> Option<(LengthId, f64)> {
    let mut ranked: Vec<(LengthId, f64)> = lengths.iter().filter_map(|&(id, w)| Some((id, w?))).collect();
    ranked.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
    let [worst, second, _, ..] = ranked[..] else { return None };
    (worst.1.abs() > CRITICAL && worst.1.powi(2) > second.1.powi(2) + CLEARLY).then_some(worst)
}

/// What the normalised residuals of the lengths say, and where they leave the place of a camera open.
pub(crate) fn length_notes(input: &MapInput, quality: Option<&Quality>, rejected: &[(LengthId, f64)]) -> Vec<String> {
    let lengths = quality.map_or(&[][..], |q| &q.lengths);
    let name = |id: LengthId| match id {
        LengthId::Baseline(i) => {
            let b = &input.rig.baselines[i];
            let [p, q] = [b.cameras.0, b.cameras.1].map(|c| input.cameras[c.index()].name.as_str());
            format!("the baseline of {p} and {q} ({} m)", b.length_m)
        }
        LengthId::ScaleBar(i) => format!("scale bar {} ({} m)", i + 1, input.scale_bars[i].length_m),
    };
    let out = rejected.iter().map(|&(id, w)| {
        let name = name(id);
        format!(
            "{name} contradicts the other lengths (normalised residual {w:.1}, at most {CRITICAL} by chance) and was taken out: check it"
        )
    });
    let against: Vec<String> = lengths
        .iter()
        .filter_map(|&(id, w)| Some((id, w.filter(|w| w.abs() > CRITICAL)?)))
        .map(|(id, w)| format!("{} ({w:.1})", name(id)))
        .collect();
    let undecided = (!against.is_empty()).then(|| {
        let list = against.join(", ");
        format!("known lengths contradict each other, and which is wrong cannot be told: {list}, normalised residuals in brackets, at most {CRITICAL} by chance")
    });
    let bent = quality.filter(|q| q.baseline_bend > MAX_BEND).map(|q| {
        format!(
            "the distances between cameras hardly tell where some of them are across the line to the others (their bend is {:.1} standard \
             deviations, at most {MAX_BEND} is harmless): the stated standard deviations are too small; let the cameras see the same points, \
             or give the mounting of the rig",
            q.baseline_bend
        )
    });
    out.chain(undecided).chain(bent).collect()
}
