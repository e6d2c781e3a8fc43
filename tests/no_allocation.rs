//! Does a second frame of the same scene and size ask for memory? It must not.

mod common;

use polyptych::convert::Converter;
use polyptych::prelude::*;
use polyptych::seam::Control;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Counts what the current thread asks for.
struct Counting;

thread_local! {
    static ASKED: Cell<u64> = const { Cell::new(0) };
}

#[expect(unsafe_code, reason = "the only way to count allocations")]
// SAFETY: every call is handed to the system's allocator as it came; counting touches no memory of the heap.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ASKED.try_with(|asked| asked.set(asked.get() + 1));
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn asked_for_in_a_second_frame(backend: &str, settings: &[(&str, &str)]) -> u64 {
    let scene = common::builtin("atelier");
    let mut need = Need { tolerance_px: 2.0, ..common::need(&scene, 96, 54) };
    let registry = Registry::builtin();
    for (name, value) in settings {
        let declared = &registry.info(backend).expect("a built-in back end").parameters;
        need.settings.set(backend, declared, name, value).expect("a parameter");
    }
    let mut renderer = registry.create(backend).expect("a built-in back end");
    let control = Control::simple();
    renderer.prepare(&scene, &need, &Converter::default(), &control).expect("the scene is prepared");
    let mut target = Framebuffer::new(96, 54, need.channels);
    let frame = need.frame();
    renderer.render(&frame, &mut target, &control).expect("a first frame");
    target.touch();
    let before = ASKED.get();
    renderer.render(&frame, &mut target, &control).expect("a second frame");
    ASKED.get() - before
}

#[test]
fn no_back_end_asks_for_memory_in_a_second_frame() {
    for backend in ["reference", "raster", "voxel", "freeform", "stylized"] {
        assert_eq!(asked_for_in_a_second_frame(backend, &[]), 0, "{backend}");
    }
}

#[test]
fn no_way_to_draw_triangles_asks_for_memory_in_a_second_frame() {
    for setting in [("mode", "hidden-line"), ("mode", "wireframe"), ("shading", "gouraud"), ("samples", "4")]
    {
        assert_eq!(asked_for_in_a_second_frame("raster", &[setting]), 0, "{setting:?}");
    }
}

#[test]
fn no_style_asks_for_memory_in_a_second_frame() {
    for style in polyptych::stylized::STYLES {
        let settings = [("preset", *style), ("wireframe", "true")];
        assert_eq!(asked_for_in_a_second_frame("stylized", &settings), 0, "{style}");
    }
}
