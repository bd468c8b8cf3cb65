//! The laws of the store, on a toy stage: stopped between any two operations and started again, it ends with the same
//! bytes; what is not its own stays.

use super::*;
use serde_json::json;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Lets a number of operations through, then fails every one, as if the process had died or the disk were full. A write
/// that fails leaves half of its bytes. Does not sync: the tests would wait for the medium thousands of times.
struct FailingDisk {
    left: AtomicUsize,
}

impl FailingDisk {
    fn after(operations: usize) -> Self {
        Self { left: AtomicUsize::new(operations) }
    }

    fn step(&self) -> io::Result<()> {
        let passed = self.left.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |left| left.checked_sub(1));
        passed.map(|_| ()).map_err(|_| io::Error::from(io::ErrorKind::StorageFull))
    }
}

impl Disk for FailingDisk {
    fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        RealDisk.create_folder(path)
    }
    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let step = self.step();
        std::fs::write(path, if step.is_ok() { bytes } else { &bytes[..bytes.len() / 2] })?;
        step
    }
    fn append(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let step = self.step();
        RealDisk.append(path, if step.is_ok() { bytes } else { &bytes[..bytes.len() / 2] })?;
        step
    }
    fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.step()?;
        RealDisk.rename(from, to)
    }
    fn remove(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        RealDisk.remove(path)
    }
    fn remove_folder(&self, path: &Path) -> io::Result<()> {
        self.step()?;
        RealDisk.remove_folder(path)
    }
    fn sync_folder(&self, _: &Path) -> io::Result<()> {
        self.step()
    }
}

/// Every file below a folder with its content, and every folder.
fn tree(root: &Path) -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    let mut folders = vec![root.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
            if path.is_dir() {
                files.insert(format!("{name}/"), String::new());
                folders.push(path);
            } else {
                files.insert(name, String::from_utf8(std::fs::read(&path).unwrap()).unwrap());
            }
        }
    }
    files
}

/// A stage of `count` items whose content depends on `option`; items of the same number modulo 3 share their key between
/// options.
fn toy_run(root: &Path, disk: Box<dyn Disk>, count: usize, option: u32, made: &AtomicUsize) -> Result<(), StoreError> {
    let store = Store::open_with(root, disk)?;
    let files = StageFiles::begin(&store, "toy", false)?;
    for i in 0..count {
        let text = if i % 3 == 0 { format!("item {i} of any option") } else { format!("item {i} of option {option}") };
        files.item::<StoreError>(&format!("frames/C{}/{i}.txt", i % 2), Fingerprint::of_bytes(text.as_bytes()), || {
            made.fetch_add(1, Ordering::Relaxed);
            Ok(text.clone().into_bytes())
        })?;
    }
    let identity =
        Identity { version: 1, options: json!({"option": option, "count": count}), inputs: BTreeMap::new(), upstream: BTreeMap::new() };
    files.finish(identity, json!({"items": count}), Vec::new())?;
    store.clear_temporary()
}

fn run_whole(root: &Path, count: usize, option: u32) -> usize {
    let made = AtomicUsize::new(0);
    toy_run(root, Box::new(FailingDisk::after(usize::MAX)), count, option, &made).unwrap();
    made.into_inner()
}

/// Stops a run after every possible number of operations, from an empty folder and over an earlier run with other
/// options, and compares what the next run ends with.
#[test]
fn stopped_anywhere_and_started_again_ends_with_the_same_bytes() {
    let reference = tempfile::tempdir().unwrap();
    run_whole(reference.path(), 4, 1);
    let expected = tree(reference.path());
    for earlier in [None, Some((7, 2)), Some((4, 1))] {
        let mut operations = 0;
        loop {
            let folder = tempfile::tempdir().unwrap();
            let root = folder.path().join("out");
            if let Some((count, option)) = earlier {
                run_whole(&root, count, option);
            }
            let stopped = toy_run(&root, Box::new(FailingDisk::after(operations)), 4, 1, &AtomicUsize::new(0));
            run_whole(&root, 4, 1);
            assert_eq!(tree(&root), expected, "stopped after {operations} operations, over {earlier:?}");
            if stopped.is_ok() {
                break;
            }
            operations += 1;
        }
        assert!(operations > 5, "the run has more operations than {operations}");
    }
}

/// A run that is stopped, another with other options, and the first again: no file of the second survives.
#[test]
fn a_stopped_change_of_options_can_be_taken_back() {
    let reference = tempfile::tempdir().unwrap();
    run_whole(reference.path(), 5, 1);
    let expected = tree(reference.path());
    for operations in 0..40 {
        let folder = tempfile::tempdir().unwrap();
        run_whole(folder.path(), 5, 1);
        let _ = toy_run(folder.path(), Box::new(FailingDisk::after(operations)), 6, 2, &AtomicUsize::new(0));
        run_whole(folder.path(), 5, 1);
        assert_eq!(tree(folder.path()), expected, "stopped after {operations} operations");
    }
}

#[test]
fn a_stop_loses_one_item() {
    let folder = tempfile::tempdir().unwrap();
    let disk = FailingDisk::after(25);
    let made = AtomicUsize::new(0);
    assert!(matches!(toy_run(folder.path(), Box::new(disk), 10, 1, &made), Err(StoreError::Write { .. })));
    let before = made.into_inner();
    assert!(before > 1);
    let after = run_whole(folder.path(), 10, 1);
    assert!(before + after <= 11, "{before} and {after} items were made of 10");
}

#[test]
fn only_what_depends_on_an_option_is_made_again() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(run_whole(folder.path(), 6, 1), 6);
    assert_eq!(run_whole(folder.path(), 6, 1), 0);
    assert_eq!(run_whole(folder.path(), 6, 2), 4);
}

/// A full disk: the error says what to do, and what was there before is whole.
#[test]
fn a_full_disk_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    run_whole(folder.path(), 3, 1);
    let before = tree(folder.path());
    // Up to the first file that is made again: the stamp may no longer vouch, but every file is what it was.
    for operations in 1..6 {
        let error = toy_run(folder.path(), Box::new(FailingDisk::after(operations)), 3, 2, &AtomicUsize::new(0)).unwrap_err();
        assert!(error.to_string().contains("make room"), "{error}");
        let now = tree(folder.path());
        for (path, content) in before.iter().filter(|(path, _)| path.starts_with("frames")) {
            assert_eq!(now.get(path), Some(content), "{path} after {operations} operations");
        }
    }
}

#[test]
fn foreign_files_stop_a_run_before_it_writes() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("masks")).unwrap();
    std::fs::write(folder.path().join("masks/mine.png"), "mine").unwrap();
    let before = tree(folder.path());
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Foreign { .. })));
    assert_eq!(tree(folder.path()), before);
}

#[test]
fn what_a_user_adds_or_changes_is_not_removed() {
    let folder = tempfile::tempdir().unwrap();
    run_whole(folder.path(), 6, 1);
    std::fs::write(folder.path().join("frames/C1/notes.txt"), "mine").unwrap();
    std::fs::write(folder.path().join("frames/C1/5.txt"), "edited").unwrap();
    run_whole(folder.path(), 2, 1);
    let now = tree(folder.path());
    assert_eq!(now.get("frames/C1/notes.txt").map(String::as_str), Some("mine"));
    assert_eq!(now.get("frames/C1/5.txt").map(String::as_str), Some("edited"));
    assert!(!now.contains_key("frames/C0/4.txt"), "what the run wrote and nobody changed goes");
}

#[test]
fn two_runs_do_not_mix() {
    let folder = tempfile::tempdir().unwrap();
    let first = Store::open(folder.path()).unwrap();
    assert!(matches!(Store::open(folder.path()), Err(StoreError::Busy { .. })));
    drop(first);
    assert!(Store::open(folder.path()).is_ok());
}

#[test]
fn an_output_that_is_a_file_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("out");
    std::fs::write(&file, "a file").unwrap();
    assert!(matches!(Store::open(&file), Err(StoreError::Folder { .. })));
    assert_eq!(std::fs::read(&file).unwrap(), b"a file");
}
