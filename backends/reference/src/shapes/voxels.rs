//! Which cells of a grid does a ray pass, in exact order, and which is the first that shows?
//!
//! Source: J. Amanatides, A. Woo, *A Fast Voxel Traversal Algorithm for Ray Tracing*, Eurographics 1987. The
//! distance of a plane is always computed from its whole number, `(k - o) / d`, and never summed up, so that
//! errors do not grow. Planes at the same distance are crossed in the order x, y, z.

use crate::line::{Hit, Line, Span, Start};
use glam::DVec3;
use polyptych_core::math::Aabb;
use polyptych_core::scene::{CHUNK, Chunk, Voxels};

/// Finds the first entry into a cell of another value than the last that is accepted.
pub(crate) fn first(
    voxels: &Voxels,
    line: &Line,
    span: &Span,
    accept: &mut impl FnMut(&Hit) -> bool,
) -> Option<Hit> {
    let mut walk = Walk::new(voxels.size(), line)?;
    let mut previous = 0u8;
    loop {
        if walk.t > span.before {
            return None;
        }
        let value = match chunk_value(voxels, walk.cell) {
            ChunkValue::Empty => {
                previous = 0;
                if !walk.leave_chunk() {
                    return None;
                }
                continue;
            }
            ChunkValue::Cell(value) => value,
        };
        // A mirror ray that begins inside clear glass has entered it already; the accepting side knows glass.
        let inside_start = walk.face.is_none();
        if value != 0 && value != previous {
            let hit = Hit { slot: usize::from(value) - 1, ..Hit::plain(walk.t, walk.steps(), walk.normal()) };
            let counts = !inside_start || line.start == Start::Eye || span.any;
            if counts && span.holds(hit.t, hit.part) && accept(&hit) {
                return Some(hit);
            }
        }
        previous = value;
        if !walk.step() {
            return None;
        }
    }
}

enum ChunkValue {
    Empty,
    Cell(u8),
}

fn chunk_value(voxels: &Voxels, cell: [i64; 3]) -> ChunkValue {
    let [x, y, z] = cell.map(|c| c as u32);
    match voxels.chunk(voxels.index_of_chunk([x, y, z].map(|c| c / CHUNK))) {
        Chunk::Uniform(0) => ChunkValue::Empty,
        _ => ChunkValue::Cell(voxels.get(x, y, z)),
    }
}

/// A walk from cell to cell.
///
/// Invariant: the line is in `cell` from `t` on, until the nearest of the `next` planes.
struct Walk {
    origin: [f64; 3],
    direction: [f64; 3],
    size: [i64; 3],
    cell: [i64; 3],
    first_cell: [i64; 3],
    /// Distances of the planes through which the cell is left.
    next: [f64; 3],
    /// Where the cell was entered.
    t: f64,
    /// The axis of the face through which it was entered; nothing for a line that begins inside.
    face: Option<usize>,
}

impl Walk {
    fn new(size: [u32; 3], line: &Line) -> Option<Self> {
        if !line.direction.is_finite() || !line.origin.is_finite() || line.direction == DVec3::ZERO {
            return None;
        }
        let (origin, direction) = (line.origin.to_array(), line.direction.to_array());
        let bounds = Aabb::new(DVec3::ZERO, DVec3::from_array(size.map(f64::from)));
        let (near, _) = bounds.clip(line.origin, line.direction)?;
        let size = size.map(i64::from);
        let mut walk = Self {
            origin,
            direction,
            size,
            cell: [0; 3],
            first_cell: [0; 3],
            next: [f64::INFINITY; 3],
            t: near,
            face: None,
        };
        for a in 0..3 {
            let border = if direction[a] < 0.0 { size[a] } else { 0 };
            // The last axis in the order of crossing is the face of entry.
            if direction[a] != 0.0 && walk.plane(a, border) == near && walk.outside(a) {
                walk.face = Some(a);
            }
        }
        for a in 0..3 {
            walk.cell[a] = walk.cell_at(a, near);
            walk.next[a] = walk.exit(a);
        }
        walk.first_cell = walk.cell;
        Some(walk)
    }

    /// Tells whether the origin lies outside of the grid, or on its border, on the side that faces the line.
    fn outside(&self, a: usize) -> bool {
        if self.direction[a] < 0.0 { self.origin[a] >= self.size[a] as f64 } else { self.origin[a] <= 0.0 }
    }

    /// Returns the distance of a plane between cells.
    fn plane(&self, a: usize, k: i64) -> f64 {
        (k as f64 - self.origin[a]) / self.direction[a]
    }

    /// Returns the distance at which the cell is left along an axis.
    fn exit(&self, a: usize) -> f64 {
        if self.direction[a] == 0.0 {
            return f64::INFINITY;
        }
        self.plane(a, self.cell[a] + i64::from(self.direction[a] > 0.0))
    }

    /// Returns the cell along an axis after all planes up to a distance were crossed, within the grid.
    fn cell_at(&self, a: usize, t: f64) -> i64 {
        let place = self.origin[a] + self.direction[a] * t;
        let last = self.size[a] - 1;
        let mut k = (place.floor() as i64).clamp(0, last);
        let d = self.direction[a];
        // The rounded place may be a cell off: the planes decide.
        if d > 0.0 {
            while k < last && self.plane(a, k + 1) <= t {
                k += 1;
            }
            while k > 0 && self.plane(a, k) > t {
                k -= 1;
            }
        } else if d < 0.0 {
            while k > 0 && self.plane(a, k) <= t {
                k -= 1;
            }
            while k < last && self.plane(a, k + 1) > t {
                k += 1;
            }
        }
        k
    }

    fn nearest_axis(next: &[f64; 3]) -> usize {
        let a = usize::from(next[1] < next[0]);
        if next[2] < next[a] { 2 } else { a }
    }

    /// Goes to the next cell; false where the grid ends.
    fn step(&mut self) -> bool {
        let a = Self::nearest_axis(&self.next);
        self.cross(a)
    }

    fn cross(&mut self, a: usize) -> bool {
        self.t = self.next[a].max(0.0);
        self.face = Some(a);
        self.cell[a] += if self.direction[a] < 0.0 { -1 } else { 1 };
        self.next[a] = self.exit(a);
        self.t.is_finite() && (0..self.size[a]).contains(&self.cell[a])
    }

    /// Goes to the first cell behind the chunk, the same that single steps would reach.
    fn leave_chunk(&mut self) -> bool {
        let chunk = i64::from(CHUNK);
        let exits: [f64; 3] = std::array::from_fn(|a| {
            let first = self.cell[a] / chunk * chunk;
            let end = (first + chunk).min(self.size[a]);
            match self.direction[a] {
                0.0 => f64::INFINITY,
                d => self.plane(a, if d < 0.0 { first } else { end }),
            }
        });
        let out = Self::nearest_axis(&exits);
        let t = exits[out];
        if !t.is_finite() {
            return false;
        }
        for a in 0..3 {
            let (first, last) = (self.cell[a] / chunk * chunk, self.cell[a] / chunk * chunk + chunk - 1);
            if a == out {
                self.cell[a] = if self.direction[a] < 0.0 { first } else { last.min(self.size[a] - 1) };
            } else if self.direction[a] != 0.0 {
                // Planes before this one in the order (distance, axis) are crossed first.
                let crossed = |p: f64| p < t || (p == t && a < out);
                let place = (self.origin[a] + self.direction[a] * t).floor() as i64;
                let (begin, end) = if self.direction[a] < 0.0 {
                    (first, self.cell[a])
                } else {
                    (self.cell[a], last.min(self.size[a] - 1))
                };
                let mut k = place.clamp(begin, end);
                if self.direction[a] > 0.0 {
                    while k < end && crossed(self.plane(a, k + 1)) {
                        k += 1;
                    }
                    while k > begin && !crossed(self.plane(a, k)) {
                        k -= 1;
                    }
                } else {
                    while k > begin && crossed(self.plane(a, k)) {
                        k -= 1;
                    }
                    while k < end && !crossed(self.plane(a, k + 1)) {
                        k += 1;
                    }
                }
                self.cell[a] = k;
            }
            self.next[a] = self.exit(a);
        }
        self.cross(out)
    }

    /// Counts the cells passed so far.
    fn steps(&self) -> i64 {
        (0..3).map(|a| (self.cell[a] - self.first_cell[a]).abs()).sum()
    }

    /// Returns the outward normal of the face entered; against the longest axis for a line that begins inside.
    fn normal(&self) -> DVec3 {
        let d = self.direction.map(f64::abs);
        let longest = if d[0] >= d[1] && d[0] >= d[2] {
            0
        } else if d[1] >= d[2] {
            1
        } else {
            2
        };
        let a = self.face.unwrap_or(longest);
        DVec3::AXES[a] * if self.direction[a] < 0.0 { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hash(x: u32, y: u32, z: u32) -> u32 {
        let mut h = x.wrapping_mul(374_761_393) ^ y.wrapping_mul(668_265_263) ^ z.wrapping_mul(2_147_483_647);
        h = (h ^ (h >> 13)).wrapping_mul(1_274_126_177);
        h ^ (h >> 16)
    }

    fn line(origin: DVec3, direction: DVec3) -> Line {
        Line { origin, direction, start: Start::Eye }
    }

    /// The nearest filled cell by a slab test of every cell.
    fn brute(voxels: &Voxels, line: &Line) -> Option<f64> {
        let mut best = None;
        voxels.for_each_filled(|[x, y, z], _| {
            let min = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
            // A ray within a plane between cells is in the upper one, but for the last.
            let beside = |a: usize| {
                let o = line.origin[a].min(f64::from(voxels.size()[a]) - 0.5);
                line.direction[a] == 0.0 && line.origin[a] >= 0.0 && o.floor() != min[a]
            };
            if (0..3).any(beside) {
                return;
            }
            if let Some((near, far)) = Aabb::new(min, min + 1.0).clip(line.origin, line.direction)
                && far > near
                && best.is_none_or(|b| near < b)
            {
                best = Some(near);
            }
        });
        best
    }

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64
    }

    #[test]
    fn the_walk_agrees_with_a_test_of_every_cell() {
        let size = [70, 9, 66];
        // Two far clusters: several chunks are empty.
        let voxels =
            Voxels::from_fn(size, |x, y, z| u8::from(hash(x, y, z).is_multiple_of(15) && (x < 6 || z > 62)));
        let mut s = 99;
        let mut hits = 0;
        for i in 0..1500 {
            let mut v = || DVec3::new(random(&mut s), random(&mut s), random(&mut s));
            let extent = DVec3::new(70.0, 9.0, 66.0);
            let (mut origin, target) = ((v() * 3.0 - 1.0) * extent, v() * extent);
            if i % 4 == 0 {
                origin = origin.floor();
            }
            let mut direction = target - origin;
            if i % 5 == 0 {
                direction[i % 3] = if i % 2 == 0 { 0.0 } else { -0.0 };
            }
            let line = line(origin, direction.normalize_or(DVec3::X));
            let found = first(&voxels, &line, &Span::WHOLE, &mut |_| true).map(|h| h.t);
            match (found, brute(&voxels, &line)) {
                (Some(a), Some(b)) => {
                    assert!((a - b).abs() < 1e-9, "{a} and {b} for {line:?}");
                    hits += 1;
                }
                (None, None) => {}
                other => panic!("{other:?} for {line:?}"),
            }
        }
        assert!(hits > 250, "{hits}");
    }

    #[test]
    fn skipping_empty_chunks_changes_nothing() {
        let size = [300, 5, 200];
        let mut sparse = Voxels::new(size);
        for (x, y, z) in [(299, 2, 199), (150, 1, 100), (3, 4, 190)] {
            sparse.set(x, y, z, 7);
        }
        // The same cells in chunks that are not marked as empty.
        let mut dense = sparse.clone();
        for z in (0..200).step_by(40) {
            for x in (0..300).step_by(40) {
                dense.set(x, 0, z, 1);
                dense.set(x, 0, z, 0);
            }
        }
        let mut s = 3;
        for _ in 0..20_000 {
            let mut v = || DVec3::new(random(&mut s), random(&mut s), random(&mut s));
            let origin = (v() * 2.0 - 0.5) * DVec3::new(300.0, 5.0, 200.0);
            let target = DVec3::new(150.0, 1.0, 100.0) + v().floor() + v().round();
            let line = line(origin, (target - origin).normalize_or(DVec3::Z));
            let hit = |v: &Voxels| first(v, &line, &Span::WHOLE, &mut |h| h.slot == 6).map(|h| (h.t, h.part));
            assert_eq!(hit(&sparse), hit(&dense), "{line:?}");
        }
    }

    #[test]
    fn inside_on_borders_and_wild_rays_are_safe() {
        let voxels = Voxels::from_fn([4, 4, 4], |x, _, _| u8::from(x == 2));
        let hit = |o: [f64; 3], d: [f64; 3]| {
            first(&voxels, &line(o.into(), d.into()), &Span::WHOLE, &mut |_| true)
                .map(|h| (h.t, h.normal.to_array()))
        };
        assert_eq!(hit([2.5, 0.5, 0.5], [0.1, -0.9, 0.2]), Some((0.0, [0.0, 1.0, 0.0])));
        assert_eq!(hit([0.0, 1.0, 1.0], [1.0, -0.0, 0.0]), Some((2.0, [-1.0, 0.0, 0.0])));
        assert_eq!(hit([4.0, 4.0, 4.0], [-1.0, 0.0, 0.0]), Some((1.0, [1.0, 0.0, 0.0])));
        assert_eq!(hit([2.0, 1.5, 1.5], [1.0, 0.0, 0.0]).map(|h| h.0), Some(0.0));
        assert_eq!(hit([3.0, 1.5, 1.5], [1.0, 0.0, 0.0]), None);
        for wild in [f64::NAN, f64::INFINITY, 0.0] {
            assert_eq!(hit([1.0, 1.0, 1.0], [wild, wild, wild]), None);
        }
        assert_eq!(hit([0.5, 0.5, 0.5], [1e-300, 0.0, 0.0]).map(|h| h.1), Some([-1.0, 0.0, 0.0]));
    }

    #[test]
    fn equal_glass_is_one_body_and_other_glass_another() {
        let voxels = Voxels::from_bytes([5, 1, 1], &[1, 1, 2, 0, 2]);
        let line = line(DVec3::new(-1.0, 0.5, 0.5), DVec3::X);
        let mut entries = Vec::new();
        first(&voxels, &line, &Span::WHOLE, &mut |h| {
            entries.push((h.t, h.slot));
            false
        });
        assert_eq!(entries, [(1.0, 0), (3.0, 1), (5.0, 1)]);
    }
}
