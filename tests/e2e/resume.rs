//! The same bytes at any number of threads, and after a kill at any instant.

#![allow(clippy::unwrap_used, reason = "a test may fail")]

mod support;

use std::process::Stdio;
use std::time::{Duration, Instant};
use support::{Dive, tree};
use synthetic::Random;
use synthetic::dive::DiveOptions;

/// Two cameras, small enough for twenty runs, large enough to be oriented.
fn dive() -> Dive {
    let (dive, _) = Dive::rendered(&DiveOptions::small(4, 320, 200));
    let cameras = "[[camera]]\nimages = \"frames/C1\"\n[[camera]]\nimages = \"frames/C2\"\n";
    let baseline = "[[rig.baseline]]\nbetween = [\"C1\", \"C2\"]\nlength_m = 0.4\n";
    for output in ["one", "two", "killed"] {
        let text = format!(
            "[dive]\noutput = \"{output}\"\n{cameras}{baseline}[mask]\nstrategy = \"ip\"\n[matching]\npairs = \"sequential\"\noverlap = 1\n[densify]\nquality = \"low\"\n"
        );
        dive.write(&format!("{output}.toml"), &text);
    }
    dive
}

#[test]
fn threads_and_kills_leave_the_same_bytes() {
    let dive = dive();
    let started = Instant::now();
    dive.ok(&["run", "one.toml", "--threads", "1"]);
    let duration = started.elapsed();
    let expected = tree(&dive.path("one"));
    assert!(expected.len() > 5, "{:?}", expected.keys());

    dive.ok(&["run", "two.toml", "--threads", "2"]);
    assert_same(&expected, &tree(&dive.path("two")), "two threads");

    let mut random = Random::new(1);
    for kill in 0..10 {
        let mut child = dive.command(&["run", "killed.toml"]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // Each run goes on where the last was killed: short pieces, so that ten of them cover the whole.
        let instant = duration.mul_f64(random.range(0.02, 0.25));
        std::thread::sleep(instant.max(Duration::from_millis(2)));
        child.kill().unwrap();
        child.wait().unwrap();
        if kill % 3 == 2 {
            // From the start again, so that early instants are met too.
            std::fs::remove_dir_all(dive.path("killed")).unwrap_or_default();
        }
    }
    dive.ok(&["run", "killed.toml"]);
    assert_same(&expected, &tree(&dive.path("killed")), "ten kills");
}

fn assert_same(expected: &std::collections::BTreeMap<String, Vec<u8>>, found: &std::collections::BTreeMap<String, Vec<u8>>, what: &str) {
    let names = |t: &std::collections::BTreeMap<String, Vec<u8>>| t.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(expected), names(found), "files after {what}");
    for (name, bytes) in expected {
        assert!(found[name] == *bytes, "{name} differs after {what}");
    }
}
