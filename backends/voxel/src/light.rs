//! How are eight pixels lit, and what is written of them? The answers of [`Tracer::color`], eight at a time, for
//! solids that are no mirrors; others are asked of it.

use crate::octet::{NOTHING, Octet};
use crate::paint::Row;
use crate::trace::{Shadows, Tracer, Wants, finite};
use crate::world::Reach;
use glam::{DVec3, Vec3};
use polyptych_core::framebuffer::{Band, Channel, Channels, Pixel};
use polyptych_core::lanes::{DVec3x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::Material;
use polyptych_core::shade::{fogged, lit_by_material};

/// Colors of eight points, and the shares of lights that reach them.
struct Lit {
    color: Vec3x8,
    shadow: [f32; LANES],
}

/// What is known of eight points before they are lit.
struct Points<'a> {
    materials: [Option<&'a Material>; LANES],
    color: Vec3x8,
    normal: DVec3x8,
    /// Those that are lit here.
    plain: Mask8,
}

/// Writes pixels of a plane, if the picture has it.
#[inline(always)]
fn put<T: Copy>(plane: &mut [T], first: usize, stride: u32, values: &[T]) {
    if plane.is_empty() {
        return;
    }
    if stride == 1 {
        plane[first..first + values.len()].copy_from_slice(values);
        return;
    }
    for (place, value) in plane[first..].iter_mut().step_by(stride as usize).zip(values) {
        *place = *value;
    }
}

impl Tracer<'_> {
    fn points(&self, octet: &Octet, channels: Channels) -> Points<'_> {
        let nothing = DVec3x8::splat(DVec3::ZERO);
        let mut points = Points {
            materials: [None; LANES],
            color: Vec3x8::splat(Vec3::ZERO),
            normal: nothing,
            plain: Mask8::NONE,
        };
        let is_colored = channels.has(Channel::Color) || channels.has(Channel::Albedo);
        let shadow = channels.has(Channel::Shadow);
        for i in 0..LANES {
            let Some(item) = self.world.items.get(octet.item[i] as usize) else { continue };
            points.normal.set(i, item.normals[usize::from(octet.face[i])]);
            if !is_colored && !shadow {
                points.plain.0[i] = u32::MAX;
                continue;
            }
            let scene = &self.world.scene;
            let material =
                scene.material(&scene.objects[item.object], usize::from(octet.value[i]).wrapping_sub(1));
            let mirrors = self.bounces > 0 && material.reflectivity > 0.0;
            if material.texture.is_none() && !mirrors && material.effective_opacity(material.opacity) >= 1.0 {
                points.plain.0[i] = u32::MAX;
                points.materials[i] = Some(material);
                points.color.set(i, item.color_of(octet.cell(i)).unwrap_or(material.base_color));
            }
        }
        points
    }

    /// Writes what eight neighboring pixels of a row see, from a place of the band on.
    #[inline(always)]
    pub(crate) fn write(
        &self,
        octet: &Octet,
        lights: &[Option<Reach>],
        wants: Wants,
        band: &mut Band<'_>,
        channels: Channels,
        place: Row,
    ) {
        let Row { x, row, stride, count } = place;
        let count = count as usize;
        let first = (row * band.width + x) as usize;
        let points = self.points(octet, channels);
        let seen = octet.seen();
        let environment = &self.world.scene.environment;
        if wants.color || wants.shadow {
            let lit = self.light_octet(octet, &points, lights, wants);
            if wants.color {
                let background = environment.background.gradient().colors(octet.rays.direction.y.round());
                let mut colors = [Vec3::ZERO; LANES];
                for (i, color) in colors.iter_mut().enumerate() {
                    let own = if octet.item[i] == NOTHING {
                        background.get(i)
                    } else {
                        fogged(environment, lit.color.get(i), octet.t.0[i])
                    };
                    // Adding to zero drops the sign of -0, as adding up layers does.
                    *color = if octet.rays.there.has(i) { finite(Vec3::ZERO + own) } else { Vec3::ZERO };
                }
                put(band.color, first, stride, &colors[..count]);
            }
            if wants.shadow {
                put(band.shadow, first, stride, &lit.shadow[..count]);
            }
        }
        put(band.distance, first, stride, &octet.t.round().0[..count]);
        if channels.has(Channel::Normal) {
            let (given, mut normals) = (points.normal.round(), [Pixel::background(Vec3::ZERO).normal; LANES]);
            for (i, normal) in normals.iter_mut().enumerate().filter(|(i, _)| seen.has(*i)) {
                *normal = finite(given.get(i));
            }
            put(band.normal, first, stride, &normals[..count]);
        }
        if channels.has(Channel::Id) {
            let id = |item: u32| self.world.items.get(item as usize).map_or(0, |item| item.object as u32 + 1);
            put(band.id, first, stride, &octet.item.map(id)[..count]);
        }
        if channels.has(Channel::Albedo) {
            let mut albedo = [Vec3::ZERO; LANES];
            for (i, albedo) in albedo.iter_mut().enumerate() {
                *albedo = finite(points.color.get(i));
            }
            put(band.albedo, first, stride, &albedo[..count]);
        }
        if channels.has(Channel::Coverage) {
            put(band.coverage, first, stride, &seen.0.map(|m| (m & 1) as f32)[..count]);
        }
        let others = seen & !points.plain;
        if others.any() {
            for i in (0..count).filter(|&i| others.has(i)) {
                let pixel = self.color(&octet.rays.one(i), octet.met(i), lights, wants);
                band.put(x + i as u32 * stride, row, &pixel);
            }
        }
    }

    /// Lights the points that are plain.
    #[inline(always)]
    fn light_octet(&self, octet: &Octet, points: &Points<'_>, lights: &[Option<Reach>], wants: Wants) -> Lit {
        let environment = &self.world.scene.environment;
        let normal = points.normal.round();
        let to_eye = DVec3x8::splat(DVec3::ZERO) - octet.rays.direction;
        let to_eye = to_eye.round();
        let mut lit = Lit { color: Vec3x8::splat(Vec3::ZERO), shadow: [1.0; LANES] };
        let mut asked = octet.seen() & points.plain;
        if wants.color {
            for (i, material) in points.materials.iter().enumerate() {
                if let Some(m) = material {
                    lit.color.set(i, m.emission + environment.ambient * points.color.get(i) * m.ambient);
                } else {
                    asked.0[i] = 0;
                }
            }
        }
        if !asked.any() {
            return lit;
        }
        let (mut casting, mut reaching) = ([0u32; LANES], [0u32; LANES]);
        let position = octet.position();
        for (index, lamp) in self.world.lamps.iter().enumerate() {
            let mut to_light = DVec3x8::splat(DVec3::ZERO);
            let mut radiance = Vec3x8::splat(Vec3::ZERO);
            let mut ends = F64x8::splat(f64::INFINITY);
            let mut arrives = Mask8::NONE;
            if let Some(arriving) = lamp.everywhere() {
                let Some(arriving) = arriving else { continue };
                to_light = DVec3x8::splat(arriving.to_light);
                radiance = Vec3x8::splat(arriving.radiance);
                arrives = asked;
            } else {
                for i in (0..LANES).filter(|&i| asked.has(i)) {
                    let Some(arriving) = lamp.arriving(position.get(i)) else { continue };
                    to_light.set(i, arriving.to_light);
                    radiance.set(i, arriving.radiance);
                    ends.0[i] = arriving.distance;
                    arrives.0[i] = u32::MAX;
                }
            }
            if lamp.casts_shadow {
                for (count, arrives) in casting.iter_mut().zip(arrives.0) {
                    *count += arrives & 1;
                }
            }
            let facing = arrives & points.normal.dot(to_light).above(F64x8::ZERO);
            if !facing.any() {
                continue;
            }
            let mut share = Vec3x8::splat(Vec3::ZERO);
            let mut needed = if wants.shadow && lamp.casts_shadow { facing } else { Mask8::NONE };
            if wants.color {
                let model = environment.lighting;
                let surfaces = (points.color, normal, to_eye);
                share = lit_by_material(points.materials, surfaces, model, to_light.round(), radiance);
                for i in 0..LANES {
                    if facing.has(i) && share.get(i) != Vec3::ZERO {
                        needed.0[i] = u32::MAX;
                    }
                }
            }
            let mut reaches = needed;
            if lamp.is_blocked && self.shadows == Shadows::Hard && needed.any() {
                self.counts.shadow_rays.set(self.counts.shadow_rays.get() + u64::from(needed.count()));
                let reach = lights.get(index).and_then(Option::as_ref);
                if lamp.is_cell() {
                    let lifted = self.world.lifted(octet, points.normal);
                    for i in (0..LANES).filter(|&i| needed.has(i)) {
                        let ray =
                            polyptych_core::math::Ray { origin: lifted.get(i), direction: to_light.get(i) };
                        ends.0[i] = lamp.shadow_end(&ray, ends.0[i]);
                    }
                }
                if reach.is_none_or(|reach| !reach.is_empty()) {
                    let way = (points.normal, to_light, ends);
                    let blocked = self.world.blocked_octet(octet, way, needed, reach, &self.counts);
                    reaches = needed & !blocked;
                }
            }
            if wants.color {
                lit.color = lit.color + Vec3x8::pick(reaches, share, Vec3x8::splat(Vec3::ZERO));
            }
            if lamp.casts_shadow {
                for (count, reaches) in reaching.iter_mut().zip(reaches.0) {
                    *count += reaches & 1;
                }
            }
        }
        for i in 0..LANES {
            if casting[i] > 0 {
                lit.shadow[i] = reaching[i] as f32 / casting[i] as f32;
            }
        }
        lit
    }
}
