//! Which strokes lie on a dark tone?
//!
//! Strokes are baked into maps, one for each halving of the pattern's size on the picture. A texel says how far the
//! middle of the nearest stroke is, and how often that stroke's number can be halved: its order. The width is laid
//! on in pixels when a pixel is drawn, so that it is the same near and far. From map to map every other stroke is
//! gone; it thins out on the way, and those that stay take on the threshold of their new order, so nothing pops. A
//! dark tone has the strokes of the lighter ones.
//!
//! Source: E. Praun, H. Hoppe, M. Webb, A. Finkelstein, *Real-time hatching*, SIGGRAPH 2001, with distances in place
//! of painted levels.

use crate::bake::{self, MIDDLE, Maps, SIGNED_STEPS};
use glam::Vec3;
use polyptych_core::lanes::{F32x8, LANES};
use polyptych_core::load::Limits;
use polyptych_core::load::image::decode;
use polyptych_core::seam::{Parameter, Settings};
use std::sync::Arc;

/// Texels along the edge of the largest map.
pub(crate) const EDGE: u32 = 256;
/// Steps of a stored distance in a texel.
pub(crate) const STEPS: f32 = 32.0;
/// Most levels of darkness, and most orders of strokes.
const MOST_LEVELS: usize = 8;
/// Most pixels of a picture of strokes.
const MOST_PIXELS: u64 = 1 << 24;

/// Why strokes cannot be had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct HatchError(String);

/// What strokes look like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Set {
    Pencil,
    Ink,
    Dots,
    Images,
}

/// What strokes stick to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sticks {
    /// The body, along the three axes of its space.
    Triplanar,
    /// The body, by its texture coordinates.
    Uv,
    /// The picture.
    Screen,
}

/// What maps are baked of.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Source {
    set: Set,
    images: String,
    /// Only pictures have theirs baked in; bits, to be compared.
    thresholds: Vec<u32>,
}

/// Strokes with their colors, ready to be laid on.
#[derive(Clone, Debug)]
pub(crate) struct Hatching {
    source: Source,
    maps: Arc<Maps>,
    /// Across the strokes of both families, where there are strokes.
    across: Option<[[f32; 2]; 2]>,
    pub(crate) set: Set,
    pub(crate) sticks: Sticks,
    pub(crate) scale: f32,
    pub(crate) color: Vec3,
    pub(crate) own: f32,
    pub(crate) opacity: f32,
    pub(crate) texture: f32,
    half_width: f32,
    /// Darkness at which a stroke of each order begins, for both families, and by what that changes until the next map;
    /// the first is for order 0.
    begins: [[[f32; 2]; MOST_LEVELS]; 2],
    /// Beyond this order nothing changes in each family.
    distinct: [usize; 2],
    /// The least of those of each family.
    earliest: [f32; 2],
    /// Darkness in which a stroke grows to its width.
    ramp: f32,
    /// Nothing is laid on what is lighter.
    pub(crate) lightest: f32,
}

impl Hatching {
    /// Reads what parameters say of strokes; nothing for none. Maps that are in `before` are not baked again.
    pub(crate) fn of(
        settings: &Settings,
        declared: &[Parameter],
        before: &[Arc<Self>],
    ) -> Result<Option<Arc<Self>>, HatchError> {
        let set = match settings.text(declared, "hatch") {
            "pencil" => Set::Pencil,
            "ink" => Set::Ink,
            "dots" => Set::Dots,
            "images" => Set::Images,
            _ => return Ok(None),
        };
        let float = |name: &str| settings.float(declared, name) as f32;
        let names = if set == Set::Images { settings.text(declared, "hatch.images") } else { "" };
        let files: Vec<&str> = names.split(',').map(str::trim).filter(|f| !f.is_empty()).collect();
        if set == Set::Images && files.is_empty() {
            return Ok(None);
        }
        if files.len() > 64 {
            return Err(HatchError(format!("hatch.images: name at most 64 pictures, not {}", files.len())));
        }
        let count = match set {
            Set::Pencil | Set::Ink => 4,
            Set::Dots => 1,
            Set::Images => files.len(),
        };
        let thresholds = thresholds(settings.text(declared, "hatch.thresholds"), set, count)?;
        let baked = if set == Set::Images { &thresholds[..] } else { &[] };
        let source =
            Source { set, images: names.to_owned(), thresholds: baked.iter().map(|t| t.to_bits()).collect() };
        let maps = match before.iter().find(|b| b.source == source) {
            Some(same) => same.maps.clone(),
            None if set == Set::Images => Arc::new(bake::images(&pictures(&files)?, &thresholds)),
            None => Arc::new(bake::strokes(set)),
        };
        let sticks = match settings.text(declared, "hatch.mapping") {
            "uv" => Sticks::Uv,
            "screen" => Sticks::Screen,
            _ => Sticks::Triplanar,
        };
        let begins = orders(&thresholds, set);
        let (ramp, thickness) = match set {
            Set::Pencil => (0.16, 0.5),
            Set::Ink => (0.1, 0.5),
            // A dot grows with all the darkness that is left: it is a screen.
            Set::Dots => (1.0 - thresholds[0], 2.4),
            Set::Images => (0.1, 0.5),
        };
        Ok(Some(Arc::new(Self {
            source,
            maps,
            across: bake::across(set),
            set,
            sticks,
            scale: float("hatch.scale"),
            color: settings.color(declared, "hatch.color"),
            own: float("hatch.own"),
            opacity: float("hatch.opacity"),
            texture: float("hatch.texture"),
            half_width: float("hatch.width") * thickness,
            begins,
            distinct: begins.map(|family| {
                let last = family[MOST_LEVELS - 1];
                family.iter().rposition(|of| *of != last).map_or(0, |order| order + 1)
            }),
            earliest: begins
                .map(|family| family.into_iter().map(|[begin, _]| begin).fold(f32::MAX, f32::min)),
            ramp: 1.0 / ramp.max(0.01),
            lightest: thresholds.iter().fold(f32::MAX, |a, &b| a.min(b))
                - if set == Set::Images { 0.06 } else { 0.0 },
        })))
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.maps.bytes()
    }

    /// Returns how much of eight pixels strokes cover, at places of the pattern (1 is its period), on so much darkness.
    /// `density` is how many texels of the largest map a pixel is wide.
    #[inline(always)]
    pub(crate) fn ink(&self, u: F32x8, v: F32x8, density: F32x8, darkness: F32x8) -> F32x8 {
        // The exponent of the density is the map, its mantissa the way to the next one.
        let bounded = density.max(F32x8::splat(2f32.powi(-20))).min(F32x8::splat(2f32.powi(20)));
        let bits = bounded.0.map(f32::to_bits);
        let halvings = bits.map(|b| (b >> 23) as i32 - 127);
        let mantissa = F32x8::new(bits.map(|b| f32::from_bits(b & 0x007f_ffff | 0x3f80_0000)));
        let places = Places { u, v, mantissa, darkness };
        let mut covered = self.on_map(halvings[0], &places);
        // Neighbors mostly have one map; where they do not, each map is read for all, and each pixel takes its own.
        let mut done = 1;
        while let Some(next) = (done..LANES).find(|&i| halvings[i] != halvings[done - 1]) {
            if !halvings[..next].contains(&halvings[next]) {
                let other = self.on_map(halvings[next], &places);
                for i in next..LANES {
                    if halvings[i] == halvings[next] {
                        covered.0[i] = other.0[i];
                    }
                }
            }
            done = next + 1;
        }
        covered
    }

    polyptych_core::for_registers! {
        /// Returns how much strokes of one map cover, that of so many halvings.
        ///
        /// A kernel of its own: within that which paints rows it would stand there several times, and leave that no
        /// room in the processor's cache of instructions.
        fn on_map(&self, halvings: i32, here: &Places) -> F32x8 = on_map_512, on_map_256, on_map_here;
    }

    #[inline(always)]
    fn on_map_here(&self, halvings: i32, here: &Places) -> F32x8 {
        let &Places { u, v, mantissa, darkness } = here;
        let (zero, one, half) = (F32x8::ZERO, F32x8::splat(1.0), F32x8::splat(0.5));
        let power = |exponent: i32| f32::from_bits(((exponent + 127) as u32) << 23);
        let last = self.maps.levels.len() as i32 - 1;
        let level = &self.maps.levels[halvings.clamp(0, last) as usize];
        // Beyond the smallest map strokes thin out.
        let (within, way, beyond) = if halvings > last {
            let far = mantissa * F32x8::splat(power(halvings - last));
            (far, zero, F32x8::splat(2.0) / far)
        } else {
            (mantissa, mantissa - one, one)
        };
        // Nearer than the largest map the pattern repeats more often: every other of its strokes lies where they lay.
        // Pictures have no such strokes.
        let repeats = if self.set == Set::Images { 1.0 } else { power(-halvings.min(0)) };
        let scale = F32x8::splat(repeats * level.size as f32);
        let (x, y) = (u * scale, v * scale);
        let mut texels = [0u32; LANES];
        let [first, second] = if let Some(across) = &self.across {
            // Strokes are straight over a texel: what lies between its middle and the place is added.
            let (column, row) = (floor(x), floor(y));
            let (right, down) = (x - column - half, y - row - half);
            let [columns, rows] = [column, row].map(|c| (c + F32x8::splat(WHOLE)).0.values());
            let (mask, shift) = (level.size - 1, level.shift);
            for i in 0..LANES {
                let place = (rows[i].to_bits() & mask) << shift | (columns[i].to_bits() & mask);
                texels[i] = self.maps.at(level, place);
            }
            [aside::<0>(&texels, right, down, &across[0]), aside::<16>(&texels, right, down, &across[1])]
        } else {
            let mut sums = [0u32; LANES];
            for i in 0..LANES {
                (sums[i], texels[i]) = self.maps.between(level, x.0[i] - 0.5, y.0[i] - 0.5);
            }
            let scale = F32x8::splat(1.0 / (256.0 * STEPS));
            [bits_at::<0, 0xffff>(&sums) * scale, bits_at::<16, 0xffff>(&sums) * scale]
        };
        if self.set == Set::Images {
            let threshold = first * F32x8::splat(1.25 * STEPS / 255.0);
            return ((darkness - threshold) * F32x8::splat(self.ramp) + half).max(zero).min(one);
        }
        let reach = Reach { way, thickness: F32x8::splat(self.half_width) * beyond, pixels: one / within };
        let mut clear = one;
        if darkness.above(F32x8::splat(self.earliest[0])).any() {
            clear = one - self.covered(0, bits_at::<8, 7>(&texels), first, darkness, &reach);
        }
        if darkness.above(F32x8::splat(self.earliest[1])).any() {
            clear = clear * (one - self.covered(1, bits_at::<24, 7>(&texels), second, darkness, &reach));
        }
        one - clear
    }

    /// Returns how much strokes of one family cover, by their orders and how far their middle is, in texels.
    #[inline(always)]
    fn covered(&self, family: usize, order: F32x8, distance: F32x8, darkness: F32x8, reach: &Reach) -> F32x8 {
        let &Reach { way, thickness, pixels } = reach;
        let (zero, one, half) = (F32x8::ZERO, F32x8::splat(1.0), F32x8::splat(0.5));
        // Few orders differ: to choose among them takes less than to look each pixel's up.
        let begins = &self.begins[family];
        let [mut begin, mut change] = begins[0].map(F32x8::splat);
        for (k, [begins, changes]) in (1u8..).zip(&begins[1..=self.distinct[family]]) {
            let reaches = order.at_least(F32x8::splat(f32::from(k)));
            begin = reaches.pick(F32x8::splat(*begins), begin);
            change = reaches.pick(F32x8::splat(*changes), change);
        }
        let stays = order.at_least(one);
        let thins = stays.pick(one, one - way);
        let grown = ((darkness - begin - change * way) * F32x8::splat(self.ramp)).max(zero).min(one);
        let grown = if self.set == Set::Dots { grown.sqrt() } else { grown };
        let reach = thickness * grown * thins;
        // A stroke thinner than a pixel covers as much of it as it is wide.
        let most = (reach + reach).min(one);
        (reach + half - distance * pixels).max(zero).min(most)
    }
}

/// What the strokes of both families at eight pixels have in common.
struct Reach {
    /// The way to the next map, from 0 to 1.
    way: F32x8,
    /// Half of a full stroke's width in pixels.
    thickness: F32x8,
    /// Pixels in a texel.
    pixels: F32x8,
}

/// Returns some bits of texels as numbers.
#[inline(always)]
fn bits_at<const SHIFT: u32, const MASK: u32>(texels: &[u32; LANES]) -> F32x8 {
    F32x8::new(texels.map(|t| (t >> SHIFT & MASK) as i32 as f32))
}

/// Returns how far the strokes of the family that is stored from a bit on are from places within their texels.
#[inline(always)]
fn aside<const SHIFT: u32>(texels: &[u32; LANES], right: F32x8, down: F32x8, across: &[f32; 2]) -> F32x8 {
    let middle = (bits_at::<SHIFT, 255>(texels) - F32x8::splat(MIDDLE)) * F32x8::splat(1.0 / SIGNED_STEPS);
    (middle + right * F32x8::splat(across[0]) + down * F32x8::splat(across[1])).abs()
}

#[inline(always)]
fn floor(numbers: F32x8) -> F32x8 {
    F32x8::new(numbers.0.map(f32::floor))
}

/// The lowest bits of a whole number are those of its sum with this one, unless it is so large that single precision
/// cannot tell where in the pattern it lies.
const WHOLE: f32 = 12_582_912.0;

/// Eight places on the pattern.
struct Places {
    u: F32x8,
    v: F32x8,
    /// Width of a pixel in texels of its map: from 1 to the next map's 2.
    mantissa: F32x8,
    darkness: F32x8,
}

/// Reads thresholds, or spreads them.
fn thresholds(text: &str, set: Set, count: usize) -> Result<Vec<f32>, HatchError> {
    let given: Vec<&str> = text.split(',').map(str::trim).filter(|t| !t.is_empty()).collect();
    if given.is_empty() {
        let (first, last) = match set {
            Set::Pencil => (0.22, 0.82),
            Set::Ink => (0.3, 0.86),
            Set::Dots => (0.35, 0.35),
            Set::Images => (0.15, 0.85),
        };
        let step = (last - first) / (count.max(2) - 1) as f32;
        return Ok((0..count).map(|i| first + step * i as f32).collect());
    }
    let parse = |t: &&str| t.parse::<f32>().ok().filter(|t| (0.0..=1.0).contains(t));
    let read: Option<Vec<f32>> = given.iter().map(parse).collect();
    let Some(read) = read else {
        return Err(HatchError(format!(
            "hatch.thresholds: `{text}`: write numbers from 0 to 1, separated by commas"
        )));
    };
    let most = if set == Set::Images { count } else { MOST_LEVELS };
    if read.len() > most || (set == Set::Images && read.len() < count) {
        let wanted = if set == Set::Images {
            format!("{count}, one for each picture")
        } else {
            format!("at most {most}")
        };
        return Err(HatchError(format!("hatch.thresholds: {} numbers: write {wanted}", read.len())));
    }
    Ok(read)
}

/// Returns at which darkness strokes of each order begin, for the two families, and by what that changes on the way to
/// the next map. The first half of the thresholds is that of the first family; the sparsest strokes come first.
fn orders(thresholds: &[f32], set: Set) -> [[[f32; 2]; MOST_LEVELS]; 2] {
    const NEVER: f32 = 9.0;
    let mut sorted = thresholds.to_vec();
    sorted.sort_by(f32::total_cmp);
    let middle = sorted.len().div_ceil(2);
    let families =
        if set == Set::Dots { [&sorted[..], &sorted[..]] } else { [&sorted[..middle], &sorted[middle..]] };
    let mut begins = [[[NEVER, 0.0]; MOST_LEVELS]; 2];
    for (family, of) in families.iter().enumerate().filter(|(_, of)| !of.is_empty()) {
        let of_order = |order: usize| of[of.len() - 1 - order.min(of.len() - 1)];
        for (order, begins) in begins[family].iter_mut().enumerate() {
            let change = if order == 0 { 0.0 } else { of_order(order - 1) - of_order(order) };
            *begins = [of_order(order), change];
        }
    }
    begins
}

/// Reads pictures of strokes.
fn pictures(files: &[&str]) -> Result<Vec<bake::Picture>, HatchError> {
    let limits = Limits { texture_pixels: MOST_PIXELS, ..Limits::default() };
    let read = |file: &&str| {
        let refuse = |reason: String| HatchError(format!("{file}: {reason}"));
        let length = std::fs::metadata(file).map_err(|e| refuse(e.to_string()))?.len();
        if length > MOST_PIXELS * 8 {
            return Err(refuse(format!("{length} bytes are too many for a picture of strokes")));
        }
        let bytes = std::fs::read(file).map_err(|e| refuse(e.to_string()))?;
        let picture = decode(&bytes, file, &limits).map_err(|e| HatchError(e.to_string()))?.to_luma8();
        Ok(bake::Picture { width: picture.width(), height: picture.height(), light: picture.into_raw() })
    };
    files.iter().map(read).collect()
}
