//! Which cells does a shape fill?
//!
//! By itself a mesh, a plane or a height field fills every cell that its surface touches (26-separating: no way leads
//! between, not even over corners); closed bodies fill the cells whose middle is inside, found by interval
//! subdivision; volumes fill the cells where opacity passes half of its greatest. [`Filling`] asks for other cells.

mod body;
mod lines;
mod slab;
mod solid;
mod surface;

#[cfg(test)]
mod tests;

use super::{ConvertError, Filling, VoxelModel, distance, height_mesh, primitive_mesh};
use crate::math::Aabb;
use crate::scene::{FreeForm, Object, Scene, Shape, Voxels};
use crate::seam::{Cancelled, Control};
use glam::{DAffine3, DVec3};
use slab::Slab;
use surface::Surface;
pub(super) use surface::triangle_touches_box;

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
    filling: Filling,
    control: &Control<'_>,
) -> Result<VoxelModel, ConvertError> {
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
    let mut slabs = Slab::all(size);
    let mut why = format!("{}x{}x{} voxels", size[0], size[1], size[2]);
    let on = |mesh| Surface { scene, object, mesh, grid: &grid };
    let is_body = match &*object.shape {
        Shape::Mesh(mesh) => fill_mesh(&on(mesh), filling, &mut slabs, control, &mut why)?,
        Shape::HeightField(field) => {
            let mesh = height_mesh::triangulate(field, 0.0, control)?.0;
            fill_mesh(&on(&mesh), filling, &mut slabs, control, &mut why)?
        }
        Shape::Primitive(primitive) => match FreeForm::from_primitive(primitive) {
            Some(form) => {
                let surface = |p: DVec3, n: DVec3| Some(primitive.uv(p, n));
                body::fill_form(scene, object, form.form(), &grid, &surface, &mut slabs, control)?;
                true
            }
            None => {
                let mesh = primitive_mesh::tessellate(primitive, cell).0;
                fill_mesh(&on(&mesh), filling, &mut slabs, control, &mut why)?
            }
        },
        Shape::FreeForm(form) => {
            body::fill_form(scene, object, form.form(), &grid, &|_, _| None, &mut slabs, control)?;
            true
        }
        Shape::Volume(volume) => {
            control
                .for_each_mut(&mut slabs, 1, &|_, slab| body::fill_volume(volume, &grid, slab, control))?;
            true
        }
        Shape::Voxels(_) => true,
    };
    let (mut bytes, palette) = slab::choose_colors(scene, object, &mut slabs, control)?;
    if is_body && matches!(filling, Filling::Surface | Filling::Thin) {
        bytes = body::hollow(size, &bytes, filling == Filling::Surface, control)?;
        why.push_str(", hollow");
    }
    Ok(VoxelModel {
        voxels: Voxels::from_bytes(size, &bytes),
        palette,
        object_from_voxels: DAffine3::from_translation(grid.first) * DAffine3::from_scale(DVec3::splat(cell)),
        bound: cell * 3f64.sqrt(),
        why,
    })
}

/// Fills cells of a mesh. Tells whether they are a whole body by now.
fn fill_mesh(
    surface: &Surface<'_>,
    filling: Filling,
    slabs: &mut [Slab],
    control: &Control<'_>,
    why: &mut String,
) -> Result<bool, Cancelled> {
    match filling {
        Filling::Natural | Filling::Surface => surface::fill_touched(surface, slabs, control)?,
        Filling::Thin => surface::fill_thinly(surface, slabs, control)?,
        Filling::Solid => {
            solid::fill(surface, slabs, control)?;
            // What encloses nothing is still to be seen.
            let (border, _) = distance::border_edges(surface.mesh, control)?;
            if border > 0 {
                surface::fill_thinly(surface, slabs, control)?;
                let edges = if border == 1 { "edge" } else { "edges" };
                why.push_str(&format!(
                    "; open at {border} {edges}, so that most of six directions tell what is inside"
                ));
            }
        }
    }
    if matches!(filling, Filling::Thin | Filling::Solid) {
        why.push_str("; parts that are thinner than a cell may be missing");
    }
    Ok(false)
}

/// A box of cubic cells in object space.
pub(super) struct Grid {
    pub(super) size: [u32; 3],
    pub(super) cell: f64,
    pub(super) first: DVec3,
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
