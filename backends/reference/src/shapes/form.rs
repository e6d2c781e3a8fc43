//! Where does a ray cross the zero surface of a free form, with no crossing missed?
//!
//! Interval bisection along the ray (after D. P. Mitchell, *Robust ray intersection with interval arithmetic*,
//! Graphics Interface 1990): a stretch is dropped when bounds of the function exclude zero, solved when bounds
//! of the slope do, and halved otherwise.
//!
//! **Accuracy**: a pair of crossings closer together than 1e-12 of the ray's way through the bounds may be
//! taken for a touch, and touches are no crossings. The ray is measured from the middle of that way, so that
//! far eyes cost no digits.

use super::function::Function;
use crate::line::{Hit, Line, Span};
use crate::roots::bracketed_root;
use glam::DVec3;
use polyptych_core::math::Aabb;
use polyptych_core::scene::FreeForm;

/// Stretches shorter than this share of the whole are not halved any further.
const SHORTEST: f64 = 1e-12;
/// After so many stretches without an end the shortest grows: only forms that vanish on whole stretches of a
/// ray come here (a double plane seen edge-on), and there a crossing means nothing.
const PATIENCE: u32 = 20_000;
/// One entry for each halving down to [`SHORTEST`], with room to spare.
const STACK: usize = 64;
/// A form made ready for evaluation along rays.
#[derive(Debug)]
pub(crate) struct Solid {
    function: Function,
    bounds: Aabb,
}

impl Solid {
    pub(crate) fn new(form: &FreeForm) -> Self {
        // Surfaces that lie in the faces of the bounds must be well inside.
        let bounds = form.bounds();
        Self { function: Function::new(form.form()), bounds: bounds.grown(bounds.radius() * 1e-6) }
    }

    pub(crate) fn first(
        &self,
        form: &FreeForm,
        line: &Line,
        span: &Span,
        accept: &mut impl FnMut(&Hit) -> bool,
    ) -> Option<Hit> {
        let mut found = None;
        let mut part = 0;
        self.crossings(line, span.before, &mut |t, p| {
            let hit = Hit::plain(t, part, DVec3::ZERO);
            part += 1;
            if span.holds(t, hit.part) {
                let hit = Hit { normal: -form.form().value_and_gradient(p).1, ..hit };
                if accept(&hit) {
                    found = Some(hit);
                }
            }
            found.is_none() && t < span.before
        });
        found
    }

    /// Tells whether a point is inside.
    pub(crate) fn contains(&self, point: DVec3) -> bool {
        self.function.on(point, DVec3::ZERO, 0.0).middle >= 0.0
    }

    /// Calls `visit` with distance and place of every crossing before a distance, in order, while it returns
    /// true.
    pub(crate) fn crossings(&self, line: &Line, before: f64, visit: &mut impl FnMut(f64, DVec3) -> bool) {
        let Some((near, far)) = self.bounds.clip(line.origin, line.direction) else { return };
        if !(near <= before && (far - near).is_finite()) {
            return;
        }
        let middle = near * 0.5 + far * 0.5;
        let local = Line { origin: line.at(middle), ..*line };
        let half = (far - near) * 0.5;
        self.isolate(&local, -half, half, &mut |s| visit(middle + s, local.at(s)));
    }

    fn isolate(&self, line: &Line, from: f64, to: f64, visit: &mut impl FnMut(f64) -> bool) {
        let on = |a: f64, b: f64| self.function.on(line.at(a * 0.5 + b * 0.5), line.direction, (b - a) * 0.5);
        let at = |s: f64| self.function.on(line.at(s), line.direction, 0.0);
        let changes = |a: f64, b: f64| (at(a).middle >= 0.0) != (at(b).middle >= 0.0);
        let solve = |a: f64, b: f64| {
            bracketed_root(a, b, |s| {
                let jet = at(s);
                (jet.middle, (jet.slope.lo + jet.slope.hi) * 0.5)
            })
        };
        let mut shortest = SHORTEST * (to - from);
        let mut stack = [(0.0, 0.0); STACK];
        stack[0] = (from, to);
        let (mut height, mut count) = (1, 0u32);
        while height > 0 {
            height -= 1;
            count += 1;
            if count > PATIENCE && count.is_multiple_of(64) {
                shortest *= 2.0;
            }
            let (a, b) = stack[height];
            let jet = on(a, b);
            if jet.value.lo > 0.0 || jet.value.hi < 0.0 {
                continue;
            }
            let monotone = jet.slope.lo > 0.0 || jet.slope.hi < 0.0;
            if monotone || b - a <= shortest || height + 2 > STACK {
                if changes(a, b) && !visit(solve(a, b)) {
                    return;
                }
                continue;
            }
            let middle = a * 0.5 + b * 0.5;
            stack[height] = (middle, b);
            stack[height + 1] = (a, middle);
            height += 2;
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::line::Start;
    use polyptych_core::scene::{Form, Perturbation, Power, Quadric};

    pub(crate) fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    fn ball(center: [f64; 3], radius: f64) -> Form {
        Form::Ellipsoid { center: center.into(), radii: DVec3::splat(radius) }
    }

    /// A figure with every operation.
    pub(crate) fn everything() -> Form {
        let bump = Perturbation { weight: 0.9, power: Power::Cube, function: ball([0.8, 0.1, -0.2], 0.5) };
        let dent = Perturbation {
            weight: -0.7,
            power: Power::Square,
            function: Form::Perturbed {
                base: Box::new(ball([-0.6, 0.3, 0.5], 0.5)),
                terms: vec![bump.clone()],
            },
        };
        let bent = Form::Perturbed { base: Box::new(ball([0.0; 3], 1.0)), terms: vec![bump, dent] };
        let rod = Form::Cylinder { center: DVec3::ZERO, axis: DVec3::new(1.0, 1.0, 0.3), radius: 0.3 };
        let quadric = Quadric([-1.0, -2.0, -1.5, 0.3, 0.1, -0.2, 0.4, 0.0, 0.1, 0.8]);
        Form::Union(vec![
            Form::SmoothUnion {
                a: Box::new(bent),
                b: Box::new(Form::Torus { major: 1.3, minor: 0.2 }),
                k: 0.3,
            },
            Form::Difference(
                Box::new(Form::Intersection(vec![rod, ball([0.0; 3], 1.6)])),
                Box::new(Form::HalfSpace { normal: DVec3::Y, offset: 0.1 }),
            ),
            Form::Morph {
                from: Box::new(Form::Offset { form: Box::new(Form::Quadric(quadric)), amount: -0.3 }),
                to: Box::new(ball([1.2, 0.0, 0.0], 0.3)),
                t: 0.4,
            },
        ])
    }

    #[test]
    fn no_first_root_is_missed_against_dense_sampling() {
        let form = FreeForm::new(everything()).unwrap();
        let solid = Solid::new(&form);
        let mut s = 77;
        let (mut hits, mut close) = (0, 0);
        for _ in 0..800 {
            let mut v = || DVec3::new(random(&mut s), random(&mut s), random(&mut s));
            let origin = v().normalize_or(DVec3::X) * 4.0;
            let direction = (v() * 1.2 - origin).normalize_or(DVec3::X);
            let line = Line { origin, direction, start: Start::Eye };
            let found = solid.first(&form, &line, &Span::WHOLE, &mut |_| true).map(|h| h.t);
            // Sampling sees sign changes more than a step apart.
            let step = 1e-3;
            let sampled =
                (0..8000).map(|i| f64::from(i) * step).find(|&t| form.form().value(line.at(t)) >= 0.0);
            match (found, sampled) {
                (Some(t), Some(beyond)) => {
                    assert!(t <= beyond, "missed: {t} after {beyond} for {line:?}");
                    if t < beyond - step {
                        // Something thinner than a step: it must be real.
                        assert!(form.form().value(line.at(t + 1e-9)).abs() < 1e-6);
                        close += 1;
                    }
                    let value = form.form().value(line.at(t));
                    assert!(value.abs() < 1e-12, "{value} is not on the surface");
                    hits += 1;
                }
                (None, None) => {}
                (Some(t), None) => {
                    assert!(form.form().value(line.at(t)).abs() < 1e-12);
                    close += 1;
                }
                (None, Some(t)) => panic!("missed the solid at {t}: {line:?}"),
            }
        }
        assert!(hits > 400 && close < 10, "{hits} hits, {close} thinner than a step");
    }

    #[test]
    fn close_pairs_are_found_down_to_the_stated_distance() {
        // Grazing a ball: the two crossings are 2 sqrt(1 - y^2) apart.
        let form = FreeForm::new(ball([0.0; 3], 1.0)).unwrap();
        let solid = Solid::new(&form);
        for k in 1..=6 {
            let gap = 10f64.powi(-k);
            let y = (1.0 - gap * gap / 4.0).sqrt();
            let line = Line { origin: DVec3::new(-5.0, y, 0.0), direction: DVec3::X, start: Start::Eye };
            let mut places = Vec::new();
            solid.crossings(&line, f64::INFINITY, &mut |t, _| {
                places.push(t);
                true
            });
            assert_eq!(places.len(), 2, "gap {gap}");
            assert!(((places[1] - places[0]) / gap - 1.0).abs() < 1e-3 * 10f64.powi(k - 4).max(1.0), "{gap}");
        }
    }

    #[test]
    fn forms_that_vanish_along_a_ray_come_to_an_end() {
        let plane = Quadric([0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let cut = Aabb::new(DVec3::splat(-1.0), DVec3::splat(1.0));
        let form = FreeForm::within(Form::Quadric(plane), cut).unwrap();
        let solid = Solid::new(&form);
        for y in [0.0, 1e-9, -1e-17, 0.3] {
            let line = Line { origin: DVec3::new(-5.0, y, 0.0), direction: DVec3::X, start: Start::Eye };
            let hit = solid.first(&form, &line, &Span::WHOLE, &mut |_| true);
            assert!(hit.is_none_or(|h| h.t.is_finite()));
        }
    }
}
