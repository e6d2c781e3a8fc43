//! How does a scene become flat C structs?

use crate::flat::{Names, Place};
use glam::DVec3;
use polyptych_core::camera::{Camera, Projection};
use polyptych_core::scene::{
    AlphaMode, Background, Chunk, Environment, Form, FreeForm, Light, LightKind, LightingModel, Mapping,
    Material, Mesh, Object, Power, Primitive, Samples, Scene, Shape, Texture, TextureWrap, Volume, Voxels,
};
use polyptych_core::seam::{Need, Parameter, Settings, Value};
use polyptych_plugin_abi::{self as abi, *};
use std::ptr::null;
use std::sync::Arc;

/// Makes the flat form of a scene; `hidden` objects go without their shape.
pub(crate) fn scene(
    place: &mut impl Place,
    names: &mut Names,
    scene: &Arc<Scene>,
    hidden: &dyn Fn(usize) -> Hidden,
) -> *const PolyptychScene {
    let id = names.scene(scene);
    let textures = scene.textures.iter().map(|t| texture(place, names, t)).collect::<Vec<_>>();
    let materials = scene.materials.iter().map(|m| material(place, m)).collect::<Vec<_>>();
    let objects = (scene.objects.iter().enumerate())
        .map(|(index, o)| object(place, names, o, hidden(index)))
        .collect::<Vec<_>>();
    let flat = PolyptychScene {
        size: size_of::<PolyptychScene>() as u32,
        object_count: objects.len() as u32,
        material_count: materials.len() as u32,
        texture_count: textures.len() as u32,
        light_count: scene.lights.len() as u32,
        reserved: 0,
        id,
        name: place.text(&scene.name),
        objects: place.put(objects),
        materials: place.put(materials),
        textures: place.put(textures),
        lights: place.put(scene.lights.iter().map(light).collect()),
        environment: place.one(environment(&scene.environment)),
    };
    place.one(flat)
}

/// What a plugin does not see of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Hidden {
    /// Nothing.
    No,
    /// Its shape: the host will convert it.
    Shape,
    /// The whole object: the host has skipped it.
    Object,
}

fn object(place: &mut impl Place, names: &mut Names, object: &Object, hidden: Hidden) -> PolyptychObject {
    let materials: Vec<u32> = object.materials.iter().map(|&m| m as u32).collect();
    PolyptychObject {
        size: size_of::<PolyptychObject>() as u32,
        visible: u32::from(object.visible && hidden != Hidden::Object),
        required: u32::from(object.required),
        material_count: materials.len() as u32,
        name: place.text(&object.name),
        shape: if hidden == Hidden::No { shape(place, names, &object.shape) } else { null() },
        materials: place.put(materials),
        world_from_object: object.world_from_object.to_cols_array(),
    }
}

fn shape(place: &mut impl Place, names: &mut Names, shape: &Arc<Shape>) -> *const PolyptychShape {
    let mut flat = PolyptychShape {
        size: size_of::<PolyptychShape>() as u32,
        kind: 1 << shape.kind() as u32,
        id: names.shape(shape),
        primitive: null(),
        mesh: null(),
        voxels: null(),
        free_form: null(),
        height_field: null(),
        volume: null(),
    };
    match &**shape {
        Shape::Primitive(p) => flat.primitive = place.one(primitive(p)),
        Shape::Mesh(m) => {
            let m = mesh(place, flat.id, m);
            flat.mesh = place.one(m);
        }
        Shape::Voxels(v) => {
            let v = voxels(place, flat.id, v);
            flat.voxels = place.one(v);
        }
        Shape::FreeForm(f) => {
            let f = free_form(place, f);
            flat.free_form = place.one(f);
        }
        Shape::HeightField(f) => {
            let heights = place.lend((flat.id, 0), f.heights());
            flat.height_field = place.one(PolyptychHeightField {
                size: size_of::<PolyptychHeightField>() as u32,
                columns: f.columns(),
                rows: f.rows(),
                reserved: 0,
                extent: f.extent().to_array(),
                heights,
            });
        }
        Shape::Volume(v) => {
            let v = volume(place, flat.id, v);
            flat.volume = place.one(v);
        }
    }
    place.one(flat)
}

fn primitive(primitive: &Primitive) -> PolyptychPrimitive {
    let (kind, numbers) = match *primitive {
        Primitive::Box { size } => (abi::POLYPTYCH_BOX, [size.x, size.y, size.z, 0.0]),
        Primitive::Sphere { radius } => (abi::POLYPTYCH_SPHERE, [radius, 0.0, 0.0, 0.0]),
        Primitive::Cylinder { radius, height } => (abi::POLYPTYCH_CYLINDER, [radius, height, 0.0, 0.0]),
        Primitive::Cone { radius, height } => (abi::POLYPTYCH_CONE, [radius, height, 0.0, 0.0]),
        Primitive::Torus { major, minor } => (abi::POLYPTYCH_TORUS, [major, minor, 0.0, 0.0]),
        Primitive::Plane { width, depth } => (abi::POLYPTYCH_PLANE, [width, depth, 0.0, 0.0]),
        Primitive::Frustum { sides, lower_radius, upper_radius, height } => {
            (abi::POLYPTYCH_FRUSTUM, [f64::from(sides), lower_radius, upper_radius, height])
        }
    };
    PolyptychPrimitive { size: size_of::<PolyptychPrimitive>() as u32, kind, numbers }
}

fn mesh(place: &mut impl Place, id: u64, mesh: &Mesh) -> PolyptychMesh {
    PolyptychMesh {
        size: size_of::<PolyptychMesh>() as u32,
        reserved: 0,
        vertex_count: mesh.positions.len() as u64,
        triangle_count: mesh.triangles.len() as u64,
        segment_count: mesh.segments.len() as u64,
        positions: place.lend((id, 0), &mesh.positions).cast(),
        normals: place.lend((id, 1), &mesh.normals).cast(),
        uvs: place.lend((id, 2), &mesh.uvs).cast(),
        colors: place.lend((id, 3), &mesh.colors).cast(),
        triangles: place.lend((id, 4), &mesh.triangles).cast(),
        slots: place.lend((id, 5), &mesh.slots),
        segments: place.lend((id, 6), &mesh.segments).cast(),
    }
}

fn voxels(place: &mut impl Place, id: u64, voxels: &Voxels) -> PolyptychVoxels {
    let chunks = voxels.chunks().enumerate().map(|(index, chunk)| match chunk {
        Chunk::Uniform(value) => PolyptychChunk { cells: null(), uniform: u64::from(*value) },
        Chunk::Cells(cells) => PolyptychChunk { cells: place.lend((id, index as u32), cells), uniform: 0 },
    });
    let chunks = chunks.collect();
    PolyptychVoxels {
        size: size_of::<PolyptychVoxels>() as u32,
        cells: voxels.size(),
        chunks: place.put(chunks),
    }
}

fn volume(place: &mut impl Place, id: u64, volume: &Volume) -> PolyptychVolume {
    let (format, data) = match volume.samples() {
        Samples::U8(s) => (abi::POLYPTYCH_U8, place.lend((id, 0), s).cast()),
        Samples::I16(s) => (abi::POLYPTYCH_I16, place.lend((id, 0), s).cast()),
        Samples::U16(s) => (abi::POLYPTYCH_U16, place.lend((id, 0), s).cast()),
        Samples::F32(s) => (abi::POLYPTYCH_F32, place.lend((id, 0), s).cast()),
    };
    let points: Vec<PolyptychTransferPoint> = (volume.transfer.points.iter())
        .map(|p| PolyptychTransferPoint { value: p.value, color: p.color.to_array(), opacity: p.opacity })
        .collect();
    let shell = volume.shell.as_ref().map(|shell| free_form(place, shell));
    PolyptychVolume {
        size: size_of::<PolyptychVolume>() as u32,
        samples: volume.size(),
        spacing: volume.spacing().to_array(),
        format,
        point_count: points.len() as u32,
        data,
        points: place.put(points),
        reference_length: volume.transfer.reference_length,
        shell: shell.map_or(null(), |shell| place.one(shell)),
    }
}

fn free_form(place: &mut impl Place, form: &FreeForm) -> PolyptychFreeForm {
    let mut nodes = Vec::new();
    push_nodes(form.form(), &mut nodes);
    let bounds = form.bounds();
    let ([x0, y0, z0], [x1, y1, z1]) = (bounds.min.to_array(), bounds.max.to_array());
    PolyptychFreeForm {
        size: size_of::<PolyptychFreeForm>() as u32,
        node_count: nodes.len() as u32,
        nodes: place.put(nodes),
        bounds: [x0, y0, z0, x1, y1, z1],
    }
}

/// Adds a function's tree to a list, each node before its children.
fn push_nodes(form: &Form, nodes: &mut Vec<PolyptychFormNode>) {
    let mut node = |kind: u32, children: usize, numbers: &[f64]| {
        let mut all = [0.0; 10];
        all[..numbers.len()].copy_from_slice(numbers);
        nodes.push(PolyptychFormNode { kind, children: children as u32, numbers: all });
    };
    let flat = |a: DVec3, b: DVec3| [a.x, a.y, a.z, b.x, b.y, b.z];
    let parts: Vec<&Form> = match form {
        Form::Quadric(q) => return node(abi::POLYPTYCH_FORM_QUADRIC, 0, &q.0),
        Form::Ellipsoid { center, radii } => {
            return node(abi::POLYPTYCH_FORM_ELLIPSOID, 0, &flat(*center, *radii));
        }
        Form::HalfSpace { normal: n, offset } => {
            return node(abi::POLYPTYCH_FORM_HALF_SPACE, 0, &[n.x, n.y, n.z, *offset]);
        }
        Form::Cylinder { center: c, axis: a, radius } => {
            return node(abi::POLYPTYCH_FORM_CYLINDER, 0, &[c.x, c.y, c.z, a.x, a.y, a.z, *radius]);
        }
        Form::Torus { major, minor } => return node(abi::POLYPTYCH_FORM_TORUS, 0, &[*major, *minor]),
        Form::Perturbed { base, terms } => {
            node(abi::POLYPTYCH_FORM_PERTURBED, 1 + terms.len(), &[]);
            push_nodes(base, nodes);
            for term in terms {
                let power = if term.power == Power::Cube { 3.0 } else { 2.0 };
                let mut numbers = [0.0; 10];
                (numbers[0], numbers[1]) = (term.weight, power);
                nodes.push(PolyptychFormNode { kind: abi::POLYPTYCH_FORM_TERM, children: 1, numbers });
                push_nodes(&term.function, nodes);
            }
            return;
        }
        Form::Union(parts) => {
            node(abi::POLYPTYCH_FORM_UNION, parts.len(), &[]);
            parts.iter().collect()
        }
        Form::Intersection(parts) => {
            node(abi::POLYPTYCH_FORM_INTERSECTION, parts.len(), &[]);
            parts.iter().collect()
        }
        Form::Difference(a, b) => {
            node(abi::POLYPTYCH_FORM_DIFFERENCE, 2, &[]);
            vec![a, b]
        }
        Form::SmoothUnion { a, b, k } => {
            node(abi::POLYPTYCH_FORM_SMOOTH_UNION, 2, &[*k]);
            vec![a, b]
        }
        Form::Offset { form, amount } => {
            node(abi::POLYPTYCH_FORM_OFFSET, 1, &[*amount]);
            vec![form]
        }
        Form::Morph { from, to, t } => {
            node(abi::POLYPTYCH_FORM_MORPH, 2, &[*t]);
            vec![from, to]
        }
    };
    parts.into_iter().for_each(|part| push_nodes(part, nodes));
}

fn material(place: &mut impl Place, material: &Material) -> PolyptychMaterial {
    let (triplanar, triplanar_scale) = match material.mapping {
        Mapping::Uv => (0, 0.0),
        Mapping::Triplanar { scale } => (1, scale),
    };
    let (alpha, alpha_cutoff) = match material.alpha {
        AlphaMode::Opaque => (abi::POLYPTYCH_ALPHA_OPAQUE, 0.0),
        AlphaMode::Mask(cutoff) => (abi::POLYPTYCH_ALPHA_MASK, cutoff),
        AlphaMode::Blend => (abi::POLYPTYCH_ALPHA_BLEND, 0.0),
    };
    PolyptychMaterial {
        size: size_of::<PolyptychMaterial>() as u32,
        texture: material.texture.map_or(0, |t| t as u32 + 1),
        name: place.text(&material.name),
        base_color: material.base_color.to_array(),
        ambient: material.ambient,
        diffuse: material.diffuse,
        specular: material.specular,
        shininess: material.shininess,
        emission: material.emission.to_array(),
        opacity: material.opacity,
        reflectivity: material.reflectivity,
        triplanar_scale,
        triplanar,
        alpha,
        alpha_cutoff,
        normal_map: material.normal_map.map_or(0, |map| map.texture as u32 + 1),
        normal_scale: material.normal_map.map_or(0.0, |map| map.scale),
    }
}

fn texture(place: &mut impl Place, names: &mut Names, texture: &Arc<Texture>) -> PolyptychTexture {
    let id = names.texture(texture);
    let wrap = |w| match w {
        TextureWrap::Repeat => abi::POLYPTYCH_WRAP_REPEAT,
        TextureWrap::Mirror => abi::POLYPTYCH_WRAP_MIRROR,
        TextureWrap::Clamp => abi::POLYPTYCH_WRAP_CLAMP,
    };
    let [width, height] = texture.size();
    PolyptychTexture {
        size: size_of::<PolyptychTexture>() as u32,
        width,
        height,
        wrap_u: wrap(texture.wrap[0]),
        wrap_v: wrap(texture.wrap[1]),
        reserved: 0,
        id,
        name: place.text(&texture.name),
        texels: place.lend((id, 0), texture.texels()).cast(),
    }
}

fn light(light: &Light) -> PolyptychLight {
    let none = DVec3::ZERO;
    let (kind, position, direction, inner, outer) = match light.kind {
        LightKind::Directional { direction } => (abi::POLYPTYCH_DIRECTIONAL, none, direction, 0.0, 0.0),
        LightKind::Point { position } => (abi::POLYPTYCH_POINT, position, none, 0.0, 0.0),
        LightKind::Spot { position, direction, inner, outer } => {
            (abi::POLYPTYCH_SPOT, position, direction, inner, outer)
        }
    };
    PolyptychLight {
        size: size_of::<PolyptychLight>() as u32,
        kind,
        position: position.to_array(),
        direction: direction.to_array(),
        inner,
        outer,
        color: light.color.to_array(),
        intensity: light.intensity,
        casts_shadow: u32::from(light.casts_shadow),
        reserved: 0,
    }
}

fn environment(environment: &Environment) -> PolyptychEnvironment {
    let (solid, [below, horizon, above]) = match environment.background {
        Background::Solid(color) => (1, [color; 3]),
        Background::Gradient { below, horizon, above } => (0, [below, horizon, above]),
    };
    let (fog, fog_color, fog_density) =
        environment.fog.as_ref().map_or((0, [0.0; 3], 0.0), |fog| (1, fog.color.to_array(), fog.density));
    PolyptychEnvironment {
        size: size_of::<PolyptychEnvironment>() as u32,
        lighting: match environment.lighting {
            LightingModel::Lambert => abi::POLYPTYCH_LAMBERT,
            LightingModel::Phong => abi::POLYPTYCH_PHONG,
            LightingModel::BlinnPhong => abi::POLYPTYCH_BLINN_PHONG,
        },
        below: below.to_array(),
        horizon: horizon.to_array(),
        above: above.to_array(),
        solid,
        ambient: environment.ambient.to_array(),
        fog,
        fog_color,
        fog_density,
    }
}

/// Makes the flat form of a camera; a warp table is used where it is.
pub(crate) fn camera(camera: &Camera) -> PolyptychCamera {
    let (projection, angles) = match &camera.projection {
        Projection::Perspective { fov_y } => (abi::POLYPTYCH_PERSPECTIVE, [*fov_y, 0.0]),
        Projection::Orthographic { height } => (abi::POLYPTYCH_ORTHOGRAPHIC, [*height, 0.0]),
        Projection::Fisheye { fov } => (abi::POLYPTYCH_FISHEYE, [*fov, 0.0]),
        Projection::Cylindrical { fov_x, fov_y } => (abi::POLYPTYCH_CYLINDRICAL, [*fov_x, *fov_y]),
        Projection::Warp(_) => (abi::POLYPTYCH_WARP, [0.0; 2]),
    };
    let warp = if let Projection::Warp(table) = &camera.projection { Some(table) } else { None };
    PolyptychCamera {
        size: size_of::<PolyptychCamera>() as u32,
        projection,
        eye: camera.eye.to_array(),
        world_from_camera: camera.world_from_camera.to_cols_array(),
        angles,
        warp_columns: warp.map_or(0, |w| w.columns()),
        warp_rows: warp.map_or(0, |w| w.rows()),
        warp_directions: warp.map_or(null(), |w| w.directions().as_ptr().cast()),
    }
}

/// Makes the flat form of a need.
pub(crate) fn need(
    place: &mut impl Place,
    need: &Need,
    camera: *const PolyptychCamera,
    declared: &[Parameter],
) -> PolyptychNeed {
    let values: Vec<PolyptychValue> =
        declared.iter().map(|parameter| value(place, parameter, &need.settings, declared)).collect();
    PolyptychNeed {
        size: size_of::<PolyptychNeed>() as u32,
        width: need.width,
        height: need.height,
        channels: u32::from(need.channels.bits()),
        samples: need.samples,
        value_count: values.len() as u32,
        tolerance_px: need.tolerance_px,
        camera,
        values: place.put(values),
    }
}

fn value(
    place: &mut impl Place,
    parameter: &Parameter,
    settings: &Settings,
    declared: &[Parameter],
) -> PolyptychValue {
    let none = PolyptychValue { integer: 0, number: 0.0, text: null() };
    match settings.get(declared, parameter.name) {
        Value::Bool(v) => PolyptychValue { integer: i64::from(*v), ..none },
        Value::Int(v) => PolyptychValue { integer: *v, number: *v as f64, ..none },
        Value::Float(v) => PolyptychValue { number: *v, ..none },
        Value::Text(v) => {
            let index = match parameter.kind {
                polyptych_core::seam::ParameterKind::Choice { choices } => {
                    choices.iter().position(|c| c == v).unwrap_or(0)
                }
                _ => 0,
            };
            PolyptychValue { integer: index as i64, text: place.text(v), ..none }
        }
    }
}
