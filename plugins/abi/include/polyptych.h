/* What crosses the border between Polyptych and a back end in a library.
 *
 * Made from plugins/abi/src/lib.rs: change that. A plugin in C needs this file and a C99 compiler.
 *
 * - A library exports one function, polyptych_plugin, which returns a table that lives for ever.
 * - Every struct begins with its size in bytes, as its maker knew it. Fields are only ever appended, in a new minor
 *   version; read a field only if the size covers it. In an array, step by the size of its first element: the
 *   functions at the end of this file do so. PolyptychValue, PolyptychRay, PolyptychChunk, PolyptychFormNode and
 *   PolyptychTransferPoint have no size: they stay as they are within a major version.
 * - Whoever makes something owns it. What the host passes is lent until the call returns; what a plugin passes to a
 *   host function is lent until that function returns. Nothing is freed by the other side.
 * - Text is UTF-8 and ends with a zero byte. A pointer may be null only where that is said.
 * - No call unwinds or throws across the border, in either direction.
 * - One instance is used by one thread at a time; different instances may be used at the same time.
 */


#pragma once

#include <stddef.h>
#include <stdint.h>

#if defined(_WIN32)
#define POLYPTYCH_EXPORT __declspec(dllexport)
#else
#define POLYPTYCH_EXPORT __attribute__((visibility("default")))
#endif


// First word of the table: the bytes `PLYP` in memory on a little-endian machine.
#define POLYPTYCH_MAGIC 1348029520

// Version of the interface that breaks with what was before.
#define POLYPTYCH_MAJOR 1

// Version of the interface that only adds.
//
// 1: materials have normal maps.
#define POLYPTYCH_MINOR 1

// Instead of an object's index: no object.
#define POLYPTYCH_NO_OBJECT 4294967295

// Kind of shape, and its bit in a set of kinds: a parametric body.
#define POLYPTYCH_PRIMITIVE 1

// Kind of shape: triangles.
#define POLYPTYCH_MESH 2

// Kind of shape: a grid of palette bytes.
#define POLYPTYCH_VOXELS 4

// Kind of shape: a solid where a function is positive.
#define POLYPTYCH_FREE_FORM 8

// Kind of shape: heights over a plane.
#define POLYPTYCH_HEIGHT_FIELD 16

// Kind of shape: a scalar field.
#define POLYPTYCH_VOLUME 32

// All kinds of shape of this version.
#define POLYPTYCH_ALL_SHAPES 63

// Bit of a channel: linear RGB.
#define POLYPTYCH_COLOR 1

// Bit of a channel: distance from the eye in meters, infinity = nothing.
#define POLYPTYCH_DISTANCE 2

// Bit of a channel: unit normal in world space on the viewer's side, zero = nothing.
#define POLYPTYCH_NORMAL 4

// Bit of a channel: index of the object plus one, 0 = nothing.
#define POLYPTYCH_ID 8

// Bit of a channel: base color with texture, unlit.
#define POLYPTYCH_ALBEDO 16

// Bit of a channel: share of the shadow-casting lights that reach the point; 1 where nothing is seen.
#define POLYPTYCH_SHADOW 32

// Bit of a channel: share of the pixel that objects cover.
#define POLYPTYCH_COVERAGE 64

// All channels of this version.
#define POLYPTYCH_ALL_CHANNELS 127

// Status: done.
#define POLYPTYCH_OK 0

// Status: stopped because the host asked for it; the target holds finished parts.
#define POLYPTYCH_CANCELLED 1

// Status: `render` was called before `prepare`.
#define POLYPTYCH_NOT_PREPARED 2

// Status: a required object cannot be drawn; say which and why with `PolyptychHost::refuse`.
#define POLYPTYCH_REQUIRED 3

// Status: failed; say why with `PolyptychHost::refuse`.
#define POLYPTYCH_FAILED 4

// Status: a bug in the plugin was caught inside the plugin; the instance is not used again.
#define POLYPTYCH_PANICKED 5

// Decision: drawn as given.
#define POLYPTYCH_EXACT 0

// Decision: drawn in another representation, at most `bound` meters off.
#define POLYPTYCH_CONVERTED 1

// Decision: something is left out or simplified.
#define POLYPTYCH_APPROXIMATED 2

// Decision: not drawn.
#define POLYPTYCH_SKIPPED 3

// Kind of parameter: on or off, in `PolyptychValue::integer`.
#define POLYPTYCH_BOOL 0

// Kind of parameter: a whole number, in `PolyptychValue::integer`.
#define POLYPTYCH_INT 1

// Kind of parameter: a number, in `PolyptychValue::number`.
#define POLYPTYCH_FLOAT 2

// Kind of parameter: one of several words, in `PolyptychValue::text`; its index in `PolyptychValue::integer`.
#define POLYPTYCH_CHOICE 3

// Kind of parameter: a color `#rrggbb`, in `PolyptychValue::text`.
#define POLYPTYCH_RGB 4

// Severity of a log line: of interest to the plugin's author.
#define POLYPTYCH_DEBUG 0

// Severity of a log line: of interest to the user.
#define POLYPTYCH_NOTE 1

// Severity of a log line: the picture is not what it should be.
#define POLYPTYCH_WARNING 2

// Severity of a log line: something failed.
#define POLYPTYCH_ERROR 3

// Bit of a processor feature that a plugin needs: AVX.
#define POLYPTYCH_CPU_AVX 1

// Bit of a processor feature: AVX2.
#define POLYPTYCH_CPU_AVX2 2

// Bit of a processor feature: fused multiply-add.
#define POLYPTYCH_CPU_FMA 4

// Bit of a processor feature: AVX-512 Foundation.
#define POLYPTYCH_CPU_AVX512F 8

// Projection: straight lines stay straight; `angles[0]` is the vertical field of view.
#define POLYPTYCH_PERSPECTIVE 0

// Projection: parallel rays; `angles[0]` is the height of the picture in meters.
#define POLYPTYCH_ORTHOGRAPHIC 1

// Projection: the distance from the middle is the angle to the axis; `angles[0]` is the angle across the circle.
#define POLYPTYCH_FISHEYE 2

// Projection: columns are angles around the up axis; `angles` are those across the width and the height.
#define POLYPTYCH_CYLINDRICAL 3

// Projection: directions from a table.
#define POLYPTYCH_WARP 4

// Kind of light: parallel.
#define POLYPTYCH_DIRECTIONAL 0

// Kind of light: from a point, falling with the square of the distance.
#define POLYPTYCH_POINT 1

// Kind of light: from a point, inside a cone.
#define POLYPTYCH_SPOT 2

// Lighting model: diffuse light only.
#define POLYPTYCH_LAMBERT 0

// Lighting model: highlight by the mirrored light direction.
#define POLYPTYCH_PHONG 1

// Lighting model: highlight by the half vector.
#define POLYPTYCH_BLINN_PHONG 2

// Meaning of a texture's alpha: none.
#define POLYPTYCH_ALPHA_OPAQUE 0

// Meaning of a texture's alpha: below `alpha_cutoff` is a hole.
#define POLYPTYCH_ALPHA_MASK 1

// Meaning of a texture's alpha: opacity.
#define POLYPTYCH_ALPHA_BLEND 2

// Outside of a texture: it repeats.
#define POLYPTYCH_WRAP_REPEAT 0

// Outside of a texture: it repeats, every other time mirrored.
#define POLYPTYCH_WRAP_MIRROR 1

// Outside of a texture: its border is drawn out.
#define POLYPTYCH_WRAP_CLAMP 2

// Primitive: a box; `numbers` are its edge lengths.
#define POLYPTYCH_BOX 0

// Primitive: a sphere; its radius.
#define POLYPTYCH_SPHERE 1

// Primitive: a cylinder along y; radius, height.
#define POLYPTYCH_CYLINDER 2

// Primitive: a cone along y, the apex at the top; radius, height.
#define POLYPTYCH_CONE 3

// Primitive: a ring around y; radius of the ring, radius of the tube.
#define POLYPTYCH_TORUS 4

// Primitive: a rectangle in the xz plane; width, depth.
#define POLYPTYCH_PLANE 5

// Primitive: a frustum of a regular pyramid; sides, lower radius, upper radius, height.
#define POLYPTYCH_FRUSTUM 6

// Form: ten coefficients of x2 y2 z2 xy xz yz x y z 1.
#define POLYPTYCH_FORM_QUADRIC 0

// Form: center, radii.
#define POLYPTYCH_FORM_ELLIPSOID 1

// Form: normal, offset.
#define POLYPTYCH_FORM_HALF_SPACE 2

// Form: center, axis, radius.
#define POLYPTYCH_FORM_CYLINDER 3

// Form: radius of the ring, radius of the tube.
#define POLYPTYCH_FORM_TORUS 4

// Form: its first child bent by the others, which are `POLYPTYCH_FORM_TERM`.
#define POLYPTYCH_FORM_PERTURBED 5

// Form: a perturbation by its child; weight, power (2 or 3).
#define POLYPTYCH_FORM_TERM 6

// Form: the maximum of its children.
#define POLYPTYCH_FORM_UNION 7

// Form: the minimum of its children.
#define POLYPTYCH_FORM_INTERSECTION 8

// Form: its first child without its second.
#define POLYPTYCH_FORM_DIFFERENCE 9

// Form: two children with a fillet; its width.
#define POLYPTYCH_FORM_SMOOTH_UNION 10

// Form: its child plus an amount.
#define POLYPTYCH_FORM_OFFSET 11

// Form: from its first child to its second; the share of the second.
#define POLYPTYCH_FORM_MORPH 12

// Numbers of a volume's samples: one byte.
#define POLYPTYCH_U8 0

// Numbers of a volume's samples: two bytes, with sign.
#define POLYPTYCH_I16 1

// Numbers of a volume's samples: two bytes, without sign.
#define POLYPTYCH_U16 2

// Numbers of a volume's samples: four bytes, floating point.
#define POLYPTYCH_F32 3

// The value of a parameter; which field counts follows from the parameter's kind.
typedef struct PolyptychValue {
  // Switch (0 or 1), whole number, or index of a choice.
  int64_t integer;
  // Number.
  double number;
  // Word or color; null for other kinds.
  const char *text;
} PolyptychValue;

// A parameter that users may set.
typedef struct PolyptychParameter {
  // Bytes of this struct.
  uint32_t size;
  // Kind of parameter.
  uint32_t kind;
  // Dotted name, unique within the plugin: `detail.samples`.
  const char *name;
  // Unit, empty for pure numbers.
  const char *unit;
  // One line of help.
  const char *help;
  // Meaning shared across back ends, or empty.
  const char *tag;
  // Value when nobody sets it.
  struct PolyptychValue initial;
  // Smallest whole number or number.
  struct PolyptychValue least;
  // Largest whole number or number.
  struct PolyptychValue most;
  // The words of a choice; null for other kinds.
  const char *const *choices;
  // Number of words.
  uint32_t choice_count;
  // 1 where it trades time for accuracy, else 0.
  uint32_t quality_axis;
} PolyptychParameter;

// What a back end says of itself. Owned by the plugin, for ever.
typedef struct PolyptychInfo {
  // Bytes of this struct.
  uint32_t size;
  // Shapes that are drawn as given, for tables and reports.
  uint32_t native_shapes;
  // Shapes that the plugin takes; the host converts all others into triangles, or else voxels, before.
  uint32_t accepted_shapes;
  // Channels that it can deliver.
  uint32_t channels;
  // 1 where colors are meant to be those of the lighting equation, 0 where the picture is stylized.
  uint32_t photometric;
  // Number of parameters.
  uint32_t parameter_count;
  // Short name on the command line: lower-case letters, digits, `-` and `_`.
  const char *id;
  // Name for people.
  const char *name;
  // Its version.
  const char *version;
  // Its parameters; null where there is none.
  const struct PolyptychParameter *parameters;
} PolyptychInfo;

// A parametric body around the origin; axes of revolution are the y axis.
typedef struct PolyptychPrimitive {
  // Bytes of this struct.
  uint32_t size;
  // Which body.
  uint32_t kind;
  // Its measures in meters; see the bodies.
  double numbers[4];
} PolyptychPrimitive;

// Triangles in object space.
typedef struct PolyptychMesh {
  // Bytes of this struct.
  uint32_t size;
  // Not used, 0.
  uint32_t reserved;
  // Number of vertices.
  uint64_t vertex_count;
  // Number of triangles.
  uint64_t triangle_count;
  // Number of free segments.
  uint64_t segment_count;
  // Three numbers for each vertex.
  const float *positions;
  // Three numbers for each vertex, or null.
  const float *normals;
  // Two numbers for each vertex, or null; v grows downward.
  const float *uvs;
  // Three numbers for each vertex in linear light, multiplied with the material's color, or null.
  const float *colors;
  // Three indices for each triangle, counter-clockwise seen from outside.
  const uint32_t *triangles;
  // Material slot of each triangle, or null where all have slot 0.
  const uint16_t *slots;
  // Two indices for each segment, or null.
  const uint32_t *segments;
} PolyptychMesh;

// 64 x 64 x 64 cells.
typedef struct PolyptychChunk {
  // One byte a cell, x fastest, then y, then z; null where all cells hold `uniform`.
  const uint8_t *cells;
  // The byte of all cells where `cells` is null.
  uint64_t uniform;
} PolyptychChunk;

// A grid of palette bytes: 0 is empty, byte v has the material of slot v - 1. Cell (x, y, z) fills
// [x, x+1] x [y, y+1] x [z, z+1] in object space.
typedef struct PolyptychVoxels {
  // Bytes of this struct.
  uint32_t size;
  // Cells along each axis.
  uint32_t cells[3];
  // Chunks, x fastest; along each axis `(cells + 63) / 64`.
  const struct PolyptychChunk *chunks;
} PolyptychVoxels;

// A node of a free form's function.
typedef struct PolyptychFormNode {
  // Which function.
  uint32_t kind;
  // How many of the following subtrees are its children.
  uint32_t children;
  // Its numbers; see the functions.
  double numbers[10];
} PolyptychFormNode;

// A solid where a function of position is not negative. The nodes are the function's tree, each before its children.
typedef struct PolyptychFreeForm {
  // Bytes of this struct.
  uint32_t size;
  // Number of nodes.
  uint32_t node_count;
  // The nodes.
  const struct PolyptychFormNode *nodes;
  // A box that holds the solid: smallest corner, largest corner.
  double bounds[6];
} PolyptychFreeForm;

// A surface y = h(x, z), bilinear between samples, over a rectangle around the origin.
typedef struct PolyptychHeightField {
  // Bytes of this struct.
  uint32_t size;
  // Samples along x.
  uint32_t columns;
  // Samples along z.
  uint32_t rows;
  // Not used, 0.
  uint32_t reserved;
  // Lengths of the rectangle along x and z.
  double extent[2];
  // Samples, row by row.
  const float *heights;
} PolyptychHeightField;

// A support point of a transfer function.
typedef struct PolyptychTransferPoint {
  // Field value.
  float value;
  // Linear color.
  float color[3];
  // Opacity of a layer as thick as the reference length.
  float opacity;
} PolyptychTransferPoint;

// A scalar field with a transfer function; samples lie at cell centers, the box is centered on the origin.
typedef struct PolyptychVolume {
  // Bytes of this struct.
  uint32_t size;
  // Samples along each axis.
  uint32_t samples[3];
  // Distance of neighboring samples along each axis.
  double spacing[3];
  // Numbers of the samples.
  uint32_t format;
  // Number of support points.
  uint32_t point_count;
  // Samples, x fastest, then y, then z.
  const void *data;
  // Support points by rising value.
  const struct PolyptychTransferPoint *points;
  // Length over which a support point's opacity is reached.
  double reference_length;
  // Only what lies inside of this is drawn; null = everything.
  const struct PolyptychFreeForm *shell;
} PolyptychVolume;

// The geometry of one or more objects. Exactly the pointer that belongs to `kind` is not null.
typedef struct PolyptychShape {
  // Bytes of this struct.
  uint32_t size;
  // Kind of shape.
  uint32_t kind;
  // A name for its contents: while the program runs, the same id means the same geometry.
  uint64_t id;
  // See the kinds.
  const struct PolyptychPrimitive *primitive;
  // See the kinds.
  const struct PolyptychMesh *mesh;
  // See the kinds.
  const struct PolyptychVoxels *voxels;
  // See the kinds.
  const struct PolyptychFreeForm *free_form;
  // See the kinds.
  const struct PolyptychHeightField *height_field;
  // See the kinds.
  const struct PolyptychVolume *volume;
} PolyptychShape;

// One thing in the scene.
typedef struct PolyptychObject {
  // Bytes of this struct.
  uint32_t size;
  // 1 where it is to be drawn and decided about; 0 where it is invisible, or the host has skipped it already.
  uint32_t visible;
  // 1 where the scene is to be refused if it cannot be drawn.
  uint32_t required;
  // Number of material slots.
  uint32_t material_count;
  // Its name in reports.
  const char *name;
  // Its geometry; null where the host has skipped it, and in `plan` where the host would convert it.
  const struct PolyptychShape *shape;
  // Index of a material for each slot; a slot beyond has the first.
  const uint32_t *materials;
  // Four columns: where the x, y and z axes go, and where the origin goes.
  double world_from_object[12];
} PolyptychObject;

// What a surface is made of.
typedef struct PolyptychMaterial {
  // Bytes of this struct.
  uint32_t size;
  // Index of a texture plus one; 0 = none.
  uint32_t texture;
  // Its name in reports.
  const char *name;
  // Diffuse color in linear light, multiplied with the texture.
  float base_color[3];
  // Share of ambient light that is returned.
  float ambient;
  // Share of light that is scattered evenly.
  float diffuse;
  // Share of light that is mirrored as a highlight.
  float specular;
  // Exponent of the highlight.
  float shininess;
  // Light that it gives off.
  float emission[3];
  // 1 hides what lies behind, 0 is clear.
  float opacity;
  // Share of the color that comes from the mirror direction.
  float reflectivity;
  // Repeats of the texture in a meter, projected along three axes; 0 = by texture coordinates.
  float triplanar_scale;
  // 1 where the texture is projected along three axes.
  uint32_t triplanar;
  // What the texture's alpha means.
  uint32_t alpha;
  // Where holes begin.
  float alpha_cutoff;
  // Since 1.1: index of a texture plus one, of which red, green and blue from 0 to 1 are normals from -1 to 1: to the
  // right of the picture, up in it, outward; 0 = none.
  uint32_t normal_map;
  // Since 1.1: factor on red and green of those.
  float normal_scale;
} PolyptychMaterial;

// A picture on surfaces.
typedef struct PolyptychTexture {
  // Bytes of this struct.
  uint32_t size;
  // Columns.
  uint32_t width;
  // Rows.
  uint32_t height;
  // What lies outside along u.
  uint32_t wrap_u;
  // What lies outside along v.
  uint32_t wrap_v;
  // Not used, 0.
  uint32_t reserved;
  // A name for its contents: the same id means the same picture.
  uint64_t id;
  // Its name in reports.
  const char *name;
  // Red, green, blue and alpha in linear light, 65535 = 1; rows from the top.
  const uint16_t *texels;
} PolyptychTexture;

// A light source without extent.
typedef struct PolyptychLight {
  // Bytes of this struct.
  uint32_t size;
  // Kind of light.
  uint32_t kind;
  // Where it is; not for parallel light.
  double position[3];
  // Where it goes; not for point lights.
  double direction[3];
  // Half angle of full light of a cone, radians.
  double inner;
  // Half angle of no light of a cone, radians.
  double outer;
  // Linear color.
  float color[3];
  // Factor of the color.
  float intensity;
  // 1 where opaque things block it.
  uint32_t casts_shadow;
  // Not used, 0.
  uint32_t reserved;
} PolyptychLight;

// What surrounds the objects.
typedef struct PolyptychEnvironment {
  // Bytes of this struct.
  uint32_t size;
  // Lighting model.
  uint32_t lighting;
  // Color straight down; one color has all three the same.
  float below[3];
  // Color at eye level. Between, colors mix by the y component of the direction.
  float horizon[3];
  // Color straight up.
  float above[3];
  // 1 where the background is one color for all directions.
  uint32_t solid;
  // Light that comes from everywhere.
  float ambient[3];
  // 1 where there is fog.
  uint32_t fog;
  // Color of fog.
  float fog_color[3];
  // Extinction of fog for each meter.
  float fog_density;
} PolyptychEnvironment;

// Everything that is to be drawn. Lent until the call returns: a plugin copies what it keeps.
typedef struct PolyptychScene {
  // Bytes of this struct.
  uint32_t size;
  // Number of objects.
  uint32_t object_count;
  // Number of materials.
  uint32_t material_count;
  // Number of textures.
  uint32_t texture_count;
  // Number of lights.
  uint32_t light_count;
  // Not used, 0.
  uint32_t reserved;
  // A name for its contents: while the program runs, the same id means the same scene.
  uint64_t id;
  // What it is called in reports.
  const char *name;
  // The objects; null where there is none, as for the arrays below.
  const struct PolyptychObject *objects;
  // The materials.
  const struct PolyptychMaterial *materials;
  // The textures.
  const struct PolyptychTexture *textures;
  // The lights.
  const struct PolyptychLight *lights;
  // Background, ambient light and fog.
  const struct PolyptychEnvironment *environment;
} PolyptychScene;

// From where a picture is seen.
typedef struct PolyptychCamera {
  // Bytes of this struct.
  uint32_t size;
  // Kind of projection.
  uint32_t projection;
  // Where the eye is; for parallel rays the middle of the picture plane.
  double eye[3];
  // Three columns: right, up, backward.
  double world_from_camera[9];
  // Angles in radians or a height in meters; see the projections.
  double angles[2];
  // Columns of the table of a warp projection.
  uint32_t warp_columns;
  // Rows of that table.
  uint32_t warp_rows;
  // Directions in camera space, three numbers each; null for other projections.
  const double *warp_directions;
} PolyptychCamera;

// What is wanted of a picture.
typedef struct PolyptychNeed {
  // Bytes of this struct.
  uint32_t size;
  // Columns.
  uint32_t width;
  // Rows.
  uint32_t height;
  // Channels that will be asked for.
  uint32_t channels;
  // Samples a pixel for the color.
  uint32_t samples;
  // Number of values.
  uint32_t value_count;
  // How far an edge may be off, in pixels.
  double tolerance_px;
  // From where.
  const struct PolyptychCamera *camera;
  // The value of each declared parameter, in the order of declaration; null where there is none.
  const struct PolyptychValue *values;
} PolyptychNeed;

// Work for `PolyptychHost::join`.
typedef void (*PolyptychTask)(void *data);

// Work for `PolyptychHost::parallel_for`: the items from `begin` up to, but not including, `end`.
typedef void (*PolyptychRange)(void *data, uint64_t begin, uint64_t end);

// A ray through a pixel. Its direction has length 1, or 0 where the projection sees nothing.
typedef struct PolyptychRay {
  // Where it begins.
  double origin[3];
  // Where it goes.
  double direction[3];
} PolyptychRay;

// What the host does for a plugin during a call of `plan`, `prepare` or `render`; not valid after it.
//
// `join`, `parallel_for`, `rays`, `finished`, `log` and `cancel` may be used on any thread that the host lends;
// the others on the thread of the call.
typedef struct PolyptychHost {
  // Bytes of this struct.
  uint32_t size;
  // How many threads work at once.
  uint32_t thread_count;
  // The host's own.
  void *context;
  // Becomes 1 when the host wants to stop: look at least every millisecond, then return `POLYPTYCH_CANCELLED`.
  const uint8_t *cancel;
  // Runs both tasks, perhaps at the same time, and returns when both are done. The only source of threads: a
  // plugin starts none. Pictures must not depend on which thread does what.
  void (*join)(const struct PolyptychHost *host,
               PolyptychTask left,
               void *left_data,
               PolyptychTask right,
               void *right_data);
  // Runs `work` over `count` items in ranges of at most `grain`, and returns when all are done.
  void (*parallel_for)(const struct PolyptychHost *host,
                       uint64_t count,
                       uint64_t grain,
                       PolyptychRange work,
                       void *data);
  // Writes the rays of the call's camera through the centers of `count` pixels of a row, beginning with column
  // `first`, of a picture of that size. Any projection; a call costs as little as the rays do.
  void (*rays)(const struct PolyptychHost *host,
               uint32_t width,
               uint32_t height,
               uint32_t row,
               uint32_t first,
               uint32_t count,
               struct PolyptychRay *rays);
  // Tells that rows of the target are finished and may be shown. They must not be written again.
  void (*finished)(const struct PolyptychHost *host, uint32_t first_row, uint32_t rows);
  // Says how an object is (in `plan`: would be) drawn. In `prepare` and `plan` once for each object; in `render`
  // only where it differs. `why` may be null for `POLYPTYCH_EXACT`.
  void (*decide)(const struct PolyptychHost *host,
                 uint32_t object,
                 uint32_t decision,
                 double bound,
                 const char *why);
  // In `plan`: says what would be built for an object, and its bytes.
  void (*builds)(const struct PolyptychHost *host, uint32_t object, const char *what, uint64_t bytes);
  // In `plan`: names a pass over the picture, whether (1) or not (0) it is needed, and why.
  void (*pass)(const struct PolyptychHost *host, const char *name, uint32_t needed, const char *why);
  // In `plan`: estimates the time of a frame on one thread, milliseconds.
  void (*estimate)(const struct PolyptychHost *host, double milliseconds);
  // Says how many bytes are held for the scene.
  void (*bytes)(const struct PolyptychHost *host, uint64_t bytes);
  // In `render`: names a count, such as `rays`; up to six.
  void (*count)(const struct PolyptychHost *host, const char *name, uint64_t count);
  // In `render`: names a phase and its time; up to eight.
  void (*phase)(const struct PolyptychHost *host, const char *name, uint64_t nanoseconds);
  // Says why a call fails, before it returns a status that is not `POLYPTYCH_OK`; with an object's index, or
  // `POLYPTYCH_NO_OBJECT`.
  void (*refuse)(const struct PolyptychHost *host, uint32_t object, const char *why);
  // Writes a line to the host's log, about an object or `POLYPTYCH_NO_OBJECT`.
  void (*log)(const struct PolyptychHost *host, uint32_t severity, uint32_t object, const char *text);
} PolyptychHost;

// The picture to be filled. Planes of channels that were not asked for are null; the others have `width * height`
// pixels, rows from the top, without gaps.
typedef struct PolyptychTarget {
  // Bytes of this struct.
  uint32_t size;
  // Columns.
  uint32_t width;
  // Rows.
  uint32_t height;
  // Channels that are there.
  uint32_t channels;
  // Three numbers a pixel.
  float *color;
  // One number a pixel.
  float *distance;
  // Three numbers a pixel.
  float *normal;
  // One number a pixel.
  uint32_t *id;
  // Three numbers a pixel.
  float *albedo;
  // One number a pixel.
  float *shadow;
  // One number a pixel.
  float *coverage;
} PolyptychTarget;

// The table that a plugin returns. Its first four words never change, in no version.
typedef struct PolyptychPlugin {
  // Bytes of this struct.
  uint32_t size;
  // `POLYPTYCH_MAGIC`.
  uint32_t magic;
  // `POLYPTYCH_MAJOR` of the header it was built with.
  uint32_t major;
  // `POLYPTYCH_MINOR` of the header it was built with.
  uint32_t minor;
  // Processor features without which it does not run.
  uint64_t cpu;
  // What the back end says of itself.
  const struct PolyptychInfo *info;
  // Makes an instance; null where that fails.
  void *(*create)(void);
  // Ends an instance.
  void (*destroy)(void *instance);
  // Says what would be built for a need, with `decide`, `builds`, `pass` and `estimate`, and builds nothing. May be
  // null.
  int32_t (*plan)(void *instance,
                  const struct PolyptychScene *scene,
                  const struct PolyptychNeed *need,
                  const struct PolyptychHost *host);
  // Builds what a need asks of a scene and decides about every object. Copies what it keeps of the scene.
  int32_t (*prepare)(void *instance,
                     const struct PolyptychScene *scene,
                     const struct PolyptychNeed *need,
                     const struct PolyptychHost *host);
  // Draws what was prepared. The camera may differ from the one that was needed, the size may too.
  int32_t (*render)(void *instance,
                    const struct PolyptychCamera *camera,
                    const struct PolyptychTarget *target,
                    const struct PolyptychHost *host);
} PolyptychPlugin;

#ifdef __cplusplus
extern "C" {
#endif

/* The one function that a plugin exports. It is told the host's version. */
POLYPTYCH_EXPORT const PolyptychPlugin *polyptych_plugin(uint32_t host_major, uint32_t host_minor);

#ifdef __cplusplus
}
#endif

/* Elements of the scene's arrays, whatever the size that the host's version gives them. */
static inline const PolyptychObject *polyptych_object(const PolyptychScene *scene, uint32_t i) {
  return (const PolyptychObject *)((const char *)scene->objects + (size_t)scene->objects->size * i);
}
static inline const PolyptychMaterial *polyptych_material(const PolyptychScene *scene, uint32_t i) {
  return (const PolyptychMaterial *)((const char *)scene->materials + (size_t)scene->materials->size * i);
}
static inline const PolyptychTexture *polyptych_texture(const PolyptychScene *scene, uint32_t i) {
  return (const PolyptychTexture *)((const char *)scene->textures + (size_t)scene->textures->size * i);
}
static inline const PolyptychLight *polyptych_light(const PolyptychScene *scene, uint32_t i) {
  return (const PolyptychLight *)((const char *)scene->lights + (size_t)scene->lights->size * i);
}
