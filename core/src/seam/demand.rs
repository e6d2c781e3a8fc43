//! What does a picture take: which objects, which attributes, which shadows? Read from scene and need before anything is
//! built, and alike for all back ends.
//!
//! What it says holds for every camera: a frame may be drawn from elsewhere than was needed.

use super::need::Need;
use super::plan::PassPlan;
use crate::convert::Detail;
use crate::framebuffer::Channel;
use crate::math::Aabb;
use crate::scene::{AlphaMode, Light, LightKind, Object, Primitive, Scene, Shape};
use glam::DVec3;

/// What a picture of a scene takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Demand {
    /// Whether light is reckoned: color is asked for.
    pub shading: bool,
    /// Whether normals are needed: to shade, or for themselves.
    pub normals: bool,
    /// Whether textures are read, and what they hold in bytes.
    pub textures: Option<u64>,
    /// Whether anything lets light through, so that more than the nearest surface counts.
    pub layers: bool,
    /// For each light whether anything can stand between it and a surface, or why its shadows need not be found.
    pub shadows: Vec<Result<(), &'static str>>,
}

/// Whether a body can throw a shadow on itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surfaces {
    /// As it is, or so near that a convex one stays convex: it cannot.
    Smooth,
    /// In steps, each of which shades the next.
    Stepped,
}

/// Says why an object is not drawn, if that is so.
#[must_use]
pub fn why_not_drawn(object: &Object) -> Option<&'static str> {
    if !object.visible {
        return Some("it is invisible");
    }
    match &*object.shape {
        Shape::Mesh(mesh) if mesh.triangles.is_empty() && !mesh.segments.is_empty() => {
            Some("line segments have no area")
        }
        _ => object.why_undrawable(),
    }
}

/// Lists what of a mesh cannot be drawn: segments, and triangles with corners that are nowhere.
#[must_use]
pub fn left_out(shape: &Shape) -> Vec<String> {
    let Shape::Mesh(mesh) = shape else { return Vec::new() };
    let mut left_out = Vec::new();
    if !mesh.segments.is_empty() {
        left_out.push(format!("{} line segments are left out: they have no area", mesh.segments.len()));
    }
    left_out.extend(broken_triangles(shape));
    left_out
}

/// Says how many triangles have corners that are nowhere, if any have.
#[must_use]
pub fn broken_triangles(shape: &Shape) -> Option<String> {
    let Shape::Mesh(mesh) = shape else { return None };
    let is_broken = |t: &usize| !mesh.corners(*t).iter().all(|c| c.is_finite());
    let broken = (0..mesh.triangles.len()).filter(is_broken).count();
    (broken > 0).then(|| format!("{broken} triangles with corners that are not finite are left out"))
}

/// Tells how fine an object is to be converted: no finer than shows.
#[must_use]
pub fn detail(object: &Object, need: &Need, max_resolution: u32) -> Detail {
    Detail { tolerance: need.world_tolerance(&object.bounds()), max_resolution }
}

impl Demand {
    /// Reads what a picture takes. `lights` are those that the back end reckons with, in its order; `shadow_switch` is
    /// its own parameter.
    #[must_use]
    pub fn of(scene: &Scene, need: &Need, lights: &[Light], shadow_switch: bool, surfaces: Surfaces) -> Self {
        let shading = need.channels.has(Channel::Color);
        let drawn = || scene.objects.iter().filter(|o| why_not_drawn(o).is_none());
        let materials = || drawn().flat_map(|o| (0..slots(o)).map(|slot| scene.material(o, slot)));
        let normals = shading || need.channels.has(Channel::Normal);
        let reads_color = shading || need.channels.has(Channel::Albedo);
        let colors = materials().filter_map(|m| m.texture.filter(|_| reads_color));
        let of_normals = materials().filter_map(|m| m.normal_map.filter(|_| normals).map(|map| map.texture));
        let mut used: Vec<usize> = colors.chain(of_normals).collect();
        used.sort_unstable();
        used.dedup();
        let bytes = used.iter().filter_map(|&t| scene.textures.get(t)).map(|t| t.bytes()).sum();
        let general = match (shading || need.channels.has(Channel::Shadow), shadow_switch) {
            (false, _) => Err("neither color nor shadow is asked for"),
            (_, false) => Err("shadows are switched off"),
            (true, true) => Ok(()),
        };
        let casters = general.is_ok().then(|| Casters::of(scene, surfaces));
        let shadow_of = |light: &Light| {
            general?;
            if !light.casts_shadow {
                return Err("the light casts no shadow");
            }
            if (light.color * light.intensity).max_element() <= 0.0 {
                return Err("the light is dark");
            }
            casters.as_ref().map_or(Ok(()), |casters| casters.between(&light.kind))
        };
        Self {
            shading,
            normals,
            textures: (!used.is_empty()).then_some(bytes),
            layers: materials().any(crate::scene::Material::is_see_through),
            shadows: lights.iter().map(shadow_of).collect(),
        }
    }

    /// Tells whether the shadows of any light must be found.
    #[must_use]
    pub fn any_shadow(&self) -> bool {
        self.shadows.iter().any(Result::is_ok)
    }

    /// Returns how many lights' shadows must be found.
    #[must_use]
    pub fn shadow_count(&self) -> usize {
        self.shadows.iter().filter(|s| s.is_ok()).count()
    }

    /// Lists the passes that do not depend on the method: normals, textures, layers.
    #[must_use]
    pub fn passes(&self) -> Vec<PassPlan> {
        let pass = |name: &str, needed: bool, why: String| PassPlan { name: name.to_owned(), needed, why };
        let (textures, why) = match self.textures {
            Some(bytes) => (true, format!("{bytes} bytes are at hand, read where they are seen")),
            None => (false, "nothing that is asked for has one".to_owned()),
        };
        let asked = |is: bool, yes: &str, no: &str| if is { yes.to_owned() } else { no.to_owned() };
        vec![
            pass(
                "normals",
                self.normals,
                asked(
                    self.normals,
                    "light or normals are asked for",
                    "neither light nor normals are asked for",
                ),
            ),
            pass("textures", textures, why),
            pass(
                "see-through layers",
                self.layers,
                asked(self.layers, "a material lets light through", "everything is opaque"),
            ),
        ]
    }

    /// Says why shadow rays are cast or not.
    #[must_use]
    pub fn shadow_rays(&self) -> PassPlan {
        let count = self.shadow_count();
        let why = match (count, self.shadows.first()) {
            (0, None) => "there is no light".to_owned(),
            (0, Some(first)) => first.err().unwrap_or_default().to_owned(),
            (n, _) if n < self.shadows.len() => {
                format!("to {n} of {} lights: nothing blocks the others", self.shadows.len())
            }
            (n, _) => format!("to {n} light{}", if n == 1 { "" } else { "s" }),
        };
        PassPlan { name: "shadow rays".to_owned(), needed: count > 0, why }
    }
}

fn slots(object: &Object) -> usize {
    object.materials.len().max(1)
}

/// Tells whether light cannot pass through some of an object.
#[must_use]
pub fn blocks_light(scene: &Scene, object: &Object) -> bool {
    why_not_drawn(object).is_none()
        && !matches!(&*object.shape, Shape::Volume(_))
        && (0..slots(object)).any(|slot| {
            let material = scene.material(object, slot);
            material.opacity >= 1.0 && material.alpha != AlphaMode::Blend
        })
}

/// Most pairs of objects that are looked at to show that a light blocks nothing: beyond, shadows are taken for needed.
const MOST_PAIRS: usize = 1 << 14;

/// What can block light, and what light can be kept from.
struct Casters {
    casters: Vec<Body>,
    takers: Vec<Body>,
}

/// A ball around an object.
struct Body {
    object: usize,
    center: DVec3,
    radius: f64,
    /// Whether no part of it can shade another.
    is_convex: bool,
}

impl Casters {
    fn of(scene: &Scene, surfaces: Surfaces) -> Self {
        let (mut casters, mut takers) = (Vec::new(), Vec::new());
        for (object, thing) in scene.objects.iter().enumerate() {
            if why_not_drawn(thing).is_some() || matches!(&*thing.shape, Shape::Volume(_)) {
                continue;
            }
            let bounds = thing.bounds();
            // What is converted may stand out a little.
            let (center, radius) = (bounds.center(), bounds.radius() * 1.02);
            let is_convex = surfaces == Surfaces::Smooth && is_convex(&thing.shape, &bounds);
            if blocks_light(scene, thing) {
                casters.push(Body { object, center, radius, is_convex });
            }
            takers.push(Body { object, center, radius, is_convex });
        }
        Self { casters, takers }
    }

    /// Tells whether any body can stand between a light and a surface.
    fn between(&self, light: &LightKind) -> Result<(), &'static str> {
        if self.casters.is_empty() {
            return Err("nothing blocks light");
        }
        if self.casters.len() * self.takers.len() > MOST_PAIRS {
            return Ok(());
        }
        let blocked = self.casters.iter().any(|caster| {
            self.takers.iter().any(|taker| {
                let is_itself = caster.object == taker.object;
                if is_itself { !caster.is_convex } else { caster.can_shade(taker, light) }
            })
        });
        if blocked { Ok(()) } else { Err("no body stands between the light and another") }
    }
}

impl Body {
    /// Tells whether the balls leave room for a ray of the light through this and then the other.
    fn can_shade(&self, other: &Self, light: &LightKind) -> bool {
        let apart = other.center - self.center;
        let reach = self.radius + other.radius;
        match *light {
            LightKind::Directional { direction } => {
                let along = direction.normalize_or_zero();
                // Bodies without bounds are everywhere; a light without direction gives none.
                let aside = (apart - along * apart.dot(along)).length();
                !(apart.dot(along) < -reach || aside > reach)
            }
            LightKind::Point { position } | LightKind::Spot { position, .. } => {
                let (to_self, to_other) = (self.center - position, other.center - position);
                let (near, far) = (to_self.length(), to_other.length());
                if near <= self.radius || far <= other.radius {
                    return true;
                }
                let angle = to_self.angle_between(to_other);
                let wide = (self.radius / near).asin() + (other.radius / far).asin();
                !(near - self.radius > far + other.radius || angle > wide)
            }
        }
    }
}

/// Tells whether a body cannot shade itself.
fn is_convex(shape: &Shape, bounds: &Aabb) -> bool {
    let is_flat = bounds.size().min_element() <= 0.0;
    match shape {
        Shape::Primitive(body) => !matches!(body, Primitive::Torus { .. }),
        // A sheet along two axes.
        Shape::Mesh(_) => is_flat && bounds.size().is_finite(),
        Shape::Voxels(_) | Shape::FreeForm(_) | Shape::HeightField(_) | Shape::Volume(_) => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use crate::framebuffer::Channels;
    use crate::scene::{Material, Texture};
    use glam::Vec3;

    fn scene(things: &[(Primitive, DVec3)]) -> Scene {
        let mut scene = Scene::default();
        scene.add_material(Material::new(Vec3::ONE));
        for &(body, place) in things {
            scene.objects.push(Object::new("thing", Shape::Primitive(body), 0).at(place));
        }
        scene
    }

    fn need() -> Need {
        let view = Projection::Perspective { fov_y: 0.8 };
        Need::new(Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, view), 64, 48)
    }

    fn shadow(scene: &Scene, light: &Light, surfaces: Surfaces) -> Result<(), &'static str> {
        Demand::of(scene, &need(), std::slice::from_ref(light), true, surfaces).shadows[0]
    }

    const BALL: Primitive = Primitive::Sphere { radius: 1.0 };

    #[test]
    fn a_convex_body_alone_needs_no_shadow_and_two_in_a_row_do() {
        let sun = Light::directional(DVec3::NEG_Y);
        let alone = Err("no body stands between the light and another");
        assert_eq!(shadow(&scene(&[(BALL, DVec3::ZERO)]), &sun, Surfaces::Smooth), alone);
        assert_eq!(shadow(&scene(&[(BALL, DVec3::ZERO)]), &sun, Surfaces::Stepped), Ok(()));
        let ring = Primitive::Torus { major: 1.0, minor: 0.3 };
        assert_eq!(shadow(&scene(&[(ring, DVec3::ZERO)]), &sun, Surfaces::Smooth), Ok(()));
        let pair = |offset: DVec3| scene(&[(BALL, DVec3::ZERO), (BALL, offset)]);
        assert_eq!(shadow(&pair(DVec3::Y * 3.0), &sun, Surfaces::Smooth), Ok(()));
        assert_eq!(shadow(&pair(DVec3::X * 9.0), &sun, Surfaces::Smooth), alone);
        let lamp = |at: DVec3| Light::point(at, 1.0);
        assert_eq!(shadow(&pair(DVec3::X * 9.0), &lamp(DVec3::X * 20.0), Surfaces::Smooth), Ok(()));
        assert_eq!(shadow(&pair(DVec3::X * 9.0), &lamp(DVec3::X * 4.5), Surfaces::Smooth), alone);
        assert_eq!(
            shadow(&pair(DVec3::X * 9.0), &lamp(DVec3::ZERO), Surfaces::Smooth),
            Ok(()),
            "from within"
        );
    }

    #[test]
    fn what_is_not_asked_for_is_not_needed() {
        let mut scene = scene(&[(BALL, DVec3::ZERO), (BALL, DVec3::Y * 3.0)]);
        let texture = scene.add_texture(Texture::from_srgb8("dot", 1, 1, &[255; 4]));
        let of = |scene: &Scene, channels: Channels, switch: bool, light: &Light| {
            let need = Need { channels, ..need() };
            Demand::of(scene, &need, std::slice::from_ref(light), switch, Surfaces::Smooth)
        };
        let sun = Light::directional(DVec3::NEG_Y);
        let plain = of(&scene, Channels::COLOR, true, &sun);
        assert!(plain.shading && plain.normals && plain.any_shadow() && !plain.layers);
        assert_eq!(plain.textures, None);
        scene.materials[0].texture = Some(texture);
        assert_eq!(of(&scene, Channels::COLOR, true, &sun).textures, Some(8));
        let depth = of(&scene, Channels::of(&[Channel::Distance, Channel::Id]), true, &sun);
        assert_eq!((depth.shading, depth.normals, depth.textures), (false, false, None));
        assert_eq!(depth.shadows, [Err("neither color nor shadow is asked for")]);
        assert_eq!(of(&scene, Channels::COLOR, false, &sun).shadows, [Err("shadows are switched off")]);
        let dark = Light { intensity: 0.0, ..sun.clone() };
        assert_eq!(of(&scene, Channels::COLOR, true, &dark).shadows, [Err("the light is dark")]);
        scene.materials[0].opacity = 0.5;
        let clear = of(&scene, Channels::COLOR, true, &sun);
        assert_eq!((clear.layers, clear.shadows), (true, vec![Err("nothing blocks light")]));
    }
}
