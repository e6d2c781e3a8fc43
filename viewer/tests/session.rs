//! Does a real window do what a user does in it? Under Xvfb, with Mesa's software rasterizer.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// A display without a screen, for as long as it lives.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// Starts a display; nothing where there is no server for it.
    fn start() -> Option<Self> {
        let number = 300 + std::process::id() % 500;
        let name = format!(":{number}");
        let server = Command::new("Xvfb")
            .args([&name, "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stderr(Stdio::null())
            .spawn()
            .ok()?;
        let socket = PathBuf::from(format!("/tmp/.X11-unix/X{number}"));
        let begin = Instant::now();
        while !socket.exists() {
            assert!(begin.elapsed() < Duration::from_secs(20), "Xvfb gives no display");
            std::thread::sleep(Duration::from_millis(20));
        }
        Some(Self { server, name })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// A small model in a file of its own.
fn model(folder: &Path) -> PathBuf {
    let path = folder.join("roof.obj");
    let text =
        "v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv 0 1 0\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nf 4 3 2 1\n";
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn a_session_in_a_real_window() {
    let Some(display) = Display::start() else {
        println!("skipped: Xvfb is not installed here, so there is no window to try");
        return;
    };
    let folder = std::env::temp_dir().join(format!("polyptych-session-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let shot = |name: &str| folder.join(format!("{name}.png"));
    let mut script = String::from("size 640x400\npanes raster,voxel\n");
    let mut add = |line: String| script += &(line + "\n");
    let take = |name: &str| format!("wait\nshot {}", shot(name).display());
    add(take("first"));
    add("orbit 1".to_owned());
    add(take("turned"));
    for number in 1..=5 {
        add(format!("do Back end {number}"));
        add(take(&format!("backend{number}")));
    }
    add("panes freeform\nbend 6".to_owned());
    add(take("bent"));
    add("do Undo".to_owned());
    add(take("unbent"));
    add("panes raster,stylized\ndo Wipe".to_owned());
    add(take("wipe"));
    add(format!("open {}\ndo Side by side", model(&folder).display()));
    add(take("model"));
    add("quit".to_owned());
    let file = folder.join("session.txt");
    std::fs::write(&file, script).unwrap();

    let begin = Instant::now();
    let done = Command::new(env!("CARGO_BIN_EXE_polyptych-viewer"))
        .args(["--script", file.to_str().unwrap(), "builtin:atelier"])
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .env("LIBGL_ALWAYS_SOFTWARE", "1")
        .env("XDG_RUNTIME_DIR", &folder)
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    println!("{told}the session took {:.1} s", begin.elapsed().as_secs_f64());
    assert!(done.status.success(), "{told}");
    assert!(told.contains("orbit: ") && told.contains("window's thread, with painting: "), "{told}");
    let seen =
        |name: &str| image::open(shot(name)).unwrap_or_else(|e| panic!("{name}: {e}\n{told}")).into_rgb8();
    let differ = |a: &str, b: &str| {
        let (a, b) = (seen(a), seen(b));
        assert_eq!(a.dimensions(), b.dimensions());
        let differs =
            |(a, b): &(&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 8);
        a.pixels().zip(b.pixels()).filter(differs).count() as f64 / f64::from(a.width() * a.height())
    };
    assert!(differ("first", "turned") > 0.2, "the orbit turned it: {}", differ("first", "turned"));
    for number in 2..=5 {
        let share = differ("backend1", &format!("backend{number}"));
        assert!((0.0005..0.5).contains(&share), "back end {number} shows the same scene its way: {share}");
    }
    let (bent, back) = (differ("unbent", "bent"), differ("turned", "model"));
    assert!(bent > 0.002, "the bump is seen: {bent}");
    assert!(back > 0.3, "another scene: {back}");
    assert!(differ("wipe", "unbent") > 0.1);
    if std::env::var_os("POLYPTYCH_KEEP").is_none() {
        std::fs::remove_dir_all(folder).unwrap();
    }
}
