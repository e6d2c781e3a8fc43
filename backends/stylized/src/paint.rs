//! From visible surfaces to colors: tone, highlights, strokes, paper, and lines on top, row by row.

use crate::cracks::shows_nothing;
use crate::hatch::{EDGE, Hatching, Sticks};
use crate::ink::{Ink, Sheaf};
use crate::light::Lighting;
use crate::paper::Grain;
use crate::style::{Highlight, Paper, Show, Style, Styles};
use glam::{DVec3, Mat3, Vec3};
use polyptych_core::camera::{Camera, Projection, RowDirections, View};
use polyptych_core::framebuffer::{Band, Framebuffer};
use polyptych_core::lanes::{F32x8, F64x8, I32x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::{Object, Scene};
use polyptych_core::shade::{fogged, highlight};

/// Rows drawn by one worker at a time.
pub(crate) const ROWS: u32 = 32;
/// Columns whose background is filled at once.
const GROUND: usize = 64;

/// How an object takes paint: what is the same for all its pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Look {
    pub(crate) specular: f32,
    pub(crate) shininess: f32,
    /// Cosine below which its highlight is less than a five-hundredth: not seen.
    pub(crate) faint: f32,
    /// Whether its color channel holds texture coordinates and the slot of its material.
    pub(crate) is_coded: bool,
    /// Edge of the strokes' pattern in object space, before scaling.
    pub(crate) period: f64,
    /// From places relative to the eye to the pattern.
    pub(crate) pattern: Mat3,
    /// Where the eye is in the pattern.
    pub(crate) eye: Vec3,
    /// Turns normals to the body's axes.
    pub(crate) turn: Mat3,
    /// Pattern in a meter.
    pub(crate) repeats: f32,
}

/// Buffers of a band.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Cosines to the light of the band's rows, and of one more on each side.
    facing: Vec<f32>,
    pub(crate) ink: Ink,
}

impl Scratch {
    pub(crate) fn bytes(&self) -> usize {
        self.facing.capacity() * 4 + self.ink.bytes()
    }
}

impl Look {
    /// Places the pattern for a frame.
    pub(crate) fn place(&mut self, object: &Object, camera: &Camera, scale: f32) {
        let period = self.period * f64::from(scale);
        if !(period > 0.0 && period.is_finite()) {
            return;
        }
        let from_world = object.world_from_object.inverse();
        self.pattern = (from_world.matrix3 * (1.0 / period)).as_mat3();
        // Whole periods away it is the same, and nearer to the numbers that can be told apart.
        let eye = from_world.transform_point3(camera.eye) / period;
        self.eye = (eye - eye.floor()).as_vec3();
        let turn = object.world_from_object.matrix3.transpose();
        let largest =
            [turn.x_axis, turn.y_axis, turn.z_axis].iter().map(|a| a.abs().max_element()).fold(0.0, f64::max);
        self.turn = (turn * (1.0 / largest)).as_mat3();
        self.repeats = (from_world.matrix3.determinant().abs().cbrt() / period) as f32;
    }
}

/// What one frame is painted with.
pub(crate) struct Painting<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) styles: &'a Styles,
    pub(crate) looks: &'a [Look],
    pub(crate) view: View<'a>,
    pub(crate) camera: &'a Camera,
    pub(crate) visible: &'a Framebuffer,
    pub(crate) light: Lighting<'a>,
    pub(crate) grain: &'a Grain,
    pub(crate) lines: &'a Sheaf,
    /// Nearest and farthest distance of the scene, to show depth.
    pub(crate) depths: [f32; 2],
    pub(crate) any_coded: bool,
}

/// Eight pixels of a row.
#[derive(Clone, Copy)]
struct Eight {
    x: u32,
    y: u32,
    count: usize,
    first: usize,
    /// Unit vectors from the eye.
    direction: Vec3x8,
}

/// Reads up to eight vectors; the rest are zero.
#[inline(always)]
fn gather(from: &[Vec3], first: usize, count: usize) -> Vec3x8 {
    let mut all = Vec3x8::splat(Vec3::ZERO);
    if count == LANES {
        let eight: &[Vec3; LANES] = from[first..first + LANES].try_into().expect("eight vectors");
        for (lane, v) in eight.iter().enumerate() {
            (all.x.0[lane], all.y.0[lane], all.z.0[lane]) = (v.x, v.y, v.z);
        }
    } else {
        from[first..first + count].iter().enumerate().for_each(|(lane, v)| all.set(lane, *v));
    }
    all
}

#[inline(always)]
fn numbers(from: &[f32], first: usize, count: usize) -> F32x8 {
    if count == LANES {
        return F32x8::load(&from[first..]);
    }
    let mut all = F32x8::ZERO;
    all.0[..count].copy_from_slice(&from[first..first + count]);
    all
}

impl Painting<'_> {
    /// Paints a band with the widest registers there are; the bytes do not depend on them.
    pub(crate) fn draw(&self, band: &mut Band<'_>, scratch: &mut Scratch) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for a processor feature can only be called so"
            )]
            // SAFETY: the processor has the feature that the kernel was compiled for; it was just asked.
            return unsafe { self.band_avx2(band, scratch) };
        }
        self.band(band, scratch);
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn band_avx2(&self, band: &mut Band<'_>, scratch: &mut Scratch) {
        self.band(band, scratch);
    }

    #[inline(always)]
    fn band(&self, band: &mut Band<'_>, scratch: &mut Scratch) {
        let (width, first) = (band.width, band.first_row);
        let Scratch { facing, ink } = scratch;
        let stride = width as usize + 2 * LANES;
        facing.resize(stride * (ROWS as usize + 2), 0.0);
        if self.styles.all[0].show == Show::Style {
            let steps = self.styles.all.iter().any(|s| s.tone.steps > 1);
            let around = u32::from(steps);
            let rows = first.saturating_sub(around)..(first + band.rows + around).min(self.visible.height());
            for y in rows {
                let row = (y + 1 - first) as usize * stride;
                self.face(y, &mut facing[row..row + stride]);
            }
            // Beyond the picture it goes on as it is.
            if first == 0 {
                facing.copy_within(stride..2 * stride, 0);
            }
            if first + band.rows == self.visible.height() {
                let last = band.rows as usize * stride;
                facing.copy_within(last..last + stride, last + stride);
            }
        }
        let lines = self.styles.draw_lines();
        if lines {
            ink.clear(width, band.rows);
            for stroke in self.lines.of_band((first / ROWS) as usize) {
                ink.draw(stroke, self.styles, first, band.rows);
            }
        }
        for row in 0..band.rows {
            let y = first + row;
            let colors = &mut band.color[(row * width) as usize..((row + 1) * width) as usize];
            self.row(y, (row as usize + 1) * stride, stride, facing, colors);
            if lines {
                ink.blend(row, self.styles, colors);
            }
        }
    }

    /// Reckons the cosines to the light of a row, shadows included, with a margin at its ends.
    #[inline(always)]
    fn face(&self, y: u32, facing: &mut [f32]) {
        let width = self.visible.width() as usize;
        let row = y as usize * width;
        let ids = &self.visible.id()[row..row + width];
        let directions = self.view.row(y);
        for x in (0..width).step_by(LANES) {
            let count = (width - x).min(LANES);
            let out = &mut facing[LANES + x..LANES + x + LANES];
            if shows_nothing(&ids[x..x + count]) {
                out.fill(0.0);
                continue;
            }
            let normal = gather(self.visible.normal(), row + x, count);
            let toward = self.toward(x, y, count, directions.as_ref());
            let cosine = normal.dot(toward);
            let bounded = cosine.max(F32x8::splat(-1.0)).min(F32x8::splat(1.0));
            let shaded = if self.visible.shadow().is_empty() {
                bounded
            } else {
                // A style without shadows has them where nothing is darker.
                let depth_of = |s: &Style| if s.shadow { s.shadow_depth } else { f32::INFINITY };
                let mut depth = F32x8::splat(depth_of(&self.styles.all[0]));
                if self.styles.all.len() > 1 {
                    for lane in 0..count {
                        let style = usize::from(self.styles.index(ids[x + lane]));
                        depth.0[lane] = depth_of(&self.styles.all[style]);
                    }
                }
                let lit = numbers(self.visible.shadow(), row + x, count);
                bounded.above(depth).pick(depth + (bounded - depth) * lit, bounded)
            };
            shaded.finite().store(out);
        }
        facing[LANES - 1] = facing[LANES];
        facing[LANES + width] = facing[LANES + width - 1];
    }

    /// Returns the directions to the light of eight pixels.
    #[inline(always)]
    fn toward(&self, x: usize, y: u32, count: usize, directions: Option<&RowDirections>) -> Vec3x8 {
        if let Some(uniform) = self.light.uniform {
            return Vec3x8::splat(uniform);
        }
        let mut all = Vec3x8::splat(Vec3::Y);
        for lane in 0..count {
            let column = (x + lane) as u32;
            let ray = || self.view.ray(f64::from(column) + 0.5, f64::from(y) + 0.5);
            let to_eye = || match directions {
                Some(directions) => -directions.at(column),
                None => ray().map_or(Vec3::Y, |r| -r.direction.as_vec3()),
            };
            let at = y as usize * self.visible.width() as usize + column as usize;
            let position = || match self.visible.distance().get(at) {
                Some(&distance) => ray().map_or(DVec3::ZERO, |r| r.at(f64::from(distance))),
                None => DVec3::ZERO,
            };
            all.set(lane, self.light.toward(position, to_eye));
        }
        all
    }

    /// Paints a row without its lines. `own` is where its cosines begin.
    #[inline(always)]
    fn row(&self, y: u32, own: usize, stride: usize, facing: &[f32], colors: &mut [Vec3]) {
        let width = colors.len();
        let directions = self.view.row(y);
        let paper = &self.styles.all[0].paper;
        let row = y as usize * width;
        let ids = &self.visible.id()[row..row + width];
        for (piece, (ids, colors)) in ids.chunks(GROUND).zip(colors.chunks_mut(GROUND)).enumerate() {
            if ids.contains(&0) {
                self.ground(paper, (piece * GROUND) as u32, y, directions.as_ref(), colors);
            }
        }
        for x in (0..width).step_by(LANES) {
            let count = (width - x).min(LANES);
            let own_ids = &ids[x..x + count];
            if shows_nothing(own_ids) {
                continue;
            }
            let (direction, origin) = self.rays(x, y, directions.as_ref());
            let eight = Eight { x: x as u32, y, count, first: row + x, direction };
            let around = [own + LANES + x, stride];
            let out = &mut colors[x..x + count];
            // Mostly one style; each that is there paints its own pixels.
            for (index, style) in (0u8..).zip(&self.styles.all) {
                let is_own = |id: &u32| *id != 0 && self.styles.index(*id) == index;
                if !own_ids.iter().any(is_own) {
                    continue;
                }
                let result = self.eight(style, &eight, origin, around, facing);
                for (lane, (color, id)) in out.iter_mut().zip(own_ids).enumerate() {
                    if is_own(id) {
                        *color = result.get(lane);
                    }
                }
            }
        }
    }

    /// Fills a row with what is there where nothing is.
    #[inline(always)]
    fn ground(&self, paper: &Paper, x: u32, y: u32, directions: Option<&RowDirections>, colors: &mut [Vec3]) {
        let show = self.styles.all[0].show;
        if show != Show::Style {
            colors.fill(Vec3::ZERO);
        } else if paper.is_shown {
            self.grain.paper(paper, x, y, colors);
        } else if let Some(directions) = directions {
            directions.fill(&self.scene.environment.background, x, colors);
        } else {
            for (x, color) in (x..).zip(colors) {
                let ray = self.view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                *color = ray.map_or(Vec3::ZERO, |r| self.scene.environment.background.color(r.direction));
            }
        }
    }

    /// Returns the directions of eight rays, and where they begin as seen from the eye.
    #[inline(always)]
    fn rays(&self, x: usize, y: u32, directions: Option<&RowDirections>) -> (Vec3x8, Vec3x8) {
        let columns = I32x8::count_from(x as i32).to_f64();
        if let (Projection::Perspective { .. }, Some(row)) = (&self.camera.projection, directions) {
            let direction = Vec3x8::splat(row.first) + Vec3x8::splat(row.step).scaled(columns.round());
            let length = F32x8::splat(1.0) / direction.length();
            return (direction.scaled(length), Vec3x8::splat(Vec3::ZERO));
        }
        let (origin, direction, _) = self.view.rays(columns + F64x8::splat(0.5), f64::from(y) + 0.5);
        let eye = polyptych_core::lanes::DVec3x8::splat(self.camera.eye);
        (direction.round().finite(), (origin - eye).round().finite())
    }

    /// Paints eight pixels in one style.
    #[inline(always)]
    fn eight(
        &self,
        style: &Style,
        eight: &Eight,
        origin: Vec3x8,
        [at, stride]: [usize; 2],
        facing: &[f32],
    ) -> Vec3x8 {
        if style.show != Show::Style {
            return self.study(style.show, eight);
        }
        let Eight { count, first, direction, .. } = *eight;
        let ids = &self.visible.id()[first..first + count];
        let mut own = gather(self.visible.albedo(), first, count);
        let coded = own;
        if self.any_coded && ids.iter().any(|&id| self.look(id).is_coded) {
            self.decode(eight, &mut own);
        }
        let cosine = F32x8::load(&facing[at..]);
        let slope = if style.tone.steps > 1 {
            // On the smooth side: next to another surface or a shadow the other difference says nothing.
            let steepness = |before: usize, after: usize| {
                let (before, after) = (F32x8::load(&facing[before..]), F32x8::load(&facing[after..]));
                (cosine - before).abs().min((after - cosine).abs())
            };
            let (across, down) = (steepness(at - 1, at + 1), steepness(at - stride, at + stride));
            (across * across + down * down).sqrt()
        } else {
            F32x8::ZERO
        };
        let mut color = style.tone.colors(own, cosine, slope);
        if style.highlight != Highlight::Off {
            color = self.shine(style, eight, cosine, color);
        }
        if let Some(hatching) = &style.hatching {
            color = self.hatch(hatching, style, eight, origin, (own, coded, cosine), color);
        }
        if style.paper.grain > 0.0 {
            let grain = self.grain.at(eight.x, eight.y);
            let shade =
                F32x8::splat(1.0) + (grain - F32x8::splat(0.5)) * F32x8::splat(0.3 * style.paper.grain);
            color = color.scaled(shade);
        }
        if self.scene.environment.fog.is_some() {
            for lane in 0..count {
                let distance = self.visible.distance().get(first + lane).copied().unwrap_or(0.0);
                color.set(lane, fogged(&self.scene.environment, color.get(lane), f64::from(distance)));
            }
        }
        let _ = direction;
        color.finite()
    }

    /// Shows distance or normal.
    #[inline(always)]
    fn study(&self, show: Show, eight: &Eight) -> Vec3x8 {
        let half = Vec3x8::splat(Vec3::splat(0.5));
        if show == Show::Normals {
            let normal = gather(self.visible.normal(), eight.first, eight.count);
            return normal.scaled(F32x8::splat(0.5)) + half;
        }
        let [near, far] = self.depths;
        let distance = numbers(self.visible.distance(), eight.first, eight.count);
        let part = (distance - F32x8::splat(near)) / F32x8::splat((far - near).max(f32::MIN_POSITIVE));
        let light = F32x8::splat(1.0) - part.max(F32x8::ZERO).min(F32x8::splat(1.0)) * F32x8::splat(0.9);
        Vec3x8 { x: light, y: light, z: light }.finite()
    }

    #[inline(always)]
    fn look(&self, id: u32) -> Look {
        self.looks.get(id.wrapping_sub(1) as usize).copied().unwrap_or_default()
    }

    /// Reads the colors of surfaces whose color channel holds texture coordinates.
    fn decode(&self, eight: &Eight, own: &mut Vec3x8) {
        let coordinates = *own;
        for lane in 0..eight.count {
            let id = self.visible.id()[eight.first + lane];
            if !self.look(id).is_coded {
                continue;
            }
            let here = coordinates.get(lane);
            let object = &self.scene.objects[id as usize - 1];
            let material = self.scene.material(object, here.z.round().max(0.0) as usize);
            // How much of the texture a pixel covers, as far as its neighbor in the row tells.
            let beside = if lane > 0 { lane - 1 } else { (lane + 1).min(eight.count - 1) };
            let texture = material.texture.and_then(|t| self.scene.textures.get(t));
            let change = (coordinates.get(beside) - here).truncate().abs();
            let lod =
                if change.max_element() < 0.1 { texture.map_or(0.0, |t| t.lod(change, change)) } else { 0.0 };
            let color = self.scene.base_color(material, Some([here.x, here.y]), Vec3::ZERO, Vec3::Y, lod).0;
            own.set(lane, color);
        }
    }

    /// Adds highlights.
    #[inline(always)]
    fn shine(&self, style: &Style, eight: &Eight, cosine: F32x8, color: Vec3x8) -> Vec3x8 {
        let Eight { x, y, count, first, direction } = *eight;
        let zero = F32x8::ZERO;
        if !cosine.above(zero).any() {
            return color;
        }
        let ids = &self.visible.id()[first..first + count];
        let look = |id: u32| &self.looks[(id.wrapping_sub(1) as usize).min(self.looks.len() - 1)];
        let first_look = look(ids[0].max(1));
        let mut strength = F32x8::splat(first_look.specular);
        let mut faint = F32x8::splat(first_look.faint);
        let mut shininess = [first_look.shininess; LANES];
        if ids.iter().any(|&id| id != ids[0]) {
            for (lane, &id) in ids.iter().enumerate() {
                let look = look(id);
                (strength.0[lane], faint.0[lane], shininess[lane]) =
                    (look.specular, look.faint, look.shininess);
            }
        }
        if !strength.above(zero).any() {
            return color;
        }
        let directions = if self.light.uniform.is_some() { None } else { self.view.row(y) };
        let toward = self.toward(x as usize, y, count, directions.as_ref());
        let normal = gather(self.visible.normal(), first, count);
        let between = toward - direction;
        let half = between.dot(normal) / between.length().max(F32x8::splat(f32::MIN_POSITIVE));
        let faces = cosine.above(zero) & half.above(faint);
        if !faces.any() {
            return color;
        }
        let power = powers(half.max(zero), &shininess);
        let lit = if self.visible.shadow().is_empty() || !style.shadow {
            F32x8::splat(1.0)
        } else {
            numbers(self.visible.shadow(), first, count)
        };
        let share = match style.highlight {
            Highlight::Off => return color,
            Highlight::Soft => power * strength * lit,
            Highlight::Hard => {
                // The edge is where half of the light is left, as wide as a pixel by the change to the neighbor.
                let mut change = zero;
                for lane in 0..LANES {
                    let beside = if lane + 1 < count { lane + 1 } else { lane.saturating_sub(1) };
                    change.0[lane] = (power.0[beside] - power.0[lane]).abs();
                }
                let half = F32x8::splat(0.5);
                let over = (power - half) / change.max(F32x8::splat(1e-3)) + half;
                let full = (strength * F32x8::splat(2.5)).min(F32x8::splat(1.0));
                over.max(zero).min(F32x8::splat(1.0)) * full * lit
            }
        };
        color + Vec3x8::splat(style.highlight_color).scaled(faces.pick(share, zero))
    }

    /// Lays strokes on.
    #[inline(always)]
    fn hatch(
        &self,
        hatching: &Hatching,
        style: &Style,
        eight: &Eight,
        origin: Vec3x8,
        (own, coded, cosine): (Vec3x8, Vec3x8, F32x8),
        color: Vec3x8,
    ) -> Vec3x8 {
        let Eight { x, y, count, first, direction } = *eight;
        let (one, half) = (F32x8::splat(1.0), F32x8::splat(0.5));
        let mut light = (one + cosine) * half;
        if hatching.texture > 0.0 {
            let luminance = own.dot(Vec3x8::splat(Vec3::new(0.2126, 0.7152, 0.0722)));
            let dark = one - luminance.max(F32x8::ZERO).min(one).sqrt();
            light = light * (one - dark * F32x8::splat(hatching.texture));
        }
        let darkness = one - light;
        let ids = &self.visible.id()[first..first + count];
        if !darkness.above(F32x8::splat(hatching.lightest)).any() {
            return color;
        }
        let mut ink = F32x8::ZERO;
        if hatching.sticks == Sticks::Screen {
            let scale = F32x8::splat(1.0 / (EDGE as f32 * hatching.scale));
            let u = I32x8::count_from(x as i32).to_f64().round() * scale;
            let v = F32x8::splat(y as f32) * scale;
            ink = hatching.ink(u, v, F32x8::splat(1.0 / hatching.scale), darkness);
        } else {
            let distance = numbers(self.visible.distance(), first, count);
            let place = origin + direction.scaled(distance);
            let pixel = self.view.pixel_size(1.0) as f32;
            let is_parallel = matches!(self.camera.projection, Projection::Orthographic { .. });
            let pixels = if is_parallel { F32x8::splat(pixel) } else { distance * F32x8::splat(pixel) };
            let normal = gather(self.visible.normal(), first, count);
            let mut lane = 0;
            // Run by run of one object.
            while lane < count {
                let id = ids[lane];
                let end = (lane + 1..count).find(|&next| ids[next] != id).unwrap_or(count);
                let index = (id.wrapping_sub(1) as usize).min(self.looks.len() - 1);
                if id != 0 {
                    let look = &self.looks[index];
                    let coordinates = (hatching.sticks == Sticks::Uv && look.is_coded).then_some(coded);
                    let run = Run { look, lanes: lane..end, place, normal, pixels, coordinates };
                    run.ink(hatching, darkness, &mut ink);
                }
                lane = end;
            }
        }
        if style.paper.grain > 0.0 {
            // Strokes skip the valleys of the paper.
            let valley = one - self.grain.at(x, y);
            ink = ink * (one - valley * F32x8::splat(0.9 * style.paper.grain));
        }
        let stroke =
            Vec3x8::splat(hatching.color * (1.0 - hatching.own)) + own.scaled(F32x8::splat(hatching.own));
        let share = ink * F32x8::splat(hatching.opacity);
        color.scaled(one - share) + stroke.scaled(share)
    }
}

/// Neighboring pixels of one object.
struct Run<'a> {
    look: &'a Look,
    lanes: std::ops::Range<usize>,
    /// Relative to the eye.
    place: Vec3x8,
    normal: Vec3x8,
    /// Edge of a pixel there.
    pixels: F32x8,
    coordinates: Option<Vec3x8>,
}

impl Run<'_> {
    /// Returns how much strokes cover of the pixels.
    #[inline(always)]
    fn ink(self, hatching: &Hatching, darkness: F32x8, ink: &mut F32x8) {
        let Self { look, lanes, place, normal, pixels, coordinates } = self;
        let texels = pixels * F32x8::splat(look.repeats * EDGE as f32);
        let mut covered = F32x8::ZERO;
        if let Some(coordinates) = coordinates {
            // A texture is taken to be laid once around the body: six periods.
            let scale = F32x8::splat(6.0 / hatching.scale);
            let (u, v) = (coordinates.x * scale, coordinates.y * scale);
            // By how much they change to the neighbor: how wide a pixel is in the pattern.
            let mut density = texels;
            for lane in lanes.clone().filter(|_| lanes.len() > 1) {
                let beside = if lane + 1 < lanes.end { lane + 1 } else { lane - 1 };
                let change = (u.0[beside] - u.0[lane]).hypot(v.0[beside] - v.0[lane]);
                if change > 0.0 && change < 0.25 {
                    density.0[lane] = change * EDGE as f32;
                }
            }
            covered = hatching.ink(u, v, density, darkness);
        } else {
            let p = turned(&look.pattern, place) + Vec3x8::splat(look.eye);
            let n = turned(&look.turn, normal);
            let weights = [n.x.abs(), n.y.abs(), n.z.abs()];
            // Along the axis that the surface faces most, and mixed with the next where they are much alike.
            let (zero, most) = (F32x8::ZERO, weights[0].max(weights[1]).max(weights[2]));
            let least = weights[0].min(weights[1]).min(weights[2]);
            let next = weights[0] + weights[1] + weights[2] - most - least;
            let mix = ((next - most * F32x8::splat(0.85))
                / (most * F32x8::splat(0.3)).max(F32x8::splat(1e-20)))
            .max(zero)
            .min(F32x8::splat(0.5));
            let is_first = [weights[0].at_least(most), weights[1].at_least(most), weights[2].at_least(most)];
            let is_last =
                [least.at_least(weights[0]), least.at_least(weights[1]), least.at_least(weights[2])];
            let mut first = [Mask8::NONE; 3];
            let mut second = [Mask8::NONE; 3];
            first[0] = is_first[0];
            first[1] = is_first[1] & !first[0];
            first[2] = !(first[0] | first[1]);
            for axis in 0..3 {
                second[axis] = !first[axis] & !is_last[axis];
            }
            let planes = [(p.z, -p.y), (p.x, p.z), (p.x, -p.y)];
            let mixes = mix.above(zero).any();
            for (chosen, share, needed) in [(first, F32x8::splat(1.0) - mix, true), (second, mix, mixes)] {
                if !needed {
                    continue;
                }
                let pick = |a: F32x8, b: F32x8, c: F32x8| chosen[0].pick(a, chosen[1].pick(b, c));
                let u = pick(planes[0].0, planes[1].0, planes[2].0);
                let v = pick(planes[0].1, planes[1].1, planes[2].1);
                covered = covered + hatching.ink(u, v, texels, darkness) * share;
            }
        }
        for lane in lanes {
            ink.0[lane] = covered.0[lane];
        }
    }
}

#[inline(always)]
fn turned(by: &Mat3, v: Vec3x8) -> Vec3x8 {
    Vec3x8::splat(by.x_axis).scaled(v.x)
        + Vec3x8::splat(by.y_axis).scaled(v.y)
        + Vec3x8::splat(by.z_axis).scaled(v.z)
}

/// Raises cosines to their exponents: all at once where these are one whole number, which they mostly are.
#[inline(always)]
fn powers(cosine: F32x8, shininess: &[f32; LANES]) -> F32x8 {
    let exponent = shininess[0];
    let is_whole = exponent.fract() == 0.0 && (1.0..=65536.0).contains(&exponent);
    if !(is_whole && shininess.iter().all(|&s| s == exponent)) {
        let mut all = cosine;
        for (power, &exponent) in all.0.iter_mut().zip(shininess) {
            *power = highlight(*power, exponent);
        }
        return all;
    }
    let (mut power, mut result, mut left) = (cosine, F32x8::splat(1.0), exponent as u32);
    while left > 0 {
        if left & 1 == 1 {
            result = result * power;
        }
        power = power * power;
        left >>= 1;
    }
    result
}
