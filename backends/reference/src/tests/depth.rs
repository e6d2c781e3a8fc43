//! Are surfaces where they should be?

use super::*;
use crate::line::{Line, Span, Start};
use crate::shapes::Geometry;

const BODIES: [Primitive; 8] = [
    Primitive::Box { size: DVec3::new(1.0, 2.0, 0.5) },
    Primitive::Sphere { radius: 1.0 },
    Primitive::Cylinder { radius: 0.7, height: 1.5 },
    Primitive::Cone { radius: 0.9, height: 1.3 },
    Primitive::Torus { major: 1.0, minor: 0.3 },
    Primitive::Frustum { sides: 7, lower_radius: 1.0, upper_radius: 0.4, height: 1.2 },
    Primitive::Frustum { sides: 3, lower_radius: 0.0, upper_radius: 1.0, height: 0.8 },
    Primitive::Frustum { sides: 4096, lower_radius: 1.0, upper_radius: 1.0, height: 1.0 },
];

fn line(origin: DVec3, direction: DVec3) -> Line {
    Line { origin, direction, start: Start::Eye }
}

fn first(geometry: &Geometry, line: &Line) -> Option<(f64, DVec3)> {
    geometry.first(line, &Span::WHOLE, &mut |_| true).map(|h| (h.t, h.normal.normalize_or_zero()))
}

/// A point of the surface with its outward normal: where a ray from the middle of the body comes out.
fn surface_point(geometry: &Geometry, form: &Form, state: &mut u64) -> (DVec3, DVec3) {
    let Shape::Primitive(body) = &*geometry.shape else { panic!("a primitive") };
    let center = match *body {
        Primitive::Torus { major, .. } => {
            let a = random(state) * 3.2;
            DVec3::new(a.cos(), 0.0, a.sin()) * major
        }
        _ => DVec3::new(0.0, 0.05, 0.0),
    };
    let direction = unit(state);
    // Bisection on the implicit function, which this module does not use for primitives.
    let (mut a, mut b) = (0.0, 0.0);
    while form.value(center + direction * b) >= 0.0 {
        (a, b) = (b, b + 0.05);
    }
    for _ in 0..80 {
        let m = 0.5 * (a + b);
        if form.value(center + direction * m) >= 0.0 { a = m } else { b = m }
    }
    let p = center + direction * a;
    (p, -form.value_and_gradient(p).1.normalize_or_zero())
}

#[test]
fn every_body_is_met_where_its_surface_is_even_from_afar() {
    let mut s = 1234;
    for body in BODIES {
        let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
        let form = body.form().unwrap();
        let convex = !matches!(body, Primitive::Torus { .. });
        for distance in [3.0, 1e3, 1e6] {
            // 4096 faces make the implicit function slow.
            let many = matches!(body, Primitive::Frustum { sides: 4096, .. });
            for _ in 0..if many { 12 } else { 400 } {
                let (point, normal) = surface_point(&geometry, &form, &mut s);
                let mut direction = unit(&mut s);
                direction *= -direction.dot(normal).signum();
                if direction.dot(normal) > -0.01 {
                    continue;
                }
                let line = line(point - direction * distance, direction);
                let (t, n) = first(&geometry, &line).unwrap_or_else(|| panic!("{body:?}: {line:?} missed"));
                let error = (t - distance) / distance;
                assert!(error < 1e-9, "{body:?} from {distance}: behind the surface by {error:e}");
                if convex {
                    assert!(error.abs() < 1e-9, "{body:?} from {distance}: {error:e}");
                    let turn = (n - normal).length();
                    assert!(turn < 1e-4 || form_is_creased(&form, point), "{body:?}: normal off by {turn}");
                } else {
                    let size = form.value_and_gradient(line.at(t)).1.length();
                    let off = form.value(line.at(t)).abs() / size;
                    assert!(off < 1e-9 * distance, "{body:?} from {distance}: off by {off:e}");
                }
            }
        }
    }
}

/// Tells whether two faces meet nearby.
fn form_is_creased(form: &Form, p: DVec3) -> bool {
    let normal = |p: DVec3| form.value_and_gradient(p).1.normalize_or_zero();
    (0..6).any(|i| {
        let step = DVec3::AXES[i % 3] * if i < 3 { 1e-3 } else { -1e-3 };
        (normal(p + step) - normal(p)).length() > 1e-2
    })
}

#[test]
fn a_body_and_its_free_form_are_met_at_the_same_distance() {
    let mut s = 4321;
    for body in BODIES.into_iter().take(7) {
        let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
        let form = FreeForm::from_primitive(&body).unwrap();
        let implicit = Geometry::new(&Arc::new(Shape::FreeForm(form)));
        let (mut both, mut one) = (0, 0);
        for i in 0..1500 {
            let distance = [2.5, 40.0, 1e5][i % 3];
            let origin = unit(&mut s) * distance;
            let target = DVec3::new(random(&mut s), random(&mut s), random(&mut s)) * 1.1;
            let line = line(origin, (target - origin).normalize_or(DVec3::X));
            match (first(&geometry, &line), first(&implicit, &line)) {
                (Some((a, m)), Some((b, n))) => {
                    let slant = m.dot(line.direction).abs().max(1e-4);
                    let error = (a - b).abs() / a * slant;
                    assert!(error < 1e-9, "{body:?}: {a} and {b} for {line:?}");
                    assert!((m - n).length() < 1e-3 || both > 0, "{body:?}: {m} and {n}");
                    both += 1;
                }
                (None, None) => {}
                _ => one += 1,
            }
        }
        assert!(both > 300 && one <= 2, "{body:?}: {both} by both, {one} by one only");
    }
}

#[test]
fn a_torus_has_as_many_crossings_as_by_dense_sampling() {
    let body = Primitive::Torus { major: 1.0, minor: 0.35 };
    let geometry = Geometry::new(&Arc::new(Shape::Primitive(body)));
    let form = body.form().unwrap();
    let mut s = 8;
    let mut four = 0;
    for _ in 0..1000 {
        let origin = unit(&mut s) * 4.0;
        let target = DVec3::new(random(&mut s), 0.3 * random(&mut s), random(&mut s));
        let line = line(origin, (target - origin).normalize_or(DVec3::X));
        let mut found = Vec::new();
        geometry.first(&line, &Span::WHOLE, &mut |h| {
            found.push(h.t);
            false
        });
        let step = 2e-3;
        let inside = |i: i32| form.value(line.at(f64::from(i) * step)) >= 0.0;
        let changes = (0..4000).filter(|&i| inside(i) != inside(i + 1)).count();
        assert!(found.len() >= changes && (found.len() - changes).is_multiple_of(2));
        // More than sampling sees only where a pair is closer than a step.
        if found.len() > changes {
            assert!(found.windows(2).any(|w| w[1] - w[0] < step), "{found:?}");
        }
        assert!(found.windows(2).all(|w| w[0] < w[1]));
        four += usize::from(found.len() == 4);
    }
    assert!(four > 30, "{four}");
}
