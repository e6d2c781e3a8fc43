//! Does it stop when it is told to, go on after that, and keep no memory?

use super::{Random, Subject, hold, scene};
use crate::convert::Converter;
use crate::framebuffer::Framebuffer;
use crate::seam::{Control, RenderError};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

pub(super) fn cancelling(subject: &Subject) -> Result<(), String> {
    let scene = scene("polyhedra")?;
    let need = subject.need(&scene, 64, 64)?;
    let mut renderer = subject.registry.create(&subject.backend).map_err(|e| e.to_string())?;
    let (converter, simple) = (Converter::default(), Control::simple());
    let mut target = Framebuffer::new(64, 64, need.channels);
    let early = renderer.render(&need.frame(), &mut target, &simple).err();
    hold(early == Some(RenderError::NotPrepared), || format!("`render` before `prepare`: {early:?}"))?;
    renderer.prepare(&scene, &need, &converter, &simple).map_err(|e| e.to_string())?;
    let flag = AtomicBool::new(true);
    let cancelled = renderer.render(&need.frame(), &mut target, &Control::simple().cancelled_by(&flag)).err();
    hold(cancelled == Some(RenderError::Cancelled), || format!("cancelled before it began: {cancelled:?}"))?;
    renderer.render(&need.frame(), &mut target, &simple).map_err(|e| e.to_string())?;
    let fresh = subject.draw(1, &scene, &need)?.framebuffer;
    hold(target.same_bits(&fresh), || "the picture after a cancelled one differs".to_owned())
}

/// How soon it must stop.
const SOON: Duration = Duration::from_millis(5);

/// Stops frames at random times. Each time, threads that do nothing but look at the flag are stopped too: how late
/// they are is what the machine itself takes, and is allowed for.
pub(super) fn stops_soon(subject: &Subject) -> Result<(), String> {
    let scene = scene("atelier")?;
    let need = subject.need(&scene, 640, 360)?;
    let mut renderer = subject.registry.create(&subject.backend).map_err(|e| e.to_string())?;
    renderer.prepare(&scene, &need, &Converter::default(), &Control::simple()).map_err(|e| e.to_string())?;
    let mut target = Framebuffer::new(640, 360, need.channels);
    let mut random = Random(subject.seed);
    let (mut late, mut noise) = (Vec::new(), Vec::new());
    let begin = Instant::now();
    while late.len() < 200 && begin.elapsed() < Duration::from_secs(20) {
        let wait = Duration::from_micros(200 + random.below(8000) as u64);
        let (result, lateness) = stopped_after(wait, |flag| {
            renderer.render(&need.frame(), &mut target, &Control::simple().cancelled_by(flag))
        })?;
        match result {
            Err(RenderError::Cancelled) => late.push(lateness),
            // It was done before, or while the flag was set.
            Ok(_) => late.push(Duration::ZERO),
            Err(error) => return Err(format!("stopped after {wait:?}: {error}")),
        }
        noise.push(stopped_after(wait, spin)?.1);
    }
    let (late, noise) = (percentile_99(&mut late), percentile_99(&mut noise));
    hold(late <= SOON + noise, || {
        format!("the 99th percentile is {late:.1?} (the machine itself is late by {noise:.1?})")
    })
}

/// Does some work, raises a flag after a time, and returns how long after that the work ended.
fn stopped_after<T>(wait: Duration, work: impl FnOnce(&AtomicBool) -> T) -> Result<(T, Duration), String> {
    let flag = Arc::new(AtomicBool::new(false));
    let setter = flag.clone();
    let stopper = std::thread::spawn(move || {
        std::thread::sleep(wait);
        setter.store(true, Ordering::Relaxed);
        Instant::now()
    });
    let result = work(&flag);
    let ended = Instant::now();
    let set = stopper.join().map_err(|_| "the stopping thread panicked".to_owned())?;
    Ok((result, ended.saturating_duration_since(set)))
}

/// Keeps every processor busy until the flag is raised.
fn spin(flag: &AtomicBool) {
    let wait = || {
        while !flag.load(Ordering::Relaxed) {
            std::hint::spin_loop();
        }
    };
    let others = std::thread::available_parallelism().map_or(1, usize::from) - 1;
    std::thread::scope(|scope| {
        (0..others).for_each(|_| drop(scope.spawn(wait)));
        wait();
    });
}

/// Returns the smallest time that at most one in a hundred is above.
fn percentile_99(times: &mut [Duration]) -> Duration {
    times.sort_unstable();
    let rank = (times.len() * 99).div_ceil(100);
    times.get(rank.saturating_sub(1)).copied().unwrap_or_default()
}

/// Bytes by which memory may grow in 900 frames: what allocators keep.
const SLACK: u64 = 4 << 20;

pub(super) fn keeps_no_memory(subject: &Subject) -> Result<(), String> {
    let Some(_) = resident() else { return Ok(()) };
    let scene = scene("polyhedra")?;
    let need = subject.need(&scene, 16, 9)?;
    let mut renderer = subject.registry.create(&subject.backend).map_err(|e| e.to_string())?;
    let simple = Control::simple();
    renderer.prepare(&scene, &need, &Converter::default(), &simple).map_err(|e| e.to_string())?;
    let mut target = Framebuffer::new(16, 9, need.channels);
    let mut before = 0;
    for frame in 0..1000 {
        if frame == 100 {
            before = resident().unwrap_or(0);
        }
        renderer.render(&need.frame(), &mut target, &simple).map_err(|e| e.to_string())?;
    }
    let grown = resident().unwrap_or(0).saturating_sub(before);
    hold(grown <= SLACK, || format!("900 frames of 16x9 pixels took {grown} more bytes"))
}

/// Returns the bytes of memory that this process and its children use; nothing where the system does not say.
fn resident() -> Option<u64> {
    let pages = |path: &std::path::Path| -> Option<u64> {
        std::fs::read_to_string(path).ok()?.split_whitespace().nth(1)?.parse().ok()
    };
    let own = std::process::id().to_string();
    let mut sum = pages(std::path::Path::new("/proc/self/statm"))?;
    for entry in std::fs::read_dir("/proc").ok()?.filter_map(Result::ok) {
        let stat = std::fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
        // The parent stands after the name in brackets and a letter.
        let parent = stat.rsplit_once(')').and_then(|(_, rest)| rest.split_whitespace().nth(1));
        if parent == Some(&own) {
            sum += pages(&entry.path().join("statm")).unwrap_or(0);
        }
    }
    Some(sum * 4096)
}
