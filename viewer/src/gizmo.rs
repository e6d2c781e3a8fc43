//! How is the chosen thing moved, turned and scaled in the picture? By handles along its axes that are painted over it.

use crate::scene_panel::{Chosen, Edit};
use crate::tools::Tool;
use eframe::egui::{self, Color32, Pos2, Rect, Sense, Shape, Stroke, Vec2};
use glam::{DMat3, DQuat, DVec3};
use polyptych::camera::{Camera, Projection};
use polyptych::scene::{LightKind, Scene};
use std::f64::consts::TAU;

/// Length of an arrow, points of the screen.
const LENGTH: f64 = 80.0;
/// Edge of what is grabbed, points.
const GRIP: f32 = 16.0;
/// The axes with their names and colors.
const AXES: [(DVec3, &str, Color32); 3] = [
    (DVec3::X, "x", Color32::from_rgb(230, 70, 70)),
    (DVec3::Y, "y", Color32::from_rgb(80, 200, 80)),
    (DVec3::Z, "z", Color32::from_rgb(80, 120, 250)),
];

/// Returns where a point of the world is in a picture; nothing behind the eye, and of projections that bend lines.
pub(crate) fn project(camera: &Camera, picture: Rect, point: DVec3) -> Option<Pos2> {
    let local = camera.world_from_camera.transpose() * (point - camera.eye);
    let half = match camera.projection {
        Projection::Perspective { fov_y } => -local.z * (fov_y * 0.5).tan(),
        Projection::Orthographic { height } => height * 0.5,
        _ => return None,
    };
    let scale = f64::from(picture.height()) * 0.5 / half;
    let shift = Vec2::new((local.x * scale) as f32, (-local.y * scale) as f32);
    (half > 1e-9 && shift.is_finite()).then(|| picture.center() + shift)
}

/// Shows the handles of the chosen thing. Returns the scene with it moved, turned or scaled.
pub(crate) fn show(
    ui: &egui::Ui,
    picture: Rect,
    camera: &Camera,
    scene: &Scene,
    (tool, chosen): (Tool, Chosen),
    salt: &str,
) -> Option<Edit> {
    let origin = match chosen {
        Chosen::Object(index) => scene.objects.get(index)?.world_from_object.translation,
        Chosen::Light(index) => match scene.lights.get(index)?.kind {
            LightKind::Point { position } | LightKind::Spot { position, .. } => position,
            LightKind::Directional { .. } => return None,
        },
    };
    let middle = project(camera, picture, origin).filter(|p| picture.contains(*p))?;
    let height = f64::from(picture.height()).max(1.0);
    let meter = camera.view(1, height as u32).pixel_size((origin - camera.eye).dot(camera.forward()));
    let painter = ui.painter().with_clip_rect(picture);
    for (index, (axis, name, color)) in AXES.into_iter().enumerate() {
        let place = if tool == Tool::Turn {
            let ring = ring(camera, picture, origin, axis, LENGTH * meter);
            painter.add(Shape::line(ring.clone(), Stroke::new(2.0, color)));
            // Grips of different rings lie apart.
            ring.get(ring.len() / 8 * (1 + 2 * index)).copied()
        } else {
            project(camera, picture, origin + axis * (LENGTH * meter))
        };
        let Some(place) = place else { continue };
        let grip = Rect::from_center_size(place, Vec2::splat(GRIP));
        let response = ui.interact(grip, ui.scope_id().with(("gizmo", salt, name)), Sense::drag());
        let label = format!("{} along {name}", format!("{tool:?}").to_lowercase());
        response.widget_info(|| egui::WidgetInfo::labeled(egui::Role::Button, true, &label));
        let color = if response.hovered() || response.dragged() { Color32::WHITE } else { color };
        match tool {
            Tool::Move => painter.arrow(middle, place - middle, Stroke::new(3.0, color)),
            Tool::Scale => {
                painter.line_segment([middle, place], Stroke::new(3.0, color));
                painter.rect_filled(grip.shrink(3.0), 1.0, color);
            }
            _ => drop(painter.circle_filled(place, 6.0, color)),
        }
        let delta = response.drag_delta();
        if response.dragged() && delta != Vec2::ZERO {
            let amount = if tool == Tool::Turn {
                let towards = if axis.dot(camera.forward()) > 0.0 { -1.0 } else { 1.0 };
                towards * turn_of(place - middle, place + delta - middle)
            } else {
                // What the drag is along the arrow on the screen.
                let arrow = place - middle;
                f64::from(delta.dot(arrow) / arrow.length_sq().max(1.0)) * LENGTH * meter
            };
            return moved(scene, chosen, tool, axis, amount, LENGTH * meter);
        }
    }
    None
}

/// Returns the angle between two directions on the screen, counterclockwise.
fn turn_of(from: Vec2, to: Vec2) -> f64 {
    let cross = f64::from(from.x * to.y - from.y * to.x);
    -cross.atan2(f64::from(from.dot(to)))
}

fn ring(camera: &Camera, picture: Rect, center: DVec3, axis: DVec3, radius: f64) -> Vec<Pos2> {
    let (u, v) = axis.any_orthonormal_pair();
    (0..=48)
        .filter_map(|i| {
            let angle = f64::from(i) / 48.0 * TAU;
            project(camera, picture, center + (u * angle.cos() + v * angle.sin()) * radius)
        })
        .collect()
}

/// Moves by meters, turns by radians, or scales so that what was `length` long grows by meters.
fn moved(scene: &Scene, chosen: Chosen, tool: Tool, axis: DVec3, amount: f64, length: f64) -> Option<Edit> {
    if !amount.is_finite() {
        return None;
    }
    match chosen {
        Chosen::Object(index) => {
            let mut place = scene.objects[index].world_from_object;
            match tool {
                Tool::Move => place.translation += axis * amount,
                Tool::Turn => {
                    place.matrix3 = DMat3::from_quat(DQuat::from_axis_angle(axis, amount)) * place.matrix3;
                }
                _ => {
                    // Along the axis of the object that is nearest to that of the handle: no shear.
                    let factor = (amount / length).clamp(-0.5, 0.5).exp();
                    let columns = [place.matrix3.x_axis, place.matrix3.y_axis, place.matrix3.z_axis];
                    let along = |c: &DVec3| c.normalize_or_zero().dot(axis).abs();
                    let own = (0..3).max_by(|&a, &b| along(&columns[a]).total_cmp(&along(&columns[b])))?;
                    *place.matrix3.col_mut(own) *= factor;
                }
            }
            Some(Edit::new(scene, format!("{tool:?} {index}"), |s| {
                s.objects[index].world_from_object = place;
            }))
        }
        Chosen::Light(index) => {
            let mut light = scene.lights[index].clone();
            match (&mut light.kind, tool) {
                (LightKind::Point { position } | LightKind::Spot { position, .. }, Tool::Move) => {
                    *position += axis * amount;
                }
                (LightKind::Spot { direction, .. }, Tool::Turn) => {
                    *direction = DQuat::from_axis_angle(axis, amount) * *direction;
                }
                _ => return None,
            }
            Some(Edit::new(scene, format!("{tool:?} light {index}"), |s| s.lights[index] = light))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_where_their_rays_go_through() {
        let picture = Rect::from_min_size(Pos2::new(50.0, 20.0), Vec2::new(300.0, 200.0));
        for projection in [Projection::Perspective { fov_y: 0.9 }, Projection::Orthographic { height: 4.0 }] {
            let camera = Camera::look_at(DVec3::new(3.0, 2.0, 5.0), DVec3::ZERO, DVec3::Y, projection);
            for point in [DVec3::ZERO, DVec3::new(1.0, 0.5, -0.3), DVec3::new(-0.7, -0.9, 1.0)] {
                let place = project(&camera, picture, point).unwrap() - picture.min;
                let ray = camera.view(300, 200).ray(f64::from(place.x), f64::from(place.y)).unwrap();
                let along = (point - ray.origin).dot(ray.direction);
                assert!((ray.origin + ray.direction * along).distance(point) < 1e-4);
            }
        }
    }
}
