//! Does every hostile file end in a scene or in one clear line, fast and without eating the memory?

use polyptych_core::load::{LoadOptions, load};
use std::alloc::{GlobalAlloc, Layout, System};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

mod models_folder;

/// Counts the bytes that are alive, and the most that were.
struct Counting;

static LIVE: AtomicUsize = AtomicUsize::new(0);
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn grow(bytes: usize) {
    let live = LIVE.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(live, Ordering::Relaxed);
}

#[expect(unsafe_code, reason = "a global allocator is unsafe by nature; this one counts and passes on")]
// SAFETY: every call goes to the system allocator with the arguments as they came; counting touches no memory of it.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        grow(layout.size());
        // SAFETY: the caller keeps the contract of `alloc_zeroed`.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from the system allocator with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // While it moves, both blocks are alive.
        grow(size);
        LIVE.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: the pointer came from the system allocator with this layout, the size is the caller's.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The most that memory may grow, and the time that a file may take (a debug build on a busy machine is allowed more).
const MOST_BYTES: usize = 512 << 20;
const LONGEST: Duration = Duration::from_secs(if cfg!(debug_assertions) { 6 } else { 2 });

/// Files that are judged otherwise here than in EXPECT.tsv, each with its reason.
const JUDGED_OTHERWISE: &[(&str, &str)] = &[];

#[test]
fn hostile_files_end_in_a_scene_or_in_one_clear_line() {
    let Some(models) = models_folder::find() else { return };
    let table = std::fs::read_to_string(models.join("hostile/EXPECT.tsv")).unwrap();
    let mut complaints = Vec::new();
    let mut walked = 0;
    for line in table.lines().skip(1) {
        let mut columns = line.split('\t');
        let (Some(file), Some(expect)) = (columns.next(), columns.next()) else { continue };
        walked += 1;
        if let Err(complaint) = judge(models.join("hostile").join(file), file, expect) {
            complaints.push(complaint);
        }
    }
    assert!(walked > 500, "only {walked} files were walked");
    assert!(complaints.is_empty(), "{} of {walked}:\n{}", complaints.len(), complaints.join("\n"));
}

/// Loads one file and says what is wrong with the outcome.
fn judge(path: PathBuf, file: &str, expect: &str) -> Result<(), String> {
    let before = LIVE.load(Ordering::Relaxed);
    PEAK.store(before, Ordering::Relaxed);
    let start = Instant::now();
    let options = LoadOptions { height_map: file.starts_with("image/"), ..LoadOptions::default() };
    let outcome = std::thread::spawn(move || load(&path, &options)).join();
    let (time, grown) = (start.elapsed(), PEAK.load(Ordering::Relaxed) - before);
    let outcome = outcome.map_err(|_| format!("{file}: panicked"))?;
    if time > LONGEST {
        return Err(format!("{file}: took {time:?}"));
    }
    if grown > MOST_BYTES {
        return Err(format!("{file}: memory grew by {} MB", grown >> 20));
    }
    if std::env::var_os("POLYPTYCH_SHOW").is_some() {
        let text = match &outcome {
            Ok(scene) => format!("{} objects {:?}", scene.objects.len(), scene.notes),
            Err(error) => error.to_string(),
        };
        eprintln!("{file} [{expect}] {} ms {} MB: {text}", time.as_millis(), grown >> 20);
    }
    let excused = JUDGED_OTHERWISE.iter().any(|(known, _)| *known == file);
    match (outcome, expect) {
        (Ok(_), "reject") if !excused => Err(format!("{file}: was loaded, should be refused")),
        (Err(error), "load") if !excused => Err(format!("{file}: should load: {error}")),
        (Err(error), _) => {
            let text = error.to_string();
            let name = file.rsplit('/').next().unwrap_or(file);
            let clear = !text.chars().any(char::is_control) && text.contains(name) && text.len() < 1000;
            if clear { Ok(()) } else { Err(format!("{file}: not a clear line: {text:?}")) }
        }
        (Ok(scene), _) => {
            let broken = scene.objects.iter().any(|o| match &*o.shape {
                polyptych_core::scene::Shape::Mesh(mesh) => mesh.check().is_err(),
                _ => false,
            });
            let camera = &scene.cameras[0].1;
            if broken
                || !camera.eye.is_finite()
                || scene.notes.iter().any(|n| n.chars().any(char::is_control))
            {
                return Err(format!("{file}: the scene is broken"));
            }
            Ok(())
        }
    }
}
