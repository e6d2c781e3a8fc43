//! How does the host call a plugin in a child, watch it, end it, and start another?

use super::heap::{Heap, Published, Shared};
use super::message::{
    DONE, FAILED, FINISHED, LOG, PLAN, PREPARE, RENDER, Reader, Writer, get_log, get_told, put_camera,
};
use super::picture::{Buffer, Layout};
use super::process::{Gone, Message, Process};
use crate::call::Told;
use crate::callee::{Callee, Subject};
use crate::flat::{Names, Place};
use crate::flat_scene;
use crate::limits::Limits;
use crate::manifest::Manifest;
use crate::refusal::Refusal;
use crate::renderer::Log;
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::seam::{BackendInfo, Control, RenderError};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// How often the host looks whether it wants to stop, and where nobody can stop it: each look takes time from the child.
const LOOK: Duration = Duration::from_millis(1);
const LOOK_SELDOM: Duration = Duration::from_millis(20);
/// Most pictures whose memory is kept.
const MOST_BUFFERS: usize = 4;

/// An instance in a process of its own.
pub(crate) struct Peer {
    program: PathBuf,
    library: PathBuf,
    info: BackendInfo,
    limits: Limits,
    log: Log,
    process: Option<Process>,
    published: Published,
    names: Names,
    buffers: Vec<Arc<Buffer>>,
    heap: Arc<Heap>,
}

/// Rows of the picture that is drawn.
struct Rows<'a> {
    target: &'a mut Framebuffer,
    finished: Vec<bool>,
}

impl Peer {
    /// Starts a child. Returns what the library says of itself, and whether it plans.
    pub(crate) fn start(
        program: &Path,
        library: &Path,
        limits: Limits,
        log: Log,
    ) -> Result<(Self, Manifest, bool), Refusal> {
        let heap = Heap::new().map_err(|what| Refusal::NoChild { path: library.into(), what })?;
        let (process, manifest, plans) = Process::start(program, library, &heap)?;
        let peer = Self {
            program: program.into(),
            library: library.into(),
            info: manifest.info(),
            limits,
            log,
            process: Some(process),
            published: Published::default(),
            names: Names::default(),
            buffers: Vec::new(),
            heap: Arc::new(heap),
        };
        Ok((peer, manifest, plans))
    }

    fn process(&mut self) -> Result<&mut Process, RenderError> {
        if self.process.as_mut().is_some_and(|process| !process.is_alive()) {
            self.process = None;
            return Err(RenderError::Failed("its process ended between two calls".to_owned()));
        }
        if self.process.is_none() {
            let started = Process::start(&self.program, &self.library, &self.heap);
            self.process = Some(started.map_err(|e| RenderError::Failed(e.to_string()))?.0);
        }
        self.process.as_mut().ok_or(RenderError::NotPrepared)
    }

    fn call_with_scene(
        &mut self,
        kind: u8,
        subject: &Subject<'_>,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        self.process()?;
        self.published.begin();
        let mut place = Shared { heap: &self.heap, published: &mut self.published };
        let scene = flat_scene::scene(&mut place, &mut self.names, subject.scene, subject.hidden);
        // The child puts the camera there: its own, since this one comes as a message.
        let need = flat_scene::need(&mut place, subject.need, std::ptr::null(), &self.info.parameters);
        let need = place.one(need);
        if self.published.full {
            self.published.end(&self.heap, true);
            return Err(RenderError::Failed("the scene is larger than the memory it may share".to_owned()));
        }
        let mut message = Writer::new(kind);
        message.u32(control.threads.count() as u32).u64(scene as u64).u64(need as u64);
        put_camera(&mut message, &subject.need.camera);
        let function = if kind == PLAN { "plan" } else { "prepare" };
        let result = self.call(function, &message.finish(), control, told, None);
        self.published.end(&self.heap, kind == PREPARE);
        result
    }

    /// Sends a call and waits for its end.
    fn call(
        &mut self,
        function: &str,
        message: &[u8],
        control: &Control<'_>,
        told: &mut Told,
        mut rows: Option<&mut Rows<'_>>,
    ) -> Result<i32, RenderError> {
        let stops = control.is_cancelled();
        self.heap.stop().store(stops, Ordering::Release);
        let Some(process) = self.process.as_mut() else { return Err(RenderError::NotPrepared) };
        let look = if control.cancel_flag().is_some() { LOOK } else { LOOK_SELDOM };
        let mut sign = Instant::now();
        let mut stopped = stops.then(Instant::now);
        let mut received: Result<Option<Message>, Gone> = process.send(message).map(|()| None);
        let ended = loop {
            match received {
                Ok(None) => {}
                Ok(Some((DONE, message))) => {
                    let mut from = Reader(&message);
                    match from.u32().zip(get_told(&mut from, told)) {
                        Some((status, ())) => return Ok(status as i32),
                        None => break "it answered with something that cannot be read".to_owned(),
                    }
                }
                Ok(Some((FAILED, message))) => {
                    return Err(RenderError::Failed(Reader(&message).text().unwrap_or_default()));
                }
                Ok(Some((FINISHED, message))) => {
                    sign = Instant::now();
                    let mut from = Reader(&message);
                    if let (Some(rows), Some(first), Some(count)) = (rows.as_mut(), from.u32(), from.u32()) {
                        rows.finish(first, count, control);
                    }
                }
                Ok(Some((LOG, message))) => {
                    sign = Instant::now();
                    if let Some(line) = get_log(&mut Reader(&message), &self.info.id) {
                        (self.log)(line);
                    }
                }
                Ok(Some(_)) => break "it answered with something that means nothing".to_owned(),
                Err(Gone) => break process.end(),
            }
            if control.is_cancelled() && stopped.is_none() {
                self.heap.stop().store(true, Ordering::Release);
                stopped = Some(Instant::now());
            }
            if stopped.is_some_and(|since| since.elapsed() > self.limits.stopping) {
                self.process = None;
                return Err(RenderError::Cancelled);
            }
            if sign.elapsed() > self.limits.silence {
                process.kill();
                break format!(
                    "it gave no sign for {:.1} s and was ended",
                    self.limits.silence.as_secs_f64()
                );
            }
            received = process.receive(look);
        };
        self.process = None;
        let place = rows.map_or(String::new(), |rows| rows.place());
        Err(RenderError::Failed(format!("`{function}` crashed: {ended}{place}")))
    }

    /// Sees to it that the picture lies in shared memory.
    fn share(&mut self, target: &mut Framebuffer) -> Option<Layout> {
        if let Some(buffer) = self.buffers.iter().find(|buffer| buffer.holds(target)) {
            return Some(buffer.layout);
        }
        let (width, height, channels) = (target.width(), target.height(), target.channels());
        let fits = |b: &&Arc<Buffer>| {
            let size = (b.layout.width, b.layout.height, b.layout.channels);
            Arc::strong_count(b) == 1 && size == (width, height, channels.bits())
        };
        let buffer = match self.buffers.iter().find(fits) {
            Some(buffer) => buffer.clone(),
            None => {
                let new = Arc::new(Buffer::new(&self.heap, width, height, channels)?);
                if self.buffers.len() >= MOST_BUFFERS {
                    self.buffers.retain(|buffer| Arc::strong_count(buffer) > 1);
                }
                self.buffers.push(new.clone());
                new
            }
        };
        if buffer.layout.pixels() > 0 {
            let mut shared = buffer.framebuffer()?;
            // What the plugin leaves alone stays as the caller had it, wherever the picture lies.
            let to = shared.band();
            to.color.copy_from_slice(target.color());
            to.distance.copy_from_slice(target.distance());
            to.normal.copy_from_slice(target.normal());
            to.id.copy_from_slice(target.id());
            to.albedo.copy_from_slice(target.albedo());
            to.shadow.copy_from_slice(target.shadow());
            to.coverage.copy_from_slice(target.coverage());
            *target = shared;
        }
        Some(buffer.layout)
    }
}

impl Callee for Peer {
    fn plan(&mut self, subject: &Subject<'_>, told: &mut Told) -> Result<i32, RenderError> {
        self.call_with_scene(PLAN, subject, &Control::simple(), told)
    }

    fn prepare(
        &mut self,
        subject: &Subject<'_>,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        self.call_with_scene(PREPARE, subject, control, told)
    }

    fn render(
        &mut self,
        camera: &Camera,
        target: &mut Framebuffer,
        control: &Control<'_>,
        told: &mut Told,
    ) -> Result<i32, RenderError> {
        self.process()?;
        let full = || RenderError::Failed("the picture is larger than the memory it may share".to_owned());
        let layout = self.share(target).ok_or_else(full)?;
        let mut message = Writer::new(RENDER);
        message.u32(control.threads.count() as u32);
        message.u32(layout.width).u32(layout.height).u32(u32::from(layout.channels));
        layout.pages.iter().for_each(|&page| {
            message.u64(page);
        });
        put_camera(&mut message, camera);
        let finished = vec![false; layout.height as usize];
        let mut rows = Rows { target, finished };
        let result = self.call("render", &message.finish(), control, told, Some(&mut rows));
        if result.is_err() {
            rows.clear_unfinished();
        }
        result
    }

    fn is_new(&self) -> bool {
        self.process.is_none()
    }

    fn discard(&mut self) {
        self.process = None;
    }
}

impl Rows<'_> {
    fn finish(&mut self, first: u32, count: u32, control: &Control<'_>) {
        let height = self.target.height();
        if first >= height || count == 0 {
            return;
        }
        let count = count.min(height - first);
        self.finished[first as usize..(first + count) as usize].fill(true);
        let (band, _) = self.target.band().split(first).1.split(count);
        control.finished(&band);
    }

    /// Says where the work ended.
    fn place(&self) -> String {
        let (done, all) = (self.finished.iter().filter(|f| **f).count(), self.finished.len());
        match self.finished.iter().position(|f| !f) {
            None => ", after its last row".to_owned(),
            Some(first) => format!(", in row {first} or after it ({done} of {all} rows were finished)"),
        }
    }

    /// Empties rows that were not finished: they hold parts of this picture or of an older one.
    fn clear_unfinished(&mut self) {
        let width = self.target.width() as usize;
        let band = self.target.band();
        for row in (0..self.finished.len()).filter(|&row| !self.finished[row]) {
            let part = row * width..(row + 1) * width;
            if let Some(v) = band.color.get_mut(part.clone()) {
                v.fill(glam::Vec3::ZERO);
            }
            if let Some(v) = band.distance.get_mut(part.clone()) {
                v.fill(f32::INFINITY);
            }
            if let Some(v) = band.normal.get_mut(part.clone()) {
                v.fill(glam::Vec3::ZERO);
            }
            if let Some(v) = band.id.get_mut(part.clone()) {
                v.fill(0);
            }
            if let Some(v) = band.albedo.get_mut(part.clone()) {
                v.fill(glam::Vec3::ZERO);
            }
            if let Some(v) = band.shadow.get_mut(part.clone()) {
                v.fill(1.0);
            }
            if let Some(v) = band.coverage.get_mut(part) {
                v.fill(0.0);
            }
        }
    }
}
