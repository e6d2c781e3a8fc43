//! Is `polyptych.h` what the Rust types say, and do compilers take it?

use std::path::{Path, PathBuf};
use std::process::Command;

fn header() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("include/polyptych.h")
}

/// Makes the header from the source.
fn generate() -> String {
    let config = cbindgen::Config::from_file(Path::new(env!("CARGO_MANIFEST_DIR")).join("cbindgen.toml"))
        .expect("cbindgen.toml is read");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/lib.rs");
    let bindings = cbindgen::Builder::new().with_config(config).with_src(source).generate();
    let mut text = Vec::new();
    bindings.expect("the types can be said in C").write(&mut text);
    String::from_utf8(text).expect("the header is text")
}

#[test]
fn the_header_says_what_the_types_say() {
    let wanted = generate();
    let kept = std::fs::read_to_string(header()).unwrap_or_default();
    if kept != wanted && std::env::var_os("POLYPTYCH_WRITE_HEADER").is_some() {
        std::fs::write(header(), &wanted).expect("the header is written");
        return;
    }
    assert!(
        kept == wanted,
        "polyptych.h is out of date: run `POLYPTYCH_WRITE_HEADER=1 cargo test -p polyptych-plugin-abi`"
    );
}

#[test]
fn the_header_is_c99_and_cpp17_without_a_warning() {
    let folder = std::env::temp_dir().join(format!("polyptych-header-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (compiler, standard, file) in [("cc", "c99", "header.c"), ("c++", "c++17", "header.cpp")] {
        if Command::new(compiler).arg("--version").output().is_err() {
            eprintln!("skipped: there is no {compiler}");
            continue;
        }
        let source = folder.join(file);
        let text = "#include \"polyptych.h\"\nint main(void) { return (int)sizeof(PolyptychPlugin) == 0; }\n";
        std::fs::write(&source, text).unwrap();
        let done = Command::new(compiler)
            .args(["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only"])
            .arg(format!("-std={standard}"))
            .arg("-I")
            .arg(header().parent().unwrap())
            .arg(&source)
            .output()
            .unwrap();
        assert!(done.status.success(), "{compiler}: {}", String::from_utf8_lossy(&done.stderr));
    }
    std::fs::remove_dir_all(folder).unwrap();
}

/// The C compiler's idea of every struct's size is ours.
#[test]
fn sizes_are_the_same_in_both_languages() {
    use polyptych_plugin_abi as abi;
    macro_rules! sizes {
        ($($name:ident)*) => { [$((stringify!($name), size_of::<abi::$name>())),*] };
    }
    let sizes = sizes!(PolyptychValue PolyptychParameter PolyptychInfo PolyptychCamera PolyptychRay PolyptychMesh
        PolyptychPrimitive PolyptychChunk PolyptychVoxels PolyptychFormNode PolyptychFreeForm PolyptychHeightField
        PolyptychTransferPoint PolyptychVolume PolyptychShape PolyptychObject PolyptychMaterial PolyptychTexture
        PolyptychLight PolyptychEnvironment PolyptychScene PolyptychNeed PolyptychTarget PolyptychHost
        PolyptychPlugin);
    if Command::new("cc").arg("--version").output().is_err() {
        eprintln!("skipped: there is no cc");
        return;
    }
    let checks: String = sizes
        .iter()
        .map(|(name, size)| format!("typedef char check_{name}[sizeof({name}) == {size} ? 1 : -1];\n"))
        .collect();
    let source = std::env::temp_dir().join(format!("polyptych-sizes-{}.c", std::process::id()));
    std::fs::write(&source, format!("#include \"polyptych.h\"\n{checks}")).unwrap();
    let include = header();
    let include = include.parent().unwrap();
    let done = Command::new("cc").arg("-fsyntax-only").arg("-I").arg(include).arg(&source).output().unwrap();
    std::fs::remove_file(source).unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
}
