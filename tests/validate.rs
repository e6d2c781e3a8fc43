//! Does `polyptych validate` pass what is right, and name what is wrong?

#![cfg(target_os = "linux")]

#[path = "common/plugins.rs"]
mod libraries;

use libraries::{built, compiled, folder};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs checks against a plugin; returns the exit code and what was printed.
fn validate(library: &Path, words: &[&str]) -> (Option<i32>, String) {
    validate_with(library, words, "")
}

/// Does the same with a planted defect.
fn validate_with(library: &Path, words: &[&str], defect: &str) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_polyptych"));
    command.arg("validate").arg(library).args(words).env("POLYPTYCH_DEFECT", defect);
    let done = command.output().expect("the command starts");
    let text = [done.stdout, done.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    (done.status.code(), text)
}

#[test]
fn the_template_keeps_every_promise_and_the_report_says_so() {
    let out = folder("validate-template");
    let (code, text) = validate(&built("polyptych_template"), &["-o", out.to_str().unwrap()]);
    let report: Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    let checks = report["checks"].as_array().unwrap();
    assert_eq!(checks.len(), 17);
    // How soon a plugin stops is measured, and other tests keep the processors busy beside this one.
    let failed: Vec<_> =
        checks.iter().filter(|c| c["passed"] == false && c["name"] != "stops-soon").collect();
    assert!(failed.is_empty(), "{text}");
    let kept = checks.iter().filter(|c| c["passed"] == true).count();
    assert_eq!(
        (code, report["passed"] == true),
        (Some(if kept == 17 { 0 } else { 4 }), kept == 17),
        "{text}"
    );
    let words = format!("{kept} of 17 promises are kept");
    assert!(text.contains(&format!("template: {words}")), "{text}");
    assert!(std::fs::read_to_string(out.join("report.html")).unwrap().contains(&words));
}

/// Checks that neither measure the machine nor convert the whole default scene.
const QUICK: &str =
    "after-a-switch,sizes,every-pixel,required,empty-scene,cancelling,edits,parameters,wild-numbers";

#[test]
fn the_example_in_c_keeps_every_promise() {
    let library = folder("validate-facets").join("libfacets.so");
    let Some(()) = compiled("plugins/examples/facets/facets.c", &library, &["-std=c99"]) else { return };
    let (code, text) = validate(&library, &["--only", QUICK]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn the_example_in_rust_keeps_every_promise() {
    let (code, text) = validate(&built("polyptych_occlusion"), &["--only", QUICK]);
    assert_eq!(code, Some(0), "{text}");
}

/// Returns the code of the tutorial in a language.
fn tutorial(language: &str) -> String {
    let text = std::fs::read_to_string(libraries::source("docs/write_a_backend.md")).unwrap();
    let code = text.split(&format!("```{language}\n")).nth(1).and_then(|rest| rest.split("```").next());
    code.unwrap_or_default().to_owned()
}

#[test]
fn the_tutorial_in_c_keeps_every_promise() {
    let folder = folder("tutorial");
    let source = folder.join("balls.c");
    std::fs::write(&source, tutorial("c")).unwrap();
    let library = folder.join("libballs.so");
    let strict = ["-std=c99", "-Wpedantic"];
    // `compiled` takes files of the project; an absolute one stays as it is.
    let Some(()) = compiled(source.to_str().unwrap(), &library, &strict) else { return };
    let (code, text) = validate(&library, &["--only", QUICK]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn the_tutorial_in_rust_keeps_every_promise() {
    let built_from =
        std::fs::read_to_string(libraries::source("plugins/fixtures/tutorial/src/lib.rs")).unwrap();
    assert!(tutorial("rust") == built_from, "docs/write_a_backend.md and plugins/fixtures/tutorial differ");
    let (code, text) = validate(&built("polyptych_tutorial"), &["--only", QUICK]);
    assert_eq!(code, Some(0), "{text}");
}

#[test]
fn faults_are_named() {
    for (fault, check, words) in [
        ("segfault", "second-frame", "touched memory that is not its own"),
        ("out-of-bounds", "sizes", "touched memory that is not its own"),
        ("overflow", "second-frame", "overflowed its stack"),
        ("exit", "second-frame", "ended its process with code 0"),
        ("hang", "second-frame", "gave no sign for"),
        ("nan", "sizes", "numbers are not finite"),
        ("flicker", "second-frame", "a second frame differs: color"),
        ("leak", "keeps-no-memory", "more bytes"),
        ("lie", "accounts", "does not say how it is drawn"),
        ("unwritten", "every-pixel", "pixels of color are not written"),
        ("fail", "second-frame", "it does not say why"),
    ] {
        let library = folder(&format!("validate-{fault}")).join("libanimal.so");
        let initial = format!("-DINITIAL=\"{fault}\"");
        let Some(()) = compiled("plugins/fixtures/zoo/zoo.c", &library, &[&initial]) else { return };
        let (code, text) = validate(&library, &["--only", check, "--timeout", "4"]);
        assert_eq!(code, Some(4), "{fault}: {text}");
        assert!(text.starts_with(&format!("FAILED {check}: ")) && text.contains(words), "{fault}: {text}");
    }
}

#[test]
fn planted_defects_are_seen_and_shown() {
    let library = built("polyptych_defects");
    let out = folder("defects");
    let words = ["--only", "picture", "-o", out.to_str().unwrap()];
    // Edges may be off by a pixel: what moves nothing by more is harmless.
    for harmless in ["none", "half-resolution"] {
        let (code, text) = validate_with(&library, &words, harmless);
        assert_eq!(code, Some(0), "{harmless}: {text}");
    }
    for defect in [
        "missing-object",
        "undrawn-tile",
        "cracks",
        "no-shadow",
        "bright-light",
        "shift",
        "inverted-normals",
        "swapped-channels",
        "not-linear",
    ] {
        let (code, text) = validate_with(&library, &words, defect);
        assert_eq!(code, Some(4), "{defect}: {text}");
        let shown = text.split("see ").nth(1).and_then(|rest| rest.split([';', '\n']).next());
        let shown = shown.unwrap_or_else(|| panic!("{defect}: {text}"));
        assert!(Path::new(shown).exists(), "{defect}: {shown}");
    }
}

#[test]
fn what_is_refused_is_refused_input_and_unknown_checks_are_wrong_use() {
    let (code, text) = validate(Path::new("Cargo.toml"), &[]);
    assert_eq!((code, text.lines().count()), (Some(3), 1), "{text}");
    let (code, text) = validate(&built("polyptych_template"), &["--only", "beauty"]);
    assert!(code == Some(2) && text.contains("same-bytes, second-frame"), "{text}");
}
