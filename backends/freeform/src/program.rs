//! A free form as a list of steps for a stack machine, and which of them matter in a part of space.

use glam::{DMat3, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8};
use polyptych_core::math::{Aabb, Interval};
use polyptych_core::scene::{Form, Perturbation, Power, Quadric};

/// One step. Functions are pushed on a stack; combinations take theirs from it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    /// Pushes a quadric by its index.
    Leaf(u32),
    /// Takes `q`, then adds `weight * R(q)` to what lies below.
    Term { weight: f64, power: Power },
    /// Adds `weight * R(q)` of a quadric: the perturbation that most forms are made of.
    Bump { leaf: u32, weight: f64, power: Power },
    /// Takes two, pushes the larger.
    Max,
    /// Takes two, pushes the smaller.
    Min,
    /// Changes the sign.
    Neg,
    /// Adds a constant.
    Add(f64),
    /// Takes two, pushes their smooth union.
    Smooth(f64),
    /// Takes `from` and `to`, pushes their mix.
    Mix(f64),
    /// Takes `s` and `flat`, pushes `ring * flat - s^2`.
    Torus(f64),
}

/// A form as steps in postfix order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Program {
    pub(crate) steps: Vec<Step>,
    pub(crate) leaves: Vec<Quadric>,
    /// Where each leaf may be positive; everywhere unless it is an ellipsoid.
    pub(crate) supports: Vec<Aabb>,
    /// Most values on the stack at once.
    pub(crate) depth: usize,
}

impl Program {
    pub(crate) fn new(form: &Form) -> Self {
        let mut program = Self::default();
        program.push(form);
        let mut height = 0usize;
        for step in &program.steps {
            height = match step {
                Step::Leaf(_) => height + 1,
                Step::Neg | Step::Add(_) | Step::Bump { .. } => height,
                _ => height - 1,
            };
            program.depth = program.depth.max(height);
        }
        program
    }

    fn leaf(&mut self, quadric: Quadric) {
        self.steps.push(Step::Leaf(self.leaves.len() as u32));
        self.leaves.push(quadric);
        self.supports.push(support(&quadric));
    }

    fn push(&mut self, form: &Form) {
        if let Some(quadric) = form.as_quadric() {
            self.leaf(quadric);
            return;
        }
        match form {
            Form::Torus { major, minor } => {
                let (r2, m2) = (major * major, minor * minor);
                self.leaf(Quadric([1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]));
                self.leaf(Quadric([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, r2 - m2]));
                self.steps.push(Step::Torus(4.0 * r2));
            }
            Form::Perturbed { base, terms } => {
                self.push(base);
                for &Perturbation { weight, power, ref function } in terms {
                    self.push(function);
                    match self.steps.last_mut() {
                        Some(last @ &mut Step::Leaf(leaf)) if function.as_quadric().is_some() => {
                            *last = Step::Bump { leaf, weight, power };
                        }
                        _ => self.steps.push(Step::Term { weight, power }),
                    }
                }
            }
            Form::Union(parts) => self.combine(parts, Step::Max, f64::NEG_INFINITY),
            Form::Intersection(parts) => self.combine(parts, Step::Min, f64::INFINITY),
            Form::Difference(a, b) => {
                self.push(a);
                self.push(b);
                self.steps.extend([Step::Neg, Step::Min]);
            }
            Form::SmoothUnion { a, b, k } => {
                self.push(a);
                self.push(b);
                self.steps.push(Step::Smooth(*k));
            }
            Form::Offset { form, amount } => {
                self.push(form);
                self.steps.push(Step::Add(*amount));
            }
            Form::Morph { from, to, t } => {
                self.push(from);
                self.push(to);
                self.steps.push(Step::Mix(*t));
            }
            _ => {}
        }
    }

    fn combine(&mut self, parts: &[Form], step: Step, empty: f64) {
        if parts.is_empty() {
            // Nothing combined: everywhere or nowhere.
            let sign = empty.signum();
            self.leaf(Quadric([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, sign]));
        }
        for (i, part) in parts.iter().enumerate() {
            self.push(part);
            if i > 0 {
                self.steps.push(step);
            }
        }
    }
}

/// The steps that matter in a part of space, with the reason that the others do not: perturbations that are
/// zero there, and sides of a union or intersection that lose everywhere.
#[derive(Clone, Debug, Default)]
pub(crate) struct Active {
    pub(crate) steps: Vec<Step>,
    /// Where each value on the stack began in `steps`, with its bounds.
    stack: Vec<(usize, Interval)>,
}

impl Active {
    /// Keeps what matters in a box and returns the bounds of the form there. Allocates only when a program is
    /// longer than any before.
    pub(crate) fn prune(&mut self, program: &Program, from: &[Step], part: &Aabb) -> Interval {
        self.steps.clear();
        self.stack.clear();
        for &step in from {
            match step {
                Step::Leaf(leaf) => {
                    self.stack.push((self.steps.len(), program.leaves[leaf as usize].interval(part)));
                    self.steps.push(step);
                }
                Step::Term { weight, power } => {
                    if let Some((begin, q)) = self.stack.pop() {
                        self.add(q, weight, power, step);
                        if q.hi <= 0.0 {
                            self.steps.truncate(begin);
                        }
                    }
                }
                Step::Bump { leaf, weight, power } => {
                    if !program.supports[leaf as usize].intersection(*part).is_empty() {
                        self.add(program.leaves[leaf as usize].interval(part), weight, power, step);
                    }
                }
                Step::Max => self.select(step, |a, b| a.lo >= b.hi, Interval::max),
                Step::Min => self.select(step, |a, b| a.hi <= b.lo, Interval::min),
                Step::Neg => self.unary(step, |a| -a),
                Step::Add(amount) => self.unary(step, |a| a + Interval::point(amount)),
                Step::Smooth(k) => self.select(step, |a, b| a.lo - b.hi >= k, |a, b| smooth(a, b, k)),
                Step::Mix(t) => self.select(step, |_, _| false, |a, b| a * (1.0 - t) + b * t),
                Step::Torus(ring) => self.select(step, |_, _| false, |flat, s| flat * ring - s.square()),
            }
        }
        self.stack.first().map_or(Interval::point(-1.0), |top| top.1)
    }

    /// Adds a perturbation to what lies below, unless it is zero everywhere.
    fn add(&mut self, q: Interval, weight: f64, power: Power, step: Step) {
        if q.hi <= 0.0 {
            return;
        }
        let q = q.positive_part();
        let raised = match power {
            Power::Square => q.square(),
            Power::Cube => q.square() * q,
        };
        if let Some(base) = self.stack.last_mut() {
            base.1 = base.1 + raised * weight;
        }
        self.steps.push(step);
    }

    fn unary(&mut self, step: Step, apply: impl Fn(Interval) -> Interval) {
        if let Some(top) = self.stack.last_mut() {
            top.1 = apply(top.1);
        }
        self.steps.push(step);
    }

    /// Drops a side that loses everywhere: `wins(a, b)` tells that `a` alone decides.
    fn select(
        &mut self,
        step: Step,
        wins: impl Fn(Interval, Interval) -> bool,
        both: impl Fn(Interval, Interval) -> Interval,
    ) {
        let (Some((b_begin, b)), Some((a_begin, a))) = (self.stack.pop(), self.stack.pop()) else { return };
        if wins(a, b) {
            self.steps.truncate(b_begin);
            self.stack.push((a_begin, a));
        } else if wins(b, a) {
            self.steps.drain(a_begin..b_begin);
            self.stack.push((a_begin, b));
        } else {
            self.steps.push(step);
            self.stack.push((a_begin, both(a, b)));
        }
    }
}

/// Bounds where a quadric is positive: `v - (p - m)^T M (p - m)` with a positive definite `M` reaches
/// `sqrt(v (M^-1)_ii)` from its middle along axis `i`. Others reach everywhere.
fn support(quadric: &Quadric) -> Aabb {
    let everywhere = Aabb::new(DVec3::NEG_INFINITY, DVec3::INFINITY);
    let [a, b, c, d, e, f, ..] = quadric.0;
    let (d, e, f) = (0.5 * d, 0.5 * e, 0.5 * f);
    let bend = DMat3::from_cols(DVec3::new(-a, -d, -e), DVec3::new(-d, -b, -f), DVec3::new(-e, -f, -c));
    let minors = [-a, a * b - d * d, bend.determinant()];
    let scale = DVec3::new(a, b, c).abs().max_element();
    // Nearly flat ones are left alone: their inverse is rounded too much.
    let round = [1.0, scale, scale * scale].map(|s| 1e-6 * s * scale);
    if (0..3).any(|i| minors[i].is_nan() || minors[i] <= round[i]) {
        return everywhere;
    }
    let inverse = bend.inverse();
    let middle = inverse * quadric.gradient(DVec3::ZERO) * 0.5;
    let top = quadric.value(middle);
    let reach = |spread: f64| (top.max(0.0) * spread).sqrt();
    let half = DVec3::new(reach(inverse.x_axis.x), reach(inverse.y_axis.y), reach(inverse.z_axis.z));
    // The value at the middle was rounded in terms as large as these.
    let size = quadric.0[9].abs() + middle.abs().dot(bend.abs() * middle.abs());
    let slack = (size * 1e-12 * inverse.x_axis.x.max(inverse.y_axis.y).max(inverse.z_axis.z)).sqrt();
    let all = Aabb::new(middle - half, middle + half).grown(half.max_element() * 1e-6 + slack);
    if all.min.is_finite() && all.max.is_finite() { all } else { everywhere }
}

fn smooth(a: Interval, b: Interval, k: f64) -> Interval {
    let gap = a - b;
    let nearest = if gap.contains(0.0) { 0.0 } else { gap.lo.abs().min(gap.hi.abs()) };
    let farthest = gap.lo.abs().max(gap.hi.abs());
    let fillet = |gap: f64| (k - gap).max(0.0).powi(2) / (4.0 * k);
    a.max(b) + Interval::new(fillet(farthest), fillet(nearest))
}

/// Evaluates steps and their gradients at eight points, in double precision.
#[inline(always)]
pub(crate) fn values_and_gradients(
    program: &Program,
    steps: &[Step],
    p: DVec3x8,
    stack: &mut Vec<(F64x8, DVec3x8)>,
) -> (F64x8, DVec3x8) {
    let quadric = |leaf: u32| value_and_gradient(&program.leaves[leaf as usize].0, p);
    let number = F64x8::splat;
    stack.clear();
    // The top of the stack.
    let (mut b, mut db) = (number(-1.0), DVec3x8::splat(DVec3::ZERO));
    for (i, &step) in steps.iter().enumerate() {
        match step {
            Step::Leaf(leaf) => {
                if i > 0 {
                    stack.push((b, db));
                }
                (b, db) = quadric(leaf);
                continue;
            }
            Step::Bump { leaf, weight, power } => {
                let (q, dq) = quadric(leaf);
                let (r, slope) = raised(q, weight, power);
                (b, db) = (b + r, db + dq.scaled(slope));
                continue;
            }
            Step::Neg => {
                (b, db) = (-b, db.scaled(number(-1.0)));
                continue;
            }
            Step::Add(amount) => {
                b = b + number(amount);
                continue;
            }
            _ => {}
        }
        let Some((a, da)) = stack.pop() else { break };
        (b, db) = match step {
            Step::Term { weight, power } => {
                let (r, slope) = raised(b, weight, power);
                (a + r, da + db.scaled(slope))
            }
            Step::Max => {
                let first = a.at_least(b);
                (F64x8::pick(first, a, b), DVec3x8::pick(first, da, db))
            }
            Step::Min => {
                let first = b.at_least(a);
                (F64x8::pick(first, a, b), DVec3x8::pick(first, da, db))
            }
            Step::Smooth(k) => {
                let first = a.at_least(b);
                let (top, low) = (F64x8::pick(first, a, b), F64x8::pick(first, b, a));
                let (dtop, dlow) = (DVec3x8::pick(first, da, db), DVec3x8::pick(first, db, da));
                let overlap = (number(k) - (top - low)).max(F64x8::ZERO);
                let share = overlap * number(0.5 / k);
                (top + overlap * overlap * number(0.25 / k), dtop + (dlow - dtop).scaled(share))
            }
            Step::Mix(t) => {
                let (s, t) = (number(1.0 - t), number(t));
                (a * s + b * t, da.scaled(s) + db.scaled(t))
            }
            Step::Torus(ring) => {
                let ring = number(ring);
                (ring * a - b * b, da.scaled(ring) - db.scaled(b + b))
            }
            Step::Leaf(_) | Step::Bump { .. } | Step::Neg | Step::Add(_) => (b, db),
        };
    }
    (b, db)
}

#[inline(always)]
fn value_and_gradient(q: &[f64; 10], p: DVec3x8) -> (F64x8, DVec3x8) {
    let [qa, qb, qc, qd, qe, qf, qg, qh, qi, qk] = q.map(F64x8::splat);
    let DVec3x8 { x, y, z } = p;
    let (ax, by, cz) = (qa * x, qb * y, qc * z);
    let (dx, dy, ex, ez, fy, fz) = (qd * x, qd * y, qe * x, qe * z, qf * y, qf * z);
    let gradient =
        DVec3x8 { x: ax + ax + dy + ez + qg, y: by + by + dx + fz + qh, z: cz + cz + ex + fy + qi };
    (x * (ax + dy + ez + qg) + y * (by + fz + qh) + z * (cz + qi) + qk, gradient)
}

/// Returns `weight * R(q)` and its slope.
#[inline(always)]
fn raised(q: F64x8, weight: f64, power: Power) -> (F64x8, F64x8) {
    let (q, w) = (q.max(F64x8::ZERO), F64x8::splat(weight));
    match power {
        Power::Square => (w * (q * q), w * (q + q)),
        Power::Cube => (w * (q * q * q), w * (F64x8::splat(3.0) * (q * q))),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A figure that uses every step.
    pub(crate) fn everything() -> Form {
        let ball =
            |x: f64, r: f64| Form::Ellipsoid { center: DVec3::new(x, 0.1, -0.2), radii: DVec3::splat(r) };
        let bump = Perturbation { weight: 0.7, power: Power::Cube, function: ball(0.8, 0.5) };
        let dent = Perturbation {
            weight: -0.4,
            power: Power::Square,
            function: Form::Perturbed { base: Box::new(ball(-0.6, 0.4)), terms: vec![bump.clone()] },
        };
        Form::Union(vec![
            Form::SmoothUnion {
                a: Box::new(Form::Perturbed { base: Box::new(ball(0.0, 1.0)), terms: vec![bump, dent] }),
                b: Box::new(Form::Torus { major: 1.0, minor: 0.2 }),
                k: 0.3,
            },
            Form::Difference(
                Box::new(Form::Intersection(vec![
                    Form::Cylinder { center: DVec3::ZERO, axis: DVec3::new(1.0, 1.0, 0.3), radius: 0.4 },
                    ball(0.0, 1.5),
                ])),
                Box::new(Form::HalfSpace { normal: DVec3::Y, offset: 0.1 }),
            ),
            Form::Morph {
                from: Box::new(ball(1.0, 0.2)),
                to: Box::new(Form::Offset { form: Box::new(ball(1.2, 0.3)), amount: 0.05 }),
                t: 0.4,
            },
        ])
    }

    #[test]
    fn a_pruned_program_has_the_same_values_in_its_box() {
        let form = everything();
        let program = Program::new(&form);
        let mut active = Active::default();
        let mut stack = Vec::new();
        let mut shorter = 0;
        for i in 0..400 {
            let place = |k: i32| f64::from((i * k) % 97) / 48.5 - 1.0;
            let middle = DVec3::new(place(17), place(29), place(41)) * 1.5;
            let part = Aabb::new(middle - 0.1, middle + 0.1);
            let bounds = active.prune(&program, &program.steps, &part);
            shorter += usize::from(active.steps.len() < program.steps.len());
            let corners = part.corners();
            let mut points = DVec3x8::splat(DVec3::ZERO);
            corners.iter().enumerate().for_each(|(i, c)| points.set(i, *c));
            let (values, gradients) = values_and_gradients(&program, &active.steps, points, &mut stack);
            for (i, corner) in corners.into_iter().enumerate() {
                let (value, gradient) = (values.0[i], gradients.get(i));
                let (exact, slope) = form.value_and_gradient(corner);
                assert!(
                    (value - exact).abs() <= 1e-12 * (1.0 + exact.abs()),
                    "{value} for {exact} at {corner}"
                );
                assert!((gradient - slope).length() <= 1e-9 * (1.0 + slope.length()) || value == 0.0);
                assert!(bounds.contains(value));
            }
        }
        assert!(shorter > 300, "pruning does something: {shorter} of 400");
    }
}
