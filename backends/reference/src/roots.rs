//! Where does a function of one variable change its sign?

/// Finds the sign change in `[a, b]` by Newton's method held inside a shrinking bracket.
///
/// `f` returns value and slope; its signs at `a` and `b` must differ (0 counts as positive). Where Newton's
/// steps do not halve the bracket in three steps, the bracket is halved. Ends within a few units in the last
/// place of the numbers involved.
pub(crate) fn bracketed_root(mut a: f64, mut b: f64, f: impl Fn(f64) -> (f64, f64)) -> f64 {
    let positive_at_a = f(a).0 >= 0.0;
    let mut x = 0.5 * (a + b);
    let (mut width, mut slow) = (b - a, 0);
    for _ in 0..200 {
        let (value, slope) = f(x);
        if value == 0.0 {
            return x;
        }
        if (value >= 0.0) == positive_at_a {
            a = x;
        } else {
            b = x;
        }
        slow = if b - a <= 0.5 * width { 0 } else { slow + 1 };
        if slow == 0 {
            width = b - a;
        }
        let newton = x - value / slope;
        let next = if newton > a && newton < b && slow < 3 { newton } else { 0.5 * (a + b) };
        if slow >= 3 {
            slow = 0;
            width = b - a;
        }
        let unit = f64::EPSILON * a.abs().max(b.abs());
        if (next - x).abs() <= unit || b - a <= 2.0 * unit {
            return next;
        }
        x = next;
    }
    x
}

/// Finds the real roots of odd order of a polynomial of degree 4 or less in `[lo, hi]`, in rising order.
///
/// `c[i]` is the factor of `x^i`. Between neighboring roots of the derivative, found in the same way, the
/// polynomial is monotone, so each sign change is one root and none is missed; points where it only touches
/// zero are none.
pub(crate) fn polynomial_roots(c: &[f64; 5], lo: f64, hi: f64) -> Roots {
    let degree = (0..5).rev().find(|&i| c[i] != 0.0).unwrap_or(0);
    roots_of_degree(c, degree, lo, hi)
}

/// Up to four roots.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Roots {
    places: [f64; 4],
    count: usize,
}

impl Roots {
    pub(crate) fn as_slice(&self) -> &[f64] {
        &self.places[..self.count]
    }
}

fn roots_of_degree(c: &[f64; 5], degree: usize, lo: f64, hi: f64) -> Roots {
    let mut roots = Roots::default();
    if degree == 0 {
        return roots;
    }
    let mut derivative = [0.0; 5];
    for i in 1..=degree {
        derivative[i - 1] = c[i] * i as f64;
    }
    let turns = roots_of_degree(&derivative, degree - 1, lo, hi);
    let value = |x: f64| c[..=degree].iter().rev().fold(0.0, |sum, c| sum * x + c);
    let slope = |x: f64| derivative[..degree].iter().rev().fold(0.0, |sum, c| sum * x + c);
    let mut a = lo;
    for b in turns.as_slice().iter().copied().chain([hi]) {
        if (value(a) >= 0.0) != (value(b) >= 0.0) && roots.count < 4 {
            roots.places[roots.count] = bracketed_root(a, b, |x| (value(x), slope(x)));
            roots.count += 1;
        }
        a = b;
    }
    roots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_roots_are_found_in_order() {
        // (x + 3)(x + 1)(x - 0.5)(x - 2)
        let c = [3.0, -3.5, -6.0, 1.5, 1.0];
        let roots = polynomial_roots(&c, -10.0, 10.0);
        for (found, exact) in roots.as_slice().iter().zip([-3.0, -1.0, 0.5, 2.0]) {
            assert!((found - exact).abs() < 1e-14, "{found} for {exact}");
        }
        assert_eq!(roots.as_slice().len(), 4);
        assert_eq!(polynomial_roots(&c, 0.0, 1.0).as_slice().len(), 1);
    }

    #[test]
    fn close_pairs_stay_apart_and_touching_is_no_root() {
        let d = 1e-6;
        let c = [-d * d, 0.0, 1.0, 0.0, 0.0];
        let roots = polynomial_roots(&c, -1.0, 1.0);
        assert_eq!(roots.as_slice().len(), 2);
        assert!((roots.as_slice()[1] - d).abs() < 1e-15);
        assert!(polynomial_roots(&[0.0, 0.0, 1.0, 0.0, 0.0], -1.0, 1.0).as_slice().is_empty());
    }
}
