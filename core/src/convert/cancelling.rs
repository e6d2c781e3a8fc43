//! What does a conversion that was stopped leave behind? Nothing.

use super::*;
use crate::parallel::Pool;
use crate::scene::{Form, FreeForm, HeightField, Primitive, Samples, Volume};
use crate::seam::Probe;
use glam::{DVec2, Vec3};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Stops the work at the k-th time that it asks, and at all that follow.
struct Fuse {
    asked: AtomicUsize,
    burns_at: usize,
}

impl Fuse {
    fn of(burns_at: usize) -> Self {
        Self { asked: AtomicUsize::new(0), burns_at }
    }
}

impl Probe for Fuse {
    fn stops(&self) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed) >= self.burns_at
    }
}

fn torus(tolerance: f64) -> Mesh {
    primitive_mesh::tessellate(&Primitive::Torus { major: 1.0, minor: 0.3 }, tolerance).0
}

/// A shape of each kind that takes time to convert.
fn shapes() -> Vec<(&'static str, Shape)> {
    let mut open = torus(0.03);
    open.triangles.truncate(open.triangles.len() / 2);
    let ellipsoid = |x: f64| Form::Ellipsoid { center: DVec3::X * x, radii: DVec3::new(1.0, 0.7, 0.8) };
    let form = FreeForm::new(Form::Union(vec![ellipsoid(0.0), ellipsoid(0.9)])).unwrap();
    let heights = (0..40 * 30).map(|i| (f64::from(i % 40) * 0.4).sin() as f32).collect();
    let field = HeightField::new(40, 30, DVec2::ONE, heights).unwrap();
    let samples = (0..12 * 12 * 12)
        .map(|i| 4.0 - (Vec3::new((i % 12) as f32, (i / 12 % 12) as f32, (i / 144) as f32) - 5.5).length())
        .collect();
    let volume = Volume::new([12; 3], DVec3::ONE, Samples::F32(samples)).unwrap();
    let ball = |x: u32, y: u32, z: u32| {
        let p = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - 9.5;
        u8::from(p.length() < 9.0)
    };
    vec![
        ("closed mesh", Shape::Mesh(torus(0.03))),
        ("open mesh", Shape::Mesh(open)),
        ("free form", Shape::FreeForm(form)),
        ("height field", Shape::HeightField(field)),
        ("volume", Shape::Volume(volume)),
        ("voxels", Shape::Voxels(Voxels::from_fn([20; 3], ball))),
        ("primitive", Shape::Primitive(Primitive::Sphere { radius: 1.0 })),
    ]
}

/// All ways to convert an object.
const WAYS: [&str; 7] = ["mesh", "level", "distance", "natural", "surface", "thin", "solid"];

/// Returns what becomes of an object as text that tells every number exactly.
fn convert(
    way: usize,
    converter: &Converter,
    object: &Object,
    control: &Control<'_>,
) -> Result<String, ConvertError> {
    let (scene, detail) = (Scene::default(), Detail { tolerance: 0.05, max_resolution: 16 });
    Ok(match way {
        0 => format!("{:?}", converter.mesh(&scene, object, detail, control)?),
        1 => format!("{:?}", converter.level(&scene, object, detail, control)?),
        2 => format!("{:?}", converter.distance(&scene, object, detail, control)?),
        _ => {
            let filling = Filling::ALL[way - 3];
            let model = converter.voxels_filled(&scene, object, detail, filling, control)?;
            let mut cells = Vec::new();
            model.voxels.for_each_filled(|cell, value| cells.push((cell, value)));
            format!(
                "{cells:?} {:?} {:?} {} {}",
                model.palette, model.object_from_voxels, model.bound, model.why
            )
        }
    })
}

/// Times at which to stop work that asks `count` times: first ones, last ones, and some between.
fn places(count: usize) -> impl Iterator<Item = usize> {
    (0..3).chain((1..6).map(move |i| count * i / 6)).chain([count.saturating_sub(2), count - 1])
}

#[test]
fn a_stopped_conversion_is_told_and_forgotten() {
    let pool = Pool::new(3).unwrap();
    for (name, shape) in shapes() {
        let object = Object::new("thing", shape, 0);
        for (way, kind) in WAYS.into_iter().enumerate() {
            let never = Fuse::of(usize::MAX);
            let fresh =
                convert(way, &Converter::default(), &object, &Control::simple().probed_by(&never)).unwrap();
            let asked = never.asked.into_inner();
            assert!(asked > 0, "{name} as {kind} asks");
            for k in places(asked).filter(|&k| k < asked) {
                for control in [Control::simple(), Control::new(&pool)] {
                    let (converter, fuse) = (Converter::default(), Fuse::of(k));
                    let stopped = convert(way, &converter, &object, &control.probed_by(&fuse));
                    assert_eq!(stopped, Err(ConvertError::Cancelled), "{name} as {kind} at {k} of {asked}");
                    let again = convert(way, &converter, &object, &control).unwrap();
                    assert!(again == fresh, "{name} as {kind} after a stop at {k} of {asked}");
                }
            }
        }
    }
}

/// What takes long asks often: the work between two times is bounded, whatever the size of the shape.
#[test]
fn larger_shapes_ask_more_often() {
    let asked = |way: usize, mesh: Mesh| {
        let (object, fuse) = (Object::new("thing", Shape::Mesh(mesh), 0), Fuse::of(usize::MAX));
        convert(way, &Converter::default(), &object, &Control::simple().probed_by(&fuse)).unwrap();
        fuse.asked.into_inner()
    };
    for (way, kind) in WAYS.into_iter().enumerate().skip(1) {
        let (small, large) = (torus(0.03), torus(0.001));
        let times = large.triangles.len() / small.triangles.len();
        let [few, many] = [small, large].map(|mesh| asked(way, mesh));
        assert!(many > few * times / 8, "{kind}: {few} and {many} times for {times} times the triangles");
    }
}
