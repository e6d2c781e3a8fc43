//! What is left of a session that ended, by whatever means? What persists, and scenes that were not saved.
//!
//! A thread of its own writes both into the user's data folder. A scene that was changed is written a moment later, under
//! the number of the process; a file of a process that is gone holds what it did not save.

use polyptych::load::save;
use polyptych::picture::write_whole;
use polyptych::scene::Scene;
use polyptych::seam::Settings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Least time between two writes of a scene; and that a write may take a tenth of the time at most.
const CALM: Duration = Duration::from_millis(500);

/// What persists from one session to the next.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Memory {
    /// Files that were opened, the newest first.
    pub(crate) recent: Vec<String>,
    /// Back end and channel of each pane.
    pub(crate) panes: Vec<(String, String)>,
    pub(crate) mode: String,
    /// Values of parameters by back end and name, as text.
    pub(crate) settings: BTreeMap<String, BTreeMap<String, String>>,
    pub(crate) is_light: bool,
    pub(crate) zoom: f32,
    /// Size of the window, points.
    pub(crate) window: [f32; 2],
    /// Names of the panels that are open.
    pub(crate) panels: Vec<String>,
    /// Whether the first screen was seen.
    pub(crate) is_welcomed: bool,
}

impl Memory {
    /// Puts a file in front of the recent ones.
    pub(crate) fn opened(&mut self, name: &str) {
        self.recent.retain(|other| other != name);
        self.recent.insert(0, name.to_owned());
        self.recent.truncate(12);
    }

    /// Writes down what was set.
    pub(crate) fn remember(&mut self, settings: &BTreeMap<String, Settings>) {
        let texts = |settings: &Settings| {
            settings.iter().map(|(name, value)| (name.to_owned(), value.to_string())).collect()
        };
        self.settings = settings.iter().map(|(id, settings)| (id.clone(), texts(settings))).collect();
    }
}

/// Returns the user's folder for what persists; nothing where the system has none.
#[must_use]
pub fn data_folder() -> Option<PathBuf> {
    let folder = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
    let data = if cfg!(windows) {
        folder("LOCALAPPDATA")
    } else {
        folder("XDG_DATA_HOME").or_else(|| folder("HOME").map(|home| home.join(".local/share")))
    };
    data.map(|data| data.join("polyptych/viewer"))
}

/// Writes what persists, on a thread of its own.
pub(crate) struct Keeper {
    folder: PathBuf,
    desk: Arc<Desk>,
}

#[derive(Default)]
struct Desk {
    state: Mutex<State>,
    told: Condvar,
}

#[derive(Default)]
struct State {
    scene: Option<Arc<Scene>>,
    memory: Option<Memory>,
    /// The scene that was kept last.
    kept: Option<Arc<Scene>>,
    is_busy: bool,
    /// Whether somebody waits for everything to be written.
    is_hurried: bool,
    is_closed: bool,
    failure: Option<String>,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Keeper {
    /// Keeps things in a folder, which is made when there is something to keep.
    pub(crate) fn new(folder: PathBuf) -> Self {
        let desk = Arc::<Desk>::default();
        let (shared, place) = (desk.clone(), folder.clone());
        std::thread::spawn(move || write_what_comes(&shared, &place));
        Self { folder, desk }
    }

    /// Returns what was kept of the session before; what cannot be read is as if it had never been.
    pub(crate) fn memory(&self) -> Memory {
        let text = std::fs::read_to_string(self.folder.join("viewer.ron")).unwrap_or_default();
        ron::from_str(&text).unwrap_or_default()
    }

    /// Keeps what persists.
    pub(crate) fn remember(&self, memory: Memory) {
        self.desk.lock().memory = Some(memory);
        self.desk.told.notify_one();
    }

    /// Keeps a changed scene.
    pub(crate) fn keep(&self, scene: &Arc<Scene>) {
        let mut state = self.desk.lock();
        let last = state.scene.as_ref().or(state.kept.as_ref());
        if last.is_none_or(|last| !Arc::ptr_eq(last, scene)) {
            state.scene = Some(scene.clone());
            self.desk.told.notify_one();
        }
    }

    /// Throws the kept scene away: it was saved.
    pub(crate) fn forget(&self) {
        let mut state = self.desk.lock();
        if state.scene.take().is_some() || state.kept.take().is_some() || state.is_busy {
            drop(state);
            self.wait();
            self.desk.lock().kept = None;
            let _ = std::fs::remove_file(own_file(&self.folder));
        }
    }

    /// Tells whether the scene is written by now, after waiting for it.
    pub(crate) fn holds_a_scene(&self) -> bool {
        self.wait();
        own_file(&self.folder).exists()
    }

    /// Returns why nothing can be kept, once.
    pub(crate) fn failure(&self) -> Option<String> {
        self.desk.lock().failure.take()
    }

    /// Lists the scenes that sessions left unsaved which are gone now, the newest first.
    pub(crate) fn left_over(&self) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut files: Vec<_> = entries
            .map(|entry| entry.path())
            .filter(|path| {
                let number = path.file_stem().and_then(|stem| stem.to_str()?.strip_prefix("unsaved-"));
                path.extension().is_some_and(|e| e == "ron") && number.is_some_and(|n| !is_running(n))
            })
            .collect();
        let age = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).ok();
        files.sort_by_key(|path| std::cmp::Reverse(age(path)));
        files
    }

    /// Waits until everything is written.
    pub(crate) fn wait(&self) {
        let is_busy = || {
            let state = self.desk.lock();
            state.is_busy || state.scene.is_some() || state.memory.is_some()
        };
        let begin = Instant::now();
        while is_busy() && begin.elapsed() < Duration::from_secs(20) {
            self.desk.lock().is_hurried = true;
            self.desk.told.notify_one();
            std::thread::sleep(Duration::from_millis(2));
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.wait();
        self.desk.lock().is_closed = true;
        self.desk.told.notify_one();
    }
}

fn own_file(folder: &Path) -> PathBuf {
    folder.join(format!("unsaved-{}.ron", std::process::id()))
}

/// Tells whether a process of that number runs: another viewer, which keeps its own scene.
fn is_running(number: &str) -> bool {
    number.parse() == Ok(std::process::id()) || Path::new("/proc").join(number).exists()
}

fn write_what_comes(desk: &Desk, folder: &Path) {
    loop {
        let mut state = desk.lock();
        (state.is_busy, state.is_hurried) = (false, false);
        while state.scene.is_none() && state.memory.is_none() {
            if state.is_closed {
                return;
            }
            state = desk.told.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        let (scene, memory) = (state.scene.take(), state.memory.take());
        state.is_busy = true;
        state.kept = scene.clone().or(state.kept.take());
        drop(state);
        let begin = Instant::now();
        let result = write(folder, scene.as_deref(), memory.as_ref());
        if let Err(why) = result {
            desk.lock().failure = Some(why);
        }
        if scene.is_some() {
            let mut state = desk.lock();
            state.is_busy = false;
            let calm = CALM.max(begin.elapsed() * 10);
            drop(desk.told.wait_timeout_while(state, calm, |state| !state.is_hurried && !state.is_closed));
        }
    }
}

fn write(folder: &Path, scene: Option<&Scene>, memory: Option<&Memory>) -> Result<(), String> {
    let refuse = |error: std::io::Error| format!("{}: nothing can be kept there: {error}", folder.display());
    std::fs::create_dir_all(folder).map_err(refuse)?;
    if let Some(memory) = memory {
        let text = ron::ser::to_string_pretty(memory, ron::ser::PrettyConfig::new());
        let text = text.map_err(|error| error.to_string())?;
        write_whole(&folder.join("viewer.ron"), text.as_bytes()).map_err(refuse)?;
    }
    scene.map_or(Ok(()), |scene| save(scene, &own_file(folder)).map_err(|error| error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_remembered_reads_back_and_nonsense_is_nothing() {
        let folder = std::env::temp_dir().join(format!("polyptych-keeper-{}", std::process::id()));
        let keeper = Keeper::new(folder.clone());
        assert_eq!(keeper.memory(), Memory::default());
        let mut memory = Memory { zoom: 1.5, ..Memory::default() };
        memory.opened("a.obj");
        memory.opened("b.obj");
        memory.opened("a.obj");
        assert_eq!(memory.recent, ["a.obj", "b.obj"]);
        keeper.remember(memory.clone());
        keeper.wait();
        assert_eq!(keeper.memory(), memory);
        std::fs::write(folder.join("viewer.ron"), "(recent: 7").unwrap();
        assert_eq!(keeper.memory(), Memory::default());
        // A scene of a process that is gone is left over, one of a running process is not.
        std::fs::write(folder.join("unsaved-4194999.ron"), "()").unwrap();
        std::fs::write(folder.join(format!("unsaved-{}.ron", std::process::id())), "()").unwrap();
        assert_eq!(keeper.left_over(), [folder.join("unsaved-4194999.ron")]);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
