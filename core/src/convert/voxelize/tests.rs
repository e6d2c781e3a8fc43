//! Are the cells that are filled those that were promised?

use super::*;
use crate::parallel::Pool;
use crate::scene::{Material, Mesh, Primitive};
use glam::{DQuat, Vec3};
use std::collections::BTreeSet;
use std::f64::consts::PI;

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
        let model =
            voxelize(&scene(), &object, 0.0, resolution, Filling::Natural, &Control::simple()).unwrap();
        let cell = model.bound / 3f64.sqrt();
        let error = (model.voxels.filled() as f64 * cell.powi(3) - exact).abs();
        // First order in the cell, with a constant far below the area's 4 pi.
        assert!(error < 0.5 * cell, "{resolution}: {error}");
    }
}

/// A ball, a torus, and a torus turned over, which cross each other; nothing lies along the grid.
fn bodies() -> Mesh {
    let turned = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(0.7);
    let mut all = Mesh::default();
    let torus = Primitive::Torus { major: 1.0, minor: 0.3 };
    for (primitive, place, is_turned_over) in [
        (Primitive::Sphere { radius: 0.5 }, DVec3::new(0.1, 0.2, 0.05), false),
        (torus, DVec3::ZERO, false),
        (torus, DVec3::new(3.0, 0.3, 0.6), true),
    ] {
        let (mesh, _) = primitive_mesh::tessellate(&primitive, 0.01);
        let first = all.positions.len() as u32;
        all.positions.extend(mesh.positions.iter().map(|p| (turned * p.as_dvec3() + place).as_vec3()));
        all.triangles.extend(mesh.triangles.iter().map(|t| {
            let [a, b, c] = t.map(|i| i + first);
            if is_turned_over { [a, c, b] } else { [a, b, c] }
        }));
    }
    all
}

fn model(mesh: &Mesh, resolution: u32, filling: Filling) -> VoxelModel {
    let object = Object::new("mesh", Shape::Mesh(mesh.clone()), 0);
    voxelize(&scene(), &object, 0.0, resolution, filling, &Control::simple()).unwrap()
}

fn cells(voxels: &Voxels) -> BTreeSet<[u32; 3]> {
    let mut cells = BTreeSet::new();
    voxels.for_each_filled(|cell, _| {
        cells.insert(cell);
    });
    cells
}

/// Counts how many of some cells water reaches that comes from outside, over faces or over edges and corners, too.
fn wet(walls: &BTreeSet<[u32; 3]>, size: [u32; 3], corners: bool, of: &BTreeSet<[u32; 3]>) -> usize {
    let steps = (0..27i64).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
    let steps: Vec<_> = steps.filter(|s| corners || s.iter().map(|c| c.abs()).sum::<i64>() == 1).collect();
    let mut seen = std::collections::HashSet::from([[-1i64; 3]]);
    let mut open = vec![[-1i64; 3]];
    let mut count = 0;
    while let Some(cell) = open.pop() {
        for step in &steps {
            let next: [i64; 3] = std::array::from_fn(|a| cell[a] + step[a]);
            let is_near = (0..3).all(|a| (-1..=i64::from(size[a])).contains(&next[a]));
            let place = next.map(|c| u32::try_from(c).unwrap_or(u32::MAX));
            if is_near && !walls.contains(&place) && seen.insert(next) {
                count += usize::from(of.contains(&place));
                open.push(next);
            }
        }
    }
    count
}

#[test]
fn surfaces_stop_the_floods_that_they_promise_to_stop() {
    let mesh = bodies();
    for resolution in [23, 64] {
        let [thick, thin, solid] = [Filling::Surface, Filling::Thin, Filling::Solid].map(|filling| {
            let model = model(&mesh, resolution, filling);
            (cells(&model.voxels), model.voxels.size())
        });
        let size = thick.1;
        let inside: BTreeSet<_> = solid.0.difference(&thick.0).copied().collect();
        assert!(inside.len() > if resolution > 30 { 3000 } else { 10 }, "{}", inside.len());
        assert_eq!(wet(&thick.0, size, true, &inside), 0, "{resolution}: over corners");
        assert_eq!(wet(&thin.0, size, false, &inside), 0, "{resolution}: over faces");
        // The counter can tell: over corners water comes through what is thin.
        assert!(wet(&thin.0, size, true, &inside) > inside.len() / 2);
        assert!(thin.0.is_subset(&thick.0));
        let share = thin.0.len() as f64 / thick.0.len() as f64;
        assert!((0.45..0.7).contains(&share), "{resolution}: {share}");
    }
}

#[test]
fn volumes_of_solids_converge_to_closed_forms() {
    let (torus, _) = primitive_mesh::tessellate(&Primitive::Torus { major: 1.0, minor: 0.3 }, 1e-4);
    let (volume, area) = (2.0 * PI * PI * 0.09, 4.0 * PI * PI * 0.3);
    for resolution in [30, 61, 120] {
        let model = model(&torus, resolution, Filling::Solid);
        let cell = model.bound / 3f64.sqrt();
        let error = (model.voxels.filled() as f64 * cell.powi(3) - volume).abs();
        // A tenth of a cell all over: middles err to both sides alike.
        assert!(error < 0.1 * area * cell, "{resolution}: {}", error / (area * cell));
        assert!(!model.why.contains("open"), "{}", model.why);
    }
}

#[test]
fn order_and_quarter_turns_change_nothing() {
    let mesh = bodies();
    for filling in [Filling::Surface, Filling::Thin, Filling::Solid] {
        let given = model(&mesh, 50, filling).voxels;
        let (before, [sx, ..]) = (cells(&given), given.size());
        let mut turned = mesh.clone();
        turned.triangles.reverse();
        for t in &mut turned.triangles {
            t.rotate_left(1);
        }
        assert_eq!(before, cells(&model(&turned, 50, filling).voxels), "{filling:?}");
        for p in &mut turned.positions {
            *p = Vec3::new(p.y, -p.x, p.z);
        }
        let quarter: BTreeSet<_> = before.iter().map(|&[x, y, z]| [y, sx - 1 - x, z]).collect();
        assert_eq!(quarter, cells(&model(&turned, 50, filling).voxels), "{filling:?} turned around z");
        for p in &mut turned.positions {
            *p = Vec3::new(p.z, p.x, p.y);
        }
        let upright: BTreeSet<_> = quarter.iter().map(|&[x, y, z]| [z, x, y]).collect();
        assert_eq!(upright, cells(&model(&turned, 50, filling).voxels), "{filling:?} turned again");
    }
}

#[test]
fn open_meshes_are_filled_where_most_directions_agree_and_are_reported() {
    let (ball, _) = primitive_mesh::tessellate(&Primitive::Sphere { radius: 1.0 }, 0.005);
    let mut holed = ball.clone();
    holed
        .triangles
        .retain(|t| t.iter().all(|&i| ball.positions[i as usize].dot(Vec3::new(0.5, 0.7, 0.5)) < 0.95));
    let [whole, open] = [&ball, &holed].map(|mesh| model(mesh, 40, Filling::Solid));
    assert!(open.why.contains("open at ") && !whole.why.contains("open at "), "{}", open.why);
    let missing = cells(&whole.voxels).difference(&cells(&open.voxels)).count() as f64;
    assert!(missing < 0.02 * whole.voxels.filled() as f64, "{missing} of {}", whole.voxels.filled());
    // A sheet encloses nothing: it is its surface.
    let (sheet, _) = primitive_mesh::tessellate(&Primitive::Plane { width: 1.0, depth: 1.0 }, 0.1);
    assert_eq!(cells(&model(&sheet, 20, Filling::Solid).voxels).len(), 400);
}

#[test]
fn bodies_can_be_made_hollow() {
    let object = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0);
    let fill = |filling| voxelize(&scene(), &object, 0.0, 40, filling, &Control::simple()).unwrap().voxels;
    let whole = cells(&fill(Filling::Natural));
    assert_eq!(whole, cells(&fill(Filling::Solid)));
    let [thick, thin] = [Filling::Surface, Filling::Thin].map(|filling| cells(&fill(filling)));
    assert!(thin.is_subset(&thick) && thick.is_subset(&whole) && thin.len() < thick.len());
    let inside: BTreeSet<_> = whole.difference(&thick).copied().collect();
    assert!(inside.len() > whole.len() / 2);
    assert_eq!(wet(&thick, [40; 3], true, &inside), 0);
    assert_eq!(wet(&thin, [40; 3], false, &inside), 0);
    assert!(wet(&thin, [40; 3], true, &inside) > 0);
}

#[test]
fn what_is_inside_has_the_color_of_the_surface_beside_it() {
    let (mut mesh, _) = primitive_mesh::tessellate(&Primitive::Box { size: DVec3::new(2.0, 1.0, 1.0) }, 0.1);
    let (blue, red) = (Vec3::new(0.2, 0.4, 0.6), Vec3::new(0.9, 0.1, 0.1));
    mesh.colors = mesh.positions.iter().map(|p| if p.x > 0.0 { red } else { blue }).collect();
    let model = model(&mesh, 20, Filling::Solid);
    assert_eq!((model.voxels.filled(), model.voxels.size()), (2000, [20, 10, 10]));
    let color = |cell: [u32; 3]| {
        model.palette[usize::from(model.voxels.get(cell[0], cell[1], cell[2])) - 1].base_color
    };
    let near = |cell, wanted: Vec3| {
        (color(cell) - Material::default().base_color * wanted).abs().max_element() < 0.05
    };
    for at in [[0, 5, 5], [0, 0, 0], [0, 9, 9]] {
        let other = [19, at[1], at[2]];
        assert!(near(at, blue) && near(other, red), "{} {}", color(at), color(other));
    }
}

#[test]
fn any_number_of_threads_fills_the_same_bytes() {
    let (torus, _) = primitive_mesh::tessellate(&Primitive::Torus { major: 1.0, minor: 0.3 }, 0.02);
    let ball = Primitive::Sphere { radius: 1.0 };
    for (shape, filling) in [
        (Shape::Mesh(torus.clone()), Filling::Natural),
        (Shape::Mesh(torus.clone()), Filling::Thin),
        (Shape::Mesh(torus), Filling::Solid),
        (Shape::Primitive(ball), Filling::Natural),
        (Shape::Primitive(ball), Filling::Thin),
    ] {
        let mut scene = scene();
        let halves = [255, 0, 0, 255, 0, 0, 255, 255];
        scene.textures.push(crate::scene::Texture::from_srgb8("halves", 2, 1, &halves).into());
        scene.materials[0].texture = Some(0);
        let object = Object::new("thing", shape, 0);
        let fill = |control: &Control<'_>| {
            let model = voxelize(&scene, &object, 0.0, 45, filling, control).unwrap();
            let mut cells = Vec::new();
            model.voxels.for_each_filled(|cell, byte| cells.push((cell, byte)));
            (cells, model.palette)
        };
        let alone = fill(&Control::simple());
        assert!(alone.1.len() > 1 && fill(&Control::new(&Pool::new(3).unwrap())) == alone);
    }
}
