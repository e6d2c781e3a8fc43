//! What color has a surface where a pixel shows it, and how much light does it let through?
//!
//! Texture coordinates are weighted by corner in double precision. What a pixel covers of a texture comes from the exact
//! change of the weights over one pixel to the right and one down.

use crate::affine::OnRays;
use crate::lens::{Lens, Rays};
use crate::model::{Model, Part};
use crate::octet::Names;
use glam::{DVec3, Vec2, Vec3, Vec4};
use polyptych_core::lanes::{DVec3x8, F32x8, F64x8, LANES, Mask8, Vec3x8};
use polyptych_core::scene::{AlphaMode, Mapping, Material, NormalMap, Scene, Texture};

/// How the weights of the second and third corner change over one pixel to the right, and over one down.
#[derive(Clone, Copy)]
pub(crate) struct Changes {
    pub(crate) right: [f32; 2],
    pub(crate) down: [f32; 2],
}

/// The same for eight pixels.
#[derive(Clone, Copy)]
pub(crate) struct ChangesAll {
    pub(crate) right: [F32x8; 2],
    pub(crate) down: [F32x8; 2],
}

impl ChangesAll {
    /// Where nothing asks for them.
    pub(crate) const NONE: Self = Self { right: [F32x8::ZERO; 2], down: [F32x8::ZERO; 2] };

    pub(crate) fn splat(changes: Changes) -> Self {
        Self { right: changes.right.map(F32x8::splat), down: changes.down.map(F32x8::splat) }
    }

    #[inline(always)]
    fn of(&self, lane: usize) -> Changes {
        let of = |all: &[F32x8; 2]| [all[0].0[lane], all[1].0[lane]];
        Changes { right: of(&self.right), down: of(&self.down) }
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, lane: usize, changes: Changes) {
        for k in 0..2 {
            (self.right[k].0[lane], self.down[k].0[lane]) = (changes.right[k], changes.down[k]);
        }
    }
}

/// Places on eight triangles, those that there are first.
#[derive(Clone, Copy)]
pub(crate) struct Spots<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) model: &'a Model,
    pub(crate) count: usize,
    /// Whether there are eight, all on one triangle.
    pub(crate) is_one: bool,
    pub(crate) names: &'a Names,
    pub(crate) materials: &'a [Option<&'a Material>; LANES],
    /// Of the second and third corner.
    pub(crate) weights: &'a [F64x8; 2],
    pub(crate) changes: &'a ChangesAll,
}

/// Places of one part that have one material.
struct Alike<'a> {
    part: &'a Part,
    material: &'a Material,
    lanes: Mask8,
}

impl<'a> Spots<'a> {
    /// Returns base colors and effective opacities.
    #[inline(always)]
    pub(crate) fn color(&self) -> (Vec3x8, [f32; LANES]) {
        let (mut color, mut opacity) = (Vec3x8::splat(Vec3::ZERO), F32x8::splat(1.0));
        let mut waits = Mask8::first(self.count);
        while let Some(alike) = self.next(&mut waits) {
            let (of_all, opacities) = self.color_of(&alike);
            color = Vec3x8::pick(alike.lanes, of_all, color);
            opacity = alike.lanes.pick(opacities.min(F32x8::splat(1.0)), opacity);
            if !alike.part.mesh().colors.is_empty() {
                self.tint(&alike, &mut color);
            }
        }
        (color, opacity.0.values())
    }

    /// Turns unit shading normals as normal maps say. Both normals are on the viewer's side.
    #[inline(always)]
    pub(crate) fn turn(&self, normals: &mut Vec3x8, true_normals: &DVec3x8) {
        let mut waits = Mask8::first(self.count);
        while let Some(alike) = self.next(&mut waits) {
            let Some(map) = &alike.material.normal_map else { continue };
            let Some(texture) = self.scene.textures.get(map.texture) else { continue };
            let texels = self.texels(alike.part.mesh(), texture, alike.lanes);
            for lane in 0..LANES {
                if alike.lanes.has(lane) {
                    let texel = Vec3::new(texels[0].0[lane], texels[1].0[lane], texels[2].0[lane]);
                    let of = (normals.get(lane), true_normals.get(lane).as_vec3());
                    normals.set(lane, self.turned(&alike, map, lane, texel, of));
                }
            }
        }
    }

    /// Takes the first of those that wait, and all like it.
    #[inline(always)]
    fn next(&self, waits: &mut Mask8) -> Option<Alike<'a>> {
        if let (true, Some(material)) = (self.is_one & waits.any(), self.materials[0]) {
            *waits = Mask8::NONE;
            let part = &self.model.parts[self.names.part[0] as usize];
            return Some(Alike { part, material, lanes: Mask8::ALL });
        }
        let mut lead = 0;
        while lead < self.count {
            if let Some(material) = self.materials[lead].filter(|_| waits.has(lead)) {
                let mut lanes = Mask8::NONE;
                for lane in lead..self.count {
                    let same = self.materials[lane].is_some_and(|other| std::ptr::eq(other, material));
                    if same & (self.names.part[lane] == self.names.part[lead]) {
                        lanes.0[lane] = u32::MAX;
                    }
                }
                *waits = *waits & !lanes;
                let part = &self.model.parts[self.names.part[lead] as usize];
                return Some(Alike { part, material, lanes });
            }
            lead += 1;
        }
        None
    }

    /// Returns colors and effective opacities as material and texture give them.
    #[inline(always)]
    fn color_of(&self, alike: &Alike<'_>) -> (Vec3x8, F32x8) {
        let Alike { part, material, lanes } = alike;
        let base = Vec3x8::splat(material.base_color);
        let Some(texture) = material.texture.and_then(|t| self.scene.textures.get(t)) else {
            return (base, F32x8::splat(material.effective_opacity(material.opacity)));
        };
        let mesh = part.mesh();
        let [r, g, b, a] = match material.mapping {
            Mapping::Uv if !mesh.uvs.is_empty() => self.texels(mesh, texture, *lanes),
            Mapping::Uv => self.triplanar(part, texture, 1.0, *lanes),
            Mapping::Triplanar { scale } => self.triplanar(part, texture, scale, *lanes),
        };
        let mut opacity = F32x8::splat(material.opacity);
        if material.alpha != AlphaMode::Opaque {
            for (lane, opacity) in opacity.0.iter_mut().enumerate() {
                *opacity = material.effective_opacity(*opacity * a.0[lane]);
            }
        }
        (base * Vec3x8 { x: r, y: g, z: b }, opacity)
    }

    /// Multiplies by the colors of corners.
    #[inline(never)]
    fn tint(&self, alike: &Alike<'_>, color: &mut Vec3x8) {
        for lane in (0..LANES).filter(|&lane| alike.lanes.has(lane)) {
            let weights = [self.weights[0].0[lane] as f32, self.weights[1].0[lane] as f32];
            let triangle = self.names.triangle[lane] as usize;
            color.set(lane, alike.part.tinted(color.get(lane), triangle, weights));
        }
    }

    #[inline(always)]
    fn turned(
        &self,
        alike: &Alike<'_>,
        map: &NormalMap,
        lane: usize,
        texel: Vec3,
        (normal, true_normal): (Vec3, Vec3),
    ) -> Vec3 {
        let (part, mesh, triangle) = (alike.part, alike.part.mesh(), self.names.triangle[lane] as usize);
        let Some(along) = mesh.along_uv(triangle) else { return normal };
        let along = along.map(|v| (part.world_from_object.matrix3 * v.as_dvec3()).as_vec3());
        let [a, b, c] = mesh.corners(triangle);
        let outside = part.world_from_normal * (b - a).cross(c - a);
        let side = if outside.dot(true_normal) < 0.0 { -1.0 } else { 1.0 };
        map.turned(normal * side, along, texel) * side
    }

    #[inline(never)]
    fn triplanar(&self, part: &Part, texture: &Texture, scale: f32, lanes: Mask8) -> [F32x8; 4] {
        let mut texels = [Vec4::ZERO; LANES];
        for lane in (0..LANES).filter(|&lane| lanes.has(lane)) {
            let mesh = part.mesh();
            let corners = mesh.triangles[self.names.triangle[lane] as usize];
            let [a, b, c]: [DVec3; 3] = corners.map(|i| mesh.positions[i as usize].as_dvec3());
            let [v, w] = [self.weights[0].0[lane], self.weights[1].0[lane]];
            let position = (a * (1.0 - v - w) + b * v + c * w).as_vec3() * scale;
            let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
            let (ab, ac) = ((b - a).as_vec3() * scale, (c - a).as_vec3() * scale);
            let moved = |[v, w]: [f32; 2]| Vec2::new((ab * v + ac * w).length(), 0.0);
            let changes = self.changes.of(lane);
            let lod = texture.lod(moved(changes.right), moved(changes.down));
            texels[lane] = texture.triplanar(position, normal, lod);
        }
        by_channel(&texels)
    }
}

/// Turns eight texels into their channels.
#[inline(always)]
pub(crate) fn by_channel(texels: &[Vec4; LANES]) -> [F32x8; 4] {
    let mut channels = [F32x8::ZERO; 4];
    for (lane, texel) in texels.iter().enumerate() {
        let [r, g, b, a] = texel.to_array();
        (channels[0].0[lane], channels[1].0[lane]) = (r, g);
        (channels[2].0[lane], channels[3].0[lane]) = (b, a);
    }
    channels
}

polyptych_core::for_registers! {
    /// Returns base color and effective opacity of the first of spots.
    pub(crate) fn color_of_first(spots: &Spots<'_>) -> (Vec3, f32)
        = color_of_first_512, color_of_first_256, color_of_first_here;
}

#[inline(always)]
fn color_of_first_here(spots: &Spots<'_>) -> (Vec3, f32) {
    let (color, opacity) = spots.color();
    (color.get(0), opacity[0])
}

/// Finds how weights change whose functions along the rays are given, as is the plane's and how far along the rays it
/// is met.
///
/// On central rays `w = s t - o` with `t = h / n`, so `w' = t (s' - s n' / n)`; on parallel ones `w' = s' - s n' / n`.
#[inline(always)]
pub(crate) fn changes(
    lens: &Lens,
    across: &OnRays,
    weights: &[OnRays; 2],
    (x, y): (f64, f64),
    t: f64,
) -> Changes {
    let share = 1.0 / across.at(lens.rays, x, y).1;
    let (right, down) = (across.by_column * share, across.by_row * share);
    let factor = match lens.rays {
        Rays::Central => t,
        Rays::Parallel => 1.0,
    };
    let slopes = weights.map(|w| w.at(lens.rays, x, y).1);
    let of = |own: [f64; 2], of_plane: f64| {
        [0, 1].map(|i: usize| ((own[i] - slopes[i] * of_plane) * factor) as f32)
    };
    Changes { right: of(weights.map(|w| w.by_column), right), down: of(weights.map(|w| w.by_row), down) }
}

/// The same for eight pixels: `plane` and `slopes` are what the plane's function and the weights' change by along the
/// rays, `steps` by how much those differ over one pixel to the right and one down.
#[inline(always)]
pub(crate) fn changes_all(
    lens: &Lens,
    t: F64x8,
    (plane, slopes): (F64x8, [F64x8; 2]),
    (plane_steps, slope_steps): ([F64x8; 2], [[F64x8; 2]; 2]),
) -> ChangesAll {
    let share = F64x8::splat(1.0) / plane;
    let (right, down) = (plane_steps[0] * share, plane_steps[1] * share);
    let factor = match lens.rays {
        Rays::Central => t,
        Rays::Parallel => F64x8::splat(1.0),
    };
    let [v, w] = slopes;
    let [v_steps, w_steps] = slope_steps;
    ChangesAll {
        right: [((v_steps[0] - v * right) * factor).round(), ((w_steps[0] - w * right) * factor).round()],
        down: [((v_steps[1] - v * down) * factor).round(), ((w_steps[1] - w * down) * factor).round()],
    }
}
