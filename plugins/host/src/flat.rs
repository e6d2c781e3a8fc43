//! Where does the flat scene lie, and under which names do its parts go?

#![expect(unsafe_code, reason = "pointers for plugins to follow")]

use polyptych_core::scene::{Scene, Shape, Texture};
use std::any::Any;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Weak};

/// A place for the parts of a flat scene; pointers that it returns are what the plugin will follow.
pub(crate) trait Place {
    /// Stores a small array; null for an empty one.
    fn put<T: Copy + 'static>(&mut self, items: Vec<T>) -> *const T;

    /// Makes a large array reachable that lives as long as the scene, under a name of its contents.
    fn lend<T: Copy>(&mut self, name: (u64, u32), items: &[T]) -> *const T;

    /// Stores one thing.
    fn one<T: Copy + 'static>(&mut self, item: T) -> *const T {
        self.put(vec![item])
    }

    /// Stores text, with a zero byte at its end and none within.
    fn text(&mut self, text: &str) -> *const std::ffi::c_char {
        let bytes = text.bytes().take_while(|&b| b != 0).chain([0]);
        self.put(bytes.collect()).cast()
    }
}

/// This process's memory: large arrays are used where they are.
#[derive(Default)]
pub(crate) struct Memory {
    kept: Vec<Box<dyn Any>>,
}

// SAFETY: the arrays are numbers and pointers to each other and to the scene, which nobody changes.
unsafe impl Send for Memory {}

impl Place for Memory {
    fn put<T: Copy + 'static>(&mut self, items: Vec<T>) -> *const T {
        if items.is_empty() {
            return std::ptr::null();
        }
        let items = items.into_boxed_slice();
        let first = items.as_ptr();
        self.kept.push(Box::new(items));
        first
    }

    fn lend<T: Copy>(&mut self, _: (u64, u32), items: &[T]) -> *const T {
        if items.is_empty() { std::ptr::null() } else { items.as_ptr() }
    }
}

/// Gives shapes, textures and scenes names: the same name means the same contents.
#[derive(Default)]
pub(crate) struct Names {
    shapes: Known<Shape>,
    textures: Known<Texture>,
    scenes: Known<Scene>,
}

impl Names {
    pub(crate) fn shape(&mut self, shape: &Arc<Shape>) -> u64 {
        self.shapes.name(shape)
    }
    pub(crate) fn texture(&mut self, texture: &Arc<Texture>) -> u64 {
        self.textures.name(texture)
    }
    pub(crate) fn scene(&mut self, scene: &Arc<Scene>) -> u64 {
        self.scenes.name(scene)
    }
}

/// Names by address. The weak reference keeps an address from being used again while its name stands.
struct Known<T>(HashMap<usize, (Weak<T>, u64)>);

impl<T> Default for Known<T> {
    fn default() -> Self {
        Self(HashMap::new())
    }
}

impl<T> Known<T> {
    fn name(&mut self, item: &Arc<T>) -> u64 {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        let address = Arc::as_ptr(item) as usize;
        if let Some((weak, name)) = self.0.get(&address)
            && weak.strong_count() > 0
        {
            return *name;
        }
        self.0.retain(|_, (weak, _)| weak.strong_count() > 0);
        let name = NEXT.fetch_add(1, Ordering::Relaxed);
        self.0.insert(address, (Arc::downgrade(item), name));
        name
    }
}
