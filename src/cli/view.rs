//! `polyptych view`: the viewer is a program of its own beside this one, so that who needs no window builds none.

use super::Failure;
use super::arguments::ViewerArguments;
use std::process::Command;

pub(super) fn run(arguments: &ViewerArguments) -> Result<(), Failure> {
    let own = std::env::current_exe().map_err(Failure::running)?;
    let viewer = own.with_file_name(format!("polyptych-viewer{}", std::env::consts::EXE_SUFFIX));
    if !viewer.is_file() {
        let how =
            "the viewer is a program of its own: build it with `cargo build --release -p polyptych-viewer`";
        return Err(Failure::running(format!("{}: there is no such program; {how}", viewer.display())));
    }
    let mut command = Command::new(&viewer);
    for folder in &arguments.plugin_dir {
        command.arg("--plugin-dir").arg(folder);
    }
    if arguments.trust_plugins {
        command.arg("--trust-plugins");
    }
    let ended = command.arg(&arguments.scene).status();
    let ended = ended.map_err(|e| Failure::running(format!("{}: {e}", viewer.display())))?;
    // The viewer has said what was wrong.
    if ended.success() { Ok(()) } else { std::process::exit(ended.code().unwrap_or(1)) }
}
