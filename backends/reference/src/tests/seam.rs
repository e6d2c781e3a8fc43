//! Does the back end keep its promises to the host?

use super::*;

/// A bit of everything.
pub(super) fn everything() -> Scene {
    let mut scene = Scene::default();
    let plain = scene.add_material(Material::default());
    let glass = scene.add_material(Material { opacity: 0.4, reflectivity: 0.3, ..Material::new(Vec3::Y) });
    let body = |p: Primitive| Shape::Primitive(p);
    let mut add = |name: &str, shape: Shape, material: usize, x: f64, z: f64| {
        scene.objects.push(Object::new(name, shape, material).at(DVec3::new(x, 0.5, z)));
    };
    add("floor", body(Primitive::Plane { width: 9.0, depth: 9.0 }), plain, 0.0, 0.0);
    add("ball", body(Primitive::Sphere { radius: 0.6 }), glass, -1.0, 0.5);
    add("ring", body(Primitive::Torus { major: 0.6, minor: 0.2 }), plain, 1.0, 0.5);
    let voxels = Voxels::from_fn([5, 5, 5], |x, y, z| u8::from((x + y * z) % 3 == 0));
    add("voxels", Shape::Voxels(voxels), plain, -3.0, -4.0);
    let ball = |x: f64| Form::Ellipsoid { center: DVec3::new(x, 0.5, 0.0), radii: DVec3::splat(0.5) };
    let blend = Form::SmoothUnion { a: Box::new(ball(0.0)), b: Box::new(ball(0.6)), k: 0.4 };
    add("blend", Shape::FreeForm(FreeForm::new(blend).unwrap()), glass, 0.0, 1.5);
    let heights = (0..25).map(|i| (i % 3) as f32 * 0.2).collect();
    let field = HeightField::new(5, 5, DVec2::splat(2.0), heights).unwrap();
    add("field", Shape::HeightField(field), plain, 2.5, -1.0);
    let samples = (0..216).map(|i| (i * 37 % 256) as u8).collect();
    let volume = Volume::new([6, 6, 6], DVec3::splat(0.3), Samples::U8(samples)).unwrap();
    add("cloud", Shape::Volume(volume), plain, 0.0, -1.5);
    let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(f32::NAN, 0.0, 1.0)];
    let triangles = vec![[0, 1, 2], [0, 1, 3]];
    add("broken", Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() }), plain, -2.0, 1.0);
    scene.lights.push(Light::directional(DVec3::new(-0.4, -1.0, -0.3)));
    scene.lights.push(Light::point(DVec3::new(2.0, 4.0, 3.0), 6.0));
    scene
}

fn need(width: u32, height: u32) -> Need {
    let camera = camera([3.0, 4.0, 7.0], [0.0, 0.5, 0.0]);
    Need { channels: Channels::ALL, samples: 3, ..Need::new(camera, width, height) }
}

#[test]
fn any_number_of_threads_gives_the_same_bytes_at_any_size() {
    let scene = Arc::new(everything());
    for (width, height) in [(0, 0), (1, 1), (1, 7), (13, 11), (67, 41)] {
        let need = need(width, height);
        let one = draw_with(&scene, &need, &Control::simple());
        assert_eq!(one.count_not_finite(), 0);
        for threads in [2, 4] {
            let pool = Pool::new(threads).unwrap();
            let other = draw_with(&scene, &need, &Control::new(&pool));
            assert!(one.same_bits(&other), "{width}x{height} with {threads} threads");
        }
    }
}

#[test]
fn a_channel_is_the_same_alone_and_among_others() {
    let scene = Arc::new(everything());
    let need = need(53, 37);
    let all = draw_with(&scene, &need, &Control::simple());
    let only = |channels: Channels| draw_with(&scene, &Need { channels, ..need.clone() }, &Control::simple());
    use polyptych_core::framebuffer::Channel as C;
    assert_eq!(only(Channels::COLOR).color(), all.color());
    assert_eq!(only(Channels::of(&[C::Distance])).distance(), all.distance());
    assert_eq!(only(Channels::of(&[C::Normal])).normal(), all.normal());
    assert_eq!(only(Channels::of(&[C::Id])).id(), all.id());
    assert_eq!(only(Channels::of(&[C::Albedo])).albedo(), all.albedo());
    assert_eq!(only(Channels::of(&[C::Shadow])).shadow(), all.shadow());
    assert_eq!(only(Channels::of(&[C::Coverage])).coverage(), all.coverage());
}

#[test]
fn a_cancelled_picture_is_an_error_and_the_next_one_is_whole() {
    let scene = Arc::new(everything());
    let need = need(40, 30);
    let mut renderer = Reference::new();
    let mut picture = Framebuffer::new(40, 30, Channels::ALL);
    let missing = renderer.render(&need.frame(), &mut picture, &Control::simple());
    assert_eq!(missing.unwrap_err(), RenderError::NotPrepared);
    renderer.prepare(&scene, &need, &Converter::default(), &Control::simple()).unwrap();
    let flag = AtomicBool::new(true);
    let control = Control::simple().cancelled_by(&flag);
    let stopped = renderer.render(&need.frame(), &mut picture, &control);
    assert_eq!(stopped.unwrap_err(), RenderError::Cancelled);
    flag.store(false, Ordering::Relaxed);
    renderer.render(&need.frame(), &mut picture, &control).unwrap();
    assert!(picture.same_bits(&draw_with(&scene, &need, &Control::simple())));
}

#[test]
fn plan_and_report_say_the_same_and_nothing_is_dropped_in_silence() {
    let mut scene = everything();
    let wire = Mesh { positions: vec![Vec3::ZERO, Vec3::ONE], segments: vec![[0, 1]], ..Mesh::default() };
    scene.objects.push(Object::new("wire", Shape::Mesh(wire), 0));
    let need = need(8, 8);
    let mut renderer = Reference::new();
    let plan = renderer.plan(&scene, &need);
    let shared = Arc::new(scene.clone());
    let done = renderer.prepare(&shared, &need, &Converter::default(), &Control::simple()).unwrap();
    let planned: Vec<_> = plan.objects.iter().map(|o| o.decision.clone()).collect();
    assert_eq!(planned, &*done.objects);
    assert_eq!(planned[8], Decision::Skipped { why: "line segments have no area".to_owned() });
    let why = "1 triangles with corners that are not finite are left out".to_owned();
    assert_eq!(planned[7], Decision::Approximated { why });
    assert!(planned[..7].iter().all(|d| *d == Decision::Exact));
    scene.objects[8].required = true;
    let refused = renderer.prepare(&Arc::new(scene), &need, &Converter::default(), &Control::simple());
    assert!(matches!(refused, Err(RenderError::Required { object, .. }) if object == "wire"));
}

#[test]
fn an_edit_keeps_what_was_built_for_other_shapes_and_matches_a_fresh_start() {
    let mut scene = everything();
    let need = need(31, 23);
    let mut renderer = Reference::new();
    let shared = Arc::new(scene.clone());
    renderer.prepare(&shared, &need, &Converter::default(), &Control::simple()).unwrap();
    scene.objects[1].world_from_object.translation.y += 0.4;
    scene.objects.remove(2);
    let edited = Arc::new(scene);
    renderer.prepare(&edited, &need, &Converter::default(), &Control::simple()).unwrap();
    let mut picture = Framebuffer::new(31, 23, Channels::ALL);
    renderer.render(&need.frame(), &mut picture, &Control::simple()).unwrap();
    assert!(picture.same_bits(&draw_with(&edited, &need, &Control::simple())));
}

#[test]
fn parameters_are_refused_with_the_nearest_name() {
    let declared = Factory.info().parameters;
    let mut settings = Settings::default();
    let error = settings.set("reference", &declared, "sample", "4").unwrap_err();
    assert!(error.to_string().ends_with("the nearest is `samples`"));
    settings.set("reference", &declared, "samples", "4").unwrap();
    assert!(settings.set("reference", &declared, "bounces", "17").is_err());
}

#[test]
fn five_thousand_instances_share_one_shape() {
    let mut scene = Scene::default();
    let material = scene.add_material(Material::default());
    let shape = Arc::new(Shape::Primitive(Primitive::Sphere { radius: 0.4 }));
    for i in 0..5000 {
        let place = DVec3::new(f64::from(i % 100), 0.0, f64::from(i / 100));
        let mut object = Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 0.4 }), material);
        object.shape = shape.clone();
        scene.objects.push(object.at(place));
    }
    let from_above = Camera::look_at(
        DVec3::new(49.5, 9.0, 24.5),
        DVec3::new(49.5, 0.0, 24.5),
        DVec3::NEG_Z,
        Projection::Orthographic { height: 50.0 },
    );
    let picture = draw(scene, from_above, 100, 50);
    for (i, &id) in picture.id().iter().enumerate() {
        assert_eq!(id as usize, i + 1);
    }
}
