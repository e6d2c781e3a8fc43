//! Which triangles approximate a height field?

use super::MeshSize;
use crate::scene::{HeightField, Mesh};
use crate::seam::{Cancelled, Control};
use glam::{Vec2, Vec3};

/// Triangulates every `n`-th sample, `n` the largest power of two that keeps the tolerance; returns the bound.
///
/// With `n = 1` the greatest distance between a bilinear patch and its two triangles is a quarter of its
/// twist `|h00 - h10 - h01 + h11|`, along y.
pub(super) fn triangulate(
    field: &HeightField,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<(Mesh, f64), Cancelled> {
    let (stride, bound) = choose_stride(field, tolerance, control)?;
    let columns = kept(field.columns(), stride);
    let rows = kept(field.rows(), stride);
    let mut mesh = Mesh::default();
    for &row in &rows {
        control.check()?;
        for &column in &columns {
            let p = field.vertex(column, row);
            mesh.positions.push(p.as_vec3());
            mesh.normals.push(normal(field, column, row));
            mesh.uvs.push(Vec2::from_array(field.uv(p.x, p.z)));
        }
    }
    let width = columns.len() as u32;
    for row in 0..rows.len() as u32 - 1 {
        for column in 0..width - 1 {
            let a = row * width + column;
            let (b, c, d) = (a + 1, a + width, a + width + 1);
            mesh.triangles.push([a, c, b]);
            mesh.triangles.push([b, c, d]);
        }
    }
    Ok((mesh, bound))
}

/// Tells how large a mesh [`triangulate`] would make, and its bound.
pub(super) fn forecast(
    field: &HeightField,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<(MeshSize, f64), Cancelled> {
    let (stride, bound) = choose_stride(field, tolerance, control)?;
    let [columns, rows] = [field.columns(), field.rows()].map(|samples| kept(samples, stride).len() as u32);
    Ok((MeshSize::exact(columns * rows, (columns - 1) * (rows - 1) * 2), bound))
}

fn choose_stride(
    field: &HeightField,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<(u32, f64), Cancelled> {
    let mut best = (1, deviation(field, 1, control)?);
    let mut stride = 2;
    while stride < field.columns().min(field.rows()) {
        let bound = deviation(field, stride, control)?;
        if bound > tolerance {
            break;
        }
        best = (stride, bound);
        stride *= 2;
    }
    Ok(best)
}

/// Lists the samples that are kept: every `stride`-th and the last.
fn kept(samples: u32, stride: u32) -> Vec<u32> {
    let mut list: Vec<u32> = (0..samples - 1).step_by(stride as usize).collect();
    list.push(samples - 1);
    list
}

/// Returns the greatest height difference between the field and its triangles.
fn deviation(field: &HeightField, stride: u32, control: &Control<'_>) -> Result<f64, Cancelled> {
    let (columns, rows) = (kept(field.columns(), stride), kept(field.rows(), stride));
    let mut worst = 0.0_f64;
    for z in rows.windows(2) {
        control.check()?;
        for x in columns.windows(2) {
            let [h00, h10] = [field.height(x[0], z[0]), field.height(x[1], z[0])];
            let [h01, h11] = [field.height(x[0], z[1]), field.height(x[1], z[1])];
            for row in z[0]..=z[1] {
                for column in x[0]..=x[1] {
                    let u = f64::from(column - x[0]) / f64::from(x[1] - x[0]);
                    let v = f64::from(row - z[0]) / f64::from(z[1] - z[0]);
                    // The diagonal runs from (1, 0) to (0, 1).
                    let flat = if u + v <= 1.0 {
                        h00 + (h10 - h00) * u + (h01 - h00) * v
                    } else {
                        h11 + (h01 - h11) * (1.0 - u) + (h10 - h11) * (1.0 - v)
                    };
                    worst = worst.max((field.height(column, row) - flat).abs());
                }
            }
        }
    }
    // Between the samples the field bends by at most a quarter of its own twist.
    let twist = (0..field.rows() - 1)
        .flat_map(|row| (0..field.columns() - 1).map(move |column| (column, row)))
        .map(|(column, row)| {
            let [h00, h10, h01, h11] = field.cell(column, row);
            (h00 - h10 - h01 + h11).abs() * 0.25
        })
        .fold(0.0, f64::max);
    Ok(worst + twist)
}

/// Returns the mean slope of the cells around a sample as a normal.
fn normal(field: &HeightField, column: u32, row: u32) -> Vec3 {
    let (left, right) = (column.saturating_sub(1), (column + 1).min(field.columns() - 1));
    let (near, far) = (row.saturating_sub(1), (row + 1).min(field.rows() - 1));
    let size = field.cell_size();
    let slope_x = (field.height(right, row) - field.height(left, row)) / (f64::from(right - left) * size.x);
    let slope_z = (field.height(column, far) - field.height(column, near)) / (f64::from(far - near) * size.y);
    glam::DVec3::new(-slope_x, 1.0, -slope_z).normalize_or(glam::DVec3::Y).as_vec3()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    fn waves() -> HeightField {
        let heights = (0..65 * 33)
            .map(|i| ((i % 65) as f32 * 0.21).sin() * ((i / 65) as f32 * 0.33).cos() * 0.1)
            .collect();
        HeightField::new(65, 33, DVec2::new(2.0, 1.0), heights).unwrap()
    }

    #[test]
    fn deviations_stay_under_the_bound() {
        let field = waves();
        for tolerance in [0.0, 0.004, 0.05] {
            let (mesh, bound) = triangulate(&field, tolerance, &Control::simple()).unwrap();
            mesh.check().unwrap();
            assert!(bound <= tolerance.max(deviation(&field, 1, &Control::simple()).unwrap()));
            for t in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(t).map(glam::Vec3::as_dvec3);
                for p in [(a + b) * 0.5, (b + c) * 0.5, (a + c) * 0.5, (a + b + c) / 3.0] {
                    let error = (field.height_and_normal(p.x, p.z).0 - p.y).abs();
                    assert!(error <= bound + 1e-6, "{error} over {bound}");
                }
                assert!((b - a).cross(c - a).y > 0.0, "faces look up");
            }
        }
        let count = |tolerance| triangulate(&field, tolerance, &Control::simple()).unwrap().0.triangles.len();
        assert!(count(0.05) * 3 < count(0.0));
    }
}
