//! A voxel figure: a small robot gardener with a flower, painted by boxes.

use crate::scene::Voxels;

/// Palette bytes of the figure; its materials stand in the same order.
#[derive(Clone, Copy)]
pub(super) enum Paint {
    Steel = 1,
    Teal,
    Dark,
    Orange,
    Eye,
    Leaf,
    Petal,
    Soil,
}

/// Colors in the order of [`Paint`], sRGB.
pub(super) const COLORS: [&str; 8] =
    ["#b9c2c9", "#2f8f8b", "#2b3038", "#e0872f", "#fff3c4", "#5d9a3c", "#d6456b", "#6a4a33"];

/// Paints the figure; it stands on y = 0 and looks along +z.
pub(super) fn robot() -> Voxels {
    let mut grid = Voxels::new([23, 32, 15]);
    let mut fill = |from: [u32; 3], to: [u32; 3], paint: Paint| {
        for z in from[2]..=to[2] {
            for y in from[1]..=to[1] {
                for x in from[0]..=to[0] {
                    grid.set(x, y, z, paint as u8);
                }
            }
        }
    };
    // Feet and legs.
    fill([5, 0, 3], [9, 1, 10], Paint::Dark);
    fill([13, 0, 3], [17, 1, 10], Paint::Dark);
    fill([6, 2, 5], [8, 7, 7], Paint::Steel);
    fill([14, 2, 5], [16, 7, 7], Paint::Steel);
    // Body with a chest plate and a belt.
    fill([4, 8, 3], [18, 18, 9], Paint::Teal);
    fill([4, 10, 3], [18, 10, 9], Paint::Dark);
    fill([7, 12, 10], [15, 16, 10], Paint::Steel);
    fill([8, 13, 11], [9, 14, 11], Paint::Orange);
    fill([11, 13, 11], [11, 15, 11], Paint::Dark);
    fill([13, 13, 11], [14, 15, 11], Paint::Leaf);
    // Arms: the left hangs, the right holds a pot with a flower.
    fill([1, 9, 5], [3, 17, 7], Paint::Steel);
    fill([1, 7, 4], [3, 8, 8], Paint::Dark);
    fill([19, 14, 5], [21, 17, 7], Paint::Steel);
    fill([19, 12, 8], [21, 14, 10], Paint::Steel);
    fill([18, 13, 11], [22, 13, 14], Paint::Orange);
    fill([18, 14, 11], [22, 15, 14], Paint::Orange);
    fill([19, 16, 12], [21, 16, 13], Paint::Soil);
    fill([20, 17, 12], [20, 21, 12], Paint::Leaf);
    fill([19, 19, 12], [19, 19, 12], Paint::Leaf);
    fill([19, 22, 12], [21, 24, 12], Paint::Petal);
    fill([20, 23, 13], [20, 23, 13], Paint::Orange);
    // Neck and head with eyes, a mouth and an antenna.
    fill([10, 19, 5], [12, 19, 7], Paint::Dark);
    fill([6, 20, 3], [16, 27, 9], Paint::Steel);
    fill([8, 23, 10], [9, 25, 10], Paint::Eye);
    fill([13, 23, 10], [14, 25, 10], Paint::Eye);
    fill([9, 21, 10], [13, 21, 10], Paint::Dark);
    fill([5, 22, 5], [5, 25, 7], Paint::Orange);
    fill([17, 22, 5], [17, 25, 7], Paint::Orange);
    fill([11, 28, 6], [11, 30, 6], Paint::Dark);
    fill([11, 31, 6], [11, 31, 6], Paint::Petal);
    grid
}
