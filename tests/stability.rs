//! Do methods break no earlier than LIMITS.md says, and can a single pixel be drawn again? A quick part of the cases; the
//! whole is `polyptych stability --check LIMITS.md`.

use std::process::{Command, Output};

fn stability(arguments: &[&str], out: &std::path::Path) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_polyptych"));
    command.arg("stability").args(arguments).args(["--threads", "2", "-o"]).arg(out);
    command.output().expect("the command starts")
}

#[test]
fn nothing_breaks_earlier_than_written_and_what_does_is_told() {
    let out = std::env::temp_dir().join(format!("polyptych-stability-{}", std::process::id()));
    let limits = concat!(env!("CARGO_MANIFEST_DIR"), "/LIMITS.md");
    let cases = [
        "degenerate",
        "shared-edges",
        "coplanar",
        "depth-resolution",
        "huge-triangles",
        "voxel-edges",
        "voxel-corners",
        "missing-lines",
    ];
    let done = stability(&[&cases[..], &["--check", limits]].concat(), &out);
    let told = String::from_utf8_lossy(&done.stderr);
    assert_eq!(done.status.code(), Some(0), "{told}");
    for name in ["index.html", "stability.json", "LIMITS.md", "coplanar.svg"] {
        assert!(out.join(name).exists(), "no {name}");
    }
    let outcomes: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("stability.json")).unwrap()).unwrap();
    for field in ["case", "backend", "parameter", "values", "error", "breaks_at", "limit", "passed"] {
        assert!(outcomes[0].get(field).is_some(), "no {field}");
    }

    // As if the rasterizer had told coplanar faces apart at any distance before.
    let was = std::fs::read_to_string(limits).unwrap();
    let better: String = was
        .split("\n## ")
        .map(|part| {
            let never = |line: &str| match line.split('|').collect::<Vec<_>>()[..] {
                ["", " raster ", way, _, ref rest @ ..] if part.starts_with("coplanar") => {
                    format!("| raster |{way}| never |{}", rest.join("|"))
                }
                _ => line.to_owned(),
            };
            part.lines().map(never).collect::<Vec<_>>().join("\n")
        })
        .collect::<Vec<_>>()
        .join("\n## ");
    let file = out.join("better.md");
    std::fs::write(&file, better).unwrap();
    let done = stability(&["coplanar", "-b", "raster", "--check", file.to_str().unwrap()], &out);
    let told = String::from_utf8_lossy(&done.stderr);
    assert!(
        done.status.code() == Some(4) && told.contains("worse: coplanar: raster (plain) breaks at"),
        "{told}"
    );

    let done = stability(&["coplanar", "-b", "raster", "--at", "1e-9"], &out);
    let told = String::from_utf8_lossy(&done.stdout);
    assert!(
        done.status.success() && told.contains("pixel ") && told.contains("held against: color"),
        "{told}"
    );
    let done = stability(&["coplanarity"], &out);
    assert_eq!(done.status.code(), Some(2));
    std::fs::remove_dir_all(out).expect("the run is removed");
}
