//! Which boxes does a ray pass, near ones first?
//!
//! A binary tree of boxes split by the surface area heuristic over 16 bins (I. Wald, *On fast construction of
//! SAH-based bounding volume hierarchies*, 2007). Boxes are `f32`, rounded outward.

use crate::line::Line;
use glam::DVec3;
use polyptych_core::math::Aabb;
use std::ops::Range;

const BINS: usize = 16;
/// From this depth on nodes are split at the median, so that a tree of 2^32 boxes is at most 64 deep.
const SAH_DEPTH: u32 = 32;
const STACK: usize = 66;
/// Widens the box test: covers the rounding of a subtraction and a product by far, and any hit test's.
const SLACK: f64 = 1e-13;

/// Boxes in a tree.
#[derive(Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

/// `count > 0`: a leaf with the boxes `order[first..][..count]`; else the children are `first` and the next.
#[derive(Clone, Copy, Debug)]
struct Node {
    min: [f32; 3],
    first: u32,
    max: [f32; 3],
    count: u32,
}

/// Boxes in a leaf of at most four, on the mean of many meshes.
const FULL: f64 = 2.25;

/// A box to be put into the tree, and its number.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounded {
    min: [f32; 3],
    max: [f32; 3],
    index: u32,
}

impl Bounded {
    pub(crate) fn new(bounds: &Aabb, index: usize) -> Self {
        Self {
            min: bounds.min.to_array().map(round_down),
            max: bounds.max.to_array().map(round_up),
            index: index as u32,
        }
    }

    fn center(&self, axis: usize) -> f32 {
        self.min[axis] * 0.5 + self.max[axis] * 0.5
    }
}

fn round_down(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) > v { f.next_down() } else { f }
}

fn round_up(v: f64) -> f32 {
    let f = v as f32;
    if f64::from(f) < v { f.next_up() } else { f }
}

#[derive(Clone, Copy)]
struct Hull {
    min: [f32; 3],
    max: [f32; 3],
}

impl Hull {
    const EMPTY: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    fn add(&mut self, min: &[f32; 3], max: &[f32; 3]) {
        for a in 0..3 {
            self.min[a] = self.min[a].min(min[a]);
            self.max[a] = self.max[a].max(max[a]);
        }
    }

    fn area(&self) -> f32 {
        let [x, y, z] = std::array::from_fn(|a| (self.max[a] - self.min[a]).max(0.0));
        x * y + y * z + z * x
    }
}

impl Bvh {
    /// Sorts boxes into a tree with at most `leaf` boxes in a leaf: 1 where what is in a box is dear to test.
    pub(crate) fn build(mut boxes: Vec<Bounded>, leaf: usize) -> Self {
        let mut nodes = Vec::with_capacity(boxes.len() + 1);
        if boxes.is_empty() {
            return Self::default();
        }
        nodes.push(node_over(&boxes, 0));
        let mut open = vec![(0usize, 0..boxes.len(), 0u32)];
        while let Some((at, range, depth)) = open.pop() {
            let Some(middle) = split(&mut boxes[range.clone()], depth, leaf) else { continue };
            let middle = range.start + middle;
            let first = nodes.len();
            nodes.push(node_over(&boxes[range.start..middle], range.start));
            nodes.push(node_over(&boxes[middle..range.end], middle));
            nodes[at] = Node { first: first as u32, count: 0, ..nodes[at] };
            open.push((first + 1, middle..range.end, depth + 1));
            open.push((first, range.start..middle, depth + 1));
        }
        nodes.shrink_to_fit();
        Self { nodes, order: boxes.iter().map(|b| b.index).collect() }
    }

    /// Lists the numbers of the boxes in the order of the leaves.
    pub(crate) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Returns what [`Bvh::bytes`] will be: exact where each leaf holds one box, near it for leaves of more, which hold
    /// [`FULL`] boxes on the mean.
    pub(crate) fn planned_bytes(boxes: usize, leaf: usize) -> u64 {
        let leaves = if leaf == 1 { boxes as f64 } else { (boxes as f64 / FULL).max(1.0) };
        let nodes = if boxes == 0 { 0.0 } else { 2.0 * leaves - 1.0 };
        (nodes * size_of::<Node>() as f64) as u64 + boxes as u64 * 4
    }

    pub(crate) fn bytes(&self) -> u64 {
        (self.nodes.len() * size_of::<Node>() + self.order.len() * 4) as u64
    }

    /// Calls `visit` for the leaves that the line passes between two distances, near ones first. `visit` gets
    /// positions in [`Bvh::order`] and returns the distance beyond which nothing is looked for any more.
    pub(crate) fn walk(
        &self,
        line: &Line,
        after: f64,
        before: f64,
        visit: &mut impl FnMut(Range<usize>) -> f64,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let slabs = Slabs::new(line);
        let mut before = before;
        let mut stack = [(0u32, 0.0f32); STACK];
        let mut height = 0;
        if let Some(near) = slabs.enter(&self.nodes[0], after, before) {
            stack[0] = (0, round_down(near));
            height = 1;
        }
        while height > 0 {
            height -= 1;
            let (at, near) = stack[height];
            if f64::from(near) > before {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count > 0 {
                let first = node.first as usize;
                before = visit(first..first + node.count as usize);
                continue;
            }
            let (left, right) = (node.first, node.first + 1);
            let enter = |n: u32| slabs.enter(&self.nodes[n as usize], after, before).map(|near| (n, near));
            let (first, second) = match (enter(left), enter(right)) {
                (Some(l), Some(r)) if r.1 < l.1 => (Some(r), Some(l)),
                (l, r) => (l, r),
            };
            for child in [second, first].into_iter().flatten() {
                stack[height] = (child.0, round_down(child.1));
                height += 1;
            }
        }
    }
}

fn node_over(boxes: &[Bounded], first: usize) -> Node {
    let mut hull = Hull::EMPTY;
    boxes.iter().for_each(|b| hull.add(&b.min, &b.max));
    Node { min: hull.min, max: hull.max, first: first as u32, count: boxes.len() as u32 }
}

/// Parts boxes in two and returns where the second part begins; nothing for a leaf.
fn split(boxes: &mut [Bounded], depth: u32, leaf: usize) -> Option<usize> {
    if boxes.len() <= 1 {
        return None;
    }
    let mut centers = Hull::EMPTY;
    let mut hull = Hull::EMPTY;
    for b in boxes.iter() {
        let c = std::array::from_fn(|a| b.center(a));
        centers.add(&c, &c);
        hull.add(&b.min, &b.max);
    }
    if depth < SAH_DEPTH
        && let Some((axis, bin, cost)) = cheapest_split(boxes, &centers)
    {
        // A leaf costs a test for each box, a split two box tests more.
        if boxes.len() <= leaf && cost + hull.area() * 1.5 >= hull.area() * boxes.len() as f32 {
            return None;
        }
        let bins = Binning::new(&centers, axis);
        let middle = partition(boxes, |b| bins.of(b.center(axis)) <= bin);
        if middle > 0 && middle < boxes.len() {
            return Some(middle);
        }
    }
    if boxes.len() <= leaf {
        return None;
    }
    let extent = |a: usize| centers.max[a] - centers.min[a];
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b))).unwrap_or(0);
    let middle = boxes.len() / 2;
    boxes.select_nth_unstable_by(middle, |a, b| {
        a.center(axis).total_cmp(&b.center(axis)).then(a.index.cmp(&b.index))
    });
    Some(middle)
}

struct Binning {
    origin: f32,
    scale: f32,
}

impl Binning {
    fn new(centers: &Hull, axis: usize) -> Self {
        let extent = centers.max[axis] - centers.min[axis];
        Self { origin: centers.min[axis], scale: BINS as f32 * 0.999_99 / extent }
    }

    fn of(&self, center: f32) -> usize {
        (((center - self.origin) * self.scale) as usize).min(BINS - 1)
    }
}

/// Returns axis, last bin of the first part, and cost of the best split; nothing where no split helps.
fn cheapest_split(boxes: &[Bounded], centers: &Hull) -> Option<(usize, usize, f32)> {
    let mut best: Option<(usize, usize, f32)> = None;
    for axis in 0..3 {
        let extent = centers.max[axis] - centers.min[axis];
        if !(extent > 0.0 && extent.is_finite()) {
            continue;
        }
        let binning = Binning::new(centers, axis);
        let mut bins = [(Hull::EMPTY, 0u32); BINS];
        for b in boxes {
            let bin = &mut bins[binning.of(b.center(axis))];
            bin.0.add(&b.min, &b.max);
            bin.1 += 1;
        }
        let mut right_cost = [0.0f32; BINS];
        let (mut hull, mut count) = (Hull::EMPTY, 0);
        for i in (1..BINS).rev() {
            hull.add(&bins[i].0.min, &bins[i].0.max);
            count += bins[i].1;
            right_cost[i - 1] = if count > 0 { hull.area() * count as f32 } else { f32::INFINITY };
        }
        (hull, count) = (Hull::EMPTY, 0);
        for i in 0..BINS - 1 {
            hull.add(&bins[i].0.min, &bins[i].0.max);
            count += bins[i].1;
            let cost = hull.area() * count as f32 + right_cost[i];
            if count > 0 && cost.is_finite() && best.is_none_or(|(.., least)| cost < least) {
                best = Some((axis, i, cost));
            }
        }
    }
    best
}

fn partition(boxes: &mut [Bounded], first: impl Fn(&Bounded) -> bool) -> usize {
    let mut middle = 0;
    for i in 0..boxes.len() {
        if first(&boxes[i]) {
            boxes.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

/// A line made ready for box tests.
struct Slabs {
    origin: DVec3,
    inverse: DVec3,
    backward: [bool; 3],
}

impl Slabs {
    fn new(line: &Line) -> Self {
        let d = line.direction;
        // Minus zero must count as zero, or the slab of a parallel ray would be turned around.
        let inverse = DVec3::from_array(d.to_array().map(|d| if d == 0.0 { f64::INFINITY } else { 1.0 / d }));
        Self { origin: line.origin, inverse, backward: d.to_array().map(|d| d < 0.0) }
    }

    /// Returns where the line enters a box, not after the true place.
    fn enter(&self, node: &Node, after: f64, before: f64) -> Option<f64> {
        let (mut near, mut far) = (after, before);
        for a in 0..3 {
            let (lo, hi) =
                if self.backward[a] { (node.max[a], node.min[a]) } else { (node.min[a], node.max[a]) };
            let t_lo = (f64::from(lo) - self.origin[a]) * self.inverse[a];
            let t_hi = (f64::from(hi) - self.origin[a]) * self.inverse[a];
            // Zero times infinity, a parallel ray in the plane of a face, compares false: no limit.
            if t_lo > near {
                near = t_lo;
            }
            if t_hi < far {
                far = t_hi;
            }
        }
        let near = near * (1.0 - SLACK);
        (near <= far * (1.0 + SLACK)).then_some(near)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::line::Start;

    fn random(state: &mut u64) -> f64 {
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        (*state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }

    #[test]
    fn every_box_that_a_ray_passes_is_visited() {
        let mut s = 5;
        let mut v = |k: f64| DVec3::new(random(&mut s), random(&mut s), random(&mut s)) * k;
        let boxes: Vec<Aabb> = (0..3000)
            .map(|i| {
                let (c, h) = (v(10.0), v(0.5).abs());
                // Some are flat, some all in one place.
                let c = if i % 10 == 0 { DVec3::ONE } else { c };
                let h = if i % 7 == 0 { h * DVec3::new(1.0, 0.0, 1.0) } else { h };
                Aabb::new(c - h, c + h)
            })
            .collect();
        let tree = Bvh::build(boxes.iter().enumerate().map(|(i, b)| Bounded::new(b, i)).collect(), 3);
        let mut order = tree.order().to_vec();
        order.sort_unstable();
        assert!(order.iter().enumerate().all(|(i, &o)| i == o as usize));
        for i in 0..500 {
            let origin = v(12.0);
            let mut direction = v(1.0);
            if i % 3 == 0 {
                direction.y = -0.0;
            }
            let line = Line { origin, direction, start: Start::Eye };
            let mut seen = vec![false; boxes.len()];
            tree.walk(&line, 0.0, f64::INFINITY, &mut |range| {
                range.for_each(|p| seen[tree.order()[p] as usize] = true);
                f64::INFINITY
            });
            for (j, b) in boxes.iter().enumerate() {
                assert!(seen[j] || b.clip(origin, direction).is_none(), "box {j} was passed over by ray {i}");
            }
        }
    }
}
