//! Can everything be done from the palette and by keys?

use crate::harness::{press, rest, window};
use eframe::egui::accesskit::Role;
use eframe::egui::{Key, Modifiers, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT, Queryable};
use polyptych_viewer::{ACTIONS, Action, Mode, Viewer};

#[test]
fn every_action_of_the_palette_runs_once() {
    let mut harness = window("polyhedra");
    // Screenshots and sheets go to the current folder.
    let folder = std::env::temp_dir().join(format!("polyptych-actions-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for entry in ACTIONS.iter().filter(|e| !matches!(e.action, Action::Screenshot | Action::Sheet)) {
        let before = harness.state().is_on(entry.action);
        harness.key_press_modifiers(Modifiers::COMMAND, Key::P);
        harness.run_steps(2);
        assert!(
            harness.query_by_label("What do you want to do?").is_some(),
            "{}: the palette opens",
            entry.name
        );
        harness.get_by_label("What do you want to do?");
        harness.event(eframe::egui::Event::Text(entry.name.to_owned()));
        harness.run_steps(2);
        harness.key_press(Key::Enter);
        harness.run_steps(3);
        if entry.action != Action::Palette {
            assert!(harness.query_by_label("What do you want to do?").is_none(), "{}: it closes", entry.name);
        }
        let after = harness.state().is_on(entry.action);
        let stays =
            matches!(entry.action, Action::SideBySide | Action::NoTool | Action::Backend(_) | Action::Watch);
        assert!(stays || before.is_none() || before != after, "{} switches something", entry.name);
        // What was opened is closed again, so that one does not hide the next.
        for _ in 0..3 {
            harness.key_press(Key::Escape);
            harness.run_steps(2);
        }
        if harness.state().is_on(Action::Turntable) == Some(true) {
            harness.key_press(Key::T);
            harness.run_steps(2);
        }
    }
    rest(&mut harness);
    assert!(harness.state().picture(0).is_some(), "and all panes still draw");
}

#[test]
fn keys_are_those_of_the_table() {
    let mut harness = window("polyhedra");
    let eye = harness.state().camera().eye;
    harness.key_press_modifiers(Modifiers::SHIFT, Key::Num5);
    rest(&mut harness);
    assert!(harness.state().camera().forward().y < -0.999, "from above");
    press(&mut harness, Key::Home);
    assert_eq!(harness.state().camera().eye, eye, "the scene's own camera");
    press(&mut harness, Key::P);
    assert_eq!(harness.state().is_on(Action::Parallel), Some(true));
    press(&mut harness, Key::Plus);
    assert_eq!(harness.state().shown().count(), 3);
    press(&mut harness, Key::Minus);
    press(&mut harness, Key::Minus);
    assert_eq!(harness.state().shown().count(), 1);
    harness.key_press_modifiers(Modifiers::SHIFT, Key::G);
    rest(&mut harness);
    assert_eq!(harness.state().mode(), Mode::ErrorMaps);
    // Letters that are written are no keys.
    harness.key_press_modifiers(Modifiers::COMMAND, Key::O);
    harness.run_steps(3);
    harness.key_press(Key::X);
    harness.run_steps(3);
    assert_eq!(harness.state().mode(), Mode::ErrorMaps);
}

#[test]
fn the_first_screen_says_how_and_goes() {
    let mut harness = window("polyhedra");
    press(&mut harness, Key::F1);
    assert!(harness.query_by_label_contains("Drop a model onto this window").is_some());
    harness.get_by_label("Begin").click();
    rest(&mut harness);
    assert!(harness.query_by_label_contains("Drop a model onto this window").is_none());
}

/// A window with all panels open.
fn full() -> Harness<'static, Viewer> {
    let mut harness = window("quadrics");
    let ctx = harness.ctx.clone();
    harness.set_size(Vec2::new(1200.0, 1600.0));
    harness.state_mut().choose(0);
    for action in [
        Action::RemovePane,
        Action::Objects,
        Action::Settings,
        Action::Values,
        Action::Move,
        Action::Backend(4),
    ] {
        harness.state_mut().perform(action, &ctx);
    }
    rest(&mut harness);
    harness
}

fn is_control(role: Role) -> bool {
    matches!(
        role,
        Role::Button
            | Role::CheckBox
            | Role::ComboBox
            | Role::SpinButton
            | Role::Slider
            | Role::TextInput
            | Role::ColorWell
    )
}

#[test]
fn every_control_has_a_name_for_screen_readers() {
    let harness = full();
    let mut count = 0;
    let mut nameless = Vec::new();
    for node in harness.root().children_recursive() {
        let node = node.accesskit_node();
        if is_control(node.role()) {
            count += 1;
            if node.label().is_none_or(|label| label.trim().is_empty()) {
                nameless.push(format!("{:?} {:?}", node.role(), node.value()));
            }
        }
    }
    assert!(count > 60, "{count} controls");
    assert_eq!(nameless, [""; 0], "of {count}");
}

#[test]
fn tab_reaches_every_control() {
    let mut harness = full();
    let controls = |harness: &Harness<'_, Viewer>| {
        let nodes = harness.root().children_recursive().collect::<Vec<_>>();
        let of = |node: &egui_kittest::Node<'_>| {
            let node = node.accesskit_node();
            let name = format!("{:?} {:?} {:?}", node.id(), node.role(), node.label());
            (is_control(node.role()) && !node.is_disabled()).then_some((name, node.is_focused()))
        };
        nodes.iter().filter_map(of).collect::<Vec<_>>()
    };
    let mut waits: Vec<String> = controls(&harness).into_iter().map(|(name, _)| name).collect();
    let count = waits.len();
    assert!(count > 60, "{count} controls");
    for _ in 0..count * 2 {
        harness.key_press(Key::Tab);
        harness.run_steps(2);
        let focused: Vec<_> = controls(&harness).into_iter().filter(|(_, focused)| *focused).collect();
        waits.retain(|name| focused.iter().all(|(at, _)| at != name));
    }
    assert_eq!(waits, [""; 0], "of {count} are never reached");
}
