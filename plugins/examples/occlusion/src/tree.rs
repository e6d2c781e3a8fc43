//! Which triangle does a ray meet first? A binary tree of boxes, split at the middle of the longest axis.

use crate::hit::{Hit, Triangle};
use polyptych_plugin::core::math::{Aabb, Ray};

/// Most triangles of a leaf.
const LEAF: usize = 4;
/// Deepest tree: halves of 2^32 triangles.
const DEEPEST: usize = 64;

pub(crate) struct Tree {
    triangles: Vec<Triangle>,
    nodes: Vec<Node>,
}

struct Node {
    bounds: Aabb,
    /// First triangle of a leaf, or second child of a branch; the first child follows the branch.
    next: u32,
    /// Triangles of a leaf, 0 for a branch.
    count: u32,
}

impl Tree {
    pub(crate) fn new(mut triangles: Vec<Triangle>) -> Self {
        let mut nodes = Vec::new();
        let count = triangles.len();
        if count > 0 {
            build(&mut triangles, 0, count, &mut nodes);
        }
        Self { triangles, nodes }
    }

    pub(crate) fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |root| root.bounds)
    }

    pub(crate) fn triangle(&self, index: usize) -> &Triangle {
        &self.triangles[index]
    }

    pub(crate) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Finds the nearest triangle that the ray meets within a range; of two at the same distance the one of the
    /// object that comes first.
    pub(crate) fn nearest(&self, ray: &Ray, from: f64, to: f64) -> Option<Hit> {
        let (mut best, mut limit) = (None::<Hit>, to);
        self.visit(ray, &mut limit, |index, triangle, limit| {
            if let Some((distance, u, v)) = triangle.meets(ray)
                && distance >= from
                && distance <= *limit
            {
                let first = |h: &Hit| triangle.order() < self.triangles[h.triangle].order();
                if distance < *limit || best.as_ref().is_none_or(first) {
                    best = Some(Hit { triangle: index, distance, u, v });
                }
                *limit = distance;
            }
            false
        });
        best
    }

    /// Tells whether the ray meets anything within a range.
    pub(crate) fn meets_any(&self, ray: &Ray, from: f64, to: f64) -> bool {
        let (mut found, mut limit) = (false, to);
        self.visit(ray, &mut limit, |_, triangle, limit| {
            found |= triangle.meets(ray).is_some_and(|(distance, ..)| distance >= from && distance <= *limit);
            found
        });
        found
    }

    /// Shows every triangle in boxes that the ray crosses before the limit, until `look` returns true.
    fn visit(&self, ray: &Ray, limit: &mut f64, mut look: impl FnMut(usize, &Triangle, &mut f64) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let (mut stack, mut depth) = ([0u32; DEEPEST], 1);
        while depth > 0 {
            depth -= 1;
            let at = stack[depth] as usize;
            let node = &self.nodes[at];
            let crossed = node.bounds.clip(ray.origin, ray.direction);
            if !crossed.is_some_and(|(near, far)| far >= 0.0 && near <= *limit) {
                continue;
            }
            if node.count == 0 {
                stack[depth] = node.next;
                stack[depth + 1] = at as u32 + 1;
                depth += 2;
                continue;
            }
            for index in node.next as usize..(node.next + node.count) as usize {
                if look(index, &self.triangles[index], limit) {
                    return;
                }
            }
        }
    }
}

fn build(all: &mut [Triangle], first: usize, end: usize, nodes: &mut Vec<Node>) {
    let here = &mut all[first..end];
    let bounds = here.iter().fold(Aabb::EMPTY, |b, t| b.union(t.bounds()));
    let at = nodes.len();
    nodes.push(Node { bounds, next: first as u32, count: (end - first) as u32 });
    if end - first <= LEAF {
        return;
    }
    let size = bounds.size();
    let axis = (0..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let middle = here.len() / 2;
    here.select_nth_unstable_by(middle, |a, b| {
        a.center()[axis].total_cmp(&b.center()[axis]).then(a.order().cmp(&b.order()))
    });
    build(all, first, first + middle, nodes);
    let second = nodes.len() as u32;
    build(all, first + middle, end, nodes);
    (nodes[at].next, nodes[at].count) = (second, 0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn the_tree_finds_what_trying_all_finds() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 40) as f64 / (1u64 << 24) as f64 * 2.0 - 1.0
        };
        let mut point = |scale: f64| DVec3::new(random(), random(), random()) * scale;
        let triangles: Vec<Triangle> = (0..500)
            .map(|i| {
                let corner = point(1.0);
                Triangle::new([corner, corner + point(0.3), corner + point(0.3)], i, 0)
            })
            .collect();
        let tree = Tree::new(triangles.clone());
        let mut hits = 0;
        for _ in 0..500 {
            let origin = point(2.0);
            let ray = Ray { origin, direction: (point(0.7) - origin).normalize_or(DVec3::X) };
            let all = triangles.iter().filter_map(|t| t.meets(&ray)).map(|(d, ..)| d);
            let nearest = all.filter(|d| *d >= 0.0).fold(f64::INFINITY, f64::min);
            let found = tree.nearest(&ray, 0.0, f64::INFINITY);
            assert_eq!(found.as_ref().map_or(f64::INFINITY, |h| h.distance), nearest);
            assert_eq!(tree.meets_any(&ray, 0.0, f64::INFINITY), found.is_some());
            hits += usize::from(found.is_some());
        }
        assert!(hits > 100, "{hits}");
    }
}
