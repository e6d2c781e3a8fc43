//! `polyptych-viewer [--plugin-dir FOLDER]... [--trust-plugins] [--script FILE] [SCENE]`: opens a scene file, a model,
//! or `builtin:NAME`, and shows it.

use polyptych::BuiltinBackends;
use polyptych::plugins::{self, Isolation, Options, PluginBackends, plugin_folders};
use polyptych::seam::Registry;
use polyptych_viewer::{Script, Viewer, data_folder, open, show_viewer};
use std::path::PathBuf;
use std::process::ExitCode;

/// Exit code for a wrong call, as the command has it.
const WRONG_USE: u8 = 2;
/// Exit code for a refused input, as the command has it.
const REFUSED: u8 = 3;

const USAGE: &str = "polyptych-viewer [--plugin-dir FOLDER]... [--trust-plugins] [--script FILE] [SCENE]: a scene file, \
                     a model, or builtin:NAME";

/// What was asked for.
struct Arguments {
    scene: String,
    plugin_folders: Vec<PathBuf>,
    trust_plugins: bool,
    /// A session that goes by itself.
    script: Option<PathBuf>,
}

impl Arguments {
    fn read(words: impl Iterator<Item = String>) -> Option<Self> {
        let (mut scene, mut words) = (None, words);
        let mut asked =
            Self { scene: String::new(), plugin_folders: Vec::new(), trust_plugins: false, script: None };
        while let Some(word) = words.next() {
            match word.as_str() {
                "--plugin-dir" => asked.plugin_folders.push(words.next()?.into()),
                "--script" => asked.script = Some(words.next()?.into()),
                "--trust-plugins" => asked.trust_plugins = true,
                _ if word.starts_with('-') || scene.is_some() => return None,
                _ => scene = Some(word),
            }
        }
        asked.scene = scene.unwrap_or_else(|| "builtin:atelier".to_owned());
        Some(asked)
    }
}

fn main() -> ExitCode {
    // A plugin's own process is this program, called anew.
    plugins::serve();
    start_with_settings();
    let Some(arguments) = Arguments::read(std::env::args().skip(1)) else {
        eprintln!("usage: {USAGE}");
        return ExitCode::from(WRONG_USE);
    };
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err((code, why)) => {
            eprintln!("error: {why}");
            ExitCode::from(code)
        }
    }
}

/// Starts anew with what libraries read from the environment before `main`, unless somebody chose a value.
#[cfg(target_os = "linux")]
fn start_with_settings() {
    use std::os::unix::process::CommandExt;
    // An OpenGL that is drawn in software (Mesa's llvmpipe) takes all cores that it finds from those who draw the
    // pictures, to show them hardly sooner.
    let threads = std::thread::available_parallelism().map_or(1, usize::from) / 4;
    // glibc gives freed pictures back to the system only while they are larger than the largest ever freed; else each
    // thread that drew one keeps as much for good, and memory grows with every back end that is switched to.
    let mapped = 1_usize << 20;
    let missing: Vec<_> = [("LP_NUM_THREADS", threads), ("MALLOC_MMAP_THRESHOLD_", mapped)]
        .into_iter()
        .filter(|(name, _)| std::env::var_os(name).is_none())
        .map(|(name, value)| (name, value.to_string()))
        .collect();
    if let (false, Ok(own)) = (missing.is_empty(), std::env::current_exe()) {
        // Whatever keeps it from starting anew, it goes on as it is.
        let _ = std::process::Command::new(own).args(std::env::args_os().skip(1)).envs(missing).exec();
    }
}

#[cfg(not(target_os = "linux"))]
fn start_with_settings() {}

fn run(arguments: &Arguments) -> Result<(), (u8, String)> {
    if let Some(folder) = arguments.plugin_folders.iter().find(|folder| !folder.is_dir()) {
        return Err((WRONG_USE, format!("--plugin-dir {}: there is no such folder", folder.display())));
    }
    let mut options = Options::default();
    if arguments.trust_plugins {
        options.isolation = Isolation::InProcess;
    }
    let folders: Vec<_> =
        plugin_folders(&arguments.plugin_folders).into_iter().filter(|folder| folder.is_dir()).collect();
    let mut registry = Registry::builtin();
    let refused = registry.add_plugins(&folders, &options).map_err(|e| (REFUSED, e.to_string()))?;
    let scene = open(&arguments.scene).map_err(|why| (REFUSED, why))?;
    let mut viewer = Viewer::new(registry, scene).map_err(|e| (1, e.to_string()))?;
    viewer.list_refused(refused.iter().map(ToString::to_string));
    viewer.name_scene(&arguments.scene);
    if let Some(file) = &arguments.script {
        // A scripted session is the same for everyone: nothing of other sessions is in it.
        let refuse = |why: String| (REFUSED, format!("{}: {why}", file.display()));
        let text = std::fs::read_to_string(file).map_err(|e| refuse(e.to_string()))?;
        viewer.follow(Script::read(&text).map_err(refuse)?);
    } else if let Some(folder) = data_folder() {
        viewer.keep_in(folder);
    }
    show_viewer(viewer).map_err(|e| (1, e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_or_refused() {
        let read = |words: &[&str]| Arguments::read(words.iter().map(|w| (*w).to_owned()));
        let words = ["--plugin-dir", "a", "b.obj", "--plugin-dir", "c", "--trust-plugins", "--script", "d"];
        let asked = read(&words).unwrap();
        assert_eq!(asked.script, Some(PathBuf::from("d")));
        assert_eq!((asked.scene.as_str(), asked.trust_plugins), ("b.obj", true));
        assert_eq!(asked.plugin_folders, [PathBuf::from("a"), PathBuf::from("c")]);
        assert_eq!(read(&[]).unwrap().scene, "builtin:atelier");
        assert!(read(&["--plugin-dir"]).is_none() && read(&["--wrong"]).is_none());
        assert!(read(&["a", "b"]).is_none());
    }
}
