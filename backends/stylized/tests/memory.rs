//! Does a second frame in any style ask for memory? It must not.

mod common;

use common::{Easel, ball, central, cube, scene};
use glam::DVec3;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::{Primitive, Shape};
use polyptych_core::seam::{Control, Renderer};
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

#[test]
fn no_style_asks_for_memory_in_a_second_frame() {
    let scene = scene(
        vec![
            (Shape::Mesh(cube(0.9)), DVec3::new(-0.7, 0.0, 0.0)),
            (Shape::Mesh(ball(0.6, 12, true)), DVec3::new(0.7, 0.0, 0.0)),
            (Shape::Primitive(Primitive::Sphere { radius: 0.5 }), DVec3::new(0.0, 0.4, 0.3)),
        ],
        DVec3::new(0.4, 0.8, 0.6),
    );
    for style in polyptych_stylized::STYLES {
        let camera = central(DVec3::new(0.4, 0.9, 3.6), 0.7);
        let mut easel = Easel::new(&scene, camera, [96, 54], &[("preset", style), ("wireframe", "true")]);
        let mut target = Framebuffer::new(96, 54, easel.need.channels);
        let (frame, control) = (easel.need.frame(), Control::simple());
        easel.renderer.render(&frame, &mut target, &control).expect("a first frame");
        let before = ASKED.get();
        easel.renderer.render(&frame, &mut target, &control).expect("a second frame");
        assert_eq!(ASKED.get() - before, 0, "{style}");
    }
}
