//! The log of the vehicle's sensors: a CSV file with a head, one row an instant, fields empty where a sensor gave nothing then.

use anyhow::{Context, Result, bail};
use std::path::Path;

/// Wrong fields that are named each; the rest are counted.
const MAX_NAMED: usize = 5;

/// Readings of one kind: time in seconds and value, by time.
pub type Channel<const N: usize> = Vec<(f64, [f64; N])>;

/// What a log says. Columns of other names are ignored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SensorLog {
    /// `east_m`, `north_m`.
    pub positions: Channel<2>,
    /// `up_m`, of the same instrument.
    pub heights: Channel<1>,
    /// `depth_m`.
    pub depths: Channel<1>,
    /// Up in the body of the vehicle (x forward, y starboard, z down): from `roll_deg` and `pitch_deg`, or else from
    /// `acceleration_x_m_s2` and so on, which is against gravity at rest.
    pub ups: Channel<3>,
    /// Cosine and sine of `heading_deg`, from north over east.
    pub headings: Channel<2>,
    /// First and last time.
    pub span: Option<(f64, f64)>,
    /// What was wrong with it.
    pub warnings: Vec<String>,
}

/// Reads a log. A field that is no number is left out with a warning.
///
/// # Errors
/// When the file cannot be read, is no table, or has no column `time_s`.
pub fn read_sensor_log(path: &Path) -> Result<SensorLog> {
    let name = || path.display().to_string();
    parse(&std::fs::read(path).with_context(name)?).with_context(name)
}

fn parse(bytes: &[u8]) -> Result<SensorLog> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_reader(bytes);
    let head = reader.headers().context("the head of the table cannot be read")?.clone();
    let column = |name: &str| head.iter().position(|h| h == name);
    let Some(time_column) = column("time_s") else {
        bail!("there is no column time_s, seconds; the columns are {}", head.iter().collect::<Vec<_>>().join(", "));
    };
    let columns = |names: &[&str]| names.iter().map(|n| column(n)).collect::<Option<Vec<_>>>();
    let [position, height, depth] = [&["east_m", "north_m"][..], &["up_m"], &["depth_m"]].map(columns);
    let (tilt, heading) = (columns(&["roll_deg", "pitch_deg"]), columns(&["heading_deg"]));
    let acceleration = columns(&["acceleration_x_m_s2", "acceleration_y_m_s2", "acceleration_z_m_s2"]).filter(|_| tilt.is_none());
    let (mut log, mut wrong) = (SensorLog::default(), Vec::new());
    for record in reader.records() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                wrong.push(error.to_string());
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let mut field = |c: usize| -> Option<f64> {
            let text = record.get(c).filter(|t| !t.is_empty())?;
            let value = text.parse().ok().filter(|v: &f64| v.is_finite());
            if value.is_none() {
                wrong.push(format!("line {line}: {} is \"{text}\", which is no number", head.get(c).unwrap_or_default()));
            }
            value
        };
        let Some(time) = field(time_column) else { continue };
        let mut all = |columns: &Option<Vec<usize>>| columns.as_ref()?.iter().map(|&c| field(c)).collect::<Option<Vec<f64>>>();
        if let Some(v) = all(&position) {
            log.positions.push((time, [v[0], v[1]]));
        }
        log.heights.extend(all(&height).map(|v| (time, [v[0]])));
        log.depths.extend(all(&depth).map(|v| (time, [v[0]])));
        log.ups.extend(all(&tilt).map(|v| (time, up_in_body(v[0].to_radians(), v[1].to_radians()))));
        log.ups.extend(all(&acceleration).filter(|v| v.iter().any(|x| *x != 0.0)).map(|v| (time, [v[0], v[1], v[2]])));
        log.headings.extend(all(&heading).map(|v| (time, [v[0].to_radians().cos(), v[0].to_radians().sin()])));
        log.span = Some(log.span.map_or((time, time), |(first, last)| (first.min(time), last.max(time))));
    }
    let more = wrong.len().saturating_sub(MAX_NAMED);
    wrong.truncate(MAX_NAMED);
    log.warnings = wrong;
    log.warnings.extend((more > 0).then(|| format!("{more} more fields are no numbers and were left out")));
    by_time(&mut log.positions);
    by_time(&mut log.heights);
    by_time(&mut log.depths);
    by_time(&mut log.ups);
    by_time(&mut log.headings);
    Ok(log)
}

fn by_time<const N: usize>(channel: &mut Channel<N>) {
    channel.sort_by(|a, b| a.0.total_cmp(&b.0));
}

/// Up, for a vehicle that is turned by heading, then pitched (bow up), then rolled (starboard down).
fn up_in_body(roll: f64, pitch: f64) -> [f64; 3] {
    [pitch.sin(), -roll.sin() * pitch.cos(), -roll.cos() * pitch.cos()]
}

/// What a channel says at the given instants: (index of the instant, value).
///
/// Where it is read at least as often as the instants follow each other, its value at each is interpolated; else each reading belongs to the
/// instant nearest in time, within half the interval.
pub fn at_instants<const N: usize>(channel: &Channel<N>, instants: &[f64]) -> Vec<(usize, [f64; N])> {
    let interval = median_gap(instants.iter().copied()).unwrap_or(1.0);
    let Some(gap) = median_gap(channel.iter().map(|(t, _)| *t)).filter(|gap| *gap <= interval) else {
        let nearest = |t: f64| (0..instants.len()).min_by(|&a, &b| (instants[a] - t).abs().total_cmp(&(instants[b] - t).abs()));
        return channel
            .iter()
            .filter_map(|&(t, value)| Some((nearest(t).filter(|&i| (instants[i] - t).abs() <= interval / 2.0)?, value)))
            .collect();
    };
    let at = |&t: &f64| {
        let next = channel.partition_point(|(time, _)| *time < t);
        let after = channel.get(next)?;
        if after.0 == t {
            return Some(after.1);
        }
        let before = channel.get(next.checked_sub(1)?)?;
        // Across a gap of the log nothing is known.
        let share = Some((t - before.0) / (after.0 - before.0)).filter(|_| after.0 - before.0 <= 3.0 * gap)?;
        Some(std::array::from_fn(|k| before.1[k] + share * (after.1[k] - before.1[k])))
    };
    instants.iter().enumerate().filter_map(|(i, t)| Some((i, at(t)?))).collect()
}

/// Median of the differences of ascending times; `None` for fewer than two different ones.
fn median_gap(times: impl Iterator<Item = f64>) -> Option<f64> {
    let times: Vec<f64> = times.collect();
    let mut gaps: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).filter(|g| *g > 0.0).collect();
    gaps.sort_by(f64::total_cmp);
    gaps.get(gaps.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_read_by_the_names_of_its_columns() {
        let log =
            parse(b"# dive 7\nheading_deg, time_s,note,roll_deg,pitch_deg,depth_m\n90,2.0,a,0,0,\n0,1.0,b,90,0,12.5\n,3,,0,90,\n").unwrap();
        assert_eq!(log.span, Some((1.0, 3.0)));
        assert_eq!(log.depths, [(1.0, [12.5])]);
        assert_eq!(log.headings.iter().map(|h| h.0).collect::<Vec<_>>(), [1.0, 2.0]);
        assert!((log.headings[1].1[1] - 1.0).abs() < 1e-12, "east");
        // On its starboard side, level, bow up: up is to port, against down, forward.
        let expected = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];
        for ((_, up), expected) in log.ups.iter().zip(expected) {
            assert!(up.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{up:?}, {expected:?}");
        }
        assert!(log.warnings.is_empty() && log.positions.is_empty());
    }

    #[test]
    fn accelerations_stand_in_for_roll_and_pitch() {
        let head = "time_s,acceleration_x_m_s2,acceleration_y_m_s2,acceleration_z_m_s2";
        let log = parse(format!("{head}\n0,0,0,-9.8\n1,0,0,0\n").as_bytes()).unwrap();
        assert_eq!(log.ups, [(0.0, [0.0, 0.0, -9.8])]);
    }

    #[test]
    fn wrong_fields_are_named_and_left_out() {
        let log = parse(b"time_s,depth_m\n0,1\n1,deep\nnan,3\n2,2,9\n3\n").unwrap();
        assert_eq!(log.depths, [(0.0, [1.0]), (2.0, [2.0])]);
        assert_eq!(log.warnings, ["line 3: depth_m is \"deep\", which is no number", "line 4: time_s is \"nan\", which is no number"]);
        let many = format!("time_s,depth_m\n{}", "0,x\n".repeat(9));
        assert_eq!(parse(many.as_bytes()).unwrap().warnings.last().unwrap(), "4 more fields are no numbers and were left out");
        assert!(parse(b"time,depth_m\n0,1\n").unwrap_err().to_string().contains("no column time_s"));
    }

    proptest::proptest! {
        /// Whatever the file holds, it is read or refused.
        #[test]
        fn nothing_panics(text in "(time_s|depth_m|roll_deg|[0-9.,\"\\n# -]|nan|1e999){0,60}", bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..200)) {
            let _ = parse(&bytes);
            let _ = parse(text.as_bytes());
            if let Ok(log) = parse(format!("time_s,depth_m,roll_deg,pitch_deg\n{text}").as_bytes()) {
                proptest::prop_assert!(log.depths.is_sorted_by(|a, b| a.0 <= b.0));
                at_instants(&log.depths, &[0.0, 1.0, 2.5]);
                at_instants(&log.ups, &[0.0, 1.0, 2.5]);
            }
        }
    }

    #[test]
    fn frequent_readings_are_interpolated_and_rare_ones_go_to_the_nearest_instant() {
        let instants = [0.0, 1.0, 2.0, 3.0, 10.0];
        let frequent: Channel<1> = (0..8).map(|i| (0.25 + 0.5 * f64::from(i), [f64::from(i)])).collect();
        // Before the first reading and beyond the last nothing is known.
        assert_eq!(at_instants(&frequent, &instants), [(1, [1.5]), (2, [3.5]), (3, [5.5])]);
        let mut gap = frequent.clone();
        gap.drain(1..6);
        gap.push((4.0, [0.0]));
        gap.push((4.25, [0.0]));
        assert_eq!(at_instants(&gap, &[0.0, 1.0, 2.0, 3.5]).iter().map(|r| r.0).collect::<Vec<_>>(), [3]);
        let rare: Channel<1> = vec![(0.4, [1.0]), (2.1, [2.0]), (6.0, [3.0]), (9.9, [4.0])];
        assert_eq!(at_instants(&rare, &instants), [(0, [1.0]), (2, [2.0]), (4, [4.0])]);
        assert!(at_instants(&rare, &[]).is_empty() && at_instants::<1>(&vec![], &instants).is_empty());
    }
}
