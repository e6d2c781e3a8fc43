//! Do all models of the collection load, with the counts, sizes and areas that are known of them?

use glam::DVec3;
use polyptych_core::load::{LoadOptions, load};
use polyptych_core::scene::{Mesh, Object, Scene, Shape};
use std::path::{Path, PathBuf};

mod models_folder;

fn open(models: &Path, file: &str) -> Scene {
    let options = LoadOptions { height_map: true, ..LoadOptions::default() };
    load(&models.join(file), &options).unwrap_or_else(|error| panic!("{error}"))
}

fn meshes(scene: &Scene) -> impl Iterator<Item = &Mesh> {
    scene.objects.iter().filter_map(|o| match &*o.shape {
        Shape::Mesh(mesh) => Some(mesh),
        _ => None,
    })
}

/// Returns the area in the world.
fn area(scene: &Scene) -> f64 {
    let of_object = |object: &Object| {
        let Shape::Mesh(mesh) = &*object.shape else { return 0.0 };
        let world = |p: glam::Vec3| object.world_from_object.transform_point3(p.as_dvec3());
        (0..mesh.triangles.len())
            .map(|t| {
                let [a, b, c] = mesh.corners(t).map(world);
                (b - a).cross(c - a).length() * 0.5
            })
            .sum::<f64>()
    };
    scene.objects.iter().map(of_object).sum()
}

fn files_below(folder: &Path, extensions: &[&str], list: &mut Vec<PathBuf>) {
    let mut entries: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if path.is_dir() {
            files_below(&path, extensions, list);
        } else if extensions.contains(&extension.as_str()) {
            list.push(path);
        }
    }
}

/// Models that are refused, and the words with which.
const REFUSED: &[(&str, &str)] = &[
    ("assimp/draco/2CylinderEngine.gltf", "KHR_draco_mesh_compression"),
    ("draco_required/bunny.glb", "KHR_draco_mesh_compression"),
    ("glTF1_BoxTextured/BoxTextured.gltf", "glTF version 1.0"),
    ("issue-140-zero-face-idx.obj", "index `0` is illegal"),
];

#[test]
fn all_models_load_and_are_sound() {
    let Some(models) = models_folder::find() else { return };
    let mut files = Vec::new();
    for (folder, extensions) in [
        ("mesh", &["obj", "glb"][..]),
        ("gltf", &["gltf", "glb"]),
        ("vox", &["vox"]),
        ("volume", &["nrrd", "nii", "gz"]),
        ("height", &["png"]),
    ] {
        files_below(&models.join(folder), extensions, &mut files);
    }
    assert!(files.len() > 200, "only {} files", files.len());
    let options = LoadOptions { height_map: true, ..LoadOptions::default() };
    for path in &files {
        let refusal = REFUSED.iter().find(|(name, _)| path.ends_with(name));
        match (load(path, &options), refusal) {
            (Ok(scene), None) => check_scene(&scene, path),
            (Ok(_), Some(_)) => panic!("{} should be refused", path.display()),
            (Err(error), Some((_, words))) => assert!(error.to_string().contains(words), "{error}"),
            (Err(error), None) => panic!("{error}"),
        }
    }
}

fn check_scene(scene: &Scene, path: &Path) {
    let name = path.display();
    assert!(!scene.cameras.is_empty() && !scene.lights.is_empty(), "{name}: nothing is seen");
    assert!(scene.cameras.iter().all(|(_, c)| c.eye.is_finite()), "{name}");
    for object in &scene.objects {
        assert!(object.materials.iter().all(|&m| m < scene.materials.len()), "{name}: material");
        let Shape::Mesh(mesh) = &*object.shape else { continue };
        assert_eq!(mesh.check(), Ok(()), "{name}");
        let slots = object.materials.len();
        assert!((0..mesh.triangles.len()).all(|t| mesh.slot(t) < slots), "{name}: slot");
        if !mesh.triangles.is_empty() {
            assert!(mesh.normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-3), "{name}: normals");
            assert_eq!(mesh.normals.len(), mesh.positions.len(), "{name}");
        }
    }
    assert!(scene.materials.iter().all(|m| m.texture.is_none_or(|t| t < scene.textures.len())), "{name}");
}

#[test]
fn triangles_are_as_many_as_the_manifest_says() {
    let Some(models) = models_folder::find() else { return };
    for (file, triangles) in [
        ("mesh/armadillo.obj", 52_000),
        ("mesh/stanford-bunny.obj", 69_451),
        ("mesh/suzanne.obj", 968),
        ("mesh/spot/spot_quadrangulated.obj", 5_856),
        ("mesh/nefertiti.obj", 99_938),
        ("mesh/sponza_crytek_geometry.glb", 262_267),
        ("mesh/pathological/mixed_attributes.obj", 4),
        ("mesh/pathological/zero_area.obj", 4),
        ("mesh/quirks/assimp/point_cloud.obj", 0),
        ("mesh/quirks/trimesh/rabbit.obj", 1_252),
        ("gltf/assimp/2CylinderEngine-glTF-Binary/2CylinderEngine.glb", 121_496),
        ("gltf/bevy/FlightHelmet/FlightHelmet.gltf", 94_722),
        ("gltf/bevy/terrain/Mountains.gltf", 25_600),
        ("gltf/own/instances_5000.glb", 5_000),
        ("gltf/own/orientation_trs_vs_matrix.glb", 192),
        ("gltf/own/interleaved_quantized.glb", 2),
    ] {
        let scene = open(&models, file);
        assert_eq!(meshes(&scene).map(|m| m.triangles.len()).sum::<usize>(), triangles, "{file}");
    }
}

#[test]
fn concave_polygons_keep_their_area() {
    let Some(models) = models_folder::find() else { return };
    let star = area(&open(&models, "mesh/pathological/star_400gon.obj"));
    assert!((star - 1.256_585).abs() < 1e-6, "{star}");
    // Filled as fans, Sponza's polygons cover 9.6 percent more.
    let sponza = area(&open(&models, "mesh/sponza_dabrovic/sponza.obj"));
    assert!(
        (sponza - newell_area(&models.join("mesh/sponza_dabrovic/sponza.obj"))).abs() < 1e-3 * sponza,
        "{sponza}"
    );
}

/// Sums the areas of an OBJ file's polygons by Newell's formula, which needs no triangles.
fn newell_area(path: &Path) -> f64 {
    let text = std::fs::read_to_string(path).unwrap();
    let mut positions = Vec::new();
    let mut sum = 0.0;
    for line in text.lines() {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let numbers: Vec<f64> = words.map(|w| w.parse().unwrap()).collect();
                positions.push(DVec3::new(numbers[0], numbers[1], numbers[2]));
            }
            Some("f") => {
                let corners: Vec<DVec3> = words
                    .map(|w| w.split('/').next().unwrap().parse::<i64>().unwrap())
                    .map(|i| positions[(if i < 0 { positions.len() as i64 + i } else { i - 1 }) as usize])
                    .collect();
                let area: DVec3 =
                    corners.windows(2).map(|p| (p[0] - corners[0]).cross(p[1] - corners[0])).sum();
                sum += area.length() * 0.5;
            }
            _ => {}
        }
    }
    sum
}

#[test]
fn true_bodies_have_their_area_and_volume() {
    let Some(models) = models_folder::find() else { return };
    let pi = std::f64::consts::PI;
    for (file, true_area, true_volume) in [
        ("sphere_32x64.obj", 4.0 * pi, 4.0 / 3.0 * pi),
        ("torus_96.obj", 4.0 * pi * pi * 0.7 * 0.3, 2.0 * pi * pi * 0.7 * 0.09),
    ] {
        let scene = open(&models, &format!("mesh/truth/{file}"));
        let mesh = meshes(&scene).next().unwrap();
        assert!((mesh.area() / true_area - 1.0).abs() < 0.005, "{file}: {}", mesh.area());
        assert!((mesh.volume() / true_volume - 1.0).abs() < 0.01, "{file}: {}", mesh.volume());
    }
    // The quads of the same surface enclose the same volume.
    let [quads, triangles] = ["spot_quadrangulated.obj", "spot.obj"]
        .map(|f| meshes(&open(&models, &format!("mesh/spot/{f}"))).map(Mesh::volume).sum::<f64>());
    assert!((quads / triangles - 1.0).abs() < 1e-3, "{quads} {triangles}");
}

#[test]
fn a_cube_far_away_keeps_its_edges() {
    let Some(models) = models_folder::find() else { return };
    let scene = open(&models, "mesh/pathological/far_from_origin.obj");
    let bounds = scene.bounds();
    assert!((bounds.size() - DVec3::ONE).length() < 1e-9 && bounds.min.x > 9e5, "{bounds:?}");
    assert!((area(&scene) - 6.0).abs() < 1e-6);
}

#[test]
fn voxels_are_those_that_the_reference_reader_finds() {
    let Some(models) = models_folder::find() else { return };
    let mut files = Vec::new();
    files_below(&models.join("vox"), &["vox"], &mut files);
    for path in &files {
        let known = dot_vox::load(path.to_str().unwrap()).unwrap();
        let scene = load(path, &LoadOptions::default()).unwrap();
        let Some(object) = scene.objects.first() else { continue };
        let Shape::Voxels(voxels) = &*object.shape else { panic!("not voxels") };
        // Every model of the file that is shown has its voxels, colors and orientation.
        let model = known.models.iter().find(|m| {
            [m.size.x, m.size.z, m.size.y] == voxels.size() && {
                let [_, _, depth] = voxels.size();
                m.voxels.iter().all(|v| {
                    voxels.get(u32::from(v.x), u32::from(v.z), depth - 1 - u32::from(v.y)) == v.i + 1
                })
            }
        });
        let model = model.unwrap_or_else(|| panic!("{}: no model is alike", path.display()));
        assert_eq!(voxels.filled(), model.voxels.len() as u64, "{}", path.display());
        let voxel = &model.voxels[0];
        let color = known.palette[usize::from(voxel.i)];
        let linear = scene.material(object, usize::from(voxel.i)).base_color;
        let expected = polyptych_core::shade::linear_from_srgb(f32::from(color.r) / 255.0);
        assert!((linear.x - expected).abs() < 1e-6, "{}", path.display());
    }
}

#[test]
fn the_axes_of_the_orientation_test_point_where_they_should() {
    let Some(models) = models_folder::find() else { return };
    let sphere = open(&models, "vox/truth_sphere_64_solid.vox");
    let Shape::Voxels(voxels) = &*sphere.objects[0].shape else { panic!("not voxels") };
    assert_eq!((voxels.size(), voxels.filled()), ([64; 3], 79_584));
    let shown: u64 = open(&models, "vox/dot_vox_axes.vox")
        .objects
        .iter()
        .map(|o| {
            assert!((o.world_from_object.matrix3.determinant().abs() - 1.0).abs() < 1e-12);
            let Shape::Voxels(voxels) = &*o.shape else { panic!("not voxels") };
            voxels.filled()
        })
        .sum();
    assert_eq!(shown, 12_452, "ten instances of four models");
}

#[test]
fn volumes_have_their_sizes_ranges_and_up() {
    let Some(models) = models_folder::find() else { return };
    for (file, size, range) in [
        ("cranium_ct_i16.nrrd", [256, 256, 108], [-1024.0, 2986.0]),
        ("ch2_mri_u8.nrrd", [181, 217, 181], [0.0, 254.0]),
        ("bunny_density64_f32.nrrd", [64, 64, 64], [0.0, 1.0]),
        ("truth/torus_96_u8.nrrd", [96, 96, 96], [0.0, 185.0]),
        ("ch2bet.nii.gz", [181, 217, 181], [0.0, 254.0]),
        ("anatomical_i16be.nii", [33, 41, 25], [f32::NAN; 2]),
    ] {
        let scene = open(&models, &format!("volume/{file}"));
        let Shape::Volume(volume) = &*scene.objects[0].shape else { panic!("not a volume") };
        assert_eq!(volume.size(), size, "{file}");
        if !range[0].is_nan() && !file.ends_with("gz") {
            assert_eq!(volume.range(), range, "{file}");
        }
        let up = scene.objects[0].world_from_object.transform_vector3(DVec3::Z);
        let expected = if file.contains(".nii") { DVec3::Y } else { DVec3::Z };
        assert!((up - expected).length() < 0.2, "{file}: {up}");
    }
    let scene = open(&models, "volume/truth/sphere_64_u8.nrrd");
    let Shape::Volume(volume) = &*scene.objects[0].shape else { panic!("not a volume") };
    assert!((scene.bounds().max - DVec3::splat(1.2)).length() < 1e-9);
    // value = 128 - 200 * distance: on the surface 128, a tenth inside 148
    assert!((volume.value(DVec3::new(0.9, 0.0, 0.0)) - 148.0).abs() < 1.5);
    let scene = open(&models, "volume/cranium_ct_i16.nrrd");
    let Shape::Volume(volume) = &*scene.objects[0].shape else { panic!("not a volume") };
    assert!(volume.transfer.at(-800.0).1 == 0.0 && volume.transfer.at(1500.0).1 > 0.9);
}

#[test]
fn textures_lie_the_right_way_up() {
    let Some(models) = models_folder::find() else { return };
    let scene = open(&models, "gltf/own/texcoord_origin.glb");
    let mesh = meshes(&scene).next().unwrap();
    // uv (0, 0) is the top left texel, which is red
    let texel = scene.textures[0].sample([0.05, 0.05], 0.0);
    assert!(texel.x > 0.5 && texel.y < 0.2, "{texel}");
    let top_left = mesh.uvs.iter().position(|uv| uv.length() < 1e-6).unwrap();
    let (p, bounds) = (mesh.positions[top_left], mesh.bounds());
    assert!(f64::from(p.y) > bounds.center().y && f64::from(p.x) < bounds.center().x, "{p}");
    let scene = open(&models, "gltf/own/normal_map_vs_sphere.glb");
    let map = scene.materials.iter().find_map(|m| m.normal_map).unwrap();
    // The middle of the picture of a ball looks ahead, its right to the right, its upper half up.
    let texel = |u, v| scene.textures[map.texture].sample([u, v], 0.0).truncate() * 2.0 - 1.0;
    assert!((texel(0.5, 0.5) - glam::Vec3::Z).length() < 0.05, "{}", texel(0.5, 0.5));
    assert!(texel(0.7, 0.5).x > 0.2 && texel(0.5, 0.3).y > 0.2, "{} {}", texel(0.7, 0.5), texel(0.5, 0.3));
    for file in ["mesh/spot/spot.obj", "mesh/spider/spider.obj", "mesh/duck/duck.obj", "mesh/fuze/fuze.obj"] {
        let scene = open(&models, file);
        assert!(!scene.textures.is_empty() && scene.textures.iter().all(|t| t.size() != [64, 64]), "{file}");
    }
}

#[test]
fn lights_and_cameras_of_gltf_files_are_kept() {
    let Some(models) = models_folder::find() else { return };
    let scene = open(&models, "gltf/own/punctual_lights_cameras.glb");
    assert_eq!((scene.lights.len(), scene.cameras.len()), (3, 2));
    let pairs = open(&models, "gltf/own/orientation_trs_vs_matrix.glb");
    let places: Vec<DVec3> = pairs.objects.iter().map(|o| o.bounds().size()).collect();
    let half = places.len() / 2;
    let alike = |a: DVec3, b: DVec3| (a - b).length() < 1e-5;
    let by_halves = (0..half).all(|i| alike(places[i], places[i + half]));
    let by_pairs = (0..half).all(|i| alike(places[2 * i], places[2 * i + 1]));
    assert!(by_halves || by_pairs, "arrows by parts and by matrix differ: {places:?}");
    let spike = open(&models, "gltf/own/sparse_spike.glb");
    assert!((spike.bounds().max.z - 2.0).abs() < 1e-6, "the sparse accessor was not applied");
}
