//! Cuts flat polygons into triangles, concave ones too.

use earcut::Earcut;
use glam::DVec3;

/// Most corners of a polygon that is cut properly. Above, ear clipping may need a second for a single face of a
/// hostile file; the largest face seen in a real model has 936 corners.
pub(crate) const MOST_CORNERS: usize = 4096;

/// Ear clipping is quadratic on tangled polygons: the squares of the corner counts of one file may add up to this.
const MOST_WORK: u64 = 1 << 31;

/// Cuts polygons; keeps its buffers between calls.
pub(crate) struct PolygonCutter {
    earcut: Earcut<f64>,
    cut: Vec<u32>,
    flat: Vec<[f64; 2]>,
    work: u64,
    fans: usize,
}

impl PolygonCutter {
    pub(crate) fn new() -> Self {
        Self { earcut: Earcut::new(), cut: Vec::new(), flat: Vec::new(), work: 0, fans: 0 }
    }

    /// Returns how many polygons were too large or too tangled and were filled as fans.
    pub(crate) fn fans(&self) -> usize {
        self.fans
    }

    /// Cuts a polygon: calls `emit` with the corner numbers of each triangle, wound like the polygon.
    pub(crate) fn cut(&mut self, corners: &[DVec3], mut emit: impl FnMut([usize; 3])) {
        match corners.len() {
            0..=2 => {}
            3 => emit([0, 1, 2]),
            4 => {
                let [first, second] = split_quad([corners[0], corners[1], corners[2], corners[3]]);
                emit(first);
                emit(second);
            }
            n => {
                if self.clip_ears(corners) {
                    for t in self.cut.chunks_exact(3) {
                        emit([t[0] as usize, t[1] as usize, t[2] as usize]);
                    }
                } else {
                    self.fans += 1;
                    (1..n - 1).for_each(|i| emit([0, i, i + 1]));
                }
            }
        }
    }

    /// Clips ears in the polygon's Newell plane; false when that is too much work or comes to nothing.
    fn clip_ears(&mut self, corners: &[DVec3]) -> bool {
        let work = (corners.len() as u64).pow(2);
        let normal = newell_normal(corners);
        if corners.len() > MOST_CORNERS || self.work + work > MOST_WORK || normal == DVec3::ZERO {
            return false;
        }
        self.work += work;
        // Dropping the normal's largest component keeps the polygon in shape; the sign keeps its winding.
        let size = normal.abs();
        let [u, v, sign] = if size.x >= size.y && size.x >= size.z {
            [1, 2, usize::from(normal.x < 0.0)]
        } else if size.y >= size.z {
            [2, 0, usize::from(normal.y < 0.0)]
        } else {
            [0, 1, usize::from(normal.z < 0.0)]
        };
        let [u, v] = if sign == 1 { [v, u] } else { [u, v] };
        self.flat.clear();
        self.flat.extend(corners.iter().map(|p| [p[u] - corners[0][u], p[v] - corners[0][v]]));
        self.earcut.earcut(self.flat.iter().copied(), &[] as &[u32], &mut self.cut);
        // The crate does not promise a winding: bring each triangle to that of the plane.
        for t in self.cut.chunks_exact_mut(3) {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| self.flat[i as usize]);
            if (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0 {
                t.swap(1, 2);
            }
        }
        !self.cut.is_empty()
    }
}

/// Returns twice the area vector of a polygon (M. E. Newell's method), zero where it is not finite.
fn newell_normal(corners: &[DVec3]) -> DVec3 {
    let first = corners[0];
    let normal: DVec3 = corners.windows(2).map(|pair| (pair[0] - first).cross(pair[1] - first)).sum();
    if normal.is_finite() { normal } else { DVec3::ZERO }
}

/// Splits a quad along 0-2, or along 1-3 where a corner at 1 or 3 points inward.
fn split_quad([a, b, c, d]: [DVec3; 4]) -> [[usize; 3]; 2] {
    let normal = (c - a).cross(d - b);
    let fits = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).dot(normal) >= 0.0;
    let along_02 = fits(a, b, c) && fits(a, c, d);
    let along_13 = fits(a, b, d) && fits(b, c, d);
    if !along_02 && along_13 { [[0, 1, 3], [1, 2, 3]] } else { [[0, 1, 2], [0, 2, 3]] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cut(corners: &[DVec3]) -> (usize, DVec3) {
        let (mut count, mut area) = (0, DVec3::ZERO);
        PolygonCutter::new().cut(corners, |t| {
            let [a, b, c] = t.map(|i| corners[i]);
            area += (b - a).cross(c - a) * 0.5;
            count += 1;
            assert!((b - a).cross(c - a).dot(newell_normal(corners)) > -1e-12, "a triangle is turned over");
        });
        (count, area)
    }

    #[test]
    fn a_concave_comb_keeps_its_area_in_every_plane() {
        // teeth of height 2 on a bar of height 1; a fan would fill the gaps
        let mut comb = vec![[0.0, 0.0], [9.0, 0.0]];
        for tooth in (0..5).rev() {
            let x = f64::from(tooth) * 2.0;
            comb.extend([[x + 1.0, 3.0], [x, 3.0]]);
            if tooth > 0 {
                comb.extend([[x, 1.0], [x - 1.0, 1.0]]);
            }
        }
        for plane in 0..6 {
            let lift = |&[x, y]: &[f64; 2]| match plane {
                0 => DVec3::new(x, y, 0.0),
                1 => DVec3::new(y, x, 5.0),
                2 => DVec3::new(0.0, x, y),
                3 => DVec3::new(1.0, y, x),
                4 => DVec3::new(x, 0.0, y),
                _ => DVec3::new(y, 0.0, x),
            };
            let corners: Vec<DVec3> = comb.iter().map(lift).collect();
            let (count, area) = cut(&corners);
            assert_eq!(count, corners.len() - 2);
            assert!((area.length() - 19.0).abs() < 1e-12, "plane {plane}: {area}");
        }
    }

    #[test]
    fn an_arrow_quad_is_split_at_its_notch() {
        let arrow = [(0.0, 0.0), (2.0, -1.0), (0.5, 0.0), (2.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
        let (_, area) = cut(&arrow);
        assert!((area.z - 0.5).abs() < 1e-12, "{area}");
        let turned = [arrow[1], arrow[2], arrow[3], arrow[0]];
        assert!((cut(&turned).1.z - 0.5).abs() < 1e-12);
    }

    #[test]
    fn wild_polygons_end() {
        let mut cutter = PolygonCutter::new();
        let nan = vec![DVec3::NAN; 7];
        let same = vec![DVec3::ONE; 9];
        let many: Vec<DVec3> = (0..100_000)
            .map(|i| DVec3::new(f64::from(i * 7919 % 1009), f64::from(i * 31 % 997), 0.0))
            .collect();
        for corners in [&nan, &same, &many] {
            cutter.cut(corners, |t| assert!(t.iter().all(|&i| i < corners.len())));
        }
        assert_eq!(cutter.fans(), 3);
    }
}
