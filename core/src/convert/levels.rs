//! How few of its triangles show a mesh to a tolerance?
//!
//! A corner is taken out by moving it onto a neighbor, if that changes the surface by little. What counts is how far the
//! given corners are from the triangles that are left: each that is gone is kept in mind by the triangle above or below
//! it, and measured again whenever that changes. This tells more than the quadrics of M. Garland and P. Heckbert, *Surface
//! simplification using quadric error metrics* (SIGGRAPH 1997), which sum squared distances from planes.
//!
//! Corners at borders, at seams of normals, texture coordinates and materials, and where more than one sheet meets stay.

use crate::scene::Mesh;
use crate::seam::{Cancelled, Control};
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Cosine of the angle by which a shading normal may be turned.
const SAME_NORMAL: f32 = 0.9987;
/// By how much a vertex color may change.
const SAME_COLOR: f32 = 1.0 / 128.0;
/// By what share of its triangles' extent on the texture a texture coordinate may move.
const SAME_UV: f32 = 1.0 / 64.0;
/// Most neighbors of a corner that is looked at: the work grows with the square.
const MOST_NEIGHBORS: usize = 16;
/// Most rounds; each takes out corners that have nothing to do with one another.
const ROUNDS: u32 = 40;
/// Corners looked at by one worker at a time: less than a millisecond's work.
const PIECE: usize = 128;

/// Returns fewer triangles, where that are many fewer, and how far the farthest given corner is from them, in units of the mesh.
pub(super) fn simplified(
    mesh: &Mesh,
    tolerance: f64,
    control: &Control<'_>,
) -> Result<(Mesh, f64), Cancelled> {
    let mut state = State::of(mesh, control)?;
    for round in 0..ROUNDS {
        // What is flattest goes first.
        let limit = tolerance * (f64::from(round + 1) / 4.0).min(1.0);
        let gone = state.round(limit, tolerance, control)?;
        if round >= 4 && gone * 100 < state.triangles.len() {
            break;
        }
    }
    // To save a few is not worth a surface that is only almost the given one.
    let is_worth = state.triangles.len() * 4 <= mesh.triangles.len() * 3;
    Ok(if is_worth { state.finish() } else { (mesh.clone(), 0.0) })
}

/// A triangle that is left.
#[derive(Clone, Copy)]
struct Triangle {
    corners: [u32; 3],
    slot: u16,
    /// How far the corners that it stands for are from it, at most.
    off: f32,
    /// The first of those.
    lost: u32,
}

/// No corner.
const NONE: u32 = u32::MAX;

/// Where a corner goes.
#[derive(Clone, Copy)]
struct Move {
    to: u32,
    /// How far off its triangles are then.
    off: f64,
}

struct State<'a> {
    mesh: &'a Mesh,
    stays: Vec<bool>,
    triangles: Vec<Triangle>,
    /// Of each corner that is gone, the next one of its triangle.
    next_lost: Vec<u32>,
    moves: Vec<Option<Move>>,
    /// Whose move must be looked for again.
    is_stale: Vec<bool>,
    /// Which triangles each corner has: those of corner `c` are `of_corner[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    of_corner: Vec<u32>,
}

impl<'a> State<'a> {
    fn of(mesh: &'a Mesh, control: &Control<'_>) -> Result<Self, Cancelled> {
        let count = mesh.positions.len();
        let mut known: HashMap<[u32; 3], u32> = HashMap::with_capacity(count);
        let mut stays = vec![false; count];
        for (i, p) in mesh.positions.iter().enumerate() {
            control.check()?;
            // Adding 0 makes one number of 0 and -0.
            let place = (*p + Vec3::ZERO).to_array().map(f32::to_bits);
            if let Some(other) = known.insert(place, i as u32) {
                (stays[i], stays[other as usize]) = (true, true);
            }
            stays[i] |= !p.is_finite();
        }
        mesh.segments.iter().flatten().for_each(|&i| stays[i as usize] = true);
        let triangle = |(t, &corners): (usize, &[u32; 3])| Triangle {
            corners,
            slot: mesh.slots.get(t).copied().unwrap_or(0),
            off: 0.0,
            lost: NONE,
        };
        Ok(Self {
            mesh,
            stays,
            triangles: mesh.triangles.iter().enumerate().map(triangle).collect(),
            next_lost: vec![NONE; count],
            moves: vec![None; count],
            is_stale: vec![true; count],
            first: Vec::new(),
            of_corner: Vec::new(),
        })
    }

    /// Lists the triangles of each corner.
    fn link(&mut self) {
        self.first.clear();
        self.first.resize(self.stays.len() + 1, 0);
        for corner in self.triangles.iter().flat_map(|t| t.corners) {
            self.first[corner as usize + 1] += 1;
        }
        for i in 1..self.first.len() {
            self.first[i] += self.first[i - 1];
        }
        self.of_corner.resize(self.triangles.len() * 3, 0);
        let mut next = self.first.clone();
        for (t, triangle) in self.triangles.iter().enumerate() {
            for corner in triangle.corners {
                self.of_corner[next[corner as usize] as usize] = t as u32;
                next[corner as usize] += 1;
            }
        }
    }

    fn around(&self, corner: u32) -> &[u32] {
        let [from, to] = [0, 1].map(|i| self.first[corner as usize + i] as usize);
        &self.of_corner[from..to]
    }

    /// Takes out corners that change the surface by less than a limit. Returns how many.
    fn round(&mut self, limit: f64, tolerance: f64, control: &Control<'_>) -> Result<usize, Cancelled> {
        self.link();
        let mut moves = std::mem::take(&mut self.moves);
        control.for_each_mut(&mut moves, PIECE, &|corner, chosen| {
            if self.is_stale[corner] && !self.stays[corner] {
                *chosen = self.best_move(corner as u32, tolerance);
            }
        })?;
        self.is_stale.fill(false);
        let mut order: Vec<(f64, u32)> = moves
            .iter()
            .zip(0u32..)
            .filter_map(|(chosen, corner)| Some((chosen.as_ref()?.off, corner)))
            .filter(|(off, _)| *off <= limit)
            .collect();
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.moves = moves;
        let (mut touched, mut gone) = (vec![false; self.stays.len()], vec![false; self.triangles.len()]);
        let (mut count, mut added) = (0, Vec::new());
        for (_, corner) in order {
            control.check()?;
            let Some(chosen) = self.moves[corner as usize] else { continue };
            let is_free = |t: &u32| !self.triangles[*t as usize].corners.iter().any(|&c| touched[c as usize]);
            if !self.around(corner).iter().all(is_free) {
                continue;
            }
            let Some(star) = Star::of(self, corner) else { continue };
            for &t in self.around(corner) {
                gone[t as usize] = true;
                self.triangles[t as usize].corners.iter().for_each(|&c| touched[c as usize] = true);
            }
            star.go(self, chosen, &mut added);
            (self.moves[corner as usize], self.stays[corner as usize]) = (None, true);
            count += 1;
        }
        // What was found for a corner holds until something next to it changes.
        for triangle in &self.triangles {
            if triangle.corners.iter().any(|&c| touched[c as usize]) {
                triangle.corners.iter().for_each(|&c| self.is_stale[c as usize] = true);
            }
        }
        let mut each = gone.iter();
        self.triangles.retain(|_| each.next().is_some_and(|gone| !gone));
        self.triangles.append(&mut added);
        Ok(count)
    }

    /// Finds the neighbor onto which a corner is best moved.
    fn best_move(&self, corner: u32, tolerance: f64) -> Option<Move> {
        let star = Star::of(self, corner)?;
        let mut best: Option<Move> = None;
        for index in 0..star.count {
            let most = best.map_or(tolerance, |best| best.off);
            if let Some(off) = star.moved(self, index, most)
                && (off < most || best.is_none())
            {
                best = Some(Move { to: star.ring[index], off });
            }
        }
        best
    }

    fn finish(self) -> (Mesh, f64) {
        let mesh = self.mesh;
        let mut place = vec![u32::MAX; mesh.positions.len()];
        let mut kept = Vec::new();
        let used =
            self.triangles.iter().flat_map(|t| t.corners).chain(mesh.segments.iter().flatten().copied());
        for corner in used {
            if place[corner as usize] == u32::MAX {
                place[corner as usize] = kept.len() as u32;
                kept.push(corner as usize);
            }
        }
        fn of<T: Copy>(all: &[T], kept: &[usize]) -> Vec<T> {
            if all.is_empty() { Vec::new() } else { kept.iter().map(|&i| all[i]).collect() }
        }
        let moved = |corner: u32| place[corner as usize];
        let simplified = Mesh {
            positions: of(&mesh.positions, &kept),
            normals: of(&mesh.normals, &kept),
            uvs: of(&mesh.uvs, &kept),
            colors: of(&mesh.colors, &kept),
            triangles: self.triangles.iter().map(|t| t.corners.map(moved)).collect(),
            slots: if mesh.slots.is_empty() {
                Vec::new()
            } else {
                self.triangles.iter().map(|t| t.slot).collect()
            },
            segments: mesh.segments.iter().map(|s| s.map(moved)).collect(),
        };
        (simplified, self.triangles.iter().map(|t| f64::from(t.off)).fold(0.0, f64::max))
    }
}

/// A corner with all triangles around it, on a plane across their mean normal.
struct Star {
    corner: u32,
    /// Its neighbors in order.
    ring: [u32; MOST_NEIGHBORS],
    /// Places on the plane as seen from the corner, and heights above it.
    flat: [(DVec2, f64); MOST_NEIGHBORS],
    count: usize,
    slot: u16,
    /// Corners that its triangles stand for, itself among them, and where they are.
    lost: Vec<(u32, DVec2, f64)>,
}

impl Star {
    /// Sorts the triangles around a corner; nothing unless they close, face one way, and have one material.
    fn of(state: &State<'_>, corner: u32) -> Option<Self> {
        let around = state.around(corner);
        let count = around.len();
        if !(3..=MOST_NEIGHBORS).contains(&count) {
            return None;
        }
        let mut sides = [[0; 2]; MOST_NEIGHBORS];
        let slot = state.triangles[around[0] as usize].slot;
        for (side, &t) in sides.iter_mut().zip(around) {
            let Triangle { corners: [a, b, c], slot: own, .. } = state.triangles[t as usize];
            *side = if a == corner {
                [b, c]
            } else if b == corner {
                [c, a]
            } else {
                [a, b]
            };
            if own != slot || side[0] == side[1] || side.contains(&corner) {
                return None;
            }
        }
        let mut ring = [0; MOST_NEIGHBORS];
        let mut next = sides[0][0];
        for i in 0..count {
            ring[i] = next;
            let mut follows = sides[..count].iter().filter(|side| side[0] == next);
            let (Some(side), None) = (follows.next(), follows.next()) else { return None };
            next = side[1];
            if (next == ring[0]) != (i + 1 == count) {
                return None;
            }
        }
        let place = |i: u32| state.mesh.positions[i as usize].as_dvec3();
        let center = place(corner);
        let mut spokes = [DVec3::ZERO; MOST_NEIGHBORS];
        for (spoke, &neighbor) in spokes.iter_mut().zip(&ring[..count]) {
            *spoke = place(neighbor) - center;
        }
        let normal: DVec3 = (0..count).map(|i| spokes[i].cross(spokes[(i + 1) % count])).sum();
        let normal = normal.try_normalize()?;
        let (right, up) = normal.any_orthonormal_pair();
        let mut flat = [(DVec2::ZERO, 0.0); MOST_NEIGHBORS];
        for (flat, spoke) in flat.iter_mut().zip(&spokes[..count]) {
            *flat = (DVec2::new(right.dot(*spoke), up.dot(*spoke)), normal.dot(*spoke));
        }
        if !(0..count).all(|i| flat[i].0.perp_dot(flat[(i + 1) % count].0) > 0.0) {
            return None;
        }
        let mut lost = vec![(corner, DVec2::ZERO, 0.0)];
        for &t in around {
            let mut next = state.triangles[t as usize].lost;
            while next != NONE {
                let spoke = place(next) - center;
                lost.push((next, DVec2::new(right.dot(spoke), up.dot(spoke)), normal.dot(spoke)));
                next = state.next_lost[next as usize];
            }
        }
        Some(Self { corner, ring, flat, count, slot, lost })
    }

    /// Returns the triangles that are left when the corner goes to a neighbor: their corners' indices in the ring.
    fn left(&self, index: usize) -> impl Iterator<Item = [usize; 3]> {
        let count = self.count;
        (1..count - 1).map(move |i| [index, (index + i) % count, (index + i + 1) % count])
    }

    /// Returns how far off the worst of the lost corners is when the corner goes to a neighbor; nothing if it would be
    /// farther than a limit, if triangles would turn over, or if what is interpolated would change too much.
    fn moved(&self, state: &State<'_>, index: usize, limit: f64) -> Option<f64> {
        let is_sound = |[a, b, c]: [usize; 3]| {
            let [a, b, c] = [a, b, c].map(|i| self.flat[i].0);
            let longest =
                (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            // Slivers would shade badly.
            (b - a).perp_dot(c - a) > 0.02 * longest
        };
        if !self.left(index).all(is_sound) {
            return None;
        }
        let mut worst = 0.0f64;
        for &(lost, place, height) in &self.lost {
            let (_, triangle, weights, above) = self.over(index, place)?;
            worst = worst.max((above - height).abs());
            if worst > limit {
                return None;
            }
            if lost == self.corner {
                let corners = triangle.map(|i| self.ring[i]);
                if !self.keeps_what_is_interpolated(state.mesh, corners, weights.as_vec2()) {
                    return None;
                }
            }
        }
        self.stays_a_sheet(state, index).then_some(worst)
    }

    /// Finds which of the triangles that are left is over a place: its number, its corners in the ring, the weights of the
    /// second and third, and how high it is there. A place beside all of them is given to the nearest.
    fn over(&self, index: usize, place: DVec2) -> Option<(usize, [usize; 3], DVec2, f64)> {
        let mut best = None;
        let mut most = f64::NEG_INFINITY;
        for (number, triangle) in self.left(index).enumerate() {
            let [(a, at_a), (b, at_b), (c, at_c)] = triangle.map(|i| self.flat[i]);
            let (ab, ac, ap) = (b - a, c - a, place - a);
            let weights = DVec2::new(ap.perp_dot(ac), ab.perp_dot(ap)) / ab.perp_dot(ac);
            let least = weights.min_element().min(1.0 - weights.element_sum());
            if least > most {
                most = least;
                let above = at_a + (at_b - at_a) * weights.x + (at_c - at_a) * weights.y;
                best = Some((number, triangle, weights, above));
                if least >= 0.0 {
                    break;
                }
            }
        }
        best
    }

    /// Moves the corner: adds the triangles that are left, with what they stand for.
    fn go(&self, state: &mut State<'_>, chosen: Move, added: &mut Vec<Triangle>) {
        let Some(index) = self.ring[..self.count].iter().position(|&c| c == chosen.to) else { return };
        let begin = added.len();
        for triangle in self.left(index) {
            let corners = triangle.map(|i| self.ring[i]);
            added.push(Triangle { corners, slot: self.slot, off: 0.0, lost: NONE });
        }
        for &(lost, place, height) in &self.lost {
            let Some((number, _, _, above)) = self.over(index, place) else { continue };
            let triangle = &mut added[begin + number];
            triangle.off = triangle.off.max((above - height).abs() as f32);
            state.next_lost[lost as usize] = std::mem::replace(&mut triangle.lost, lost);
        }
    }

    fn keeps_what_is_interpolated(&self, mesh: &Mesh, corners: [u32; 3], weights: Vec2) -> bool {
        let [a, b, c] = corners.map(|i| i as usize);
        let corner = self.corner as usize;
        let shares = [1.0 - weights.x - weights.y, weights.x, weights.y];
        let mix = |of: &[Vec3]| of[a] * shares[0] + of[b] * shares[1] + of[c] * shares[2];
        let same_normal = || mix(&mesh.normals).normalize_or_zero().dot(mesh.normals[corner]) >= SAME_NORMAL;
        let same_color = || (mix(&mesh.colors) - mesh.colors[corner]).abs().max_element() <= SAME_COLOR;
        let same_uv = || {
            let uv = &mesh.uvs;
            let mixed = uv[a] * shares[0] + uv[b] * shares[1] + uv[c] * shares[2];
            let extent = (uv[b] - uv[a]).length().max((uv[c] - uv[a]).length());
            (mixed - uv[corner]).length() <= SAME_UV * extent
        };
        (mesh.normals.is_empty() || same_normal())
            && (mesh.colors.is_empty() || same_color())
            && (mesh.uvs.is_empty() || same_uv())
    }

    /// Tells whether no new edge is there already, nor the one triangle that is left: two sheets would grow together.
    fn stays_a_sheet(&self, state: &State<'_>, index: usize) -> bool {
        let to = self.ring[index];
        let beside = [1, self.count - 1].map(|i| self.ring[(index + i) % self.count]);
        state.around(to).iter().all(|&t| {
            let corners = state.triangles[t as usize].corners;
            let is_ring = |c: &u32| *c != to && self.ring[..self.count].contains(c);
            let is_whole = self.count == 3 && corners.iter().filter(|c| is_ring(c)).count() == 2;
            corners.contains(&self.corner)
                || !(is_whole || corners.iter().any(|c| is_ring(c) && !beside.contains(c)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of rings and columns whose last column has the first one's corners.
    fn ball(rings: u32) -> Mesh {
        let columns = 2 * rings;
        let mut mesh = Mesh::default();
        for i in 0..rings * columns {
            let polar = std::f32::consts::PI * (i / columns) as f32 / (rings - 1) as f32;
            let angle = std::f32::consts::TAU * (i % columns) as f32 / columns as f32;
            let out = Vec3::new(polar.sin() * angle.cos(), polar.cos(), polar.sin() * angle.sin());
            mesh.positions.push(out);
            mesh.normals.push(out);
        }
        for ring in 0..rings - 1 {
            for column in 0..columns {
                let [a, b] = [column, (column + 1) % columns].map(|c| ring * columns + c);
                mesh.triangles.extend([[a, b, a + columns], [b, b + columns, a + columns]]);
            }
        }
        mesh
    }

    /// Returns the distance of a point from a triangle.
    fn distance(p: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
        let normal = (b - a).cross(c - a);
        let weight = |from: DVec3, to: DVec3| normal.dot((to - from).cross(p - from)) >= 0.0;
        if normal.length() > 0.0 && weight(a, b) && weight(b, c) && weight(c, a) {
            return (normal.dot(p - a) / normal.length()).abs();
        }
        let to_edge = |from: DVec3, to: DVec3| {
            let t = ((p - from).dot(to - from) / (to - from).length_squared().max(1e-300)).clamp(0.0, 1.0);
            (from + (to - from) * t - p).length()
        };
        to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
    }

    /// Returns how far places of a mesh, four on each triangle, are from another mesh, at most.
    fn farthest(of: &Mesh, from: &Mesh) -> f64 {
        let corners = |mesh: &Mesh, t: usize| mesh.corners(t).map(Vec3::as_dvec3);
        let mut most = 0.0f64;
        for t in (0..of.triangles.len()).step_by(of.triangles.len() / 150 + 1) {
            let [a, b, c] = corners(of, t);
            for p in [a, b, c, (a + b + c) / 3.0] {
                let near = (0..from.triangles.len()).map(|other| distance(p, corners(from, other)));
                most = most.max(near.fold(f64::INFINITY, f64::min));
            }
        }
        most
    }

    #[test]
    fn fewer_triangles_stay_within_what_is_told() {
        let mesh = ball(60);
        for (tolerance, most) in [(0.002, 9500), (0.004, 3500), (0.02, 1500)] {
            let (fewer, bound) = simplified(&mesh, tolerance, &Control::simple()).unwrap();
            fewer.check().unwrap();
            assert!(bound <= tolerance && bound > 0.0, "{bound}");
            // Slivers at the poles stay.
            assert!(fewer.triangles.len() < most, "{} at {tolerance}", fewer.triangles.len());
            let off = farthest(&fewer, &mesh).max(farthest(&mesh, &fewer));
            // Between the given corners it may be a little more.
            assert!(off <= bound * 1.3 && off > bound * 0.5, "{off} for {bound}");
            // The ball is still closed and not turned over.
            assert!((fewer.volume() - mesh.volume()).abs() < 12.6 * bound, "{}", fewer.volume());
            assert!((0..fewer.triangles.len()).all(|t| {
                let [a, b, c] = fewer.corners(t);
                (b - a).cross(c - a).dot(a + b + c) * (mesh.volume() as f32).signum() >= -1e-6
            }));
        }
    }

    #[test]
    fn flat_sheets_keep_their_borders_and_lose_their_insides() {
        let mut mesh = Mesh::default();
        for i in 0..21 * 21 {
            mesh.positions.push(Vec3::new((i % 21) as f32, (i / 21) as f32, 0.0));
            mesh.uvs.push(Vec2::new((i % 21) as f32 * 0.1, (i / 21) as f32 * 0.1));
        }
        for i in (0..20 * 21).filter(|i| i % 21 < 20) {
            mesh.triangles.extend([[i, i + 1, i + 21], [i + 1, i + 22, i + 21]]);
        }
        let (fewer, bound) = simplified(&mesh, 1e-6, &Control::simple()).unwrap();
        assert!(bound < 1e-12 && fewer.triangles.len() < 200, "{bound} {}", fewer.triangles.len());
        assert!((fewer.area() - 400.0).abs() < 1e-9 && fewer.uvs.len() == fewer.positions.len());
        // Where two materials meet, all corners stay.
        mesh.slots = (0..mesh.triangles.len()).map(|t| u16::from(t >= mesh.triangles.len() / 2)).collect();
        let (two, _) = simplified(&mesh, 1e-6, &Control::simple()).unwrap();
        let area = |slot: u16| {
            let own = (0..two.triangles.len()).filter(|&t| two.slots[t] == slot);
            Mesh { triangles: own.map(|t| two.triangles[t]).collect(), slots: vec![], ..two.clone() }.area()
        };
        assert!((area(0) - 200.0).abs() < 1e-9 && (area(1) - 200.0).abs() < 1e-9, "{} {}", area(0), area(1));
    }

    #[test]
    fn strange_meshes_are_left_as_they_are() {
        let tetrahedron = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            ..Mesh::default()
        };
        let (same, bound) = simplified(&tetrahedron, 10.0, &Control::simple()).unwrap();
        assert_eq!((same.triangles.len(), bound), (4, 0.0));
        let broken = Mesh {
            positions: vec![Vec3::NAN, Vec3::X, Vec3::Y, Vec3::splat(f32::INFINITY), Vec3::Z],
            triangles: vec![[0, 1, 2], [1, 1, 1], [1, 2, 3], [4, 1, 2], [4, 2, 1], [4, 1, 2]],
            segments: vec![[1, 4]],
            ..Mesh::default()
        };
        for tolerance in [0.0, 1.0, f64::INFINITY, f64::NAN] {
            assert_eq!(
                simplified(&broken, tolerance, &Control::simple()).unwrap().0.triangles.len(),
                6,
                "{tolerance}"
            );
        }
        assert_eq!(simplified(&Mesh::default(), 1.0, &Control::simple()).unwrap().0.triangles.len(), 0);
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let (mesh, pool) = (ball(40), crate::parallel::Pool::new(3).unwrap());
        let [one, three] = [Control::simple(), Control::new(&pool)]
            .map(|control| simplified(&mesh, 0.01, &control).unwrap().0);
        assert!(one.positions == three.positions && one.triangles == three.triangles);
    }
}
