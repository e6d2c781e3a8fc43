//! How is each object drawn, and what is lost?

use crate::info::{Mode, Options, Shading, Tier};
use crate::light::Lamp;
use crate::shadow::MapSizes;
use polyptych_core::camera::Projection;
use polyptych_core::convert::Detail;
use polyptych_core::scene::{LightKind, Material, Object, Scene, Shape};
use polyptych_core::seam::{self, Decision, Demand, Need, Surfaces};

/// Most cells along an edge that a free form is converted on.
const FINEST: u32 = 256;

/// What every object loses by the way the picture is drawn.
pub(crate) const RESAMPLED: &str = "resampled from perspective faces";

/// How fine an object is to be converted.
pub(crate) fn detail(object: &Object, need: &Need) -> Detail {
    seam::detail(object, need, FINEST)
}

/// What a picture takes.
pub(crate) fn demand(scene: &Scene, need: &Need, lamps: &[Lamp], options: Options) -> Demand {
    let shows_shadows = options.mode == Mode::Shadowed;
    Demand::of(scene, need, &Lamp::lights(lamps), shows_shadows, Surfaces::Smooth)
}

/// Says why an object is not drawn, if that is so.
pub(crate) fn why_skipped(object: &Object, draws_lines: bool) -> Option<String> {
    let has_lines =
        matches!(&*object.shape, Shape::Mesh(m) if m.triangles.is_empty() && !m.segments.is_empty());
    match seam::why_not_drawn(object) {
        Some(_) if has_lines && draws_lines && object.visible => object.why_undrawable().map(str::to_owned),
        Some(why) if has_lines && object.visible => {
            Some(format!("{why}: they are drawn in modes hidden-line and wireframe"))
        }
        why => why.map(str::to_owned),
    }
}

/// Says what is lost of an object itself.
pub(crate) fn losses(scene: &Scene, object: &Object, draws_lines: bool) -> Vec<String> {
    let mut losses = if draws_lines {
        seam::broken_triangles(&object.shape).into_iter().collect()
    } else {
        seam::left_out(&object.shape)
    };
    let materials = || (0..object.materials.len().max(1)).map(|slot| scene.material(object, slot));
    if matches!(*object.shape, Shape::Voxels(_)) && materials().any(Material::is_see_through) {
        losses.push("see-through voxels are drawn as their outer faces".to_owned());
    }
    if materials().any(|m| m.reflectivity > 0.0) {
        losses.push("reflections are not drawn".to_owned());
    }
    losses
}

/// Says what every object loses by the way it is drawn.
pub(crate) fn losses_of_all(
    scene: &Scene,
    lamps: &[Lamp],
    options: Options,
    sizes: MapSizes,
) -> Vec<&'static str> {
    if options.mode.draws_lines() {
        return vec!["drawn as lines"];
    }
    let shading = match options.shading {
        Shading::Phong => None,
        Shading::Gouraud => Some("light is interpolated between corners"),
        Shading::Flat => Some("every triangle has one normal"),
    };
    let other = options.lighting.is_some_and(|model| model != scene.environment.lighting);
    let lighting = other.then_some("highlights are not reckoned as the scene says");
    light_losses(lamps, options, sizes).into_iter().chain(shading).chain(lighting).collect()
}

fn light_losses(lamps: &[Lamp], options: Options, sizes: MapSizes) -> Option<&'static str> {
    let casting = |lamp: &&Lamp| lamp.light.casts_shadow;
    if options.mode != Mode::Shadowed {
        return lamps.iter().find(casting).map(|_| "shadows are switched off");
    }
    if lamps.iter().filter(casting).any(|lamp| lamp.tier == Tier::Plain) {
        return Some("shadows begin a texel late and have soft edges of a texel's width");
    }
    let local = lamps.iter().filter(casting).any(|l| !matches!(l.light.kind, LightKind::Directional { .. }));
    (local && sizes.local.is_none())
        .then_some("shadows of point and spot lights are not drawn: too many lights")
}

/// Decides about an object that is drawn; `converted` are bound and description of its triangles.
pub(crate) fn decision(
    object: &Object,
    converted: Option<(f64, String)>,
    mut losses: Vec<String>,
) -> Decision {
    let exact_faces = matches!(*object.shape, Shape::Primitive(_) | Shape::Voxels(_) | Shape::Mesh(_));
    let converted = match (converted, &*object.shape) {
        (Some((_, why)), Shape::Volume(_)) => {
            losses.insert(0, why);
            None
        }
        (Some((bound, _)), _) if exact_faces && bound <= 0.0 => None,
        (converted, _) => converted,
    };
    match (losses.is_empty(), converted) {
        (true, None) => Decision::Exact,
        (true, Some((bound, why))) => Decision::Converted { bound, why },
        (false, None) => Decision::Approximated { why: losses.join("; ") },
        (false, Some((bound, why))) => {
            losses.push(format!("{why}, at most {bound:.2e} m off"));
            Decision::Approximated { why: losses.join("; ") }
        }
    }
}

/// Tells whether a camera's picture is put together from faces.
pub(crate) fn is_resampled(projection: &Projection) -> bool {
    !matches!(projection, Projection::Perspective { .. } | Projection::Orthographic { .. })
}
