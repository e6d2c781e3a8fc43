//! A picture, tile by tile: what is met first, then what is seen through, then the light on it.

use crate::bundle::{Bundle, Crossing, Hit, Stretch, TILE, TILE_RAYS};
use crate::form::FormScratch;
use crate::volume::{Gathered, March, OPAQUE, Shine};
use crate::world::{Geometry, Point, World};
use glam::{DVec3, Vec3};
use polyptych_core::camera::View;
use polyptych_core::framebuffer::{Band, Channel, Channels, Pixel};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{Arriving, Shape};
use polyptych_core::seam::Control;
use polyptych_core::shade::{Surface, facing, fogged, turned_away};

/// How to draw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    pub(crate) shadows: bool,
    /// Step through volumes in units of the smallest spacing.
    pub(crate) volume_step: f64,
}

/// Scratch memory for one band.
#[derive(Default)]
pub(crate) struct Scratch {
    primary: Bundle,
    /// Which pixel of the tile each primary ray belongs to.
    places: Vec<u32>,
    opaque: Vec<Hit>,
    layer: Vec<Hit>,
    layer_rays: Bundle,
    gathered: Vec<Gathered>,
    pixels: Vec<Pixel>,
    lit: Lighting,
    form: FormScratch,
    shines: Vec<Shine>,
    pub(crate) rays: u64,
}

/// Light on the points of one layer.
#[derive(Default)]
struct Lighting {
    /// Light and normals of each ray's point.
    shaded: Vec<Shaded>,
    shadow_rays: Bundle,
    shadow_of: Vec<u32>,
    /// What would arrive along each shadow ray.
    arriving: Vec<Arriving>,
    blocked: Vec<Hit>,
}

#[derive(Clone, Copy)]
struct Shaded {
    color: Vec3,
    albedo: Vec3,
    normal: DVec3,
    true_normal: DVec3,
    position: DVec3,
    t: f64,
    opacity: f32,
    /// Lights that cast and arrive, and those of them that are blocked.
    casting: u32,
    dark: u32,
}

/// What one frame is drawn with.
pub(crate) struct FrameDrawing<'a> {
    pub(crate) world: &'a World,
    pub(crate) view: View<'a>,
    pub(crate) channels: Channels,
    pub(crate) options: Options,
}

impl FrameDrawing<'_> {
    /// Draws a band, tile by tile; stops between tiles when the host wants to.
    pub(crate) fn band(&self, mut band: Band<'_>, scratch: &mut Scratch, control: &Control<'_>) {
        scratch.rays = 0;
        for first in (0..band.width).step_by(TILE as usize) {
            if control.is_cancelled() {
                return;
            }
            self.tile(&mut band, first, scratch);
        }
        control.finished(&band);
    }

    fn tile(&self, band: &mut Band<'_>, first: u32, scratch: &mut Scratch) {
        let columns = TILE.min(band.width - first);
        self.aim(band, first, columns, scratch);
        self.nearest(|body| !body.see_through, &scratch.primary, &mut scratch.opaque, &mut scratch.form);
        scratch.gathered.clear();
        scratch.gathered.resize(scratch.primary.rays.len(), Gathered::NOTHING);
        scratch.pixels.clear();
        scratch.pixels.resize(TILE_RAYS, Pixel::background(Vec3::ZERO));
        self.look_through(scratch);
        self.finish(scratch);
        for row in 0..band.rows {
            for x in 0..columns {
                band.put(first + x, row, &scratch.pixels[(row * TILE + x) as usize]);
            }
        }
    }

    /// Sets up the rays through the middles of the pixels.
    fn aim(&self, band: &Band<'_>, first: u32, columns: u32, scratch: &mut Scratch) {
        scratch.primary.rays.clear();
        scratch.places.clear();
        for row in 0..band.rows {
            for x in 0..columns {
                let place = (f64::from(first + x) + 0.5, f64::from(band.first_row + row) + 0.5);
                if let Some(ray) = self.view.ray(place.0, place.1) {
                    let (origin, direction) = (ray.origin, ray.direction);
                    scratch.primary.rays.push(Stretch { origin, direction, near: 0.0, far: f64::INFINITY });
                    scratch.places.push(row * TILE + x);
                }
            }
        }
        scratch.rays += scratch.primary.rays.len() as u64;
    }

    /// Finds what each ray meets first among some bodies.
    fn nearest(
        &self,
        wanted: impl Fn(&crate::world::Body) -> bool,
        bundle: &Bundle,
        hits: &mut Vec<Hit>,
        form: &mut FormScratch,
    ) {
        hits.clear();
        hits.extend(bundle.rays.iter().map(|r| Hit::nothing(r.far)));
        let cone = bundle.cone();
        for (index, body) in self.world.bodies.iter().enumerate() {
            if wanted(body) && cone.is_none_or(|c| c.touches(body.center, body.radius)) {
                body.cast(index as u32, Crossing::Any, bundle, hits, form);
            }
        }
    }

    /// Gathers see-through surfaces and volumes in front of the opaque ones, layer by layer.
    fn look_through(&self, scratch: &mut Scratch) {
        // Most scenes have nothing of the kind: no cone is needed to tell.
        if !self.world.bodies.iter().any(|b| b.see_through || b.is_volume()) {
            return;
        }
        let cone = scratch.primary.cone();
        let near = |b: &&crate::world::Body| cone.is_none_or(|c| c.touches(b.center, b.radius));
        let layered = self.world.bodies.iter().filter(near).any(|b| b.see_through && !b.is_volume());
        let volumes = self.world.bodies.iter().filter(near).any(crate::world::Body::is_volume);
        if !layered && !volumes {
            return;
        }
        // Rays that were followed to the end have `near` beyond `far`.
        scratch.layer_rays.rays.clear();
        for (ray, hit) in scratch.primary.rays.iter().zip(&scratch.opaque) {
            scratch.layer_rays.rays.push(Stretch { far: hit.t, ..*ray });
        }
        loop {
            let Scratch { layer, layer_rays, form, .. } = &mut *scratch;
            if layered {
                self.nearest(|b| b.see_through && !b.is_volume(), layer_rays, layer, form);
            } else {
                layer.clear();
                layer.extend(layer_rays.rays.iter().map(|r| Hit::nothing(r.far)));
            }
            if volumes {
                self.march_volumes(scratch);
            }
            if !scratch.layer.iter().any(Hit::is_some) {
                return;
            }
            let Scratch { layer, primary, lit, form, .. } = &mut *scratch;
            self.light(primary, layer, lit, form);
            for i in 0..scratch.layer.len() {
                let hit = scratch.layer[i];
                let ray = &mut scratch.layer_rays.rays[i];
                if !hit.is_some() {
                    ray.near = f64::INFINITY;
                    continue;
                }
                let shaded = scratch.lit.shaded[i];
                let body = &self.world.bodies[hit.body as usize];
                if shaded.opacity > 0.0 {
                    let place = scratch.places[i] as usize;
                    first_surface(&mut scratch.pixels[place], &shaded, body.object, &scratch.gathered[i]);
                    scratch.gathered[i].add(self.seen(&shaded), shaded.opacity);
                }
                // The same surface again begins a hair behind: the resolution of single precision.
                ray.near = hit.t + body.radius * 2e-5;
                if scratch.gathered[i].transparency < OPAQUE {
                    ray.near = f64::INFINITY;
                }
            }
        }
    }

    /// Adds the volumes between the last layer and this one, all of them together in the order of depth.
    fn march_volumes(&self, scratch: &mut Scratch) {
        for i in 0..scratch.layer_rays.rays.len() {
            let ray = scratch.layer_rays.rays[i];
            let end = scratch.layer[i].t;
            if ray.near >= end || scratch.gathered[i].transparency < OPAQUE {
                continue;
            }
            for body in &self.world.bodies {
                let (Geometry::Volume(volume), Shape::Volume(shape)) = (&*body.geometry, &*body.shape) else {
                    continue;
                };
                let origin = body.object_from_world.transform_point3(ray.origin);
                let direction = body.object_from_world.transform_vector3(ray.direction);
                let bounds: Aabb =
                    shape.shell.as_ref().map_or(shape.bounds(), |s| s.bounds().intersection(shape.bounds()));
                let Some((enter, leave)) = bounds.clip(origin, direction) else { continue };
                let object_per_world = direction.length();
                let step = self.options.volume_step * shape.spacing().min_element() / object_per_world;
                // Samples keep their places whatever layers cut the ray: each belongs to the part it stands in.
                let count =
                    ((leave.min(end) - enter) / step - 0.5).ceil().clamp(0.0, f64::from(u32::MAX / 4));
                let first = ((ray.near - enter) / step - 0.5).ceil().clamp(0.0, count);
                let scene = &self.world.scene;
                let material = scene.material(&scene.objects[body.object], 0);
                self.shine_on(body.center, &mut scratch.shines);
                let march = March {
                    volume: shape,
                    material,
                    environment: &scene.environment,
                    origin,
                    direction,
                    step,
                    object_per_world,
                    normal_map: body.normal_map,
                    to_eye: -ray.direction.as_vec3(),
                };
                let sum = &mut scratch.gathered[i];
                let was_half = sum.half;
                volume.march(&march, enter, first as u32..count as u32, &scratch.shines, sum);
                if let (None, Some(t)) = (was_half, sum.half) {
                    let pixel = &mut scratch.pixels[scratch.places[i] as usize];
                    if pixel.id == 0 {
                        (pixel.id, pixel.distance) = (body.object as u32 + 1, t as f32);
                        let p = origin + direction * t;
                        let normal = body.normal_map * -shape.gradient(p);
                        pixel.normal = facing(normal.normalize_or(-ray.direction), ray.direction).as_vec3();
                        pixel.albedo = shape.transfer.at(shape.value(p) as f32).0;
                    }
                }
            }
        }
    }

    /// Lists the lights as they arrive at the middle of a volume.
    fn shine_on(&self, center: DVec3, shines: &mut Vec<Shine>) {
        shines.clear();
        shines.extend(
            self.world
                .lights
                .iter()
                .filter_map(|light| light.arriving(center))
                .map(|a| Shine { to_light: a.to_light.as_vec3(), radiance: a.radiance }),
        );
    }

    /// Lights the opaque surfaces, lays what was gathered over them, and fills the pixels.
    fn finish(&self, scratch: &mut Scratch) {
        let Scratch { primary, opaque, lit, form, .. } = &mut *scratch;
        self.light(primary, opaque, lit, form);
        for i in 0..scratch.primary.rays.len() {
            let hit = scratch.opaque[i];
            let pixel = &mut scratch.pixels[scratch.places[i] as usize];
            let gathered = &mut scratch.gathered[i];
            if hit.is_some() {
                let shaded = scratch.lit.shaded[i];
                let object = self.world.bodies[hit.body as usize].object;
                first_surface(pixel, &shaded, object, &Gathered { half: None, ..*gathered });
                gathered.add(self.seen(&shaded), 1.0);
            } else {
                let background =
                    self.world.scene.environment.background.color(scratch.primary.rays[i].direction);
                gathered.add(background, 1.0);
            }
            pixel.color = gathered.color;
            pixel.coverage = if pixel.id != 0 { 1.0 } else { 0.0 };
        }
    }

    fn seen(&self, shaded: &Shaded) -> Vec3 {
        fogged(&self.world.scene.environment, shaded.color, shaded.t)
    }

    /// Computes the points that rays met and the light on them.
    fn light(&self, bundle: &Bundle, hits: &mut [Hit], lit: &mut Lighting, form: &mut FormScratch) {
        let scene = &self.world.scene;
        lit.shaded.clear();
        for (ray, hit) in bundle.rays.iter().zip(&mut *hits) {
            if !hit.is_some() {
                lit.shaded.push(Shaded::NOTHING);
                continue;
            }
            let body = &self.world.bodies[hit.body as usize];
            let point: Point<'_> = body.point(scene, ray.origin, ray.direction, hit);
            let normal = facing(point.normal, ray.direction);
            let surface = surface(&point, normal, ray.direction);
            lit.shaded.push(Shaded {
                color: surface.ambient(&scene.environment),
                albedo: point.color,
                normal,
                true_normal: normal,
                position: point.position,
                t: point.t,
                opacity: point.opacity,
                casting: 0,
                dark: 0,
            });
        }
        if !self.channels.has(Channel::Color) && !self.channels.has(Channel::Shadow) {
            return;
        }
        for light in 0..self.world.lights.len() {
            self.light_by(light, bundle, hits, lit, form);
        }
    }

    /// Adds one light.
    fn light_by(
        &self,
        index: usize,
        bundle: &Bundle,
        hits: &[Hit],
        lit: &mut Lighting,
        form: &mut FormScratch,
    ) {
        let light = &self.world.lights[index];
        let scene = &self.world.scene;
        lit.shadow_rays.rays.clear();
        lit.shadow_of.clear();
        lit.arriving.clear();
        for (i, hit) in hits.iter().enumerate() {
            if !hit.is_some() {
                continue;
            }
            let shaded = &mut lit.shaded[i];
            let Some(arriving) = light.arriving(shaded.position) else { continue };
            shaded.casting += u32::from(light.casts_shadow);
            if turned_away(shaded.true_normal, arriving.to_light) {
                shaded.dark += u32::from(light.casts_shadow);
                continue;
            }
            // Begin a hair away: the resolution of single precision for a body of that size.
            let near = self.world.bodies[hit.body as usize].radius * 1e-5;
            let (origin, direction) = (shaded.position, arriving.to_light);
            lit.shadow_rays.rays.push(Stretch { origin, direction, near, far: arriving.distance });
            lit.shadow_of.push(i as u32);
            lit.arriving.push(arriving);
        }
        lit.blocked.clear();
        lit.blocked.extend(lit.shadow_rays.rays.iter().map(|r| Hit::nothing(r.far)));
        if light.casts_shadow && self.options.shadows && !lit.shadow_rays.rays.is_empty() {
            let cone = lit.shadow_rays.cone();
            for (i, body) in self.world.bodies.iter().enumerate() {
                if !body.see_through && cone.is_none_or(|c| c.touches(body.center, body.radius)) {
                    body.cast(i as u32, Crossing::Entry, &lit.shadow_rays, &mut lit.blocked, form);
                    // One thing in the way is enough: blocked rays are not followed further.
                    for (ray, hit) in lit.shadow_rays.rays.iter_mut().zip(&lit.blocked) {
                        if hit.is_some() {
                            ray.far = -1.0;
                        }
                    }
                }
            }
        }
        for ((&i, blocked), arriving) in lit.shadow_of.iter().zip(&lit.blocked).zip(&lit.arriving) {
            let shaded = &mut lit.shaded[i as usize];
            if blocked.is_some() {
                shaded.dark += 1;
                continue;
            }
            let (ray, hit) = (&bundle.rays[i as usize], &hits[i as usize]);
            let body = &self.world.bodies[hit.body as usize];
            let surface = Surface {
                material: body.material_at(scene, shaded.position),
                color: shaded.albedo,
                normal: shaded.normal.as_vec3(),
                to_eye: -ray.direction.as_vec3(),
            };
            let model = scene.environment.lighting;
            shaded.color += surface.lit_by(model, arriving.to_light.as_vec3(), arriving.radiance);
        }
    }
}

fn surface<'a>(point: &Point<'a>, normal: DVec3, direction: DVec3) -> Surface<'a> {
    Surface {
        material: point.material,
        color: point.color,
        normal: normal.as_vec3(),
        to_eye: -direction.as_vec3(),
    }
}

/// Fills the geometry channels from the first surface, unless a volume was dense before it.
fn first_surface(pixel: &mut Pixel, shaded: &Shaded, object: usize, gathered: &Gathered) {
    if pixel.id != 0 || gathered.half.is_some() {
        return;
    }
    pixel.id = object as u32 + 1;
    pixel.distance = shaded.t as f32;
    pixel.normal = shaded.normal.as_vec3();
    pixel.albedo = shaded.albedo;
    pixel.shadow = if shaded.casting == 0 { 1.0 } else { 1.0 - shaded.dark as f32 / shaded.casting as f32 };
}

impl Shaded {
    const NOTHING: Self = Self {
        color: Vec3::ZERO,
        albedo: Vec3::ZERO,
        normal: DVec3::ZERO,
        true_normal: DVec3::ZERO,
        position: DVec3::ZERO,
        t: f64::INFINITY,
        opacity: 0.0,
        casting: 0,
        dark: 0,
    };
}
