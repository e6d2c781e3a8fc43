//! What lies before the nearest solid surface of each pixel: fragments that light may pass, front to back.
//!
//! All fragments of a tile are kept and sorted, so any number of layers is right whatever the order of triangles.

use crate::edges::Spans;
use crate::grid::TileArea;
use crate::setup::Record;
use crate::tile::TileBuffer;

/// A triangle on a pixel. The order of the fields is the order of drawing.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Fragment {
    /// Pixel within the tile.
    pub(crate) pixel: u32,
    /// Falls with depth: nearer fragments come first.
    far: u32,
    pub(crate) id: u32,
}

/// Collects the fragments of a triangle that the solid surfaces of the tile do not hide.
pub(crate) fn collect(fragments: &mut Vec<Fragment>, record: &Record, area: &TileArea, solid: &TileBuffer) {
    for span in Spans::of(record, area).iter() {
        let row = record.depth_of_row(span.y);
        for i in 0..span.length {
            let depth = record.hold(row + record.depth_of_column(span.x + i as i32));
            let pixel = span.first + i;
            let hidden =
                depth < solid.depth[pixel] || (depth == solid.depth[pixel] && record.id > solid.id[pixel]);
            if !hidden {
                fragments.push(Fragment { pixel: pixel as u32, far: !ordered(depth), id: record.id });
            }
        }
    }
}

/// Sorts fragments by pixel, then from front to back, then by id.
pub(crate) fn sort(fragments: &mut [Fragment]) {
    fragments.sort_unstable();
}

/// Maps numbers to whole numbers in the same order.
fn ordered(v: f32) -> u32 {
    let bits = v.to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_keep_the_order_of_depths() {
        let depths = [f32::NEG_INFINITY, -2.5, -1e-20, 0.0, 1e-20, 3.0, f32::INFINITY];
        assert!(depths.windows(2).all(|d| ordered(d[0]) < ordered(d[1])));
    }
}
