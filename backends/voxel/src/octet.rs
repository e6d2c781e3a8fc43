//! What do eight rays meet first, and what stands between eight points and a light?
//!
//! The answers of [`World::meet`] and [`World::is_blocked`], eight at a time. What is no plain solid (a texture with
//! holes, a ray that began in a cell, a grid too long for single precision) is asked of them, ray by ray.

use crate::beam::Span;
use crate::levels::Footprint;
use crate::walk::packet::{GridRays, Packet, Stretch};
use crate::walk::steps::find_marked;
use crate::world::{Counts, LIFT, Met, Place, Reach, Site, World};
use glam::DAffine3;
use polyptych_core::lanes::{DVec3x8, F64x8, I32x8, LANES, Mask8};
use polyptych_core::math::Ray;

/// Stands for no grid.
pub(crate) const NOTHING: u32 = u32::MAX;

/// Rays through eight pixels.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rays {
    pub(crate) origin: DVec3x8,
    pub(crate) direction: DVec3x8,
    pub(crate) there: Mask8,
}

impl Rays {
    #[inline(always)]
    pub(crate) fn one(&self, lane: usize) -> Ray {
        Ray { origin: self.origin.get(lane), direction: self.direction.get(lane) }
    }
}

impl Rays {
    /// Moves them into the space of a grid.
    #[inline(always)]
    fn within(&self, map: &DAffine3) -> GridRays {
        let origin = self.origin.turned(&map.matrix3) + DVec3x8::splat(map.translation);
        GridRays::new(origin, self.direction.turned(&map.matrix3), self.there)
    }
}

/// Where rays of the eye may meet something first: between two distances, and nearer than what they met before.
#[inline(always)]
fn first_stretch(rays: &GridRays, span: &Span, met: F64x8, [begins, ends]: [f64; 2]) -> Stretch {
    let (from, to) = span.eight_distances(rays);
    // Just before the plane: where a ray is then is beyond doubt.
    let from = (from * F64x8::splat(1.0 - 1e-9)).max(F64x8::splat(begins));
    Stretch { from, to: minimum(minimum(to, met), F64x8::splat(ends)) }
}

/// Moves rays toward a light into the space of a grid: from its own surfaces, or from above those of others.
#[inline(always)]
fn shadow_rays(
    octet: &Octet,
    is_own: bool,
    map: &DAffine3,
    (lifted, to_light): (DVec3x8, DVec3x8),
    there: Mask8,
) -> GridRays {
    let mut origin = octet.site;
    if !is_own {
        origin = lifted.turned(&map.matrix3) + DVec3x8::splat(map.translation);
    }
    GridRays::new(origin, to_light.turned(&map.matrix3), there)
}

/// Eight pixels and the surfaces that they see first.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Octet {
    pub(crate) rays: Rays,
    /// Distances, infinite where nothing is met.
    pub(crate) t: F64x8,
    /// Index of each grid among the items of the world, or [`NOTHING`].
    pub(crate) item: [u32; LANES],
    /// See [`crate::walk::Walk::face`].
    pub(crate) face: [u8; LANES],
    /// Byte of each cell. This, and what follows, is told where it was asked for.
    pub(crate) value: [u8; LANES],
    pub(crate) began_inside: Mask8,
    /// Where the cells were entered, in the space of their grids: exactly in the face.
    pub(crate) site: DVec3x8,
    /// See [`crate::walk::Walk::cell_before`].
    pub(crate) before: [I32x8; 3],
    /// See [`crate::walk::Walk::rank`].
    pub(crate) rank: [i32; LANES],
}

/// Where the light of eight surfaces comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Way {
    /// Of the surfaces, in the world.
    pub(crate) normal: DVec3x8,
    pub(crate) to_light: DVec3x8,
    /// Distances of the light.
    pub(crate) ends: F64x8,
    /// Those for which it is asked whether anything is between.
    pub(crate) asked: Mask8,
}

/// Whether more than distances and faces is asked for: the bytes of cells, and where they were entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Bytes {
    Read,
    Unread,
}

/// Sets the lanes whose bits are.
#[inline(always)]
fn mask_of(bits: u32) -> Mask8 {
    let mut mask = Mask8::NONE;
    for i in 0..LANES {
        mask.0[i] = 0u32.wrapping_sub(bits >> i & 1);
    }
    mask
}

#[inline(always)]
fn minimum(a: F64x8, b: F64x8) -> F64x8 {
    a.min(b)
}

impl Octet {
    #[inline(always)]
    pub(crate) fn nothing(rays: Rays) -> Self {
        Self {
            rays,
            t: F64x8::splat(f64::INFINITY),
            item: [NOTHING; LANES],
            face: [0; LANES],
            value: [0; LANES],
            began_inside: Mask8::NONE,
            site: DVec3x8 { x: F64x8::ZERO, y: F64x8::ZERO, z: F64x8::ZERO },
            before: [I32x8::splat(0); 3],
            rank: [0; LANES],
        }
    }

    /// Tells which pixels see something.
    #[inline(always)]
    pub(crate) fn seen(&self) -> Mask8 {
        let mut seen = Mask8::NONE;
        for i in 0..LANES {
            seen.0[i] = if self.item[i] == NOTHING { 0 } else { u32::MAX };
        }
        seen
    }

    /// Returns where the surfaces are in the world.
    #[inline(always)]
    pub(crate) fn position(&self) -> DVec3x8 {
        self.rays.origin + self.rays.direction.scaled(self.t)
    }

    /// Returns one surface as the walk ray by ray tells it.
    pub(crate) fn met(&self, lane: usize) -> Option<Met> {
        let cell = [self.before[0].0[lane], self.before[1].0[lane], self.before[2].0[lane]];
        (self.item[lane] != NOTHING).then(|| Met {
            place: Place {
                t: self.t.0[lane],
                item: i64::from(self.item[lane]),
                rank: i64::from(self.rank[lane]),
            },
            origin: self.site.get(lane),
            cell_before: cell,
            face: self.face[lane],
            value: self.value[lane],
            began_inside: self.began_inside.has(lane),
        })
    }

    /// Returns the cell whose surface a pixel sees.
    pub(crate) fn cell(&self, lane: usize) -> [i32; 3] {
        let mut cell = [self.before[0].0[lane], self.before[1].0[lane], self.before[2].0[lane]];
        if !self.began_inside.has(lane) {
            let face = usize::from(self.face[lane]);
            cell[face / 2] += if face.is_multiple_of(2) { 1 } else { -1 };
        }
        cell
    }

    fn put(&mut self, lane: usize, met: &Met) {
        self.t.0[lane] = met.place.t;
        self.item[lane] = met.place.item as u32;
        self.rank[lane] = met.place.rank as i32;
        self.site.set(lane, met.origin);
        for a in 0..3 {
            self.before[a].0[lane] = met.cell_before[a];
        }
        self.face[lane] = met.face;
        self.value[lane] = met.value;
        self.began_inside.0[lane] = if met.began_inside { u32::MAX } else { 0 };
    }

    fn site(&self, lane: usize) -> Site {
        Site {
            item: self.item[lane] as usize,
            origin: self.site.get(lane),
            cell: [self.before[0].0[lane], self.before[1].0[lane], self.before[2].0[lane]],
            is_within_solid: self.began_inside.has(lane),
        }
    }
}

impl World {
    /// Finds the first surfaces that rays from the eye meet, among what their tile can reach.
    #[inline(always)]
    pub(crate) fn meet_octets(
        &self,
        octets: &mut [Octet; 2],
        reach: &Reach,
        (bytes, footprint): (Bytes, &Footprint),
        counts: &Counts,
    ) {
        // Loops of two, not two calls: what is inlined twice is compiled twice.
        let (mut rays, mut packets) = ([GridRays::NOWHERE; 2], [Packet::NOWHERE; 2]);
        for (index, span) in reach.grids.iter().flatten() {
            let (index, item) = (*index, &self.items[*index as usize]);
            let layer = &item.grid.seen;
            let [begins, ends] = item.range(&self.items, footprint);
            let Some(order) = self.walk.order().filter(|_| Packet::can(layer)) else {
                for octet in octets.iter_mut() {
                    let there = octet.rays.there;
                    self.meet_each(octet, index, span, (there, [begins, ends]), counts);
                }
                continue;
            };
            let map = &item.grid_from_world;
            for k in 0..2 {
                rays[k] = octets[k].rays.within(map);
                let stretch = first_stretch(&rays[k], span, octets[k].t, [begins, ends]);
                packets[k] = Packet::begin(&rays[k], layer.size, None, &stretch);
            }
            let (all_hits, steps) = find_marked(&mut packets, &rays, layer, order);
            counts.steps.set(counts.steps.get() + u64::from(steps));
            for k in 0..2 {
                let (octet, packet) = (&mut octets[k], &packets[k]);
                let mut marked = all_hits[k].marked;
                if begins > 0.0 && marked != 0 {
                    let within = mask_of(marked) & packet.begun_in();
                    if within.any() {
                        for lane in (0..LANES).filter(|&lane| within.has(lane)) {
                            marked &= !(1 << lane);
                        }
                        self.meet_each(octet, index, span, (within, [begins, ends]), counts);
                    }
                }
                if marked != 0 {
                    if item.without_holes {
                        self.take(octet, &rays[k], packet, index, mask_of(marked), bytes);
                    } else {
                        self.meet_each(octet, index, span, (mask_of(marked), [begins, ends]), counts);
                    }
                }
                if packet.refused.any() {
                    self.meet_each(octet, index, span, (packet.refused, [begins, ends]), counts);
                }
            }
        }
    }

    /// Asks ray by ray.
    #[cold]
    #[inline(never)]
    fn meet_each(
        &self,
        octet: &mut Octet,
        index: u32,
        span: &Span,
        (asked, [begins, ends]): (Mask8, [f64; 2]),
        counts: &Counts,
    ) {
        let is_coarse = self.items[index as usize].colors.is_some();
        for lane in (0..LANES).filter(|&lane| asked.has(lane)) {
            let old = octet.met(lane);
            let (ray, before) = (octet.rays.one(lane), octet.t.0[lane].min(ends));
            let met = if is_coarse {
                self.meet_coarse(index as usize, &ray, [begins, before], counts)
            } else {
                self.meet_grid(index as usize, span, &ray, before, counts)
            };
            if let Some(new) = met
                && old.as_ref().is_none_or(|old| new.place < old.place)
            {
                octet.put(lane, &new);
            }
        }
    }

    /// Notes the cells that were met where they are nearer than what was met before.
    #[inline(always)]
    fn take(
        &self,
        octet: &mut Octet,
        rays: &GridRays,
        packet: &Packet,
        index: u32,
        marked: Mask8,
        bytes: Bytes,
    ) {
        let faces = packet.faces(rays);
        let mut nearer = octet.t.above(faces.t);
        for i in 0..LANES {
            if faces.t.0[i] == octet.t.0[i] && index < octet.item[i] {
                nearer.0[i] = u32::MAX;
            }
        }
        let taken = marked & nearer;
        octet.t = F64x8::pick(taken, faces.t, octet.t);
        for i in 0..LANES {
            if taken.has(i) {
                octet.item[i] = index;
                octet.face[i] = faces.face.0[i] as u8;
            }
        }
        if bytes == Bytes::Unread {
            return;
        }
        octet.site = DVec3x8::pick(taken, faces.point, octet.site);
        for a in 0..3 {
            octet.before[a] = I32x8::pick(taken, faces.before[a], octet.before[a]);
        }
        octet.began_inside = (octet.began_inside & !taken) | (taken & faces.entered.equal(I32x8::splat(3)));
        let grid = &self.items[index as usize].grid;
        for i in 0..LANES {
            if taken.has(i) {
                octet.rank[i] = faces.rank.0[i];
                let cell = [faces.cell[0].0[i], faces.cell[1].0[i], faces.cell[2].0[i]];
                octet.value[i] = grid.value(cell);
            }
        }
    }

    /// Returns where rays to other grids leave surfaces: a little above them.
    #[inline(always)]
    pub(crate) fn lifted(&self, octet: &Octet, normal: DVec3x8) -> DVec3x8 {
        let position = octet.position();
        let mut largest = position.x.abs().max(position.y.abs()).max(position.z.abs()).max(octet.t);
        for i in 0..LANES {
            if let Some(item) = self.items.get(octet.item[i] as usize) {
                largest.0[i] = largest.0[i].max(item.radius);
            }
        }
        position + normal.scaled(largest * F64x8::splat(LIFT))
    }

    /// Tells for which of some surfaces anything blocks the light from a direction, nearer than some distance; `reach`
    /// are the grids that the rays may meet, where that is known.
    #[inline(always)]
    pub(crate) fn blocked_octets(
        &self,
        octets: &[Octet; 2],
        ways: &[Way; 2],
        reach: Option<&Reach>,
        counts: &Counts,
    ) -> [Mask8; 2] {
        let mut blocked = [Mask8::NONE; 2];
        let mut lifted = [ways[0].normal; 2];
        for k in 0..2 {
            lifted[k] = self.lifted(&octets[k], ways[k].normal);
        }
        let (Some(reach), Some(order)) = (reach, self.walk.order()) else {
            for k in 0..2 {
                let view = (lifted[k], ways[k].to_light, ways[k].ends);
                blocked[k] = self.blocked_each(&octets[k], view, ways[k].asked, reach, counts);
            }
            return blocked;
        };
        let (mut rays, mut packets) = ([GridRays::NOWHERE; 2], [Packet::NOWHERE; 2]);
        for (index, span) in reach.grids.iter().flatten() {
            let (index, item) = (*index, &self.items[*index as usize]);
            let layer = &item.grid.blocking;
            let mut open = [ways[0].asked & !blocked[0], ways[1].asked & !blocked[1]];
            if !Packet::can(layer) {
                for k in 0..2 {
                    let view = (lifted[k], ways[k].to_light, ways[k].ends);
                    blocked[k] =
                        blocked[k] | self.blocked_by(&octets[k], view, (index, span), open[k], counts);
                }
                continue;
            }
            let map = &item.grid_from_world;
            for is_own in [true, false] {
                let mut lanes = open;
                for k in 0..2 {
                    for i in 0..LANES {
                        let is_among = (octets[k].item[i] == index) == is_own;
                        lanes[k].0[i] = if is_among { open[k].0[i] } else { 0 };
                    }
                }
                if !(lanes[0] | lanes[1]).any() {
                    continue;
                }
                for k in 0..2 {
                    let way = &ways[k];
                    rays[k] = shadow_rays(&octets[k], is_own, map, (lifted[k], way.to_light), lanes[k]);
                    let to = minimum(span.eight_distances(&rays[k]).1, way.ends);
                    let known = is_own.then_some(octets[k].before);
                    packets[k] =
                        Packet::begin(&rays[k], layer.size, known, &Stretch { from: F64x8::ZERO, to });
                }
                let (hits, steps) = find_marked(&mut packets, &rays, layer, order);
                counts.steps.set(counts.steps.get() + u64::from(steps));
                for k in 0..2 {
                    let (octet, way) = (&octets[k], &ways[k]);
                    let mut met = mask_of(hits[k].marked);
                    let sure =
                        if is_own { mask_of(hits[k].passed_empty) & !octet.began_inside } else { Mask8::ALL };
                    if (met & F64x8::splat(f64::INFINITY).above(way.ends)).any() {
                        met = met & way.ends.above(packets[k].faces(&rays[k]).t);
                    }
                    let sure = if item.without_holes { sure } else { Mask8::NONE };
                    blocked[k] = blocked[k] | (met & sure);
                    let doubtful = (met & !sure) | packets[k].refused;
                    if doubtful.any() {
                        let view = (lifted[k], way.to_light, way.ends);
                        blocked[k] =
                            blocked[k] | self.blocked_by(octet, view, (index, span), doubtful, counts);
                    }
                    open[k] = open[k] & !lanes[k];
                }
            }
        }
        blocked
    }

    /// Asks one grid ray by ray.
    #[cold]
    #[inline(never)]
    fn blocked_by(
        &self,
        octet: &Octet,
        (lifted, to_light, ends): (DVec3x8, DVec3x8, F64x8),
        (index, span): (u32, &Span),
        asked: Mask8,
        counts: &Counts,
    ) -> Mask8 {
        let mut blocked = Mask8::NONE;
        for i in (0..LANES).filter(|&i| asked.has(i)) {
            let ray = Ray { origin: lifted.get(i), direction: to_light.get(i) };
            if self.blocks(index as usize, &ray, &octet.site(i), ends.0[i], Some(span), counts) {
                blocked.0[i] = u32::MAX;
            }
        }
        blocked
    }

    /// Asks ray by ray.
    #[inline(never)]
    fn blocked_each(
        &self,
        octet: &Octet,
        (lifted, to_light, ends): (DVec3x8, DVec3x8, F64x8),
        asked: Mask8,
        reach: Option<&Reach>,
        counts: &Counts,
    ) -> Mask8 {
        let mut blocked = Mask8::NONE;
        for i in (0..LANES).filter(|&i| asked.has(i)) {
            let ray = Ray { origin: lifted.get(i), direction: to_light.get(i) };
            if self.is_blocked(&ray, &octet.site(i), ends.0[i], reach, counts) {
                blocked.0[i] = u32::MAX;
            }
        }
        blocked
    }
}
