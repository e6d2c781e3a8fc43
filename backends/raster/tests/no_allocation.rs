//! Does the second frame allocate nothing?

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::scene::{Light, Material, Object, Primitive, Scene, Shape};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_raster::Raster;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

struct Counting;

#[expect(unsafe_code, reason = "an allocator cannot be written without")]
// SAFETY: every call is handed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the promises of `alloc`, which are those of `System.alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the pointer came from `System.alloc` with this layout.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_second_frame_allocates_nothing() {
    let materials = vec![Material::default(), Material { opacity: 0.5, ..Material::new(Vec3::X) }];
    let mut scene = Scene { materials, ..Scene::default() };
    let body = Shape::Primitive;
    let plane = Object::new("floor", body(Primitive::Plane { width: 9.0, depth: 9.0 }), 0);
    let glass = Object::new("glass", body(Primitive::Sphere { radius: 0.5 }), 1);
    let torus = Object::new("torus", body(Primitive::Torus { major: 0.7, minor: 0.2 }), 0);
    scene.objects = vec![plane.at(DVec3::new(0.0, -0.5, 0.0)), glass.at(DVec3::new(0.0, 0.2, 1.0)), torus];
    scene.lights = vec![Light::directional(DVec3::new(-0.3, -1.0, -0.2))];
    let scene = Arc::new(scene);
    for projection in [
        Projection::Perspective { fov_y: 0.8 },
        Projection::Orthographic { height: 4.0 },
        Projection::Fisheye { fov: 3.0 },
    ] {
        let camera = Camera::look_at(DVec3::new(1.0, 1.5, 4.0), DVec3::ZERO, DVec3::Y, projection);
        let need = Need { channels: Channels::ALL, ..Need::new(camera, 130, 70) };
        let (mut raster, control) = (Raster::new(), Control::simple());
        raster.prepare(&scene, &need, &Converter::default(), &control).unwrap();
        let mut picture = Framebuffer::new(130, 70, need.channels);
        let frame = need.frame();
        raster.render(&frame, &mut picture, &control).unwrap();
        let before = ALLOCATIONS.load(Ordering::Relaxed);
        raster.render(&frame, &mut picture, &control).unwrap();
        assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0, "{:?}", frame.camera.projection);
    }
}
