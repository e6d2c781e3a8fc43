//! Where on the picture are the lines of a mesh, and which parts of them does nothing hide?
//!
//! An edge is a line for what its two faces are to the eye: one turned to it and one away, both turned but folded, one
//! alone. The line is exact where the edge is, to a fraction of a pixel. What hides it is read from the visible
//! surfaces: a place of an edge is seen when one of the pixels around it shows nothing nearer, by its distance or
//! where its plane runs at that place.
//!
//! Source: P. Bénard, A. Hertzmann, *Line drawings from 3D models: a tutorial*, Foundations and Trends in Computer
//! Graphics and Vision 11, 2019, chapters 3 and 4.

use crate::edges::{Edges, NO_FACE};
use crate::stroke::{Kind, Stroke};
use crate::style::{Style, Styles};
use crate::veil::Veil;
use glam::{DAffine3, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::seam::{Cancelled, Control};
use std::sync::Arc;

/// Edges looked at by one worker at a time: those that are long on the picture take a while.
const PIECE: usize = 512;
/// Faces looked at by one worker at a time.
const FACES: usize = 1 << 14;
/// What is nearer to the eye than this share of the body's distance is cut off.
const NEAR: f64 = 1e-4;

/// A mesh at its place.
pub(crate) struct Body {
    pub(crate) object: u32,
    pub(crate) world_from_object: DAffine3,
    pub(crate) edges: Arc<Edges>,
}

/// Buffers that live from frame to frame.
#[derive(Default)]
pub(crate) struct Scratch {
    /// Which faces are turned to the eye, body by body.
    facing: Vec<bool>,
    pieces: Vec<Piece>,
    veil: Veil,
}

/// Some edges of a body, and their lines.
#[derive(Default)]
struct Piece {
    body: usize,
    first: usize,
    last: usize,
    /// Where the body's faces begin.
    faces: usize,
    strokes: Vec<Stroke>,
}

/// How points of a body get onto the picture.
struct Lens {
    /// Camera space, -z ahead.
    view_from_object: DAffine3,
    /// Half of the picture's width and height on a plane at distance 1, or for parallel rays at any.
    half: [f64; 2],
    size: [f64; 2],
    is_parallel: bool,
}

/// What lines are looked for in.
pub(crate) struct Sight<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) visible: &'a Framebuffer,
    pub(crate) styles: &'a Styles,
    /// How large a pixel is at distance 1, or for parallel rays at any.
    pub(crate) pixel: f64,
}

/// Tells whether a projection keeps straight lines straight, so that edges are drawn by their ends.
pub(crate) fn keeps_lines(projection: &Projection) -> bool {
    matches!(projection, Projection::Perspective { .. } | Projection::Orthographic { .. })
}

impl Scratch {
    /// Finds the lines of all bodies; see [`Scratch::strokes`].
    pub(crate) fn fill(
        &mut self,
        bodies: &[Body],
        sight: &Sight<'_>,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let faces: usize = bodies.iter().map(|b| b.edges.planes.len()).sum();
        self.facing.resize(faces, false);
        let mut rest = &mut self.facing[..];
        let (mut count, mut first_face) = (0, 0);
        for (index, body) in bodies.iter().enumerate() {
            let (own, others) = rest.split_at_mut(body.edges.planes.len());
            rest = others;
            turn(body, sight.camera, own, control)?;
            for first in (0..body.edges.edges.len()).step_by(PIECE) {
                if count == self.pieces.len() {
                    self.pieces.push(Piece::default());
                }
                let piece = &mut self.pieces[count];
                piece.strokes.clear();
                (piece.body, piece.first, piece.faces) = (index, first, first_face);
                piece.last = (first + PIECE).min(body.edges.edges.len());
                count += 1;
            }
            first_face += body.edges.planes.len();
        }
        self.pieces[count..].iter_mut().for_each(|piece| piece.strokes.clear());
        if count > 0 {
            self.veil.fill(sight.visible, control)?;
        }
        let (facing, veil) = (&self.facing[..], &self.veil);
        control.for_each_mut(&mut self.pieces[..count], 1, &|_, piece| {
            piece.find(bodies, facing, sight, veil);
        })
    }

    /// Lists the lines piece by piece, in the order of bodies and edges.
    pub(crate) fn strokes(&self) -> impl Iterator<Item = &[Stroke]> {
        self.pieces.iter().map(|piece| &piece.strokes[..])
    }

    pub(crate) fn clear(&mut self) {
        self.pieces.iter_mut().for_each(|piece| piece.strokes.clear());
    }

    pub(crate) fn bytes(&self) -> u64 {
        let strokes: usize = self.pieces.iter().map(|p| p.strokes.capacity() * size_of::<Stroke>()).sum();
        (self.facing.capacity() + strokes) as u64 + self.veil.bytes()
    }
}

/// Tells which faces of a body are turned to the eye.
fn turn(body: &Body, camera: &Camera, facing: &mut [bool], control: &Control<'_>) -> Result<(), Cancelled> {
    let object_from_world = body.world_from_object.inverse();
    // A homogeneous eye: a place, or for parallel rays a direction.
    let (eye, weight) = match camera.projection {
        Projection::Orthographic { .. } => (object_from_world.transform_vector3(-camera.forward()), 0.0),
        _ => (object_from_world.transform_point3(camera.eye), 1.0),
    };
    let eye = eye.as_vec3();
    let planes = &body.edges.planes;
    control.for_each_mut(facing, FACES, &|i, turned| {
        let [x, y, z, offset] = planes[i];
        *turned = x * eye.x + y * eye.y + z * eye.z > offset * weight;
    })
}

impl Piece {
    polyptych_core::for_registers! {
        /// Finds the lines of a piece.
        fn find(&mut self, bodies: &[Body], facing: &[bool], sight: &Sight<'_>, veil: &Veil)
            = find_512, find_256, find_here;
    }

    #[inline(always)]
    fn find_here(&mut self, bodies: &[Body], facing: &[bool], sight: &Sight<'_>, veil: &Veil) {
        let body = &bodies[self.body];
        let style_index = sight.styles.index(body.object + 1);
        let style = &sight.styles.all[usize::from(style_index)];
        if !style.draws_lines() {
            return;
        }
        let facing = &facing[self.faces..self.faces + body.edges.planes.len()];
        let lens = Lens::of(body, sight);
        let wires = style.pen(Kind::Wire).is_drawn;
        let skips_backs = body.edges.is_closed && !style.dashes_hidden;
        for edge in &body.edges.edges[self.first..self.last] {
            let first = facing[edge.faces[0] as usize];
            let second = if edge.faces[1] == NO_FACE { first } else { facing[edge.faces[1] as usize] };
            if skips_backs && !first && !second {
                continue;
            }
            let turns = edge.faces[1] != NO_FACE && (first == second) == edge.is_turned;
            // Most edges lie within a surface: they are no lines.
            let is_within = edge.faces[1] != NO_FACE && edge.cosine >= style.crease_cosine;
            if is_within && !(turns || edge.is_crowded || edge.parts_materials || wires) {
                continue;
            }
            let Some(kind) = kind_of(edge, turns, style) else { continue };
            let [a, b] = edge.ends;
            let [a, b] = [&body.edges.places[a as usize], &body.edges.places[b as usize]];
            let [a, b] = [lens.ahead(*a), lens.ahead(*b)];
            let line = Line { kind, style: style_index, object: body.object, dashes: style.dashes_hidden };
            trace(&lens, sight, veil, line, [a, b], &mut self.strokes);
        }
    }
}

/// Returns as what an edge is drawn, if it is.
#[inline(always)]
fn kind_of(edge: &crate::edges::Edge, turns: bool, style: &Style) -> Option<Kind> {
    let is_drawn = |kind: Kind| style.pen(kind).is_drawn;
    let is_fold = edge.is_crowded || edge.cosine < style.crease_cosine;
    if edge.crosses {
        return is_drawn(Kind::Intersection).then_some(Kind::Intersection);
    }
    if turns && is_drawn(Kind::Silhouette) {
        Some(Kind::Silhouette)
    } else if edge.faces[1] == NO_FACE && is_drawn(Kind::Border) {
        Some(Kind::Border)
    } else if is_fold && is_drawn(Kind::Crease) {
        Some(Kind::Crease)
    } else if edge.parts_materials && is_drawn(Kind::Material) {
        Some(Kind::Material)
    } else {
        is_drawn(Kind::Wire).then_some(Kind::Wire)
    }
}

/// What is the same along an edge.
#[derive(Clone, Copy)]
struct Line {
    kind: Kind,
    style: u8,
    object: u32,
    dashes: bool,
}

impl Lens {
    fn of(body: &Body, sight: &Sight<'_>) -> Self {
        let camera = sight.camera;
        let camera_from_world = camera.world_from_camera.transpose();
        let [width, height] = [sight.visible.width(), sight.visible.height()].map(f64::from);
        let (half, is_parallel) = match camera.projection {
            Projection::Perspective { fov_y } => ((fov_y * 0.5).tan(), false),
            Projection::Orthographic { height } => (height * 0.5, true),
            _ => (1.0, false),
        };
        let place = &body.world_from_object;
        let view_from_object = DAffine3 {
            matrix3: camera_from_world * place.matrix3,
            translation: camera_from_world * (place.translation - camera.eye),
        };
        Self { view_from_object, half: [half * width / height, half], size: [width, height], is_parallel }
    }

    /// Returns a corner in camera space.
    #[inline(always)]
    fn ahead(&self, corner: Vec3) -> DVec3 {
        self.view_from_object.transform_point3(corner.as_dvec3())
    }

    /// Returns where a place before the eye is on the picture.
    #[inline(always)]
    fn pixel(&self, p: DVec3) -> [f64; 2] {
        let ahead = if self.is_parallel { 1.0 } else { -p.z };
        [
            (p.x / (ahead * self.half[0]) + 1.0) * 0.5 * self.size[0],
            (1.0 - p.y / (ahead * self.half[1])) * 0.5 * self.size[1],
        ]
    }

    /// Cuts off what is behind the eye or outside of the picture, with a margin for wide lines.
    #[inline(always)]
    fn clip(&self, mut a: DVec3, mut b: DVec3) -> Option<[DVec3; 2]> {
        let margin = 1.0 + 32.0 / self.size[1].max(1.0);
        let reach = a.length().max(b.length());
        let planes = [
            (DVec3::NEG_Z, -NEAR * reach),
            (DVec3::X, self.half[0] * margin),
            (DVec3::NEG_X, self.half[0] * margin),
            (DVec3::Y, self.half[1] * margin),
            (DVec3::NEG_Y, self.half[1] * margin),
        ];
        for (i, (normal, limit)) in planes.into_iter().enumerate() {
            let inside = |p: DVec3| match (i, self.is_parallel) {
                (0, true) => 1.0,
                (0, false) => normal.dot(p) + limit,
                (_, true) => limit + normal.dot(p),
                (_, false) => normal.dot(p) - p.z * limit,
            };
            let (at_a, at_b) = (inside(a), inside(b));
            if !(at_a > 0.0 || at_b > 0.0) {
                return None;
            }
            let cross = |from: DVec3, to: DVec3, f: f64, t: f64| from.lerp(to, f / (f - t));
            if at_a <= 0.0 {
                a = cross(b, a, at_b, at_a);
            } else if at_b <= 0.0 {
                b = cross(a, b, at_a, at_b);
            }
        }
        (a.is_finite() && b.is_finite()).then_some([a, b])
    }
}

/// Puts the seen parts of an edge, and the hidden ones where they are dashed, into a list.
#[inline(always)]
fn trace(
    lens: &Lens,
    sight: &Sight<'_>,
    veil: &Veil,
    line: Line,
    [a, b]: [DVec3; 2],
    strokes: &mut Vec<Stroke>,
) {
    let Some([a, b]) = lens.clip(a, b) else { return };
    let [from, to] = [lens.pixel(a), lens.pixel(b)];
    let (across, down) = (to[0] - from[0], to[1] - from[1]);
    let length = (across * across + down * down).sqrt();
    if !length.is_finite() || length > 1e5 {
        return;
    }
    let count = length.ceil().max(1.0) as usize;
    let at = |part: f64| [from[0] + (to[0] - from[0]) * part, from[1] + (to[1] - from[1]) * part];
    let end = |i: usize| {
        let [x, y] = at(i as f64 / count as f64);
        [x as f32, y as f32]
    };
    let mut put = |first: usize, last: usize, is_seen: bool| {
        if is_seen || line.dashes {
            let Line { kind, style, object, .. } = line;
            strokes.push(Stroke {
                from: end(first),
                to: end(last),
                kind,
                style,
                is_hidden: !is_seen,
                object,
            });
        }
    };
    let nearest = (-a.z).min(-b.z);
    if veil.hides(from, to, sight.behind(nearest, lens.is_parallel)) {
        return put(0, count, false);
    }
    // Equal steps on the picture are equal steps on a plane before the eye, and of one over the depth.
    let flat = |p: DVec3| if lens.is_parallel { p } else { DVec3::new(p.x, p.y, 1.0) / -p.z };
    let (flat_a, flat_b) = (flat(a), flat(b));
    let ends = line.kind == Kind::Silhouette;
    let (mut begin, mut state, mut i) = (0, None, 0);
    while i < count {
        let part = (i as f64 + 0.5) / count as f64;
        let p = flat_a + (flat_b - flat_a) * part;
        let place = if lens.is_parallel { p } else { DVec3::new(p.x, p.y, -1.0) * (1.0 / p.z) };
        let seen = sight.sees(at(part), place, lens, ends);
        let is_seen = seen == Seen::Yes;
        if state != Some(is_seen) {
            if let Some(was) = state {
                put(begin, i, was);
            }
            (begin, state) = (i, Some(is_seen));
        }
        // Behind a wall, the next place is, too.
        i += if seen == Seen::FarBehind { 2 } else { 1 };
    }
    if let Some(was) = state {
        put(begin, count, was);
    }
}

/// Whether a place of an edge is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Seen {
    Yes,
    No,
    /// Far behind everything around it.
    FarBehind,
}

impl Sight<'_> {
    /// Returns how far away a surface must be, so that it does not hide for sure what is at a distance: what
    /// [`Sight::sees`] allows anywhere, and as far as a plane may tell.
    fn behind(&self, distance: f64, is_parallel: bool) -> f64 {
        let size = if is_parallel { self.pixel } else { self.pixel * distance };
        distance - (24.0 + 24.0) * size - 1e-5 * distance
    }

    /// Tells whether nothing hides a place of an edge: `pixel` is where it is on the picture, `place` where in camera
    /// space; `ends` for one at which the body ends.
    #[inline(always)]
    fn sees(&self, pixel: [f64; 2], place: DVec3, lens: &Lens, ends: bool) -> Seen {
        let (width, height) = (self.visible.width() as i32, self.visible.height() as i32);
        let distance = if lens.is_parallel { -place.z } else { place.length() };
        let size = if lens.is_parallel { self.pixel } else { self.pixel * distance };
        // Beyond the picture's edge nothing is known: what is there is judged by the nearest pixels, and generously.
        let is_outside = pixel[0] < 0.5
            || pixel[1] < 0.5
            || pixel[0] > f64::from(width) - 0.5
            || pixel[1] > f64::from(height) - 0.5;
        let allowed = if is_outside { 24.0 } else { 1.5 } * size + 1e-5 * distance;
        let (x, y) = ((pixel[0] - 0.5).floor() as i32, (pixel[1] - 0.5).floor() as i32);
        let column = |x: i32| x.clamp(0, width - 1) as usize;
        let row = |y: i32| y.clamp(0, height - 1) as usize * width as usize;
        let (left, right, top, bottom) =
            (column(x), column(x.saturating_add(1)), row(y), row(y.saturating_add(1)));
        let around = [top + left, top + right, bottom + left, bottom + right];
        let seen = self.visible.distance();
        let most = seen[around[0]].max(seen[around[1]]).max(seen[around[2]].max(seen[around[3]]));
        let nearest_allowed = (distance - allowed) as f32;
        if most >= nearest_allowed {
            return Seen::Yes;
        }
        // A line at which a body ends may lie a little within its outline on the picture, as faces are flat: it is seen
        // where a pixel next to those shows what is behind.
        if ends {
            let (x, y) = (pixel[0].floor() as i32, pixel[1].floor() as i32);
            let (left, middle, right) = (column(x.saturating_sub(1)), column(x), column(x.saturating_add(1)));
            let mut most = 0.0f32;
            for y in y.saturating_sub(1)..=y.saturating_add(1) {
                let row = row(y);
                most = most.max(seen[row + left].max(seen[row + middle]).max(seen[row + right]));
            }
            if most >= nearest_allowed {
                return Seen::Yes;
            }
        }
        // The surface of a pixel may run away from the eye. A plane says little far from its pixel, though.
        let far = (distance - allowed - 24.0 * size) as f32;
        if most < far {
            return Seen::FarBehind;
        }
        let limits = (distance, size, distance - allowed);
        let (x, y) = (x.clamp(-1, width), y.clamp(-1, height));
        let is_on_plane = self.predicts((x, y), place, limits, lens)
            || self.predicts((x + 1, y), place, limits, lens)
            || self.predicts((x, y + 1), place, limits, lens)
            || self.predicts((x + 1, y + 1), place, limits, lens);
        if is_on_plane { Seen::Yes } else { Seen::No }
    }

    /// Tells whether the plane of what a pixel shows does not hide a place.
    #[inline(always)]
    fn predicts(
        &self,
        (x, y): (i32, i32),
        place: DVec3,
        (distance, size, limit): (f64, f64, f64),
        lens: &Lens,
    ) -> bool {
        let [x, y] =
            [x.clamp(0, self.visible.width() as i32 - 1), y.clamp(0, self.visible.height() as i32 - 1)];
        let i = y as usize * self.visible.width() as usize + x as usize;
        let found = f64::from(self.visible.distance()[i]);
        if found + 24.0 * size < limit {
            return false;
        }
        // All in camera space.
        let (normal, axes) = (self.visible.normal()[i].as_dvec3(), &self.camera.world_from_camera);
        let normal = DVec3::new(axes.x_axis.dot(normal), axes.y_axis.dot(normal), axes.z_axis.dot(normal));
        let slope = if lens.is_parallel { -normal.z } else { normal.dot(place) / distance };
        if slope > -1e-3 {
            return false;
        }
        let middle = DVec3::new(
            ((f64::from(x) + 0.5) * 2.0 / lens.size[0] - 1.0) * lens.half[0],
            (1.0 - (f64::from(y) + 0.5) * 2.0 / lens.size[1]) * lens.half[1],
            -1.0,
        );
        let predicted = if lens.is_parallel {
            normal.dot(DVec3::new(middle.x - place.x, middle.y - place.y, -found)) / slope
        } else {
            normal.dot(middle) * found / (middle.length() * slope)
        };
        predicted.min(found + 24.0 * size) >= limit
    }
}
