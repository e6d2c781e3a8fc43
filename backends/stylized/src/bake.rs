//! How are maps of strokes made?

use crate::hatch::{EDGE, STEPS, Set};

/// Maps of a pattern that repeats, at all its sizes.
#[derive(Debug)]
pub(crate) struct Maps {
    pub(crate) levels: Vec<Level>,
    /// Bytes from the lowest: distance and order of the nearest stroke of the first family, and of the second; those of
    /// strokes are signed, around [`MIDDLE`]. For pictures the lowest is the threshold, and nothing else. More room
    /// than there are texels: the lowest bits of any number are a place.
    texels: Box<[u32; ROOM]>,
}

/// A power of two above the number of texels of all maps.
const ROOM: usize = 1 << 17;

/// One of the maps.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Level {
    /// Texels along its edge, a power of two.
    pub(crate) size: u32,
    /// Its logarithm.
    pub(crate) shift: u32,
    /// Where its texels begin.
    pub(crate) first: u32,
}

/// What a signed distance of zero is stored as, and the steps of one in a texel.
pub(crate) const MIDDLE: f32 = 128.0;
pub(crate) const SIGNED_STEPS: f32 = 16.0;

/// Directions across the strokes of a set's families, of unit length; dots have none.
pub(crate) fn across(set: Set) -> Option<[[f32; 2]; 2]> {
    let unit = |f: Family| {
        let [a, b] = f.along.map(|c| c as f32);
        [a / a.hypot(b), b / a.hypot(b)]
    };
    matches!(set, Set::Pencil | Set::Ink).then(|| families(set).map(unit))
}

fn families(set: Set) -> [Family; 2] {
    let ink = |along, seed| Family { along, count: 32, wobble: 0.12, gap: 0.05, seed };
    match set {
        Set::Pencil => [
            Family { along: [1, 1], count: 32, wobble: 0.34, gap: 0.16, seed: 1 },
            Family { along: [1, 2], count: 16, wobble: 0.3, gap: 0.2, seed: 2 },
        ],
        _ => [ink([1, 1], 3), ink([1, -1], 4)],
    }
}

/// A picture in gray.
pub(crate) struct Picture {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) light: Vec<u8>,
}

/// Parallel strokes: where `a u + b v` is a whole number of `count`ths.
#[derive(Clone, Copy)]
struct Family {
    along: [i32; 2],
    count: u32,
    /// How far strokes swing, in distances of neighbors.
    wobble: f32,
    /// Share of a stroke that is lifted off the paper.
    gap: f32,
    seed: u32,
}

/// Bakes one of our own sets.
pub(crate) fn strokes(set: Set) -> Maps {
    let families = families(set);
    let mut maps = Maps::empty();
    for halvings in 0..SIZES {
        let size = EDGE >> halvings;
        maps.push(size, |x, y, _| {
            let [u, v] = [x, y].map(|c| (c as f32 + 0.5) / size as f32);
            let [first, second] = match set {
                Set::Dots => [0.0, 0.5].map(|shift| dot(u, v, shift, halvings, size)),
                _ => families.map(|f| f.nearest(u, v, halvings, size)),
            };
            first | second << 16
        });
    }
    maps
}

/// Bakes pictures from light to dark: each texel's threshold is that of the first picture with ink there.
pub(crate) fn images(pictures: &[Picture], thresholds: &[f32]) -> Maps {
    let mut maps = Maps::empty();
    maps.push(EDGE, |x, y, _| {
        let [u, v] = [x, y].map(|c| (c as f32 + 0.5) / EDGE as f32);
        let mut threshold = 1.25f32;
        for (picture, own) in pictures.iter().zip(thresholds) {
            // Gray is ink that comes later.
            let ink = 1.0 - picture.at(u, v);
            threshold = threshold.min(own + (1.25 - own) * (1.0 - (ink * 2.0).min(1.0)));
        }
        (threshold / 1.25 * 255.0).round() as u32
    });
    for halvings in 1..SIZES {
        let size = EDGE >> halvings;
        maps.push(size, |x, y, finer| {
            let at = |dx: u32, dy: u32| finer[((2 * y + dy) * 2 * size + 2 * x + dx) as usize];
            (at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) / 4
        });
    }
    maps
}

/// How many maps there are, each half as large as the one before: down to one that holds a single stroke.
const SIZES: u32 = 6;

fn packed(texels: f32, order: u32) -> u32 {
    (texels * STEPS).clamp(0.0, 255.0).round() as u32 | order.min(7) << 8
}

impl Maps {
    fn empty() -> Self {
        Self { levels: Vec::new(), texels: vec![0; ROOM].try_into().expect("as long") }
    }

    /// Makes the next map; a texel is made of its place and the texels of the map before.
    fn push(&mut self, size: u32, texel: impl Fn(u32, u32, &[u32]) -> u32) {
        let before =
            self.levels.last().map_or(0..0, |l| l.first as usize..(l.first + l.size * l.size) as usize);
        let (first, count) = (before.end, (size * size) as usize);
        let (finer, own) = self.texels[before.start..first + count].split_at_mut(before.len());
        for (i, own) in (0u32..).zip(own) {
            *own = texel(i % size, i / size, finer);
        }
        self.levels.push(Level { size, shift: size.trailing_zeros(), first: first as u32 });
    }

    pub(crate) fn bytes(&self) -> u64 {
        size_of_val(&*self.texels) as u64
    }

    /// Returns the texel at a place of a map, told by its row and column there.
    #[inline(always)]
    pub(crate) fn at(&self, level: &Level, place: u32) -> u32 {
        self.texels[(level.first + place) as usize % ROOM]
    }

    /// Returns the sums of the even bytes around a place, each times 256, and the nearest texel.
    #[inline(always)]
    pub(crate) fn between(&self, level: &Level, x: f32, y: f32) -> (u32, u32) {
        let (x0, y0) = (x.floor(), y.floor());
        let (fx, fy) = (((x - x0) * 16.0) as u32, ((y - y0) * 16.0) as u32);
        let mask = level.size as i32 - 1;
        let (column, row) = (x0 as i32 & mask, (y0 as i32 & mask) << level.shift);
        let (right, below) = ((column + 1) & mask, ((y0 as i32 + 1) & mask) << level.shift);
        let at = |place: i32| self.at(level, place as u32);
        let corners = [at(row | column), at(row | right), at(below | column), at(below | right)];
        let weights = [(16 - fx) * (16 - fy), fx * (16 - fy), (16 - fx) * fy, fx * fy];
        // Two sums in one word, each below 2^16.
        let sum = (0..4).fold(0u32, |sum, k| sum.wrapping_add((corners[k] & 0x00ff_00ff) * weights[k]));
        (sum, corners[usize::from(fx > 8) + 2 * usize::from(fy > 8)])
    }
}

impl Family {
    /// Returns distance and order of the nearest of the strokes that are left after so many halvings.
    fn nearest(&self, u: f32, v: f32, halvings: u32, size: u32) -> u32 {
        let [a, b] = self.along.map(|c| c as f32);
        let across = a * u + b * v;
        let length = a.hypot(b);
        // Along the stroke; whole numbers times the coordinates repeat with the pattern.
        let along = b * u - a * v;
        let left = (self.count >> halvings).max(1);
        let step = self.count / left;
        let near = (across * left as f32).round() as i32;
        let mut best = (f32::MAX, 0);
        for candidate in near - 1..=near + 1 {
            let number = candidate.rem_euclid(left as i32) as u32 * step;
            let swing = self.wobble / self.count as f32 * wave(along, number, self.seed);
            let aside = (across - candidate as f32 / left as f32 - swing) / length;
            let lifted = self.lifted(along, number);
            let distance = aside.hypot(lifted).copysign(aside) * size as f32;
            if distance.abs() < best.0.abs() {
                best = (distance, number);
            }
        }
        // The order counts among what is left; that of stroke 0 has no end.
        let among = best.1 / step;
        let order = if among == 0 { 7 } else { among.trailing_zeros() };
        (best.0 * SIGNED_STEPS + MIDDLE).clamp(0.0, 255.0).round() as u32 | order.min(7) << 8
    }

    /// Returns how far a place is from the end of the stroke, where the pen is lifted; 0 on the stroke.
    fn lifted(&self, along: f32, number: u32) -> f32 {
        let part = (along + noise(number, self.seed + 7)).rem_euclid(1.0);
        let beyond = (self.gap * 0.5 - (part - 0.5).abs()).max(0.0);
        beyond / (self.along[0] as f32).hypot(self.along[1] as f32)
    }
}

/// A swing that fits the period, from -1 to 1.
fn wave(along: f32, number: u32, seed: u32) -> f32 {
    let turn = std::f32::consts::TAU;
    let (p, q) = (noise(number, seed) * turn, noise(number, seed + 1) * turn);
    (along * turn + p).sin() * 0.6 + (along * 3.0 * turn + q).sin() * 0.4
}

/// A number from 0 to 1 for each pair.
pub(crate) fn noise(number: u32, seed: u32) -> f32 {
    let mut x = number.wrapping_mul(0x9e37_79b9) ^ seed.wrapping_mul(0x85eb_ca6b);
    x = (x ^ x >> 16).wrapping_mul(0x7feb_352d);
    x = (x ^ x >> 15).wrapping_mul(0x846c_a68b);
    (x ^ x >> 16) as f32 / u32::MAX as f32
}

/// Returns distance and order of the nearest dot of a square lattice.
fn dot(u: f32, v: f32, shift: f32, halvings: u32, size: u32) -> u32 {
    let count = 32u32 >> halvings;
    let [p, q] = [u, v].map(|c| c * count as f32 - shift);
    let near = [p, q].map(f32::round);
    let distance = (p - near[0]).hypot(q - near[1]) / count as f32 * size as f32;
    let order = near
        .map(|n| (n as i32).rem_euclid(count as i32) as u32)
        .map(|n| if n == 0 { 7 } else { n.trailing_zeros() });
    packed(distance, order[0].min(order[1]))
}

impl Picture {
    /// Returns the light at a place, from 0 to 1, the mean of the pixels that a texel covers.
    fn at(&self, u: f32, v: f32) -> f32 {
        let span = |c: f32, size: u32| {
            let wide = size as f32 / EDGE as f32;
            let first = ((c * size as f32 - wide * 0.5).floor().max(0.0) as u32).min(size - 1);
            let last = ((c * size as f32 + wide * 0.5).ceil() as u32).clamp(first + 1, size);
            first..last
        };
        let (columns, rows) = (span(u, self.width), span(v, self.height));
        let (mut sum, mut count) = (0u32, 0u32);
        for y in rows {
            for x in columns.clone() {
                sum += u32::from(self.light[(y * self.width + x) as usize]);
                count += 1;
            }
        }
        sum as f32 / (count.max(1) as f32 * 255.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads the distance of a texel.
    fn stored(set: Set, texel: u32) -> f32 {
        let byte = (texel & 255) as f32;
        if set == Set::Dots { byte / STEPS } else { ((byte - MIDDLE) / SIGNED_STEPS).abs() }
    }

    #[test]
    fn maps_repeat_without_a_seam_and_halve_the_strokes() {
        for set in [Set::Pencil, Set::Ink, Set::Dots] {
            let maps = strokes(set);
            assert_eq!(maps.levels.iter().map(|l| l.size).collect::<Vec<_>>(), [256, 128, 64, 32, 16, 8]);
            for level in &maps.levels[..4] {
                // Distances change by no more than the way to the next texel, over the seam as elsewhere. Between
                // lifted ends of strokes another may be the nearest, which is as far at that place.
                let size = level.size;
                let distance = |x: u32, y: u32| stored(set, maps.at(level, y % size * size + x % size));
                let jumps =
                    (0..size).filter(|&y| (distance(size - 1, y) - distance(size, y)).abs() > 1.3).count();
                assert!(jumps * 20 <= size as usize, "{set:?} {size}: {jumps} jumps");
                let count = size * size;
                let near = (0..count).filter(|&i| stored(set, maps.at(level, i)) < 1.0).count() as f32;
                let share = near / count as f32;
                assert!((0.05..0.5).contains(&share), "{set:?} {size}: {share} is near strokes");
            }
        }
    }

    #[test]
    fn a_picture_s_ink_has_its_level_s_threshold() {
        let half = |dark: u8| Picture { width: 2, height: 1, light: vec![dark, 255] };
        let maps = images(&[half(255), half(0)], &[0.2, 0.6]);
        let threshold = |x: u32| maps.at(&maps.levels[0], x) as f32 / 255.0 * 1.25;
        assert!((threshold(10) - 0.6).abs() < 0.01 && threshold(250) > 1.2);
    }
}
