//! The ONNX Runtime library: where it is, and that it loads.

use crate::ModelError;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A loaded ONNX Runtime. A process holds one: which library ran is part of what a result depends on.
#[derive(Clone, Debug)]
pub struct Runtime {
    pub(crate) environment: ort::environment::Environment,
    library: PathBuf,
}

/// The library that this process has loaded.
static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);

impl Runtime {
    /// Loads the library: `named`, else that of `ORT_DYLIB_PATH`, else the first of: beside the program, in a folder `.onnxruntime` of the
    /// program's or the working folder or one above (where `make setup` puts it), among the packages of Python, on the loader's path.
    ///
    /// A library that was loaded before stays, unless `named` names another.
    ///
    /// # Errors
    /// [`ModelError::NoRuntime`] where none is found, [`ModelError::Runtime`] where it does not load.
    pub fn load(named: Option<&Path>) -> Result<Self, ModelError> {
        let mut loaded = LOADED.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if let Some(runtime) = loaded.as_ref()
            && named.is_none_or(|n| n == runtime.library)
        {
            return Ok(runtime.clone());
        }
        let library = find(named)?;
        let refused = |reason: String| ModelError::Runtime { path: library.clone(), reason };
        if let Some(runtime) = loaded.as_ref() {
            return Err(refused(format!("{} is loaded already", runtime.library.display())));
        }
        let environment = ort::init_from(&library).map_err(|e| refused(e.to_string()))?.build().map_err(|e| refused(e.to_string()))?;
        let runtime = Self { environment, library };
        *loaded = Some(runtime.clone());
        Ok(runtime)
    }

    /// File name of the library, which tells its version.
    #[must_use]
    pub fn name(&self) -> String {
        self.library.file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The library.
    #[must_use]
    pub fn library(&self) -> &Path {
        &self.library
    }
}

/// Names of the library on this system begin so.
const PREFIX: &str = if cfg!(windows) { "onnxruntime.dll" } else { "libonnxruntime." };

fn find(named: Option<&Path>) -> Result<PathBuf, ModelError> {
    let given = named.map(Path::to_path_buf).or_else(|| std::env::var_os("ORT_DYLIB_PATH").filter(|v| !v.is_empty()).map(PathBuf::from));
    if let Some(path) = given {
        let missing = || ModelError::Runtime { path: path.clone(), reason: "there is no such file".to_owned() };
        return if path.is_dir() {
            library_in(&path).ok_or_else(missing)
        } else {
            path.is_file().then(|| path.clone()).ok_or_else(missing)
        };
    }
    let program = std::env::current_exe().ok();
    let beside = program.as_deref().and_then(Path::parent).map(Path::to_path_buf);
    let working = std::env::current_dir().ok();
    let above = |start: &Option<PathBuf>| -> Vec<PathBuf> {
        start.iter().flat_map(|s| s.ancestors()).map(|f| f.join(".onnxruntime/onnxruntime/capi")).collect()
    };
    let mut folders: Vec<PathBuf> = beside.iter().cloned().collect();
    folders.extend(above(&beside));
    folders.extend(above(&working));
    folders.extend(python_packages());
    folders.extend(
        ["/usr/local/lib", "/usr/lib", "/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/opt/homebrew/lib"].map(PathBuf::from),
    );
    folders.iter().find_map(|folder| library_in(folder)).ok_or(ModelError::NoRuntime)
}

/// The library in a folder; of several versions the last by name.
fn library_in(folder: &Path) -> Option<PathBuf> {
    let names = std::fs::read_dir(folder).ok()?.flatten().filter_map(|e| e.file_name().into_string().ok());
    // `libonnxruntime_providers_shared.so` does not begin with `libonnxruntime.`.
    names.filter(|n| n.starts_with(PREFIX)).max().map(|n| folder.join(n))
}

/// Folders where `pip install onnxruntime` puts the library, as the Python of this environment says.
fn python_packages() -> Option<PathBuf> {
    let program = if cfg!(windows) { "python" } else { "python3" };
    let code = "import importlib.util as u; s = u.find_spec('onnxruntime'); print(s.submodule_search_locations[0] if s else '')";
    let output = std::process::Command::new(program).args(["-c", code]).output().ok()?;
    let folder = String::from_utf8(output.stdout).ok()?;
    let folder = folder.trim();
    (!folder.is_empty()).then(|| Path::new(folder).join("capi"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_library_that_is_missing_is_told() {
        let error = find(Some(Path::new("/nowhere/libonnxruntime.so"))).expect_err("missing");
        assert!(error.to_string().contains("/nowhere/libonnxruntime.so"), "{error}");
    }

    #[test]
    fn the_last_version_in_a_folder_is_taken_and_no_provider() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["libonnxruntime_providers_shared.so", "libonnxruntime.so.1.20.0", "libonnxruntime.so.1.31.1"] {
            std::fs::write(folder.path().join(name), b"").expect("written");
        }
        assert_eq!(library_in(folder.path()), Some(folder.path().join("libonnxruntime.so.1.31.1")));
        assert_eq!(find(Some(folder.path())).expect("found"), folder.path().join("libonnxruntime.so.1.31.1"));
    }
}
