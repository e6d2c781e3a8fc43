//! Is every pixel inside of a surface covered exactly once?

use super::{Random, camera, draw, scene_of, triangle};
use crate::edges::{BLOCK, STRIP, Spans};
use crate::grid::{TILE_WIDTH, TileGrid};
use crate::setup::{Corners, DepthPlane, Record, ScreenPoint};
use glam::Vec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::scene::{Mesh, Shape};

type Corner = (f64, f64);

/// Counts how often triangles cover each pixel.
fn count(width: u32, height: u32, triangles: &[[Corner; 3]]) -> Vec<u32> {
    let grid = TileGrid::new(width, height);
    let mut hits = vec![0; (width * height) as usize];
    for corners in triangles {
        let corners = Corners::snapped(corners.map(|(x, y)| ScreenPoint { x, y, depth: 1.0 }));
        let plane = || DepthPlane::through(&corners.points);
        let area = corners.area();
        let Some(record) = Record::new(&corners, area, plane, 0, 0).filter(|_| area != 0) else {
            continue;
        };
        grid.for_each_touched(&record, |tile| {
            let area = grid.area(tile);
            let spans = Spans::of(&record, &area);
            let mut covered = Vec::new();
            for span in spans.iter() {
                for i in 0..span.length as i32 {
                    let inside =
                        (span.x + i - area.x) as usize + (span.y - area.y) as usize * TILE_WIDTH as usize;
                    assert_eq!(inside, span.first + i as usize);
                    covered.push(inside);
                    hits[(span.y * width as i32 + span.x + i) as usize] += 1;
                }
            }
            assert_eq!(in_strips(&spans), covered);
        });
    }
    hits
}

/// Lists the pixels of a tile that are covered as strips tell it.
fn in_strips(spans: &Spans) -> Vec<usize> {
    let mut covered = Vec::new();
    for strip in (0..spans.strips()).map(|index| spans.strip(index)) {
        let [first, end] = strip.blocks;
        for row in 0..STRIP {
            for column in (0..strip.length[row]).map(|i| strip.begin[row] as usize + i as usize) {
                assert!((first..end).contains(&(column / BLOCK)));
                covered.push((strip.row + row) * TILE_WIDTH as usize + column);
            }
        }
    }
    covered
}

/// Tells on which side of a polygon of snapped corners a pixel's center is: 1 inside, 0 on its border, -1 outside.
fn side(polygon: &[(i64, i64)], x: i64, y: i64) -> i32 {
    let (px, py) = (x * 256 + 128, y * 256 + 128);
    let mut inside = false;
    for i in 0..polygon.len() {
        let ((ax, ay), (bx, by)) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        let cross = (bx - ax) * (py - ay) - (by - ay) * (px - ax);
        let within = (ax.min(bx)..=ax.max(bx)).contains(&px) && (ay.min(by)..=ay.max(by)).contains(&py);
        if cross == 0 && within {
            return 0;
        }
        if (ay > py) != (by > py) && (cross > 0) == (by > ay) {
            inside = !inside;
        }
    }
    if inside { 1 } else { -1 }
}

/// Puts corners on pixel centers, on eighths, on steps, or anywhere.
fn place(v: f64, kind: u32) -> f64 {
    match kind {
        0 => v.floor() + 0.5,
        1 => (v * 8.0).round() / 8.0,
        2 => (v * 256.0).round() / 256.0,
        _ => v,
    }
}

#[test]
fn fans_cover_each_pixel_inside_once() {
    let mut random = Random(9);
    let (mut gaps, mut doubles, mut spills, mut checked) = (0, 0, 0, 0u64);
    for fan in 0..10_000u32 {
        let kind = fan % 4;
        let (width, height) = (70, 40);
        let center = (place(35.0 + random.next() * 4.0, kind), place(20.0 + random.next() * 4.0, kind));
        let spokes = 3 + (random.next() * 7.0) as usize;
        let rim: Vec<Corner> = (0..spokes)
            .map(|i| {
                let angle = std::f64::consts::TAU * (i as f64 + random.next() * 0.6) / spokes as f64;
                let radius = 4.0 + random.next() * 40.0;
                (place(center.0 + angle.cos() * radius, kind), place(center.1 + angle.sin() * radius, kind))
            })
            .collect();
        let triangles: Vec<[Corner; 3]> =
            (0..spokes).map(|i| [center, rim[i], rim[(i + 1) % spokes]]).collect();
        let area =
            |t: &[Corner; 3]| (t[1].0 - t[0].0) * (t[2].1 - t[0].1) - (t[2].0 - t[0].0) * (t[1].1 - t[0].1);
        if triangles.iter().any(|t| area(t) < 1.0) {
            continue; // the center does not see its whole rim: not a fan
        }
        let snap = |v: f64| (v * 256.0).round_ties_even() as i64;
        let polygon: Vec<(i64, i64)> = rim.iter().map(|c| (snap(c.0), snap(c.1))).collect();
        for (i, hits) in count(width, height, &triangles).into_iter().enumerate() {
            match side(&polygon, i as i64 % i64::from(width), i as i64 / i64::from(width)) {
                1 => gaps += u32::from(hits == 0),
                0 => {}
                _ => spills += u32::from(hits > 0),
            }
            doubles += u32::from(hits > 1);
            checked += u64::from(hits);
        }
    }
    assert_eq!((gaps, doubles, spills), (0, 0, 0));
    assert!(checked > 1_000_000, "{checked}");
}

#[test]
fn grids_of_small_triangles_leave_no_pixel_open() {
    let mut random = Random(5);
    for (size, cells) in [(64.0, 150), (200.0, 37), (8000.0, 11)] {
        for kind in 0..4 {
            // The border lies outside of the picture; inner corners are moved by less than half a cell.
            let step = (size + 4.0) / f64::from(cells);
            let corners: Vec<Corner> = (0..=cells)
                .flat_map(|row| (0..=cells).map(move |column| (row, column)))
                .map(|(row, column)| {
                    let shake =
                        |at: i32, r: f64| if at == 0 || at == cells { 0.0 } else { (r - 0.5) * step * 0.4 };
                    let x = f64::from(column) * step - 2.0 + shake(column, random.next());
                    let y = f64::from(row) * step - 2.0 + shake(row, random.next());
                    // Cells smaller than a pixel would fold over on coarse places.
                    if step < 4.0 { (x, y) } else { (place(x, kind), place(y, kind)) }
                })
                .collect();
            let at = |row: i32, column: i32| corners[(row * (cells + 1) + column) as usize];
            let mut triangles = Vec::new();
            for row in 0..cells {
                for column in 0..cells {
                    let quad =
                        [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
                    let flip = (row + column) % 2;
                    let [a, b, c, d] = if flip == 0 { quad } else { [quad[1], quad[2], quad[3], quad[0]] };
                    triangles.extend([[a, b, c], [a, c, d]]);
                }
            }
            let edge = size.min(300.0) as u32;
            let hits = count(edge, edge, &triangles);
            assert!(hits.iter().all(|&h| h == 1), "{size} {cells} {kind}");
        }
    }
}

#[test]
fn wide_pictures_are_covered_to_their_end() {
    let far = 20_001.0 + 8000.0;
    let quad = [(-8000.0, -8000.3), (far, -7990.7), (far, 8003.2), (-8000.0, 7999.9)];
    let hits = count(20_001, 2, &[[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
    assert!(hits.iter().all(|&h| h == 1));
}

#[test]
fn a_floor_from_behind_the_eye_covers_all_below_the_horizon() {
    let e = 1e5;
    let floor = Mesh {
        positions: [[-e, e], [e, e], [e, -e], [-e, -e]]
            .map(|[x, z]| Vec3::new(x as f32, -1.0, z as f32))
            .into(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    };
    let scene = scene_of(vec![(Shape::Mesh(floor), [0.0; 3])]);
    for roll in [0.0, 0.3, 1.2] {
        let mut camera = camera([0.0; 3], [0.0, 0.0, -1.0]);
        camera.world_from_camera = glam::DMat3::from_rotation_z(roll) * camera.world_from_camera;
        let picture = draw(&scene, camera.clone(), 160, 100);
        let view = camera.view(160, 100);
        for (i, &distance) in picture.distance().iter().enumerate() {
            let ray = view.ray(i as f64 % 160.0 + 0.5, (i / 160) as f64 + 0.5).unwrap();
            if ray.direction.y < -1e-4 {
                let truth = -1.0 / ray.direction.y;
                assert!((f64::from(distance) / truth - 1.0).abs() < 1e-5, "{distance} for {truth} at {i}");
            } else {
                assert!(ray.direction.y < 0.0 || distance.is_infinite());
            }
        }
    }
}

#[test]
fn broken_triangles_are_not_drawn_and_huge_ones_are() {
    let wild = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38];
    for bad in wild {
        for axis in 0..3 {
            let mut corners = [[-1.0, -1.0, -5.0], [1.0, -1.0, -5.0], [0.0, 1.0, -5.0]];
            corners[1][axis] = bad;
            let picture = draw(
                &scene_of(vec![(Shape::Mesh(triangle(corners)), [0.0; 3])]),
                camera([0.0; 3], [0.0, 0.0, -1.0]),
                33,
                17,
            );
            assert_eq!(picture.count_not_finite(), 0);
            assert!(bad.is_finite() || picture.id().iter().all(|&id| id == 0));
        }
    }
    for scale in [1e-20_f32, 1e3, 1e15, 1e30] {
        let corners = [[-1.0, -1.0, -5.0], [1.0, -1.0, -5.0], [0.0, 1.0, -5.0]].map(|c| c.map(|v| v * scale));
        let picture = draw(
            &scene_of(vec![(Shape::Mesh(triangle(corners)), [0.0; 3])]),
            camera([0.0; 3], [0.0, 0.0, -1.0]),
            33,
            33,
        );
        let distance = picture.distance()[16 * 33 + 16];
        assert!((distance / (5.0 * scale) - 1.0).abs() < 1e-5, "{distance} at {scale}");
    }
}

#[test]
fn far_from_the_origin_nothing_is_lost() {
    let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    let at = [1e9, -2e9, 3e9];
    let scene = scene_of(vec![(Shape::Mesh(triangle(corners)), at)]);
    let eye = [at[0], at[1], at[2] + 4.0];
    let camera = Camera { projection: Projection::Perspective { fov_y: 0.8 }, ..camera(eye, at) };
    let picture = draw(&scene, camera, 65, 65);
    let distance = picture.distance()[32 * 65 + 32];
    assert!((distance - 4.0).abs() < 4e-5, "{distance}");
}
