//! Do rays meet random free forms where a slow search in double precision says?

use crate::bundle::{Crossing, Hits, NOWHERE, OCTETS, Rays};
use crate::form::{Cast, FormBody, FormScratch, Precision};
use glam::{DAffine3, DVec3};
use polyptych_core::lanes::{DVec3x8, F64x8, LANES};
use polyptych_core::math::Interval;
use polyptych_core::scene::{Form, FreeForm, Perturbation, Power};

/// Distances that differ by more, as a share of the scene, are wrong.
const WRONG: f64 = 2e-5;

/// The margin: rays count whose answer does not change when the function is moved by as much up or down.
const MARGIN: f64 = 1e-5;

struct Random(u64);

impl Random {
    /// Returns a number in `[-1, 1)`.
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.next(), self.next(), self.next())
    }

    fn ball(&mut self, aside: f64, least: f64, most: f64) -> Form {
        let center = self.point().normalize_or(DVec3::X) * aside;
        let radii = DVec3::splat(least) + (self.point() + 1.0) * (0.5 * (most - least));
        Form::Ellipsoid { center, radii }
    }

    /// Makes a perturbed ball of so many terms, some of which are themselves perturbed.
    fn form(&mut self, terms: u32, depth: u32) -> Form {
        let term = |random: &mut Self| {
            let plain = random.ball(0.9, 0.1, 0.5);
            let function = if depth > 1 && random.next() > 0.3 {
                let bump = random.form(2, depth - 1);
                let Form::Perturbed { terms, .. } = bump else { return plain_term(random, plain) };
                Form::Perturbed { base: Box::new(plain), terms }
            } else {
                plain
            };
            plain_term(random, function)
        };
        let terms = (0..terms).map(|_| term(self)).collect();
        Form::Perturbed { base: Box::new(self.ball(0.0, 0.7, 1.0)), terms }
    }
}

fn plain_term(random: &mut Random, function: Form) -> Perturbation {
    let power = if random.next() > 0.0 { Power::Square } else { Power::Cube };
    Perturbation { weight: random.next() * 0.8, power, function }
}

/// Bounds a form over a stretch of a ray: quadrics exactly, as the parabolas that they are along it.
fn range(form: &Form, o: DVec3, d: DVec3, from: f64, to: f64) -> Interval {
    if let Some(q) = form.as_quadric() {
        let at = |t: f64| q.value(o + d * t);
        let (a, b) = (at(from), at(to));
        let middle = 0.5 * (from + to);
        // f(m + u) = f(m) + s u + c u^2
        let (slope, reach) = (q.gradient(o + d * middle).dot(d), 0.5 * (to - from));
        let curve = if reach > 0.0 { (0.5 * (a + b) - at(middle)) / (reach * reach) } else { 0.0 };
        let turn = if curve == 0.0 { f64::INFINITY } else { -slope / (2.0 * curve) };
        let top = if turn.abs() < reach { at(middle + turn) } else { a };
        let slack = 1e-13 * (1.0 + a.abs() + b.abs());
        return Interval { lo: a.min(b).min(top) - slack, hi: a.max(b).max(top) + slack };
    }
    let Form::Perturbed { base, terms } = form else { return Interval::point(form.value(o + d * from)) };
    terms.iter().fold(range(base, o, d, from, to), |sum, term| {
        let q = range(&term.function, o, d, from, to).positive_part();
        let raised = if term.power == Power::Square { q.square() } else { q.square() * q };
        sum + raised * term.weight
    })
}

/// Finds the first change of sign of a form, moved by `shift`, in a stretch of a ray.
fn first(form: &Form, (o, d): (DVec3, DVec3), (from, to): (f64, f64), shift: f64) -> Option<f64> {
    let bounds = range(form, o, d, from, to);
    if bounds.lo + shift > 0.0 || bounds.hi + shift < 0.0 {
        return None;
    }
    let inside = |t: f64| form.value(o + d * t) + shift >= 0.0;
    if to - from < 1e-7 {
        return (inside(from) != inside(to)).then_some(0.5 * (from + to));
    }
    let middle = 0.5 * (from + to);
    first(form, (o, d), (from, middle), shift).or_else(|| first(form, (o, d), (middle, to), shift))
}

/// What went wrong, and the largest error of those that did not.
#[derive(Debug, Default)]
struct Count {
    rays: u32,
    hits: u32,
    missed: u32,
    extra: u32,
    wrong: u32,
    within_margin: u32,
    worst: f64,
}

/// Makes one of so many forms, and what its rays are drawn from.
fn seeded(forms: u64, seed: u64) -> (Form, Random) {
    let mut random = Random(0x9E37_79B9_7F4A_7C15 ^ (seed * 7919 + 1));
    (0..20).for_each(|_| {
        random.next();
    });
    let form = random.form(1 + (seed * 64 / forms.max(1)) as u32, 1 + seed as u32 % 3);
    (form, random)
}

/// Casts eight rays that are close to one another from a random eye.
fn cast(
    body: &FormBody,
    random: &mut Random,
    precision: Precision,
    scratch: &mut FormScratch,
) -> (DVec3, DVec3x8, Hits) {
    let eye = random.point().normalize_or(DVec3::X) * (2.5 + random.next());
    let (mut direction, aim) = (NOWHERE, random.point() * 0.9);
    for lane in 0..LANES {
        direction.set(lane, (aim + random.point() * 0.1 - eye).normalize_or(DVec3::X));
    }
    let (origin, far) = (DVec3x8::splat(eye), F64x8::splat(f64::INFINITY));
    let rays = [Rays { origin, direction, near: F64x8::ZERO, far }];
    let mut hits = [Hits::nothing(&rays[0])];
    let place = DAffine3::IDENTITY;
    let cast = Cast { object_from_world: &place, body: 0, crossing: Crossing::Any, precision };
    body.cast(cast, &rays, &mut hits, scratch);
    let [hits] = hits;
    (eye, direction, hits)
}

fn count(forms: u64, octets: u32, precision: Precision) -> Count {
    let mut count = Count::default();
    for seed in 0..forms {
        let (form, mut random) = seeded(forms, seed);
        let Ok(whole) = FreeForm::new(form) else { continue };
        let body = FormBody::new(&whole);
        let mut scratch = FormScratch::default();
        for _ in 0..octets {
            let (eye, direction, hits) = cast(&body, &mut random, precision, &mut scratch);
            for lane in 0..LANES {
                let met = hits.any().has(lane).then_some(hits.t.0[lane]);
                count.add(&whole, (eye, direction.get(lane)), met);
            }
        }
    }
    count
}

impl Count {
    fn add(&mut self, form: &FreeForm, ray: (DVec3, DVec3), met: Option<f64>) {
        self.rays += 1;
        let scene = form.bounds().radius();
        let whole = form.bounds().grown(1e-3).clip(ray.0, ray.1);
        let truth = |shift: f64| whole.and_then(|ends| first(form.form(), ray, ends, shift));
        let right = truth(0.0);
        self.hits += u32::from(right.is_some());
        let kind = match (right, met) {
            (None, None) => return,
            (Some(a), Some(b)) => {
                let error = (a - b).abs() / scene;
                if error <= WRONG {
                    self.worst = self.worst.max(error);
                    return;
                }
                &mut self.wrong
            }
            (Some(_), None) => &mut self.missed,
            (None, Some(_)) => &mut self.extra,
        };
        // A ray that touches the surface, or leaves it at once, has no answer in any precision.
        let near = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-2 * scene,
            (a, b) => a.is_none() && b.is_none(),
        };
        let [above, below] = [truth(MARGIN), truth(-MARGIN)];
        if near(above, right) && near(below, right) {
            *kind += 1;
            println!("{ray:?}: {met:?} for {right:?}, moved {above:?} and {below:?}");
        } else {
            self.within_margin += 1;
        }
    }

    fn check(&self, what: &str) {
        assert_eq!((self.missed, self.extra, self.wrong), (0, 0, 0), "{what}: {self:?}");
        assert!(self.hits * 3 > self.rays && self.within_margin * 500 < self.rays, "{what}: {self:?}");
    }
}

#[test]
fn random_forms_are_met_where_a_slow_search_says() {
    count(50, 16, Precision::Single).check("single");
    count(50, 4, Precision::Double).check("double");
}

/// Where much of a bracket is flat, steps of Newton's method leave it, and it is halved many times.
#[test]
fn hits_lie_on_the_surface_however_slowly_roots_are_closed_in_on() {
    for seed in [40, 43] {
        let (form, mut random) = seeded(50, seed);
        let Ok(whole) = FreeForm::new(form) else { continue };
        let (body, mut scratch) = (FormBody::new(&whole), FormScratch::default());
        let mut met = 0;
        for _ in 0..2500 {
            let (eye, direction, hits) = cast(&body, &mut random, Precision::Single, &mut scratch);
            for lane in (0..LANES).filter(|&lane| hits.any().has(lane)) {
                let value = whole.form().value(eye + direction.get(lane) * hits.t.0[lane]);
                assert!(value.abs() < 1e-3, "seed {seed}, {eye}, {}: {value}", direction.get(lane));
                met += 1;
            }
        }
        assert!(met > 9000, "{met}");
    }
}

/// The whole of it: fifty forms, 20,000 rays each. Takes minutes.
#[test]
#[ignore = "takes minutes"]
fn a_million_rays_meet_random_forms_in_single_precision() {
    let count = count(50, 2500, Precision::Single);
    println!("{count:?}");
    count.check("single");
}

/// The same in double precision.
#[test]
#[ignore = "takes minutes"]
fn a_million_rays_meet_random_forms_in_double_precision() {
    let count = count(50, 2500, Precision::Double);
    println!("{count:?}");
    count.check("double");
}

/// Casts 400,000 rays from far away at a ball of radius 1, twice as wide as it is, and counts wrong answers: those of a
/// naive discriminant in single precision, those that were found.
fn wrong_from_afar(distance: f64, form: Form, precision: Precision) -> [u32; 2] {
    let body = FormBody::new(&FreeForm::new(form).unwrap());
    let (mut scratch, mut random) = (FormScratch::default(), Random(0x5EED));
    let eye = DVec3::new(0.0, 0.0, distance);
    let cast = Cast { object_from_world: &DAffine3::IDENTITY, body: 0, crossing: Crossing::Any, precision };
    let (mut wrong, mut naive) = (0, 0);
    for _ in 0..400_000 / (LANES * OCTETS) + 1 {
        let mut rays = Vec::new();
        let mut expected = Vec::new();
        for _ in 0..OCTETS {
            let mut direction = DVec3x8::splat(DVec3::NEG_Z);
            for lane in 0..LANES {
                let (x, y) = (2.0 * random.next(), 2.0 * random.next());
                direction.set(lane, DVec3::new(x, y, -distance).normalize_or(DVec3::NEG_Z));
                // The square of the distance from the middle to the ray.
                let (aside, deep) = (x * x + y * y, distance * distance);
                expected.push(aside * deep / (aside + deep) < 1.0);
            }
            let (near, far) = (F64x8::ZERO, F64x8::splat(f64::INFINITY));
            rays.push(Rays { origin: DVec3x8::splat(eye), direction, near, far });
        }
        let mut hits: Vec<Hits> = rays.iter().map(Hits::nothing).collect();
        body.cast(cast, &rays, &mut hits, &mut scratch);
        for (i, expected) in expected.into_iter().enumerate() {
            let (octet, lane) = (i / LANES, i % LANES);
            wrong += u32::from(hits[octet].any().has(lane) != expected);
            let (o, d) = (eye.as_vec3(), rays[octet].direction.get(lane).as_vec3());
            let (b, c) = (o.dot(d), o.length_squared() - 1.0);
            naive += u32::from((b * b - d.length_squared() * c >= 0.0) != expected);
        }
    }
    [naive, wrong]
}

#[test]
fn balls_from_a_million_radii_away_are_met_where_they_are() {
    // As one quadric, and as a sum that is searched by intervals.
    fn ball() -> Form {
        Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::ONE }
    }
    fn searched() -> Form {
        Form::Offset { form: Box::new(ball()), amount: 0.0 }
    }
    for distance in [1e4, 1e6] {
        for form in [ball as fn() -> Form, searched] {
            let [naive, single] = wrong_from_afar(distance, form(), Precision::Single);
            let [_, double] = wrong_from_afar(distance, form(), Precision::Double);
            println!("{distance:e}: naive {naive}, single {single}, double {double} of 400,000");
            assert!(naive > 50_000 && f64::from(single) <= 1e-3 * f64::from(naive) && double == 0);
        }
    }
}
