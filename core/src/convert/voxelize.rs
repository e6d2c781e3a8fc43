//! Which cells does a shape fill?
//!
//! Meshes, planes and height fields fill every cell that their surface touches (26-separating: no ray passes
//! between); closed bodies fill the cells whose middle is inside, found by interval subdivision; volumes fill
//! the cells where opacity passes half of its greatest.

use super::palette::{ColorCollector, ColorKey, triangle_color};
use super::{VoxelModel, height_mesh, primitive_mesh};
use crate::math::Aabb;
use crate::parallel::{Threads, for_each_mut};
use crate::scene::{Form, FreeForm, Material, Mesh, Object, Scene, Shape, Volume, Voxels};
use glam::{DAffine3, DVec3, Vec3};
use std::collections::HashMap;

/// Returns the number of cells along each axis and their edge: the diagonal of a cell is the bound.
pub(super) fn grid_size(bounds: &Aabb, tolerance: f64, max_resolution: u32) -> ([u32; 3], f64) {
    let longest = bounds.size().max_element().max(1e-300);
    let wanted = longest / (tolerance / 3f64.sqrt()).max(1e-300);
    let resolution = wanted.ceil().clamp(1.0, f64::from(max_resolution.max(1)));
    // A little margin keeps surfaces that lie in the box's faces within the grid.
    let cell = longest / resolution * (1.0 + 1e-6);
    let size = bounds.size().to_array().map(|edge| ((edge / cell).ceil() as u32).max(1));
    (size, cell)
}

pub(super) fn voxelize(
    scene: &Scene,
    object: &Object,
    tolerance: f64,
    max_resolution: u32,
    threads: &dyn Threads,
) -> Result<VoxelModel, String> {
    let bounds = object.shape.bounds();
    if let Shape::Voxels(voxels) = &*object.shape {
        return Ok(VoxelModel {
            voxels: voxels.clone(),
            palette: (0..255).map(|slot| scene.material(object, slot).clone()).collect(),
            object_from_voxels: DAffine3::IDENTITY,
            bound: 0.0,
            why: "voxels as given".to_owned(),
        });
    }
    let (size, cell) = grid_size(&bounds, tolerance, max_resolution);
    let grid = Grid::around(&bounds, size, cell);
    let mut slabs: Vec<Slab> = (0..size[2]).step_by(SLAB as usize).map(|z| Slab::new(size, z)).collect();
    match &*object.shape {
        Shape::Mesh(mesh) => fill_mesh(scene, object, mesh, &grid, &mut slabs, threads),
        Shape::HeightField(field) => {
            let mesh = height_mesh::triangulate(field, 0.0).0;
            fill_mesh(scene, object, &mesh, &grid, &mut slabs, threads);
        }
        Shape::Primitive(primitive) => match FreeForm::from_primitive(primitive) {
            Some(form) => {
                let surface = |p: DVec3, n: DVec3| Some(primitive.uv(p, n));
                fill_form(scene, object, form.form(), &grid, &surface, &mut slabs, threads);
            }
            None => {
                let mesh = primitive_mesh::tessellate(primitive, cell).0;
                fill_mesh(scene, object, &mesh, &grid, &mut slabs, threads);
            }
        },
        Shape::FreeForm(form) => {
            fill_form(scene, object, form.form(), &grid, &|_, _| None, &mut slabs, threads);
        }
        Shape::Volume(volume) => {
            for_each_mut(threads, &mut slabs, 1, &|_, slab| fill_volume(volume, &grid, slab));
        }
        Shape::Voxels(_) => {}
    }
    let (bytes, palette) = choose_colors(scene, object, &mut slabs, threads)?;
    let [x, y, z] = size;
    Ok(VoxelModel {
        voxels: Voxels::from_bytes(size, &bytes),
        palette,
        object_from_voxels: DAffine3::from_translation(grid.first) * DAffine3::from_scale(DVec3::splat(cell)),
        bound: cell * 3f64.sqrt(),
        why: format!("{x}x{y}x{z} voxels"),
    })
}

/// Chooses a palette for all slabs together, in their order whoever filled them, and writes the bytes.
fn choose_colors(
    scene: &Scene,
    object: &Object,
    slabs: &mut [Slab],
    threads: &dyn Threads,
) -> Result<(Vec<u8>, Vec<Material>), String> {
    let mut colors = ColorCollector::default();
    for slab in &mut *slabs {
        slab.flush();
        colors.merge(&slab.colors);
    }
    if slabs.iter().all(|slab| slab.keys.is_empty()) {
        return Err("it fills no voxel: it is empty or thinner than a cell".to_owned());
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
    for_each_mut(threads, &mut parts, 1, &|_, (bytes, slab)| {
        let byte_of: Vec<u8> =
            std::iter::once(0).chain(slab.keys.iter().map(|&key| palette.byte(key))).collect();
        for (byte, &number) in bytes.iter_mut().zip(&slab.cells) {
            *byte = byte_of[number as usize];
        }
    });
    Ok((bytes, palette.materials))
}

/// A box of cubic cells in object space.
pub(super) struct Grid {
    pub(super) size: [u32; 3],
    pub(super) cell: f64,
    first: DVec3,
}

impl Grid {
    /// Lays cells around a box, as much over on either side.
    pub(super) fn around(bounds: &Aabb, size: [u32; 3], cell: f64) -> Self {
        let covered = DVec3::from_array(size.map(f64::from)) * cell;
        Self { size, cell, first: bounds.center() - covered * 0.5 }
    }

    pub(super) fn corner(&self, cell: [u32; 3]) -> DVec3 {
        self.first + DVec3::from_array(cell.map(f64::from)) * self.cell
    }

    pub(super) fn clamp_cell(&self, p: DVec3) -> [u32; 3] {
        let c = ((p - self.first) / self.cell).floor();
        std::array::from_fn(|a| c[a].clamp(0.0, f64::from(self.size[a] - 1)) as u32)
    }
}

/// Layers of cells that are filled by one thread. Their borders do not depend on the number of threads.
const SLAB: u32 = 8;

/// Some layers of cells with their colors; a cell named again keeps its last color.
struct Slab {
    size: [u32; 3],
    from: u32,
    to: u32,
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

    fn index(&self, [x, y, z]: [u32; 3]) -> usize {
        ((z - self.from) as usize * self.size[1] as usize + y as usize) * self.size[0] as usize + x as usize
    }

    fn fill(&mut self, cell: [u32; 3], slot: u16, color: Vec3) {
        let index = self.index(cell);
        self.cells[index] = self.number(slot, color);
    }

    /// Notes a color and returns its number.
    fn number(&mut self, slot: u16, color: Vec3) -> u32 {
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

    /// Notes the color that was counted last.
    fn flush(&mut self) {
        if let Some(last) = self.last.take() {
            self.colors.note(last.key, last.color * last.count as f32, last.count);
        }
    }
}

fn fill_mesh(
    scene: &Scene,
    object: &Object,
    mesh: &Mesh,
    grid: &Grid,
    slabs: &mut [Slab],
    threads: &dyn Threads,
) {
    // Which triangles reach into each slab, in their order.
    let mut reaching: Vec<(&mut Slab, Vec<u32>)> = slabs.iter_mut().map(|slab| (slab, Vec::new())).collect();
    for t in 0..mesh.triangles.len() {
        let corners = mesh.corners(t).map(glam::Vec3::as_dvec3);
        if corners.iter().all(|p| p.is_finite()) {
            let box_ = Aabb::of_points(corners);
            let (low, high) = (grid.clamp_cell(box_.min)[2], grid.clamp_cell(box_.max)[2]);
            for (_, triangles) in &mut reaching[(low / SLAB) as usize..=(high / SLAB) as usize] {
                triangles.push(t as u32);
            }
        }
    }
    for_each_mut(threads, &mut reaching, 1, &|_, (slab, triangles)| {
        for &t in &*triangles {
            fill_triangle(scene, object, mesh, t as usize, grid, slab);
        }
    });
}

/// Fills the cells of a slab that a triangle touches.
fn fill_triangle(scene: &Scene, object: &Object, mesh: &Mesh, t: usize, grid: &Grid, slab: &mut Slab) {
    let half = DVec3::splat(grid.cell * 0.5);
    let corners = mesh.corners(t).map(glam::Vec3::as_dvec3);
    let box_ = Aabb::of_points(corners);
    let (low, high) = (grid.clamp_cell(box_.min), grid.clamp_cell(box_.max));
    for z in low[2].max(slab.from)..=high[2].min(slab.to - 1) {
        for y in low[1]..=high[1] {
            for x in low[0]..=high[0] {
                let middle = grid.corner([x, y, z]) + half;
                if !triangle_touches_box(corners, middle, half) {
                    continue;
                }
                let weights = super::distance::closest_weights(corners, middle).as_vec3();
                if let Some(color) = triangle_color(scene, object, mesh, t, weights) {
                    slab.fill([x, y, z], mesh.slot(t) as u16, color);
                }
            }
        }
    }
}

/// Tells whether a triangle and a box share a point.
///
/// Source: T. Akenine-Möller, *Fast 3D triangle-box overlap testing*, JGT 6(1), 2001 (separating axes).
pub(super) fn triangle_touches_box(corners: [DVec3; 3], middle: DVec3, half: DVec3) -> bool {
    let [a, b, c] = corners.map(|p| p - middle);
    let edges = [b - a, c - b, a - c];
    let separated = |axis: DVec3| {
        let p = [a.dot(axis), b.dot(axis), c.dot(axis)];
        let reach = half.dot(axis.abs()) * (1.0 + 1e-12);
        p[0].min(p[1]).min(p[2]) > reach || p[0].max(p[1]).max(p[2]) < -reach
    };
    let axes = [DVec3::X, DVec3::Y, DVec3::Z];
    !(axes.iter().any(|&x| separated(x))
        || separated(edges[0].cross(edges[1]))
        || edges.iter().any(|e| axes.iter().any(|x| separated(x.cross(*e)))))
}

/// Texture coordinates of a point of the surface with its normal, where the shape has any.
type UvAt<'a> = dyn Fn(DVec3, DVec3) -> Option<[f32; 2]> + Sync + 'a;

fn fill_form(
    scene: &Scene,
    object: &Object,
    form: &Form,
    grid: &Grid,
    uv: &UvAt<'_>,
    slabs: &mut [Slab],
    threads: &dyn Threads,
) {
    let form = &form.lowered();
    let material = scene.material(object, 0);
    let color_of = |cell: [u32; 3]| {
        // One color for all cells, unless a texture says otherwise.
        if material.texture.is_none() {
            return material.base_color;
        }
        let p = grid.corner(cell) + grid.cell * 0.5;
        let n = -form.value_and_gradient(p).1.normalize_or(DVec3::Y);
        scene.base_color(material, uv(p, n), p.as_vec3(), n.as_vec3(), 0.0).0
    };
    for_each_mut(threads, slabs, 1, &|_, slab| {
        let mut stack = vec![([0, 0, slab.from], [grid.size[0], grid.size[1], slab.to])];
        while let Some((from, to)) = stack.pop() {
            let box_ = Aabb::new(grid.corner(from), grid.corner(to));
            let range = form.interval(&box_);
            if range.hi < 0.0 {
                continue;
            }
            let longest = (0..3).max_by_key(|&a| to[a] - from[a]).unwrap_or(0);
            let solid = range.lo >= 0.0;
            if !solid && to[longest] - from[longest] > 1 {
                let middle = from[longest] + (to[longest] - from[longest]) / 2;
                let (mut left_to, mut right_from) = (to, from);
                left_to[longest] = middle;
                right_from[longest] = middle;
                stack.extend([(right_from, to), (from, left_to)]);
                continue;
            }
            if solid || form.value(box_.center()) >= 0.0 {
                fill_box(slab, from, to, &color_of);
            }
        }
    });
}

fn fill_box(slab: &mut Slab, from: [u32; 3], to: [u32; 3], color_of: &impl Fn([u32; 3]) -> Vec3) {
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            for x in from[0]..to[0] {
                slab.fill([x, y, z], 0, color_of([x, y, z]));
            }
        }
    }
}

fn fill_volume(volume: &Volume, grid: &Grid, slab: &mut Slab) {
    let level = f64::from(volume.transfer.surface_value());
    for z in slab.from..slab.to {
        for y in 0..grid.size[1] {
            for x in 0..grid.size[0] {
                let p = grid.corner([x, y, z]) + grid.cell * 0.5;
                let value = volume.value(p);
                let in_shell = volume.shell.as_ref().is_none_or(|s| s.form().value(p) >= 0.0);
                if value >= level && in_shell {
                    slab.fill([x, y, z], 0, volume.transfer.at(value as f32).0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::{OneThread, Pool};
    use crate::scene::Primitive;

    fn scene() -> Scene {
        let mut scene = Scene::default();
        scene.add_material(Material::default());
        scene
    }

    #[test]
    fn the_volume_of_a_ball_converges_to_the_closed_form() {
        let object = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0);
        let exact = 4.0 / 3.0 * std::f64::consts::PI;
        for resolution in [32, 64, 128] {
            let model = voxelize(&scene(), &object, 0.0, resolution, &OneThread).unwrap();
            let cell = model.bound / 3f64.sqrt();
            let error = (model.voxels.filled() as f64 * cell.powi(3) - exact).abs();
            // First order in the cell, with a constant far below the area's 4 pi.
            assert!(error < 0.5 * cell, "{resolution}: {error}");
        }
    }

    #[test]
    fn a_meshed_shell_stops_every_flood() {
        let (mesh, _) = primitive_mesh::tessellate(&Primitive::Sphere { radius: 1.0 }, 0.01);
        let object = Object::new("shell", Shape::Mesh(mesh), 0);
        let voxels = voxelize(&scene(), &object, 0.0, 40, &OneThread).unwrap().voxels;
        let size = voxels.size();
        // Flood from the middle through faces, edges and corners; it must not reach the border.
        let mut seen = std::collections::HashSet::from([size.map(|s| s as i64 / 2)]);
        let mut queue: Vec<[i64; 3]> = seen.iter().copied().collect();
        while let Some(cell) = queue.pop() {
            for k in 0..27 {
                let next = [cell[0] + k % 3 - 1, cell[1] + k / 3 % 3 - 1, cell[2] + k / 9 - 1];
                let inside = (0..3).all(|a| next[a] >= 0 && next[a] < i64::from(size[a]));
                assert!(inside, "the flood reached the border at {next:?}");
                if voxels.get(next[0] as u32, next[1] as u32, next[2] as u32) == 0 && seen.insert(next) {
                    queue.push(next);
                }
            }
        }
    }

    #[test]
    fn turned_triangle_order_fills_the_same_cells() {
        let (mut mesh, _) = primitive_mesh::tessellate(&Primitive::Torus { major: 1.0, minor: 0.3 }, 0.02);
        let cells = |mesh: &Mesh| {
            let object = Object::new("torus", Shape::Mesh(mesh.clone()), 0);
            let voxels = voxelize(&scene(), &object, 0.0, 50, &OneThread).unwrap().voxels;
            let mut list = Vec::new();
            voxels.for_each_filled(|cell, _| list.push(cell));
            list
        };
        let before = cells(&mesh);
        mesh.triangles.reverse();
        for t in &mut mesh.triangles {
            t.rotate_left(1);
        }
        assert_eq!(before, cells(&mesh));
    }

    #[test]
    fn any_number_of_threads_fills_the_same_bytes() {
        let (torus, _) = primitive_mesh::tessellate(&Primitive::Torus { major: 1.0, minor: 0.3 }, 0.02);
        let ball = Primitive::Sphere { radius: 1.0 };
        for shape in [Shape::Mesh(torus), Shape::Primitive(ball)] {
            let mut scene = scene();
            let halves = [255, 0, 0, 255, 0, 0, 255, 255];
            scene.textures.push(crate::scene::Texture::from_srgb8("halves", 2, 1, &halves).into());
            scene.materials[0].texture = Some(0);
            let object = Object::new("thing", shape, 0);
            let fill = |threads: &dyn Threads| {
                let model = voxelize(&scene, &object, 0.0, 45, threads).unwrap();
                let mut cells = Vec::new();
                model.voxels.for_each_filled(|cell, byte| cells.push((cell, byte)));
                (cells, model.palette)
            };
            let alone = fill(&OneThread);
            assert!(alone.1.len() > 1 && fill(&Pool::new(3).unwrap()) == alone);
        }
    }
}
