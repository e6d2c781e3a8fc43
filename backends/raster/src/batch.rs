//! How are visible pixels resolved? Eight at once: where their rays meet the triangles seen, and what is there.
//!
//! Eight pixels in a row that show one triangle, as most do where triangles are large, meet a [`Face`] that was set up
//! for all of them. Others meet a triangle each.

use crate::color::{ChangesAll, Spots};
use crate::face::Face;
use crate::info::Shading;
use crate::lens::Lens;
use crate::model::Model;
use crate::octet::{Names, Octet};
use glam::{DVec3, Vec3};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, I32x8, LANES, Vec3x8};
use polyptych_core::scene::{Material, Scene};

/// Places of the picture with the triangle seen there, and what resolving and lighting found out.
pub(crate) struct Batch<'a> {
    pub(crate) count: usize,
    /// Whether all places are filled and show one triangle, which has a face.
    is_one: bool,
    /// Whether all that are filled have the first one's material.
    pub(crate) has_one_material: bool,
    /// Place in the picture.
    x: F64x8,
    y: F64x8,
    pub(crate) names: Names,
    /// Index of the triangle in the tile's table, or [`NO_FACE`].
    pub(crate) face: [u16; LANES],
    /// What the painter needs to know to put the sample where it belongs.
    pub(crate) tag: [u32; LANES],
    /// Along the ray, in lengths of its direction.
    t: F64x8,
    /// Of the triangle's second and third corner.
    pub(crate) weights: [F32x8; 2],
    /// Along the ray, meters.
    pub(crate) distance: F64x8,
    /// Relative to the lens's origin, never outside of the triangle.
    pub(crate) place: DVec3x8,
    /// Unit true normal on the viewer's side.
    pub(crate) true_normal: DVec3x8,
    /// Unit shading normal, turned along with the true one.
    pub(crate) normal: Vec3x8,
    /// Unit vector to the eye.
    pub(crate) to_eye: Vec3x8,
    pub(crate) color: Vec3x8,
    pub(crate) opacity: [f32; LANES],
    pub(crate) material: [Option<&'a Material>; LANES],
    /// Light that leaves towards the eye.
    pub(crate) lit: Vec3x8,
    /// Share of the shadow-casting lights that arrive.
    pub(crate) shadow: F32x8,
}

/// The index of triangles that need no face.
pub(crate) const NO_FACE: u16 = u16::MAX;

/// How the points of a batch are to be found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Manner {
    pub(crate) ask: Ask,
    pub(crate) shading: Shading,
    /// Whether normal maps turn normals.
    pub(crate) turns: bool,
}

/// What is asked of a point beyond its place and normals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ask {
    /// Nothing: color is black, opacity 1.
    Geometry,
    /// Color and opacity.
    Color,
}

impl Batch<'_> {
    pub(crate) fn new() -> Self {
        let (one, black) = (F64x8::splat(1.0), Vec3x8::splat(Vec3::ZERO));
        Self {
            count: 0,
            is_one: false,
            has_one_material: false,
            x: F64x8::splat(0.0),
            y: F64x8::splat(0.0),
            names: Names { id: [0; LANES], part: [0; LANES], triangle: [0; LANES] },
            face: [NO_FACE; LANES],
            tag: [0; LANES],
            t: one,
            weights: [F32x8::ZERO; 2],
            distance: one,
            place: DVec3x8::splat(DVec3::ZERO),
            true_normal: DVec3x8::splat(DVec3::ZERO),
            normal: black,
            to_eye: black,
            color: black,
            opacity: [1.0; LANES],
            material: [None; LANES],
            lit: black,
            shadow: F32x8::splat(1.0),
        }
    }

    /// Adds a place; the name is id, part and triangle.
    #[inline(always)]
    pub(crate) fn push(&mut self, (x, y): (f64, f64), [id, part, triangle]: [u32; 3], face: u16, tag: u32) {
        let (i, names) = (self.count, &mut self.names);
        (self.x.0[i], self.y.0[i], self.face[i], self.tag[i]) = (x, y, face, tag);
        (names.id[i], names.part[i], names.triangle[i]) = (id, part, triangle);
        self.count += 1;
    }

    /// Fills an empty batch with pixels of a row that show one triangle; `x` and `y` are the first one's center.
    #[inline(always)]
    pub(crate) fn fill(&mut self, (x, y): (f64, f64), [id, part, triangle]: [u32; 3], face: u16, tag: u32) {
        (self.count, self.is_one) = (LANES, true);
        self.x = F64x8::splat(x) + I32x8::count_from(0).to_f64();
        self.y = F64x8::splat(y);
        self.face = [face; LANES];
        self.names = Names { id: [id; LANES], part: [part; LANES], triangle: [triangle; LANES] };
        self.tag = std::array::from_fn(|lane| tag + lane as u32);
    }

    /// Returns the part that the last place showed: the next one likely shows it, too.
    #[inline(always)]
    pub(crate) fn last_part(&self) -> usize {
        self.names.part[self.count.saturating_sub(1)] as usize
    }

    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        (self.count, self.is_one) = (0, false);
    }

    pub(crate) fn is_full(&self) -> bool {
        self.count == LANES
    }
}

impl<'a> Batch<'a> {
    /// Finds the surface points of all samples.
    #[inline(always)]
    pub(crate) fn resolve(
        &mut self,
        scene: &'a Scene,
        model: &Model,
        lens: &Lens,
        faces: &[Face],
        manner: Manner,
    ) {
        if !(self.is_one && self.resolve_one(scene, model, lens, faces, manner)) {
            self.resolve_each(scene, model, lens, manner);
        }
        self.straighten();
    }

    /// Finds the points of pixels that show one triangle; false if a ray passes beside it.
    #[inline(always)]
    fn resolve_one(
        &mut self,
        scene: &'a Scene,
        model: &Model,
        lens: &Lens,
        faces: &[Face],
        manner: Manner,
    ) -> bool {
        let Manner { ask, shading, turns } = manner;
        let face = &faces[usize::from(self.face[0])];
        let Some(met) = face.meet_all(lens, self.x, self.y) else { return false };
        self.t = met.t;
        self.weights = [met.weights[0].round(), met.weights[1].round()];
        let side = if met.from_within { -1.0 } else { 1.0 };
        let outward = face.outward * side;
        self.true_normal = DVec3x8::splat(outward);
        self.normal = if shading == Shading::Flat {
            Vec3x8::splat(outward.as_vec3())
        } else {
            face.normals_of(&met).scaled(F32x8::splat(side as f32))
        };
        let material = face.material(scene, model);
        self.material = [Some(material); LANES];
        self.has_one_material = true;
        let has_one_color = model.parts[face.part as usize].has_one_color(material);
        let turns = turns && material.normal_map.is_some();
        let paints = ask == Ask::Color && !has_one_color;
        if ask == Ask::Color && !paints {
            self.fill_color(material);
        }
        if turns || paints {
            let changes = face.changes(lens, self.x, self.y, &met);
            self.paint_and_turn((scene, model), &met.weights, &changes, [paints, turns]);
        }
        self.reach(lens);
        true
    }

    /// Finds the points of pixels that show a triangle each.
    #[inline(always)]
    fn resolve_each(&mut self, scene: &'a Scene, model: &Model, lens: &Lens, manner: Manner) {
        let Manner { ask, shading, turns } = manner;
        let octet = Octet::of(model, lens.origin, &self.names, self.count, shading != Shading::Flat);
        self.find_materials(scene, model);
        let materials = || self.material[..self.count].iter().flatten();
        let has_textures = ask == Ask::Color && materials().any(|material| material.texture.is_some());
        let turns = turns && materials().any(|material| material.normal_map.is_some());
        let met = octet.meet(lens, self.x, self.y, has_textures || turns);
        self.t = met.t;
        self.weights = [met.weights[0].round(), met.weights[1].round()];
        (self.true_normal, self.normal) = (met.true_normal, met.normal);
        let (mut weights, mut changes) = (met.weights, met.changes);
        let (mut held, mut any_held) = ([DVec3::NAN; LANES], false);
        for i in (0..self.count).filter(|&i| !met.inside.has(i)) {
            // The ray passes beside its triangle: rare, and held to it one by one.
            let face = Face::new(model, lens, self.names.id[i]);
            let met = face.meet(lens, self.x.0[i], self.y.0[i]);
            if let Some(changes) = &mut changes {
                changes.set(i, face.changes_at(lens, self.x.0[i], self.y.0[i], met.t));
            }
            self.t.0[i] = met.t;
            let [_, v, w] = met.weights;
            (weights[0].0[i], weights[1].0[i]) = (v, w);
            (self.weights[0].0[i], self.weights[1].0[i]) = (v as f32, w as f32);
            if let Some(place) = met.held {
                (held[i], any_held) = (place, true);
            }
            let outward = face.outward;
            let normal = if shading == Shading::Flat { outward.as_vec3() } else { face.normal(&met) };
            let (normal, outward) = if met.from_within { (-normal, -outward) } else { (normal, outward) };
            self.normal.set(i, normal);
            self.true_normal.set(i, outward);
        }
        let one_color = self.material[0].filter(|material| self.is_of_one_color(model, material));
        if let (Ask::Color, Some(material)) = (ask, one_color) {
            self.fill_color(material);
        }
        let paints = ask == Ask::Color && one_color.is_none();
        if paints || turns {
            let changes = changes.unwrap_or(ChangesAll::NONE);
            self.paint_and_turn((scene, model), &weights, &changes, [paints, turns]);
        }
        self.reach(lens);
        for i in (0..self.count).filter(|_| any_held) {
            if held[i].is_finite() {
                self.place.set(i, held[i]);
            }
        }
    }

    /// Tells whether all places have one color, that of a material.
    #[inline(always)]
    fn is_of_one_color(&self, model: &Model, material: &Material) -> bool {
        let parts = &self.names.part[..self.count];
        self.has_one_material && parts.iter().all(|&part| model.parts[part as usize].has_one_color(material))
    }

    /// Gives all places the color of a material.
    #[inline(always)]
    fn fill_color(&mut self, material: &Material) {
        self.opacity = [material.effective_opacity(material.opacity).min(1.0); LANES];
        self.color = Vec3x8::splat(material.base_color);
    }

    /// Finds the color of each place, and turns the normal of each that has a normal map, if so asked.
    #[inline(always)]
    fn paint_and_turn(
        &mut self,
        (scene, model): (&Scene, &Model),
        weights: &[F64x8; 2],
        changes: &ChangesAll,
        [paints, turns]: [bool; 2],
    ) {
        let Self { count, names, material: materials, .. } = &*self;
        let (count, names, materials, is_one) = (*count, *names, *materials, self.is_one);
        let (names, materials) = (&names, &materials);
        let spots = Spots { scene, model, count, is_one, names, materials, weights, changes };
        if paints {
            (self.color, self.opacity) = spots.color();
        }
        if turns {
            self.straighten();
            spots.turn(&mut self.normal, &self.true_normal);
        }
    }

    /// Finds the material of each place.
    #[inline(always)]
    fn find_materials(&mut self, scene: &'a Scene, model: &Model) {
        self.has_one_material = true;
        for i in 0..self.count {
            let part = &model.parts[self.names.part[i] as usize];
            let same = i > 0 && self.names.part[i] == self.names.part[i - 1] && part.has_one_slot();
            self.material[i] = if same {
                self.material[i - 1]
            } else {
                let slot = part.mesh().slot(self.names.triangle[i] as usize);
                Some(scene.material(&scene.objects[part.object], slot))
            };
            let (first, this) = (self.material[0], self.material[i]);
            self.has_one_material &= first.zip(this).is_some_and(|(a, b)| std::ptr::eq(a, b));
        }
    }

    /// Goes along all rays: places, distances, directions to the eye.
    #[inline(always)]
    fn reach(&mut self, lens: &Lens) {
        let (start, direction) = lens.lines(self.x, self.y);
        let length = direction.length();
        self.distance = self.t * length;
        self.to_eye = direction.scaled(F64x8::splat(-1.0) / length).round();
        self.place = start + direction.scaled(self.t);
    }

    /// Gives shading normals unit length; the true normal where there is none.
    #[inline(always)]
    fn straighten(&mut self) {
        let (zero, infinity) = (F32x8::splat(0.0), F32x8::splat(f32::INFINITY));
        let share = F32x8::splat(1.0) / self.normal.length();
        let good = share.above(zero) & infinity.above(share);
        self.normal = Vec3x8::pick(good, self.normal.scaled(share), self.true_normal.round());
    }
}
