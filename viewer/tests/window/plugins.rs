//! Does a back end that misbehaves do so in its own pane?

use crate::harness::{colors, press, rest, window_with};
use crate::libraries::{compiled, folder};
use eframe::egui::Key;
use egui_kittest::kittest::Queryable;
use polyptych::BuiltinBackends;
use polyptych::plugins::{Isolation, Limits, Options, PluginBackends};
use polyptych::seam::Registry;
use std::time::Duration;

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
