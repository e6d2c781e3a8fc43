//! What crosses the border between the host and a back end in a library: C types and nothing else.
//!
//! `include/polyptych.h` is made from this file; a test holds them together. Names are the same in both languages.
//!
//! Rules, for both sides:
//! - A library exports one function, `polyptych_plugin`, which returns a [`PolyptychPlugin`] that lives for ever.
//! - Every struct begins with its size in bytes, as its maker knew it. Fields are only ever appended, in a new minor
//!   version; a reader looks at a field only if the size covers it. In an array, the size of the first element is
//!   the distance between elements. [`PolyptychValue`], [`PolyptychRay`], [`PolyptychChunk`], [`PolyptychFormNode`]
//!   and [`PolyptychTransferPoint`] have no size: they stay as they are within a major version.
//! - Whoever makes something owns it. What the host passes is lent until the call returns; what a plugin passes to a
//!   host function is lent until that function returns. Nothing is freed by the other side.
//! - Text is UTF-8 and ends with a zero byte. A pointer may be null only where that is said.
//! - No call unwinds or throws across the border, in either direction.
//! - One instance is used by one thread at a time; different instances may be used at the same time.

use std::ffi::{c_char, c_void};

/// First word of the table: the bytes `PLYP` in memory on a little-endian machine.
pub const POLYPTYCH_MAGIC: u32 = 0x5059_4c50;
/// Version of the interface that breaks with what was before.
pub const POLYPTYCH_MAJOR: u32 = 1;
/// Version of the interface that only adds.
///
/// 1: materials have normal maps.
pub const POLYPTYCH_MINOR: u32 = 1;

/// Instead of an object's index: no object.
pub const POLYPTYCH_NO_OBJECT: u32 = 0xffff_ffff;

/// Kind of shape, and its bit in a set of kinds: a parametric body.
pub const POLYPTYCH_PRIMITIVE: u32 = 1;
/// Kind of shape: triangles.
pub const POLYPTYCH_MESH: u32 = 2;
/// Kind of shape: a grid of palette bytes.
pub const POLYPTYCH_VOXELS: u32 = 4;
/// Kind of shape: a solid where a function is positive.
pub const POLYPTYCH_FREE_FORM: u32 = 8;
/// Kind of shape: heights over a plane.
pub const POLYPTYCH_HEIGHT_FIELD: u32 = 16;
/// Kind of shape: a scalar field.
pub const POLYPTYCH_VOLUME: u32 = 32;
/// All kinds of shape of this version.
pub const POLYPTYCH_ALL_SHAPES: u32 = 63;

/// Bit of a channel: linear RGB.
pub const POLYPTYCH_COLOR: u32 = 1;
/// Bit of a channel: distance from the eye in meters, infinity = nothing.
pub const POLYPTYCH_DISTANCE: u32 = 2;
/// Bit of a channel: unit normal in world space on the viewer's side, zero = nothing.
pub const POLYPTYCH_NORMAL: u32 = 4;
/// Bit of a channel: index of the object plus one, 0 = nothing.
pub const POLYPTYCH_ID: u32 = 8;
/// Bit of a channel: base color with texture, unlit.
pub const POLYPTYCH_ALBEDO: u32 = 16;
/// Bit of a channel: share of the shadow-casting lights that reach the point; 1 where nothing is seen.
pub const POLYPTYCH_SHADOW: u32 = 32;
/// Bit of a channel: share of the pixel that objects cover.
pub const POLYPTYCH_COVERAGE: u32 = 64;
/// All channels of this version.
pub const POLYPTYCH_ALL_CHANNELS: u32 = 127;

/// Status: done.
pub const POLYPTYCH_OK: i32 = 0;
/// Status: stopped because the host asked for it; the target holds finished parts.
pub const POLYPTYCH_CANCELLED: i32 = 1;
/// Status: `render` was called before `prepare`.
pub const POLYPTYCH_NOT_PREPARED: i32 = 2;
/// Status: a required object cannot be drawn; say which and why with `PolyptychHost::refuse`.
pub const POLYPTYCH_REQUIRED: i32 = 3;
/// Status: failed; say why with `PolyptychHost::refuse`.
pub const POLYPTYCH_FAILED: i32 = 4;
/// Status: a bug in the plugin was caught inside the plugin; the instance is not used again.
pub const POLYPTYCH_PANICKED: i32 = 5;

/// Decision: drawn as given.
pub const POLYPTYCH_EXACT: u32 = 0;
/// Decision: drawn in another representation, at most `bound` meters off.
pub const POLYPTYCH_CONVERTED: u32 = 1;
/// Decision: something is left out or simplified.
pub const POLYPTYCH_APPROXIMATED: u32 = 2;
/// Decision: not drawn.
pub const POLYPTYCH_SKIPPED: u32 = 3;

/// Kind of parameter: on or off, in `PolyptychValue::integer`.
pub const POLYPTYCH_BOOL: u32 = 0;
/// Kind of parameter: a whole number, in `PolyptychValue::integer`.
pub const POLYPTYCH_INT: u32 = 1;
/// Kind of parameter: a number, in `PolyptychValue::number`.
pub const POLYPTYCH_FLOAT: u32 = 2;
/// Kind of parameter: one of several words, in `PolyptychValue::text`; its index in `PolyptychValue::integer`.
pub const POLYPTYCH_CHOICE: u32 = 3;
/// Kind of parameter: a color `#rrggbb`, in `PolyptychValue::text`.
pub const POLYPTYCH_RGB: u32 = 4;

/// Severity of a log line: of interest to the plugin's author.
pub const POLYPTYCH_DEBUG: u32 = 0;
/// Severity of a log line: of interest to the user.
pub const POLYPTYCH_NOTE: u32 = 1;
/// Severity of a log line: the picture is not what it should be.
pub const POLYPTYCH_WARNING: u32 = 2;
/// Severity of a log line: something failed.
pub const POLYPTYCH_ERROR: u32 = 3;

/// Bit of a processor feature that a plugin needs: AVX.
pub const POLYPTYCH_CPU_AVX: u64 = 1;
/// Bit of a processor feature: AVX2.
pub const POLYPTYCH_CPU_AVX2: u64 = 2;
/// Bit of a processor feature: fused multiply-add.
pub const POLYPTYCH_CPU_FMA: u64 = 4;
/// Bit of a processor feature: AVX-512 Foundation.
pub const POLYPTYCH_CPU_AVX512F: u64 = 8;

/// Projection: straight lines stay straight; `angles[0]` is the vertical field of view.
pub const POLYPTYCH_PERSPECTIVE: u32 = 0;
/// Projection: parallel rays; `angles[0]` is the height of the picture in meters.
pub const POLYPTYCH_ORTHOGRAPHIC: u32 = 1;
/// Projection: the distance from the middle is the angle to the axis; `angles[0]` is the angle across the circle.
pub const POLYPTYCH_FISHEYE: u32 = 2;
/// Projection: columns are angles around the up axis; `angles` are those across the width and the height.
pub const POLYPTYCH_CYLINDRICAL: u32 = 3;
/// Projection: directions from a table.
pub const POLYPTYCH_WARP: u32 = 4;

/// Kind of light: parallel.
pub const POLYPTYCH_DIRECTIONAL: u32 = 0;
/// Kind of light: from a point, falling with the square of the distance.
pub const POLYPTYCH_POINT: u32 = 1;
/// Kind of light: from a point, inside a cone.
pub const POLYPTYCH_SPOT: u32 = 2;

/// Lighting model: diffuse light only.
pub const POLYPTYCH_LAMBERT: u32 = 0;
/// Lighting model: highlight by the mirrored light direction.
pub const POLYPTYCH_PHONG: u32 = 1;
/// Lighting model: highlight by the half vector.
pub const POLYPTYCH_BLINN_PHONG: u32 = 2;

/// Meaning of a texture's alpha: none.
pub const POLYPTYCH_ALPHA_OPAQUE: u32 = 0;
/// Meaning of a texture's alpha: below `alpha_cutoff` is a hole.
pub const POLYPTYCH_ALPHA_MASK: u32 = 1;
/// Meaning of a texture's alpha: opacity.
pub const POLYPTYCH_ALPHA_BLEND: u32 = 2;

/// Outside of a texture: it repeats.
pub const POLYPTYCH_WRAP_REPEAT: u32 = 0;
/// Outside of a texture: it repeats, every other time mirrored.
pub const POLYPTYCH_WRAP_MIRROR: u32 = 1;
/// Outside of a texture: its border is drawn out.
pub const POLYPTYCH_WRAP_CLAMP: u32 = 2;

/// Primitive: a box; `numbers` are its edge lengths.
pub const POLYPTYCH_BOX: u32 = 0;
/// Primitive: a sphere; its radius.
pub const POLYPTYCH_SPHERE: u32 = 1;
/// Primitive: a cylinder along y; radius, height.
pub const POLYPTYCH_CYLINDER: u32 = 2;
/// Primitive: a cone along y, the apex at the top; radius, height.
pub const POLYPTYCH_CONE: u32 = 3;
/// Primitive: a ring around y; radius of the ring, radius of the tube.
pub const POLYPTYCH_TORUS: u32 = 4;
/// Primitive: a rectangle in the xz plane; width, depth.
pub const POLYPTYCH_PLANE: u32 = 5;
/// Primitive: a frustum of a regular pyramid; sides, lower radius, upper radius, height.
pub const POLYPTYCH_FRUSTUM: u32 = 6;

/// Form: ten coefficients of x2 y2 z2 xy xz yz x y z 1.
pub const POLYPTYCH_FORM_QUADRIC: u32 = 0;
/// Form: center, radii.
pub const POLYPTYCH_FORM_ELLIPSOID: u32 = 1;
/// Form: normal, offset.
pub const POLYPTYCH_FORM_HALF_SPACE: u32 = 2;
/// Form: center, axis, radius.
pub const POLYPTYCH_FORM_CYLINDER: u32 = 3;
/// Form: radius of the ring, radius of the tube.
pub const POLYPTYCH_FORM_TORUS: u32 = 4;
/// Form: its first child bent by the others, which are `POLYPTYCH_FORM_TERM`.
pub const POLYPTYCH_FORM_PERTURBED: u32 = 5;
/// Form: a perturbation by its child; weight, power (2 or 3).
pub const POLYPTYCH_FORM_TERM: u32 = 6;
/// Form: the maximum of its children.
pub const POLYPTYCH_FORM_UNION: u32 = 7;
/// Form: the minimum of its children.
pub const POLYPTYCH_FORM_INTERSECTION: u32 = 8;
/// Form: its first child without its second.
pub const POLYPTYCH_FORM_DIFFERENCE: u32 = 9;
/// Form: two children with a fillet; its width.
pub const POLYPTYCH_FORM_SMOOTH_UNION: u32 = 10;
/// Form: its child plus an amount.
pub const POLYPTYCH_FORM_OFFSET: u32 = 11;
/// Form: from its first child to its second; the share of the second.
pub const POLYPTYCH_FORM_MORPH: u32 = 12;

/// Numbers of a volume's samples: one byte.
pub const POLYPTYCH_U8: u32 = 0;
/// Numbers of a volume's samples: two bytes, with sign.
pub const POLYPTYCH_I16: u32 = 1;
/// Numbers of a volume's samples: two bytes, without sign.
pub const POLYPTYCH_U16: u32 = 2;
/// Numbers of a volume's samples: four bytes, floating point.
pub const POLYPTYCH_F32: u32 = 3;

/// The value of a parameter; which field counts follows from the parameter's kind.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychValue {
    /// Switch (0 or 1), whole number, or index of a choice.
    pub integer: i64,
    /// Number.
    pub number: f64,
    /// Word or color; null for other kinds.
    pub text: *const c_char,
}

/// A parameter that users may set.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychParameter {
    /// Bytes of this struct.
    pub size: u32,
    /// Kind of parameter.
    pub kind: u32,
    /// Dotted name, unique within the plugin: `detail.samples`.
    pub name: *const c_char,
    /// Unit, empty for pure numbers.
    pub unit: *const c_char,
    /// One line of help.
    pub help: *const c_char,
    /// Meaning shared across back ends, or empty.
    pub tag: *const c_char,
    /// Value when nobody sets it.
    pub initial: PolyptychValue,
    /// Smallest whole number or number.
    pub least: PolyptychValue,
    /// Largest whole number or number.
    pub most: PolyptychValue,
    /// The words of a choice; null for other kinds.
    pub choices: *const *const c_char,
    /// Number of words.
    pub choice_count: u32,
    /// 1 where it trades time for accuracy, else 0.
    pub quality_axis: u32,
}

/// What a back end says of itself. Owned by the plugin, for ever.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychInfo {
    /// Bytes of this struct.
    pub size: u32,
    /// Shapes that are drawn as given, for tables and reports.
    pub native_shapes: u32,
    /// Shapes that the plugin takes; the host converts all others into triangles, or else voxels, before.
    pub accepted_shapes: u32,
    /// Channels that it can deliver.
    pub channels: u32,
    /// 1 where colors are meant to be those of the lighting equation, 0 where the picture is stylized.
    pub photometric: u32,
    /// Number of parameters.
    pub parameter_count: u32,
    /// Short name on the command line: lower-case letters, digits, `-` and `_`.
    pub id: *const c_char,
    /// Name for people.
    pub name: *const c_char,
    /// Its version.
    pub version: *const c_char,
    /// Its parameters; null where there is none.
    pub parameters: *const PolyptychParameter,
}

/// From where a picture is seen.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychCamera {
    /// Bytes of this struct.
    pub size: u32,
    /// Kind of projection.
    pub projection: u32,
    /// Where the eye is; for parallel rays the middle of the picture plane.
    pub eye: [f64; 3],
    /// Three columns: right, up, backward.
    pub world_from_camera: [f64; 9],
    /// Angles in radians or a height in meters; see the projections.
    pub angles: [f64; 2],
    /// Columns of the table of a warp projection.
    pub warp_columns: u32,
    /// Rows of that table.
    pub warp_rows: u32,
    /// Directions in camera space, three numbers each; null for other projections.
    pub warp_directions: *const f64,
}

/// A ray through a pixel. Its direction has length 1, or 0 where the projection sees nothing.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychRay {
    /// Where it begins.
    pub origin: [f64; 3],
    /// Where it goes.
    pub direction: [f64; 3],
}

/// Triangles in object space.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychMesh {
    /// Bytes of this struct.
    pub size: u32,
    /// Not used, 0.
    pub reserved: u32,
    /// Number of vertices.
    pub vertex_count: u64,
    /// Number of triangles.
    pub triangle_count: u64,
    /// Number of free segments.
    pub segment_count: u64,
    /// Three numbers for each vertex.
    pub positions: *const f32,
    /// Three numbers for each vertex, or null.
    pub normals: *const f32,
    /// Two numbers for each vertex, or null; v grows downward.
    pub uvs: *const f32,
    /// Three numbers for each vertex in linear light, multiplied with the material's color, or null.
    pub colors: *const f32,
    /// Three indices for each triangle, counter-clockwise seen from outside.
    pub triangles: *const u32,
    /// Material slot of each triangle, or null where all have slot 0.
    pub slots: *const u16,
    /// Two indices for each segment, or null.
    pub segments: *const u32,
}

/// A parametric body around the origin; axes of revolution are the y axis.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychPrimitive {
    /// Bytes of this struct.
    pub size: u32,
    /// Which body.
    pub kind: u32,
    /// Its measures in meters; see the bodies.
    pub numbers: [f64; 4],
}

/// 64 x 64 x 64 cells.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychChunk {
    /// One byte a cell, x fastest, then y, then z; null where all cells hold `uniform`.
    pub cells: *const u8,
    /// The byte of all cells where `cells` is null.
    pub uniform: u64,
}

/// A grid of palette bytes: 0 is empty, byte v has the material of slot v - 1. Cell (x, y, z) fills
/// [x, x+1] x [y, y+1] x [z, z+1] in object space.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychVoxels {
    /// Bytes of this struct.
    pub size: u32,
    /// Cells along each axis.
    pub cells: [u32; 3],
    /// Chunks, x fastest; along each axis `(cells + 63) / 64`.
    pub chunks: *const PolyptychChunk,
}

/// A node of a free form's function.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychFormNode {
    /// Which function.
    pub kind: u32,
    /// How many of the following subtrees are its children.
    pub children: u32,
    /// Its numbers; see the functions.
    pub numbers: [f64; 10],
}

/// A solid where a function of position is not negative. The nodes are the function's tree, each before its children.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychFreeForm {
    /// Bytes of this struct.
    pub size: u32,
    /// Number of nodes.
    pub node_count: u32,
    /// The nodes.
    pub nodes: *const PolyptychFormNode,
    /// A box that holds the solid: smallest corner, largest corner.
    pub bounds: [f64; 6],
}

/// A surface y = h(x, z), bilinear between samples, over a rectangle around the origin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychHeightField {
    /// Bytes of this struct.
    pub size: u32,
    /// Samples along x.
    pub columns: u32,
    /// Samples along z.
    pub rows: u32,
    /// Not used, 0.
    pub reserved: u32,
    /// Lengths of the rectangle along x and z.
    pub extent: [f64; 2],
    /// Samples, row by row.
    pub heights: *const f32,
}

/// A support point of a transfer function.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychTransferPoint {
    /// Field value.
    pub value: f32,
    /// Linear color.
    pub color: [f32; 3],
    /// Opacity of a layer as thick as the reference length.
    pub opacity: f32,
}

/// A scalar field with a transfer function; samples lie at cell centers, the box is centered on the origin.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychVolume {
    /// Bytes of this struct.
    pub size: u32,
    /// Samples along each axis.
    pub samples: [u32; 3],
    /// Distance of neighboring samples along each axis.
    pub spacing: [f64; 3],
    /// Numbers of the samples.
    pub format: u32,
    /// Number of support points.
    pub point_count: u32,
    /// Samples, x fastest, then y, then z.
    pub data: *const c_void,
    /// Support points by rising value.
    pub points: *const PolyptychTransferPoint,
    /// Length over which a support point's opacity is reached.
    pub reference_length: f64,
    /// Only what lies inside of this is drawn; null = everything.
    pub shell: *const PolyptychFreeForm,
}

/// The geometry of one or more objects. Exactly the pointer that belongs to `kind` is not null.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychShape {
    /// Bytes of this struct.
    pub size: u32,
    /// Kind of shape.
    pub kind: u32,
    /// A name for its contents: while the program runs, the same id means the same geometry.
    pub id: u64,
    /// See the kinds.
    pub primitive: *const PolyptychPrimitive,
    /// See the kinds.
    pub mesh: *const PolyptychMesh,
    /// See the kinds.
    pub voxels: *const PolyptychVoxels,
    /// See the kinds.
    pub free_form: *const PolyptychFreeForm,
    /// See the kinds.
    pub height_field: *const PolyptychHeightField,
    /// See the kinds.
    pub volume: *const PolyptychVolume,
}

/// One thing in the scene.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychObject {
    /// Bytes of this struct.
    pub size: u32,
    /// 1 where it is to be drawn and decided about; 0 where it is invisible, or the host has skipped it already.
    pub visible: u32,
    /// 1 where the scene is to be refused if it cannot be drawn.
    pub required: u32,
    /// Number of material slots.
    pub material_count: u32,
    /// Its name in reports.
    pub name: *const c_char,
    /// Its geometry; null where the host has skipped it, and in `plan` where the host would convert it.
    pub shape: *const PolyptychShape,
    /// Index of a material for each slot; a slot beyond has the first.
    pub materials: *const u32,
    /// Four columns: where the x, y and z axes go, and where the origin goes.
    pub world_from_object: [f64; 12],
}

/// What a surface is made of.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychMaterial {
    /// Bytes of this struct.
    pub size: u32,
    /// Index of a texture plus one; 0 = none.
    pub texture: u32,
    /// Its name in reports.
    pub name: *const c_char,
    /// Diffuse color in linear light, multiplied with the texture.
    pub base_color: [f32; 3],
    /// Share of ambient light that is returned.
    pub ambient: f32,
    /// Share of light that is scattered evenly.
    pub diffuse: f32,
    /// Share of light that is mirrored as a highlight.
    pub specular: f32,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Light that it gives off.
    pub emission: [f32; 3],
    /// 1 hides what lies behind, 0 is clear.
    pub opacity: f32,
    /// Share of the color that comes from the mirror direction.
    pub reflectivity: f32,
    /// Repeats of the texture in a meter, projected along three axes; 0 = by texture coordinates.
    pub triplanar_scale: f32,
    /// 1 where the texture is projected along three axes.
    pub triplanar: u32,
    /// What the texture's alpha means.
    pub alpha: u32,
    /// Where holes begin.
    pub alpha_cutoff: f32,
    /// Since 1.1: index of a texture plus one, of which red, green and blue from 0 to 1 are normals from -1 to 1: to the
    /// right of the picture, up in it, outward; 0 = none.
    pub normal_map: u32,
    /// Since 1.1: factor on red and green of those.
    pub normal_scale: f32,
}

/// A picture on surfaces.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychTexture {
    /// Bytes of this struct.
    pub size: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What lies outside along u.
    pub wrap_u: u32,
    /// What lies outside along v.
    pub wrap_v: u32,
    /// Not used, 0.
    pub reserved: u32,
    /// A name for its contents: the same id means the same picture.
    pub id: u64,
    /// Its name in reports.
    pub name: *const c_char,
    /// Red, green, blue and alpha in linear light, 65535 = 1; rows from the top.
    pub texels: *const u16,
}

/// A light source without extent.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychLight {
    /// Bytes of this struct.
    pub size: u32,
    /// Kind of light.
    pub kind: u32,
    /// Where it is; not for parallel light.
    pub position: [f64; 3],
    /// Where it goes; not for point lights.
    pub direction: [f64; 3],
    /// Half angle of full light of a cone, radians.
    pub inner: f64,
    /// Half angle of no light of a cone, radians.
    pub outer: f64,
    /// Linear color.
    pub color: [f32; 3],
    /// Factor of the color.
    pub intensity: f32,
    /// 1 where opaque things block it.
    pub casts_shadow: u32,
    /// Not used, 0.
    pub reserved: u32,
}

/// What surrounds the objects.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychEnvironment {
    /// Bytes of this struct.
    pub size: u32,
    /// Lighting model.
    pub lighting: u32,
    /// Color straight down; one color has all three the same.
    pub below: [f32; 3],
    /// Color at eye level. Between, colors mix by the y component of the direction.
    pub horizon: [f32; 3],
    /// Color straight up.
    pub above: [f32; 3],
    /// 1 where the background is one color for all directions.
    pub solid: u32,
    /// Light that comes from everywhere.
    pub ambient: [f32; 3],
    /// 1 where there is fog.
    pub fog: u32,
    /// Color of fog.
    pub fog_color: [f32; 3],
    /// Extinction of fog for each meter.
    pub fog_density: f32,
}

/// Everything that is to be drawn. Lent until the call returns: a plugin copies what it keeps.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychScene {
    /// Bytes of this struct.
    pub size: u32,
    /// Number of objects.
    pub object_count: u32,
    /// Number of materials.
    pub material_count: u32,
    /// Number of textures.
    pub texture_count: u32,
    /// Number of lights.
    pub light_count: u32,
    /// Not used, 0.
    pub reserved: u32,
    /// A name for its contents: while the program runs, the same id means the same scene.
    pub id: u64,
    /// What it is called in reports.
    pub name: *const c_char,
    /// The objects; null where there is none, as for the arrays below.
    pub objects: *const PolyptychObject,
    /// The materials.
    pub materials: *const PolyptychMaterial,
    /// The textures.
    pub textures: *const PolyptychTexture,
    /// The lights.
    pub lights: *const PolyptychLight,
    /// Background, ambient light and fog.
    pub environment: *const PolyptychEnvironment,
}

/// What is wanted of a picture.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychNeed {
    /// Bytes of this struct.
    pub size: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channels that will be asked for.
    pub channels: u32,
    /// Samples a pixel for the color.
    pub samples: u32,
    /// Number of values.
    pub value_count: u32,
    /// How far an edge may be off, in pixels.
    pub tolerance_px: f64,
    /// From where.
    pub camera: *const PolyptychCamera,
    /// The value of each declared parameter, in the order of declaration; null where there is none.
    pub values: *const PolyptychValue,
}

/// The picture to be filled. Planes of channels that were not asked for are null; the others have `width * height`
/// pixels, rows from the top, without gaps.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychTarget {
    /// Bytes of this struct.
    pub size: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Channels that are there.
    pub channels: u32,
    /// Three numbers a pixel.
    pub color: *mut f32,
    /// One number a pixel.
    pub distance: *mut f32,
    /// Three numbers a pixel.
    pub normal: *mut f32,
    /// One number a pixel.
    pub id: *mut u32,
    /// Three numbers a pixel.
    pub albedo: *mut f32,
    /// One number a pixel.
    pub shadow: *mut f32,
    /// One number a pixel.
    pub coverage: *mut f32,
}

/// Work for `PolyptychHost::join`.
pub type PolyptychTask = Option<unsafe extern "C" fn(data: *mut c_void)>;
/// Work for `PolyptychHost::parallel_for`: the items from `begin` up to, but not including, `end`.
pub type PolyptychRange = Option<unsafe extern "C" fn(data: *mut c_void, begin: u64, end: u64)>;

/// What the host does for a plugin during a call of `plan`, `prepare` or `render`; not valid after it.
///
/// `join`, `parallel_for`, `rays`, `finished`, `log` and `cancel` may be used on any thread that the host lends;
/// the others on the thread of the call.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychHost {
    /// Bytes of this struct.
    pub size: u32,
    /// How many threads work at once.
    pub thread_count: u32,
    /// The host's own.
    pub context: *mut c_void,
    /// Becomes 1 when the host wants to stop: look at least every millisecond, then return `POLYPTYCH_CANCELLED`.
    pub cancel: *const u8,
    /// Runs both tasks, perhaps at the same time, and returns when both are done. The only source of threads: a
    /// plugin starts none. Pictures must not depend on which thread does what.
    pub join: Option<
        unsafe extern "C" fn(
            host: *const PolyptychHost,
            left: PolyptychTask,
            left_data: *mut c_void,
            right: PolyptychTask,
            right_data: *mut c_void,
        ),
    >,
    /// Runs `work` over `count` items in ranges of at most `grain`, and returns when all are done.
    pub parallel_for: Option<
        unsafe extern "C" fn(
            host: *const PolyptychHost,
            count: u64,
            grain: u64,
            work: PolyptychRange,
            data: *mut c_void,
        ),
    >,
    /// Writes the rays of the call's camera through the centers of `count` pixels of a row, beginning with column
    /// `first`, of a picture of that size. Any projection; a call costs as little as the rays do.
    pub rays: Option<
        unsafe extern "C" fn(
            host: *const PolyptychHost,
            width: u32,
            height: u32,
            row: u32,
            first: u32,
            count: u32,
            rays: *mut PolyptychRay,
        ),
    >,
    /// Tells that rows of the target are finished and may be shown. They must not be written again.
    pub finished: Option<unsafe extern "C" fn(host: *const PolyptychHost, first_row: u32, rows: u32)>,
    /// Says how an object is (in `plan`: would be) drawn. In `prepare` and `plan` once for each object; in `render`
    /// only where it differs. `why` may be null for `POLYPTYCH_EXACT`.
    pub decide: Option<
        unsafe extern "C" fn(
            host: *const PolyptychHost,
            object: u32,
            decision: u32,
            bound: f64,
            why: *const c_char,
        ),
    >,
    /// In `plan`: says what would be built for an object, and its bytes.
    pub builds: Option<
        unsafe extern "C" fn(host: *const PolyptychHost, object: u32, what: *const c_char, bytes: u64),
    >,
    /// In `plan`: names a pass over the picture, whether (1) or not (0) it is needed, and why.
    pub pass: Option<
        unsafe extern "C" fn(
            host: *const PolyptychHost,
            name: *const c_char,
            needed: u32,
            why: *const c_char,
        ),
    >,
    /// In `plan`: estimates the time of a frame on one thread, milliseconds.
    pub estimate: Option<unsafe extern "C" fn(host: *const PolyptychHost, milliseconds: f64)>,
    /// Says how many bytes are held for the scene.
    pub bytes: Option<unsafe extern "C" fn(host: *const PolyptychHost, bytes: u64)>,
    /// In `render`: names a count, such as `rays`; up to six.
    pub count: Option<unsafe extern "C" fn(host: *const PolyptychHost, name: *const c_char, count: u64)>,
    /// In `render`: names a phase and its time; up to eight.
    pub phase:
        Option<unsafe extern "C" fn(host: *const PolyptychHost, name: *const c_char, nanoseconds: u64)>,
    /// Says why a call fails, before it returns a status that is not `POLYPTYCH_OK`; with an object's index, or
    /// `POLYPTYCH_NO_OBJECT`.
    pub refuse: Option<unsafe extern "C" fn(host: *const PolyptychHost, object: u32, why: *const c_char)>,
    /// Writes a line to the host's log, about an object or `POLYPTYCH_NO_OBJECT`.
    pub log: Option<
        unsafe extern "C" fn(host: *const PolyptychHost, severity: u32, object: u32, text: *const c_char),
    >,
}

/// The table that a plugin returns. Its first four words never change, in no version.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PolyptychPlugin {
    /// Bytes of this struct.
    pub size: u32,
    /// `POLYPTYCH_MAGIC`.
    pub magic: u32,
    /// `POLYPTYCH_MAJOR` of the header it was built with.
    pub major: u32,
    /// `POLYPTYCH_MINOR` of the header it was built with.
    pub minor: u32,
    /// Processor features without which it does not run.
    pub cpu: u64,
    /// What the back end says of itself.
    pub info: *const PolyptychInfo,
    /// Makes an instance; null where that fails.
    pub create: Option<unsafe extern "C" fn() -> *mut c_void>,
    /// Ends an instance.
    pub destroy: Option<unsafe extern "C" fn(instance: *mut c_void)>,
    /// Says what would be built for a need, with `decide`, `builds`, `pass` and `estimate`, and builds nothing. May be
    /// null.
    pub plan: Option<
        unsafe extern "C" fn(
            instance: *mut c_void,
            scene: *const PolyptychScene,
            need: *const PolyptychNeed,
            host: *const PolyptychHost,
        ) -> i32,
    >,
    /// Builds what a need asks of a scene and decides about every object. Copies what it keeps of the scene.
    pub prepare: Option<
        unsafe extern "C" fn(
            instance: *mut c_void,
            scene: *const PolyptychScene,
            need: *const PolyptychNeed,
            host: *const PolyptychHost,
        ) -> i32,
    >,
    /// Draws what was prepared. The camera may differ from the one that was needed, the size may too.
    pub render: Option<
        unsafe extern "C" fn(
            instance: *mut c_void,
            camera: *const PolyptychCamera,
            target: *const PolyptychTarget,
            host: *const PolyptychHost,
        ) -> i32,
    >,
}

/// The type of the one function that a plugin exports, under the name `polyptych_plugin`. It is told the host's version.
pub type PolyptychEntry =
    Option<unsafe extern "C" fn(host_major: u32, host_minor: u32) -> *const PolyptychPlugin>;
/// Name of the function that a plugin exports.
pub const ENTRY: &str = "polyptych_plugin";

mod read;

pub use read::{SizeFirst, element, read};
