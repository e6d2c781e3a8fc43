//! Are the lines there, all of them and no others, without gaps, and do they hold still?

mod common;

use common::{Easel, LINES, ball, central, cube, direction, joined, luminance, parallel, scene};
use glam::{DVec3, Vec3};
use polyptych_core::camera::Camera;
use polyptych_core::framebuffer::{Channel, Channels, Framebuffer};
use polyptych_core::scene::{Mesh, Primitive, Shape};
use polyptych_stylized::{Kind, Stroke};
use std::collections::{HashMap, HashSet};

const SIZE: u32 = 160;

fn length(s: &Stroke) -> f32 {
    (s.to[0] - s.from[0]).hypot(s.to[1] - s.from[1])
}

/// Returns how far a point is from a segment.
fn away(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (d, q) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let square = (d[0] * d[0] + d[1] * d[1]).max(1e-12);
    let part = ((q[0] * d[0] + q[1] * d[1]) / square).clamp(0.0, 1.0);
    (q[0] - d[0] * part).hypot(q[1] - d[1] * part)
}

/// The twelve edges of the cube on the picture, and whether each bounds a face that is turned to the eye.
fn cube_edges(camera: &Camera, eye: impl Fn(DVec3) -> DVec3, height: f64) -> Vec<([f32; 2], [f32; 2], bool)> {
    let to_picture = |p: DVec3| {
        let v = camera.world_from_camera.transpose() * p;
        let scale = f64::from(SIZE) / height;
        [(v.x * scale + f64::from(SIZE) * 0.5) as f32, (f64::from(SIZE) * 0.5 - v.y * scale) as f32]
    };
    let mut edges = Vec::new();
    for axis in 0..3 {
        for (s, t) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)] {
            let mut ends = [DVec3::ZERO; 2];
            for (end, along) in ends.iter_mut().zip([-0.5, 0.5]) {
                (end[axis], end[(axis + 1) % 3], end[(axis + 2) % 3]) = (along, s, t);
            }
            let faces = [((axis + 1) % 3, s), ((axis + 2) % 3, t)];
            let is_seen = faces.iter().any(|&(axis, side)| {
                let mut normal = DVec3::ZERO;
                normal[axis] = side * 2.0;
                normal.dot(eye(normal * 0.5)) > 0.0
            });
            edges.push((to_picture(ends[0]), to_picture(ends[1]), is_seen));
        }
    }
    edges
}

#[test]
fn a_cube_shows_nine_edges_from_a_hundred_directions_and_no_more() {
    let scene = scene(vec![(Shape::Mesh(cube(1.0)), DVec3::ZERO)], DVec3::Y);
    for i in 0..100 {
        let camera = parallel(direction(i, 100), 2.0);
        let toward = -camera.forward();
        let strokes = Easel::new(&scene, camera.clone(), [SIZE; 2], &LINES).strokes();
        let edges = cube_edges(&camera, |_| toward, 2.0);
        assert_eq!(edges.iter().filter(|e| e.2).count(), 9, "direction {i}");
        let mut shown = [0.0f32; 12];
        for stroke in &strokes {
            assert!(!stroke.is_hidden);
            let near =
                |e: &([f32; 2], [f32; 2], bool)| away(stroke.from, e.0, e.1).max(away(stroke.to, e.0, e.1));
            let best = (0..12).min_by(|&a, &b| near(&edges[a]).total_cmp(&near(&edges[b]))).unwrap();
            assert!(near(&edges[best]) < 0.05, "direction {i}: a line that is no edge");
            shown[best] += length(stroke);
        }
        for (edge, shown) in edges.iter().zip(shown) {
            let full = (edge.1[0] - edge.0[0]).hypot(edge.1[1] - edge.0[1]);
            if edge.2 {
                assert!(
                    (shown - full).abs() < 0.01,
                    "direction {i}: {shown} of {full} pixels of a seen edge"
                );
            } else {
                assert_eq!(shown, 0.0, "direction {i}: a hidden edge");
            }
        }
    }
}

#[test]
fn the_same_edges_come_out_where_the_cube_is_one_of_many_triangles_or_a_primitive() {
    let camera = parallel(DVec3::new(0.5, 0.6, 0.7).normalize_or_zero(), 2.0);
    let body = Shape::Primitive(Primitive::Box { size: DVec3::ONE });
    for (shape, visibility) in
        [(Shape::Mesh(cube(1.0)), "reference"), (body.clone(), "raster"), (body, "reference")]
    {
        let scene = scene(vec![(shape, DVec3::ZERO)], DVec3::Y);
        let settings = [&LINES[..], &[("visibility", visibility)]].concat();
        let strokes = Easel::new(&scene, camera.clone(), [SIZE; 2], &settings).strokes();
        let total: f32 = strokes.iter().map(length).sum();
        let edges = cube_edges(&camera, |_| -camera.forward(), 2.0);
        let full: f32 = edges.iter().filter(|e| e.2).map(|e| (e.1[0] - e.0[0]).hypot(e.1[1] - e.0[1])).sum();
        assert!((total - full).abs() < 0.1, "{visibility}: {total} of {full}");
    }
}

#[test]
fn hidden_edges_are_dashed_where_that_is_asked_for() {
    let scene = scene(vec![(Shape::Mesh(cube(1.0)), DVec3::ZERO)], DVec3::Y);
    let camera = parallel(DVec3::new(0.5, 0.6, 0.7).normalize_or_zero(), 2.0);
    let settings = [&LINES[..], &[("contours.hidden", "dash")]].concat();
    let strokes = Easel::new(&scene, camera, [SIZE; 2], &settings).strokes();
    let hidden: f32 = strokes.iter().filter(|s| s.is_hidden).map(length).sum();
    let seen: f32 = strokes.iter().filter(|s| !s.is_hidden).map(length).sum();
    // Three of twelve edges, of three lengths, each of which occurs four times.
    assert!((hidden * 3.0 - seen).abs() < 15.0, "{hidden} hidden, {seen} seen");
}

/// Joins strokes at their ends; tells how many curves there are, and how many ends hang loose.
fn curves(strokes: &[Stroke]) -> (usize, usize) {
    let key = |p: [f32; 2]| p.map(|c| (c * 16.0).round() as i32);
    let mut at: HashMap<[i32; 2], Vec<usize>> = HashMap::new();
    for (i, s) in strokes.iter().enumerate().filter(|(_, s)| key(s.from) != key(s.to)) {
        at.entry(key(s.from)).or_default().push(i);
        at.entry(key(s.to)).or_default().push(i);
    }
    let loose = at.values().filter(|list| list.len() != 2).count();
    let mut seen = HashSet::new();
    let mut count = 0;
    for start in 0..strokes.len() {
        if key(strokes[start].from) == key(strokes[start].to) || !seen.insert(start) {
            continue;
        }
        count += 1;
        let mut left = vec![start];
        while let Some(i) = left.pop() {
            for end in [strokes[i].from, strokes[i].to] {
                left.extend(at[&key(end)].iter().copied().filter(|&n| seen.insert(n)));
            }
        }
    }
    (count, loose)
}

#[test]
fn a_smooth_ball_has_one_closed_silhouette_and_no_line_within() {
    let primitive = Shape::Primitive(Primitive::Sphere { radius: 1.0 });
    let mesh = Shape::Mesh(ball(1.0, 96, true));
    for (shape, visibility) in [
        (mesh.clone(), "raster"),
        (mesh, "reference"),
        (primitive.clone(), "raster"),
        (primitive, "reference"),
    ] {
        let scene = scene(vec![(shape, DVec3::ZERO)], DVec3::Y);
        let settings = [&LINES[..], &[("visibility", visibility)]].concat();
        for eye in [DVec3::new(0.3, 1.1, 3.0), DVec3::new(2.0, -1.9, 1.4), DVec3::new(0.01, 0.02, 4.0)] {
            let strokes = Easel::new(&scene, central(eye, 0.8), [SIZE; 2], &settings).strokes();
            // The circle of the tangents: its radius is that of the tangent of its angle.
            let distance = eye.length();
            let radius = (1.0 / (distance * distance - 1.0).sqrt()) / 0.4f64.tan() * f64::from(SIZE) * 0.5;
            // One pixel; and half of one more that the rasterizer's triangles may be off a primitive.
            let is_cut = visibility == "raster" && matches!(*scene.objects[0].shape, Shape::Primitive(_));
            let bound = if is_cut { 1.5 } else { 1.0 };
            for stroke in &strokes {
                assert_eq!(stroke.kind, Kind::Silhouette);
                let out = (stroke.from[0] - 80.0).hypot(stroke.from[1] - 80.0);
                assert!(
                    (out - radius as f32).abs() < bound,
                    "{visibility}: {out} from the middle, not {radius}"
                );
            }
            assert_eq!(curves(&strokes), (1, 0), "{visibility} from {eye}");
        }
    }
}

/// Draws lines alone, and counts the areas between them that hold more than one region: a gap in the line between two
/// regions joins them. Regions are what is parted by a line: an object, and of flat ones each face.
fn leaks(
    scene: &std::sync::Arc<polyptych_core::scene::Scene>,
    camera: &Camera,
    settings: &[(&str, &str)],
    by_face: bool,
) -> usize {
    let settings = [&LINES[..], settings].concat();
    let channels = Channels::of(&[Channel::Color, Channel::Id, Channel::Normal]);
    let picture = Easel::with_channels(scene, camera.clone(), [SIZE; 2], &settings, channels).picture();
    let is_line = |i: usize| luminance(picture.color()[i]) < 0.5;
    let region = |i: usize| {
        let normal = picture.normal()[i].to_array().map(|c| (c * 8.0).round() as i32);
        (picture.id()[i], if by_face { normal } else { [0; 3] })
    };
    let mut seen = vec![false; picture.color().len()];
    let mut leaks = 0;
    for start in 0..seen.len() {
        if seen[start] || is_line(start) {
            continue;
        }
        let (mut left, mut regions) = (vec![start], HashMap::new());
        seen[start] = true;
        while let Some(i) = left.pop() {
            *regions.entry(region(i)).or_insert(0) += 1;
            let (x, y) = (i as u32 % SIZE, i as u32 / SIZE);
            let mut visit = |x: u32, y: u32| {
                let n = (y * SIZE + x) as usize;
                if !seen[n] && !is_line(n) {
                    seen[n] = true;
                    left.push(n);
                }
            };
            if x > 0 {
                visit(x - 1, y);
            }
            if y > 0 {
                visit(x, y - 1);
            }
            if x + 1 < SIZE {
                visit(x + 1, y);
            }
            if y + 1 < SIZE {
                visit(x, y + 1);
            }
        }
        // Single pixels on the wrong side of a line are its width, no gap.
        let whole: usize = regions.values().sum();
        let others = whole - regions.values().copied().max().unwrap_or(0);
        leaks += usize::from(others > 3);
    }
    leaks
}

/// A name, bodies, what is set, and whether faces are regions.
type Subject = (&'static str, Vec<(Shape, DVec3)>, &'static [(&'static str, &'static str)], bool);

#[test]
fn lines_of_flat_crowded_and_crossing_bodies_have_no_gaps() {
    let flat = ball(1.0, 6, false);
    // Three sheets at one edge, wound as they come, and a fourth alone.
    let fan = Mesh {
        positions: [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.1, 0.3], [-0.9, 0.2, 0.4], [0.1, 0.0, -1.1]]
            .map(Vec3::from_array)
            .to_vec(),
        triangles: vec![[0, 1, 2], [1, 0, 3], [0, 1, 4]],
        ..Mesh::default()
    };
    let two = joined(&[(cube(1.0), Vec3::ZERO), (cube(0.8), Vec3::new(0.1, 1.2, 0.0))]);
    let shapes: [Subject; 5] = [
        ("flat ball", vec![(Shape::Mesh(flat.clone()), DVec3::ZERO)], &[("crease.angle", "5")], true),
        ("fan", vec![(Shape::Mesh(fan), DVec3::ZERO)], &[("crease.angle", "5")], true),
        ("two in one", vec![(Shape::Mesh(two), DVec3::ZERO)], &[], true),
        (
            "crossing cubes",
            vec![
                (Shape::Mesh(cube(1.0)), DVec3::ZERO),
                (Shape::Mesh(cube(0.9)), DVec3::new(0.4, 0.35, 0.45)),
            ],
            &[("silhouette.width", "1.5"), ("intersection.width", "1.5")],
            false,
        ),
        (
            "ball in a cube",
            vec![
                (Shape::Mesh(cube(1.2)), DVec3::ZERO),
                (Shape::Primitive(Primitive::Sphere { radius: 0.7 }), DVec3::new(0.2, 0.5, 0.1)),
            ],
            &[],
            false,
        ),
    ];
    for (name, shapes, settings, by_face) in shapes {
        let scene = scene(shapes, DVec3::Y);
        for i in 0..16 {
            let camera = central(direction(i, 16) * 4.0, 0.7);
            assert_eq!(leaks(&scene, &camera, settings, by_face), 0, "{name} from direction {i}");
        }
    }
}

/// Counts pixels that jump by more than a quarter from picture to picture, which no line does that moves by a sixteenth
/// of a pixel.
fn toggles(pictures: &[Vec<f32>]) -> usize {
    let count = |w: &[Vec<f32>]| w[0].iter().zip(&w[1]).filter(|(a, b)| (**a - **b).abs() > 0.25).count();
    pictures.windows(2).map(count).sum()
}

/// Counts pixels that pass a half and, within half of the frames that a line takes to pass by, turn back: what flickers, and
/// not what a line passes on its way.
fn turns(pictures: &[Vec<f32>]) -> usize {
    const SOON: usize = 8;
    let turns_of = |pixel: usize| {
        let is_dark = |frame: &Vec<f32>| frame[pixel] < 0.5;
        let changes: Vec<usize> =
            (1..pictures.len()).filter(|&i| is_dark(&pictures[i]) != is_dark(&pictures[i - 1])).collect();
        changes.windows(2).filter(|w| w[1] - w[0] < SOON).count()
    };
    (0..pictures[0].len()).map(turns_of).sum()
}

/// Shrinks a picture.
fn reduced(picture: &Framebuffer, times: u32) -> Vec<f32> {
    let width = picture.width() / times;
    let mean = |i: u32| {
        let (x, y) = (i % width * times, i / width * times);
        let all = (0..times * times).map(|k| ((y + k / times) * picture.width() + x + k % times) as usize);
        all.map(|i| luminance(picture.color()[i])).sum::<f32>() / (times * times) as f32
    };
    (0..width * picture.height() / times).map(mean).collect()
}

#[test]
fn lines_toggle_no_more_pixels_than_those_of_an_antialiased_reference() {
    let scene = scene(
        vec![
            (Shape::Mesh(cube(1.0)), DVec3::new(-0.7, 0.0, 0.0)),
            (Shape::Mesh(ball(0.6, 24, true)), DVec3::new(0.8, 0.1, 0.2)),
        ],
        DVec3::Y,
    );
    let eye = DVec3::new(0.5, 0.9, 4.0);
    let pixel = 4.0 * 2.0 * 0.35f64.tan() / f64::from(SIZE);
    let cameras: Vec<Camera> = (0..24)
        .map(|i| {
            let base = central(eye, 0.7);
            Camera { eye: base.eye + base.right() * (pixel / 16.0 * f64::from(i)), ..base }
        })
        .collect();
    let mut own = Easel::new(&scene, cameras[0].clone(), [SIZE; 2], &LINES);
    // Four by four samples of a pixel, lines four times as wide.
    let wide: Vec<(String, String)> =
        [("silhouette.width", 8.0), ("crease.width", 4.8), ("border.width", 6.4)]
            .map(|(name, width): (&str, f64)| (name.to_owned(), width.to_string()))
            .to_vec();
    let wide: Vec<(&str, &str)> = wide.iter().map(|(a, b)| (a.as_str(), b.as_str())).collect();
    let settings = [&LINES[..], &wide[..], &[("visibility", "reference")]].concat();
    let mut fine = Easel::new(&scene, cameras[0].clone(), [SIZE * 4; 2], &settings);
    let threads = polyptych_core::parallel::Pool::new(2).unwrap();
    let drawn: Vec<Vec<f32>> = cameras.iter().map(|c| reduced(&own.picture_from(c, &threads), 1)).collect();
    let truth: Vec<Vec<f32>> = cameras.iter().map(|c| reduced(&fine.picture_from(c, &threads), 4)).collect();
    let (ours, theirs) = (toggles(&drawn), toggles(&truth));
    println!("{ours} toggles, {theirs} of the reference");
    assert!(ours <= theirs, "{ours} toggles, {theirs} of the reference");
    let (ours, theirs) = (turns(&drawn), turns(&truth));
    println!("{ours} turn back, {theirs} of the reference");
    assert!(ours <= theirs, "{ours} turn back, {theirs} of the reference");
}

#[test]
fn a_mesh_that_crosses_itself_has_the_lines_of_two_that_cross() {
    let parts = [(cube(1.0), Vec3::ZERO), (cube(0.9), Vec3::new(0.4, 0.35, 0.45))];
    let one = scene(vec![(Shape::Mesh(joined(&parts)), DVec3::ZERO)], DVec3::Y);
    let [a, b] = parts.map(|(mesh, at)| (Shape::Mesh(mesh), at.as_dvec3()));
    let two = scene(vec![a, b], DVec3::Y);
    let lengths = |strokes: Vec<Stroke>| {
        let crossings: f32 = strokes.iter().filter(|s| s.kind == Kind::Intersection).map(length).sum();
        (crossings, strokes.iter().map(length).sum::<f32>())
    };
    let (mut of_one, mut of_two) = ([0.0f32; 2], [0.0f32; 2]);
    for i in 0..16 {
        let camera = central(direction(i, 16) * 4.0, 0.7);
        for (scene, sums) in [(&one, &mut of_one), (&two, &mut of_two)] {
            let (crossings, all) = lengths(Easel::new(scene, camera.clone(), [SIZE; 2], &LINES).strokes());
            (sums[0], sums[1]) = (sums[0] + crossings, sums[1] + all);
        }
        // Its own are exact: each place lies on both bodies, which only the eye may not see.
        let without = [&LINES[..], &[("intersection", "false")]].concat();
        let strokes = Easel::new(&one, camera, [SIZE; 2], &without).strokes();
        assert!(strokes.iter().all(|s| s.kind != Kind::Intersection));
    }
    // Those of two bodies are found pixel by pixel, and go around corners.
    assert!(of_one[0] > 500.0 && (of_one[0] / of_two[0] - 1.0).abs() < 0.1, "{of_one:?} {of_two:?}");
    assert!((of_one[1] / of_two[1] - 1.0).abs() < 0.05, "{of_one:?} {of_two:?}");
}

#[test]
fn vectors_are_written_as_closed_paths_with_their_objects() {
    let mut scene = (*scene(vec![(Shape::Mesh(ball(1.0, 16, true)), DVec3::ZERO)], DVec3::Y)).clone();
    scene.objects[0].name = "a <ball> & more".to_owned();
    let scene = std::sync::Arc::new(scene);
    let mut easel = Easel::new(&scene, central(DVec3::Z * 3.0, 0.8), [SIZE; 2], &LINES);
    let (frame, control) = (easel.need.frame(), polyptych_core::seam::Control::simple());
    let svg = easel.renderer.svg(&frame, SIZE, SIZE, &control).unwrap();
    assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
    assert!(svg.contains("data-object=\"a &lt;ball&gt; &amp; more\" data-kind=\"silhouette\""));
    assert_eq!(svg.matches("<path ").count(), 1, "one closed curve is one path");
}
