//! Which objects do the rays of a picture pass? Found with a few rays and the objects' boxes, to foretell what a frame
//! takes: nothing is built for it.

use super::demand::why_not_drawn;
use super::need::Need;
use crate::math::Aabb;
use crate::scene::{Object, Primitive, Scene, Shape, Volume};

/// What the rays of a picture are likely to meet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Survey {
    /// For each object the share of the picture's rays that must be held against it: those that enter its box before
    /// they have met something else.
    pub tested: Vec<f64>,
    /// For each object the mean length of such a ray within its box, meters; 0 where there is none.
    pub length: Vec<f64>,
    /// Share of rays that enter any box.
    pub entered: f64,
    /// Share of rays that meet a surface.
    pub seen: f64,
}

/// Rays along the longer edge of the picture.
const RAYS: u32 = 48;

/// Most pairs of ray and box: a scene of many objects is looked at with fewer rays.
const MOST_PAIRS: usize = 1 << 22;

impl Survey {
    /// Looks at a scene through the boxes of its objects.
    #[must_use]
    pub fn of(scene: &Scene, need: &Need) -> Self {
        let boxes: Vec<Option<(Aabb, f64)>> = scene.objects.iter().map(bounds_and_fill).collect();
        let longer = need.width.max(need.height).max(1);
        let affordable = (MOST_PAIRS / boxes.len().max(1)).isqrt() as u32;
        let rays = RAYS.min(affordable).clamp(4, longer.max(4));
        let across =
            |edge: u32| (f64::from(edge) / f64::from(longer) * f64::from(rays)).ceil().max(1.0) as u32;
        let (columns, rows) = (across(need.width), across(need.height));
        let view = need.camera.view(need.width, need.height);
        let mut survey =
            Self { tested: vec![0.0; boxes.len()], length: vec![0.0; boxes.len()], ..Self::default() };
        let mut met: Vec<(f64, f64, usize)> = Vec::new();
        for i in 0..columns * rows {
            let place =
                |k: u32, count: u32, edge: u32| (f64::from(k) + 0.5) / f64::from(count) * f64::from(edge);
            let (x, y) = (place(i % columns, columns, need.width), place(i / columns, rows, need.height));
            let Some(ray) = view.ray(x, y) else { continue };
            met.clear();
            for (index, bounds) in boxes.iter().enumerate() {
                let Some((bounds, _)) = bounds else { continue };
                if let Some((near, far)) =
                    bounds.clip(ray.origin, ray.direction).filter(|(_, far)| *far > 0.0)
                {
                    met.push((near.max(0.0), far, index));
                }
            }
            met.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
            // The share of rays like this one that nothing has stopped yet.
            let mut open = 1.0;
            for &(near, far, index) in &met {
                survey.tested[index] += open;
                survey.length[index] += open * (far - near);
                open *= 1.0 - boxes[index].map_or(0.0, |(_, fill)| fill);
            }
            survey.entered += f64::from(u8::from(!met.is_empty()));
            survey.seen += 1.0 - open;
        }
        let all = f64::from(columns * rows);
        for (tested, length) in survey.tested.iter_mut().zip(&mut survey.length) {
            if *tested > 0.0 {
                *length /= *tested;
            }
            *tested /= all;
        }
        survey.entered /= all;
        survey.seen /= all;
        survey
    }

    /// Returns how many samples a ray takes of a volume, `step` spacings apart: where there is something to be seen, and few
    /// where there is nothing.
    #[must_use]
    pub fn samples(&self, index: usize, object: &Object, step: f64) -> f64 {
        let Shape::Volume(volume) = &*object.shape else { return 0.0 };
        let scale = object.world_from_object.matrix3.determinant().abs().cbrt();
        let all = self.length[index] / (volume.spacing().min_element() * scale * step).max(1e-300);
        all * (EMPTY + (1.0 - EMPTY) * occupied(volume))
    }

    /// Sums what the picture's rays cost: `cost` is that of one ray against an object.
    #[must_use]
    pub fn sum(&self, scene: &Scene, cost: impl Fn(usize, &Object) -> f64) -> f64 {
        let things = scene.objects.iter().enumerate().zip(&self.tested);
        things.filter(|(_, tested)| **tested > 0.0).map(|((i, o), tested)| tested * cost(i, o)).sum()
    }
}

/// What it takes to pass by a sample in empty space, against one that is seen: with less a cloud is drawn in more than
/// twice the time foretold, with more an orbital, of which little is seen, in less than half.
const EMPTY: f64 = 0.4;

/// Edge of the blocks of samples that are passed by where all of them are empty.
const BLOCK: usize = 8;

/// Returns the share of a volume's blocks in which something is seen, from some of them.
fn occupied(volume: &Volume) -> f64 {
    /// Most blocks that are looked at.
    const MOST: usize = 2048;
    let size = volume.size().map(|s| s as usize);
    let blocks = size.map(|s| s.div_ceil(BLOCK));
    let all: usize = blocks.iter().product();
    let is_seen = |i: usize| volume.transfer.at(volume.samples().get(i)).1 > 0.0;
    let holds = |block: usize| {
        let at = [block % blocks[0], block / blocks[0] % blocks[1], block / (blocks[0] * blocks[1])];
        let span = |a: usize| at[a] * BLOCK..((at[a] + 1) * BLOCK).min(size[a]);
        span(2).any(|z| span(1).any(|y| span(0).any(|x| is_seen((z * size[1] + y) * size[0] + x))))
    };
    // An odd stride does not stay in one column.
    let looked = (0..all).step_by((all / MOST) | 1);
    let count = looked.len().max(1) as f64;
    looked.filter(|&block| holds(block)).count() as f64 / count
}

/// Returns the box of an object that is drawn, and the share of rays into it that meet its surface.
fn bounds_and_fill(object: &Object) -> Option<(Aabb, f64)> {
    if why_not_drawn(object).is_some() {
        return None;
    }
    let fill = match &*object.shape {
        Shape::Primitive(Primitive::Box { .. } | Primitive::Plane { .. }) => 0.9,
        Shape::HeightField(_) => 0.8,
        Shape::Primitive(_) => 0.6,
        Shape::Mesh(_) | Shape::Voxels(_) | Shape::FreeForm(_) => 0.5,
        // Light passes through it.
        Shape::Volume(_) => 0.0,
    };
    let bounds = match &*object.shape {
        // A grid may be larger than what is in it.
        Shape::Voxels(voxels) => voxels.filled_bounds().transformed(&object.world_from_object),
        _ => object.bounds(),
    };
    Some((bounds, fill))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, Projection};
    use glam::DVec3;

    #[test]
    fn what_stands_before_takes_rays_from_what_stands_behind() {
        let mut scene = Scene::default();
        let wall = |z: f64| {
            let body = Primitive::Box { size: DVec3::new(2.0, 2.0, 0.1) };
            Object::new("wall", Shape::Primitive(body), 0).at(DVec3::Z * z)
        };
        scene.objects = vec![wall(0.0), wall(-1.0), wall(-2.0)];
        scene.objects[2].visible = false;
        let view = Projection::Orthographic { height: 4.0 };
        let camera = Camera::look_at(DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, view);
        let survey = Survey::of(&scene, &Need::new(camera.clone(), 480, 480));
        let expected = [0.25, 0.025, 0.0];
        for (tested, expected) in survey.tested.iter().zip(expected) {
            assert!((tested - expected).abs() < 1e-9, "{survey:?}");
        }
        assert!((survey.entered - 0.25).abs() < 1e-9 && (survey.seen - 0.2475).abs() < 1e-9, "{survey:?}");
        assert!((survey.length[0] - 0.1).abs() < 1e-9);
        assert!((survey.sum(&scene, |i, _| if i == 0 { 4.0 } else { 0.0 }) - 1.0).abs() < 1e-9);
        let nothing = Survey::of(&Scene::default(), &Need::new(camera, 0, 0));
        assert_eq!((nothing.entered, nothing.seen), (0.0, 0.0));
    }
}
