//! How does a picture lie in memory that another process writes?
//!
//! Each plane ends at the end of a page, and the page after it may not be touched in the child, nor the one before: a
//! plugin that writes past its picture is stopped at the first wrong number.

#![expect(unsafe_code, reason = "memory that is shared with another process")]

use super::heap::{Heap, PAGE};
use glam::Vec3;
use polyptych_core::framebuffer::{Band, Channel, Channels, Framebuffer};
use std::sync::Arc;

/// Where the planes of a picture lie, from the base of the shared memory; those of missing channels nowhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) channels: u8,
    /// First page of each plane.
    pub(super) pages: [u64; 7],
}

impl Layout {
    pub(super) fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Returns the bytes of a plane.
    pub(super) fn bytes(&self, plane: usize) -> usize {
        let channel = Channel::ALL[plane];
        if !Channels::from_bits(self.channels).has(channel) {
            return 0;
        }
        let numbers = match channel {
            Channel::Color | Channel::Normal | Channel::Albedo => 3,
            _ => 1,
        };
        self.pixels() * numbers * 4
    }

    /// Returns how far behind its first page a plane begins, so that it ends with a page.
    pub(super) fn lead(&self, plane: usize) -> usize {
        self.bytes(plane).next_multiple_of(PAGE) - self.bytes(plane)
    }
}

/// Pages for a picture; given back with the last framebuffer over them.
pub(super) struct Buffer {
    heap: Arc<Heap>,
    pub(super) layout: Layout,
}

impl Buffer {
    pub(super) fn new(heap: &Arc<Heap>, width: u32, height: u32, channels: Channels) -> Option<Self> {
        let mut layout = Layout { width, height, channels: channels.bits(), pages: [0; 7] };
        for plane in 0..7 {
            let bytes = layout.bytes(plane);
            if bytes > 0 {
                match heap.take(bytes) {
                    Some(at) => layout.pages[plane] = at as u64,
                    None => {
                        drop(Self { heap: heap.clone(), layout });
                        return None;
                    }
                }
            }
        }
        Some(Self { heap: heap.clone(), layout })
    }

    /// Returns where a plane's numbers begin.
    fn address(&self, plane: usize) -> usize {
        match self.layout.bytes(plane) {
            0 => 0,
            _ => self.heap.base() + self.layout.pages[plane] as usize + self.layout.lead(plane),
        }
    }

    /// Tells whether a framebuffer lies here.
    pub(super) fn holds(&self, picture: &Framebuffer) -> bool {
        let at = [
            picture.color().as_ptr() as usize,
            picture.distance().as_ptr() as usize,
            picture.normal().as_ptr() as usize,
            picture.id().as_ptr() as usize,
            picture.albedo().as_ptr() as usize,
            picture.shadow().as_ptr() as usize,
            picture.coverage().as_ptr() as usize,
        ];
        let layout = &self.layout;
        let size = (picture.width(), picture.height(), picture.channels().bits());
        size == (layout.width, layout.height, layout.channels)
            && layout.pixels() > 0
            && (0..7).all(|plane| layout.bytes(plane) == 0 || at[plane] == self.address(plane))
    }

    /// Makes the framebuffer over these pages; there may be one at a time.
    pub(super) fn framebuffer(self: &Arc<Self>) -> Option<Framebuffer> {
        let n = self.layout.pixels();
        // SAFETY: the pages were taken for this picture and are mapped as long as the buffer, which the framebuffer
        // keeps; `peer` makes no second framebuffer while there is a first. The child writes during calls only; one
        // that writes later changes plain numbers, of which no pattern is invalid.
        let planes = unsafe {
            Band {
                width: self.layout.width,
                first_row: 0,
                rows: self.layout.height,
                color: self.plane::<Vec3>(0, n),
                distance: self.plane::<f32>(1, n),
                normal: self.plane::<Vec3>(2, n),
                id: self.plane::<u32>(3, n),
                albedo: self.plane::<Vec3>(4, n),
                shadow: self.plane::<f32>(5, n),
                coverage: self.plane::<f32>(6, n),
            }
        };
        Framebuffer::lent(Channels::from_bits(self.layout.channels), planes, self.clone()).ok()
    }

    unsafe fn plane<T>(&self, plane: usize, n: usize) -> &'static mut [T] {
        match self.address(plane) {
            0 => &mut [],
            // SAFETY: the caller's promise.
            address => unsafe { std::slice::from_raw_parts_mut(address as *mut T, n) },
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        for plane in 0..7 {
            if self.layout.pages[plane] != 0 {
                self.heap.give_back(self.layout.pages[plane] as usize, self.layout.bytes(plane));
            }
        }
    }
}
