//! Do STL and PLY files load, whatever their encoding, and are lying counts refused?

use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::{Mesh, Scene, Shape};
use std::path::PathBuf;

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("polyptych-meshes-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn load(&self, name: &str, bytes: &[u8]) -> Result<Scene, String> {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).unwrap();
        load(&path, &LoadOptions::default()).map_err(|error| error.to_string())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn mesh(scene: &Scene) -> &Mesh {
    let Shape::Mesh(mesh) = &*scene.objects[0].shape else { panic!("not a mesh") };
    mesh.check().unwrap();
    mesh
}

/// The four faces of a tetrahedron with corners at the origin and on the axes.
const TETRAHEDRON: [[[f32; 3]; 3]; 4] = [
    [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
];

fn binary_stl(count: u32) -> Vec<u8> {
    let mut bytes = b"solid but binary".to_vec();
    bytes.resize(80, 0);
    bytes.extend(count.to_le_bytes());
    for face in TETRAHEDRON {
        bytes.extend([0u8; 12]);
        bytes.extend(face.iter().flatten().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0u8; 2]);
    }
    bytes
}

#[test]
fn binary_and_text_stl_are_the_same_body() {
    let folder = Folder::new("stl");
    let mut text = String::from("solid t\r\n");
    for face in TETRAHEDRON {
        text += "facet normal 0 0 0\r\n outer loop\r\n";
        for [x, y, z] in face {
            text += &format!("  vertex {x} {y:e} {z}\r\n");
        }
        text += " endloop\r\nendfacet\r\n";
    }
    text += "endsolid t\r\n";
    for (name, bytes) in [("b.stl", binary_stl(4)), ("t.STL", text.clone().into_bytes())] {
        let scene = folder.load(name, &bytes).unwrap();
        let mesh = mesh(&scene);
        assert_eq!(mesh.triangles.len(), 4);
        assert!((mesh.volume() - 1.0 / 6.0).abs() < 1e-6, "{name}: {}", mesh.volume());
        assert_eq!(mesh.normals.len(), mesh.positions.len());
    }
    let error = folder.load("lie.stl", &binary_stl(1_000_000_000)).unwrap_err();
    assert!(error.contains("byte 80: 1000000000 triangles are promised, 4 are there"), "{error}");
    for cut in [0, 10, 83, 84, 120] {
        let _ = folder.load("cut.stl", &binary_stl(4)[..cut]);
    }
    let error = folder.load("word.stl", b"solid\nfacet\nouter loop\nvertex 0 x 0\n").unwrap_err();
    assert!(error.contains("line 4: `x` is no number"), "{error}");
    let error = folder.load("end.stl", &text.as_bytes()[..text.len() - 32]).unwrap_err();
    assert!(error.contains("the last facet has no end"), "{error}");
}

const PLY_HEADER: &str = "comment made by hand\nelement vertex 4\nproperty float x\nproperty float y\nproperty double z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement odd 1\nproperty list uchar short stuff\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n";

fn binary_ply(format: &str, big: bool) -> Vec<u8> {
    let mut bytes = format!("ply\nformat {format} 1.0\n{PLY_HEADER}").into_bytes();
    let mut put = |value: &[u8]| {
        let mut value = value.to_vec();
        if big {
            value.reverse();
        }
        bytes.extend(value);
    };
    for (x, y) in [(0.0f32, 0.0f32), (2.0, 0.0), (2.0, 3.0), (0.0, 3.0)] {
        put(&x.to_le_bytes());
        put(&y.to_le_bytes());
        put(&0.5f64.to_le_bytes());
        put(&[255]);
        put(&[0]);
        put(&[188]);
    }
    put(&[2]);
    put(&7i16.to_le_bytes());
    put(&8i16.to_le_bytes());
    put(&[4]);
    (0..4i32).for_each(|i| put(&i.to_le_bytes()));
    bytes
}

#[test]
fn ply_in_every_encoding_is_the_same_rectangle() {
    let folder = Folder::new("ply");
    let text = format!(
        "ply\nformat ascii 1.0\n{PLY_HEADER}0 0 0.5 255 0 188\n2 0 0.5 255 0 188\n2 3 0.5 255 0 188\n0 3 0.5 255 0 188\n2 7 8\n4 0 1 2 3\n"
    );
    for (name, bytes) in [
        ("text.ply", text.into_bytes()),
        ("little.ply", binary_ply("binary_little_endian", false)),
        ("big.ply", binary_ply("binary_big_endian", true)),
    ] {
        let scene = folder.load(name, &bytes).unwrap();
        let mesh = mesh(&scene);
        assert_eq!((mesh.triangles.len(), mesh.area()), (2, 6.0), "{name}");
        assert!((mesh.colors[0].z - 0.5029).abs() < 1e-3, "colors are sRGB in the file: {}", mesh.colors[0]);
        for cut in (0..bytes.len()).step_by(11).chain([bytes.len() - 3, bytes.len() - 1]) {
            // the text may lack its last line break
            let loaded = folder.load("cut.ply", &bytes[..cut]);
            assert!(loaded.is_err() || cut + 1 == bytes.len(), "{name} cut at {cut} was loaded");
        }
    }
    for (name, change, message) in [
        ("count.ply", ("element vertex 4", "element vertex 4000000000"), "are promised"),
        ("index.ply", ("4 0 1 2 3", "4 0 1 2 4"), "face 0: vertex 4 of 4"),
        ("list.ply", ("4 0 1 2 3", "9000 0 1 2 3"), "a list of 9000"),
        ("type.ply", ("double z", "quad z"), "line 7: this number format is not known"),
    ] {
        let text = format!(
            "ply\nformat ascii 1.0\n{PLY_HEADER}0 0 0.5 1 0 1\n2 0 0.5 1 0 1\n2 3 0.5 1 0 1\n0 3 0.5 1 0 1\n2 7 8\n4 0 1 2 3\n"
        );
        let error = folder.load(name, text.replace(change.0, change.1).as_bytes()).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
}
