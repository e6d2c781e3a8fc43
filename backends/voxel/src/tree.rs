//! Which of many boxes may a ray meet? A bounding volume hierarchy over the objects of a scene.

use crate::beam::Beam;
use glam::DVec3;
use polyptych_core::math::{Aabb, Ray};

/// Boxes in a leaf: grids are dear to enter, boxes cheap to test.
const LEAF: usize = 2;
/// Longest path: 2^32 boxes halve 32 times.
const DEEPEST: usize = 32;

/// A binary tree of boxes, halved by count along the longest axis.
#[derive(Debug, Default)]
pub(crate) struct Tree {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

#[derive(Debug)]
struct Node {
    bounds: Aabb,
    /// First entry of a leaf, or the left one of two neighboring nodes.
    first: u32,
    /// Entries of a leaf, 0 for a node above others.
    count: u32,
}

/// A ray of the world with what box tests need.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldRay {
    pub(crate) ray: Ray,
    inverse: DVec3,
}

impl WorldRay {
    pub(crate) fn new(ray: Ray) -> Self {
        Self { ray, inverse: ray.direction.recip() }
    }

    /// Returns where the ray enters a box; infinity where it does not. Boxes are a little larger than what they
    /// bound, so that a ray exactly in a face need not count.
    #[inline]
    fn enters(&self, bounds: &Aabb, before: f64) -> f64 {
        let (mut near, mut far) = (0.0_f64, before);
        for a in 0..3 {
            let low = (bounds.min[a] - self.ray.origin[a]) * self.inverse[a];
            let high = (bounds.max[a] - self.ray.origin[a]) * self.inverse[a];
            let (first, last) = if low < high { (low, high) } else { (high, low) };
            near = if first > near { first } else { near };
            far = if last < far { last } else { far };
        }
        if near <= far { near } else { f64::INFINITY }
    }
}

impl Tree {
    /// Builds the tree; entries are found again by their index.
    pub(crate) fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..boxes.len() as u32).collect() };
        if !boxes.is_empty() {
            tree.nodes.push(Node { bounds: Aabb::EMPTY, first: 0, count: 0 });
            tree.split(boxes, 0, 0, boxes.len());
        }
        tree
    }

    fn split(&mut self, boxes: &[Aabb], node: usize, from: usize, to: usize) {
        let entries = &mut self.order[from..to];
        let bounds = entries.iter().fold(Aabb::EMPTY, |all, &i| all.union(boxes[i as usize]));
        if entries.len() <= LEAF {
            self.nodes[node] = Node { bounds, first: from as u32, count: (to - from) as u32 };
            return;
        }
        let centers = entries.iter().fold(Aabb::EMPTY, |all, &i| all.with(boxes[i as usize].center()));
        let size = centers.size();
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
        let half = entries.len() / 2;
        let key = |i: u32| boxes[i as usize].center()[axis];
        entries.select_nth_unstable_by(half, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        let left = self.nodes.len();
        for _ in 0..2 {
            self.nodes.push(Node { bounds: Aabb::EMPTY, first: 0, count: 0 });
        }
        self.nodes[node] = Node { bounds, first: left as u32, count: 0 };
        self.split(boxes, left, from, from + half);
        self.split(boxes, left + 1, from + half, to);
    }

    /// Visits the entries whose boxes a ray may meet before a distance, near ones first. A visit returns the
    /// distance before which further ones matter.
    #[inline]
    pub(crate) fn visit(&self, ray: &WorldRay, before: f64, visit: &mut impl FnMut(usize, f64) -> f64) {
        let Some(root) = self.nodes.first() else { return };
        let mut before = before;
        let mut current = (0u32, ray.enters(&root.bounds, before));
        if current.1 == f64::INFINITY {
            return;
        }
        let (mut waiting, mut waiting_from, mut len) = ([0u32; DEEPEST], [0.0_f64; DEEPEST], 0);
        loop {
            if current.1 <= before && current.1 < f64::INFINITY {
                let node = &self.nodes[current.0 as usize];
                if node.count == 0 {
                    let enter = |i: u32| (i, ray.enters(&self.nodes[i as usize].bounds, before));
                    let (left, right) = (enter(node.first), enter(node.first + 1));
                    let (near, far) = if right.1 < left.1 { (right, left) } else { (left, right) };
                    (waiting[len], waiting_from[len]) = far;
                    len += 1;
                    current = near;
                    continue;
                }
                for &entry in &self.order[node.first as usize..(node.first + node.count) as usize] {
                    before = visit(entry as usize, before);
                }
            }
            if len == 0 {
                return;
            }
            len -= 1;
            current = (waiting[len], waiting_from[len]);
        }
    }

    /// Visits the entries whose boxes a beam may touch, until a visit returns false; false if one did.
    pub(crate) fn visit_beam(&self, beam: &Beam, visit: &mut impl FnMut(usize) -> bool) -> bool {
        let (mut waiting, mut len) = ([0u32; DEEPEST + 1], usize::from(!self.nodes.is_empty()));
        while len > 0 {
            len -= 1;
            let node = &self.nodes[waiting[len] as usize];
            if !beam.touches(&node.bounds) {
                continue;
            }
            if node.count == 0 {
                (waiting[len], waiting[len + 1]) = (node.first, node.first + 1);
                len += 2;
                continue;
            }
            let entries = &self.order[node.first as usize..(node.first + node.count) as usize];
            if !entries.iter().all(|&entry| visit(entry as usize)) {
                return false;
            }
        }
        true
    }

    /// Returns the bytes held.
    /// Returns what [`Tree::bytes`] will be for so many boxes: halves down to leaves of [`LEAF`].
    pub(crate) fn planned_bytes(boxes: usize) -> u64 {
        fn nodes(boxes: usize) -> usize {
            if boxes <= LEAF { 1 } else { 1 + nodes(boxes / 2) + nodes(boxes - boxes / 2) }
        }
        let nodes = if boxes == 0 { 0 } else { nodes(boxes) };
        (nodes * size_of::<Node>() + boxes * 4) as u64
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.nodes.len() * size_of::<Node>() + self.order.len() * 4) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_box_on_the_way_is_visited_and_few_others() {
        let boxes: Vec<Aabb> = (0..1000)
            .map(|i| {
                let corner = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 3.0;
                Aabb::new(corner, corner + 1.0)
            })
            .collect();
        let tree = Tree::new(&boxes);
        for (origin, direction) in [
            (DVec3::new(-5.0, 0.5, 0.5), DVec3::X),
            (DVec3::new(-5.0, -5.0, -5.0), DVec3::ONE.normalize_or_zero()),
            (DVec3::new(15.5, 40.0, 15.5), DVec3::new(0.0, -1.0, -0.0)),
            (DVec3::new(7.0, 1.0, 60.0), DVec3::new(0.1, 0.2, -0.9).normalize_or_zero()),
        ] {
            let ray = WorldRay::new(Ray { origin, direction });
            let mut seen = Vec::new();
            tree.visit(&ray, f64::INFINITY, &mut |i, before| {
                seen.push(i);
                before
            });
            let expected: Vec<usize> =
                (0..1000).filter(|&i| boxes[i].clip(origin, direction).is_some()).collect();
            assert!(!expected.is_empty());
            assert!(expected.iter().all(|i| seen.contains(i)), "{seen:?} lacks some of {expected:?}");
            assert!(seen.len() <= 4 * expected.len() + 8, "{} visits for {}", seen.len(), expected.len());
        }
    }
}
