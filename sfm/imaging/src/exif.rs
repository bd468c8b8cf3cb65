//! What the camera wrote about itself.

use exif::{Exif, In, Rational, Reader, Tag, Value};

/// Camera data of an image file. A field that is missing, malformed or absurd is `None`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExifInfo {
    /// How the stored pixels have to be turned, 1..=8; 1 as stored. [`crate::decode_grey`] and [`crate::decode_rgb`] apply it.
    pub orientation: u8,
    /// Focal length, millimetres.
    pub focal_mm: Option<f64>,
    /// Focal length of a 36 x 24 mm camera with the same diagonal angle of view, millimetres.
    pub focal_35mm: Option<f64>,
    /// Maker of the camera.
    pub make: Option<String>,
    /// Model of the camera.
    pub model: Option<String>,
    /// Serial number of the body: tells two cameras of one model apart.
    pub serial: Option<String>,
    /// Time of exposure, seconds since 1970 **as if the camera's clock showed UTC**, with the fraction where the camera writes one.
    pub time_secs: Option<f64>,
    /// Pixels per millimetre of the sensor, along x as stored.
    pub focal_plane_px_per_mm: Option<f64>,
    /// Size of the image as the camera wrote it, pixels; differs from the file's where it was resized afterwards.
    pub original_size: Option<(u32, u32)>,
}

impl Default for ExifInfo {
    fn default() -> Self {
        Self {
            orientation: 1,
            focal_mm: None,
            focal_35mm: None,
            make: None,
            model: None,
            serial: None,
            time_secs: None,
            focal_plane_px_per_mm: None,
            original_size: None,
        }
    }
}

/// How a focal length in pixels was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FocalRule {
    /// Focal length in millimetres times the resolution of the focal plane.
    FocalPlaneResolution,
    /// 35 mm equivalent over the diagonal of 36 x 24 mm (43.27 mm), times the diagonal of the image.
    Equivalent35mm,
}

/// A focal length in pixels, and where it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocalEstimate {
    /// Focal length, pixels.
    pub focal_px: f64,
    /// The rule that gave it.
    pub rule: FocalRule,
}

/// Diagonal of the 36 x 24 mm format, millimetres.
const DIAGONAL_35MM: f64 = 43.266_615_305_567_87;
/// Relative difference above which the focal plane resolution is not believed: cameras are known to write it in a wrong unit, or
/// for a thumbnail, while the 35 mm equivalent is off by its rounding to whole millimetres and by the aspect ratio.
const MAX_DISAGREEMENT: f64 = 0.25;
/// Sensors outside these widths (mm) are nonsense.
const SENSOR_WIDTH_MM: std::ops::RangeInclusive<f64> = 1.0..=150.0;

impl ExifInfo {
    /// Focal length in pixels of the image at `width` x `height` pixels, by the better of two rules, or `None` where the
    /// file gives neither: see [`ExifInfo::focal_estimate`].
    #[must_use]
    pub fn focal_px(&self, width: u32, height: u32) -> Option<f64> {
        self.focal_estimate(width, height).map(|f| f.focal_px)
    }

    /// Focal length in pixels of the image at `width` x `height` pixels, and the rule that gave it.
    ///
    /// First the focal plane resolution, corrected for a later change of size; it is passed over where it implies an absurd
    /// sensor or contradicts the 35 mm equivalent by more than a quarter. Then the 35 mm equivalent (by the diagonal, CIPA DCG-001).
    /// Both are those of the lens in air as the camera knows it: under water behind a flat port the effective one is about 1.34 times longer.
    #[must_use]
    pub fn focal_estimate(&self, width: u32, height: u32) -> Option<FocalEstimate> {
        let (w, h) = (f64::from(width), f64::from(height));
        let equivalent = self.focal_35mm.map(|f| f / DIAGONAL_35MM * w.hypot(h));
        let plane = self.focal_mm.zip(self.focal_plane_px_per_mm).and_then(|(focal, px_per_mm)| {
            let long = w.max(h);
            let original = self.original_size.map_or(long, |(ow, oh)| f64::from(ow.max(oh)));
            SENSOR_WIDTH_MM.contains(&(original / px_per_mm)).then_some(focal * px_per_mm * long / original)
        });
        let plane = plane.filter(|f| equivalent.is_none_or(|e| (f / e - 1.0).abs() <= MAX_DISAGREEMENT));
        let by = |rule| move |focal_px| FocalEstimate { focal_px, rule };
        plane.map(by(FocalRule::FocalPlaneResolution)).or(equivalent.map(by(FocalRule::Equivalent35mm)))
    }
}

/// Reads the camera data of an image file; what is missing or malformed stays `None`.
pub(crate) fn read_exif(bytes: &[u8]) -> ExifInfo {
    let mut reader = Reader::new();
    reader.continue_on_error(true);
    match reader.read_from_container(&mut std::io::Cursor::new(bytes)).or_else(|e| e.distill_partial_result(|_| {})) {
        Ok(exif) => interpret(&exif),
        Err(_) => ExifInfo::default(),
    }
}

fn interpret(exif: &Exif) -> ExifInfo {
    let orientation = unsigned(exif, Tag::Orientation).and_then(|o| u8::try_from(o).ok()).filter(|o| (1..=8).contains(o));
    // EXIF 2.32: 2 inch (also the default), 3 centimetre; millimetre and micrometre (4, 5) are widespread extensions.
    let unit_mm = match unsigned(exif, Tag::FocalPlaneResolutionUnit) {
        Some(3) => 10.0,
        Some(4) => 1.0,
        Some(5) => 0.001,
        _ => 25.4,
    };
    let size = unsigned(exif, Tag::PixelXDimension).zip(unsigned(exif, Tag::PixelYDimension)).filter(|&(w, h)| w > 0 && h > 0);
    ExifInfo {
        orientation: orientation.unwrap_or(1),
        focal_mm: positive(exif, Tag::FocalLength),
        focal_35mm: positive(exif, Tag::FocalLengthIn35mmFilm),
        make: text(exif, Tag::Make),
        model: text(exif, Tag::Model),
        serial: text(exif, Tag::BodySerialNumber),
        time_secs: time(exif),
        focal_plane_px_per_mm: positive(exif, Tag::FocalPlaneXResolution).map(|r| r / unit_mm),
        original_size: size,
    }
}

fn unsigned(exif: &Exif, tag: Tag) -> Option<u32> {
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0)
}

fn positive(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(v) => v.first().map(Rational::to_f64)?,
        other => f64::from(other.get_uint(0)?),
    };
    (value.is_finite() && value > 0.0).then_some(value)
}

fn ascii(exif: &Exif, tag: Tag) -> Option<&[u8]> {
    match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Ascii(v) => v.first().map(Vec::as_slice),
        _ => None,
    }
}

fn text(exif: &Exif, tag: Tag) -> Option<String> {
    let text = String::from_utf8_lossy(ascii(exif, tag)?);
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    (!text.is_empty()).then(|| text.to_owned())
}

/// DateTimeOriginal with SubSecTimeOriginal.
fn time(exif: &Exif) -> Option<f64> {
    let at = exif::DateTime::from_ascii(ascii(exif, Tag::DateTimeOriginal)?).ok()?;
    let (month, day) = (i64::from(at.month), i64::from(at.day));
    let valid = at.year > 0 && (1..=12).contains(&month) && (1..=31).contains(&day) && at.hour < 24 && at.minute < 60 && at.second <= 60;
    if !valid {
        return None;
    }
    let seconds = days_since_1970(i64::from(at.year), month, day) * 86_400
        + i64::from(at.hour) * 3_600
        + i64::from(at.minute) * 60
        + i64::from(at.second);
    Some(seconds as f64 + fraction(ascii(exif, Tag::SubSecTimeOriginal).unwrap_or_default()))
}

/// Fraction of a second from the digits that follow the decimal point.
fn fraction(digits: &[u8]) -> f64 {
    let digits: String = digits.iter().take_while(|d| d.is_ascii_digit()).map(|&d| char::from(d)).collect();
    if digits.is_empty() { 0.0 } else { format!("0.{digits}").parse().unwrap_or(0.0) }
}

/// Days of the proleptic Gregorian calendar. Years are counted from March, so that the leap day ends them; 153 days are
/// the five months from March to July, and the same pattern repeats.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let before_year = 365 * year + year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    // Day 0 is 1 March of the year 0; 1 January 1970 is day 719,468 of that count.
    before_year + (153 * month + 2) / 5 + day - 1 - 719_468
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_of_the_calendar() {
        // Day numbers as `date -u +%s` gives them, over 86,400.
        for (date, days) in [
            ((1970, 1, 1), 0),
            ((1969, 12, 31), -1),
            ((2000, 2, 29), 11_016),
            ((2000, 3, 1), 11_017),
            ((2024, 12, 31), 20_088),
            ((2100, 3, 1), 47_541),
        ] {
            assert_eq!(days_since_1970(date.0, date.1, date.2), days, "{date:?}");
        }
    }

    #[test]
    fn fractions_of_a_second() {
        assert_eq!(fraction(b"25"), 0.25);
        assert_eq!(fraction(b"007 "), 0.007);
        assert_eq!(fraction(b""), 0.0);
        assert_eq!(fraction(b"x"), 0.0);
    }

    #[test]
    fn focal_length_by_the_resolution_of_the_focal_plane() {
        // 36 mm sensor of 6000 px, 50 mm lens; stored at half size later.
        let exif = ExifInfo {
            focal_mm: Some(50.0),
            focal_plane_px_per_mm: Some(6000.0 / 36.0),
            original_size: Some((6000, 4000)),
            ..ExifInfo::default()
        };
        let full = exif.focal_estimate(6000, 4000).expect("both tags");
        assert_eq!(full.rule, FocalRule::FocalPlaneResolution);
        assert!((full.focal_px - 6000.0 * 50.0 / 36.0).abs() < 1e-9);
        let half = exif.focal_px(2000, 3000).expect("both tags");
        assert!((half - 3000.0 * 50.0 / 36.0).abs() < 1e-9);
    }

    #[test]
    fn focal_length_by_the_equivalent() {
        let exif = ExifInfo { focal_35mm: Some(35.0), ..ExifInfo::default() };
        let found = exif.focal_estimate(3600, 2400).expect("the tag");
        assert_eq!(found.rule, FocalRule::Equivalent35mm);
        assert!((found.focal_px - 3500.0).abs() < 1e-9, "on 3:2 the diagonal rule is the width rule");
    }

    #[test]
    fn absurd_focal_planes_are_passed_over() {
        // Inches taken for centimetres: 2.54 times too long.
        let exif = ExifInfo {
            focal_mm: Some(50.0),
            focal_plane_px_per_mm: Some(6000.0 / 36.0 * 2.54),
            focal_35mm: Some(50.0),
            ..ExifInfo::default()
        };
        assert_eq!(exif.focal_estimate(6000, 4000).map(|f| f.rule), Some(FocalRule::Equivalent35mm));
        let exif = ExifInfo { focal_mm: Some(50.0), focal_plane_px_per_mm: Some(1e7), ..ExifInfo::default() };
        assert_eq!(exif.focal_estimate(6000, 4000), None);
        assert_eq!(ExifInfo::default().focal_px(6000, 4000), None);
    }
}
