//! `polyptych-viewer [SCENE]`: opens a scene file, a model, or `builtin:NAME`, and shows it.

use polyptych_viewer::{open, show};
use std::process::ExitCode;

/// Exit code for a refused input, as the command has it.
const REFUSED: u8 = 3;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let name = match &arguments[..] {
        [] => "builtin:atelier",
        [name] if !name.starts_with('-') => name,
        _ => {
            eprintln!("usage: polyptych-viewer [SCENE]: a scene file, a model, or builtin:NAME");
            return ExitCode::from(2);
        }
    };
    let scene = match open(name) {
        Ok(scene) => scene,
        Err(why) => {
            eprintln!("error: {why}");
            return ExitCode::from(REFUSED);
        }
    };
    match show(scene) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
