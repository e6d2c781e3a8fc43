//! Which colors have the cells of a few layers?

use super::super::ConvertError;
use super::super::palette::{ColorCollector, ColorKey};
use crate::scene::{Material, Object, Scene};
use crate::seam::Control;
use glam::Vec3;
use std::collections::HashMap;

/// Layers of cells that are filled by one thread. Their borders do not depend on the number of threads.
const SLAB: u32 = 8;

/// Some layers of cells with their colors; a cell named again keeps its last color.
pub(super) struct Slab {
    size: [u32; 3],
    pub(super) from: u32,
    pub(super) to: u32,
    colors: ColorCollector,
    /// Colors by their number, counted from 1.
    keys: Vec<ColorKey>,
    number_of: HashMap<ColorKey, u32>,
    /// The number of each cell's color, 0 where it is empty.
    cells: Vec<u32>,
    last: Option<LastColor>,
}

/// Neighboring cells mostly have the same color: it is looked up once.
struct LastColor {
    slot: u16,
    color: Vec3,
    key: ColorKey,
    number: u32,
    count: u32,
}

impl Slab {
    /// Cuts a grid into slabs.
    pub(super) fn all(size: [u32; 3]) -> Vec<Self> {
        (0..size[2]).step_by(SLAB as usize).map(|z| Self::new(size, z)).collect()
    }

    /// Returns which slab a layer is in.
    pub(super) fn of(layer: u32) -> usize {
        (layer / SLAB) as usize
    }

    fn new(size: [u32; 3], from: u32) -> Self {
        let to = (from + SLAB).min(size[2]);
        Self {
            size,
            from,
            to,
            colors: ColorCollector::default(),
            keys: Vec::new(),
            number_of: HashMap::new(),
            cells: vec![0; size[0] as usize * size[1] as usize * (to - from) as usize],
            last: None,
        }
    }

    /// Returns where a cell lies in the slab.
    pub(super) fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        ((z - self.from) as usize * self.size[1] as usize + y as usize) * self.size[0] as usize + x as usize
    }

    /// Fills a cell.
    pub(super) fn fill(&mut self, cell: [u32; 3], slot: u16, color: Vec3) {
        let index = self.index(cell);
        self.cells[index] = self.number(slot, color);
    }

    /// Notes a color and returns its number.
    pub(super) fn number(&mut self, slot: u16, color: Vec3) -> u32 {
        if let Some(last) = &mut self.last
            && last.slot == slot
            && last.color == color
        {
            last.count += 1;
            return last.number;
        }
        self.flush();
        let key = ColorCollector::key(slot, color);
        let number = *self.number_of.entry(key).or_insert_with(|| {
            self.keys.push(key);
            self.keys.len() as u32
        });
        self.last = Some(LastColor { slot, color, key, number, count: 1 });
        number
    }

    /// Returns the number of a cell's color, 0 where it is empty.
    pub(super) fn number_at(&self, index: usize) -> u32 {
        self.cells[index]
    }

    /// Fills a cell with a color that was noted.
    pub(super) fn put(&mut self, index: usize, number: u32) {
        self.cells[index] = number;
    }

    /// Notes the color that was counted last.
    fn flush(&mut self) {
        if let Some(last) = self.last.take() {
            self.colors.note(last.key, last.color * last.count as f32, last.count);
        }
    }
}

/// Chooses a palette for all slabs together, in their order whoever filled them, and writes the bytes.
pub(super) fn choose_colors(
    scene: &Scene,
    object: &Object,
    slabs: &mut [Slab],
    control: &Control<'_>,
) -> Result<(Vec<u8>, Vec<Material>), ConvertError> {
    let mut colors = ColorCollector::default();
    for slab in &mut *slabs {
        control.check()?;
        slab.flush();
        colors.merge(&slab.colors);
    }
    if slabs.iter().all(|slab| slab.keys.is_empty()) {
        return Err(ConvertError::of(object, "it fills no voxel: it is empty or thinner than a cell"));
    }
    let palette = colors.choose(scene, object);
    let mut bytes = vec![0u8; slabs.iter().map(|slab| slab.cells.len()).sum()];
    let mut rest: &mut [u8] = &mut bytes;
    let mut parts = Vec::with_capacity(slabs.len());
    for slab in slabs {
        let (part, others) = std::mem::take(&mut rest).split_at_mut(slab.cells.len());
        rest = others;
        parts.push((part, slab));
    }
    control.for_each_mut(&mut parts, 1, &|_, (bytes, slab)| {
        let byte_of: Vec<u8> =
            std::iter::once(0).chain(slab.keys.iter().map(|&key| palette.byte(key))).collect();
        for (byte, &number) in bytes.iter_mut().zip(&slab.cells) {
            *byte = byte_of[number as usize];
        }
    })?;
    Ok((bytes, palette.materials))
}
