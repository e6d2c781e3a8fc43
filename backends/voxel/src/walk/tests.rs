//! Does the walk in strides visit the cells of the walk over every cell, in the same order, at the same
//! distances, for every ray?

use super::packet::{GridRays, Order, Packet, Stretch};
use super::steps::find_marked_in_all;
use super::*;
use crate::grid::{Chunks, Grid};
use crate::occupancy::Values;
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};
use polyptych_core::scene::Voxels;
use polyptych_core::seam::Control;
use std::sync::Arc;

struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() * n as f64) as usize
    }
}

fn hash(x: u32, y: u32, z: u32) -> u32 {
    let mut h = x.wrapping_mul(374_761_393) ^ y.wrapping_mul(668_265_263) ^ z.wrapping_mul(2_246_822_519);
    h = (h ^ (h >> 13)).wrapping_mul(1_274_126_177);
    h ^ (h >> 16)
}

fn ready(voxels: &Voxels) -> Arc<Grid> {
    let all = Values::of(|_| true);
    Chunks::default().grid(voxels, all, all, &Control::simple()).unwrap()
}

fn grids() -> Vec<(&'static str, Voxels)> {
    let size = [130, 70, 65];
    vec![
        ("specks", Voxels::from_fn(size, |x, y, z| u8::from(hash(x, y, z).is_multiple_of(1000)))),
        ("dense", Voxels::from_fn(size, |x, y, z| u8::from(hash(x, y, z) % 10 < 3))),
        ("hills", Voxels::from_fn(size, |x, y, z| u8::from(y < 8 + (x / 5 + z / 3) % 17))),
        ("diagonal", Voxels::from_fn([65, 65, 65], |x, y, z| u8::from((x + y + z) % 31 == 0))),
        ("thin", Voxels::from_fn([1, 1, 200], |_, _, z| u8::from(z == 150))),
        ("nothing", Voxels::new([130, 70, 65])),
    ]
}

/// All crossings of a ray with the planes of a grid in the order (distance, axis, along the ray), written down
/// and sorted; the states between them are the cells. Shares nothing with the walk but the plane's formula.
struct Flat {
    /// Cells with the distance and the axis of their entry, in order.
    visits: Vec<([i32; 3], f64, Option<usize>)>,
}

impl Flat {
    fn new(size: [u32; 3], origin: DVec3, direction: DVec3) -> Self {
        let mut visits = Vec::new();
        if !origin.is_finite() || !direction.is_finite() || direction == DVec3::ZERO {
            return Self { visits };
        }
        let mut cell = [0i64; 3];
        let mut crossings: Vec<(f64, usize, i64)> = Vec::new();
        for a in 0..3 {
            let (o, d, n) = (origin[a], direction[a], i64::from(size[a]));
            if d == 0.0 {
                if !(o >= 0.0 && o <= n as f64) {
                    return Self { visits };
                }
                cell[a] = (o.floor() as i64).min(n - 1);
                continue;
            }
            let inverse = 1.0 / d;
            cell[a] = if d > 0.0 { -1 } else { n };
            let planes: Vec<i64> = if d > 0.0 { (0..=n).collect() } else { (0..=n).rev().collect() };
            // Adding 0 turns -0 into 0, which sorts the same.
            crossings.extend(planes.iter().map(|&k| ((k as f64 - o) * inverse + 0.0, a, k)));
        }
        // Stable: planes of one axis at the same distance stay in the order of the ray.
        crossings.sort_by(|p, q| p.0.total_cmp(&q.0).then(p.1.cmp(&q.1)));
        let inside = |cell: &[i64; 3]| (0..3).all(|a| (0..i64::from(size[a])).contains(&cell[a]));
        let (begun, rest) =
            crossings.split_at(crossings.iter().position(|c| c.0 > 0.0).unwrap_or(crossings.len()));
        let step = |cell: &mut [i64; 3], a: usize| cell[a] += if direction[a] < 0.0 { -1 } else { 1 };
        for c in begun {
            step(&mut cell, c.1);
        }
        if inside(&cell) {
            visits.push((cell.map(|c| c as i32), 0.0, None));
        }
        for &(t, a, _) in rest {
            step(&mut cell, a);
            if inside(&cell) && t < f64::INFINITY {
                visits.push((cell.map(|c| c as i32), t, Some(a)));
            }
        }
        Self { visits }
    }

    fn first(&self, voxels: &Voxels) -> Option<&([i32; 3], f64, Option<usize>)> {
        self.visits.iter().find(|v| {
            let [x, y, z] = v.0.map(|c| c as u32);
            voxels.get(x, y, z) != 0
        })
    }
}

/// A ray of one of many kinds, most of them unpleasant.
fn ray(random: &mut Random, size: DVec3) -> (DVec3, DVec3) {
    let anywhere = (random.point() * 3.0 - 1.0) * size;
    let inside = random.point() * size;
    let mut origin = if random.below(2) == 0 { anywhere } else { inside };
    let target = random.point() * size;
    match random.below(8) {
        0 => origin = origin.floor(),
        1 => origin[random.below(3)] = 0.0,
        2 => {
            let a = random.below(3);
            origin[a] = size[a];
        }
        _ => {}
    }
    let mut direction = target - origin;
    match random.below(10) {
        0 => direction[random.below(3)] = 0.0,
        1 => direction[random.below(3)] = -0.0,
        2 => {
            let a = random.below(3);
            direction = DVec3::ZERO;
            direction[a] = if random.below(2) == 0 { 1.0 } else { -1.0 };
        }
        // Through exact corners and edges: from whole numbers along diagonals.
        3 => {
            origin = origin.floor();
            direction = (random.point() * 3.0).floor() - 1.0;
        }
        4 => {
            origin = (origin * 2.0).floor() * 0.5;
            direction = (random.point() * 9.0).floor() - 4.0;
        }
        5 => direction[random.below(3)] *= 1e-30,
        6 => direction *= 1e30,
        7 => direction *= 1e-30,
        8 => origin *= 10f64.powi(random.below(12) as i32),
        _ => {}
    }
    (origin, direction)
}

fn walk(grid: &Grid, origin: DVec3, direction: DVec3) -> Option<Walk> {
    let ray = GridRay::new(origin, direction)?;
    let mut walk = Walk::begin(ray, grid.seen.size, Moment::START)?;
    match walk.find_marked(&grid.seen, f64::INFINITY) {
        Found::Marked { .. } => Some(walk),
        Found::Nothing => None,
    }
}

#[test]
fn strides_find_the_cell_of_the_flat_walk_bit_for_bit() {
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    for (name, voxels) in grids() {
        let grid = ready(&voxels);
        let size = DVec3::from_array(voxels.size().map(f64::from));
        let (mut hits, mut ties) = (0, 0);
        for _ in 0..30_000 {
            let (origin, direction) = ray(&mut random, size);
            let flat = Flat::new(voxels.size(), origin, direction);
            let expected = flat.first(&voxels);
            let found = walk(&grid, origin, direction);
            let found = found.as_ref().map(|w| (w.cell(), w.t.to_bits(), w.entered));
            assert_eq!(
                found,
                expected.map(|v| (v.0, v.1.to_bits(), v.2)),
                "{name}: from {origin:?} along {direction:?}"
            );
            hits += u32::from(expected.is_some());
            ties += u32::from(flat.visits.windows(2).any(|v| v[0].1 == v[1].1));
        }
        assert!(hits > 1000 || name == "nothing" || name == "thin", "{name}: {hits} hits");
        assert!(ties > 500 || name == "thin", "{name}: {ties} rays through edges");
    }
}

#[test]
fn single_steps_visit_the_flat_walk_and_end_in_time() {
    let mut random = Random(77);
    let size = [23, 17, 9];
    for _ in 0..20_000 {
        let (origin, direction) = ray(&mut random, DVec3::from_array(size.map(f64::from)));
        let flat = Flat::new(size, origin, direction);
        let begun = GridRay::new(origin, direction)
            .and_then(|ray| Walk::begin(ray, size.map(|s| s as i32), Moment::START));
        let mut visits = Vec::new();
        if let Some(mut walk) = begun {
            loop {
                visits.push((walk.cell(), walk.t, walk.entered));
                assert!(visits.len() <= 23 + 17 + 9 + 3);
                if !walk.leave(0) {
                    break;
                }
            }
        }
        assert_eq!(visits, flat.visits, "from {origin:?} along {direction:?}");
        for pair in visits.windows(2) {
            let moved: i32 = (0..3).map(|a| (pair[0].0[a] - pair[1].0[a]).abs()).sum();
            assert!(moved == 1 && pair[0].1 <= pair[1].1, "{pair:?}");
        }
    }
}

#[test]
fn a_walk_resumed_anywhere_goes_the_same_way() {
    let mut random = Random(5);
    let size = [40, 70, 33];
    for _ in 0..5_000 {
        let (origin, direction) = ray(&mut random, DVec3::from_array(size.map(f64::from)));
        let visits = Flat::new(size, origin, direction).visits;
        if visits.is_empty() {
            continue;
        }
        let at = visits[random.below(visits.len())].1;
        let ray = GridRay::new(origin, direction).unwrap();
        let Some(mut walk) = Walk::begin(ray, size.map(|s| s as i32), Moment::before(at)) else {
            panic!("{at} along {origin:?} {direction:?}");
        };
        let mut later = Vec::new();
        loop {
            if walk.entered.is_some() && walk.t > 0.0 {
                later.push((walk.cell(), walk.t, walk.entered));
            }
            if !walk.leave(0) {
                break;
            }
        }
        let expected: Vec<_> = visits.into_iter().filter(|v| v.1 >= at && v.2.is_some()).collect();
        assert_eq!(later, expected, "from {origin:?} along {direction:?} at {at}");
    }
}

#[test]
fn a_reversed_ray_visits_the_same_cells() {
    let mut random = Random(11);
    let size = [64, 50, 70];
    for _ in 0..5_000 {
        let extent = DVec3::from_array(size.map(f64::from));
        let (origin, target) = ((random.point() * 2.0 - 0.5) * extent, (random.point() * 2.0 - 0.5) * extent);
        // From beyond the grid to beyond it, in general position.
        let direction = target - origin;
        let beyond = direction.normalize_or(DVec3::X) * 300.0;
        let (a, b) = (origin - beyond, target + beyond);
        let cells = |o: DVec3, d: DVec3| Flat::new(size, o, d).visits.iter().map(|v| v.0).collect::<Vec<_>>();
        let walked = |o: DVec3, d: DVec3| {
            let mut list = Vec::new();
            let walk = GridRay::new(o, d).and_then(|r| Walk::begin(r, size.map(|s| s as i32), Moment::START));
            if let Some(mut walk) = walk {
                list.push(walk.cell());
                while walk.leave(0) {
                    list.push(walk.cell());
                }
            }
            list
        };
        let mut back = walked(b, a - b);
        back.reverse();
        assert_eq!(walked(a, b - a), back, "{a:?} to {b:?}");
        assert_eq!(cells(a, b - a), back);
    }
}

#[test]
fn wild_rays_hit_nothing_and_end() {
    let voxels = Voxels::from_fn([70, 70, 70], |_, _, _| 1);
    let grid = ready(&voxels);
    let middle = DVec3::splat(35.5);
    for wild in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for a in 0..3 {
            let mut v = DVec3::ONE;
            v[a] = wild;
            assert!(walk(&grid, middle, v).is_none());
            assert!(walk(&grid, v, DVec3::ONE).is_none());
        }
    }
    for still in
        [DVec3::ZERO, DVec3::splat(-0.0), DVec3::splat(1e-300), DVec3::splat(f64::MIN_POSITIVE / 4.0)]
    {
        assert!(walk(&grid, middle, still).is_none());
    }
    // Very long, very short, very far.
    let hit = |o: DVec3, d: DVec3| walk(&grid, o, d).map(|w| (w.cell(), w.t, w.face()));
    assert_eq!(hit(middle, DVec3::new(-1e30, 1e-30, 0.0)), Some(([35; 3], 0.0, 1)));
    assert_eq!(hit(DVec3::new(-1e30, 35.5, 35.5), DVec3::X), Some(([0, 35, 35], 1e30, 0)));
    let slow = 2f64.powi(-100);
    assert_eq!(
        hit(DVec3::new(35.5, 71.0, 35.5), DVec3::new(-0.0, -slow, 0.0)),
        Some(([35, 69, 35], 1.0 / slow, 3))
    );
    // All planes lie at the same distance: x is left before z is entered.
    assert_eq!(hit(DVec3::splat(1e300), DVec3::splat(-1.0)), None);
}

#[test]
fn starts_on_faces_edges_and_corners_cross_what_lies_at_zero() {
    let voxels = Voxels::from_fn([4, 4, 4], |_, _, _| 1);
    let grid = ready(&voxels);
    let cell = |o: [f64; 3], d: [f64; 3]| walk(&grid, o.into(), d.into()).map(|w| (w.cell(), w.t));
    assert_eq!(cell([2.0, 1.5, 1.5], [1.0, 0.0, 0.0]), Some(([2, 1, 1], 0.0)));
    assert_eq!(cell([2.0, 1.5, 1.5], [-1.0, 0.0, 0.0]), Some(([1, 1, 1], 0.0)));
    assert_eq!(cell([2.0, 2.0, 1.5], [-1.0, 1.0, 0.0]), Some(([1, 2, 1], 0.0)));
    assert_eq!(cell([2.0, 2.0, 2.0], [-1.0, -1.0, -1.0]), Some(([1, 1, 1], 0.0)));
    assert_eq!(cell([2.0, 2.0, 2.0], [0.0, -0.0, 1.0]), Some(([2, 2, 2], 0.0)));
    // Along the border of the grid: the last cell has both faces; who leaves at once was never in.
    assert_eq!(cell([-1.0, 4.0, 4.0], [1.0, 0.0, 0.0]), Some(([0, 3, 3], 1.0)));
    assert_eq!(cell([4.0, 1.5, 1.5], [1.0, 0.0, 0.0]), None);
    assert_eq!(cell([0.0, 1.5, 1.5], [-1.0, 0.0, 0.0]), None);
    assert_eq!(cell([4.0, 1.5, 1.5], [-1.0, 0.0, 0.0]), Some(([3, 1, 1], 0.0)));
}

#[test]
fn no_sky_shows_through_walls_whose_cells_share_only_edges() {
    // A staircase wall: cells (i, i) and (i, i + 1), closed but for edges in the other diagonal.
    let voxels = Voxels::from_fn([128, 128, 3], |x, y, _| u8::from(x == y || x + 1 == y));
    let grid = ready(&voxels);
    let mut random = Random(3);
    for i in 0..50_000 {
        let mut target =
            DVec3::new(0.0, 0.0, 1.5) + DVec3::splat(20.0 + 80.0 * random.next()) * DVec3::new(1.0, 1.0, 0.0);
        if i % 2 == 0 {
            target = target.round(); // exactly through the edge between two steps
        }
        let origin = DVec3::new(target.x + 20.0, target.y - 20.0, 1.5);
        let skew = if i % 4 < 2 { 0.0 } else { random.next() - 0.5 };
        let direction = DVec3::new(-1.0, 1.0 + skew, 0.0);
        assert!(walk(&grid, origin, direction).is_some(), "{origin:?} {direction:?}");
    }
}

#[test]
fn the_point_lies_in_the_face_and_the_cell_before_is_its_neighbor() {
    let voxels = Voxels::from_fn([70, 70, 70], |x, y, z| u8::from(hash(x, y, z).is_multiple_of(50)));
    let grid = ready(&voxels);
    let mut random = Random(21);
    let mut hits = 0;
    for _ in 0..20_000 {
        let (origin, direction) = ray(&mut random, DVec3::splat(70.0));
        let Some(walk) = walk(&grid, origin, direction) else { continue };
        let (cell, before, point) = (walk.cell(), walk.cell_before(), walk.point());
        let Some(a) = walk.entered else {
            assert_eq!(cell, before);
            continue;
        };
        hits += 1;
        assert_eq!((0..3).map(|a| (cell[a] - before[a]).abs()).sum::<i32>(), 1);
        assert_eq!(point[a], f64::from(cell[a].max(before[a])));
        assert_eq!(walk.face(), a * 2 + usize::from(before[a] > cell[a]));
        let from = DVec3::from_array(cell.map(f64::from));
        assert!(point.cmpge(from).all() && point.cmple(from + 1.0).all());
    }
    assert!(hits > 4000, "{hits}");
}

#[test]
fn eight_rays_of_the_worst_kinds_meet_what_each_meets_alone() {
    let mut random = Random(0x2545_f491_4f6c_dd1d);
    for (name, voxels) in grids() {
        let grid = ready(&voxels);
        let size = DVec3::from_array(voxels.size().map(f64::from));
        let (mut hits, mut refused) = (0, 0);
        let mut last: Option<(Packet, GridRays)> = None;
        for round in 0..4_000 {
            let mut origins = DVec3x8::splat(DVec3::ZERO);
            let mut directions = origins;
            for lane in 0..LANES {
                let (origin, direction) = ray(&mut random, size);
                origins.set(lane, origin);
                directions.set(lane, direction);
            }
            let rays = GridRays::new(origins, directions, Mask8::ALL);
            // Every other time walks begin late, and end early.
            let (from, to) = if round % 2 == 0 { (-1.0, f64::INFINITY) } else { (random.next(), 1.0) };
            let stretch = Stretch { from: F64x8::splat(from), to: F64x8::splat(to) };
            let mut packet = Packet::begin(&rays, grid.seen.size, None, &stretch);
            let (other, other_rays) = last.get_or_insert((packet, rays));
            let begun = packet;
            let beside = (&*other, &*other_rays);
            let found = find_marked_in_all((&mut packet, &rays), beside, &grid.seen, Order::Exact);
            last = Some((begun, rays));
            let faces = packet.faces(&rays);
            for lane in 0..LANES {
                let (origin, direction) = (origins.get(lane), directions.get(lane));
                refused += u32::from(packet.refused.has(lane));
                if packet.refused.has(lane) {
                    continue;
                }
                let moment = if from > 0.0 { Moment::before(from) } else { Moment::START };
                let alone = GridRay::new(origin, direction)
                    .and_then(|ray| Walk::begin(ray, grid.seen.size, moment))
                    .and_then(|mut walk| {
                        let found = walk.find_marked(&grid.seen, f64::INFINITY);
                        (found != Found::Nothing).then_some(walk)
                    });
                let is_met = found.marked >> lane & 1 == 1;
                let Some(walk) = alone.filter(|walk| walk.t <= to) else {
                    // Where walks end is rounded: what lies a little behind may be found.
                    assert!(!is_met || faces.t.0[lane] > to, "{name}: {origin:?} {direction:?}");
                    continue;
                };
                hits += 1;
                let cell = [0, 1, 2].map(|a| faces.cell[a].0[lane]);
                let before = [0, 1, 2].map(|a| faces.before[a].0[lane]);
                assert!(is_met, "{name}: {origin:?} {direction:?} meets {:?}", walk.cell());
                assert_eq!(
                    (cell, before, faces.t.0[lane].to_bits(), faces.point.get(lane)),
                    (walk.cell(), walk.cell_before(), walk.t.to_bits(), walk.point()),
                    "{name}: from {origin:?} along {direction:?}"
                );
                assert_eq!(
                    (faces.face.0[lane] as usize, i64::from(faces.rank.0[lane])),
                    (walk.face(), walk.rank())
                );
            }
        }
        assert!(hits > 1000 || name == "nothing" || name == "thin", "{name}: {hits} hits");
        assert!(refused < 3000, "{name}: {refused} refused");
    }
}
