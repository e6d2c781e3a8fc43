//! Which numbers make a parametric body?

use crate::field::{POSITIVE, numbers};
use eframe::egui;
use polyptych::scene::Primitive;
use std::f64::consts::PI;

/// Shows the numbers of a body. Tells whether one was changed.
pub(super) fn fields(ui: &mut egui::Ui, body: &mut Primitive) -> bool {
    match body {
        Primitive::Box { size } => numbers(ui, "edges", [&mut size.x, &mut size.y, &mut size.z], &POSITIVE),
        Primitive::Sphere { radius } => numbers(ui, "radius", [radius], &POSITIVE),
        Primitive::Cylinder { radius, height } | Primitive::Cone { radius, height } => {
            numbers(ui, "radius", [radius], &POSITIVE) | numbers(ui, "height", [height], &POSITIVE)
        }
        Primitive::Torus { major, minor } => {
            numbers(ui, "radius of the ring", [major], &POSITIVE)
                | numbers(ui, "radius of the tube", [minor], &POSITIVE)
        }
        Primitive::Plane { width, depth } => {
            numbers(ui, "width", [width], &POSITIVE) | numbers(ui, "depth", [depth], &POSITIVE)
        }
        Primitive::Frustum { sides, lower_radius, upper_radius, height } => {
            let mut count = f64::from(*sides);
            let sided = numbers(ui, "sides", [&mut count], &(3.0..=4096.0));
            *sides = count.round() as u32;
            // The edge of the base and its radius say the same: the base keeps its share to the top.
            let chord = 2.0 * (PI / f64::from(*sides)).sin();
            let mut edge = *lower_radius * chord;
            let edged = numbers(ui, "edge of the base", [&mut edge], &POSITIVE);
            if edged {
                let share = if *lower_radius > 0.0 { *upper_radius / *lower_radius } else { 1.0 };
                *lower_radius = edge / chord;
                *upper_radius = *lower_radius * share;
            }
            sided
                | edged
                | numbers(ui, "lower radius", [lower_radius], &(0.0..=1e9))
                | numbers(ui, "upper radius", [upper_radius], &(0.0..=1e9))
                | numbers(ui, "height", [height], &POSITIVE)
        }
    }
}
