//! Do the gates catch planted defects, and let harmless changes pass?

mod common;

use common::{builtin, need, studio};
use polyptych::metrics::{ColorErrors, Errors, Gate};
use polyptych::prelude::*;
use std::sync::Arc;

const SIZE: usize = 256;

fn draw(scene: &Scene) -> Framebuffer {
    let scene = Arc::new(scene.clone());
    let need = need(&scene, SIZE as u32, SIZE as u32);
    studio(2).draw("reference", &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer
}

/// Judges displayed colors.
fn passes(picture: &[[f32; 3]], reference: &[[f32; 3]]) -> bool {
    let color = Some(ColorErrors::of_displayed(picture, reference, SIZE, SIZE));
    Gate::EDGE_TOLERANT.judge(&Errors { color, ..Errors::default() }, (SIZE * SIZE) as u64).passed
}

#[test]
fn structural_defects_are_caught() {
    let scene = (*builtin("atelier")).clone();
    let shown = |scene: &Scene| polyptych::metrics::display_colors(&draw(scene));
    let reference = shown(&scene);
    assert!(passes(&reference, &reference));

    let with = |edit: &dyn Fn(&mut Scene)| {
        let mut changed = scene.clone();
        edit(&mut changed);
        shown(&changed)
    };
    let hide = |name: &'static str| {
        move |s: &mut Scene| {
            s.objects.iter_mut().filter(|o| o.name == name).for_each(|o| o.visible = false);
        }
    };
    let pixels = |edit: &dyn Fn(&mut Vec<[f32; 3]>)| {
        let mut changed = reference.clone();
        edit(&mut changed);
        changed
    };
    let defects: Vec<(&str, Vec<[f32; 3]>)> = vec![
        ("a small object is missing", with(&hide("ball"))),
        ("no shadows", with(&|s| s.lights[0].casts_shadow = false)),
        ("light a tenth too bright", with(&|s| s.lights[0].intensity *= 1.1)),
        (
            "a tile was never drawn",
            pixels(&|p| {
                (0..32 * 32).for_each(|i| p[(128 + i / 32) * SIZE + 64 + i % 32] = [0.0; 3]);
            }),
        ),
        (
            "sixty cracks",
            pixels(&|p| {
                (0..60).for_each(|i| p[(i * 37 % SIZE) * SIZE + i * 101 % SIZE] = [1.0; 3]);
            }),
        ),
        ("red and blue swapped", pixels(&|p| p.iter_mut().for_each(|c| c.swap(0, 2)))),
        (
            "shifted by four pixels",
            pixels(&|p| {
                let old = p.clone();
                (0..p.len()).for_each(|i| p[i] = old[i - i % SIZE + (i % SIZE + 4).min(SIZE - 1)]);
            }),
        ),
        (
            "not encoded for the display",
            pixels(&|p| {
                p.iter_mut().for_each(|c| *c = c.map(polyptych::shade::linear_from_srgb));
            }),
        ),
    ];
    for (defect, picture) in &defects {
        assert!(!passes(picture, &reference), "{defect} passed the gate");
    }
}

#[test]
fn a_shift_by_one_pixel_passes() {
    let reference = polyptych::metrics::display_colors(&draw(&builtin("quadrics")));
    let shifted: Vec<_> =
        (0..reference.len()).map(|i| reference[i - i % SIZE + (i % SIZE + 1).min(SIZE - 1)]).collect();
    assert!(passes(&shifted, &reference));
}
