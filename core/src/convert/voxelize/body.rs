//! Which cells have their middle in a body that is told by a formula or by samples, and which of them are its skin?

use super::Grid;
use super::slab::Slab;
use crate::math::Aabb;
use crate::scene::{Form, Object, Scene, Volume};
use crate::seam::{Cancelled, Control};
use glam::{DVec3, Vec3};

/// Texture coordinates of a point of the surface with its normal, where the shape has any.
pub(super) type UvAt<'a> = dyn Fn(DVec3, DVec3) -> Option<[f32; 2]> + Sync + 'a;

/// Fills the cells whose middle is in a form, by halving boxes that bounds of its values do not tell about.
pub(super) fn fill_form(
    scene: &Scene,
    object: &Object,
    form: &Form,
    grid: &Grid,
    uv: &UvAt<'_>,
    slabs: &mut [Slab],
    control: &Control<'_>,
) -> Result<(), Cancelled> {
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
    control.for_each_mut(slabs, 1, &|_, slab| {
        let mut stack = vec![([0, 0, slab.from], [grid.size[0], grid.size[1], slab.to])];
        while let Some((from, to)) = stack.pop() {
            if control.is_cancelled() {
                return;
            }
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
                fill_box(slab, from, to, &color_of, control);
            }
        }
    })
}

fn fill_box(
    slab: &mut Slab,
    from: [u32; 3],
    to: [u32; 3],
    color_of: &impl Fn([u32; 3]) -> Vec3,
    control: &Control<'_>,
) {
    for z in from[2]..to[2] {
        for y in from[1]..to[1] {
            if control.is_cancelled() {
                return;
            }
            for x in from[0]..to[0] {
                slab.fill([x, y, z], 0, color_of([x, y, z]));
            }
        }
    }
}

/// Fills the cells in whose middle a volume is as opaque as at its surface.
pub(super) fn fill_volume(volume: &Volume, grid: &Grid, slab: &mut Slab, control: &Control<'_>) {
    let level = f64::from(volume.transfer.surface_value());
    for z in slab.from..slab.to {
        for y in 0..grid.size[1] {
            if control.is_cancelled() {
                return;
            }
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

/// Empties the cells that have no empty neighbor: over a face, or over an edge or a corner, too.
pub(super) fn hollow(
    size: [u32; 3],
    bytes: &[u8],
    corners: bool,
    control: &Control<'_>,
) -> Result<Vec<u8>, Cancelled> {
    let [nx, ny, nz] = size.map(|s| s as usize);
    let steps: Vec<[isize; 3]> = (0..27)
        .map(|k: isize| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1])
        .filter(|s| corners || s.iter().map(|c| c.abs()).sum::<isize>() == 1)
        .collect();
    let is_empty = |cell: [usize; 3], step: &[isize; 3]| {
        let at = |a: usize| cell[a].checked_add_signed(step[a]).filter(|&c| c < [nx, ny, nz][a]);
        let (Some(x), Some(y), Some(z)) = (at(0), at(1), at(2)) else { return true };
        bytes[(z * ny + y) * nx + x] == 0
    };
    let mut skin = vec![0u8; bytes.len()];
    let mut rows: Vec<&mut [u8]> = skin.chunks_mut(nx).collect();
    control.for_each_mut(&mut rows, 8, &|row, cells| {
        for (x, byte) in cells.iter_mut().enumerate() {
            let value = bytes[row * nx + x];
            if value != 0 && steps.iter().any(|step| is_empty([x, row % ny, row / ny], step)) {
                *byte = value;
            }
        }
    })?;
    Ok(skin)
}
