//! Does `polyptych animate` draw its frames once, share them out, and bind them into films?

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn animate(arguments: &[&str], out: &Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_polyptych"));
    command.env("XDG_CACHE_HOME", env!("CARGO_TARGET_TMPDIR"));
    command.args(["animate", "builtin:polyhedra", "--size", "32x18"]).args(arguments).arg("-o").arg(out);
    command.output().expect("the command starts")
}

fn folder(name: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("polyptych-animate-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a temporary folder");
    path
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr)
}

#[test]
fn frames_are_drawn_once_and_shared_out() {
    let out = folder("frames");
    let all = ["--turntable", "--count", "6"];
    let shard = animate(&[&all[..], &["--shard", "2/3"]].concat(), &out);
    assert_eq!(shard.status.code(), Some(0), "{}", said(&shard));
    let there = |frame: u32| out.join(format!("frame-{frame:05}.png"));
    let drawn: Vec<_> = (0..6).filter(|&frame| there(frame).exists()).collect();
    assert_eq!(drawn, [1, 4]);
    let before = std::fs::metadata(there(4)).unwrap().modified().unwrap();
    let rest = animate(&all, &out);
    assert!(said(&rest).contains("4 frames drawn, 2 were there already"), "{}", said(&rest));
    assert_eq!(std::fs::metadata(there(4)).unwrap().modified().unwrap(), before, "what is there is kept");
    let pictures: Vec<_> = (0..6).map(|frame| image::open(there(frame)).unwrap().into_rgb8()).collect();
    assert!((1..6).all(|i| pictures[i] != pictures[0] && pictures[i].dimensions() == (32, 18)));
    // The first frame is the scene's own view.
    let one = out.join("one.png");
    let render = Command::new(env!("CARGO_BIN_EXE_polyptych"))
        .args(["render", "builtin:polyhedra", "--size", "32x18", "-q", "-o"])
        .arg(&one)
        .status();
    assert!(render.unwrap().success());
    assert_eq!(image::open(one).unwrap().into_rgb8(), pictures[0]);
    // Frames of another animation are not mixed in.
    let other = animate(&["--turntable", "--count", "7"], &out);
    assert_eq!(other.status.code(), Some(2));
    assert!(said(&other).contains("holds frames of another animation"), "{}", said(&other));
    std::fs::remove_dir_all(out).unwrap();
}

#[test]
fn films_hold_all_frames() {
    let out = folder("films");
    for name in ["film.gif", "film.apng"] {
        let film = out.join(name);
        let done = animate(&["--turntable", "--frames", "0..5"], &film);
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
        let bytes = std::fs::read(&film).unwrap();
        let count = if name.ends_with("gif") {
            use image::AnimationDecoder;
            let decoder = image::codecs::gif::GifDecoder::new(std::io::Cursor::new(&bytes)).unwrap();
            decoder.into_frames().count()
        } else {
            bytes.windows(4).filter(|chunk| chunk == b"fcTL").count()
        };
        assert_eq!(count, 5, "{name}");
        assert!(!out.join(format!("{name}.frames")).exists(), "frames are put away");
    }
    let still = animate(&["--frames", "0..5"], &out.join("still.gif"));
    assert!(said(&still).contains("--turntable"), "one camera does not fly: {}", said(&still));
    let part = animate(&["--turntable", "--shard", "1/2"], &out.join("part.gif"));
    assert_eq!(part.status.code(), Some(2), "{}", said(&part));
    let wrong = animate(&["--turntable", "--frames", "5..5"], &out);
    assert_eq!(wrong.status.code(), Some(2), "{}", said(&wrong));
    std::fs::remove_dir_all(out).unwrap();
}
