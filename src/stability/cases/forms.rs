//! Which cases are about free forms, height fields and volumes?

use super::super::count::Count;
use super::super::scenes::{Setup, look, setup, studio};
use super::{Case, EVERY, base, powers};
use crate::camera::{Camera, Projection};
use crate::prelude::{DVec2, DVec3, Form, FreeForm, HeightField, Object, Primitive, Shape, Vec3, Volume};
use crate::scene::{Perturbation, Power, Quadric, Samples, TransferFunction, TransferPoint};

pub(super) fn cases() -> Vec<Case> {
    let mut all = functions();
    all.extend(fields());
    all
}

fn functions() -> Vec<Case> {
    vec![
        Case {
            id: "tangent",
            title: "The rim of a ball in a smaller and smaller window: rays that nearly touch it",
            parameter: "window over radius",
            values: powers(-1, -12),
            limit: 0.02,
            counted: "1 - silhouette IoU, or share of false shadows",
            backends: &["freeform"],
            build: tangent,
            count: Count::Silhouette,
            ..base()
        },
        Case {
            id: "degenerate-quadrics",
            title: "Quadrics that are a double plane, a line, a point, nothing, everything, or a cone's tip",
            parameter: "which",
            values: (0..7).map(f64::from).collect(),
            is_logarithmic: false,
            limit: 0.0,
            counted: "pixels that are not finite; a panic counts as infinite",
            is_promise: true,
            backends: EVERY,
            build: degenerate_quadric,
            count: Count::NotFinite,
            ..base()
        },
        Case {
            id: "close-roots",
            title: "A bumpy disc, thinner and thinner: rays meet its faces at places that nearly coincide",
            parameter: "thickness over radius",
            values: powers(-1, -7),
            limit: 0.002,
            counted: "share of pixels where counting the roots along the ray (Sturm) says otherwise",
            backends: &["reference", "freeform"],
            build: disc,
            count: Count::Roots,
            ..base()
        },
        Case {
            id: "first-roots",
            title: "A ball with more and more bumps and dents, of which rays meet many",
            parameter: "functions",
            values: vec![1.0, 3.0, 10.0, 30.0, 100.0],
            limit: 0.002,
            counted: "share of pixels where counting the roots along the ray (Sturm) says otherwise",
            backends: &["reference", "freeform"],
            build: rugged,
            count: Count::Roots,
            ..base()
        },
        Case {
            id: "rim",
            title: "A dent whose support reaches less and less into a ball",
            parameter: "overlap over radius",
            values: powers(-1, -7),
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            backends: &["freeform"],
            build: rim,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "recursion",
            title: "Bumps that are bent by bumps that are bent",
            parameter: "depth",
            values: (1..=8).map(f64::from).collect(),
            is_logarithmic: false,
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            backends: &["freeform"],
            build: recursion,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "functions",
            title: "A ball with more and more bumps",
            parameter: "functions",
            values: vec![1.0, 10.0, 100.0, 1000.0],
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            backends: &["freeform"],
            build: bumps,
            count: Count::Distance,
            ..base()
        },
    ]
}

fn fields() -> Vec<Case> {
    vec![
        Case {
            id: "vertical-heights",
            is_method: true,
            title: "Hills from straight above: rays that run along columns of the grid",
            parameter: "tilt, degrees",
            values: vec![10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0],
            is_logarithmic: false,
            limit: 0.01,
            counted: "wrong objects, or distance error p99 over the distance",
            build: vertical_heights,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "under-heights",
            is_method: true,
            title: "The eye above a field of heights, on it and below",
            parameter: "eye above the surface, m",
            values: vec![1.0, 0.1, 0.01, 1e-3, 1e-6, 0.0, -1e-6, -1e-3, -0.1, -1.0],
            is_logarithmic: false,
            limit: 0.02,
            counted: "wrong objects, or distance error p99 over the distance",
            build: under_heights,
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "height-sizes",
            is_method: true,
            title: "Hills on grids of 2, 3, 5, 7 ... columns and a prime number of rows",
            parameter: "columns",
            values: vec![2.0, 3.0, 5.0, 7.0, 17.0, 31.0, 64.0, 127.0],
            limit: 0.01,
            counted: "wrong objects, or distance error p99 over the distance",
            build: |columns| hills(columns as u32, 13),
            count: Count::Distance,
            ..base()
        },
        Case {
            id: "volume-step",
            title: "A cloud with longer and longer steps through it",
            parameter: "step, samples",
            values: vec![0.05, 0.1, 0.25, 0.5, 1.0, 2.0, 4.0],
            limit: 0.01,
            counted: "color error (RMSE) to the reference with steps of 1/20",
            backends: &["reference", "freeform"],
            build: volume_step,
            count: Count::Color,
            ..base()
        },
        Case {
            id: "volume-borders",
            title: "A cloud in a larger and larger grid, so that the borders of bricks lie elsewhere in it",
            parameter: "empty layers of samples before it",
            values: vec![0.0, 1.0, 3.0, 4.0, 7.0],
            is_logarithmic: false,
            limit: 0.004,
            counted: "color difference to the picture without empty layers",
            backends: &["reference", "freeform"],
            build: padded_cloud,
            count: Count::Change,
            ..base()
        },
        Case {
            id: "volume-slabs",
            title: "A block of even fog, seen nearer and nearer to straight: rays along its faces",
            parameter: "tilt, degrees",
            values: vec![10.0, 1.0, 0.1, 1e-3, 1e-6, 1e-9, 0.0],
            is_logarithmic: false,
            limit: 0.01,
            counted: "color error (RMSE)",
            backends: &["freeform"],
            build: volume_slabs,
            count: Count::Color,
            ..base()
        },
    ]
}

fn ball(center: DVec3, radius: f64) -> Form {
    Form::Ellipsoid { center, radii: DVec3::splat(radius) }
}

/// A scene of one form; nothing in it where the form has no bounds.
fn of_form(form: Form, camera: Camera) -> Setup {
    let mut scene = studio();
    if let Ok(form) = FreeForm::new(form) {
        scene.objects.push(Object::new("form", Shape::FreeForm(form), 0));
    }
    setup(scene, camera)
}

fn front() -> Camera {
    look(DVec3::new(0.6, 0.9, 4.0), DVec3::ZERO, 0.65)
}

/// A ball's rim in a window so wide, seen along parallel rays.
fn tangent(window: f64) -> Setup {
    let eye = DVec3::new(0.6, 0.8, 0.0) + DVec3::Z * 4.0;
    let camera = Camera::look_at(eye, eye - DVec3::Z, DVec3::Y, Projection::Orthographic { height: window });
    let mut scene = studio();
    scene.objects.push(Object::new("ball", Shape::Primitive(Primitive::Sphere { radius: 1.0 }), 0));
    setup(scene, camera)
}

/// Quadrics with hardly any inside, each cut to a box.
fn degenerate_quadric(which: f64) -> Setup {
    let mut q = [0.0; 10];
    match which as u32 {
        0 => q[0] = -1.0,                                         // -x^2: a double plane
        1 => (q[0], q[1]) = (-1.0, -1.0),                         // a line
        2 => (q[0], q[1], q[2]) = (-1.0, -1.0, -1.0),             // a point
        3 => (q[0], q[1], q[2], q[9]) = (-1.0, -1.0, -1.0, -1.0), // nothing
        4 => {}                                                   // 0 everywhere
        5 => (q[0], q[1], q[2]) = (-1.0, 1.0, -1.0),              // a cone, its tip in the middle
        _ => q[3] = 1.0,                                          // two planes that cross
    }
    let faces = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z];
    let cut = faces.map(|normal| Form::HalfSpace { normal, offset: 1.0 });
    of_form(Form::Intersection([vec![Form::Quadric(Quadric(q))], cut.to_vec()].concat()), front())
}

/// A ball with a dent that reaches so far into it.
fn rim(overlap: f64) -> Setup {
    // A dent that reaches in by little is as deep as the square of it: weight makes up for that.
    let center = DVec3::new(0.3, 0.5, 1.0).normalize_or(DVec3::Z) * (1.3 - overlap);
    let term = Perturbation { weight: -0.5 / overlap, power: Power::Square, function: ball(center, 0.3) };
    of_form(Form::Perturbed { base: Box::new(ball(DVec3::ZERO, 1.0)), terms: vec![term] }, front())
}

/// A disc so thin, with bumps on it.
fn disc(thickness: f64) -> Setup {
    let bump = |x: f64, y: f64, weight: f64| Perturbation {
        weight,
        power: Power::Square,
        function: ball(DVec3::new(x, y, 0.0), 0.4),
    };
    let base = Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::new(1.0, 0.8, thickness) };
    let terms = vec![bump(0.3, 0.2, 0.5), bump(-0.4, 0.1, -0.4), bump(0.1, -0.4, 0.7)];
    of_form(Form::Perturbed { base: Box::new(base), terms }, front())
}

/// A ball with so many bumps and dents, all of quadrics.
fn rugged(count: f64) -> Setup {
    let term = |i: u32| {
        let height = 1.0 - 2.0 * (f64::from(i) + 0.5) / count;
        let (angle, around) = (f64::from(i) * 2.399_963, (1.0 - height * height).sqrt());
        let center = DVec3::new(around * angle.cos(), height, around * angle.sin());
        let weight = if i.is_multiple_of(2) { 0.6 } else { -0.8 };
        Perturbation { weight, power: Power::Square, function: ball(center, 1.6 / count.sqrt().max(2.0)) }
    };
    let terms = (0..count as u32).map(term).collect();
    of_form(Form::Perturbed { base: Box::new(ball(DVec3::ZERO, 1.0)), terms }, front())
}

/// A ball with a bump that is bent by a bump, and so on.
fn recursion(depth: f64) -> Setup {
    let mut form = ball(DVec3::new(0.4, 0.5, 0.7), 0.3);
    for level in 0..depth as u32 {
        let turn = f64::from(level) * 2.4;
        let center = DVec3::new(turn.cos() * 0.4, turn.sin() * 0.4, 0.5);
        let base = if level + 1 == depth as u32 { ball(DVec3::ZERO, 1.0) } else { ball(center, 0.5) };
        let weight = if level % 2 == 0 { 0.6 } else { -0.5 };
        let term = Perturbation { weight, power: Power::Square, function: form };
        form = Form::Perturbed { base: Box::new(base), terms: vec![term] };
    }
    of_form(form, front())
}

/// A ball with so many bumps.
fn bumps(count: f64) -> Setup {
    let term = |i: u32| {
        let height = 1.0 - 2.0 * (f64::from(i) + 0.5) / count;
        let (angle, around) = (f64::from(i) * 2.399_963, (1.0 - height * height).sqrt());
        let center = DVec3::new(around * angle.cos(), height, around * angle.sin());
        let function = ball(center, 1.2 / count.sqrt().max(2.0));
        Perturbation { weight: 0.3, power: Power::Square, function }
    };
    let terms = (0..count as u32).map(term).collect();
    of_form(Form::Perturbed { base: Box::new(ball(DVec3::ZERO, 1.0)), terms }, front())
}

fn hilly(columns: u32, rows: u32) -> Option<HeightField> {
    let height = |i: u32| {
        let (x, z) = (f64::from(i % columns) / f64::from(columns), f64::from(i / columns) / f64::from(rows));
        (0.4 * (x * 7.0).sin() * (z * 5.0).cos() + 0.1 * (x * 23.0).sin()) as f32
    };
    HeightField::new(columns, rows, DVec2::splat(4.0), (0..columns * rows).map(height).collect()).ok()
}

fn of_heights(field: Option<HeightField>, camera: Camera) -> Setup {
    let mut scene = studio();
    scene.objects.extend(field.map(|f| Object::new("hills", Shape::HeightField(f), 0)));
    setup(scene, camera)
}

fn hills(columns: u32, rows: u32) -> Setup {
    of_heights(hilly(columns, rows), look(DVec3::new(0.5, 2.2, 4.5), DVec3::ZERO, 0.8))
}

/// Hills from above: parallel rays, each fourth of which runs along a line of the grid.
fn vertical_heights(degrees: f64) -> Setup {
    let tilt = degrees.to_radians();
    let eye = DVec3::new(tilt.sin() * 5.0, tilt.cos() * 5.0, 0.0);
    let view = Projection::Orthographic { height: 4.5 };
    of_heights(hilly(33, 33), Camera::look_at(eye, DVec3::ZERO, -DVec3::Z, view))
}

/// The eye so far above a point of the hills.
fn under_heights(gap: f64) -> Setup {
    let field = hilly(65, 65);
    let ground = field.as_ref().map_or(0.0, |f| f.height_and_normal(0.31, 0.52).0);
    let eye = DVec3::new(0.31, ground + gap, 0.52);
    of_heights(field, look(eye, DVec3::new(-1.2, ground + gap * 0.2, -1.5), 0.9))
}

fn of_volume(samples: impl Fn(DVec3) -> f32, camera: Camera) -> Setup {
    of_padded_volume(0, samples, camera)
}

/// A volume with so many empty layers before it along each axis; what is in it stays where it was.
fn of_padded_volume(layers: u32, samples: impl Fn(DVec3) -> f32, camera: Camera) -> Setup {
    let edge = 33 + layers;
    let value = |i: u32| {
        let cell = [i % edge, i / edge % edge, i / (edge * edge)].map(|c| f64::from(c) - f64::from(layers));
        if cell.iter().any(|c| *c < 0.0) {
            return 0.0;
        }
        samples((DVec3::from_array(cell) - 16.0) / 16.0)
    };
    let samples = Samples::F32((0..edge.pow(3)).map(value).collect());
    let mut scene = studio();
    if let Ok(mut volume) = Volume::new([edge; 3], DVec3::splat(2.0 / 32.0), samples) {
        let point = |value: f32, color: Vec3, opacity: f32| TransferPoint { value, color, opacity };
        volume.transfer = TransferFunction {
            points: vec![
                point(0.0, Vec3::new(0.9, 0.4, 0.2), 0.0),
                point(0.45, Vec3::new(0.9, 0.5, 0.2), 0.02),
                point(0.5, Vec3::new(0.9, 0.9, 0.9), 0.5),
                point(0.55, Vec3::new(0.2, 0.4, 0.9), 0.05),
                point(1.0, Vec3::new(0.3, 0.5, 0.9), 0.3),
            ],
            reference_length: 2.0 / 32.0,
        };
        let corner = -volume.bounds().center() - DVec3::splat(f64::from(layers) / 32.0);
        scene.objects.push(Object::new("cloud", Shape::Volume(volume), 0).at(corner));
    }
    setup(scene, camera)
}

/// A ball that is denser inside, with a thin layer that stands out: what long steps miss.
fn volume_step(step: f64) -> Setup {
    let mut setup = of_volume(|p| (1.0 - p.length() * 0.9).clamp(0.0, 1.0) as f32, front());
    setup.settings.push(("volume.step", step.to_string()));
    setup.ruler_settings.push(("volume.step", "0.05".to_owned()));
    // A ruler of steps so small is slow, and color changes gently across a cloud.
    (setup.need.width, setup.need.height) =
        (super::super::scenes::WIDTH * 2 / 3, super::super::scenes::HEIGHT * 2 / 3);
    setup
}

/// A ball of haze around a layer that stands out, with so many empty layers of samples before it.
fn padded_cloud(layers: f64) -> Setup {
    of_padded_volume(layers as u32, |p| (0.9 - p.length()).clamp(0.0, 1.0) as f32, front())
}

/// The same value everywhere, so that no gradient says where the surface faces, seen along an axis.
fn volume_slabs(degrees: f64) -> Setup {
    let tilt = degrees.to_radians();
    let eye = DVec3::new(tilt.sin(), 0.0, tilt.cos()) * 4.0;
    let view = Projection::Orthographic { height: 2.4 };
    of_volume(|_| 0.3, Camera::look_at(eye, DVec3::ZERO, DVec3::Y, view))
}
