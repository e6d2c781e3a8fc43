//! Does the viewer do what its user asks, without a display?

#[path = "../../tests/common/plugins.rs"]
mod libraries;

use eframe::egui::accesskit::Role;
use eframe::egui::{Event, Key, Modifiers, PointerButton, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use libraries::{compiled, folder};
use polyptych::BuiltinBackends;
use polyptych::plugins::{Isolation, Limits, Options, PluginBackends};
use polyptych::seam::Registry;
use polyptych_viewer::{Mode, Viewer};
use std::time::{Duration, Instant};

fn window(scene: &str) -> Harness<'static, Viewer> {
    window_with(Registry::builtin(), scene)
}

fn window_with(registry: Registry, scene: &str) -> Harness<'static, Viewer> {
    let scene = polyptych::builtin::scene(scene).unwrap();
    let viewer = Viewer::new(registry, scene).unwrap();
    let mut harness = Harness::builder()
        .with_size(Vec2::new(640.0, 360.0))
        .build_ui_state(|ui, viewer: &mut Viewer| viewer.ui(ui), viewer);
    rest(&mut harness);
    harness
}

/// Lets the painters finish.
fn rest(harness: &mut Harness<'_, Viewer>) {
    let begin = Instant::now();
    // Events that wait are handed over one a step.
    harness.run_steps(8);
    while !harness.state().is_at_rest() {
        assert!(begin.elapsed() < Duration::from_secs(100), "the panes never come to rest");
        std::thread::sleep(Duration::from_millis(5));
        harness.step();
    }
    harness.step();
}

fn press(harness: &mut Harness<'_, Viewer>, key: Key) {
    harness.key_press(key);
    rest(harness);
}

fn colors(harness: &Harness<'_, Viewer>, pane: usize) -> usize {
    let (pixels, [width, height]) = harness.state().picture(pane).expect("a picture");
    assert_eq!(pixels.len(), width * height);
    let mut seen: Vec<_> = pixels.to_vec();
    seen.sort_unstable();
    seen.dedup();
    seen.len()
}

fn drag(harness: &mut Harness<'_, Viewer>, from: Pos2, to: Pos2) {
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

#[test]
fn two_back_ends_stand_side_by_side_at_once() {
    let harness = window("polyhedra");
    assert_eq!(harness.state().shown().collect::<Vec<_>>(), ["raster", "reference"]);
    assert!(colors(&harness, 0) > 50 && colors(&harness, 1) > 50);
    let (a, b) = (harness.state().picture(0).unwrap(), harness.state().picture(1).unwrap());
    assert_eq!(a.1, b.1, "panes of one size");
    let differ =
        a.0.iter().zip(b.0).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 8)).count();
    assert!(differ * 50 < a.0.len(), "the same scene from the same side: {differ} of {}", a.0.len());
}

#[test]
fn switching_keeps_camera_and_settings() {
    let mut harness = window("polyhedra");
    drag(&mut harness, Pos2::new(160.0, 200.0), Pos2::new(200.0, 210.0));
    let camera = harness.state().camera().clone();
    let ids: Vec<_> = Registry::builtin().ids().map(str::to_owned).collect();
    for (digit, id) in [Key::Num1, Key::Num3, Key::Num5, Key::Num2].into_iter().zip([0, 2, 4, 1]) {
        press(&mut harness, digit);
        assert_eq!(harness.state().shown().next(), Some(ids[id].as_str()));
        assert_eq!(harness.state().camera().eye, camera.eye);
        assert!(colors(&harness, 0) > 20, "{}", ids[id]);
    }
    assert_eq!(harness.state().shown().nth(1), Some("reference"), "the other pane is left alone");
}

#[test]
fn dragging_turns_the_camera_of_all_panes() {
    let mut harness = window("polyhedra");
    let (eye, before) = (harness.state().camera().eye, harness.state().picture(1).unwrap().0.to_vec());
    drag(&mut harness, Pos2::new(160.0, 200.0), Pos2::new(260.0, 200.0));
    let turned = harness.state().camera().eye;
    assert!(turned.distance(eye) > 0.1, "{eye} {turned}");
    assert_ne!(before, harness.state().picture(1).unwrap().0, "the pane beside it turned, too");
}

#[test]
fn a_parameter_changes_the_picture_and_is_kept() {
    let mut harness = window("polyhedra");
    drag(&mut harness, Pos2::new(100.0, 200.0), Pos2::new(100.0, 200.0));
    press(&mut harness, Key::Num3);
    assert_eq!(harness.state().shown().next(), Some("voxel"));
    let before = harness.state().picture(0).unwrap().0.to_vec();
    harness.get_by_label("Settings").click();
    rest(&mut harness);
    drag(&mut harness, Pos2::new(100.0, 200.0), Pos2::new(100.0, 200.0));
    harness.get_by_role(Role::CheckBox).click();
    rest(&mut harness);
    let set = |harness: &Harness<'_, Viewer>| harness.state().settings("voxel").iter().count();
    assert_eq!(set(&harness), 1);
    assert_ne!(before, harness.state().picture(0).unwrap().0, "no shadows any more");
    for key in [Key::Num2, Key::Num3] {
        // Keys act on the pane under the mouse, and panels differ in width.
        drag(&mut harness, Pos2::new(60.0, 200.0), Pos2::new(60.0, 200.0));
        press(&mut harness, key);
    }
    assert_eq!(harness.state().shown().next(), Some("voxel"));
    assert_eq!(set(&harness), 1, "what was set is still set");
}

#[test]
fn what_differs_between_two_panes_is_mapped() {
    let mut harness = window("polyhedra");
    press(&mut harness, Key::G);
    assert_eq!(harness.state().mode(), Mode::Difference);
    let bright = |harness: &Harness<'_, Viewer>| {
        let map = harness.state().difference().expect("a map");
        assert_eq!(map.len(), harness.state().picture(0).unwrap().0.len());
        map.iter().filter(|p| p[0] > 60).count()
    };
    let edges = bright(&harness);
    let all = harness.state().picture(0).unwrap().0.len();
    assert!(edges > 20 && edges < all / 20, "raster and reference differ at edges only: {edges} of {all}");
    // The first pane becomes the reference, too.
    drag(&mut harness, Pos2::new(60.0, 200.0), Pos2::new(60.0, 200.0));
    press(&mut harness, Key::Num1);
    let same = harness.state().shown().next() == harness.state().shown().nth(1);
    assert!(same, "{:?}", harness.state().shown().collect::<Vec<_>>());
    assert_eq!(bright(&harness), 0);
    press(&mut harness, Key::G);
    assert_eq!((harness.state().mode(), harness.state().difference()), (Mode::SideBySide, None));
}

#[test]
fn panes_are_held_against_the_reference_and_their_values_listed() {
    let mut harness = window("polyhedra");
    assert_eq!(harness.state().error(0), None);
    harness.get_by_label("Errors").click();
    rest(&mut harness);
    let error = |harness: &Harness<'_, Viewer>, pane| harness.state().error(pane).expect("an error");
    assert!(error(&harness, 0).contains(" dB, ids 100.00 %"), "{}", error(&harness, 0));
    assert!(error(&harness, 1).starts_with("same color, ids 100.00 %"), "{}", error(&harness, 1));
    let size = |pane| harness.state().picture(pane).unwrap().1;
    assert_eq!(size(0), size(1), "pictures that are compared have one size");
    harness.get_by_label("Errors").click();
    rest(&mut harness);
    assert_eq!(harness.state().error(0), None);
    // The middle of the picture shows an object; both back ends say which.
    press(&mut harness, Key::V);
    drag(&mut harness, Pos2::new(160.0, 180.0), Pos2::new(160.0, 180.0));
    rest(&mut harness);
    let labels: Vec<_> = harness.query_all_by_label_contains("id ").map(|n| n.value()).collect();
    assert_eq!(labels.len(), 2, "{labels:?}");
    assert!(harness.query_all_by_label_contains("distance ").count() == 2);
}

#[test]
fn space_flips_between_two_panes() {
    let mut harness = window("polyhedra");
    press(&mut harness, Key::Z);
    assert_eq!(harness.state().mode(), Mode::Flip);
    assert!(harness.query_by_label_contains("hold space").is_none(), "it is painted, not a widget");
    harness.key_down(Key::Space);
    harness.run_steps(2);
    press(&mut harness, Key::Num3);
    assert_eq!(harness.state().shown().collect::<Vec<_>>(), ["raster", "voxel"], "keys act on the pane seen");
    harness.key_up(Key::Space);
    harness.run_steps(2);
    press(&mut harness, Key::Num4);
    assert_eq!(harness.state().shown().collect::<Vec<_>>(), ["freeform", "voxel"]);
}

#[test]
fn modes_and_panes_follow_the_bar() {
    let mut harness = window("polyhedra");
    harness.get_by_label("Wipe").click();
    rest(&mut harness);
    assert_eq!(harness.state().mode(), Mode::Wipe);
    assert!(harness.state().picture(0).unwrap().1[0] > 600, "both have the whole width");
    press(&mut harness, Key::X);
    assert_eq!(harness.state().mode(), Mode::SideBySide);
    harness.get_by_label("4").click();
    rest(&mut harness);
    assert_eq!(harness.state().shown().count(), 4);
    assert!((0..4).all(|pane| colors(&harness, pane) > 20));
}

#[test]
fn what_cannot_be_opened_is_said_and_nothing_is_lost() {
    let mut harness = window("polyhedra");
    let (ctx, name) = (harness.ctx.clone(), harness.state().scene().name.clone());
    harness.state_mut().open("/nowhere/nothing.obj", &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().scene().name, name);
    assert!(harness.query_by_label_contains("/nowhere/nothing.obj").is_some(), "the reason is shown");
    harness.state_mut().open("builtin:quadrics", &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().scene().name, "quadrics");
}

/// A back end that is not what it says, as a plugin that crashes is: it panics in every call.
struct Broken;

impl polyptych::seam::BackendFactory for Broken {
    fn info(&self) -> polyptych::seam::BackendInfo {
        polyptych::seam::BackendInfo {
            id: "broken".into(),
            ..Registry::builtin().info("raster").unwrap().clone()
        }
    }
    fn create(&self, _: &Registry) -> Box<dyn polyptych::seam::Renderer> {
        panic!("as it was told")
    }
}

#[test]
fn a_back_end_that_fails_leaves_the_other_panes_alone() {
    let mut registry = Registry::builtin();
    registry.add(std::sync::Arc::new(Broken), polyptych::seam::Origin::BuiltIn);
    let mut harness = window_with(registry, "polyhedra");
    harness.state_mut().list_refused(["liboops.so: is cut off".to_owned()]);
    let whole = colors(&harness, 1);
    press(&mut harness, Key::Num6);
    assert_eq!(harness.state().shown().next(), Some("broken"));
    assert!(harness.query_by_label_contains("broken: it panicked").is_some(), "the pane says why");
    assert_eq!(colors(&harness, 1), whole);
    harness.get_by_label("back end of pane 1").click();
    rest(&mut harness);
    assert!(harness.query_by_label_contains("liboops.so: is cut off").is_some(), "refused ones are listed");
    press(&mut harness, Key::Num1);
    assert!(colors(&harness, 0) > 50, "the next back end draws");
}

#[cfg(target_os = "linux")]
#[test]
fn plugins_that_misbehave_do_so_in_their_own_pane() {
    for (fault, words) in [
        ("segfault", "`render` crashed: it touched memory that is not its own"),
        ("overflow", "`render` crashed: it overflowed its stack"),
        ("hang", "`render` crashed: it gave no sign for 0.4 s and was ended"),
        ("out-of-bounds", "`render` crashed: it touched memory that is not its own"),
        ("exit", "`render` crashed: it ended its process with code 0"),
        ("prepare-segfault", "`prepare` crashed"),
        ("fail", "it does not say why"),
    ] {
        let library = folder(&format!("viewer-{fault}")).join("libanimal.so");
        let initial = format!("-DINITIAL=\"{fault}\"");
        let Some(()) = compiled("plugins/fixtures/zoo/zoo.c", &library, &[&initial]) else { return };
        let options = Options {
            isolation: Isolation::Child { program: env!("CARGO_BIN_EXE_polyptych-viewer").into() },
            limits: Limits { silence: Duration::from_millis(400), ..Limits::default() },
            ..Options::default()
        };
        let mut registry = Registry::builtin();
        registry.load_with(&library, &options).unwrap_or_else(|e| panic!("{e}"));
        let mut harness = window_with(registry, "polyhedra");
        let whole = harness.state().picture(1).unwrap().0.to_vec();
        press(&mut harness, Key::Num6);
        assert_eq!(harness.state().shown().next(), Some("animal"));
        assert!(harness.query_by_label_contains(words).is_some(), "{fault}: the pane says what happened");
        assert!(harness.state().picture(1).unwrap().0 == whole, "{fault}: the other pane is as it was");
        press(&mut harness, Key::Num1);
        assert!(colors(&harness, 0) > 50, "{fault}: the next back end draws");
    }
}

#[test]
fn things_are_hidden_deleted_added_and_brought_back() {
    let mut harness = window("polyhedra");
    let things = harness.state().scene().objects.len();
    let shown = |harness: &Harness<'_, Viewer>| harness.state().picture(0).unwrap().0.to_vec();
    harness.get_by_label("Objects").click();
    rest(&mut harness);
    let before = shown(&harness);
    let name = harness.state().scene().objects[0].name.clone();
    harness.get_by_label(&format!("{name} is drawn")).click();
    rest(&mut harness);
    assert!(!harness.state().scene().objects[0].visible);
    assert_ne!(before, shown(&harness));
    harness.get_by_label("Undo").click();
    rest(&mut harness);
    assert_eq!(before, shown(&harness), "undone");
    harness.get_by_label("Redo").click();
    rest(&mut harness);
    assert!(!harness.state().scene().objects[0].visible);
    harness.get_by_label("Undo").click();
    rest(&mut harness);
    // Delete one, add another one.
    harness.get_by_label(&name).click();
    rest(&mut harness);
    harness.get_by_label("Delete").click();
    rest(&mut harness);
    assert_eq!(harness.state().scene().objects.len(), things - 1);
    assert_ne!(before, shown(&harness));
    harness.get_by_label("Add").click();
    rest(&mut harness);
    harness.get_by_label("cylinder").click();
    rest(&mut harness);
    let scene = harness.state().scene().clone();
    assert_eq!((scene.objects.len(), scene.objects[things - 1].name.as_str()), (things, "cylinder"));
    for _ in 0..2 {
        harness.get_by_label("Undo").click();
        rest(&mut harness);
    }
    assert_eq!(before, shown(&harness), "all is as it was");
}

#[test]
fn a_click_chooses_what_is_seen_and_fields_change_it() {
    let mut harness = window("polyhedra");
    harness.get_by_label("Objects").click();
    rest(&mut harness);
    let before = harness.state().picture(0).unwrap().0.to_vec();
    // Somewhere in the pane an object is seen: the click that finds it shows its fields.
    let found = (0..40).any(|i| {
        let at = Pos2::new(280.0 + 8.0 * (i % 20) as f32, 190.0 + 30.0 * (i / 20) as f32);
        drag(&mut harness, at, at);
        harness.query_by_label("place 0").is_some()
    });
    assert!(found, "nothing was hit");
    harness.get_by_label("place 0").focus();
    harness.run_steps(2);
    (0..5).for_each(|_| harness.key_press(Key::ArrowUp));
    rest(&mut harness);
    let changed = harness.state().picture(0).unwrap().0.to_vec();
    assert_ne!(before, changed, "it moves");
    harness.get_by_label("Undo").click();
    rest(&mut harness);
    assert_eq!(before, harness.state().picture(0).unwrap().0, "one step, however many keys");
}
