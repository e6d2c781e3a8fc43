//! How is a window without a display driven?

use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use polyptych::BuiltinBackends;
use polyptych::seam::Registry;
use polyptych_viewer::Viewer;
use std::time::{Duration, Instant};

pub(crate) fn window(scene: &str) -> Harness<'static, Viewer> {
    window_with(Registry::builtin(), scene)
}

pub(crate) fn window_with(registry: Registry, scene: &str) -> Harness<'static, Viewer> {
    let scene = polyptych::builtin::scene(scene).unwrap();
    window_of(Viewer::new(registry, scene).unwrap())
}

pub(crate) fn window_of(viewer: Viewer) -> Harness<'static, Viewer> {
    let mut harness = harness(viewer, Vec2::new(640.0, 360.0));
    rest(&mut harness);
    harness
}

/// A window of some size that may have no room for anything.
pub(crate) fn window_sized(scene: &str, size: Vec2) -> Harness<'static, Viewer> {
    let scene = polyptych::builtin::scene(scene).unwrap();
    harness(Viewer::new(Registry::builtin(), scene).unwrap(), size)
}

fn harness(viewer: Viewer, size: Vec2) -> Harness<'static, Viewer> {
    Harness::builder().with_size(size).build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer)
}

/// Lets the painters finish.
pub(crate) fn rest(harness: &mut Harness<'_, Viewer>) {
    let begin = Instant::now();
    // Events that wait are handed over one a step.
    harness.run_steps(8);
    while !harness.state().is_at_rest() {
        let waits = harness.state().under_way();
        assert!(begin.elapsed() < Duration::from_secs(30), "it never comes to rest: {waits:?}");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
    harness.step();
}

pub(crate) fn press(harness: &mut Harness<'_, Viewer>, key: Key) {
    harness.key_press(key);
    rest(harness);
}

pub(crate) fn colors(harness: &Harness<'_, Viewer>, pane: usize) -> usize {
    let (pixels, [width, height]) = harness.state().picture(pane).expect("a picture");
    assert_eq!(pixels.len(), width * height);
    let mut seen: Vec<_> = pixels.to_vec();
    seen.sort_unstable();
    seen.dedup();
    seen.len()
}

pub(crate) fn drag(harness: &mut Harness<'_, Viewer>, from: Pos2, to: Pos2) {
    let button = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: Modifiers::NONE,
    };
    for event in [Event::PointerMoved(from), button(from, true)] {
        harness.event(event);
        harness.step();
    }
    for event in [Event::PointerMoved(from.lerp(to, 0.5)), Event::PointerMoved(to), button(to, false)] {
        harness.event(event);
        harness.step();
    }
    rest(harness);
}
