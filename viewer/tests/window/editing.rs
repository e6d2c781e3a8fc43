//! Is the scene changed as its user says, and brought back?

use crate::harness::{drag, rest, window};
use eframe::egui::{Key, Pos2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use polyptych_viewer::Viewer;

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
