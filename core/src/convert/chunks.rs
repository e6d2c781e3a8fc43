//! How many chunks of a grid will hold something? Told from the shape, without filling a cell.

use super::primitive_mesh;
use super::voxelize::{Grid, triangle_touches_box};
use crate::math::Aabb;
use crate::scene::{CHUNK, Form, FreeForm, HeightField, Mesh, Object, Scene, Shape, Volume};
use glam::DVec3;

/// Counts the chunks that a shape takes in a grid, those that are full of one value but once: they are shared.
pub(super) fn taken(scene: &Scene, object: &Object, grid: &Grid) -> u64 {
    let mut chunks = Chunks::of(grid);
    let is_plain = scene.material(object, 0).texture.is_none();
    match &*object.shape {
        Shape::Mesh(mesh) => chunks.take_triangles(mesh),
        Shape::HeightField(field) => chunks.take_heights(field),
        Shape::Volume(volume) => chunks.take_samples(volume),
        Shape::FreeForm(form) => return chunks.take_form(form.form(), is_plain),
        Shape::Primitive(primitive) => match FreeForm::from_primitive(primitive) {
            Some(form) => return chunks.take_form(form.form(), is_plain),
            None => chunks.take_triangles(&primitive_mesh::tessellate(primitive, grid.cell).0),
        },
        Shape::Voxels(_) => chunks.taken.fill(true),
    }
    chunks.taken.iter().filter(|&&taken| taken).count() as u64
}

/// The chunks of a grid, x fastest.
struct Chunks<'a> {
    grid: &'a Grid,
    count: [u32; 3],
    taken: Vec<bool>,
}

impl<'a> Chunks<'a> {
    fn of(grid: &'a Grid) -> Self {
        let count = grid.size.map(|s| s.div_ceil(CHUNK));
        Self { grid, count, taken: vec![false; count.iter().map(|&c| c as usize).product()] }
    }

    fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        ((z * self.count[1] + y) * self.count[0] + x) as usize
    }

    /// Returns the cells of a chunk, from the first to the one behind the last.
    fn cells(&self, index: usize) -> [[u32; 3]; 2] {
        let [nx, ny, _] = self.count.map(|c| c as usize);
        let from = [index % nx, index / nx % ny, index / (nx * ny)].map(|c| c as u32 * CHUNK);
        [from, std::array::from_fn(|a| (from[a] + CHUNK).min(self.grid.size[a]))]
    }

    /// Returns the part of space that some cells take.
    fn space(&self, [from, to]: [[u32; 3]; 2]) -> Aabb {
        Aabb::new(self.grid.corner(from), self.grid.corner(to))
    }

    /// Returns the part of space that the middles of some cells take.
    fn middles(&self, cells: [[u32; 3]; 2]) -> Aabb {
        let (space, half) = (self.space(cells), self.grid.cell * 0.5);
        Aabb::new(space.min + half, space.max - half)
    }

    /// Takes the chunks that a box reaches into and that `touches` confirms.
    fn take(&mut self, bounds: &Aabb, touches: impl Fn(&Aabb) -> bool) {
        let [low, high] = [bounds.min, bounds.max].map(|p| self.grid.clamp_cell(p).map(|c| c / CHUNK));
        let is_one = low == high;
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let index = self.index([x, y, z]);
                    if !self.taken[index] {
                        self.taken[index] = is_one || touches(&self.space(self.cells(index)));
                    }
                }
            }
        }
    }

    fn take_triangles(&mut self, mesh: &Mesh) {
        for t in 0..mesh.triangles.len() {
            let corners = mesh.corners(t).map(glam::Vec3::as_dvec3);
            if corners.iter().all(|p| p.is_finite()) {
                self.take(&Aabb::of_points(corners), |chunk| {
                    triangle_touches_box(corners, chunk.center(), chunk.size() * 0.5)
                });
            }
        }
    }

    fn take_heights(&mut self, field: &HeightField) {
        for row in 0..field.rows() - 1 {
            for column in 0..field.columns() - 1 {
                let corners = [[0, 0], [1, 0], [0, 1], [1, 1]];
                let bounds = Aabb::of_points(corners.map(|[i, j]| field.vertex(column + i, row + j)));
                if bounds.min.is_finite() && bounds.max.is_finite() {
                    self.take(&bounds, |_| true);
                }
            }
        }
    }

    /// Between samples a value is one between theirs: where none around reaches the level, none does; where one does, the
    /// cell that is nearest to it tells.
    fn take_samples(&mut self, volume: &Volume) {
        let level = volume.transfer.surface_value();
        let size = volume.size().map(|s| s as usize);
        let (first, half) = (volume.bounds().min, DVec3::splat(self.grid.cell * 0.5));
        for index in 0..self.taken.len() {
            let [begin, end] = self.cells(index);
            let space = self.space([begin, end]);
            let is_filled = |sample: [usize; 3]| {
                let place = DVec3::from_array(sample.map(|c| c as f64 + 0.5));
                let near = self.grid.clamp_cell(first + place * volume.spacing());
                let cell = std::array::from_fn(|a| near[a].clamp(begin[a], end[a] - 1));
                volume.value(self.grid.corner(cell) + half) >= f64::from(level)
            };
            let is_outside = |form: &FreeForm| form.form().interval(&space).hi < 0.0;
            if volume.shell.as_ref().is_some_and(is_outside) {
                continue;
            }
            let [low, high] = [space.min, space.max].map(|p| volume.grid_from_object(p));
            let from: [usize; 3] = std::array::from_fn(|a| low[a].floor().max(0.0) as usize);
            let to: [usize; 3] =
                std::array::from_fn(|a| (high[a].ceil().max(0.0) as usize).min(size[a].saturating_sub(1)));
            self.taken[index] = (from[2]..=to[2]).any(|z| {
                (from[1]..=to[1]).any(|y| {
                    let row = (z * size[1] + y) * size[0];
                    (from[0]..=to[0]).any(|x| volume.samples().get(row + x) >= level && is_filled([x, y, z]))
                })
            });
        }
    }

    /// Looks for the first cell of each chunk whose middle is inside, as filling does. Returns how many there are.
    fn take_form(&self, form: &Form, is_plain: bool) -> u64 {
        let form = &form.lowered();
        let (mut full, mut rest) = (0, 0);
        for index in 0..self.taken.len() {
            let [from, to] = self.cells(index);
            let is_whole = (0..3).all(|a| to[a] - from[a] == CHUNK);
            if is_plain && is_whole && form.interval(&self.middles([from, to])).lo >= 0.0 {
                full = 1;
            } else if self.any_inside(form, [from, to]) {
                rest += 1;
            }
        }
        rest + full
    }

    fn any_inside(&self, form: &Form, cells: [[u32; 3]; 2]) -> bool {
        let mut stack = vec![cells];
        while let Some([from, to]) = stack.pop() {
            let space = self.space([from, to]);
            let range = form.interval(&space);
            if range.hi < 0.0 {
                continue;
            }
            let longest = (0..3).max_by_key(|&a| to[a] - from[a]).unwrap_or(0);
            // The middle of a block is the middle of one of its cells, or as good as that.
            if range.lo >= 0.0 || (to[longest] - from[longest] == 1 && form.value(space.center()) >= 0.0) {
                return true;
            }
            if to[longest] - from[longest] > 1 {
                let middle = from[longest] + (to[longest] - from[longest]) / 2;
                let (mut left_to, mut right_from) = (to, from);
                left_to[longest] = middle;
                right_from[longest] = middle;
                stack.extend([[right_from, to], [from, left_to]]);
            }
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Filling, voxelize};
    use super::*;
    use crate::scene::{Chunk, Primitive, Samples, TransferFunction, TransferPoint};
    use crate::seam::Control;
    use glam::{DVec2, Vec3};

    /// Counts the chunks that are really taken.
    fn found(scene: &Scene, object: &Object, resolution: u32) -> u64 {
        let voxels = voxelize::voxelize(scene, object, 0.0, resolution, Filling::Natural, &Control::simple())
            .unwrap()
            .voxels;
        let mut full = std::collections::HashSet::new();
        let chunks = voxels.chunks().filter(|chunk| match chunk {
            Chunk::Uniform(value) => *value != 0 && full.insert(*value),
            Chunk::Cells(_) => true,
        });
        chunks.count() as u64
    }

    #[test]
    fn chunks_are_counted_as_they_are_filled() {
        let scene = Scene::default();
        let torus = Primitive::Torus { major: 1.0, minor: 0.2 };
        let ball = Primitive::Sphere { radius: 1.0 };
        let ramp = |i: u32| (i % 40) as f32 * 0.1;
        let heights = HeightField::new(40, 30, DVec2::splat(4.0), (0..1200).map(ramp).collect()).unwrap();
        let density = |i: u32| {
            let cell = [i % 30, i / 30 % 30, i / 900].map(f64::from);
            (10.0 - (DVec3::from_array(cell) - DVec3::new(9.0, 10.0, 11.0)).length()) as f32
        };
        let samples = Samples::F32((0..27_000).map(density).collect());
        let mut cloud = Volume::new([30; 3], DVec3::ONE, samples).unwrap();
        let point = |value: f32, opacity: f32| TransferPoint { value, color: Vec3::ONE, opacity };
        cloud.transfer =
            TransferFunction { points: vec![point(0.0, 0.0), point(5.0, 1.0)], reference_length: 1.0 };
        for (shape, resolution) in [
            (Shape::Mesh(primitive_mesh::tessellate(&torus, 0.01).0), 300),
            (Shape::Primitive(torus), 300),
            (Shape::Primitive(ball), 400),
            (Shape::Primitive(Primitive::Box { size: DVec3::new(3.0, 2.0, 1.0) }), 200),
            (Shape::HeightField(heights), 250),
            (Shape::Volume(cloud), 250),
        ] {
            let object = Object::new("thing", shape, 0);
            let (size, cell) = voxelize::grid_size(&object.shape.bounds(), 0.0, resolution);
            let grid = Grid::around(&object.shape.bounds(), size, cell);
            let all = size.map(|s| u64::from(s.div_ceil(CHUNK))).iter().product::<u64>();
            let (told, found) = (taken(&scene, &object, &grid), found(&scene, &object, resolution));
            assert_eq!(told, found, "{:?} in {all} chunks", object.shape.kind());
        }
    }
}
