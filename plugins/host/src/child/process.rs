//! How is a child started, listened to, and ended; and of what did it die?

#![expect(unsafe_code, reason = "a file descriptor is kept open in the child")]

use super::heap::Heap;
use super::message::{HELLO, LONGEST, REFUSED, Reader};
use crate::manifest::Manifest;
use crate::refusal::Refusal;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{MemfdFlags, memfd_create};
use rustix::io::{FdFlags, fcntl_setfd};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::os::fd::{AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// First argument of a program that is to serve a plugin.
pub(super) const WORD: &str = "__polyptych-plugin";
/// How long a child may take to open its library.
const OPENING: Duration = Duration::from_secs(20);

/// A running child.
pub(super) struct Process {
    child: Child,
    socket: UnixStream,
    inbox: Vec<u8>,
    /// What it wrote on its standard output and error.
    output: File,
}

/// A message's kind and the rest of it.
pub(super) type Message = (u8, Vec<u8>);

/// The child is gone, or says what no child says.
pub(super) struct Gone;

impl Process {
    /// Starts a child and waits until it has opened the library. Returns it with what the library says of itself,
    /// and whether it plans.
    pub(super) fn start(
        program: &Path,
        library: &Path,
        heap: &Heap,
    ) -> Result<(Self, Manifest, bool), Refusal> {
        let failed = |what: String| Refusal::NoChild { path: library.into(), what };
        let mut process = Self::spawn(program, library, heap).map_err(|e| failed(e.to_string()))?;
        let begin = Instant::now();
        while begin.elapsed() < OPENING {
            match process.receive(Duration::from_millis(50)) {
                Ok(None) => {}
                Ok(Some((HELLO, message))) => {
                    let mut from = Reader(&message);
                    let (plans, text) = (from.u32(), from.text());
                    let manifest = text.and_then(|text| toml::from_str(&text).ok());
                    return match (manifest, plans) {
                        (Some(manifest), Some(plans)) => Ok((process, manifest, plans != 0)),
                        _ => Err(failed("it was greeted with something that cannot be read".to_owned())),
                    };
                }
                Ok(Some((REFUSED, message))) => {
                    let what = Reader(&message).text().unwrap_or_default();
                    return Err(Refusal::InChild { path: library.into(), what });
                }
                Ok(Some(_)) | Err(Gone) => {
                    let what = format!("while it was opened: {}", process.end());
                    return Err(failed(what));
                }
            }
        }
        Err(failed(format!("it was not opened within {} s", OPENING.as_secs())))
    }

    fn spawn(program: &Path, library: &Path, heap: &Heap) -> std::io::Result<Self> {
        let (ours, theirs) = UnixStream::pair()?;
        ours.set_write_timeout(Some(Duration::from_secs(5)))?;
        let output = File::from(memfd_create("polyptych-output", MemfdFlags::CLOEXEC)?);
        let memory = heap.file().as_raw_fd();
        let mut command = Command::new(program);
        command
            .arg(WORD)
            .arg(library)
            .arg(memory.to_string())
            .arg(heap.base().to_string())
            .stdin(Stdio::from(OwnedFd::from(theirs)))
            .stdout(Stdio::from(output.try_clone()?))
            .stderr(Stdio::from(output.try_clone()?));
        // SAFETY: between fork and exec a single system call is made, on a descriptor that is open: the heap lives.
        unsafe {
            command.pre_exec(move || {
                fcntl_setfd(BorrowedFd::borrow_raw(memory), FdFlags::empty()).map_err(Into::into)
            });
        }
        Ok(Self { child: command.spawn()?, socket: ours, inbox: Vec::new(), output })
    }

    pub(super) fn send(&mut self, message: &[u8]) -> Result<(), Gone> {
        self.socket.write_all(message).map_err(|_| Gone)
    }

    /// Returns the next message; nothing when none comes within a time.
    pub(super) fn receive(&mut self, within: Duration) -> Result<Option<Message>, Gone> {
        loop {
            if let Some(message) = self.next_message()? {
                return Ok(Some(message));
            }
            let wait = Timespec { tv_sec: 0, tv_nsec: i64::from(within.subsec_nanos()) };
            let mut polled = [PollFd::new(&self.socket, PollFlags::IN)];
            match poll(&mut polled, Some(&wait)) {
                Ok(0) => return Ok(None),
                Err(rustix::io::Errno::INTR) => return Ok(None),
                Err(_) => return Err(Gone),
                Ok(_) => {}
            }
            let mut bytes = [0u8; 16_384];
            match self.socket.read(&mut bytes) {
                Ok(0) | Err(_) => return Err(Gone),
                Ok(count) => self.inbox.extend(&bytes[..count]),
            }
        }
    }

    fn next_message(&mut self) -> Result<Option<Message>, Gone> {
        let Some(head) = self.inbox.first_chunk::<4>() else { return Ok(None) };
        let length = u32::from_le_bytes(*head) as usize;
        if length == 0 || length > LONGEST {
            return Err(Gone);
        }
        if self.inbox.len() < 4 + length {
            return Ok(None);
        }
        let message = (self.inbox[4], self.inbox[5..4 + length].to_vec());
        self.inbox.drain(..4 + length);
        Ok(Some(message))
    }

    /// Tells whether the child is there still.
    pub(super) fn is_alive(&mut self) -> bool {
        matches!(self.child.try_wait(), Ok(None))
    }

    pub(super) fn kill(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }

    /// Says of what a child died, and makes sure that it did.
    pub(super) fn end(&mut self) -> String {
        let begin = Instant::now();
        loop {
            match self.child.try_wait() {
                Ok(Some(status)) => return self.cause(status),
                Ok(None) if begin.elapsed() < Duration::from_millis(50) => {
                    std::thread::sleep(Duration::from_micros(200));
                }
                _ => {
                    self.kill();
                    return "it stopped answering".to_owned();
                }
            }
        }
    }

    fn cause(&mut self, status: ExitStatus) -> String {
        let said = self.last_words();
        if said.contains("overflowed its stack") {
            return "it overflowed its stack".to_owned();
        }
        match (status.signal(), status.code()) {
            (Some(11), _) => "it touched memory that is not its own (signal 11)".to_owned(),
            (Some(7), _) => "it touched memory that is not there (signal 7)".to_owned(),
            (Some(6), _) => "it aborted (signal 6)".to_owned(),
            (Some(4), _) => "it ran an instruction that this processor lacks (signal 4)".to_owned(),
            (Some(8), _) => "it divided by zero (signal 8)".to_owned(),
            (Some(9), _) => "it was killed (signal 9)".to_owned(),
            (Some(signal), _) => format!("it was ended by signal {signal}"),
            (_, code) => format!("it ended its process with code {}", code.unwrap_or_default()),
        }
    }

    fn last_words(&mut self) -> String {
        let mut bytes = Vec::new();
        let length = self.output.seek(SeekFrom::End(0)).unwrap_or(0);
        let _ = self.output.seek(SeekFrom::Start(length.saturating_sub(4096)));
        let _ = (&self.output).take(4096).read_to_end(&mut bytes);
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Starts a child for a library, to learn what it says of itself.
pub(crate) fn describe(program: &Path, library: &Path) -> Result<Manifest, Refusal> {
    let heap = Heap::new().map_err(|what| Refusal::NoChild { path: library.into(), what })?;
    Process::start(program, library, &heap).map(|(_, manifest, _)| manifest)
}
