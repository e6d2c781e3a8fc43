//! What does the child do? It opens the library, and calls it as it is told until nobody tells it any more.

#![expect(unsafe_code, reason = "memory that is shared with another process")]

use super::heap::{PAGE, SPAN, map};
use super::message::{
    DONE, FAILED, FINISHED, HELLO, LONGEST, PLAN, PREPARE, REFUSED, RENDER, Reader, Writer, get_camera,
    log_message, put_told,
};
use super::picture::Layout;
use super::process::WORD;
use crate::call::{LogLine, Told};
use crate::callee::{Callee, Local};
use crate::flat_scene;
use crate::library::open;
use crate::manifest::Manifest;
use crate::table::Loaded;
use glam::Vec3;
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::{Band, Channels, Framebuffer};
use polyptych_core::parallel::Pool;
use polyptych_core::seam::{Control, RenderError, Watcher};
use polyptych_plugin_abi::{PolyptychNeed, PolyptychScene};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::mm::{MapFlags, MprotectFlags, ProtFlags, mmap, mmap_anonymous, mprotect};
use std::collections::HashMap;
use std::ffi::c_void;
use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsFd, FromRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Serves a plugin, if this program was started for that, and then ends the process.
pub(crate) fn serve() {
    let mut arguments = std::env::args_os().skip(1);
    if arguments.next().is_none_or(|word| word != WORD) {
        return;
    }
    let library = arguments.next().map(PathBuf::from);
    let mut number = || arguments.next()?.to_str()?.parse::<usize>().ok();
    let (memory, base) = (number(), number());
    let (Some(library), Some(memory), Some(base)) = (library, memory, base) else {
        eprintln!("error: {WORD} is for Polyptych itself");
        std::process::exit(2);
    };
    let code = run(&library, memory, base).map_or(1, |()| 0);
    std::process::exit(code);
}

type Line = Arc<Mutex<UnixStream>>;

fn send(line: &Line, message: &[u8]) {
    // A host that is gone is noticed by the watching thread.
    let _ = line.lock().unwrap_or_else(PoisonError::into_inner).write_all(message);
}

fn run(library: &std::path::Path, memory: usize, base: usize) -> Option<()> {
    // A crash is told by the host; a file of the dead process's memory would only take time.
    let none = rustix::process::Rlimit { current: Some(0), maximum: Some(0) };
    let _ = rustix::process::setrlimit(rustix::process::Resource::Core, none);
    // SAFETY: the host left this descriptor open for us, and nobody else here has it.
    let memory = unsafe { OwnedFd::from_raw_fd(i32::try_from(memory).ok()?) };
    map(memory.as_fd(), base, ProtFlags::READ).ok()?;
    let socket = UnixStream::from(std::io::stdin().as_fd().try_clone_to_owned().ok()?);
    // What a plugin reads or writes on the standard streams shall not be our messages.
    rustix::stdio::dup2_stdin(File::open("/dev/null").ok()?).ok()?;
    let mut incoming = socket.try_clone().ok()?;
    watch(socket.try_clone().ok()?);
    let line: Line = Arc::new(Mutex::new(socket));
    let loaded = match open(library) {
        Ok(loaded) => loaded,
        Err(refusal) => {
            let mut message = Writer::new(REFUSED);
            message.text(&refusal.to_string());
            send(&line, &message.finish());
            return None;
        }
    };
    let mut hello = Writer::new(HELLO);
    hello.u32(u32::from(loaded.table.plan.is_some())).text(&Manifest::of(loaded).to_text());
    send(&line, &hello.finish());
    let mut server = Server::new(loaded, line, memory, base);
    let mut message = Vec::new();
    loop {
        let mut head = [0u8; 4];
        incoming.read_exact(&mut head).ok()?;
        let length = u32::from_le_bytes(head) as usize;
        if length == 0 || length > LONGEST {
            return None;
        }
        message.resize(length, 0);
        incoming.read_exact(&mut message).ok()?;
        server.answer(&message)?;
    }
}

/// Ends this process when the host is gone, whatever the plugin does meanwhile.
fn watch(socket: UnixStream) {
    std::thread::spawn(move || {
        loop {
            let mut polled = [PollFd::new(&socket, PollFlags::RDHUP)];
            let _ = poll(&mut polled, None);
            if polled[0].revents().intersects(PollFlags::RDHUP | PollFlags::HUP | PollFlags::ERR) {
                std::process::abort();
            }
        }
    });
}

struct Server {
    callee: Local,
    line: Line,
    memory: OwnedFd,
    base: usize,
    /// Windows on planes, by first page and bytes.
    windows: HashMap<(u64, usize), usize>,
    pool: Option<(u32, Pool)>,
    told: Told,
    owner: Arc<()>,
}

/// Tells the host about finished rows, not more often than people could see: each message wakes the host. What a crash
/// keeps from being told is drawn again.
struct Announcer<'a> {
    line: &'a Line,
    untold: Mutex<Untold>,
}

/// Rows that the host was not told about.
#[derive(Default)]
struct Untold {
    bands: Vec<(u32, u32)>,
    told: Option<Instant>,
}

/// Time between two messages about rows.
const PAUSE: Duration = Duration::from_millis(5);

impl Announcer<'_> {
    fn tell(&self, untold: &mut Untold) {
        for (first_row, rows) in untold.bands.drain(..) {
            let mut message = Writer::new(FINISHED);
            message.u32(first_row).u32(rows);
            send(self.line, &message.finish());
        }
        untold.told = Some(Instant::now());
    }

    fn tell_the_rest(&self) {
        self.tell(&mut self.untold.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Watcher for Announcer<'_> {
    fn finished(&self, band: &Band<'_>) {
        let mut untold = self.untold.lock().unwrap_or_else(PoisonError::into_inner);
        match untold.bands.last_mut() {
            Some((first, rows)) if *first + *rows == band.first_row => *rows += band.rows,
            _ => untold.bands.push((band.first_row, band.rows)),
        }
        if untold.told.is_none_or(|told| told.elapsed() >= PAUSE) {
            self.tell(&mut untold);
        }
    }
}

impl Server {
    fn new(loaded: &'static Loaded, line: Line, memory: OwnedFd, base: usize) -> Self {
        let to_host = line.clone();
        let log = Arc::new(move |said: LogLine| send(&to_host, &log_message(&said)));
        let callee = Local::new(loaded, log);
        let (windows, told, owner) = (HashMap::new(), Told::default(), Arc::new(()));
        Self { callee, line, memory, base, windows, pool: None, told, owner }
    }

    /// Does what a message says. Nothing for one that cannot be read: then host and child are of different versions.
    fn answer(&mut self, message: &[u8]) -> Option<()> {
        let mut from = Reader(message);
        let (kind, threads) = (from.u8()?, from.u32()?);
        let pool = match &self.pool {
            Some((count, pool)) if *count == threads => pool.clone(),
            _ => {
                let pool = Pool::new(threads as usize).ok()?;
                self.pool = Some((threads, pool.clone()));
                pool
            }
        };
        let result = match kind {
            PLAN | PREPARE => {
                let (scene, need) = (from.u64()?, from.u64()?);
                let camera = get_camera(&mut from)?;
                self.with_scene(kind, scene, need, &camera, &pool)
            }
            RENDER => {
                let (width, height, channels) = (from.u32()?, from.u32()?, from.u32()? as u8);
                let mut pages = [0u64; 7];
                for page in &mut pages {
                    *page = from.u64()?;
                }
                let layout = Layout { width, height, channels, pages };
                let camera = get_camera(&mut from)?;
                self.render(&layout, &camera, &pool)
            }
            _ => return None,
        };
        let message = match result {
            Ok(status) => {
                let mut message = Writer::new(DONE);
                message.u32(status as u32);
                put_told(&mut message, &self.told);
                message
            }
            Err(error) => {
                let mut message = Writer::new(FAILED);
                message.text(&error.to_string());
                message
            }
        };
        send(&self.line, &message.finish());
        Some(())
    }

    fn stop(&self) -> &'static AtomicBool {
        // SAFETY: the first byte of the shared memory, which is mapped as long as the process lives, and is 0 or 1.
        unsafe { AtomicBool::from_ptr(self.base as *mut bool) }
    }

    fn with_scene(
        &mut self,
        kind: u8,
        scene: u64,
        need: u64,
        camera: &Camera,
        pool: &Pool,
    ) -> Result<i32, RenderError> {
        let (low, high) = (self.base as u64, (self.base + SPAN) as u64);
        if !(low..high).contains(&scene) || !(low..high).contains(&need) {
            return Err(RenderError::Failed("the scene lies outside of the shared memory".to_owned()));
        }
        let flat_camera = flat_scene::camera(camera);
        // SAFETY: the host put a need there.
        let mut flat_need = unsafe { (need as *const PolyptychNeed).read() };
        flat_need.camera = &raw const flat_camera;
        let control = Control::new(pool).cancelled_by(self.stop());
        let table = self.callee.table();
        let function = if kind == PLAN { table.plan } else { table.prepare };
        let scene = scene as usize;
        let need = &raw const flat_need as usize;
        let (callee, told) = (&mut self.callee, &mut self.told);
        // SAFETY: the host put a scene there, whole, at the address that it has here, too, and leaves it until we answer.
        pool.install(|| unsafe {
            let (scene, need) = (scene as *const PolyptychScene, need as *const PolyptychNeed);
            callee.call_flat(function, scene, need, camera, &control, told)
        })
    }

    fn render(&mut self, layout: &Layout, camera: &Camera, pool: &Pool) -> Result<i32, RenderError> {
        let mut picture = self
            .picture(layout)
            .ok_or_else(|| RenderError::Failed("the picture's memory cannot be mapped".to_owned()))?;
        let announcer = Announcer { line: &self.line, untold: Mutex::default() };
        let control = Control::new(pool).cancelled_by(self.stop()).watched_by(&announcer);
        let (callee, told) = (&mut self.callee, &mut self.told);
        let status = pool.install(|| callee.render(camera, &mut picture, &control, told));
        announcer.tell_the_rest();
        status
    }

    /// Makes a framebuffer over windows on the planes.
    fn picture(&mut self, layout: &Layout) -> Option<Framebuffer> {
        let mut at = [0usize; 7];
        for (plane, address) in at.iter_mut().enumerate() {
            let bytes = layout.bytes(plane);
            if bytes > 0 {
                *address = self.window(layout.pages[plane], bytes)? + layout.lead(plane);
            }
        }
        let n = layout.pixels();
        // SAFETY: the windows are as large as the planes and stay mapped; one framebuffer is used at a time.
        let planes = unsafe {
            Band {
                width: layout.width,
                first_row: 0,
                rows: layout.height,
                color: plane::<Vec3>(at[0], n),
                distance: plane::<f32>(at[1], n),
                normal: plane::<Vec3>(at[2], n),
                id: plane::<u32>(at[3], n),
                albedo: plane::<Vec3>(at[4], n),
                shadow: plane::<f32>(at[5], n),
                coverage: plane::<f32>(at[6], n),
            }
        };
        Framebuffer::lent(Channels::from_bits(layout.channels), planes, self.owner.clone()).ok()
    }

    /// Maps pages of the shared memory for writing, between pages that may not be touched.
    fn window(&mut self, page: u64, bytes: usize) -> Option<usize> {
        if let Some(&known) = self.windows.get(&(page, bytes)) {
            return Some(known);
        }
        let length = bytes.next_multiple_of(PAGE);
        let (read_write, shared) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED | MapFlags::FIXED);
        // SAFETY: new address space is taken, and the shared pages are mapped into the middle of it.
        let window = unsafe {
            let around =
                mmap_anonymous(std::ptr::null_mut(), length + 2 * PAGE, read_write, MapFlags::PRIVATE)
                    .ok()?;
            let window = around.byte_add(PAGE);
            mprotect(around, PAGE, MprotectFlags::empty()).ok()?;
            mprotect(window.byte_add(length), PAGE, MprotectFlags::empty()).ok()?;
            mmap(window.cast::<c_void>(), length, read_write, shared, &self.memory, page).ok()?;
            window as usize
        };
        self.windows.insert((page, bytes), window);
        Some(window)
    }
}

unsafe fn plane<T>(address: usize, n: usize) -> &'static mut [T] {
    match address {
        0 => &mut [],
        // SAFETY: the caller's promise.
        address => unsafe { std::slice::from_raw_parts_mut(address as *mut T, n) },
    }
}
