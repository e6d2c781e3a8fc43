//! Does `render` leave the heap alone once a frame of that size has been drawn?

use glam::{DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::scene::{Light, Material, Object, Primitive, Scene, Shape, Voxels};
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_voxel::Voxel;
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

#[expect(unsafe_code, reason = "a global allocator cannot be written without")]
// SAFETY: every call is passed on unchanged to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`, and `pointer` came from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn the_second_frame_allocates_nothing() {
    let mut scene = Scene::default();
    let ground = scene.add_material(Material::default());
    let glass = scene.add_material(Material { opacity: 0.5, reflectivity: 0.3, ..Material::new(Vec3::X) });
    let lamp = scene.add_material(Material { emission: Vec3::splat(20.0), ..Material::new(Vec3::ONE) });
    let voxels = Voxels::from_fn([70, 30, 70], |x, y, z| match (x, y, z) {
        (_, 0..4, _) => 1,
        (20..30, 4..20, 20..30) => 2,
        (50, 10, 50) => 3,
        _ => 0,
    });
    let mut object = Object::new("grid", Shape::Voxels(voxels), ground);
    object.materials = vec![ground, glass, lamp];
    scene.objects.push(object);
    let ball = Shape::Primitive(Primitive::Sphere { radius: 6.0 });
    scene.objects.push(Object::new("ball", ball, glass).at(DVec3::new(45.0, 12.0, 20.0)));
    scene.lights.push(Light::directional(DVec3::new(0.3, -1.0, 0.2)));

    let eye = DVec3::new(90.0, 50.0, 90.0);
    let camera =
        Camera::look_at(eye, DVec3::new(35.0, 5.0, 35.0), DVec3::Y, Projection::Perspective { fov_y: 0.8 });
    let need = Need { channels: Channels::ALL, ..Need::new(camera, 97, 61) };
    let mut voxel = Voxel::new();
    let control = Control::simple();
    voxel.prepare(&Arc::new(scene), &need, &Converter::default(), &control).unwrap();
    let mut picture = Framebuffer::new(97, 61, Channels::ALL);
    let frame = need.frame();
    voxel.render(&frame, &mut picture, &control).unwrap();
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    voxel.render(&frame, &mut picture, &control).unwrap();
    assert_eq!(ALLOCATIONS.load(Ordering::Relaxed) - before, 0);
    assert!(picture.id().contains(&1) && picture.id().contains(&2));
}
