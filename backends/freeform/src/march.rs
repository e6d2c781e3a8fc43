//! How much light comes from a volume along stretches of eight rays?
//!
//! `P = sum_n I_n a_n prod_{m<n} (1 - a_m)`, front to back, with opacities corrected for the length of a sample.
//! What is all transparent is jumped as far as it reaches: its samples would add exactly nothing, and the samples
//! beyond stand where they would have stood, so the picture is the same, byte for byte.
//!
//! Each ray has a sample of its own. Rays look for one that adds something; those that found one wait until they are as
//! many as those that still look, and are then lit together. Which rays share registers changes no byte.

use crate::volume::{BORDER, Level};
use glam::{Mat3, Vec3, Vec4};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, I32x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::{Environment, Light, Material};
use polyptych_core::shade::{Surfaces, fogged};

/// Transparency at which a ray ends.
pub(crate) const OPAQUE: f32 = 1.0 / 1024.0;

const BLACK: Vec3x8 = Vec3x8 { x: F32x8::ZERO, y: F32x8::ZERO, z: F32x8::ZERO };

/// A light that reaches everything alike: volumes receive no shadow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shine {
    to_light: Vec3,
    radiance: Vec3,
}

impl Shine {
    /// Returns a light as it arrives at a place, if it does.
    pub(crate) fn arriving(light: &Light, at: glam::DVec3) -> Option<Self> {
        let a = light.arriving(at)?;
        Some(Self { to_light: a.to_light.as_vec3(), radiance: a.radiance })
    }
}

/// What eight rays gathered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gathered {
    pub(crate) color: Vec3x8,
    pub(crate) transparency: F32x8,
    /// Where half of the light was held back; infinity until it was.
    pub(crate) half: F64x8,
}

impl Gathered {
    pub(crate) const NOTHING: Self = Self {
        color: BLACK,
        transparency: F32x8::new([1.0; LANES]),
        half: F64x8::new([f64::INFINITY; LANES]),
    };

    /// Adds a layer in front of everything that follows on a ray.
    pub(crate) fn add(&mut self, lane: usize, color: Vec3, opacity: f32) {
        let transparency = self.transparency.0[lane];
        self.color.set(lane, self.color.get(lane) + color * (transparency * opacity));
        self.transparency.0[lane] = transparency * (1.0 - opacity);
    }
}

/// Eight rays in the object space of a volume, with its light.
pub(crate) struct March<'a> {
    pub(crate) level: &'a Level,
    /// The next coarser samples, and how long a pixel is in units of the level's spacing: at the rays' origins, and
    /// what each unit of distance adds.
    pub(crate) coarser: Option<(&'a Level, [f32; 2])>,
    pub(crate) material: &'a Material,
    pub(crate) environment: &'a Environment,
    pub(crate) shines: &'a [Shine],
    pub(crate) origin: DVec3x8,
    pub(crate) direction: DVec3x8,
    /// Where the rays enter the volume: sample `i` stands at `enter + (i + 1/2) step`, in world units.
    pub(crate) enter: F64x8,
    pub(crate) step: F64x8,
    /// Turns gradients of object space into normals of the world.
    pub(crate) normal_map: Mat3,
    pub(crate) to_eye: Vec3x8,
}

/// Samples along rays over the grid of a level.
struct Path {
    first: Vec3x8,
    step: Vec3x8,
    pace: Vec3x8,
}

/// Where eight samples are in the grid of a level.
#[derive(Clone, Copy)]
struct Place {
    whole: [I32x8; 3],
    part: Vec3x8,
}

/// Rays that found a sample that adds something, and what it is.
struct Found {
    waiting: Mask8,
    value: F32x8,
    opacity: F32x8,
}

impl March<'_> {
    polyptych_core::for_registers! {
        /// Adds the samples from the first numbers up to the second ones.
        pub(crate) fn run(&self, samples: [I32x8; 2], open: Mask8, sum: &mut Gathered) = run_512, run_256, run_here;
    }

    #[inline(always)]
    fn run_here(&self, [first, end]: [I32x8; 2], open: Mask8, sum: &mut Gathered) {
        let (path, one, opaque) = (self.path(), I32x8::splat(1), F32x8::splat(OPAQUE));
        let mut found = Found { waiting: Mask8::NONE, value: F32x8::ZERO, opacity: F32x8::ZERO };
        let mut i = first;
        let mut alive = open & i.below(end) & sum.transparency.at_least(opaque);
        loop {
            let searching = alive & !found.waiting;
            if is_outnumbered(searching, found.waiting) {
                if !found.waiting.any() {
                    return;
                }
                self.light(&path, i, &found, sum);
                i = I32x8::pick(found.waiting, i + one, i);
                alive = alive & i.below(end) & sum.transparency.at_least(opaque);
                found.waiting = Mask8::NONE;
                continue;
            }
            let free = path.at(i);
            let place = self.level.place(free);
            let reach = self.level.clear_around(&place);
            let clear = searching & !reach.below(one);
            if clear.any() {
                i = I32x8::pick(clear, i + path.jump(&place, reach, free), i);
                alive = alive & i.below(end);
                continue;
            }
            let value = self.value(i, &place);
            let opacity = self.level.table.opacities(value);
            let adds = searching & opacity.above(F32x8::ZERO);
            found.value = adds.pick(value, found.value);
            found.opacity = adds.pick(opacity, found.opacity);
            found.waiting = found.waiting | adds;
            i = I32x8::pick(searching & !adds, i + one, i);
            alive = alive & i.below(end);
        }
    }

    #[inline(always)]
    fn path(&self) -> Path {
        let level = self.level;
        let pace = DVec3x8::splat(level.spacing.recip());
        let start = self.enter + self.step * F64x8::splat(0.5);
        let entry = self.origin + self.direction.scaled(start) - DVec3x8::splat(level.corner);
        let shift = DVec3x8::splat(glam::DVec3::splat(BORDER as f64 - 0.5));
        let first = (entry * pace + shift).round();
        let step = (self.direction.scaled(self.step) * pace).round();
        let one = F32x8::splat(1.0);
        Path { first, step, pace: Vec3x8 { x: one / step.x, y: one / step.y, z: one / step.z } }
    }

    /// Returns how far samples are on their way from this level to the next coarser one, and where they are there.
    #[inline(always)]
    fn blend(&self, i: I32x8, place: &Place) -> Option<(&Level, F32x8, Place)> {
        let (coarser, [at, per_unit]) = self.coarser?;
        let t = (self.enter + (i.to_f64() + F64x8::splat(0.5)) * self.step).round();
        let size = F32x8::splat(at) + F32x8::splat(per_unit) * t;
        let share = (size - F32x8::splat(1.0)).max(F32x8::ZERO).min(F32x8::splat(1.0));
        Some((coarser, share, coarser.place(place.in_coarser())))
    }

    #[inline(always)]
    fn value(&self, i: I32x8, place: &Place) -> F32x8 {
        let fine = self.level.value(place);
        match self.blend(i, place) {
            None => fine,
            Some((coarser, share, place)) => fine + (coarser.value(&place) - fine) * share,
        }
    }

    /// Returns the slopes of the field over its grid.
    #[inline(always)]
    fn gradient(&self, i: I32x8, wanted: Mask8, place: &Place) -> Vec3x8 {
        let fine = self.level.gradient(place, wanted);
        match self.blend(i, place) {
            None => fine,
            Some((coarser, share, place)) => fine + (coarser.gradient(&place, wanted) - fine).scaled(share),
        }
    }

    /// Lights samples by the gradient of the field, or evenly where there is hardly any, and adds them.
    #[inline(always)]
    fn light(&self, path: &Path, i: I32x8, found: &Found, sum: &mut Gathered) {
        let (material, environment, waiting) = (self.material, self.environment, found.waiting);
        let place = self.level.place(path.at(i));
        let gradient = self.gradient(i, waiting, &place);
        let color = self.level.table.colors(found.value, waiting);
        let flat = F32x8::splat(self.level.least_gradient).at_least(gradient.length());
        let turn = |row: Vec3| Vec3x8::splat(-row).dot(gradient);
        let map = self.normal_map.transpose();
        let normal = Vec3x8 { x: turn(map.x_axis), y: turn(map.y_axis), z: turn(map.z_axis) };
        let normal = normal.scaled(F32x8::splat(1.0) / normal.length()).finite();
        let away = F32x8::ZERO.above(normal.dot(self.to_eye));
        let normal = Vec3x8::pick(away, BLACK - normal, normal);
        let surfaces = Surfaces { material, color, normal, to_eye: self.to_eye };
        let ambient = Vec3x8::splat(environment.ambient * material.ambient);
        let mut lit = Vec3x8::splat(material.emission) + color * ambient;
        for shine in self.shines {
            let (to_light, radiance) = (Vec3x8::splat(shine.to_light), Vec3x8::splat(shine.radiance));
            let evenly = color * radiance.scaled(F32x8::splat(material.diffuse * 0.5));
            let added = surfaces.lit_by(environment.lighting, to_light, radiance);
            lit = lit + Vec3x8::pick(flat, evenly, added);
        }
        let before = sum.transparency;
        let after = before * (F32x8::splat(1.0) - found.opacity);
        let half = F32x8::splat(0.5);
        let halved = waiting & before.above(half) & half.at_least(after);
        if halved.any() || environment.fog.is_some() {
            let t = self.enter + (i.to_f64() + F64x8::splat(0.5)) * self.step;
            let first = halved & sum.half.equal(F64x8::splat(f64::INFINITY));
            sum.half = F64x8::pick(first, t, sum.half);
            for lane in (0..LANES).filter(|&lane| waiting.has(lane) && environment.fog.is_some()) {
                lit.set(lane, fogged(environment, lit.get(lane), t.0[lane]));
            }
        }
        let added = sum.color + lit.scaled(before * found.opacity);
        sum.color = Vec3x8::pick(waiting, added, sum.color);
        sum.transparency = waiting.pick(after, before);
    }
}

impl Path {
    #[inline(always)]
    fn at(&self, i: I32x8) -> Vec3x8 {
        self.first + self.step.scaled(i.to_f32())
    }

    /// Returns how many samples on a ray is beyond the transparent box around its brick, or at its end.
    #[inline(always)]
    fn jump(&self, place: &Place, reach: I32x8, free: Vec3x8) -> I32x8 {
        // As far as single precision tells whole numbers apart.
        let mut count = F32x8::splat(4e6);
        for (axis, (free, step, pace)) in [
            (free.x, self.step.x, self.pace.x),
            (free.y, self.step.y, self.pace.y),
            (free.z, self.step.z, self.pace.z),
        ]
        .into_iter()
        .enumerate()
        {
            let brick = place.whole[axis].down(I32x8::splat(Level::BRICK_BITS));
            let forward = step.above(F32x8::ZERO);
            let side = I32x8::pick(forward, brick + reach, brick - reach + I32x8::splat(1));
            let side = side.up(I32x8::splat(Level::BRICK_BITS)).to_f32();
            let beyond = (side - free) * pace;
            count = (!step.equal(F32x8::ZERO)).pick(count.min(beyond), count);
        }
        // One sample less than the border: rounding never jumps over a brick that is not clear.
        let count = count.max(F32x8::ZERO).nearest_below();
        count.max(I32x8::splat(1))
    }
}

impl Level {
    #[inline(always)]
    fn place(&self, grid: Vec3x8) -> Place {
        let (mut whole, mut part) = ([I32x8::splat(0); 3], grid);
        for (axis, at) in [(0, &mut part.x), (1, &mut part.y), (2, &mut part.z)] {
            let last = F32x8::splat(self.size[axis] as f32 - 2.001);
            let inside = at.max(F32x8::splat(1.0)).min(last);
            whole[axis] = inside.nearest_below();
            *at = inside - whole[axis].to_f32();
        }
        Place { whole, part }
    }

    /// Tells how far around samples everything is transparent, in bricks.
    #[inline(always)]
    fn clear_around(&self, place: &Place) -> I32x8 {
        let brick = place.whole.map(|w| w.down(I32x8::splat(Self::BRICK_BITS)));
        let [nx, ny, _] = self.bricks.map(|n| I32x8::splat(n as i32));
        let at = (brick[2] * ny + brick[1]) * nx + brick[0];
        let mut reach = I32x8::splat(0);
        for i in 0..LANES {
            reach.0[i] = i32::from(self.clear[at.0[i] as usize]);
        }
        reach
    }

    /// Returns where samples begin in the list of values.
    #[inline(always)]
    fn index(&self, place: &Place) -> I32x8 {
        let [nx, ny, _] = self.size.map(|n| I32x8::splat(n as i32));
        (place.whole[2] * ny + place.whole[1]) * nx + place.whole[0]
    }

    /// Interpolates values.
    #[inline(always)]
    fn value(&self, place: &Place) -> F32x8 {
        let (row, plane) = (self.size[0], self.size[0] * self.size[1]);
        let (at, Vec3x8 { x, y, z }) = (self.index(place), place.part);
        let near = mix(self.row(at, 0, x), self.row(at, row, x), y);
        let far = mix(self.row(at, plane, x), self.row(at, plane + row, x), y);
        mix(near, far, z)
    }

    /// Interpolates along rows.
    #[inline(always)]
    fn row(&self, at: I32x8, offset: usize, x: F32x8) -> F32x8 {
        let (mut a, mut b) = (F32x8::ZERO, F32x8::ZERO);
        for i in 0..LANES {
            let pair = &self.values[at.0[i] as usize + offset..];
            (b.0[i], a.0[i]) = (pair[1], pair[0]);
        }
        mix(a, b, x)
    }

    /// Returns the slopes of the field where they are wanted, by central differences.
    #[inline(always)]
    fn gradient(&self, place: &Place, wanted: Mask8) -> Vec3x8 {
        let (row, plane) = (self.size[0], self.size[0] * self.size[1]);
        let at = self.index(place);
        let mut gradient = BLACK;
        for lane in 0..LANES {
            if !wanted.has(lane) {
                continue;
            }
            let part = place.part.get(lane);
            let slope = if self.gradients.is_empty() {
                let first = at.0[lane] as usize - plane - row - 1;
                let values = &self.values[first..first + 3 * plane + 3 * row + 4];
                Rows { values, row, plane }.differences(part)
            } else {
                self.kept_differences(at.0[lane] as usize, part)
            };
            gradient.set(lane, slope);
        }
        gradient * Vec3x8::splat((self.spacing * 2.0).recip().as_vec3())
    }

    /// The same from differences that were taken at the samples.
    #[inline(always)]
    fn kept_differences(&self, at: usize, part: Vec3) -> Vec3 {
        let (row, plane) = (self.size[0], self.size[0] * self.size[1]);
        let along = |at: usize| {
            let pair = &self.gradients[at..at + 2];
            pair[0] + (pair[1] - pair[0]) * part.x
        };
        let (near, far) = (along(at), along(at + plane));
        let near = near + (along(at + row) - near) * part.y;
        let far = far + (along(at + plane + row) - far) * part.y;
        (near + (far - near) * part.z).truncate()
    }
}

impl Place {
    /// Returns where the same places are in the grid of the next coarser level: two samples make one, borders aside.
    #[inline(always)]
    fn in_coarser(&self) -> Vec3x8 {
        let (half, border) = (F32x8::splat(0.5), F32x8::splat(BORDER as f32 - 0.5));
        let [x, y, z] = self.whole;
        Vec3x8 {
            x: (x.to_f32() + self.part.x - border) * half + border,
            y: (y.to_f32() + self.part.y - border) * half + border,
            z: (z.to_f32() + self.part.z - border) * half + border,
        }
    }
}

/// Tells whether there are less of some than of others, or none.
#[inline(always)]
fn is_outnumbered(some: Mask8, others: Mask8) -> bool {
    // Set lanes are -1 each. Added by halves, which the compiler does in registers.
    let mut sums = [0i32; LANES / 2];
    for (i, sum) in sums.iter_mut().enumerate() {
        let [low, high] = [i, i + LANES / 2].map(|i| some.0[i] as i32 - others.0[i] as i32);
        *sum = low + high;
    }
    sums[0] + sums[1] + (sums[2] + sums[3]) > 0 || !some.any()
}

#[inline(always)]
fn mix(a: F32x8, b: F32x8, share: F32x8) -> F32x8 {
    a + (b - a) * share
}

/// The values around a sample, from the one before and below in all axes on.
struct Rows<'a> {
    values: &'a [f32],
    row: usize,
    plane: usize,
}

impl Rows<'_> {
    /// Returns the four values of a row, counted from the one before the sample's.
    #[inline(always)]
    fn row(&self, y: usize, z: usize) -> Vec4 {
        Vec4::from_slice(&self.values[z * self.plane + y * self.row..])
    }

    /// Returns the differences of the values one sample behind and one before, along each axis.
    #[inline(always)]
    fn differences(&self, part: Vec3) -> Vec3 {
        let [x, y, z] = part.to_array();
        let (a, b) = (self.row(1, 1), self.row(2, 1));
        let near = a + (b - a) * y;
        let (c, d) = (self.row(1, 2), self.row(2, 2));
        let far = c + (d - c) * y;
        let r = near + (far - near) * z;
        let along_x = (r.z + (r.w - r.z) * x) - (r.x + (r.y - r.x) * x);
        let (low, high) = (b - self.row(0, 1), self.row(3, 1) - a);
        let rise_near = low + (high - low) * y;
        let (low, high) = (d - self.row(0, 2), self.row(3, 2) - c);
        let rise_far = low + (high - low) * y;
        let rise = rise_near + (rise_far - rise_near) * z;
        let (a, b) = (self.row(1, 0), self.row(2, 0));
        let before = a + (b - a) * y;
        let (a, b) = (self.row(1, 3), self.row(2, 3));
        let behind = a + (b - a) * y;
        let (a, b) = (far - before, behind - near);
        let deep = a + (b - a) * z;
        let along = |r: Vec4| r.y + (r.z - r.y) * x;
        Vec3::new(along_x, along(rise), along(deep))
    }
}
