//! What the tests of plugins share: the libraries, and a C compiler.

#![allow(dead_code, reason = "each test uses its own part")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns a library that was built as a dependency of the tests.
pub(crate) fn built(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("the test knows where it is");
    let file = format!("{}{name}{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let path = tests.with_file_name(file);
    assert!(path.exists(), "{} is built with the tests", path.display());
    path
}

/// Makes an empty folder for a test.
pub(crate) fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("polyptych-plugins-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a temporary folder");
    path
}

/// Returns a file of the project, whichever of its packages is tested.
pub(crate) fn source(file: &str) -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let root = package.ancestors().find(|folder| folder.join("plugins/abi").is_dir());
    root.unwrap_or(package).join(file)
}

/// Builds a plugin in C; nothing where there is no compiler, which CI has.
pub(crate) fn compiled(file: &str, library: &Path, options: &[&str]) -> Option<()> {
    if Command::new("cc").arg("--version").output().is_err() {
        assert!(std::env::var_os("CI").is_none(), "CI needs a C compiler");
        eprintln!("skipped: there is no cc");
        return None;
    }
    let done = Command::new("cc")
        .args(["-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-I"])
        .arg(source("plugins/abi/include"))
        .args(options)
        .arg(source(file))
        .arg("-o")
        .arg(library)
        .arg("-lm")
        .output()
        .expect("cc runs");
    assert!(done.status.success(), "{file}: {}", String::from_utf8_lossy(&done.stderr));
    Some(())
}
