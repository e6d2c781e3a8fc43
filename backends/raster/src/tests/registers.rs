//! Do wide and plain registers give the same bytes?

use super::{Random, camera, cube, draw_with, plane, scene_of, triangle};
use glam::Vec3;
use polyptych_core::registers::Registers;
use polyptych_core::scene::{Light, Mapping, Material, Scene, Shape, Texture};

/// Small, large, painted, clear and mirrored triangles, with lights of all kinds.
fn medley() -> Scene {
    let mut random = Random(11);
    let mut around = |size: f64| [(); 3].map(|()| ((random.next() - 0.5) * size) as f32);
    let crumb = |size: f64, around: &mut dyn FnMut(f64) -> [f32; 3]| {
        let at = around(2.0);
        triangle([(); 3].map(|()| {
            let by = around(size);
            [at[0] + by[0], at[1] + 1.0 + by[1], at[2] + by[2]]
        }))
    };
    let mut shapes = vec![(plane(6.0), [0.0; 3]), (cube(0.7), [0.6, 0.35, -0.3])];
    for i in 0..400 {
        let size = [0.02, 0.2, 1.0][i % 3];
        shapes.push((Shape::Mesh(crumb(size, &mut around)), [0.0; 3]));
    }
    let mut scene = scene_of(shapes);
    let checker: Vec<u8> = (0..16 * 16).flat_map(|i| [(i * 37 % 256) as u8, 90, 200, 255]).collect();
    scene.textures.push(Texture::from_srgb8("checks", 16, 16, &checker).into());
    let painted = scene.add_material(Material {
        texture: Some(0),
        mapping: Mapping::Triplanar { scale: 3.0 },
        ..Material::new(Vec3::ONE)
    });
    let glass = scene.add_material(Material { opacity: 0.4, ..Material::new(Vec3::new(0.2, 0.7, 0.3)) });
    scene.objects[0].materials = vec![painted];
    for (i, object) in scene.objects.iter_mut().enumerate().skip(2) {
        if i % 5 == 0 {
            object.materials = vec![painted];
        } else if i % 7 == 0 {
            object.materials = vec![glass];
        } else if i % 11 == 0 {
            object.world_from_object.matrix3.x_axis *= -1.0;
        }
    }
    scene.lights =
        vec![Light::directional([-0.4, -1.0, -0.3].into()), Light::point([1.0, 2.5, 1.0].into(), 3.0)];
    scene
}

#[test]
fn pictures_do_not_depend_on_the_width_of_registers() {
    let scene = medley();
    let sights: [&[(&str, &str)]; 6] = [
        &[],
        &[("shading", "gouraud")],
        &[("shading", "flat"), ("samples", "4")],
        &[("mode", "hidden-line")],
        &[("shadow.tier", "exact")],
        &[("shadow.tier", "plain")],
    ];
    for settings in sights {
        let pictures = Registers::ALL.map(|registers| {
            registers.limit();
            draw_with(&scene, camera([2.0, 2.5, 3.0], [0.0, 0.6, 0.0]), 203, 141, settings)
        });
        let [plain, wider, widest] = &pictures;
        assert!(plain.same_bits(wider) && plain.same_bits(widest), "{settings:?}");
        assert!(plain.id().iter().filter(|&&id| id > 0).count() > 10_000);
    }
}
