//! Heights over a base plane, interpolated bilinearly.

use crate::math::Aabb;
use glam::{DVec2, DVec3};

/// A surface `y = h(x, z)` over the rectangle `[-w/2, w/2] x [-d/2, d/2]`, in object space.
///
/// `h` is bilinear between samples that lie on a grid with samples on the borders of the rectangle; column
/// `i` runs along x, row `j` along z. The normal points up.
#[derive(Clone, Debug)]
pub struct HeightField {
    columns: u32,
    rows: u32,
    extent: DVec2,
    heights: Vec<f32>,
}

impl HeightField {
    /// Builds a height field from samples in rows.
    ///
    /// # Errors
    /// When there are fewer than two rows or columns, the number of samples is not their product, a sample is
    /// not finite, or the extent is not positive; the message says which.
    pub fn new(columns: u32, rows: u32, extent: DVec2, heights: Vec<f32>) -> Result<Self, String> {
        if columns < 2 || rows < 2 {
            return Err(format!("a height field needs at least 2x2 samples, got {columns}x{rows}"));
        }
        if heights.len() as u64 != u64::from(columns) * u64::from(rows) {
            return Err(format!("{} heights for {columns}x{rows} samples", heights.len()));
        }
        if let Some(i) = heights.iter().position(|h| !h.is_finite()) {
            return Err(format!("height {i} is {}", heights[i]));
        }
        if !(extent.is_finite() && extent.min_element() > 0.0) {
            return Err(format!("the extent must be positive, got {extent}"));
        }
        Ok(Self { columns, rows, extent, heights })
    }

    /// Returns the number of samples along x.
    #[must_use]
    pub fn columns(&self) -> u32 {
        self.columns
    }

    /// Returns the number of samples along z.
    #[must_use]
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Returns the lengths of the rectangle along x and z.
    #[must_use]
    pub fn extent(&self) -> DVec2 {
        self.extent
    }

    /// Returns all samples, row by row.
    #[must_use]
    pub fn heights(&self) -> &[f32] {
        &self.heights
    }

    /// Returns one sample.
    #[must_use]
    pub fn height(&self, column: u32, row: u32) -> f64 {
        f64::from(self.heights[(row * self.columns + column) as usize])
    }

    /// Returns the four samples around a cell: `[h00, h10, h01, h11]`, first index along x.
    #[must_use]
    pub fn cell(&self, column: u32, row: u32) -> [f64; 4] {
        let i = (row * self.columns + column) as usize;
        let j = i + self.columns as usize;
        [self.heights[i], self.heights[i + 1], self.heights[j], self.heights[j + 1]].map(f64::from)
    }

    /// Returns the size of a cell along x and z.
    #[must_use]
    pub fn cell_size(&self) -> DVec2 {
        self.extent / DVec2::new(f64::from(self.columns - 1), f64::from(self.rows - 1))
    }

    /// Returns the position of a sample.
    #[must_use]
    pub fn vertex(&self, column: u32, row: u32) -> DVec3 {
        let size = self.cell_size();
        DVec3::new(
            f64::from(column) * size.x - self.extent.x * 0.5,
            self.height(column, row),
            f64::from(row) * size.y - self.extent.y * 0.5,
        )
    }

    /// Returns where a point of the base plane lies on the grid, in cells from the first sample.
    #[must_use]
    pub fn grid_from_plane(&self, x: f64, z: f64) -> DVec2 {
        (DVec2::new(x, z) + self.extent * 0.5) / self.cell_size()
    }

    /// Returns the height and the unnormalized upward normal `(-dh/dx, 1, -dh/dz)`; points outside of the
    /// rectangle are moved to its border.
    #[must_use]
    pub fn height_and_normal(&self, x: f64, z: f64) -> (f64, DVec3) {
        let grid = self.grid_from_plane(x, z);
        let column = grid.x.floor().clamp(0.0, f64::from(self.columns - 2));
        let row = grid.y.floor().clamp(0.0, f64::from(self.rows - 2));
        let (u, v) = ((grid.x - column).clamp(0.0, 1.0), (grid.y - row).clamp(0.0, 1.0));
        let [h00, h10, h01, h11] = self.cell(column as u32, row as u32);
        let (near, far) = (h00 + (h10 - h00) * u, h01 + (h11 - h01) * u);
        let size = self.cell_size();
        let dh_du = (h10 - h00) * (1.0 - v) + (h11 - h01) * v;
        (near + (far - near) * v, DVec3::new(-dh_du / size.x, 1.0, -(far - near) / size.y))
    }

    /// Returns texture coordinates of a point of the base plane: 0 to 1 over the rectangle.
    #[must_use]
    pub fn uv(&self, x: f64, z: f64) -> [f32; 2] {
        [(x / self.extent.x + 0.5) as f32, (z / self.extent.y + 0.5) as f32]
    }

    /// Bounds the surface.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        let (lo, hi) = self
            .heights
            .iter()
            .fold((f32::INFINITY, f32::NEG_INFINITY), |(lo, hi), &h| (lo.min(h), hi.max(h)));
        let half = self.extent * 0.5;
        Aabb::new(DVec3::new(-half.x, f64::from(lo), -half.y), DVec3::new(half.x, f64::from(hi), half.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twisted_cell_is_bilinear() {
        let field = HeightField::new(2, 2, DVec2::new(2.0, 4.0), vec![0.0, 1.0, 2.0, 7.0]).unwrap();
        let (height, normal) = field.height_and_normal(0.0, 0.0);
        assert_eq!(height, 2.5);
        assert_eq!(normal, DVec3::new(-1.5, 1.0, -1.0));
        assert_eq!(field.vertex(1, 1), DVec3::new(1.0, 7.0, 2.0));
    }

    #[test]
    fn bad_sizes_are_refused_with_the_reason() {
        let error = HeightField::new(1, 5, DVec2::ONE, vec![0.0; 5]).unwrap_err();
        assert_eq!(error, "a height field needs at least 2x2 samples, got 1x5");
        assert!(HeightField::new(2, 2, DVec2::ONE, vec![0.0, f32::NAN, 0.0, 0.0]).is_err());
    }
}
