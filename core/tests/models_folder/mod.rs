//! Where are the test models?

use std::path::{Path, PathBuf};

/// Finds the folder of test models: `POLYPTYCH_MODELS`, or `shared/models` beside or above the workspace.
///
/// Without it the test is skipped, unless `CI` is set, where its absence is a failure.
pub(crate) fn find() -> Option<PathBuf> {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let named = std::env::var_os("POLYPTYCH_MODELS").map(PathBuf::from);
    let near = [workspace.join("../shared/models"), workspace.join("../../shared/models")];
    let found = named.into_iter().chain(near).find(|folder| folder.join("MANIFEST.md").is_file());
    if found.is_none() {
        assert!(std::env::var_os("CI").is_none(), "the test models are missing: set POLYPTYCH_MODELS");
        eprintln!("skipped: no folder of test models, set POLYPTYCH_MODELS");
    }
    found
}
