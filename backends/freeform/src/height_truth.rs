//! Do rays meet height fields where they do when every cell under them is looked at, one by one?

use crate::height_ranges::Ranges;
use crate::height_walk::Walk;
use glam::{DVec2, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8};
use polyptych_core::scene::HeightField;

/// Numbers in `[0, 1)` from a shift register of 64 bits.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn below(&mut self, count: u32) -> u32 {
        (self.next() * f64::from(count)) as u32
    }

    /// A place from -0.5 to 0.5.
    fn place(&mut self) -> f64 {
        self.next() - 0.5
    }
}

/// A ray in object space between two distances.
#[derive(Clone, Copy, Debug)]
struct Ray {
    origin: DVec3,
    direction: DVec3,
    near: f64,
    far: f64,
}

impl Ray {
    /// Returns how far above the surface of a cell's patch the ray is.
    fn above(&self, field: &HeightField, cell: [u32; 2], t: f64) -> f64 {
        let p = self.origin + self.direction * t;
        let grid = field.grid_from_plane(p.x, p.z) - DVec2::new(f64::from(cell[0]), f64::from(cell[1]));
        let [h00, h10, h01, h11] = field.cell(cell[0], cell[1]);
        let (front, back) = (h00 + (h10 - h00) * grid.x, h01 + (h11 - h01) * grid.x);
        p.y - (front + (back - front) * grid.y)
    }

    /// Finds where it meets the surface first, without leaving out any cell: from one border between cells to the
    /// next the height above the surface is a parabola, told by three of its points.
    fn meet(&self, field: &HeightField) -> Option<f64> {
        let start = field.grid_from_plane(self.origin.x, self.origin.z);
        let slope = DVec2::new(self.direction.x, self.direction.z) / field.cell_size();
        let mut borders = vec![self.near, self.far];
        for (axis, count) in [field.columns(), field.rows()].into_iter().enumerate() {
            let times = (0..count).map(|line| (f64::from(line) - start[axis]) / slope[axis]);
            borders.extend(times.filter(|t| *t > self.near && *t < self.far));
        }
        borders.sort_by(f64::total_cmp);
        borders.windows(2).find_map(|w| {
            let middle = (start + slope * (0.5 * (w[0] + w[1]))).floor();
            let inside = |v: f64, count: u32| v.clamp(0.0, f64::from(count - 2)) as u32;
            let cell = [inside(middle.x, field.columns()), inside(middle.y, field.rows())];
            let [a, b, c] = [0.0, 0.5, 1.0].map(|s| self.above(field, cell, w[0] + (w[1] - w[0]) * s));
            first_zero(a, b, c).map(|s| w[0] + (w[1] - w[0]) * s)
        })
    }
}

/// Finds the first zero between 0 and 1 of the parabola with some values at 0, 1/2 and 1: by halving, on either side of
/// where it turns.
fn first_zero(start: f64, middle: f64, end: f64) -> Option<f64> {
    let bend = 2.0 * (start - 2.0 * middle + end);
    let slope = end - start - bend;
    let value = |s: f64| (bend * s + slope) * s + start;
    // A ray within the surface sees no more of it than its edge: nothing.
    if start == 0.0 && middle == 0.0 && end == 0.0 {
        return None;
    }
    let turn = (-slope / (2.0 * bend)).clamp(0.0, 1.0);
    let turn = if turn.is_nan() { 0.5 } else { turn };
    [(0.0, turn), (turn, 1.0)].into_iter().find_map(|(mut low, mut high)| {
        let rises = value(low) <= 0.0;
        if value(low) == 0.0 {
            return Some(low);
        }
        if (value(high) >= 0.0) != rises {
            return None;
        }
        for _ in 0..60 {
            let at = 0.5 * (low + high);
            *(if (value(at) >= 0.0) == rises { &mut high } else { &mut low }) = at;
        }
        Some(high)
    })
}

/// Makes a field of some kind: bumps, a plain with spikes, terraces, or a flat one.
fn field(kind: u32, random: &mut Random) -> HeightField {
    let (columns, rows) = (2 + random.below(70), 2 + random.below(50));
    let extent = DVec2::new(1.0 + 9.0 * random.next(), 1.0 + 9.0 * random.next());
    let height = |random: &mut Random| match kind % 4 {
        0 => random.next() - 0.3,
        1 => f64::from(u32::from(random.below(40) == 0)) * 900.0 + 0.01 * random.next(),
        2 => f64::from(random.below(4)) * 0.25 + 1000.0,
        _ => 0.5,
    };
    let heights = (0..columns * rows).map(|_| height(random) as f32).collect();
    HeightField::new(columns, rows, extent, heights).unwrap()
}

/// Aims a ray at a place near the surface: from anywhere, straight up or down, along a row, along a border between
/// cells, from far away, or from under the surface.
fn ray(field: &HeightField, kind: u32, random: &mut Random) -> Option<Ray> {
    let (mut bounds, cell) = (field.bounds(), field.cell_size());
    // So that rays reach a flat field from somewhere.
    bounds.min.y -= 1e-3 * field.extent().x;
    bounds.max.y += 1e-3 * field.extent().x;
    let size = bounds.size();
    let mut target = bounds.center() + size * DVec3::new(random.place(), random.place(), random.place());
    let reach = size.max_element() * if kind % 6 == 4 { 1e5 } else { 1.0 };
    let mut origin = target + DVec3::new(random.place(), random.place(), random.place()) * 2.0 * reach;
    match kind % 6 {
        1 => (origin.x, origin.z) = (target.x, target.z),
        2 => origin.z = target.z,
        3 => {
            let corner = field.vertex(random.below(field.columns()), random.below(field.rows()));
            (target.x, target.z) = (corner.x, corner.z);
            if random.below(2) == 0 {
                origin.x = target.x;
            } else {
                origin += DVec3::new(cell.x, 0.0, cell.y) * (corner - origin).dot(DVec3::X).round();
            }
        }
        5 => origin = target + size * DVec3::new(random.place(), -random.next(), random.place()),
        _ => {}
    }
    let direction = (target - origin).try_normalize()?;
    let (near, far) = bounds.clip(origin, direction)?;
    (near < far).then_some(Ray { origin, direction, near, far })
}

/// Counts rays, those of them that meet something, and those of which it is not the same as when all cells are looked at.
fn count(rays: u32, seed: u64) -> [u32; 3] {
    let (mut random, mut counts) = (Random(seed), [0; 3]);
    while counts[0] < rays {
        let field = field(random.below(4), &mut random);
        let ranges = Ranges::new(&field);
        for _ in 0..24 {
            let made = [(); LANES].map(|()| ray(&field, random.below(6), &mut random));
            let mut open = Mask8::NONE;
            let (mut origin, mut direction) = (DVec3x8::splat(DVec3::ZERO), DVec3x8::splat(DVec3::Y));
            let (mut near, mut far) = (F64x8::ZERO, F64x8::ZERO);
            for (i, ray) in made.iter().enumerate() {
                let Some(ray) = ray else { continue };
                open.0[i] = u32::MAX;
                origin.set(i, ray.origin);
                direction.set(i, ray.direction);
                (near.0[i], far.0[i]) = (ray.near, ray.far);
            }
            let mut walk = Walk::start(&field, &ranges, (&origin, &direction), (near, far), open);
            while walk.open.any() {
                walk.step(&field, &ranges);
            }
            let (met, t) = walk.met();
            for (i, ray) in made.iter().enumerate().filter_map(|(i, r)| r.as_ref().map(|r| (i, r))) {
                let (truth, found) = (ray.meet(&field), met.has(i).then_some(t.0[i]));
                // Where rays come from far away their places are known no better.
                let close = 1e-9 * field.bounds().size().max_element() + 1e-13 * ray.far;
                let right = match (truth, found) {
                    (Some(a), Some(b)) => (a - b).abs() <= close * 10.0,
                    (None, None) => true,
                    _ => false,
                };
                if !right {
                    println!("{truth:?} {found:?} {ray:?} {}x{}", field.columns(), field.rows());
                }
                let add = [1, u32::from(truth.is_some()), u32::from(!right)];
                counts = [0, 1, 2].map(|k| counts[k] + add[k]);
            }
        }
    }
    counts
}

#[test]
fn rays_meet_what_they_meet_cell_by_cell() {
    let [rays, hits, wrong] = count(3000, 1);
    assert!(hits > rays / 3 && wrong == 0, "{wrong} of {rays} rays wrong, {hits} hits");
}

/// `cargo test --release -p polyptych-freeform -- --ignored --nocapture cell_by_cell`
#[test]
#[ignore = "looks at every cell under a hundred thousand rays"]
fn a_hundred_thousand_rays_meet_what_they_meet_cell_by_cell() {
    let [rays, hits, wrong] = count(100_000, 2);
    println!("{rays} rays, {hits} hits, {wrong} wrong");
    assert!(hits > rays / 3 && wrong == 0);
}
