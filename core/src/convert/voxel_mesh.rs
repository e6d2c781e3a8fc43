//! Which faces of a voxel grid can be seen?

use super::MeshSize;
use crate::scene::{Mesh, Voxels};
use crate::seam::{Cancelled, Control};
use glam::Vec3;
use std::collections::HashMap;

/// Returns two triangles for every face between a filled cell and one that can be looked through.
///
/// Faces are not merged: large rectangles would meet corners of small ones along their edges, and such
/// T-junctions leave cracks in a rasterizer.
pub(super) fn exposed_faces(
    voxels: &Voxels,
    clear: &[bool; 256],
    control: &Control<'_>,
) -> Result<Mesh, Cancelled> {
    let mut mesh = Mesh::default();
    let mut vertices: HashMap<[u32; 3], u32> = HashMap::new();
    for_each_face(voxels, clear, |cell, axis, side, value| {
        // To pass by the rest takes little time.
        if control.is_cancelled() {
            return;
        }
        let corners = face_corners(cell, axis, side).map(|corner| {
            *vertices.entry(corner).or_insert_with(|| {
                mesh.positions.push(Vec3::from_array(corner.map(|c| c as f32)));
                (mesh.positions.len() - 1) as u32
            })
        });
        mesh.triangles.push([corners[0], corners[1], corners[2]]);
        mesh.triangles.push([corners[0], corners[2], corners[3]]);
        mesh.slots.extend([u16::from(value) - 1; 2]);
    });
    control.check()?;
    Ok(mesh)
}

/// Tells how large a mesh [`exposed_faces`] would make: a closed surface of squares has as many corners as faces, and two
/// more for each body.
pub(super) fn forecast(voxels: &Voxels, clear: &[bool; 256]) -> MeshSize {
    let mut faces = 0u64;
    for_each_face(voxels, clear, |_, _, _, _| faces += 1);
    // Two triangles, each with its material.
    MeshSize {
        vertices: faces as f64 + 2.0,
        triangles: faces as f64 * 2.0,
        each: [12.0, 14.0],
        is_exact: false,
    }
}

fn for_each_face(voxels: &Voxels, clear: &[bool; 256], mut visit: impl FnMut([u32; 3], usize, usize, u8)) {
    voxels.for_each_filled(|cell, value| {
        for axis in 0..3 {
            for side in 0..2 {
                let mut next = cell;
                next[axis] = if side == 0 { cell[axis].wrapping_sub(1) } else { cell[axis] + 1 };
                let beyond = voxels.get(next[0], next[1], next[2]);
                if beyond == 0
                    || (beyond != value && clear[usize::from(beyond)] && !clear[usize::from(value)])
                {
                    visit(cell, axis, side, value);
                }
            }
        }
    });
}

/// Returns the corners of a face, counter-clockwise seen from outside.
fn face_corners(cell: [u32; 3], axis: usize, side: usize) -> [[u32; 3]; 4] {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let corner = |a: u32, b: u32| {
        let mut c = cell;
        c[axis] += side as u32;
        c[u] += a;
        c[v] += b;
        c
    };
    let ring = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    if side == 1 { ring } else { [ring[0], ring[3], ring[2], ring[1]] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOLID: [bool; 256] = {
        let mut clear = [false; 256];
        clear[0] = true;
        clear
    };

    #[test]
    fn two_cells_make_a_closed_box_of_ten_faces() {
        let voxels = Voxels::from_fn([2, 1, 1], |x, _, _| x as u8 + 1);
        let mesh = exposed_faces(&voxels, &SOLID, &Control::simple()).unwrap();
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (20, 12));
        assert_eq!(forecast(&voxels, &SOLID).triangles as u64 / 2, 10);
        assert!((mesh.volume() - 2.0).abs() < 1e-12 && (mesh.area() - 10.0).abs() < 1e-12);
        assert_eq!(mesh.slots.iter().filter(|&&s| s == 1).count(), 10);
    }

    #[test]
    fn a_solid_behind_glass_keeps_its_face() {
        let voxels = Voxels::from_fn([2, 1, 1], |x, _, _| x as u8 + 1);
        let mut clear = SOLID;
        clear[1] = true;
        assert_eq!(forecast(&voxels, &clear).triangles as u64 / 2, 11);
    }
}
