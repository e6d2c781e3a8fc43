//! How does a file become a table of functions? Opened once, never closed, and opened anew when it was replaced.

#![expect(unsafe_code, reason = "running code that is not ours")]

use crate::image;
use crate::refusal::Refusal;
use crate::table::{Loaded, check};
use libloading::Library;
use polyptych_plugin_abi::{self as abi, PolyptychEntry};
use std::collections::HashMap;
use std::fs::Metadata;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::SystemTime;

/// What tells one version of a file from the next.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Stamp {
    length: u64,
    modified: Option<SystemTime>,
    file: u64,
}

/// Opens a library in this process and checks that it is a plugin of a version that this program speaks.
///
/// A library stays open for ever: one that was touched by a thread's destructors cannot be closed anyway. Where the
/// file was replaced since, a copy under a new name is opened, since the system would return the old one.
///
/// This runs the library's code: call it for files that the user named or installed.
///
/// # Errors
/// Says in one line why the library is refused.
pub fn open(path: &Path) -> Result<&'static Loaded, Refusal> {
    static OPEN: Mutex<Option<HashMap<PathBuf, (Stamp, &'static Loaded)>>> = Mutex::new(None);
    let unreadable = |e: std::io::Error| Refusal::Unreadable { path: path.into(), what: e.to_string() };
    let real = path.canonicalize().map_err(unreadable)?;
    let stamp = stamp(&real.metadata().map_err(unreadable)?);
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    let open = open.get_or_insert_default();
    let before = open.get(&real);
    if let Some((known, loaded)) = before
        && *known == stamp
    {
        return Ok(loaded);
    }
    image::check(&real)?;
    let loaded = if before.is_some() {
        let copy = std::env::temp_dir().join(format!("polyptych-{}-{}", std::process::id(), open.len()));
        let copy = copy.with_extension(format!("{}.so", unique()));
        std::fs::copy(&real, &copy).map_err(unreadable)?;
        let loaded = load(&copy, path);
        // What is open stays so without a name; where the system forbids it, a file stays behind.
        let _ = std::fs::remove_file(&copy);
        loaded?
    } else {
        load(&real, path)?
    };
    let loaded: &'static Loaded = Box::leak(Box::new(loaded));
    open.insert(real, (stamp, loaded));
    Ok(loaded)
}

fn unique() -> u64 {
    static NEXT: std::sync::atomic::AtomicU64 = std::sync::atomic::AtomicU64::new(0);
    NEXT.fetch_add(1, std::sync::atomic::Ordering::Relaxed)
}

/// Opens a file and asks it for its table; `named` is what refusals call it.
fn load(file: &Path, named: &Path) -> Result<Loaded, Refusal> {
    // SAFETY: the user named or installed the library; running its initializers is what opening means.
    let library = unsafe { Library::new(file) }
        .map_err(|e| Refusal::Unopened { path: named.into(), what: one_line(&chain(&e)) })?;
    let library: &'static Library = Box::leak(Box::new(library));
    // SAFETY: the header gives the function of this name this type.
    let entry = unsafe { library.get::<PolyptychEntry>(abi::ENTRY.as_bytes()) };
    let entry = entry.ok().and_then(|e| *e).ok_or_else(|| Refusal::NoEntry { path: named.into() })?;
    // SAFETY: the function takes these two numbers; the table is as the header says.
    unsafe { check(named, entry(abi::POLYPTYCH_MAJOR, abi::POLYPTYCH_MINOR)) }
}

fn chain(error: &dyn std::error::Error) -> String {
    error.source().map_or_else(|| error.to_string(), chain)
}

fn one_line(text: &str) -> String {
    text.replace(char::is_control, " ")
}

fn stamp(metadata: &Metadata) -> Stamp {
    #[cfg(unix)]
    let file = std::os::unix::fs::MetadataExt::ino(metadata);
    #[cfg(not(unix))]
    let file = 0;
    Stamp { length: metadata.len(), modified: metadata.modified().ok(), file }
}
