//! Does the report's page work in a browser? Driven by `tests/report_page.py` through ChromeDriver.

use std::process::Command;

#[test]
fn the_page_works_in_headless_chromium() {
    let present =
        |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    if !(present("python3") && present("chromedriver")) {
        assert!(std::env::var_os("CI").is_none(), "CI needs python3 and chromedriver");
        eprintln!("skipped: python3 and chromedriver are needed");
        return;
    }
    let out = std::env::temp_dir().join(format!("polyptych-report-{}", std::process::id()));
    let done = Command::new(env!("CARGO_BIN_EXE_polyptych"))
        .args(["compare", "builtin:polyhedra", "--size", "320x180", "-q", "-o"])
        .arg(&out)
        .status()
        .expect("the command starts");
    assert!(done.success());
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/report_page.py");
    let checked =
        Command::new("python3").arg(script).arg(out.join("index.html")).output().expect("python3 starts");
    assert!(
        checked.status.success(),
        "{}{}",
        String::from_utf8_lossy(&checked.stdout),
        String::from_utf8_lossy(&checked.stderr)
    );
    std::fs::remove_dir_all(out).expect("the report is removed");
}
