//! How does a drawing become a file of vectors?

use crate::stroke::{Kind, Stroke};
use crate::style::Styles;
use polyptych_core::pixels::srgb_bytes;
use polyptych_core::scene::Scene;
use std::collections::HashMap;
use std::fmt::Write;

/// Parts of a pixel that ends of strokes are rounded to, to find those that go on.
const FINE: f32 = 64.0;

/// Writes lines as an SVG picture: a group for each object and kind, strokes that go on as one path.
pub(crate) fn picture(strokes: &[Stroke], scene: &Scene, styles: &Styles, size: [u32; 2]) -> String {
    let [width, height] = size;
    let mut svg = String::new();
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
         viewBox=\"0 0 {width} {height}\" fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">"
    );
    let paper = &styles.all[0].paper;
    if paper.is_shown {
        let _ = writeln!(svg, "<rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>", hex(paper.color));
    }
    let mut sorted: Vec<&Stroke> = strokes.iter().collect();
    sorted.sort_by_key(|s| (s.is_hidden, s.kind, s.object));
    sorted.reverse();
    sorted.sort_by_key(|s| (!s.is_hidden, s.kind, s.object));
    for same in sorted.chunk_by(|a, b| (a.is_hidden, a.kind, a.object) == (b.is_hidden, b.kind, b.object)) {
        let first = same[0];
        let pen = styles.all[usize::from(first.style)].pen(first.kind);
        let name = scene.objects.get(first.object as usize).map_or("", |o| o.name.as_str());
        let dashes = if first.is_hidden { " stroke-dasharray=\"5 4\" stroke-opacity=\"0.7\"" } else { "" };
        let _ = writeln!(
            svg,
            "<g data-object=\"{}\" data-kind=\"{}\" stroke=\"{}\" stroke-width=\"{}\"{dashes}>",
            escaped(name),
            word(first.kind),
            hex(pen.color),
            pen.width
        );
        for path in joined(same) {
            let points: Vec<String> = path.iter().map(|[x, y]| format!("{x:.2} {y:.2}")).collect();
            let _ = writeln!(svg, "<path d=\"M{}\"/>", points.join(" L"));
        }
        svg.push_str("</g>\n");
    }
    svg.push_str("</svg>\n");
    svg
}

/// Joins strokes whose ends meet into paths.
fn joined(strokes: &[&Stroke]) -> Vec<Vec<[f32; 2]>> {
    let key = |p: [f32; 2]| p.map(|c| (c * FINE).round() as i32);
    let mut at: HashMap<[i32; 2], Vec<usize>> = HashMap::new();
    for (i, stroke) in strokes.iter().enumerate() {
        at.entry(key(stroke.from)).or_default().push(i);
        at.entry(key(stroke.to)).or_default().push(i);
    }
    let mut used = vec![false; strokes.len()];
    let mut paths = Vec::new();
    for i in 0..strokes.len() {
        if used[i] {
            continue;
        }
        used[i] = true;
        let mut path = std::collections::VecDeque::from([strokes[i].from, strokes[i].to]);
        for forward in [true, false] {
            loop {
                let end = if forward { path[path.len() - 1] } else { path[0] };
                let Some(&next) = at.get(&key(end)).and_then(|list| list.iter().find(|&&n| !used[n])) else {
                    break;
                };
                used[next] = true;
                let other =
                    if key(strokes[next].from) == key(end) { strokes[next].to } else { strokes[next].from };
                if forward { path.push_back(other) } else { path.push_front(other) }
            }
        }
        paths.push(path.into());
    }
    paths
}

fn word(kind: Kind) -> &'static str {
    kind.parameters()[0]
}

fn hex(color: glam::Vec3) -> String {
    let [r, g, b] = srgb_bytes(color);
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn escaped(text: &str) -> String {
    let plain = |c: char| match c {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        c if c.is_control() => " ".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(plain).collect()
}
