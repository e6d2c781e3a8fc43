//! Do the documents tell the truth about what is where?

use std::path::Path;

/// Finds words in backticks and links that look like paths.
fn paths(text: &str) -> Vec<&str> {
    let linked = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    let quoted = text.split('`').skip(1).step_by(2);
    quoted
        .chain(linked)
        .filter(|w| {
            !w.contains(char::is_whitespace)
                && !w.contains("::")
                && !w.starts_with(['-', '/', '.'])
                && !w.starts_with("http")
        })
        .filter(|w| w.contains('/') || [".rs", ".md", ".toml", ".ron"].iter().any(|e| w.ends_with(e)))
        .filter(|w| {
            !w.contains(['<', '*', '{', '(', '$']) && !w.starts_with("out/") && !w.starts_with("target/")
        })
        .collect()
}

#[test]
fn every_path_that_the_documents_name_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for document in ["ARCHITECTURE.md", "README.md"] {
        let text = std::fs::read_to_string(root.join(document)).unwrap_or_else(|e| panic!("{document}: {e}"));
        let named = paths(&text);
        assert!(!named.is_empty(), "{document} names files");
        for path in named {
            assert!(root.join(path).exists(), "{document} names `{path}`, which is not there");
        }
    }
}

#[test]
fn scenes_in_assets_load() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/scenes");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let scene = polyptych::load::load(&path, &polyptych::load::LoadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        assert!(!scene.objects.is_empty());
        count += 1;
    }
    assert!(count > 0);
}
