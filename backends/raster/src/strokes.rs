//! Where do lines run over the picture, and which of their pixels does nothing hide?
//!
//! A line is one pixel wide and fades over the next: a pixel takes the share `1 - d` of it, `d` being the distance of
//! its center from the line in pixels. Nothing is compared with stored depths. What hides a pixel of a line is the
//! plane of the triangle that is seen there, held against the line's own point; next to the end of a line the triangles
//! around that corner hide nothing of it. So edges need no offset towards the eye.

use crate::bin::{Bin, PIECE, run_of, runs_for};
use crate::face::Faces;
use crate::grid::{Placed, TILE_PIXELS, TILE_WIDTH, TileArea, TileGrid};
use crate::lens::{GUARD, Homogeneous, Lens};
use crate::lines::{Edge, Lines};
use crate::model::{Model, Part};
use crate::tile::NO_TRIANGLE;
use crate::transform::{PartOnScreen, ScreenVertices, border};
use glam::DVec2;
use polyptych_core::seam::{Cancelled, Control};
use std::sync::atomic::AtomicU32;

/// How far from a line pixels show something of it.
const REACH: f64 = 1.0;
/// How near to the end of a line, in pixels, triangles with a corner there hide nothing of it.
const AROUND_CORNER: f64 = 1.5;
/// Share of its distance by which a line may lie behind a plane and be seen.
const BEHIND: f64 = 1e-5;

/// A line on the picture.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stroke {
    from: DVec2,
    /// Unit vector.
    along: DVec2,
    length: f64,
    /// At both ends; linear between them.
    depth: [f64; 2],
    part: u32,
    /// Index among the lines of its part.
    edge: u32,
}

/// The lines of a picture by tile.
#[derive(Default)]
pub(crate) struct Strokes {
    runs: Vec<Bin<Stroke>>,
    used: usize,
    /// The triangles that the picture shows, row by row, where surfaces hide: written tile by tile.
    pub(crate) seen: Vec<AtomicU32>,
}

/// What strokes leave on the pixels of a tile.
pub(crate) struct Ink {
    /// Shares; 0 for no stroke.
    pub(crate) share: [f32; TILE_PIXELS],
    pub(crate) part: [u32; TILE_PIXELS],
    edge: [u32; TILE_PIXELS],
    /// Distance ahead.
    pub(crate) ahead: [f64; TILE_PIXELS],
}

impl Placed for Stroke {
    fn pixels(&self) -> ([i32; 2], [i32; 2]) {
        let to = self.from + self.along * self.length;
        let range = |a: f64, b: f64| {
            [(a.min(b) - REACH - 0.5).ceil() as i32, (a.max(b) + REACH - 0.5).floor() as i32]
        };
        (range(self.from.x, to.x), range(self.from.y, to.y))
    }

    fn may_cover(&self, _columns: [i32; 2], _rows: [i32; 2]) -> bool {
        true
    }
}

impl Strokes {
    /// Puts all lines of a model onto the picture.
    pub(crate) fn fill(
        &mut self,
        lines: &Lines,
        model: &Model,
        lens: &Lens,
        vertices: &[ScreenVertices],
        (culls_back, hides): (bool, bool),
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        if hides {
            self.seen.resize_with(lens.width as usize * lens.height as usize, AtomicU32::default);
        }
        let grid = TileGrid::new(lens.width, lens.height);
        self.used = runs_for(lines.count(), control);
        if self.runs.len() < self.used {
            self.runs.resize_with(self.used, Bin::default);
        }
        let used = self.used;
        control.for_each_mut(&mut self.runs[..used], 1, &|i, run| {
            run.clear(&grid);
            let of_run = run_of(lines.count(), i, used);
            let mut first = 0;
            for (index, part) in model.parts.iter().enumerate() {
                let edges = lines.of_part(index);
                let local =
                    of_run.start.max(first) - first..of_run.end.clamp(first, first + edges.len()) - first;
                let vertices = PartOnScreen::of(vertices, part);
                for (k, edge) in edges.get(local.clone()).unwrap_or(&[]).iter().enumerate() {
                    if k % PIECE == 0 && control.is_cancelled() {
                        return;
                    }
                    if culls_back && looks_away(part, edge, lens) {
                        continue;
                    }
                    if let Some([a, b]) = ends(lens, part, edge, vertices) {
                        let id = [index as u32, (local.start + k) as u32];
                        if let Some(stroke) = Stroke::between(a, b, id) {
                            run.add(&grid, stroke);
                        }
                    }
                }
                first += edges.len();
            }
        })
    }

    fn of_tile(&self, tile: usize) -> impl Iterator<Item = &Stroke> {
        self.runs[..self.used].iter().flat_map(move |run| run.of_tile(tile))
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.runs.iter().map(Bin::bytes).sum::<u64>() + self.seen.capacity() as u64 * 4
    }

    /// Draws the lines of a tile that its visible triangles do not hide. Tells whether there are any; the memory is
    /// kept from tile to tile.
    pub(crate) fn draw(
        &self,
        tile: usize,
        area: &TileArea,
        seen: &[u32; TILE_PIXELS],
        (model, lens, lines): (&Model, &Lens, &Lines),
        faces: &mut Faces,
        ink: &mut Option<Box<Ink>>,
    ) -> bool {
        let mut begun = false;
        for stroke in self.of_tile(tile) {
            let edge = &lines.of_part(stroke.part as usize)[stroke.edge as usize];
            stroke.for_each_pixel(area, |pixel, share, at, depth| {
                let ahead = lens.ahead(depth);
                let ink = ink.get_or_insert_with(Ink::none);
                if !std::mem::replace(&mut begun, true) {
                    ink.share.fill(0.0);
                }
                if ink.has_better(pixel, share, stroke) {
                    return;
                }
                let mut hides = |id: u32| {
                    let face = faces.find(model, lens, id);
                    let face = &faces.faces[usize::from(face)];
                    face.ahead(lens, at.x, at.y) < ahead * (1.0 - BEHIND)
                        && !stroke.ends_near(at, edge).any(|end| touches(model, id, stroke.part, end))
                };
                let id = seen[pixel];
                if id == NO_TRIANGLE || !hides(id) {
                    ink.put(pixel, share, stroke, ahead);
                }
            });
        }
        begun
    }
}

impl Stroke {
    fn between(a: (DVec2, f64), b: (DVec2, f64), [part, edge]: [u32; 2]) -> Option<Self> {
        let length = a.0.distance(b.0);
        let along = if length > 0.0 { (b.0 - a.0) / length } else { DVec2::X };
        let stroke = Self { from: a.0, along, length, depth: [a.1, b.1], part, edge };
        length.is_finite().then_some(stroke)
    }

    /// Lists the vertices at the ends of the line that are near a point of it.
    fn ends_near(&self, at: DVec2, edge: &Edge) -> impl Iterator<Item = u32> {
        let t = (at - self.from).dot(self.along);
        let near = [t < AROUND_CORNER, t > self.length - AROUND_CORNER];
        edge.ends.into_iter().zip(near).filter_map(|(end, near)| near.then_some(end))
    }

    /// Calls `visit` for all pixels of a tile near the line, with the share they take of it, and the nearest point of
    /// the line and its depth.
    fn for_each_pixel(&self, area: &TileArea, mut visit: impl FnMut(usize, f32, DVec2, f64)) {
        let ([x0, x1], [y0, y1]) = self.pixels();
        let (x0, x1) = (x0.max(area.x), x1.min(area.x + area.width - 1));
        let (y0, y1) = (y0.max(area.y), y1.min(area.y + area.height - 1));
        for y in y0..=y1 {
            let down = f64::from(y) + 0.5 - self.from.y;
            // The line's neighborhood is a slanted band: where does this row cross it?
            let (mut first, mut last) = (x0, x1);
            if self.along.y.abs() > 1e-3 {
                let middle = self.from.x + down * self.along.x / self.along.y;
                let half = REACH / self.along.y.abs();
                first = first.max((middle - half - 0.5).ceil() as i32);
                last = last.min((middle + half - 0.5).floor() as i32);
            }
            for x in first..=last {
                let center = DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5);
                let t = (center - self.from).dot(self.along).clamp(0.0, self.length);
                let at = self.from + self.along * t;
                let share = (REACH - center.distance(at)) as f32;
                if share > 0.0 {
                    let depth =
                        self.depth[0] + (self.depth[1] - self.depth[0]) * (t / self.length.max(1e-300));
                    visit(((y - area.y) * TILE_WIDTH as i32 + x - area.x) as usize, share, at, depth);
                }
            }
        }
    }
}

impl Ink {
    fn none() -> Box<Self> {
        Box::new(Self {
            share: [0.0; TILE_PIXELS],
            part: [0; TILE_PIXELS],
            edge: [0; TILE_PIXELS],
            ahead: [0.0; TILE_PIXELS],
        })
    }

    /// Tells whether a pixel has a stroke that goes before another: the larger share, then the lower line.
    fn has_better(&self, pixel: usize, share: f32, stroke: &Stroke) -> bool {
        let own = self.share[pixel];
        own > share || (own == share && (self.part[pixel], self.edge[pixel]) <= (stroke.part, stroke.edge))
    }

    fn put(&mut self, pixel: usize, share: f32, stroke: &Stroke, ahead: f64) {
        self.share[pixel] = share;
        (self.part[pixel], self.edge[pixel]) = (stroke.part, stroke.edge);
        self.ahead[pixel] = ahead;
    }

    /// Returns the slot whose material colors the stroke of a pixel.
    pub(crate) fn slot(&self, pixel: usize, model: &Model, lines: &Lines) -> usize {
        let part = self.part[pixel] as usize;
        let side = lines.of_part(part)[self.edge[pixel] as usize].sides[0];
        if side == NO_TRIANGLE { 0 } else { model.parts[part].mesh().slot(side as usize) }
    }
}

/// Tells whether a triangle has a corner at a vertex of a part.
fn touches(model: &Model, id: u32, part: u32, vertex: u32) -> bool {
    let (index, triangle) = model.find(id);
    if index != part as usize {
        return false;
    }
    let mesh = model.parts[index].mesh();
    mesh.corners(triangle).contains(&mesh.positions[vertex as usize])
}

/// Tells whether all faces at an edge look away from the eye.
fn looks_away(part: &Part, edge: &Edge, lens: &Lens) -> bool {
    let mut sides = edge.sides.iter().filter(|&&side| side != NO_TRIANGLE).peekable();
    sides.peek().is_some()
        && sides.all(|&side| {
            let [a, b, c] = part.corners(side as usize, lens.origin);
            let normal = (b - a).cross(c - a);
            (lens.sees_front(normal, a)) == part.mirrored
        })
}

/// Returns the ends of a line on the picture with their depths, clipped.
fn ends(lens: &Lens, part: &Part, edge: &Edge, vertices: PartOnScreen<'_>) -> Option<[(DVec2, f64); 2]> {
    let [(_, _, a), (_, _, b)] = edge.ends.map(|i| vertices.snapped(i));
    let (all, any) = (a & b, a | b);
    if any & border::NOWHERE != 0 || all & border::HIDING != 0 {
        return None;
    }
    if any & border::CLIPPING == 0 {
        let point = edge.ends.map(|i| vertices.point(i));
        return Some(point.map(|p| (DVec2::new(p.x, p.y), p.depth)));
    }
    let screen_from_object = lens.for_object(&part.world_from_object);
    let place = |i: u32| screen_from_object.apply(part.mesh().positions[i as usize].as_dvec3());
    let [a, b] = edge.ends.map(place);
    let (right, bottom) = (f64::from(lens.width) + GUARD, f64::from(lens.height) + GUARD);
    let distances = |h: &Homogeneous| {
        let w = lens.divisor(h.ahead);
        [h.ahead - lens.near, h.x + GUARD * w, right * w - h.x, h.y + GUARD * w, bottom * w - h.y]
    };
    // The part of the way from one end to the other that lies within all borders.
    let (mut begin, mut end) = (0.0f64, 1.0f64);
    for (da, db) in distances(&a).into_iter().zip(distances(&b)) {
        if da < 0.0 && db < 0.0 {
            return None;
        }
        let t = da / (da - db);
        if da < 0.0 {
            begin = begin.max(t);
        } else if db < 0.0 {
            end = end.min(t);
        }
    }
    let point = |t: f64| {
        let mix = |a: f64, b: f64| a + (b - a) * t;
        let ahead = mix(a.ahead, b.ahead).max(lens.near);
        let w = lens.divisor(ahead);
        (DVec2::new(mix(a.x, b.x) / w, mix(a.y, b.y) / w), lens.depth(ahead))
    };
    (begin < end).then(|| [point(begin), point(end)])
}
