//! Where does a ray first enter a form of perturbed quadrics? Told by counting roots, which no search can miss.
//!
//! Along a ray a quadric is a polynomial of degree two, and its perturbation, where it is not zero, one of degree four. Between
//! the roots of the perturbations the sum of all is one polynomial, and the number of its roots in a stretch is the loss of
//! sign changes in its Sturm sequence. Bisection by that number ends at the first root, double ones not left out.
//!
//! **Source:** C. Sturm, *Mémoire sur la résolution des équations numériques*, 1829.

use crate::prelude::{DVec3, Form};
use crate::scene::Quadric;

/// Coefficients, that of the constant first.
type Polynomial = [f64; 5];

/// What is smaller than this share of the largest coefficient is rounding, and no coefficient.
const ROUNDING: f64 = 1e-13;

/// No form reaches as far behind its middle, meters.
const FAR: f64 = 1e3;

/// Returns how far along a ray a form begins; nothing where it is not met. `direction` is a unit vector; the eye is outside.
/// Forms that are not a quadric with quadrics as perturbations, squared, have none either.
pub(super) fn first_root(form: &Form, origin: DVec3, direction: DVec3) -> Option<f64> {
    let Form::Perturbed { base, terms } = form else { return None };
    let base = base.as_quadric()?;
    // Seen from the top of the base, and in units of its width there, all numbers are about one.
    let nearest = -origin.dot(direction);
    let bend = curve(&base, direction);
    let slope = base.gradient(origin + direction * nearest).dot(direction);
    let (top, unit) =
        if bend == 0.0 { (nearest, 1.0) } else { (nearest - 0.5 * slope / bend, bend.abs().sqrt().recip()) };
    let place = origin + direction * top;
    let along = |q: &Quadric| {
        [q.value(place), q.gradient(place).dot(direction) * unit, curve(q, direction) * unit * unit]
    };
    let terms: Option<Vec<([f64; 3], f64)>> =
        terms.iter().map(|t| Some((along(&t.function.as_quadric()?), t.weight))).collect();
    let (base, terms) = (along(&base), terms?);
    let ends = [-top / unit, FAR / unit];
    let mut borders: Vec<f64> = terms.iter().flat_map(|(q, _)| quadratic_roots(q)).flatten().collect();
    borders.extend(ends);
    borders.retain(|b| (ends[0]..=ends[1]).contains(b));
    borders.sort_unstable_by(f64::total_cmp);
    borders.windows(2).find_map(|ends| {
        let middle = (ends[0] + ends[1]) * 0.5;
        let mut sum = [base[0], base[1], base[2], 0.0, 0.0];
        for (q, weight) in &terms {
            if value(q, middle) > 0.0 {
                for i in 0..3 {
                    for j in 0..3 {
                        sum[i + j] += weight * q[i] * q[j];
                    }
                }
            }
        }
        first_between(&sum, ends[0], ends[1]).map(|s| s * unit + top)
    })
}

/// Returns half of the second derivative along a line.
fn curve(q: &Quadric, d: DVec3) -> f64 {
    let [a, b, c, xy, xz, yz, ..] = q.0;
    a * d.x * d.x + b * d.y * d.y + c * d.z * d.z + xy * d.x * d.y + xz * d.x * d.z + yz * d.y * d.z
}

fn value(p: &[f64], s: f64) -> f64 {
    p.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

/// Returns the roots of a quadratic, without taking differences of what is nearly equal.
fn quadratic_roots(&[c, b, a]: &[f64; 3]) -> [Option<f64>; 2] {
    let under = b * b - 4.0 * a * c;
    if under < 0.0 {
        return [None; 2];
    }
    let q = -0.5 * (b + under.sqrt().copysign(b));
    [q / a, c / q].map(|root| Some(root).filter(|r| r.is_finite()))
}

/// Returns the first root in `(low, high]`, or `low` where the function is not negative already.
fn first_between(p: &Polynomial, low: f64, high: f64) -> Option<f64> {
    if value(p, low) >= 0.0 {
        return Some(low);
    }
    let chain = sturm(p);
    let before = changes(&chain, low);
    if before <= changes(&chain, high) {
        return None;
    }
    let (mut low, mut high) = (low, high);
    // Halved until nothing lies between.
    for _ in 0..200 {
        let middle = (low + high) * 0.5;
        if middle <= low || middle >= high {
            break;
        }
        if changes(&chain, middle) < before { high = middle } else { low = middle }
    }
    Some(high)
}

/// Returns the polynomial, its derivative, and the negated remainders of their divisions.
fn sturm(p: &Polynomial) -> Vec<Polynomial> {
    let mut slope = [0.0; 5];
    for i in 1..5 {
        slope[i - 1] = p[i] * i as f64;
    }
    let mut chain = vec![scaled(p), scaled(&slope)];
    while let [.., before, last] = chain.as_slice()
        && degree(last) > 0
    {
        let rest = remainder(before, last).map(|c| -c);
        if degree(&rest) == 0 && rest[0].abs() <= ROUNDING {
            break;
        }
        chain.push(scaled(&rest));
    }
    chain
}

/// Divides by the largest coefficient, which changes no sign.
fn scaled(p: &Polynomial) -> Polynomial {
    let largest = p.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    if largest > 0.0 { p.map(|c| c / largest) } else { *p }
}

fn degree(p: &Polynomial) -> usize {
    (1..5).rev().find(|&i| p[i].abs() > ROUNDING).unwrap_or(0)
}

fn remainder(p: &Polynomial, by: &Polynomial) -> Polynomial {
    let (mut rest, low) = (*p, degree(by));
    for high in (low..5).rev() {
        let share = rest[high] / by[low];
        for i in 0..=low {
            rest[high - low + i] -= share * by[i];
        }
        rest[high] = 0.0;
    }
    rest
}

/// Counts how often the signs of a chain change at a place.
fn changes(chain: &[Polynomial], s: f64) -> usize {
    let signs = chain.iter().map(|p| value(p, s)).filter(|v| *v != 0.0).map(f64::is_sign_negative);
    signs.fold((0, None), |(n, last), sign| (n + usize::from(last.is_some_and(|l| l != sign)), Some(sign))).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Perturbation, Power};

    #[test]
    fn the_first_of_many_roots_is_found_and_a_double_one_too() {
        // (s - 1)(s - 1.0000001)(s - 2)(s + 3), which is negative before -3 when negated.
        let product = |roots: &[f64]| {
            let mut p = [1.0, 0.0, 0.0, 0.0, 0.0];
            for (n, r) in roots.iter().enumerate() {
                for i in (0..=n + 1).rev() {
                    p[i] = if i > 0 { p[i - 1] } else { 0.0 } - r * p[i];
                }
            }
            p.map(|c: f64| -c)
        };
        let first = |roots: &[f64], low: f64| first_between(&product(roots), low, 10.0);
        assert!((first(&[1.0, 1.001, 2.0, -3.0], -9.0).unwrap() + 3.0).abs() < 1e-12);
        let near = first(&[1.0, 1.000_01, 2.5, 3.5], 0.0).unwrap();
        assert!((near - 1.0).abs() < 1e-9, "{near}");
        let double = first(&[2.0, 2.0], 0.0).unwrap();
        assert!((double - 2.0).abs() < 1e-6, "{double}");
        assert_eq!(first(&[1.0, 2.0], 4.0), None);
    }

    #[test]
    fn a_perturbed_ball_is_met_where_its_equation_says() {
        let ball = |radius: f64| Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::splat(radius) };
        let term = Perturbation { weight: 0.5, power: Power::Square, function: ball(2.0) };
        let form = Form::Perturbed { base: Box::new(ball(1.0)), terms: vec![term] };
        // With u = r^2: 1 - u + (1 - u / 4)^2 / 2 = 0, so u^2 - 40 u + 48 = 0.
        let exact = 10.0 - (20.0 - 352f64.sqrt()).sqrt();
        let met = first_root(&form, DVec3::Z * 10.0, DVec3::NEG_Z).unwrap();
        assert!((met - exact).abs() < 1e-12, "{met} for {exact}");
        assert_eq!(first_root(&form, DVec3::new(3.0, 0.0, 10.0), DVec3::NEG_Z), None);
    }
}
