//! Do surfaces of voxels stop water? Counts the cells inside of models that water from outside reaches.
//!
//! `cargo run --release -p polyptych-core --example floods -- CELLS[,CELLS...] MODEL...`. Of each model it tells how many
//! edges of a single triangle it has (an open model lets water in by its holes), then for each resolution: cells inside
//! and beside no surface, how many of them are wet over faces, edges and corners through the surface (26-separating) and
//! over faces through the thin one (6-separating), both 0 for a closed model, and by how much of a cell all over the
//! volume of the solid is off.

use polyptych_core::convert::{Converter, Detail, Filling, VoxelModel};
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::parallel::Pool;
use polyptych_core::scene::{Mesh, Object, Scene, Shape, Voxels};
use polyptych_core::seam::Control;
use std::collections::HashMap;
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let cells = words.next().ok_or("CELLS[,CELLS...] MODEL...")?;
    let cells: Vec<u32> = cells.split(',').map(str::parse).collect::<Result<_, _>>()?;
    let pool = Pool::new(0)?;
    println!("model | open edges | cells | inside | wet, surface | wet, thin | volume off, cells | seconds");
    for path in words {
        let scene = load(Path::new(&path), &LoadOptions::default())?;
        for object in &scene.objects {
            let Shape::Mesh(mesh) = &*object.shape else { continue };
            let open = open_edges(mesh);
            for &resolution in &cells {
                let start = Instant::now();
                let fill = |filling| model(&scene, object, resolution, filling, &pool);
                let [surface, thin, solid] =
                    [fill(Filling::Surface)?, fill(Filling::Thin)?, fill(Filling::Solid)?];
                let seconds = start.elapsed().as_secs_f64();
                let [thick, fine, full] = [&surface, &thin, &solid].map(|model| bytes(&model.voxels));
                let inside: Vec<bool> = full.iter().zip(&thick).map(|(f, t)| *f && !*t).collect();
                let size = surface.voxels.size();
                let wet = |walls: &[bool], corners| {
                    let reached = flood(walls, size, corners);
                    inside.iter().zip(reached).filter(|(inside, wet)| **inside && *wet).count()
                };
                let cell = solid.object_from_voxels.matrix3.x_axis.length();
                let volume = solid.voxels.filled() as f64 * cell.powi(3) - mesh.volume().abs();
                println!(
                    "{} | {open} | {resolution} | {} | {} | {} | {:.4} | {seconds:.2}",
                    Path::new(&path).file_name().unwrap_or_default().to_string_lossy(),
                    inside.iter().filter(|inside| **inside).count(),
                    wet(&thick, true),
                    wet(&fine, false),
                    volume / (mesh.area() * cell),
                );
            }
        }
    }
    Ok(())
}

fn model(
    scene: &Scene,
    object: &Object,
    max_resolution: u32,
    filling: Filling,
    pool: &Pool,
) -> Result<Arc<VoxelModel>, Box<dyn Error>> {
    let detail = Detail { tolerance: 0.0, max_resolution };
    Ok(Converter::default().voxels_filled(scene, object, detail, filling, &Control::new(pool))?)
}

/// Tells for each cell, x fastest, whether it is filled.
fn bytes(voxels: &Voxels) -> Vec<bool> {
    let [nx, ny, nz] = voxels.size().map(|s| s as usize);
    let mut filled = vec![false; nx * ny * nz];
    voxels.for_each_filled(|[x, y, z], _| filled[(z as usize * ny + y as usize) * nx + x as usize] = true);
    filled
}

/// Tells for each cell whether water from outside reaches it.
fn flood(walls: &[bool], size: [u32; 3], corners: bool) -> Vec<bool> {
    let edge = size.map(|s| s as i64);
    let index = |c: [i64; 3]| ((c[2] * edge[1] + c[1]) * edge[0] + c[0]) as usize;
    let steps: Vec<[i64; 3]> = (0..27)
        .map(|k: i64| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1])
        .filter(|s| corners || s.iter().map(|c: &i64| c.abs()).sum::<i64>() == 1)
        .collect();
    let mut wet = vec![false; walls.len()];
    let mut open = Vec::new();
    // Water stands around the grid: all cells in its faces are next to it.
    for z in 0..edge[2] {
        for y in 0..edge[1] {
            let is_face = z == 0 || y == 0 || z == edge[2] - 1 || y == edge[1] - 1;
            let step = if is_face { 1 } else { (edge[0] - 1).max(1) };
            for x in (0..edge[0]).step_by(step as usize) {
                if !walls[index([x, y, z])] {
                    wet[index([x, y, z])] = true;
                    open.push([x, y, z]);
                }
            }
        }
    }
    while let Some(cell) = open.pop() {
        for step in &steps {
            let next: [i64; 3] = std::array::from_fn(|a| cell[a] + step[a]);
            if (0..3).all(|a| (0..edge[a]).contains(&next[a])) {
                let at = index(next);
                if !walls[at] && !std::mem::replace(&mut wet[at], true) {
                    open.push(next);
                }
            }
        }
    }
    wet
}

/// Counts edges of a single triangle, corners welded to a millionth of the size.
fn open_edges(mesh: &Mesh) -> usize {
    let fine = 1e6 / mesh.bounds().radius().max(1e-30);
    let place = |i: u32| (mesh.positions[i as usize].as_dvec3() * fine).round().to_array().map(|c| c as i64);
    let mut edges: HashMap<_, u32> = HashMap::new();
    for t in &mesh.triangles {
        for [a, b] in [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]] {
            let (a, b) = (place(a), place(b));
            if a != b {
                *edges.entry((a.min(b), a.max(b))).or_default() += 1;
            }
        }
    }
    edges.values().filter(|&&count| count == 1).count()
}
