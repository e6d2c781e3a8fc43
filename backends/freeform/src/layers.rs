//! What lies before the opaque surfaces: see-through ones, layer by layer, and volumes between them?

use crate::bundle::{Crossing, Hits, OCTETS, Rays};
use crate::form::Cast;
use crate::frame::{FrameDrawing, Pixels, Scratch as FrameScratch};
use crate::light::Lit;
use crate::march::{Gathered, March, OPAQUE};
use crate::pyramid::clip;
use crate::volume::VolumeBody;
use crate::world::{Body, Geometry};
use glam::DVec3;
use polyptych_core::framebuffer::Channel;
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, I32x8, LANES, Mask8};
use polyptych_core::scene::{Shape, Volume};
use polyptych_core::shade::facing;

/// Most times that rays are followed through the border of a shell.
const BORDERS: usize = 64;

/// Most samples along a ray.
const SAMPLES: f64 = 1e9;

/// Scratch memory of one worker for volumes.
#[derive(Default)]
pub(crate) struct Scratch {
    stretches: Vec<Stretch>,
    /// Which of them come first on each ray, which second, and so on.
    order: Vec<[usize; LANES]>,
    /// Parts of the tile's rays within the shells of volumes.
    shells: Vec<Part>,
    rays: Vec<Rays>,
    hits: Vec<Hits>,
    from: Vec<F64x8>,
}

/// Parts of eight rays within a shell.
#[derive(Clone, Copy)]
struct Part {
    octet: usize,
    body: u32,
    open: Mask8,
    from: F64x8,
    to: F64x8,
}

/// The parts of eight rays in one volume.
struct Stretch {
    body: u32,
    level: usize,
    /// How long a pixel is in units of the level's spacing: where the rays begin, and what each unit of distance adds.
    pixel: [f32; 2],
    /// The rays in object space.
    origin: DVec3x8,
    direction: DVec3x8,
    /// Where they enter the volume; samples are counted from there.
    enter: F64x8,
    step: F64x8,
    /// The next sample, and the one after the last.
    next: I32x8,
    end: I32x8,
}

impl Stretch {
    fn is_left(&self, lane: usize) -> bool {
        self.next.0[lane] < self.end.0[lane]
    }

    fn begin(&self, lane: usize) -> f64 {
        self.enter.0[lane] + f64::from(self.next.0[lane]) * self.step.0[lane]
    }

    fn finish(&self, lane: usize) -> f64 {
        self.enter.0[lane] + f64::from(self.end.0[lane]) * self.step.0[lane]
    }

    /// Tells whether what is left on a ray begins before that of another.
    fn is_before(&self, other: &Self, lane: usize) -> bool {
        let (own, others) = (self.begin(lane), other.begin(lane));
        own < others || (own == others && self.body < other.body)
    }
}

/// Counts the samples that stand before distances.
fn samples_before(t: F64x8, enter: F64x8, step: F64x8) -> I32x8 {
    let place = (t - enter) / step - F64x8::splat(0.5);
    let place = place.max(F64x8::ZERO).min(F64x8::splat(SAMPLES));
    I32x8::splat(0) - (-place).nearest_below()
}

impl FrameDrawing<'_> {
    /// Gathers see-through surfaces and volumes in front of the opaque ones, layer by layer.
    pub(crate) fn look_through<'a>(
        &'a self,
        layered: bool,
        volumes: bool,
        lit: &mut [Lit<'a>; OCTETS],
        scratch: &mut FrameScratch,
    ) {
        scratch.through.clear();
        scratch.through.extend(
            scratch.rays.iter().zip(&scratch.opaque).map(|(rays, hits)| Rays { far: hits.t, ..*rays }),
        );
        if volumes {
            self.find_shells(scratch);
        }
        loop {
            let FrameScratch { layer, through, form, bodies, .. } = &mut *scratch;
            layer.clear();
            layer.extend(through.iter().map(Hits::nothing));
            if layered {
                self.nearest(|b| b.see_through && !b.is_volume(), bodies, through, layer, form);
            }
            if volumes {
                for octet in 0..OCTETS {
                    self.march_octet(octet, scratch);
                }
            }
            if !scratch.layer.iter().any(|hits| hits.any().any()) {
                return;
            }
            let FrameScratch { layer, rays, light, form, traced, .. } = &mut *scratch;
            self.illumination().light(rays, layer, lit, (light, form), traced);
            for (octet, lit) in lit.iter().enumerate() {
                self.add_layer(octet, lit, scratch);
            }
        }
    }

    /// Lays eight lit points of surfaces over what follows, and goes on behind them.
    fn add_layer(&self, octet: usize, lit: &Lit<'_>, scratch: &mut FrameScratch) {
        let (hits, met) = (scratch.layer[octet], scratch.layer[octet].any());
        let (rays, gathered) = (&mut scratch.through[octet], &mut scratch.gathered[octet]);
        for i in 0..LANES {
            if !met.has(i) {
                rays.close(i);
                continue;
            }
            let body = &self.world.bodies[hits.body.0[i] as usize];
            let opacity = lit.points.opacity.0[i];
            if opacity > 0.0 {
                if gathered.half.0[i].is_infinite() {
                    let mut mask = Mask8::NONE;
                    mask.0[i] = u32::MAX;
                    self.first_surface(&mut scratch.pixels[octet], lit, &hits, mask);
                }
                gathered.add(i, self.seen(lit.color.get(i), hits.t.0[i]), opacity);
            }
            // The same surface again begins a hair behind: the resolution of single precision.
            rays.near.0[i] = hits.t.0[i] + body.radius * 2e-5;
            if gathered.transparency.0[i] < OPAQUE {
                rays.close(i);
            }
        }
    }

    /// Finds the parts of the tile's rays within the shells of volumes, so that samples begin at the shell.
    fn find_shells(&self, scratch: &mut FrameScratch) {
        let FrameScratch { bodies, rays, opaque, form, inside, .. } = scratch;
        let Scratch { shells, rays: own, hits, from, .. } = inside;
        shells.clear();
        for &index in &*bodies {
            let body = &self.world.bodies[index as usize];
            let Geometry::Volume(VolumeBody { shell: Some(shell), .. }) = &*body.geometry else { continue };
            let cast = Cast {
                object_from_world: &body.object_from_world,
                body: index,
                crossing: Crossing::Any,
                precision: body.precision,
            };
            own.clear();
            own.extend(rays.iter().zip(&*opaque).map(|(r, hits)| Rays { far: hits.t, ..*r }));
            from.clear();
            from.extend(own.iter().map(|r| r.near));
            for _ in 0..BORDERS {
                hits.clear();
                hits.extend(own.iter().map(Hits::nothing));
                shell.cast(cast, own, hits, &mut form.form);
                let mut goes_on = false;
                for (octet, (rays, hits)) in own.iter_mut().zip(&*hits).enumerate() {
                    let (open, found) = (rays.open(), hits.any() & rays.open());
                    let part = Part { octet, body: index, open, from: from[octet], to: hits.t };
                    let open = within_shell(body, rays, &part);
                    if open.any() {
                        shells.push(Part { open, ..part });
                    }
                    // The next border is a hair behind: the resolution of single precision.
                    let behind = hits.t + F64x8::splat(body.radius * 2e-5);
                    rays.near = F64x8::pick(found, behind, F64x8::splat(1.0));
                    rays.far = F64x8::pick(found, rays.far, F64x8::ZERO);
                    from[octet] = hits.t;
                    goes_on |= rays.open().any();
                }
                if !goes_on {
                    break;
                }
            }
        }
    }

    /// Adds the volumes between the last layer and this one to eight rays, all of them together in the order of depth.
    fn march_octet(&self, octet: usize, scratch: &mut FrameScratch) {
        let FrameScratch { through, layer, gathered, pixels, inside, bodies, .. } = scratch;
        let (rays, end, sum) = (&through[octet], layer[octet].t, &mut gathered[octet]);
        let open = rays.open() & end.above(rays.near) & sum.transparency.at_least(F32x8::splat(OPAQUE));
        if !open.any() {
            return;
        }
        let Scratch { stretches, shells, order, .. } = inside;
        stretches.clear();
        for &index in &*bodies {
            let body = &self.world.bodies[index as usize];
            let Geometry::Volume(volume) = &*body.geometry else { continue };
            if volume.shell.is_some() {
                for part in shells.iter().filter(|p| p.octet == octet && p.body == index) {
                    let (near, end) = (rays.near.max(part.from), end.min(part.to));
                    stretches.extend(self.stretch(index, volume, rays, near, end, open & part.open));
                }
            } else {
                stretches.extend(self.stretch(index, volume, rays, rays.near, end, open));
            }
        }
        let pixels = &mut pixels[octet];
        let toward = &rays.direction;
        if let [only] = &mut stretches[..] {
            self.march_stretch(only, F64x8::splat(f64::INFINITY), open, toward, sum, pixels);
            return;
        }
        while let Some((until, together)) = next_slice(stretches, sum) {
            // Whose turn it is, rank by rank, is told before anything moves on.
            let ranked = |rank| std::array::from_fn(|lane| ranked_so(stretches, lane, rank));
            order.clear();
            order.extend((0..stretches.len()).map(ranked));
            for (rank, first) in order.iter().enumerate() {
                for (index, stretch) in stretches.iter_mut().enumerate() {
                    let mut turn = Mask8::NONE;
                    for lane in (0..LANES).filter(|&lane| rank < together[lane]) {
                        turn.0[lane] = if first[lane] == index { u32::MAX } else { 0 };
                    }
                    if turn.any() {
                        self.march_stretch(stretch, until, turn, toward, sum, pixels);
                    }
                }
            }
        }
    }

    /// Returns the parts of eight rays in a volume between two distances, if there are any.
    #[inline(always)]
    fn stretch(
        &self,
        index: u32,
        volume: &VolumeBody,
        rays: &Rays,
        near: F64x8,
        end: F64x8,
        open: Mask8,
    ) -> Option<Stretch> {
        let body = &self.world.bodies[index as usize];
        let origin = rays.origin.turned(&body.object_from_world.matrix3)
            + DVec3x8::splat(body.object_from_world.translation);
        let direction = rays.direction.turned(&body.object_from_world.matrix3);
        let (enter, leave) = clip(&body.local_bounds, &origin, &direction);
        let open = open & leave.min(end).above(enter.max(near));
        if !open.any() {
            return None;
        }
        let length = direction.length();
        let (level, pixel) = self.level(volume, length, enter, open);
        let step = F64x8::splat(volume.levels[level].step) / length;
        // Samples keep their places whatever layers cut the ray: each belongs to the part it stands in.
        let nothing = I32x8::splat(0);
        let next = I32x8::pick(open, samples_before(near, enter, step), nothing);
        let end = I32x8::pick(open, samples_before(leave.min(end), enter, step), nothing);
        next.below(end).any().then_some(Stretch {
            body: index,
            level,
            pixel,
            origin,
            direction,
            enter,
            step,
            next,
            end,
        })
    }

    /// Chooses the level whose samples are not larger than a pixel where the first of the rays enters.
    fn level(&self, volume: &VolumeBody, length: F64x8, enter: F64x8, open: Mask8) -> (usize, [f32; 2]) {
        if volume.levels.len() == 1 {
            return (0, [0.0; 2]);
        }
        let at_eye = self.view.pixel_size(0.0);
        let per_unit = self.view.pixel_size(1.0) - at_eye;
        let spacing = volume.levels[0].spacing.min_element();
        let (mut nearest, mut scale) = (f64::INFINITY, 0.0);
        for lane in (0..LANES).filter(|&lane| open.has(lane)) {
            (nearest, scale) = (enter.0[lane].min(nearest), length.0[lane] / spacing);
        }
        let [at_eye, per_unit] = [at_eye, per_unit].map(|size| size * scale);
        let last = volume.levels.len() as i32 - 1;
        let level = ((at_eye + per_unit * nearest).log2().floor() as i32).clamp(0, last);
        let share = 0.5f64.powi(level);
        (level as usize, [at_eye, per_unit].map(|size| (size * share) as f32))
    }

    /// Adds the samples of a volume up to distances.
    fn march_stretch(
        &self,
        stretch: &mut Stretch,
        until: F64x8,
        open: Mask8,
        toward: &DVec3x8,
        sum: &mut Gathered,
        pixels: &mut Pixels,
    ) {
        let body = &self.world.bodies[stretch.body as usize];
        let (Geometry::Volume(volume), Shape::Volume(shape)) = (&*body.geometry, &*body.shape) else {
            return;
        };
        let last = samples_before(until, stretch.enter, stretch.step).max(stretch.next).min(stretch.end);
        let scene = &self.world.scene;
        let coarser = volume.levels.get(stretch.level + 1).map(|level| (level, stretch.pixel));
        let to_eye = toward.round();
        let march = March {
            level: &volume.levels[stretch.level],
            coarser,
            material: scene.material(&scene.objects[body.object], 0),
            environment: &scene.environment,
            shines: &body.shines,
            origin: stretch.origin,
            direction: stretch.direction,
            enter: stretch.enter,
            step: stretch.step,
            normal_map: body.normal_map.as_mat3(),
            to_eye: to_eye.scaled(F32x8::splat(-1.0)),
        };
        let was_half = sum.half;
        march.run([stretch.next, last], open, sum);
        stretch.next = I32x8::pick(open, last, stretch.next);
        for lane in (0..LANES).filter(|&lane| open.has(lane)) {
            let t = sum.half.0[lane];
            if was_half.0[lane].is_infinite() && t.is_finite() && pixels.id.0[lane] == 0 {
                let place = stretch.origin.get(lane) + stretch.direction.get(lane) * t;
                self.first_haze((body, shape), (place, t), toward.get(lane), (pixels, lane));
            }
        }
    }

    /// Fills the geometry channels of a pixel with where half of its light is held back by a volume.
    fn first_haze(
        &self,
        (body, shape): (&Body, &Volume),
        (place, t): (DVec3, f64),
        toward: DVec3,
        (pixels, lane): (&mut Pixels, usize),
    ) {
        (pixels.id.0[lane], pixels.distance.0[lane]) = (body.object as u32 + 1, t as f32);
        if self.channels.has(Channel::Normal) {
            let normal = body.normal_map * -shape.gradient(place);
            pixels.normal.set(lane, facing(normal.normalize_or(-toward), toward).as_vec3());
        }
        if self.channels.has(Channel::Albedo) {
            pixels.albedo.set(lane, shape.transfer.at(shape.value(place) as f32).0);
        }
    }
}

/// Returns up to where volumes that overlap take turns, slice by slice, as thick as the longest of their steps, and how
/// many do on each ray; nothing where nothing is left.
fn next_slice(stretches: &[Stretch], sum: &Gathered) -> Option<(F64x8, [usize; LANES])> {
    let (mut until, mut together) = (F64x8::ZERO, [0; LANES]);
    for lane in (0..LANES).filter(|&lane| sum.transparency.0[lane] >= OPAQUE) {
        let left = || stretches.iter().filter(move |s| s.is_left(lane));
        let Some(first) = left().reduce(|a, b| if b.is_before(a, lane) { b } else { a }) else { continue };
        let overlap = || left().filter(|s| s.begin(lane) < first.finish(lane));
        together[lane] = overlap().count();
        let slice = overlap().map(|s| s.step.0[lane]).fold(0.0, f64::max);
        until.0[lane] = if together[lane] == 1 { f64::INFINITY } else { first.begin(lane) + slice };
    }
    together.iter().any(|&count| count > 0).then_some((until, together))
}

/// Returns which stretch is so many behind the first on a ray, of those that are left.
fn ranked_so(stretches: &[Stretch], lane: usize, rank: usize) -> usize {
    let left = || stretches.iter().filter(|s| s.is_left(lane));
    let is_so = |own: &Stretch| {
        own.is_left(lane) && left().filter(|other| other.is_before(own, lane)).count() == rank
    };
    stretches.iter().position(is_so).unwrap_or(usize::MAX)
}

/// Tells which parts between two borders of a shell are inside.
fn within_shell(body: &Body, rays: &Rays, part: &Part) -> Mask8 {
    let mut inside = Mask8::NONE;
    let Shape::Volume(Volume { shell: Some(shell), .. }) = &*body.shape else { return inside };
    for lane in (0..LANES).filter(|&lane| part.open.has(lane)) {
        let origin = body.object_from_world.transform_point3(rays.origin.get(lane));
        let direction = body.object_from_world.transform_vector3(rays.direction.get(lane));
        // Borders beyond the bounds are not looked for.
        let Some((enter, leave)) = body.local_bounds.clip(origin, direction) else { continue };
        let (from, to) = (enter.max(part.from.0[lane]), leave.min(part.to.0[lane]));
        let is_inside = from < to && shell.form().value(origin + direction * (0.5 * (from + to))) >= 0.0;
        inside.0[lane] = if is_inside { u32::MAX } else { 0 };
    }
    inside
}
