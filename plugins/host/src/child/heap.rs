//! Where do scene and picture lie, for two processes? In one sparse file of memory, at one address.

#![expect(unsafe_code, reason = "memory that is shared with another process")]

use crate::flat::Place;
use rustix::fs::{FallocateFlags, MemfdFlags, fallocate, ftruncate, memfd_create};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use std::collections::{BTreeMap, HashMap};
use std::ffi::c_void;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::{Mutex, PoisonError};

/// Bytes of address space for each child; memory is used where something was written only.
pub(super) const SPAN: usize = 1 << 36;
/// Where the first child's part begins: far from where systems put programs, stacks and libraries.
const BASE: usize = 0x2000_0000_0000;
/// Most children at once.
const MOST: usize = 512;
pub(super) const PAGE: usize = 4096;
/// Bytes that go to the system when they are given back.
const LARGE: usize = 1 << 26;

/// Parts of the address space that are in use.
static USED: Mutex<[bool; MOST]> = Mutex::new([false; MOST]);

/// Shared memory. Its first page holds the byte that says stop.
pub(super) struct Heap {
    file: OwnedFd,
    part: usize,
    free: Mutex<BTreeMap<usize, usize>>,
}

// SAFETY: the mapping belongs to the heap alone; parts of it are handed out once each.
unsafe impl Send for Heap {}
// SAFETY: as above, and the list of free parts has a lock.
unsafe impl Sync for Heap {}

impl Heap {
    /// Makes shared memory.
    pub(super) fn new() -> Result<Self, String> {
        let say = |what: &str, e: rustix::io::Errno| format!("{what}: {e}");
        if rustix::param::page_size() != PAGE {
            return Err(format!("the system's pages have {} bytes, not {PAGE}", rustix::param::page_size()));
        }
        let file = memfd_create("polyptych-plugin", MemfdFlags::CLOEXEC).map_err(|e| say("memfd", e))?;
        ftruncate(&file, SPAN as u64).map_err(|e| say("ftruncate", e))?;
        let mut used = USED.lock().unwrap_or_else(PoisonError::into_inner);
        let free = (0..MOST).filter(|&part| !used[part]);
        for part in free {
            if map(file.as_fd(), base_of(part), ProtFlags::READ | ProtFlags::WRITE).is_ok() {
                used[part] = true;
                let free = Mutex::new(BTreeMap::from([(PAGE, SPAN - PAGE)]));
                return Ok(Self { file, part, free });
            }
        }
        Err("there is no free address for shared memory".to_owned())
    }

    pub(super) fn file(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }

    pub(super) fn base(&self) -> usize {
        base_of(self.part)
    }

    /// Returns the byte that says stop.
    pub(super) fn stop(&self) -> &std::sync::atomic::AtomicBool {
        // SAFETY: the first page is mapped as long as the heap, is 0 or 1 there, and is used atomically only.
        unsafe { std::sync::atomic::AtomicBool::from_ptr(self.base() as *mut bool) }
    }

    /// Takes whole pages; returns where they begin, counted from the base.
    pub(super) fn take(&self, bytes: usize) -> Option<usize> {
        let bytes = bytes.max(1).checked_next_multiple_of(PAGE)?;
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let (&at, &length) = free.iter().find(|(_, length)| **length >= bytes)?;
        free.remove(&at);
        if length > bytes {
            free.insert(at + bytes, length - bytes);
        }
        Some(at)
    }

    /// Gives pages back. The memory of many goes to the system; that of a few stays, since new pages cost more than
    /// copying into old ones.
    pub(super) fn give_back(&self, at: usize, bytes: usize) {
        let bytes = bytes.max(1).next_multiple_of(PAGE);
        if bytes >= LARGE {
            let flags = FallocateFlags::PUNCH_HOLE | FallocateFlags::KEEP_SIZE;
            let _ = fallocate(&self.file, flags, at as u64, bytes as u64);
        }
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let (mut at, mut bytes) = (at, bytes);
        if let Some((&before, &length)) = free.range(..at).next_back()
            && before + length == at
        {
            free.remove(&before);
            (at, bytes) = (before, bytes + length);
        }
        if let Some(length) = free.remove(&(at + bytes)) {
            bytes += length;
        }
        free.insert(at, bytes);
    }
}

impl Drop for Heap {
    fn drop(&mut self) {
        // SAFETY: the heap's own mapping, which nobody uses any more: what lies in it keeps the heap.
        let _ = unsafe { munmap(self.base() as *mut c_void, SPAN) };
        USED.lock().unwrap_or_else(PoisonError::into_inner)[self.part] = false;
    }
}

fn base_of(part: usize) -> usize {
    BASE + part * SPAN
}

/// Maps shared memory at an address, unless something is there.
pub(super) fn map(file: BorrowedFd<'_>, base: usize, access: ProtFlags) -> rustix::io::Result<()> {
    let flags = MapFlags::SHARED | MapFlags::FIXED_NOREPLACE | MapFlags::NORESERVE;
    // SAFETY: nothing that is there is replaced, and nothing was there before.
    unsafe { mmap(base as *mut c_void, SPAN, access, flags, file, 0) }.map(|_| ())
}

/// Arrays of scenes that lie in shared memory: large ones as long as a scene has them, the rest for one call.
#[derive(Default)]
pub(super) struct Published {
    arrays: HashMap<(u64, u32), Array>,
    /// Pages of small things, and how much of the last one is used.
    small: Vec<(usize, usize)>,
    used: usize,
    round: u64,
    /// Bytes of large arrays that were copied in the last round.
    pub(super) copied: u64,
    pub(super) full: bool,
}

struct Array {
    at: usize,
    bytes: usize,
    round: u64,
}

/// Bytes that small things take at once.
const SMALL: usize = 1 << 18;

impl Published {
    /// Begins a scene.
    pub(super) fn begin(&mut self) {
        self.round += 1;
        (self.copied, self.full) = (0, false);
    }

    /// Ends the call: small things go. Large arrays that this scene has not go, too, if it replaces what was before.
    pub(super) fn end(&mut self, heap: &Heap, replaces: bool) {
        self.small.drain(..).for_each(|(at, bytes)| heap.give_back(at, bytes));
        self.used = 0;
        if replaces {
            let round = self.round;
            self.arrays.retain(|_, array| {
                let stays = array.round == round;
                if !stays {
                    heap.give_back(array.at, array.bytes);
                }
                stays
            });
        }
    }
}

/// A place in shared memory for one scene.
pub(super) struct Shared<'a> {
    pub(super) heap: &'a Heap,
    pub(super) published: &'a mut Published,
}

impl Shared<'_> {
    fn copy<T: Copy>(&mut self, at: usize, items: &[T]) -> *const T {
        let first = (self.heap.base() + at) as *mut T;
        // SAFETY: the pages were taken for this array, which is not larger; they are mapped, and aligned for anything.
        unsafe { std::ptr::copy_nonoverlapping(items.as_ptr(), first, items.len()) };
        first
    }
}

impl Place for Shared<'_> {
    fn put<T: Copy + 'static>(&mut self, items: Vec<T>) -> *const T {
        if items.is_empty() {
            return std::ptr::null();
        }
        let bytes = size_of_val(&items[..]).next_multiple_of(16);
        let published = &mut *self.published;
        let room = published.small.last().map_or(0, |(_, length)| length - published.used);
        if room < bytes {
            let length = bytes.max(SMALL);
            let Some(at) = self.heap.take(length) else {
                published.full = true;
                return std::ptr::null();
            };
            published.small.push((at, length));
            published.used = 0;
        }
        let at = published.small.last().map_or(0, |(at, _)| at + published.used);
        published.used += bytes;
        self.copy(at, &items)
    }

    fn lend<T: Copy>(&mut self, name: (u64, u32), items: &[T]) -> *const T {
        if items.is_empty() {
            return std::ptr::null();
        }
        let published = &mut *self.published;
        let round = published.round;
        if let Some(array) = published.arrays.get_mut(&name) {
            array.round = round;
            return (self.heap.base() + array.at) as *const T;
        }
        let bytes = size_of_val(items);
        let Some(at) = self.heap.take(bytes) else {
            published.full = true;
            return std::ptr::null();
        };
        published.arrays.insert(name, Array { at, bytes, round });
        published.copied += bytes as u64;
        self.copy(at, items)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_that_are_given_back_are_one_piece_again() {
        let heap = Heap::new().unwrap();
        let taken: Vec<_> = [1, 5000, 4096, 70_000].map(|bytes| (heap.take(bytes).unwrap(), bytes)).into();
        assert_eq!(taken.iter().map(|(at, _)| at / PAGE).collect::<Vec<_>>(), [1, 2, 4, 5]);
        for index in [1, 3, 0, 2] {
            heap.give_back(taken[index].0, taken[index].1);
        }
        assert_eq!(*heap.free.lock().unwrap(), BTreeMap::from([(PAGE, SPAN - PAGE)]));
        assert!(heap.take(SPAN).is_none());
    }

    #[test]
    fn an_array_is_copied_once_and_goes_with_its_scene() {
        let (heap, mut published) = (Heap::new().unwrap(), Published::default());
        let numbers = vec![7u32; 3000];
        for copied in [12_000, 0] {
            published.begin();
            let mut place = Shared { heap: &heap, published: &mut published };
            let lent = place.lend((1, 0), &numbers);
            // SAFETY: the array was just put there.
            assert_eq!(unsafe { *lent.add(2999) }, 7);
            assert!(place.put(vec![1u8]) < place.put(vec![2u8]));
            published.end(&heap, true);
            assert_eq!(published.copied, copied);
        }
        published.begin();
        published.end(&heap, true);
        assert_eq!(*heap.free.lock().unwrap(), BTreeMap::from([(PAGE, SPAN - PAGE)]));
    }
}
