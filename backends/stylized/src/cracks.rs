//! Where are lines between pixels, for bodies that have no edges of their own?
//!
//! A crack runs between two neighboring pixels that show different objects, between which the distance jumps away
//! from the plane through each of them (so that grazing planes have no false lines), or whose normals enclose more
//! than the crease angle. Where on the way from one center to the other it lies follows from what both show: two
//! planes cross at a place, and the square of the cosine to the eye falls evenly to zero where a round body ends.
//! Cracks around a corner of pixels are joined.

use crate::eight::difference;
use crate::spans::{SPAN, Spans, Stretch};
use crate::stroke::{Kind, Stroke};
use crate::style::{Style, Styles};
use glam::{DVec3, Vec3};
use polyptych_core::camera::View;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::lanes::LANES;
use polyptych_core::math::Ray;

/// A jump in distance smaller than this share of it is no silhouette: it would show on any rounded edge.
const JUMP: f32 = 0.01;
/// Colors of one body that differ by less are of one material.
const OTHER_COLOR: f32 = 0.02;

/// What is looked at.
pub(crate) struct Surfaces<'a> {
    pub(crate) visible: &'a Framebuffer,
    pub(crate) spans: &'a Spans,
    pub(crate) view: View<'a>,
    pub(crate) styles: &'a Styles,
    /// How large a pixel is at distance 1, or for parallel rays at any.
    pub(crate) pixel: f64,
    pub(crate) is_parallel: bool,
    /// Which objects have their lines from their edges.
    pub(crate) outlined: &'a [bool],
    /// Which objects are of several plain materials.
    pub(crate) colorful: &'a [bool],
}

/// A crack between two pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Crack {
    kind: Kind,
    style: u8,
    object: u32,
    /// On the way from the first pixel to the second.
    part: f32,
}

/// Buffers of a band that live from frame to frame.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Cracks to the right of pixels, in the row above and the one below.
    right: [Vec<Option<Crack>>; 2],
    /// Below pixels.
    down: Vec<Option<Crack>>,
    touched: Vec<u32>,
    /// Columns whose cracks to the right are set, above and below.
    set: [Vec<u32>; 2],
    pub(crate) strokes: Vec<Stroke>,
}

impl Scratch {
    /// Forgets what it holds; it has room for so many columns then.
    pub(crate) fn reserve(&mut self, width: usize) {
        // What is set is known: most columns are as they should be.
        for (set, right) in self.set.iter_mut().zip(&mut self.right) {
            set.drain(..).for_each(|x| right[x as usize] = None);
            right.resize(width + 1, None);
            // Which of the two is above changes from row to row, so neither may be too small for any.
            set.reserve(width);
        }
        for x in self.touched.drain(..) {
            self.down[x as usize] = None;
            self.down[x as usize + 1] = None;
        }
        self.down.resize(width + 1, None);
        self.strokes.clear();
    }

    pub(crate) fn bytes(&self) -> usize {
        self.down.capacity() * (3 * size_of::<Option<Crack>>() + 8)
            + self.strokes.capacity() * size_of::<Stroke>()
    }
}

impl Surfaces<'_> {
    polyptych_core::for_registers! {
        /// Finds the lines of some rows: those that pass between them and the next.
        pub(crate) fn find(&self, rows: std::ops::Range<u32>, scratch: &mut Scratch) = find_512, find_256, find_here;
    }

    #[inline(always)]
    fn find_here(&self, rows: std::ops::Range<u32>, scratch: &mut Scratch) {
        let (width, height) = (self.visible.width(), self.visible.height());
        scratch.reserve(width as usize);
        let last = rows.end.min(height.saturating_sub(1));
        if rows.start >= last || width < 2 {
            return;
        }
        self.mark_right(rows.start, scratch, 0);
        for y in rows.start..last {
            self.mark_right(y + 1, scratch, 1);
            self.mark_down(y, scratch);
            self.join(y, scratch);
            // The row below is the one above of the next.
            let Scratch { right, set, touched, down, .. } = scratch;
            set[0].drain(..).for_each(|x| right[0][x as usize] = None);
            right.swap(0, 1);
            set.swap(0, 1);
            for x in touched.drain(..) {
                down[x as usize] = None;
                down[x as usize + 1] = None;
            }
        }
    }

    #[inline(always)]
    fn mark_right(&self, y: u32, scratch: &mut Scratch, row: usize) {
        let width = self.visible.width();
        let (right, set) = (&mut scratch.right[row], &mut scratch.set[row]);
        self.each_unlike([y, y], width - 1, 1, |x| {
            let crack = self.crack((x, y), (x + 1, y));
            if crack.is_some() {
                right[x as usize] = crack;
                set.push(x);
            }
        });
    }

    #[inline(always)]
    fn mark_down(&self, y: u32, scratch: &mut Scratch) {
        let width = self.visible.width();
        let Scratch { down, touched, set, .. } = scratch;
        self.each_unlike([y, y + 1], width, width, |x| {
            let crack = self.crack((x, y), (x, y + 1));
            if crack.is_some() {
                down[x as usize] = crack;
                touched.push(x);
                touched.extend(x.checked_sub(1));
            }
        });
        touched.extend(set.iter().flatten());
        touched.sort_unstable();
        touched.dedup();
    }

    /// Visits the pixels of a row that differ from those `step` further on, which are in the other row. Most do not,
    /// which is quickly seen.
    #[inline(always)]
    fn each_unlike(&self, rows: [u32; 2], count: u32, step: u32, mut visit: impl FnMut(u32)) {
        let first = (rows[0] * self.visible.width()) as usize;
        let (count, step, [here, there]) = (count as usize, step as usize, rows.map(|y| self.spans.row(y)));
        let plane = self.visible;
        let ids = &plane.id()[first..first + count];
        let next_ids = &plane.id()[first + step..first + step + count];
        let distances = &plane.distance()[first..first + count];
        let next_distances = &plane.distance()[first + step..first + step + count];
        let normals = &plane.normal()[first..first + count];
        let next_normals = &plane.normal()[first + step..first + step + count];
        let is_plain = |id: u32| id == 0 || self.is_outlined(id);
        let mut begin = 0;
        while begin < count {
            // Much that is one body is passed at once.
            let (end, span) = (count.min(begin + SPAN), begin / SPAN);
            let is_empty = (here[span] == Stretch::Empty) & (there[span] == Stretch::Empty);
            if is_empty && next_ids[end - 1] == 0 {
                begin = end;
                continue;
            }
            let id = ids[begin];
            let differ =
                difference::<SPAN>(&ids[begin..end], id) | difference::<SPAN>(&next_ids[begin..end], id);
            if differ == 0 && is_plain(id) {
                begin = end;
                continue;
            }
            while begin < end {
                let all = begin..(begin + LANES).min(count);
                begin += LANES;
                let id = ids[all.start];
                let (here, next) = (&ids[all.clone()], &next_ids[all.clone()]);
                let is_one = difference::<LANES>(here, id) | difference::<LANES>(next, id) == 0;
                if is_one && is_plain(id) {
                    continue;
                }
                let cosine = self.styles.all[usize::from(self.styles.index(id))].crease_cosine;
                let colors = if is_one { self.has_colors(id) } else { !self.colorful.is_empty() };
                let mut unlike = [false; LANES];
                for (i, unlike) in all.clone().zip(&mut unlike) {
                    let (near, far) = (distances[i], next_distances[i]);
                    // What is no number differs, too.
                    let alike = (near - far).abs() <= JUMP * near.min(far);
                    let turned = normals[i].dot(next_normals[i]) < cosine;
                    *unlike = (ids[i] != next_ids[i]) | ((ids[i] != 0) & (!alike | turned | colors));
                }
                for (i, _) in all.zip(unlike).filter(|(_, unlike)| *unlike) {
                    visit(i as u32);
                }
            }
        }
    }

    #[inline(always)]
    fn is_outlined(&self, id: u32) -> bool {
        self.outlined.get(id.wrapping_sub(1) as usize).copied().unwrap_or(false)
    }

    /// Tells whether a body may have lines between its colors.
    fn has_colors(&self, id: u32) -> bool {
        self.colorful.get(id.wrapping_sub(1) as usize).copied().unwrap_or(false)
            && self.style(id).pen(Kind::Material).is_drawn
    }

    fn style(&self, id: u32) -> &Style {
        &self.styles.all[usize::from(self.styles.index(id))]
    }

    /// Joins the cracks around the corners below a row.
    #[inline(always)]
    fn join(&self, y: u32, scratch: &mut Scratch) {
        let Scratch { right, down, touched, strokes, .. } = scratch;
        for &x in &*touched {
            let (column, left, top) = (x as usize, x as f32 + 0.5, y as f32 + 0.5);
            let sides = [right[0][column], right[1][column], down[column], down[column + 1]];
            let place = |side: usize, part: f32| match side {
                0 => [left + part, top],
                1 => [left + part, top + 1.0],
                2 => [left, top + part],
                _ => [left + 1.0, top + part],
            };
            let mut found = [([0.0f32; 2], None); 4];
            let mut count = 0;
            for (side, crack) in sides.into_iter().enumerate() {
                if let Some(crack) = crack {
                    found[count] = (place(side, crack.part), Some(crack));
                    count += 1;
                }
            }
            let found = &found[..count];
            let mut stroke = |from: [f32; 2], to: [f32; 2], crack: Crack| {
                let Crack { kind, style, object, .. } = crack;
                strokes.push(Stroke { from, to, kind, style, is_hidden: false, object });
            };
            match found {
                [] => {}
                [(a, Some(first)), (b, Some(second))] => {
                    stroke(*a, *b, if first.kind >= second.kind { *first } else { *second });
                }
                _ => {
                    let middle = if count == 1 {
                        [left + 0.5, top + 0.5]
                    } else {
                        [0, 1].map(|axis| found.iter().map(|(p, _)| p[axis]).sum::<f32>() / count as f32)
                    };
                    for (place, crack) in found {
                        if let Some(crack) = crack {
                            stroke(*place, middle, *crack);
                        }
                    }
                }
            }
        }
    }

    /// Finds the crack between two neighbors, if there is one.
    fn crack(&self, a: (u32, u32), b: (u32, u32)) -> Option<Crack> {
        let plane = self.visible;
        let index = |p: (u32, u32)| (p.1 * plane.width() + p.0) as usize;
        let (i, j) = (index(a), index(b));
        let (near_i, near_j) = (plane.distance()[i], plane.distance()[j]);
        let ids = [plane.id()[i], plane.id()[j]];
        let i_is_nearer = near_i < near_j || (near_i == near_j && ids[0] < ids[1]) || near_j.is_nan();
        let object = if i_is_nearer { ids[0] } else { ids[1] };
        let found = |kind: Kind, part: f32| {
            let style = self.style(object);
            style.pen(kind).is_drawn.then(|| Crack {
                kind,
                style: self.styles.index(object),
                object: object.wrapping_sub(1),
                part: part.clamp(0.02, 0.98),
            })
        };
        if ids[0] != ids[1] {
            // Bodies that cross are next to each other there; to look closer takes time.
            let (near, far) = (near_i.min(near_j), near_i.max(near_j));
            if f64::from(far - near) < 64.0 * self.pixel_at(near)
                && ids[0] != 0
                && ids[1] != 0
                && self.style(object).pen(Kind::Intersection).is_drawn
                && let Some(part) = self.crossing(a, b)
            {
                return found(Kind::Intersection, part);
            }
            if self.is_outlined(object) {
                return None;
            }
            return found(Kind::Silhouette, self.end(a, b, i_is_nearer));
        }
        if object == 0 || self.is_outlined(object) {
            return None;
        }
        let normals = [plane.normal()[i], plane.normal()[j]];
        let turned = normals[0].dot(normals[1]) < self.style(object).crease_cosine;
        let (near, far) = if i_is_nearer { (near_i, near_j) } else { (near_j, near_i) };
        let jumps = far - near > JUMP * near || (far - near).is_nan();
        if jumps && self.is_apart(a, b) {
            return found(Kind::Silhouette, self.end(a, b, i_is_nearer));
        }
        if turned {
            return found(Kind::Crease, self.crossing(a, b).unwrap_or(0.5));
        }
        let colors = self.has_colors(object)
            && (plane.albedo()[i] - plane.albedo()[j]).abs().max_element() > OTHER_COLOR;
        if colors { found(Kind::Material, 0.5) } else { None }
    }

    /// Returns how large a pixel is at a distance.
    fn pixel_at(&self, distance: f32) -> f64 {
        if self.is_parallel { self.pixel } else { self.pixel * f64::from(distance) }
    }

    fn ray(&self, p: (u32, u32)) -> Option<Ray> {
        self.view.ray(f64::from(p.0) + 0.5, f64::from(p.1) + 0.5)
    }

    /// Returns by how much the plane of the one pixel is farther than what the other shows there: at the second by the
    /// plane of the first, and the other way round.
    fn gaps(&self, a: (u32, u32), b: (u32, u32)) -> Option<[f64; 2]> {
        let plane = self.visible;
        let index = |p: (u32, u32)| (p.1 * plane.width() + p.0) as usize;
        let (i, j) = (index(a), index(b));
        let (ray_a, ray_b) = (self.ray(a)?, self.ray(b)?);
        let along = |n: Vec3, p: DVec3, r: &Ray| {
            let n = n.as_dvec3();
            n.dot(p - r.origin) / n.dot(r.direction)
        };
        let [near, far] = [i, j].map(|i| f64::from(plane.distance()[i]));
        let at_b = along(plane.normal()[i], ray_a.at(near), &ray_b) - far;
        let at_a = along(plane.normal()[j], ray_b.at(far), &ray_a) - near;
        Some([at_a, at_b])
    }

    /// Tells whether neither of two pixels lies on the plane through the other.
    fn is_apart(&self, a: (u32, u32), b: (u32, u32)) -> bool {
        let Some([at_a, at_b]) = self.gaps(a, b) else { return true };
        let index = |p: (u32, u32)| (p.1 * self.visible.width() + p.0) as usize;
        let near = self.visible.distance()[index(a)].min(self.visible.distance()[index(b)]);
        let allowed = f64::from(JUMP * near);
        if at_a.abs() <= allowed || at_b.abs() <= allowed {
            return false;
        }
        // A round body that turns away falls back by more than the one plane says and less than the other, or, where
        // triangles stand for it, by not much more; and it is the farther pixel that sees it under the flatter angle.
        // Where a body ends it is the nearer one.
        let cosine = |p: (u32, u32)| {
            let normal = self.visible.normal()[index(p)].as_dvec3();
            self.ray(p).map_or(0.0, |ray| normal.dot(ray.direction).abs())
        };
        let a_is_nearer = self.visible.distance()[index(a)] < self.visible.distance()[index(b)];
        let (nearer, farther) = if a_is_nearer { (a, b) } else { (b, a) };
        let back = f64::from((self.visible.distance()[index(b)] - self.visible.distance()[index(a)]).abs());
        let is_round = at_a * at_b >= 0.0 || back < 16.0 * self.pixel_at(near);
        !(is_round && cosine(farther) < cosine(nearer))
    }

    /// Returns where between two pixels their planes cross, if they do.
    fn crossing(&self, a: (u32, u32), b: (u32, u32)) -> Option<f32> {
        let [at_a, at_b] = self.gaps(a, b)?;
        let index = (a.1 * self.visible.width() + a.0) as usize;
        let most = 16.0 * self.pixel_at(self.visible.distance()[index]);
        let crosses = at_a * at_b >= 0.0 && at_a.abs() <= most && at_b.abs() <= most;
        let sum = at_a + at_b;
        // In front of both planes is the ridge of two bodies that cross; behind both a fold of one.
        (crosses && sum != 0.0).then(|| (at_a / sum) as f32)
    }

    /// Returns where between two pixels the nearer body ends, as far as its roundness tells.
    fn end(&self, a: (u32, u32), b: (u32, u32), a_is_nearer: bool) -> f32 {
        let (near, far) = if a_is_nearer { (a, b) } else { (b, a) };
        let plane = self.visible;
        let inner = (2 * near.0).checked_sub(far.0).zip((2 * near.1).checked_sub(far.1));
        let Some(inner) = inner.filter(|p| p.0 < plane.width() && p.1 < plane.height()) else { return 0.5 };
        let index = |p: (u32, u32)| (p.1 * plane.width() + p.0) as usize;
        let (i, j) = (index(near), index(inner));
        if plane.id()[i] != plane.id()[j] {
            return 0.5;
        }
        let square = |p: (u32, u32), i: usize| {
            self.ray(p).map_or(0.0, |ray| {
                let cosine = plane.normal()[i].dot(ray.direction.as_vec3());
                cosine * cosine
            })
        };
        let (edge, inside) = (square(near, i), square(inner, j));
        let beyond = edge / (inside - edge);
        let part = if beyond > 0.0 && beyond < 1.0 { beyond } else { 0.5 };
        if a_is_nearer { part } else { 1.0 - part }
    }
}
