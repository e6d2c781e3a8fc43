//! How are eight pixels lit, and what is written of them? The answers of [`Tracer::color`], eight at a time, for
//! solids that are no mirrors; others are asked of it.

use crate::lamps::Lamp;
use crate::octet::{NOTHING, Octet, Way};
use crate::paint::Row;
use crate::trace::{Shadows, Tracer, Wants, finite};
use crate::world::Reach;
use glam::{DVec3, Vec3};
use polyptych_core::framebuffer::{Band, Channel, Channels, Pixel};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::math::Ray;
use polyptych_core::scene::Material;
use polyptych_core::shade::{fogged, lit_by_material};

/// Colors of eight points, and the shares of lights that reach them.
#[derive(Clone, Copy)]
struct Lit {
    color: Vec3x8,
    shadow: [f32; LANES],
}

impl Lit {
    const NONE: Self = Self {
        color: Vec3x8 {
            x: F32x8::new([0.0; LANES]),
            y: F32x8::new([0.0; LANES]),
            z: F32x8::new([0.0; LANES]),
        },
        shadow: [1.0; LANES],
    };
}

/// The light of a lamp at eight points.
#[derive(Clone, Copy)]
struct Arriving {
    /// Where it comes from, and which points ask whether anything is between.
    way: Way,
    share: Vec3x8,
    /// Where the lamp shines at all.
    arrives: Mask8,
}

impl Arriving {
    const NONE: Self = Self {
        way: Way {
            normal: NOWHERE,
            to_light: NOWHERE,
            ends: F64x8::new([f64::INFINITY; LANES]),
            asked: Mask8::NONE,
        },
        share: Lit::NONE.color,
        arrives: Mask8::NONE,
    };
}

/// Zero for each of eight points.
const NOWHERE: DVec3x8 = DVec3x8 { x: F64x8::ZERO, y: F64x8::ZERO, z: F64x8::ZERO };

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
        if !is_colored && !shadow && !channels.has(Channel::Normal) {
            points.plain = Mask8::ALL;
            return points;
        }
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

    /// Writes what twice eight neighboring pixels of a row see, from places of the band on.
    #[inline(always)]
    pub(crate) fn write(
        &self,
        octets: &[Octet; 2],
        lights: &[Option<Reach>],
        wants: Wants,
        band: &mut Band<'_>,
        channels: Channels,
        places: [Row; 2],
    ) {
        let points = [self.points(&octets[0], channels), self.points(&octets[1], channels)];
        let mut lit = [Lit::NONE; 2];
        if wants.color || wants.shadow {
            lit = self.light_octets(octets, &points, lights, wants);
        }
        for k in 0..2 {
            if places[k].count > 0 {
                self.write_row((&octets[k], &points[k], &lit[k]), lights, wants, band, channels, places[k]);
            }
        }
    }

    /// Writes what eight neighboring pixels of a row see.
    #[inline(always)]
    fn write_row(
        &self,
        (octet, points, lit): (&Octet, &Points<'_>, &Lit),
        lights: &[Option<Reach>],
        wants: Wants,
        band: &mut Band<'_>,
        channels: Channels,
        place: Row,
    ) {
        let Row { x, row, stride, count } = place;
        let count = count as usize;
        let first = (row * band.width + x) as usize;
        let seen = octet.seen();
        let environment = &self.world.scene.environment;
        if wants.color || wants.shadow {
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
    fn light_octets(
        &self,
        octets: &[Octet; 2],
        points: &[Points<'_>; 2],
        lights: &[Option<Reach>],
        wants: Wants,
    ) -> [Lit; 2] {
        let environment = &self.world.scene.environment;
        let mut lit = [Lit::NONE; 2];
        let mut asked = [octets[0].seen() & points[0].plain, octets[1].seen() & points[1].plain];
        if wants.color {
            for k in 0..2 {
                for (i, material) in points[k].materials.iter().enumerate() {
                    if let Some(m) = material {
                        let own = points[k].color.get(i);
                        lit[k].color.set(i, m.emission + environment.ambient * own * m.ambient);
                    } else {
                        asked[k].0[i] = 0;
                    }
                }
            }
        }
        if !(asked[0] | asked[1]).any() {
            return lit;
        }
        let (mut casting, mut reaching) = ([[0u32; LANES]; 2], [[0u32; LANES]; 2]);
        let mut arriving = [Arriving::NONE; 2];
        for (index, lamp) in self.world.lamps.iter().enumerate() {
            for k in 0..2 {
                arriving[k] = self.arriving(lamp, &octets[k], &points[k], asked[k], wants);
            }
            let mut reaches = [arriving[0].way.asked, arriving[1].way.asked];
            let reach = lights.get(index).and_then(Option::as_ref);
            if lamp.is_blocked && self.shadows == Shadows::Hard && (reaches[0] | reaches[1]).any() {
                let count = reaches[0].count() + reaches[1].count();
                self.counts.shadow_rays.set(self.counts.shadow_rays.get() + u64::from(count));
                if reach.is_none_or(|reach| !reach.is_empty()) {
                    let ways = [arriving[0].way, arriving[1].way];
                    let blocked = self.world.blocked_octets(octets, &ways, reach, &self.counts);
                    reaches = [reaches[0] & !blocked[0], reaches[1] & !blocked[1]];
                }
            }
            for k in 0..2 {
                if wants.color {
                    let nothing = Vec3x8::splat(Vec3::ZERO);
                    lit[k].color = lit[k].color + Vec3x8::pick(reaches[k], arriving[k].share, nothing);
                }
                if lamp.casts_shadow {
                    for i in 0..LANES {
                        casting[k][i] += arriving[k].arrives.0[i] & 1;
                        reaching[k][i] += reaches[k].0[i] & 1;
                    }
                }
            }
        }
        for k in 0..2 {
            for i in 0..LANES {
                if casting[k][i] > 0 {
                    lit[k].shadow[i] = reaching[k][i] as f32 / casting[k][i] as f32;
                }
            }
        }
        lit
    }

    /// Finds what a lamp adds to eight points where nothing is between.
    #[inline(always)]
    fn arriving(
        &self,
        lamp: &Lamp,
        octet: &Octet,
        points: &Points<'_>,
        asked: Mask8,
        wants: Wants,
    ) -> Arriving {
        let environment = &self.world.scene.environment;
        let mut radiance = Vec3x8::splat(Vec3::ZERO);
        let mut way = Way {
            normal: points.normal,
            to_light: DVec3x8::splat(DVec3::ZERO),
            ends: F64x8::splat(f64::INFINITY),
            asked: Mask8::NONE,
        };
        let mut arrives = Mask8::NONE;
        if let Some(everywhere) = lamp.everywhere() {
            if let Some(arriving) = everywhere {
                way.to_light = DVec3x8::splat(arriving.to_light);
                radiance = Vec3x8::splat(arriving.radiance);
                arrives = asked;
            }
        } else {
            let position = octet.position();
            for i in (0..LANES).filter(|&i| asked.has(i)) {
                let Some(arriving) = lamp.arriving(position.get(i)) else { continue };
                way.to_light.set(i, arriving.to_light);
                radiance.set(i, arriving.radiance);
                way.ends.0[i] = arriving.distance;
                arrives.0[i] = u32::MAX;
            }
        }
        let facing = arrives & points.normal.dot(way.to_light).above(F64x8::ZERO);
        let mut share = Vec3x8::splat(Vec3::ZERO);
        if !facing.any() {
            return Arriving { way, share, arrives };
        }
        if wants.shadow && lamp.casts_shadow {
            way.asked = facing;
        }
        if wants.color {
            let to_eye = DVec3x8::splat(DVec3::ZERO) - octet.rays.direction;
            let surfaces = (points.color, points.normal.round(), to_eye.round());
            let model = environment.lighting;
            share = lit_by_material(points.materials, surfaces, model, way.to_light.round(), radiance);
            for i in 0..LANES {
                if facing.has(i) && share.get(i) != Vec3::ZERO {
                    way.asked.0[i] = u32::MAX;
                }
            }
        }
        if lamp.is_cell() && lamp.is_blocked && self.shadows == Shadows::Hard {
            let lifted = self.world.lifted(octet, points.normal);
            for i in (0..LANES).filter(|&i| way.asked.has(i)) {
                let ray = Ray { origin: lifted.get(i), direction: way.to_light.get(i) };
                way.ends.0[i] = lamp.shadow_end(&ray, way.ends.0[i]);
            }
        }
        Arriving { way, share, arrives }
    }
}
