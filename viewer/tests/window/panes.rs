//! Do panes show what they are asked for, in every mode?

use crate::harness::{colors, drag, press, rest, window};
use eframe::egui::accesskit::Role;
use eframe::egui::{Event, Key, Modifiers, Pos2, TouchDeviceId, TouchId, TouchPhase, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use polyptych::BuiltinBackends;
use polyptych::seam::Registry;
use polyptych_viewer::{Action, Mode, Viewer};
use std::path::Path;

#[test]
fn two_back_ends_stand_side_by_side_at_once() {
    let harness = window("polyhedra");
    assert_eq!(harness.state().shown().collect::<Vec<_>>(), ["raster", "reference"]);
    assert!(colors(&harness, 0) > 50 && colors(&harness, 1) > 50);
    let (a, b) = (harness.state().picture(0).unwrap(), harness.state().picture(1).unwrap());
    assert_eq!(a.1, b.1, "panes of one size");
    let differ =
        a.0.iter().zip(&b.0).filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| a.abs_diff(*b) > 8)).count();
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
fn two_fingers_zoom_turn_and_shift() {
    let mut harness = window("polyhedra");
    // Where two fingers are, and what that does: eye and up before and after.
    let mut gesture = |from: [[f32; 2]; 2], to: [[f32; 2]; 2]| {
        let touch = |finger: u64, phase: TouchPhase, [x, y]: [f32; 2]| Event::Touch {
            device_id: TouchDeviceId(7),
            id: TouchId(finger),
            phase,
            pos: Pos2::new(x, y),
            force: None,
        };
        let all = |phase, places: [[f32; 2]; 2]| {
            [(); 2].iter().enumerate().map(|(i, ())| touch(i as u64, phase, places[i])).collect::<Vec<_>>()
        };
        let before = harness.state().camera().clone();
        harness.event(Event::PointerMoved(Pos2::new(160.0, 200.0)));
        harness.step();
        let steps = [0.0f32, 0.25, 0.5, 0.75, 1.0];
        for (i, share) in steps.into_iter().enumerate() {
            let place =
                |finger: usize| [0, 1].map(|k| from[finger][k] + (to[finger][k] - from[finger][k]) * share);
            let phase = if i == 0 { TouchPhase::Start } else { TouchPhase::Move };
            harness.input_mut().events.extend(all(phase, [place(0), place(1)]));
            harness.step();
        }
        harness.input_mut().events.extend(all(TouchPhase::End, to));
        rest(&mut harness);
        (before, harness.state().camera().clone())
    };
    let distance = |camera: &polyptych::camera::Camera| camera.eye.length();
    let (before, after) = gesture([[140.0, 200.0], [180.0, 200.0]], [[100.0, 200.0], [220.0, 200.0]]);
    assert!(distance(&after) < distance(&before) * 0.6, "fingers apart: nearer");
    let (before, after) = gesture([[100.0, 200.0], [220.0, 200.0]], [[160.0, 140.0], [160.0, 260.0]]);
    let turned = before.up().angle_between(after.up());
    assert!((turned - std::f64::consts::FRAC_PI_2).abs() < 0.2, "fingers around each other: {turned}");
    let (before, after) = gesture([[140.0, 200.0], [180.0, 200.0]], [[180.0, 230.0], [220.0, 230.0]]);
    assert!(before.eye.distance(after.eye) > 0.05, "both to the side: shifted");
    assert!(before.forward().distance(after.forward()) < 1e-6, "but not turned");
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
    // The last of its switches is that for shadows; it may be below what is seen of the panel.
    harness.get_all_by_role(Role::CheckBox).last().expect("a switch").scroll_to_me();
    rest(&mut harness);
    harness.get_all_by_role(Role::CheckBox).last().expect("a switch").click();
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
fn choosing_a_style_shows_its_numbers() {
    let mut harness = window("polyhedra");
    drag(&mut harness, Pos2::new(100.0, 200.0), Pos2::new(100.0, 200.0));
    press(&mut harness, Key::Num5);
    assert_eq!(harness.state().shown().next(), Some("stylized"));
    press(&mut harness, Key::I);
    harness.set_size(Vec2::new(640.0, 1500.0));
    rest(&mut harness);
    let before = harness.state().picture(0).unwrap().0;
    harness.get_by_label("toon").click();
    rest(&mut harness);
    assert_ne!(harness.state().picture(0).unwrap().0, before, "another style");
    let style = polyptych::stylized::Preset::builtin("toon").unwrap();
    let steps = style.settings["tone.steps"].to_string();
    let field = harness.get_by_role_and_label(Role::SpinButton, "tone.steps");
    assert_eq!(field.accesskit_node().numeric_value().map(|n| n.to_string()), Some(steps));
}

#[test]
fn a_style_is_saved_and_used_again() {
    let folder = std::env::temp_dir().join(format!("polyptych-viewer-style-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("mine.ron").to_string_lossy().into_owned();
    let mut harness = window("polyhedra");
    drag(&mut harness, Pos2::new(100.0, 200.0), Pos2::new(100.0, 200.0));
    press(&mut harness, Key::Num5);
    press(&mut harness, Key::I);
    harness.set_size(Vec2::new(640.0, 1500.0));
    rest(&mut harness);
    harness.get_by_label("blueprint").click();
    rest(&mut harness);
    let blueprint = harness.state().picture(0).unwrap().0.to_vec();
    let write = |harness: &mut Harness<'_, Viewer>, text: &str| {
        let field = harness.get_by_role_and_label(Role::TextInput, "file");
        field.focus();
        harness.run_steps(2);
        harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
        harness.event(Event::Text(text.to_owned()));
        rest(harness);
    };
    write(&mut harness, "mine.txt");
    harness.get_by_label("Save style").click();
    rest(&mut harness);
    assert!(harness.query_by_label_contains("styles are written as .ron").is_some(), "refused at the field");
    write(&mut harness, &file);
    harness.get_by_label("Save style").click();
    rest(&mut harness);
    let style = polyptych::stylized::Preset::load(Path::new(&file)).unwrap();
    assert_eq!(style.settings, polyptych::stylized::Preset::builtin("blueprint").unwrap().settings);
    harness.get_by_label("toon").click();
    rest(&mut harness);
    assert!(harness.state().picture(0).unwrap().0 != blueprint, "another style");
    harness.get_by_label("Use").click();
    rest(&mut harness);
    let again = harness.state().picture(0).unwrap().0;
    let differ = again.iter().zip(&blueprint).filter(|(a, b)| a != b).count();
    assert_eq!(
        (differ, again.len()),
        (0, blueprint.len()),
        "the style of the file: {}",
        harness.state().message()
    );
    std::fs::remove_dir_all(folder).unwrap();
}

#[test]
fn equal_time_draws_what_fits_and_the_chart_grows() {
    let mut harness = window("polyhedra");
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::EqualTime, &ctx);
    rest(&mut harness);
    assert!(colors(&harness, 0) > 20 && colors(&harness, 1) > 20);
    harness.state_mut().perform(Action::EqualTime, &ctx);
    harness.state_mut().perform(Action::EqualError, &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().is_on(Action::EqualError), Some(true));
    harness.state_mut().perform(Action::EqualError, &ctx);
    harness.state_mut().perform(Action::Chart, &ctx);
    rest(&mut harness);
    assert!(harness.query_by_label_contains("2 pictures, the newest large").is_some());
}

#[test]
fn a_program_changes_the_scene_while_it_is_shown() {
    let mut harness = window("polyhedra");
    let before = harness.state().picture(0).unwrap().0;
    harness.state_mut().run(|scene, _, input| {
        if input.key_pressed(Key::Backspace) {
            scene.objects.pop();
        }
    });
    let count = harness.state().scene().objects.len();
    rest(&mut harness);
    assert_eq!(harness.state().picture(0).unwrap().0, before, "who only reads changes nothing");
    press(&mut harness, Key::Backspace);
    assert_eq!(harness.state().scene().objects.len(), count - 1);
    assert_ne!(harness.state().picture(0).unwrap().0, before);
}
