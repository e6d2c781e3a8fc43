//! Do scene files say what they mean, in both languages and both directions, and do wrong ones say what is wrong?

use glam::{DAffine3, DVec2, DVec3, Vec3};
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::load::{LoadOptions, SceneFile, json_schema, load, save};
use polyptych_core::scene::{
    Form, FreeForm, HeightField, Light, LightKind, Material, Mesh, NormalMap, Object, Perturbation, Power,
    Primitive, Samples, Scene, Shape, Texture, Volume, Voxels,
};
use std::path::PathBuf;

struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("polyptych-scenes-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn load(&self, name: &str, text: &str) -> Result<Scene, String> {
        let path = self.0.join(name);
        std::fs::write(&path, text).unwrap();
        load(&path, &LoadOptions::default()).map_err(|error| error.to_string())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A scene with one shape of every kind, built in code.
fn everything() -> Scene {
    let mut scene = Scene { name: "everything".to_owned(), ..Scene::default() };
    let rgba: Vec<u8> = (0..6 * 4).map(|i| (i * 37 % 256) as u8).collect();
    let picture = scene.add_texture(Texture::from_srgb8("picture", 3, 2, &rgba));
    let red = scene.add_material(Material { name: "red".into(), ..Material::new(Vec3::new(0.5, 0.01, 0.0)) });
    let twin =
        scene.add_material(Material { name: "red".into(), texture: Some(picture), ..Material::default() });
    let bumps = scene.add_texture(Texture::from_linear8("bumps", 3, 2, &rgba));
    scene.materials[red].normal_map = Some(NormalMap { texture: bumps, scale: 0.5 });
    let blob = Form::Perturbed {
        base: Box::new(Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::new(1.0, 0.5, 1.0) }),
        terms: vec![Perturbation {
            weight: 0.3,
            power: Power::Cube,
            function: Form::Ellipsoid { center: DVec3::X, radii: DVec3::splat(0.4) },
        }],
    };
    let mesh = Mesh {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.1, 0.2, 0.3)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        slots: vec![0, 1],
        segments: vec![[1, 3]],
        ..Mesh::default()
    };
    let samples = Samples::I16((0..24).map(|i| i * 100 - 500).collect());
    let mut volume = Volume::new([2, 3, 4], DVec3::new(0.5, 0.5, 1.0), samples).unwrap();
    volume.shell = Some(FreeForm::new(Form::Ellipsoid { center: DVec3::ZERO, radii: DVec3::ONE }).unwrap());
    let tilted = DAffine3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.3);
    scene.objects = vec![
        Object::new("cup", Shape::Primitive(Primitive::prism(6, 1.0, 2.0)), red)
            .at(DVec3::new(0.1, 0.2, 0.3)),
        Object { materials: vec![red, twin], ..Object::new("mesh", Shape::Mesh(mesh), red).placed(tilted) },
        Object::new(
            "cells",
            Shape::Voxels(Voxels::from_fn([65, 2, 3], |x, y, z| ((x + y + z) % 3) as u8)),
            twin,
        ),
        Object::new("blob", Shape::FreeForm(FreeForm::new(blob).unwrap()), red),
        Object {
            visible: false,
            required: true,
            ..Object::new(
                "land",
                Shape::HeightField(
                    HeightField::new(3, 2, DVec2::new(2.0, 1.5), vec![0.0, 0.1, 0.7, 1.0, 0.5, 0.2]).unwrap(),
                ),
                red,
            )
        },
        Object::new("scan", Shape::Volume(volume), red),
    ];
    scene.lights = vec![
        Light::directional(DVec3::new(-0.5, -0.8, -0.6)),
        Light {
            kind: LightKind::Spot { position: DVec3::Y, direction: DVec3::NEG_Y, inner: 0.25, outer: 0.5 },
            casts_shadow: false,
            ..Light::point(DVec3::ZERO, 3.5)
        },
    ];
    let projection = Projection::Fisheye { fov: 3.0 };
    scene.cameras =
        vec![("side".to_owned(), Camera::look_at(DVec3::X * 4.0, DVec3::ZERO, DVec3::Y, projection))];
    scene
}

#[test]
fn every_shape_reads_back_as_it_was_written() {
    let folder = Folder::new("round");
    let scene = everything();
    for name in ["scene.ron", "scene.json"] {
        let path = folder.0.join(name);
        save(&scene, &path).unwrap();
        let read = load(&path, &LoadOptions::default()).unwrap();
        assert_eq!(read.notes, Vec::<String>::new());
        assert_eq!((read.name.as_str(), read.objects.len()), ("everything", 6));
        for (old, new) in scene.objects.iter().zip(&read.objects) {
            assert_eq!(old.name, new.name);
            assert_eq!(old.world_from_object, new.world_from_object, "{}", old.name);
            assert_eq!((old.visible, old.required), (new.visible, new.required));
            let (a, b) = (old.bounds(), new.bounds());
            assert!((a.min - b.min).length() + (a.max - b.max).length() < 0.1, "{}: {a:?} {b:?}", old.name);
        }
        check_shapes(&scene, &read);
        assert_eq!(read.material(&read.objects[0], 0).base_color, Vec3::new(0.5, 0.01, 0.0));
        assert!(read.material(&read.objects[1], 1).texture.is_some());
        for x in 0..3 {
            let uv = [(x as f32 + 0.5) / 3.0, 0.75];
            for (old, new) in scene.materials.iter().zip(&read.materials) {
                let textures = |m: &Material| [m.texture, m.normal_map.map(|map| map.texture)];
                for (old, new) in textures(old).into_iter().zip(textures(new)) {
                    let texel =
                        |scene: &Scene, of: Option<usize>| of.map(|t| scene.textures[t].sample(uv, 0.0));
                    assert_eq!(texel(&read, new), texel(&scene, old));
                }
            }
        }
        let maps =
            |scene: &Scene| scene.materials.iter().map(|m| m.normal_map.map(|map| map.scale)).collect();
        let (old, new): (Vec<_>, Vec<_>) = (maps(&scene), maps(&read));
        assert_eq!(old, new);
        assert_eq!(read.lights[0], scene.lights[0]);
        let LightKind::Spot { inner, outer, .. } = read.lights[1].kind else { panic!("not a spot") };
        assert!((inner - 0.25).abs() < 1e-12 && (outer - 0.5).abs() < 1e-12 && !read.lights[1].casts_shadow);
        let (old, new) = (&scene.cameras[0].1, &read.cameras[0].1);
        assert!((old.eye - new.eye).length() < 1e-12 && (old.forward() - new.forward()).length() < 1e-12);
        // Once read, it is written the same.
        let again = SceneFile::of(&read).unwrap();
        assert_eq!(again.objects.len(), 6);
    }
}

fn check_shapes(old: &Scene, new: &Scene) {
    let shape = |scene: &Scene, i: usize| scene.objects[i].shape.clone();
    let (Shape::Primitive(a), Shape::Primitive(b)) = (&*shape(old, 0), &*shape(new, 0)) else {
        panic!("primitive")
    };
    assert_eq!(a, b);
    let (Shape::Mesh(a), Shape::Mesh(b)) = (&*shape(old, 1), &*shape(new, 1)) else { panic!("mesh") };
    assert_eq!(
        (&a.positions, &a.triangles, &a.slots, &a.segments),
        (&b.positions, &b.triangles, &b.slots, &b.segments)
    );
    let (Shape::Voxels(a), Shape::Voxels(b)) = (&*shape(old, 2), &*shape(new, 2)) else { panic!("voxels") };
    assert_eq!(a.filled(), b.filled());
    assert!((0..65).all(|x| a.get(x, 1, 2) == b.get(x, 1, 2)));
    let (Shape::FreeForm(a), Shape::FreeForm(b)) = (&*shape(old, 3), &*shape(new, 3)) else { panic!("form") };
    assert_eq!(a.form(), b.form());
    let (Shape::HeightField(a), Shape::HeightField(b)) = (&*shape(old, 4), &*shape(new, 4)) else {
        panic!("heights")
    };
    assert_eq!((a.heights(), a.extent()), (b.heights(), b.extent()));
    let (Shape::Volume(a), Shape::Volume(b)) = (&*shape(old, 5), &*shape(new, 5)) else { panic!("volume") };
    assert_eq!(
        (a.size(), a.spacing(), a.range(), &a.transfer),
        (b.size(), b.spacing(), b.range(), &b.transfer)
    );
    assert!((0..24).all(|i| a.samples().get(i) == b.samples().get(i)) && b.shell.is_some());
}

const BY_HAND: &str = r##"(
    textures: { "tiles": Checker(colors: ("#ffffff", "#203040"), cells: 4) },
    materials: {
        "gold": (base_color: "#d4af37", specular: 0.8, shininess: 64, reflectivity: 0.3),
        "floor": (texture: "tiles", mapping: Triplanar(scale: 0.5)),
    },
    objects: [
        (shape: Primitive(Sphere(radius: 1)), material: "gold", transform: (translate: (0, 1, 0))),
        (name: "ground", shape: Primitive(Plane(width: 10, depth: 10)), material: "floor"),
        (name: "rock", shape: FreeForm(form: SmoothUnion(
            a: Ellipsoid(center: (0, 0, 0), radii: (1, 0.5, 1)),
            b: HalfSpace(normal: (0, 1, 0), offset: 0.1),
            k: 0.2,
        ), bounds: ((-2, -1, -2), (2, 1, 2))), transform: (rotate_deg: (0, 90, 0), scale: 0.5)),
        (name: "two", shape: Model(file: "part.obj"), transform: (scale: (1, 2, 1))),
        (name: "three", shape: Model(file: "part.obj"), material: "gold"),
        (name: "hill", shape: HeightField(rows: [[0, 0, 0], [0, 1, 0]], extent: (4, 2))),
        (name: "cloud", shape: Volume(file: "cloud.raw", format: "2x2x2:u8", spacing: (1, 1, 2))),
    ],
    lights: [(kind: Spot(position: (0, 5, 0), direction: (0, -1, 0), inner_deg: 10, outer_deg: 20), intensity: 30)],
    environment: (ambient: (0.1, 0.1, 0.1), background: Solid("#000000")),
    cameras: [(name: "front", eye: (0, 2, 8), target: (0, 1, 0))],
)"##;

#[test]
fn a_scene_written_by_hand_means_what_it_says() {
    let folder = Folder::new("hand");
    std::fs::write(folder.0.join("part.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    std::fs::write(folder.0.join("cloud.raw"), [0, 1, 2, 3, 4, 5, 6, 250]).unwrap();
    let scene = folder.load("hand.ron", BY_HAND).unwrap();
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["primitive 0", "ground", "rock", "two", "three", "hill", "cloud"]);
    assert_eq!(scene.name, "hand");
    assert!((scene.objects[3].bounds().size() - DVec3::new(1.0, 2.0, 0.0)).length() < 1e-6);
    assert_eq!(scene.material(&scene.objects[4], 0).name, "gold");
    assert!(std::sync::Arc::ptr_eq(&scene.objects[3].shape, &scene.objects[4].shape), "a model is read once");
    let Shape::Volume(volume) = &*scene.objects[6].shape else { panic!("not a volume") };
    assert_eq!((volume.spacing().z, volume.range()), (2.0, [0.0, 250.0]));
    assert_eq!((scene.lights.len(), scene.cameras[0].0.as_str()), (1, "front"));
    assert_eq!(scene.notes, ["part.obj: normals generated, creases sharper than 40 degrees kept"]);
}

#[test]
fn wrong_scenes_say_what_is_wrong_where_and_what_to_do() {
    let folder = Folder::new("wrong");
    let object = |shape: &str| format!("(objects: [(shape: {shape})])");
    for (name, text, parts) in [
        ("a.ron", "(\n  objects: [],\n  lamps: [],\n)".to_owned(), &["line 3 column", "lamps", "objects"][..]),
        ("b.json", "{\"objects\": [\n{\"shape\": 3}]}".to_owned(), &["line 2 column", "expected value"]),
        ("c.ron", object("Primitive(Sphere(radius: -1))"), &["objects[0]", "`radius` must be positive, got -1"]),
        (
            "d.ron",
            "(materials: {\"red\": ()}, objects: [(name: \"x\", shape: Primitive(Sphere(radius: 1)), material: \"rde\")])"
                .to_owned(),
            &["object `x`", "no material `rde`", "take one of red"],
        ),
        ("e.ron", object("Model(file: \"../x.obj\")"), &["objects[0]", "`../x.obj`", "leads out of its folder"]),
        ("f.ron", object("Model(file: \"f.ron\")"), &["`f.ron`", "are no models"]),
        ("g.ron", object("Mesh(positions: [(0,0,0)], triangles: [(0,1,2)])"), &["vertex index 1 of 1"]),
        ("h.ron", object("FreeForm(form: HalfSpace(normal: (0,1,0), offset: 0))"), &["the form has no end", "bounds"]),
        ("i.ron", object("Voxels(size: (4000000000, 4000000000, 4), cells: \"\")"), &["voxel_bytes"]),
        ("j.ron", object("Volume(format: \"9x9x9:u8\", samples: \"AAAA\")"), &["unpacked"]),
        ("k.ron", "(cameras: [(name: \"c\", eye: (0,0,0), target: (0,0,0))])".to_owned(), &["camera `c`", "two different points"]),
        ("l.ron", "(materials: {\"m\": (opacity: 2)}, objects: [])".to_owned(), &["material `m`", "`opacity` must be 0 to 1"]),
        ("m.ron", "\u{feff}".to_owned() + &"(".repeat(100_000), &["line 1"]),
        ("n.json", "[".repeat(100_000), &["line 1"]),
        ("o.ron", object(&format!("FreeForm(form: {}", "Offset(amount: 0, form: ".repeat(50_000))), &["line 1"]),
        ("p.ron", object("HeightField(rows: [[0, 0], [0]])"), &["row 1 has 1 heights, row 0 has 2"]),
        (
            "r.ron",
            "(textures: {\"t\": Checker(colors: (\"#fff\", \"#000\"))}, \
             materials: {\"m\": (texture: \"t\", normal_map: (texture: \"t\"))}, objects: [])"
                .to_owned(),
            &["texture `t` is used for colors and for normals", "name its file twice"],
        ),
        ("t.ron", object("Volume(format: \"1x1x1:u8\", samples: \"H4sIAAAAAAACA2MAAI3vAtIBAAAA\", preset: ct_bones)"), &["line 1", "ct_bones", "ct_bone"]),
        ("s.ron", object("Volume(format: \"1x1x1:u8\", samples: \"H4sIAAAAAAACA2MAAI3vAtIBAAAA\", preset: ct_bone, transfer: (points: [], reference_length: 1))"), &["both `transfer` and `preset`"]),
        ("q.ron", "(objects: [(shape: Primitive(Sphere(radius: 1)), transform: (scale: 0))])".to_owned(), &["squeezes"]),
    ] {
        let error = folder.load(name, &text).expect_err(name);
        assert!(!error.contains('\n') && error.contains(name), "{error}");
        for part in parts {
            assert!(error.contains(part), "{name}: `{part}` is not in: {error}");
        }
    }
}

#[test]
fn the_schema_knows_the_words() {
    let schema: serde_json::Value = serde_json::from_str(&json_schema()).unwrap();
    assert_eq!(schema["title"], "SceneFile");
    assert!(schema["properties"]["objects"].is_object());
    for word in ["FreeForm", "rotate_deg", "fov_y_deg", "Perturbed"] {
        assert!(json_schema().contains(word), "{word}");
    }
}
