//! Is the scene changed as its user says, and brought back?

use crate::harness::{drag, press, rest, window};
use eframe::egui::accesskit::Role;
use eframe::egui::{Event, Key, Modifiers, Pos2, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use polyptych::scene::{Form, Primitive, Shape};
use polyptych_viewer::{Action, Viewer};

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

fn write(harness: &mut Harness<'_, Viewer>, field: &str, text: &str) {
    harness.get_by_role_and_label(Role::SpinButton, field).click();
    harness.run_steps(3);
    harness.key_press_modifiers(Modifiers::COMMAND, Key::A);
    harness.event(Event::Text(text.to_owned()));
    harness.run_steps(3);
    harness.key_press(Key::Enter);
    rest(harness);
}

#[test]
fn numbers_that_will_not_do_are_refused_at_their_field() {
    let mut harness = window("polyhedra");
    // All fields are to be in sight, and one small picture is enough.
    harness.key_press(Key::Minus);
    harness.set_size(Vec2::new(500.0, 1400.0));
    press(&mut harness, Key::O);
    harness.get_by_label("Add").click();
    rest(&mut harness);
    harness.get_by_label("frustum").click();
    rest(&mut harness);
    let index = harness.state().scene().objects.len() - 1;
    let body = |harness: &Harness<'_, Viewer>| match *harness.state().scene().objects[index].shape {
        Shape::Primitive(body) => body,
        _ => panic!("no body"),
    };
    write(&mut harness, "height", "2.5");
    let Primitive::Frustum { height, sides, .. } = body(&harness) else { panic!("no frustum") };
    assert_eq!((height, sides), (2.5, 6));
    write(&mut harness, "upper radius", "0");
    for (field, text, words) in [
        ("height", "-1", "height must be at least 0.000001, got -1"),
        ("height", "tall", "a number is written like 1.5"),
        ("sides", "2", "sides must be 3 to 4096, got 2"),
        ("lower radius", "0", "`lower_radius + upper_radius` must be positive, got 0"),
    ] {
        let before = body(&harness);
        write(&mut harness, field, text);
        let said: Vec<_> = harness.query_all_by_label_contains("m").filter_map(|n| n.value()).collect();
        assert!(said.iter().any(|s| s == words), "{field} = {text}: no `{words}` in {said:?}");
        assert_eq!(body(&harness), before, "{field} = {text} changes nothing");
    }
    write(&mut harness, "height", "3");
    assert!(harness.query_by_label_contains("a number is written").is_none(), "it goes when it is mended");
}

#[test]
fn forms_are_bent_and_unbent() {
    let mut harness = window("atelier");
    // All fields are to be in sight, and one small picture is enough.
    harness.key_press(Key::Minus);
    harness.set_size(Vec2::new(500.0, 1400.0));
    press(&mut harness, Key::O);
    let scene = harness.state().scene().clone();
    let index = scene.objects.iter().position(|o| o.name == "sculpture").expect("a perturbed form");
    harness.state_mut().choose(index);
    rest(&mut harness);
    let before = harness.state().picture(0).unwrap().0;
    write(&mut harness, "weight 0", "3.5");
    let Shape::FreeForm(free) = &*harness.state().scene().objects[index].shape.clone() else { panic!() };
    let Form::Difference(body, _) = free.form() else { panic!() };
    assert!(matches!(&**body, Form::Perturbed { terms, .. } if terms[0].weight == 3.5));
    assert_ne!(harness.state().picture(0).unwrap().0, before);
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::Undo, &ctx);
    rest(&mut harness);
    assert_eq!(harness.state().picture(0).unwrap().0, before);
}

#[test]
fn handles_move_turn_and_scale() {
    let mut harness = window("polyhedra");
    let ctx = harness.ctx.clone();
    harness.state_mut().choose(0);
    harness.state_mut().perform(Action::FrameChosen, &ctx);
    harness.state_mut().perform(Action::RemovePane, &ctx);
    for (action, handle) in
        [(Action::Move, "move along y"), (Action::Turn, "turn along x"), (Action::Scale, "scale along y")]
    {
        harness.state_mut().perform(action, &ctx);
        rest(&mut harness);
        let (place, eye) =
            (harness.state().scene().objects[0].world_from_object, harness.state().camera().eye);
        let at = harness.get_by_label(handle).rect().center();
        drag(&mut harness, at, at + Vec2::new(4.0, -12.0));
        let now = harness.state().scene().objects[0].world_from_object;
        assert_ne!(place, now, "{handle}");
        assert_eq!(harness.state().camera().eye, eye, "{handle} does not turn the camera");
        match action {
            Action::Move => {
                let shift = now.translation - place.translation;
                assert!(shift.y > 0.0 && shift.x == 0.0 && shift.z == 0.0, "{shift}");
            }
            Action::Turn => {
                assert!((now.matrix3.determinant() / place.matrix3.determinant() - 1.0).abs() < 1e-9);
            }
            _ => assert!(now.matrix3.determinant() > place.matrix3.determinant() * 1.01),
        }
    }
}

#[test]
fn voxels_are_painted_and_terrain_is_raised() {
    let mut harness = window("atelier");
    let ctx = harness.ctx.clone();
    harness.state_mut().perform(Action::RemovePane, &ctx);
    let find = |harness: &Harness<'_, Viewer>, wanted: fn(&Shape) -> bool| {
        harness.state().scene().objects.iter().position(|o| wanted(&o.shape)).unwrap()
    };
    let cells = find(&harness, |s| matches!(s, Shape::Voxels(_)));
    let land = find(&harness, |s| matches!(s, Shape::HeightField(_)));
    let filled = |harness: &Harness<'_, Viewer>| match &*harness.state().scene().objects[cells].shape {
        Shape::Voxels(voxels) => voxels.filled(),
        _ => 0,
    };
    let sum = |harness: &Harness<'_, Viewer>| match &*harness.state().scene().objects[land].shape {
        Shape::HeightField(field) => field.heights().iter().map(|&h| f64::from(h)).sum(),
        _ => 0.0,
    };
    let start = filled(&harness);
    harness.state_mut().choose(cells);
    harness.state_mut().perform(Action::FrameChosen, &ctx);
    harness.state_mut().perform(Action::Erase, &ctx);
    rest(&mut harness);
    let middle = Pos2::new(320.0, 215.0);
    drag(&mut harness, middle, middle + Vec2::new(6.0, 0.0));
    let fewer = filled(&harness);
    assert!(fewer < start, "{fewer} of {start}");
    harness.state_mut().perform(Action::Paint, &ctx);
    rest(&mut harness);
    drag(&mut harness, middle, middle + Vec2::new(6.0, 0.0));
    assert!(filled(&harness) > fewer);
    let flat: f64 = sum(&harness);
    harness.state_mut().choose(land);
    harness.state_mut().perform(Action::Top, &ctx);
    harness.state_mut().perform(Action::Raise, &ctx);
    rest(&mut harness);
    for x in [150.0, 250.0, 400.0] {
        drag(&mut harness, Pos2::new(x, 330.0), Pos2::new(x + 5.0, 330.0));
    }
    assert!(sum(&harness) > flat, "the land is raised");
    while harness.state().can_undo() {
        harness.state_mut().perform(Action::Undo, &ctx);
    }
    assert_eq!((filled(&harness), sum(&harness)), (start, flat), "all is as it was");
}
