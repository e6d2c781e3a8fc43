//! How does the flat scene become a [`Scene`] again? Shapes and textures that were seen before are kept.

#![expect(unsafe_code, reason = "the border to the host")]

use crate::abi::{
    self, PolyptychCamera, PolyptychFormNode, PolyptychFreeForm, PolyptychScene, PolyptychShape,
};
use glam::{DAffine3, DMat3, DVec2, DVec3, Vec2, Vec3};
use polyptych_core::camera::{Camera, Projection, WarpTable};
use polyptych_core::math::Aabb;
use polyptych_core::scene::{
    AlphaMode, Background, Chunk, Environment, Fog, Form, FreeForm, HeightField, Light, LightKind,
    LightingModel, Mapping, Material, Mesh, NormalMap, Object, Perturbation, Power, Primitive, Quadric,
    Samples, Scene, Shape, Texture, TextureWrap, TransferFunction, TransferPoint, Volume, Voxels,
};
use std::collections::HashMap;
use std::ffi::{CStr, c_char};
use std::sync::Arc;

/// Scenes that were rebuilt, and their parts by the host's names for them.
#[derive(Default)]
pub(crate) struct Scenes {
    last: Option<(u64, Arc<Scene>)>,
    shapes: HashMap<u64, Arc<Shape>>,
    textures: HashMap<u64, Arc<Texture>>,
}

impl Scenes {
    /// Rebuilds the host's scene, or returns the one that was rebuilt before.
    ///
    /// # Safety
    /// The pointer is the host's, and what it reaches is as the header says.
    pub(crate) unsafe fn rebuild(&mut self, scene: *const PolyptychScene) -> Result<Arc<Scene>, String> {
        // SAFETY: the caller's promise.
        let flat = unsafe { abi::read(scene) }.ok_or("the host passed no scene")?;
        if let Some((id, scene)) = &self.last
            && *id == flat.id
        {
            return Ok(scene.clone());
        }
        // SAFETY: the caller's promise.
        let scene = Arc::new(unsafe { self.rebuild_all(&flat) }?);
        self.last = Some((flat.id, scene.clone()));
        Ok(scene)
    }

    /// Drops shapes and textures that a scene has not.
    pub(crate) fn forget_all_but(&mut self, scene: &Scene) {
        self.shapes.retain(|_, shape| scene.objects.iter().any(|o| Arc::ptr_eq(&o.shape, shape)));
        self.textures.retain(|_, texture| scene.textures.iter().any(|t| Arc::ptr_eq(t, texture)));
    }

    unsafe fn rebuild_all(&mut self, flat: &PolyptychScene) -> Result<Scene, String> {
        // SAFETY: the caller's promise holds for all that the scene reaches.
        unsafe {
            let mut scene = Scene { name: words(flat.name), ..Scene::default() };
            for texture in each(flat.textures, flat.texture_count) {
                scene.textures.push(self.texture(&texture));
            }
            scene.materials.extend(each(flat.materials, flat.material_count).map(|m| material(&m)));
            scene.lights.extend(each(flat.lights, flat.light_count).map(|l| light(&l)));
            if let Some(flat) = abi::read(flat.environment) {
                scene.environment = environment(&flat);
            }
            for object in each(flat.objects, flat.object_count) {
                let name = words(object.name);
                let shape = match abi::read(object.shape) {
                    Some(flat) => self.shape(&flat).map_err(|e| format!("object `{name}`: {e}"))?,
                    None => Arc::new(Shape::Mesh(Mesh::default())),
                };
                let slots = slice(object.materials, u64::from(object.material_count));
                scene.objects.push(Object {
                    name,
                    shape,
                    world_from_object: DAffine3::from_cols_array(&object.world_from_object),
                    materials: slots.iter().map(|&m| m as usize).collect(),
                    visible: object.visible != 0,
                    required: object.required != 0,
                });
            }
            Ok(scene)
        }
    }

    unsafe fn texture(&mut self, flat: &abi::PolyptychTexture) -> Arc<Texture> {
        let wrap = |w| match w {
            abi::POLYPTYCH_WRAP_MIRROR => TextureWrap::Mirror,
            abi::POLYPTYCH_WRAP_CLAMP => TextureWrap::Clamp,
            _ => TextureWrap::Repeat,
        };
        let known = self.textures.entry(flat.id).or_insert_with(|| {
            let (width, height) = (flat.width.max(1), flat.height.max(1));
            // SAFETY: the host's textures have as many texels as they say.
            let texels =
                unsafe { slice(flat.texels.cast::<[u16; 4]>(), u64::from(width) * u64::from(height)) };
            // SAFETY: the host's text.
            let name = unsafe { words(flat.name) };
            let mut texture = Texture::from_linear16(name, width, height, texels.to_vec());
            texture.wrap = [wrap(flat.wrap_u), wrap(flat.wrap_v)];
            Arc::new(texture)
        });
        known.clone()
    }

    unsafe fn shape(&mut self, flat: &PolyptychShape) -> Result<Arc<Shape>, String> {
        if let Some(known) = self.shapes.get(&flat.id) {
            return Ok(known.clone());
        }
        let none = || format!("the shape of kind {} is missing", flat.kind);
        // SAFETY: the caller's promise holds for all that the shape reaches.
        let shape = unsafe {
            match flat.kind {
                abi::POLYPTYCH_PRIMITIVE => {
                    Shape::Primitive(primitive(&abi::read(flat.primitive).ok_or_else(none)?)?)
                }
                abi::POLYPTYCH_MESH => Shape::Mesh(mesh(&abi::read(flat.mesh).ok_or_else(none)?)),
                abi::POLYPTYCH_VOXELS => Shape::Voxels(voxels(&abi::read(flat.voxels).ok_or_else(none)?)?),
                abi::POLYPTYCH_FREE_FORM => {
                    Shape::FreeForm(free_form(&abi::read(flat.free_form).ok_or_else(none)?)?)
                }
                abi::POLYPTYCH_HEIGHT_FIELD => {
                    let field = abi::read(flat.height_field).ok_or_else(none)?;
                    let heights = slice(field.heights, u64::from(field.columns) * u64::from(field.rows));
                    let extent = DVec2::from_array(field.extent);
                    Shape::HeightField(HeightField::new(field.columns, field.rows, extent, heights.to_vec())?)
                }
                abi::POLYPTYCH_VOLUME => Shape::Volume(volume(&abi::read(flat.volume).ok_or_else(none)?)?),
                other => return Err(format!("a kind of shape ({other}) that this plugin does not know")),
            }
        };
        let shape = Arc::new(shape);
        self.shapes.insert(flat.id, shape.clone());
        Ok(shape)
    }
}

/// Borrows an array of the host.
///
/// # Safety
/// It has that many elements, or the pointer is null.
pub(crate) unsafe fn slice<'a, T>(first: *const T, count: u64) -> &'a [T] {
    if first.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: the caller's promise.
    unsafe { std::slice::from_raw_parts(first, count as usize) }
}

/// Reads the elements of an array, whatever their size.
unsafe fn each<T: abi::SizeFirst>(first: *const T, count: u32) -> impl Iterator<Item = T> {
    let count = if first.is_null() { 0 } else { count };
    // SAFETY: the caller promises an array of that length.
    (0..count).filter_map(move |i| unsafe { abi::read(abi::element(first, i)) })
}

/// Reads text; null is empty.
///
/// # Safety
/// The text ends with a zero byte.
pub(crate) unsafe fn words(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Reads a camera.
///
/// # Safety
/// The pointer is null or the host's.
pub(crate) unsafe fn camera(from: *const PolyptychCamera) -> Option<Camera> {
    // SAFETY: the caller's promise; a warp table is as large as it says.
    let (flat, directions) = unsafe {
        let flat = abi::read(from)?;
        let count = u64::from(flat.warp_columns) * u64::from(flat.warp_rows);
        (flat, slice(flat.warp_directions.cast::<[f64; 3]>(), count))
    };
    let [a, b] = flat.angles;
    let projection = match flat.projection {
        abi::POLYPTYCH_ORTHOGRAPHIC => Projection::Orthographic { height: a },
        abi::POLYPTYCH_FISHEYE => Projection::Fisheye { fov: a },
        abi::POLYPTYCH_CYLINDRICAL => Projection::Cylindrical { fov_x: a, fov_y: b },
        abi::POLYPTYCH_WARP => {
            let directions = directions.iter().map(|&d| DVec3::from_array(d)).collect();
            Projection::Warp(Arc::new(WarpTable::new(flat.warp_columns, flat.warp_rows, directions).ok()?))
        }
        _ => Projection::Perspective { fov_y: a },
    };
    Some(Camera {
        eye: DVec3::from_array(flat.eye),
        world_from_camera: DMat3::from_cols_array(&flat.world_from_camera),
        projection,
    })
}

fn primitive(flat: &abi::PolyptychPrimitive) -> Result<Primitive, String> {
    let [a, b, c, d] = flat.numbers;
    Ok(match flat.kind {
        abi::POLYPTYCH_BOX => Primitive::Box { size: DVec3::new(a, b, c) },
        abi::POLYPTYCH_SPHERE => Primitive::Sphere { radius: a },
        abi::POLYPTYCH_CYLINDER => Primitive::Cylinder { radius: a, height: b },
        abi::POLYPTYCH_CONE => Primitive::Cone { radius: a, height: b },
        abi::POLYPTYCH_TORUS => Primitive::Torus { major: a, minor: b },
        abi::POLYPTYCH_PLANE => Primitive::Plane { width: a, depth: b },
        abi::POLYPTYCH_FRUSTUM => {
            Primitive::Frustum { sides: a as u32, lower_radius: b, upper_radius: c, height: d }
        }
        other => return Err(format!("a kind of primitive ({other}) that this plugin does not know")),
    })
}

unsafe fn mesh(flat: &abi::PolyptychMesh) -> Mesh {
    let (n, m) = (flat.vertex_count, flat.triangle_count);
    // SAFETY: the caller promises arrays of the lengths that the mesh says; vectors are as many numbers in a row.
    unsafe {
        Mesh {
            positions: slice(flat.positions.cast::<Vec3>(), n).to_vec(),
            normals: slice(flat.normals.cast::<Vec3>(), n).to_vec(),
            uvs: slice(flat.uvs.cast::<[f32; 2]>(), n).iter().map(|&uv| Vec2::from_array(uv)).collect(),
            colors: slice(flat.colors.cast::<Vec3>(), n).to_vec(),
            triangles: slice(flat.triangles.cast::<[u32; 3]>(), m).to_vec(),
            slots: slice(flat.slots, m).to_vec(),
            segments: slice(flat.segments.cast::<[u32; 2]>(), flat.segment_count).to_vec(),
        }
    }
}

unsafe fn voxels(flat: &abi::PolyptychVoxels) -> Result<Voxels, String> {
    let count = flat.cells.iter().map(|&c| u64::from(c.div_ceil(64))).product();
    // SAFETY: the caller promises the chunks of a grid of that size, each of 64^3 bytes.
    let chunks = unsafe { slice(flat.chunks, count) }.iter().map(|chunk| {
        if chunk.cells.is_null() {
            Chunk::Uniform(chunk.uniform as u8)
        } else {
            // SAFETY: as above.
            Chunk::Cells(unsafe { slice(chunk.cells, 64 * 64 * 64) }.into())
        }
    });
    Voxels::from_chunks(flat.cells, &chunks.collect::<Vec<_>>())
}

unsafe fn volume(flat: &abi::PolyptychVolume) -> Result<Volume, String> {
    let count = flat.samples.iter().map(|&s| u64::from(s)).product();
    // SAFETY: the caller promises as many samples of the format, and as many points, as the volume says.
    let (samples, points, shell) = unsafe {
        let samples = match flat.format {
            abi::POLYPTYCH_U8 => Samples::U8(slice(flat.data.cast(), count).to_vec()),
            abi::POLYPTYCH_I16 => Samples::I16(slice(flat.data.cast(), count).to_vec()),
            abi::POLYPTYCH_U16 => Samples::U16(slice(flat.data.cast(), count).to_vec()),
            abi::POLYPTYCH_F32 => Samples::F32(slice(flat.data.cast(), count).to_vec()),
            other => return Err(format!("samples of a kind ({other}) that this plugin does not know")),
        };
        (samples, slice(flat.points, u64::from(flat.point_count)), abi::read(flat.shell))
    };
    let mut volume = Volume::new(flat.samples, DVec3::from_array(flat.spacing), samples)?;
    let point = |p: &abi::PolyptychTransferPoint| TransferPoint {
        value: p.value,
        color: p.color.into(),
        opacity: p.opacity,
    };
    volume.transfer = TransferFunction {
        points: points.iter().map(point).collect(),
        reference_length: flat.reference_length,
    };
    if let Some(shell) = shell {
        // SAFETY: the caller's promise.
        volume.shell = Some(unsafe { free_form(&shell) }?);
    }
    Ok(volume)
}

unsafe fn free_form(flat: &PolyptychFreeForm) -> Result<FreeForm, String> {
    // SAFETY: the caller promises as many nodes as the form says.
    let mut nodes = unsafe { slice(flat.nodes, u64::from(flat.node_count)) };
    let [x0, y0, z0, x1, y1, z1] = flat.bounds;
    let bounds = Aabb::new(DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
    Ok(FreeForm::from_parts(form(&mut nodes)?, bounds))
}

/// Reads a function and takes its nodes off the list.
fn form(nodes: &mut &[PolyptychFormNode]) -> Result<Form, String> {
    let (node, rest) = nodes.split_first().ok_or("a free form with too few nodes")?;
    *nodes = rest;
    let n = node.numbers;
    let vec = |i: usize| DVec3::new(n[i], n[i + 1], n[i + 2]);
    if node.kind == abi::POLYPTYCH_FORM_PERTURBED {
        let base = Box::new(form(nodes)?);
        let terms = (1..node.children).map(|_| term(nodes)).collect::<Result<_, _>>()?;
        return Ok(Form::Perturbed { base, terms });
    }
    let mut parts = (0..node.children).map(|_| form(nodes)).collect::<Result<Vec<_>, _>>()?.into_iter();
    let mut part =
        || parts.next().map(Box::new).ok_or_else(|| format!("form {} with too few parts", node.kind));
    Ok(match node.kind {
        abi::POLYPTYCH_FORM_QUADRIC => Form::Quadric(Quadric(n)),
        abi::POLYPTYCH_FORM_ELLIPSOID => Form::Ellipsoid { center: vec(0), radii: vec(3) },
        abi::POLYPTYCH_FORM_HALF_SPACE => Form::HalfSpace { normal: vec(0), offset: n[3] },
        abi::POLYPTYCH_FORM_CYLINDER => Form::Cylinder { center: vec(0), axis: vec(3), radius: n[6] },
        abi::POLYPTYCH_FORM_TORUS => Form::Torus { major: n[0], minor: n[1] },
        abi::POLYPTYCH_FORM_UNION => Form::Union(parts.collect()),
        abi::POLYPTYCH_FORM_INTERSECTION => Form::Intersection(parts.collect()),
        abi::POLYPTYCH_FORM_DIFFERENCE => Form::Difference(part()?, part()?),
        abi::POLYPTYCH_FORM_SMOOTH_UNION => Form::SmoothUnion { a: part()?, b: part()?, k: n[0] },
        abi::POLYPTYCH_FORM_OFFSET => Form::Offset { form: part()?, amount: n[0] },
        abi::POLYPTYCH_FORM_MORPH => Form::Morph { from: part()?, to: part()?, t: n[0] },
        other => return Err(format!("a function ({other}) that this plugin does not know")),
    })
}

fn term(nodes: &mut &[PolyptychFormNode]) -> Result<Perturbation, String> {
    let (node, rest) = nodes.split_first().ok_or("a free form with too few nodes")?;
    *nodes = rest;
    let power = if node.numbers[1] >= 3.0 { Power::Cube } else { Power::Square };
    Ok(Perturbation { weight: node.numbers[0], power, function: form(nodes)? })
}

unsafe fn material(flat: &abi::PolyptychMaterial) -> Material {
    Material {
        // SAFETY: the host's text.
        name: unsafe { words(flat.name) },
        base_color: flat.base_color.into(),
        texture: flat.texture.checked_sub(1).map(|t| t as usize),
        mapping: if flat.triplanar == 0 {
            Mapping::Uv
        } else {
            Mapping::Triplanar { scale: flat.triplanar_scale }
        },
        ambient: flat.ambient,
        diffuse: flat.diffuse,
        specular: flat.specular,
        shininess: flat.shininess,
        emission: flat.emission.into(),
        opacity: flat.opacity,
        reflectivity: flat.reflectivity,
        alpha: match flat.alpha {
            abi::POLYPTYCH_ALPHA_MASK => AlphaMode::Mask(flat.alpha_cutoff),
            abi::POLYPTYCH_ALPHA_BLEND => AlphaMode::Blend,
            _ => AlphaMode::Opaque,
        },
        normal_map: flat
            .normal_map
            .checked_sub(1)
            .map(|t| NormalMap { texture: t as usize, scale: flat.normal_scale }),
    }
}

fn light(flat: &abi::PolyptychLight) -> Light {
    let (position, direction) = (flat.position.into(), flat.direction.into());
    Light {
        kind: match flat.kind {
            abi::POLYPTYCH_POINT => LightKind::Point { position },
            abi::POLYPTYCH_SPOT => {
                LightKind::Spot { position, direction, inner: flat.inner, outer: flat.outer }
            }
            _ => LightKind::Directional { direction },
        },
        color: flat.color.into(),
        intensity: flat.intensity,
        casts_shadow: flat.casts_shadow != 0,
    }
}

fn environment(flat: &abi::PolyptychEnvironment) -> Environment {
    Environment {
        background: if flat.solid == 0 {
            Background::Gradient {
                below: flat.below.into(),
                horizon: flat.horizon.into(),
                above: flat.above.into(),
            }
        } else {
            Background::Solid(flat.horizon.into())
        },
        ambient: flat.ambient.into(),
        fog: (flat.fog != 0).then(|| Fog { color: flat.fog_color.into(), density: flat.fog_density }),
        lighting: match flat.lighting {
            abi::POLYPTYCH_LAMBERT => LightingModel::Lambert,
            abi::POLYPTYCH_PHONG => LightingModel::Phong,
            _ => LightingModel::BlinnPhong,
        },
    }
}
