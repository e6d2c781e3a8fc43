//! Which things can be added to a scene?

use super::{Chosen, Edit};
use eframe::egui;
use glam::{DAffine3, DVec2, DVec3, Vec3};
use polyptych::scene::{
    Form, FreeForm, HeightField, Light, LightKind, Material, Object, Perturbation, Power, Primitive, Quadric,
    Scene, Shape, Voxels,
};

/// Bodies with the names of their kinds.
const BODIES: [(&str, Primitive); 9] = [
    ("box", Primitive::Box { size: DVec3::ONE }),
    ("ball", Primitive::Sphere { radius: 0.5 }),
    ("cylinder", Primitive::Cylinder { radius: 0.5, height: 1.0 }),
    ("cone", Primitive::Cone { radius: 0.5, height: 1.0 }),
    ("ring", Primitive::Torus { major: 0.5, minor: 0.15 }),
    ("plane", Primitive::Plane { width: 2.0, depth: 2.0 }),
    ("prism", Primitive::Frustum { sides: 6, lower_radius: 0.5, upper_radius: 0.5, height: 1.0 }),
    ("pyramid", Primitive::Frustum { sides: 4, lower_radius: 0.7, upper_radius: 0.0, height: 1.0 }),
    ("frustum", Primitive::Frustum { sides: 6, lower_radius: 0.5, upper_radius: 0.3, height: 1.0 }),
];

/// Shows the things to choose from. Returns the scene with the one that was chosen.
pub(super) fn show(
    ui: &mut egui::Ui,
    scene: &Scene,
    chosen: &mut Option<Chosen>,
    center: DVec3,
) -> Option<Edit> {
    let bodies = BODIES.map(|(name, body)| (name, Shape::Primitive(body), DAffine3::IDENTITY));
    for (name, shape, place) in bodies.into_iter().chain(others()) {
        if ui.button(name).clicked() {
            ui.close();
            *chosen = Some(Chosen::Object(scene.objects.len()));
            return Some(Edit::new(scene, format!("add {}", scene.objects.len()), |scene| {
                let gray = scene.add_material(Material::new(Vec3::splat(0.6)));
                let place = DAffine3::from_translation(center) * place;
                scene.objects.push(Object::new(name, shape, gray).placed(place));
            }));
        }
    }
    ui.separator();
    let above = center + DVec3::Y;
    let spot = LightKind::Spot { position: above, direction: DVec3::NEG_Y, inner: 0.3, outer: 0.5 };
    let lights = [
        ("directional light", Light::directional(DVec3::new(-0.4, -1.0, -0.3))),
        ("point light", Light::point(above, 1.0)),
        ("spot light", Light { kind: spot, ..Light::point(above, 2.0) }),
    ];
    for (name, light) in lights {
        if ui.button(name).clicked() {
            ui.close();
            *chosen = Some(Chosen::Light(scene.lights.len()));
            let what = format!("add light {}", scene.lights.len());
            return Some(Edit::new(scene, what, |scene| scene.lights.push(light)));
        }
    }
    None
}

/// Lists free forms, a grid and a terrain to begin with.
fn others() -> Vec<(&'static str, Shape, DAffine3)> {
    let ball = |center: DVec3, radius: f64| Form::Ellipsoid { center, radii: DVec3::splat(radius) };
    let bump =
        Perturbation { weight: 0.8, power: Power::Square, function: ball(DVec3::new(0.4, 0.2, 0.0), 0.35) };
    let quadric = Form::Quadric(Quadric([-4.0, -4.0, -4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    let blend = Form::SmoothUnion {
        a: Box::new(ball(DVec3::ZERO, 0.4)),
        b: Box::new(ball(DVec3::X * 0.5, 0.3)),
        k: 0.3,
    };
    let forms = [
        ("quadric", quadric),
        ("ball with a bump", Form::Perturbed { base: Box::new(ball(DVec3::ZERO, 0.5)), terms: vec![bump] }),
        ("two balls, blended", blend),
    ];
    let forms = forms.into_iter().filter_map(|(name, form)| {
        Some((name, Shape::FreeForm(FreeForm::new(form).ok()?), DAffine3::IDENTITY))
    });
    let cells = Voxels::from_fn([32, 32, 32], |_, y, _| u8::from(y < 4));
    let small =
        DAffine3::from_scale(DVec3::splat(1.0 / 16.0)) * DAffine3::from_translation(DVec3::splat(-16.0));
    let flat = HeightField::new(65, 65, DVec2::splat(2.0), vec![0.0; 65 * 65]).map(Shape::HeightField);
    let terrain = flat.into_iter().map(|field| ("terrain", field, DAffine3::IDENTITY));
    forms.chain([("voxels", Shape::Voxels(cells), small)]).chain(terrain).collect()
}
