//! Which scene does a case draw at a value?

use crate::builtin;
use crate::camera::{Camera, Projection};
use crate::compare::compared_channels;
use crate::framebuffer::Channels;
use crate::prelude::{
    DAffine3, DQuat, DVec2, DVec3, Form, FreeForm, HeightField, Light, Material, Mesh, Need, Object,
    Primitive, Scene, Shape, Vec3, Voxels,
};
use crate::scene::{Background, Quadric};
use std::sync::Arc;

/// A scene with what is wanted of its picture.
#[derive(Clone)]
pub(super) struct Setup {
    pub(super) scene: Arc<Scene>,
    pub(super) need: Need,
    /// Settings of the back ends that have them.
    pub(super) settings: Vec<(&'static str, String)>,
    /// Settings of what pictures are held against.
    pub(super) ruler_settings: Vec<(&'static str, String)>,
    /// Scenes that came before: what is kept of them must not show. Of a case about lines, the scene that has them.
    pub(super) history: Vec<Arc<Scene>>,
    /// Samples along each edge of a pixel that the host takes.
    pub(super) supersampling: u32,
    /// Step of a moving camera in pixels, and the distance of what it looks at.
    pub(super) step_px: f64,
    pub(super) distance: f64,
    /// Whether a better way moved scene and camera: it is then held against the reference at its own place.
    pub(super) is_moved: bool,
    /// How much there is of what grows: threads that draw, finished bands after which the scene is edited.
    pub(super) load: f64,
    /// What is changed while a frame is drawn.
    pub(super) edit: fn(&mut Scene),
}

pub(super) const WIDTH: u32 = 96;
pub(super) const HEIGHT: u32 = 72;

pub(super) fn setup(scene: Scene, camera: Camera) -> Setup {
    let channels = compared_channels();
    let distance = camera.eye.distance(scene.bounds().center());
    Setup {
        scene: Arc::new(scene),
        need: Need { channels, ..Need::new(camera, WIDTH, HEIGHT) },
        settings: Vec::new(),
        ruler_settings: Vec::new(),
        history: Vec::new(),
        supersampling: 1,
        step_px: 1.0 / 16.0,
        distance,
        is_moved: false,
        load: 1.0,
        edit: |_| (),
    }
}

pub(super) fn perspective(fov_y: f64) -> Projection {
    Projection::Perspective { fov_y }
}

pub(super) fn look(eye: DVec3, target: DVec3, fov_y: f64) -> Camera {
    Camera::look_at(eye, target, DVec3::Y, perspective(fov_y))
}

/// Begins a scene with a light and two materials: 0 light, 1 dark.
pub(super) fn studio() -> Scene {
    let mut scene = Scene::default();
    scene.add_material(Material::new(Vec3::new(0.85, 0.75, 0.6)));
    scene.add_material(Material::new(Vec3::new(0.2, 0.35, 0.6)));
    scene.lights.push(Light::directional(DVec3::new(-0.5, -0.8, -0.6)));
    scene
}

fn ball() -> Shape {
    Shape::Primitive(Primitive::Sphere { radius: 1.0 })
}

fn still_life() -> Scene {
    builtin::scene("polyhedra").unwrap_or_default()
}

/// Moves and scales a scene with everything in it.
fn placed(mut scene: Scene, world_from_scene: DAffine3) -> Scene {
    for object in &mut scene.objects {
        object.world_from_object = world_from_scene * object.world_from_object;
    }
    scene
}

pub(super) fn front(scene: &Scene) -> Camera {
    Camera::framing(&scene.bounds(), 0.5, 0.35, f64::from(WIDTH) / f64::from(HEIGHT), perspective(0.7))
}

/// A quad in the plane z = 0, its edges `half` from the middle.
fn quad(half: f32) -> Mesh {
    let at = |x: f32, y: f32| Vec3::new(x * half, y * half, 0.0);
    Mesh {
        positions: vec![at(-1.0, -1.0), at(1.0, -1.0), at(1.0, 1.0), at(-1.0, 1.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// A ball from so many radii away, always as large in the picture.
pub(super) fn far_camera(distance: f64) -> Setup {
    let mut scene = studio();
    scene.objects.push(Object::new("ball", ball(), 0));
    let fov = 2.0 * (1.4 / distance).min(0.99).asin();
    setup(scene, look(DVec3::Z * distance, DVec3::ZERO, fov))
}

/// Draws from far away as if from infinity: the picture is the same, and no number is large.
pub(super) fn from_infinity(setup: &mut Setup) {
    parallel_beyond(setup, 3e3);
}

/// The same from nearer on: for what is flat and faces the eye.
pub(super) fn flat_from_infinity(setup: &mut Setup) {
    parallel_beyond(setup, 300.0);
}

fn parallel_beyond(setup: &mut Setup, least: f64) {
    let distance = setup.need.camera.eye.length();
    if distance > least
        && let Projection::Perspective { fov_y } = setup.need.camera.projection
    {
        setup.need.camera.projection =
            Projection::Orthographic { height: 2.0 * distance * (fov_y * 0.5).tan() };
        setup.need.camera.eye *= 4.0 / distance;
    }
}

/// A voxel ball from so many cells away.
pub(super) fn far_voxels(distance: f64) -> Setup {
    let mut scene = studio();
    let cells = Voxels::from_fn([16; 3], |x, y, z| {
        let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - 7.5;
        u8::from(p.length() < 8.0)
    });
    scene.objects.push(Object::new("voxels", Shape::Voxels(cells), 0));
    let center = DVec3::splat(8.0);
    let fov = 2.0 * (11.0 / distance).min(0.99).asin();
    setup(scene, look(center + DVec3::new(0.3, 0.2, 1.0).normalize_or(DVec3::Z) * distance, center, fov))
}

/// The default scene, scaled with its camera: shapes of all kinds.
pub(super) fn scaled(scale: f64) -> Setup {
    let scene =
        placed(builtin::scene("atelier").unwrap_or_default(), DAffine3::from_scale(DVec3::splat(scale)));
    let camera = front(&scene);
    setup(scene, camera)
}

/// The still life, moved with its camera.
pub(super) fn moved(offset: f64) -> Setup {
    let offset = DVec3::new(0.577, 0.577, 0.577) * offset;
    let scene = still_life();
    let mut camera = front(&scene);
    camera.eye += offset;
    setup(placed(scene, DAffine3::from_translation(offset)), camera)
}

/// Brings the eye to the origin and the scene with it.
pub(super) fn re_origined(setup: &mut Setup) {
    // Rounded, so that moving back and forth changes no digit of a position.
    let shift = setup.need.camera.eye.round();
    setup.need.camera.eye -= shift;
    setup.is_moved = true;
    setup.scene = Arc::new(placed((*setup.scene).clone(), DAffine3::from_translation(-shift)));
}

/// A wide floor from so many degrees above it.
pub(super) fn grazing(degrees: f64) -> Setup {
    let mut scene = studio();
    let floor = Primitive::Box { size: DVec3::new(20.0, 1.0, 20.0) };
    scene.objects.push(Object::new("floor", Shape::Primitive(floor), 0).at(DVec3::Y * -0.5));
    let angle = degrees.to_radians();
    let eye = DVec3::new(0.0, angle.sin(), angle.cos()) * 9.0;
    // The picture is as high as the floor looks, so that it always fills some of it.
    setup(scene, look(eye, DVec3::ZERO, (angle * 2.0).clamp(1e-7, 1.0)))
}

/// One quad before another, so far apart.
pub(super) fn coplanar(separation: f64) -> Setup {
    let mut scene = studio();
    scene.objects.push(Object::new("behind", Shape::Mesh(quad(1.0)), 0));
    scene.objects.push(Object::new("before", Shape::Mesh(quad(0.6)), 1).at(DVec3::Z * separation));
    setup(scene, look(DVec3::new(1.0, 0.7, 4.0), DVec3::ZERO, 0.6))
}

/// Two quads 1e-4 apart at a distance, as large in the picture.
pub(super) fn depth(distance: f64) -> Setup {
    let mut scene = studio();
    scene.objects.push(Object::new("behind", Shape::Mesh(quad(1.0)), 0));
    scene.objects.push(Object::new("before", Shape::Mesh(quad(0.6)), 1).at(DVec3::Z * 1e-4));
    let fov = 2.0 * (1.2 / distance).min(0.99).asin();
    setup(scene, look(DVec3::new(0.0, 0.0, distance), DVec3::ZERO, fov))
}

/// A glowing rod so many pixels thick, before black.
pub(super) fn thin(pixels: f64) -> Setup {
    let mut scene = Scene::default();
    scene.environment.background = Background::Solid(Vec3::ZERO);
    let glow = scene.add_material(Material {
        emission: Vec3::ONE,
        ambient: 0.0,
        diffuse: 0.0,
        specular: 0.0,
        ..Material::new(Vec3::ZERO)
    });
    let camera = look(DVec3::Z * 5.0, DVec3::ZERO, 0.6);
    let radius = camera.view(WIDTH, HEIGHT).pixel_size(5.0) * pixels * 0.5;
    let rod = Shape::Primitive(Primitive::Cylinder { radius, height: 2.2 });
    scene.objects.push(Object::new("rod", rod, glow).placed(DAffine3::from_rotation_z(0.37)));
    setup(scene, camera)
}

/// Takes four by four samples a pixel in the host.
pub(super) fn supersampled(setup: &mut Setup) {
    setup.supersampling = 4;
}

/// Takes a conversion no coarser than a twentieth of a pixel.
pub(super) fn finer(setup: &mut Setup) {
    setup.need.tolerance_px = 0.05;
    setup.settings.push(("detail.resolution", "512".to_owned()));
}

/// A ball with the eye so far before its surface; negative is inside.
pub(super) fn near(gap: f64) -> Setup {
    let mut scene = studio();
    scene.objects.push(Object::new("ball", ball(), 0));
    let wall = Shape::Primitive(Primitive::Box { size: DVec3::new(40.0, 40.0, 1.0) });
    scene.objects.push(Object::new("wall", wall, 1).at(DVec3::Z * -3.5));
    setup(scene, look(DVec3::Z * (1.0 + gap), DVec3::ZERO, 0.9))
}

fn floor_and_pole(light: DVec3, gap: f64) -> Scene {
    let mut scene = studio();
    scene.lights = vec![Light::directional(light)];
    let floor = Primitive::Box { size: DVec3::new(12.0, 0.4, 12.0) };
    scene.objects.push(Object::new("floor", Shape::Primitive(floor), 0).at(DVec3::Y * -0.2));
    scene.objects.push(Object::new("ball", ball(), 1).at(DVec3::Y * (1.0 + gap)));
    let post = Primitive::Box { size: DVec3::new(0.4, 1.5, 0.4) };
    scene.objects.push(Object::new("post", Shape::Primitive(post), 1).at(DVec3::new(2.2, 0.75 + gap, 0.6)));
    scene
}

/// A ball and a post on a floor, lit so many degrees from above.
pub(super) fn shadow_slope(degrees: f64) -> Setup {
    let angle = degrees.to_radians();
    let scene = floor_and_pole(DVec3::new(-angle.sin(), -angle.cos(), -angle.sin() * 0.3), 0.0);
    setup(scene, look(DVec3::new(2.0, 5.0, 7.0), DVec3::ZERO, 0.75))
}

/// A ball and a post so far above a floor, lit from above.
pub(super) fn shadow_contact(gap: f64) -> Setup {
    let scene = floor_and_pole(DVec3::new(-0.4, -1.0, -0.2), gap);
    setup(scene, look(DVec3::new(2.0, 5.0, 7.0), DVec3::ZERO, 0.75))
}

/// Asks for the finest shadow map.
pub(super) fn fine_shadow(setup: &mut Setup) {
    setup.settings.push(("shadow.map_size", "8192".to_owned()));
}

/// Blocks in a ring, with the eye in their middle and so many degrees of view.
fn ring(projection: Projection) -> Setup {
    let mut scene = studio();
    for i in 0..12 {
        let angle = f64::from(i) * std::f64::consts::TAU / 12.0;
        let place = DVec3::new(angle.sin() * 4.0, 0.3, angle.cos() * -4.0);
        let block = Primitive::Box { size: DVec3::new(0.9, 1.6, 0.9) };
        scene.objects.push(Object::new("block", Shape::Primitive(block), (i % 2) as usize).at(place));
    }
    let camera = Camera::look_at(DVec3::ZERO, -DVec3::Z, DVec3::Y, projection);
    let mut setup = setup(scene, camera);
    setup.distance = 4.0;
    setup
}

/// The ring through a perspective camera.
pub(super) fn field_of_view(degrees: f64) -> Setup {
    ring(perspective(degrees.to_radians()))
}

/// The ring through a fisheye.
pub(super) fn fisheye(degrees: f64) -> Setup {
    ring(Projection::Fisheye { fov: degrees.to_radians() })
}

/// The still life under a camera that moves by a share of a pixel.
pub(super) fn motion(step_px: f64) -> Setup {
    let scene = still_life();
    let camera = front(&scene);
    Setup { step_px, ..setup(scene, camera) }
}

/// The moved still life under a camera that moves by a sixteenth of a pixel.
pub(super) fn trembling(offset: f64) -> Setup {
    let mut setup = moved(offset);
    setup.distance = setup.need.camera.eye.distance(setup.scene.bounds().center());
    setup
}

/// Scenes that are hardly any: each number is one of them.
pub(super) fn degenerate(which: f64) -> Setup {
    let mut scene = studio();
    let mut size = [WIDTH, HEIGHT];
    let mut mesh = quad(1.0);
    match which as u32 {
        0 => {}
        1 => mesh.positions[2].x = f32::NAN,
        2 => mesh.positions[2].y = f32::INFINITY,
        3 => mesh.positions = vec![Vec3::ZERO; 4],
        4 => mesh.triangles.clear(),
        5 => scene.lights[0] = Light::directional(DVec3::ZERO),
        6 => size = [0, 0],
        7 => size = [1, 1],
        8 => scene.materials[0].shininess = f32::INFINITY,
        9 => mesh.positions.iter_mut().for_each(|p| *p *= 1e30),
        _ => mesh = Mesh::default(),
    }
    scene.objects.push(Object::new("quad", Shape::Mesh(mesh), 0));
    let flat = Primitive::Box { size: DVec3::new(1.0, 0.0, 1.0) };
    scene.objects.push(Object::new("flat box", Shape::Primitive(flat), 1));
    if which as u32 == 11 {
        scene.objects.clear();
    }
    let mut setup = setup(scene, look(DVec3::new(0.5, 0.8, 3.0), DVec3::ZERO, 0.8));
    (setup.need.width, setup.need.height) = (size[0], size[1]);
    setup
}

/// A fan of so many triangles around a pixel's center, filling the picture.
pub(super) fn fan(triangles: f64) -> Setup {
    let count = triangles as u32;
    let mut mesh = Mesh { positions: vec![Vec3::ZERO], ..Mesh::default() };
    for i in 0..count {
        let angle = f64::from(i) * std::f64::consts::TAU / f64::from(count);
        mesh.positions.push(Vec3::new(angle.cos() as f32 * 4.0, angle.sin() as f32 * 4.0, 0.0));
        mesh.triangles.push([0, i + 1, (i + 1) % count + 1]);
    }
    let mut scene = studio();
    scene.objects.push(Object::new("fan", Shape::Mesh(mesh), 0));
    setup(scene, look(DVec3::new(0.021, -0.013, 4.0), DVec3::new(0.021, -0.013, 0.0), 0.6))
}

/// A floor of two triangles whose corners lie so far away, seen by somebody who stands on it.
pub(super) fn huge_triangles(half: f64) -> Setup {
    let mut scene = studio();
    let flat = DAffine3::from_quat(DQuat::from_rotation_x(-std::f64::consts::FRAC_PI_2));
    scene.objects.push(Object::new("floor", Shape::Mesh(quad(half as f32)), 0).placed(flat));
    setup(scene, look(DVec3::new(0.0, 1.6, 0.0), DVec3::new(0.3, 1.0, -3.0), 0.9))
}

/// A hollow ball with a wall so thick, cut open: both of its surfaces are seen.
pub(super) fn shell(thickness: f64) -> Setup {
    let ball = |radius: f64| Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::splat(radius) };
    let hollow = Form::Difference(Box::new(ball(1.0)), Box::new(ball(1.0 - thickness)));
    let half = Form::HalfSpace { normal: DVec3::new(0.3, 0.5, 1.0), offset: 0.3 };
    let mut scene = studio();
    if let Ok(form) = FreeForm::new(Form::Intersection(vec![hollow, half])) {
        scene.objects.push(Object::new("shell", Shape::FreeForm(form), 0));
    }
    setup(scene, look(DVec3::new(0.6, 0.9, 4.0), DVec3::ZERO, 0.65))
}

/// A ball as a quadric whose coefficients are multiplied by a power of ten.
pub(super) fn coefficients(power: f64) -> Setup {
    let k = 10f64.powf(power);
    let quadric = Quadric([-k, -k, -k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, k]);
    let mut scene = studio();
    if let Ok(form) = FreeForm::new(Form::Quadric(quadric)) {
        scene.objects.push(Object::new("ball", Shape::FreeForm(form), 0));
    }
    setup(scene, look(DVec3::new(0.6, 0.9, 4.0), DVec3::ZERO, 0.65))
}

/// A plain with a single spike, on a grid of so many columns.
pub(super) fn spike(columns: f64) -> Setup {
    let n = columns as u32;
    let mut heights = vec![0.0; (n * n) as usize];
    heights[((n / 2) * n + n / 2) as usize] = 1.0;
    let mut scene = studio();
    if let Ok(field) = HeightField::new(n, n, DVec2::splat(4.0), heights) {
        scene.objects.push(Object::new("plain", Shape::HeightField(field), 0));
    }
    setup(scene, look(DVec3::new(0.0, 1.6, 4.0), DVec3::new(0.0, 0.2, 0.0), 0.8))
}

/// So many boxes in a field.
pub(super) fn many(count: f64) -> Setup {
    let mut scene = studio();
    let edge = count.sqrt().ceil() as i32;
    let shape = Arc::new(Shape::Primitive(Primitive::Box { size: DVec3::splat(0.6) }));
    for i in 0..count as i32 {
        let place = DVec3::new(f64::from(i % edge - edge / 2), 0.0, f64::from(i / edge - edge / 2));
        scene.objects.push(Object {
            shape: shape.clone(),
            ..Object::new("box", Shape::Primitive(Primitive::Box { size: DVec3::ONE }), (i % 2) as usize)
                .at(place)
        });
    }
    let camera = front(&scene);
    Setup { load: count, ..setup(scene, camera) }
}

/// The still life under so many lights.
pub(super) fn lights(count: f64) -> Setup {
    let mut scene = still_life();
    scene.lights = (0..count as u32)
        .map(|i| {
            let angle = f64::from(i) * 2.399_963;
            Light::point(DVec3::new(angle.cos() * 2.0, 1.5, angle.sin() * 2.0), 3.0 / count as f32)
        })
        .collect();
    let camera = front(&scene);
    Setup { load: count, ..setup(scene, camera) }
}

/// The still life in a picture of so many rows.
pub(super) fn pixels(rows: f64) -> Setup {
    let scene = still_life();
    let camera = front(&scene);
    let mut setup = setup(scene, camera);
    (setup.need.width, setup.need.height) = (rows as u32 * 16 / 9, rows as u32);
    // Time is counted, and nothing compared.
    setup.need.channels = Channels::COLOR;
    Setup { load: rows * rows, ..setup }
}
