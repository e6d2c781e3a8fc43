//! Do the gates catch planted defects, and let harmless changes pass: each class its own?

mod common;

use common::{builtin, need, studio};
use polyptych::framebuffer::Channels;
use polyptych::metrics::{ColorErrors, Errors, Gate, Verdict, display_colors};
use polyptych::prelude::*;
use polyptych::scene::LightKind;
use std::sync::Arc;

const SIZE: usize = 256;
const CLASSES: [Gate; 4] = [Gate::EXACT, Gate::EDGE_TOLERANT, Gate::STOCHASTIC, Gate::STYLIZED];

type Picture = Vec<[f32; 3]>;

fn draw(scene: &Scene) -> Picture {
    let scene = Arc::new(scene.clone());
    let need = Need { channels: Channels::COLOR, ..need(&scene, SIZE as u32, SIZE as u32) };
    display_colors(&studio(2).draw("reference", &scene, &need).unwrap_or_else(|e| panic!("{e}")).framebuffer)
}

/// Judges displayed colors.
fn judge(gate: &Gate, picture: &Picture, reference: &Picture) -> Verdict {
    let color = Some(ColorErrors::of_displayed(picture, reference, SIZE, SIZE));
    gate.judge(&Errors { color, ..Errors::default() }, (SIZE * SIZE) as u64)
}

/// Returns a letter for each class: P for passed, F for failed, in the order of [`CLASSES`].
fn verdicts(picture: &Picture, reference: &Picture) -> String {
    CLASSES.iter().map(|gate| if judge(gate, picture, reference).passed { 'P' } else { 'F' }).collect()
}

fn shifted(picture: &Picture, by: usize) -> Picture {
    (0..picture.len()).map(|i| picture[i - i % SIZE + (i % SIZE + by).min(SIZE - 1)]).collect()
}

/// Numbers in [-1, 1] without a mean, always the same.
fn noise(i: usize) -> f32 {
    let mixed = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let mixed = (mixed ^ (mixed >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    ((mixed >> 40) as f32 / (1u64 << 23) as f32) - 1.0
}

#[test]
fn every_class_gives_its_verdict_on_every_planted_change() {
    let scene = (*builtin("atelier")).clone();
    let reference = draw(&scene);
    let with = |edit: &dyn Fn(&mut Scene)| {
        let mut changed = scene.clone();
        edit(&mut changed);
        draw(&changed)
    };
    let pixels = |edit: &dyn Fn(&mut Picture)| {
        let mut changed = reference.clone();
        edit(&mut changed);
        changed
    };
    let hide =
        |s: &mut Scene| s.objects.iter_mut().filter(|o| o.name == "ball").for_each(|o| o.visible = false);
    let turn = |s: &mut Scene| {
        if let LightKind::Directional { direction } = &mut s.lights[0].kind {
            *direction = -*direction;
        }
    };
    let tile = |p: &mut Picture| {
        (0..32 * 32).for_each(|i| p[(128 + i / 32) * SIZE + 64 + i % 32] = [0.0; 3]);
    };
    let cracks =
        |p: &mut Picture| (0..60).for_each(|i| p[(i * 37 % SIZE) * SIZE + i * 101 % SIZE] = [1.0; 3]);
    let halved = |p: &mut Picture| {
        let old = p.clone();
        (0..p.len()).for_each(|i| p[i] = old[(i / SIZE / 2 * 2) * SIZE + i % SIZE / 2 * 2]);
    };
    let noisy = |p: &mut Picture| {
        p.iter_mut().enumerate().for_each(|(i, c)| *c = c.map(|v| v + 0.08 * noise(i)));
    };
    // Exact, edge-tolerant, stochastic, stylized.
    let table: Vec<(&str, Picture, &str)> = vec![
        ("the same picture", reference.clone(), "PPPP"),
        ("a small object is missing", with(&hide), "FFFF"),
        ("a tile was never drawn", pixels(&tile), "FFFF"),
        ("sixty cracks", pixels(&cracks), "FFFF"),
        ("no shadows", with(&|s| s.lights[0].casts_shadow = false), "FFFF"),
        ("light a tenth too bright", with(&|s| s.lights[0].intensity *= 1.1), "FFFF"),
        ("lit from behind, as with inverted normals", with(&turn), "FFFF"),
        ("red and blue swapped", pixels(&|p| p.iter_mut().for_each(|c| c.swap(0, 2))), "FFFF"),
        (
            "not encoded for the display",
            pixels(&|p| p.iter_mut().for_each(|c| *c = c.map(polyptych::shade::linear_from_srgb))),
            "FFFF",
        ),
        ("shifted by four pixels", shifted(&reference, 4), "FFFF"),
        // Doubled pixels move nothing by more than a pixel: a class that allows that cannot refuse them.
        ("half the resolution", pixels(&halved), "FPFF"),
        ("noise without a mean", pixels(&noisy), "FFPF"),
    ];
    let wrong: Vec<String> = table
        .iter()
        .filter_map(|(change, picture, expected)| {
            let found = verdicts(picture, &reference);
            let why: Vec<_> = CLASSES.iter().map(|g| judge(g, picture, &reference).failed).collect();
            (found != *expected).then(|| format!("{change}: {found} instead of {expected}: {why:?}"))
        })
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_shift_by_one_pixel_passes_where_edges_may_move() {
    let reference = draw(&builtin("quadrics"));
    assert_eq!(verdicts(&shifted(&reference, 1), &reference), "FPFP");
}

#[test]
fn a_coarser_model_within_the_tolerance_passes_where_edges_may_move() {
    let scene = builtin("polyhedra");
    let need = need(&scene, SIZE as u32, SIZE as u32);
    let mut studio = studio(2);
    studio.prepare("raster", &scene, &need).unwrap();
    let coarse = studio.renderer("raster").unwrap().model().expect("triangles in place of bodies");
    let found = verdicts(&draw(&coarse), &draw(&scene));
    assert_eq!((&found[..2], &found[3..]), ("FP", "P"));
}

#[test]
fn only_the_stylized_class_sees_a_thin_line_that_is_missing() {
    let paper = vec![[0.8; 3]; SIZE * SIZE];
    let mut lined = paper.clone();
    (0..60).for_each(|i| lined[(40 + i) * SIZE + 90 + i / 2] = [0.1; 3]);
    assert!(judge(&Gate::EDGE_TOLERANT, &paper, &lined).passed);
    assert_eq!(judge(&Gate::STYLIZED, &paper, &lined).failed, ["missing 60 > 39"]);
    assert!(judge(&Gate::STYLIZED, &shifted(&lined, 1), &lined).passed);
}
