//! Which tiles of a picture does something touch?

/// Columns of a tile.
pub(crate) const TILE_WIDTH: u32 = 64;
/// Rows of a tile: those of a band, so that a band is a row of tiles.
pub(crate) const TILE_HEIGHT: u32 = 16;
/// Pixels of a tile.
pub(crate) const TILE_PIXELS: usize = (TILE_WIDTH * TILE_HEIGHT) as usize;

/// The tiles of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TileGrid {
    width: u32,
    height: u32,
    pub(crate) columns: u32,
    pub(crate) rows: u32,
    /// Pixels around boxes that count as touched, too.
    margin: i32,
}

/// The place of a tile in the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TileArea {
    pub(crate) x: i32,
    pub(crate) y: i32,
    pub(crate) width: i32,
    pub(crate) height: i32,
}

/// What lies in a box of pixels.
pub(crate) trait Placed {
    /// Returns the first and last column and row that it can cover; maybe none.
    fn pixels(&self) -> ([i32; 2], [i32; 2]);

    /// Tells whether it may cover pixels of a box that it was found to reach into; asked where it reaches into many.
    fn may_cover(&self, columns: [i32; 2], rows: [i32; 2]) -> bool;
}

impl TileGrid {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let (columns, rows) = (width.div_ceil(TILE_WIDTH), height.div_ceil(TILE_HEIGHT));
        Self { width, height, columns, rows, margin: 0 }
    }

    /// Returns the grid for triangles that are looked at from other places than the pixels' centers.
    pub(crate) fn smooth(self, smooth: bool) -> Self {
        Self { margin: i32::from(smooth), ..self }
    }

    pub(crate) fn count(&self) -> usize {
        self.columns as usize * self.rows as usize
    }

    pub(crate) fn area(&self, tile: usize) -> TileArea {
        let (column, row) = (tile as u32 % self.columns, tile as u32 / self.columns);
        let (x, y) = (column * TILE_WIDTH, row * TILE_HEIGHT);
        TileArea {
            x: x as i32,
            y: y as i32,
            width: TILE_WIDTH.min(self.width - x) as i32,
            height: TILE_HEIGHT.min(self.height - y) as i32,
        }
    }

    /// Calls `touch` for the tiles under a box.
    pub(crate) fn for_each_touched(&self, record: &impl Placed, mut touch: impl FnMut(usize)) {
        let ([x0, x1], [y0, y1]) = record.pixels();
        let m = self.margin;
        let (x0, x1) = ((x0 - m).max(0), (x1 + m).min(self.width as i32 - 1));
        let (y0, y1) = ((y0 - m).max(0), (y1 + m).min(self.height as i32 - 1));
        if x0 > x1 || y0 > y1 {
            return;
        }
        let (rows, columns) = (
            y0 as u32 / TILE_HEIGHT..=y1 as u32 / TILE_HEIGHT,
            x0 as u32 / TILE_WIDTH..=x1 as u32 / TILE_WIDTH,
        );
        let is_one_line = columns.start() == columns.end() || rows.start() == rows.end();
        for row in rows {
            for column in columns.clone() {
                let tile = (row * self.columns + column) as usize;
                if is_one_line || self.may_touch(record, tile) {
                    touch(tile);
                }
            }
        }
    }
}

impl TileGrid {
    fn may_touch(&self, record: &impl Placed, tile: usize) -> bool {
        let (area, m) = (self.area(tile), self.margin);
        let columns = [area.x - m, area.x + area.width - 1 + m];
        record.may_cover(columns, [area.y - m, area.y + area.height - 1 + m])
    }
}
