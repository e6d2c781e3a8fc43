/* A back end for Polyptych in C: draws every triangle flat, in the light of the scene's lamps, without shadows.
 *
 *   cc -O2 -shared -fPIC -I ../../abi/include facets.c -o libfacets.so -lm
 *
 * It takes triangles only: the host converts spheres, voxels, free forms, terrain and volumes before. Rays come from
 * the host, so that every projection works; a tree of boxes over the triangles finds what a ray meets first.
 */
#include "polyptych.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct { double corner[3], edge[2][3], center[3]; uint32_t object, material, order; } Triangle;
typedef struct { double low[3], high[3]; uint32_t next, count; } Node;
typedef struct {
  Triangle *triangles; Node *nodes; PolyptychMaterial *materials; PolyptychLight *lights;
  PolyptychEnvironment environment;
  uint32_t triangle_count, node_count, light_count, ready;
} Facets;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void cross(const double *a, const double *b, double *c) {
  for (int i = 0; i < 3; i++) c[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}
static void sub(const double *a, const double *b, double *c) { for (int i = 0; i < 3; i++) c[i] = a[i] - b[i]; }
static double normalize(double *v) {
  double length = sqrt(dot(v, v));
  for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
  return length;
}
/* One order for each axis: `qsort` cannot be told which, and instances may work at the same time. */
static int order(const Triangle *s, const Triangle *t, int axis) {
  double d = s->center[axis] - t->center[axis];
  return d < 0 ? -1 : d > 0 ? 1 : s->order < t->order ? -1 : 1;
}
static int by_x(const void *a, const void *b) { return order(a, b, 0); }
static int by_y(const void *a, const void *b) { return order(a, b, 1); }
static int by_z(const void *a, const void *b) { return order(a, b, 2); }

/* Builds the tree over triangles [first, first + count): halves along the longest axis, leaves of up to four. */
static void build(Facets *f, uint32_t first, uint32_t count) {
  Node *node = &f->nodes[f->node_count++];
  for (int a = 0; a < 3; a++) { node->low[a] = INFINITY; node->high[a] = -INFINITY; }
  for (uint32_t i = first; i < first + count; i++)
    for (int c = 0; c < 3; c++)
      for (int a = 0; a < 3; a++) {
        double p = f->triangles[i].corner[a] + (c ? f->triangles[i].edge[c - 1][a] : 0);
        node->low[a] = fmin(node->low[a], p);
        node->high[a] = fmax(node->high[a], p);
      }
  node->next = first;
  node->count = count;
  if (count <= 4) return;
  int (*orders[3])(const void *, const void *) = {by_x, by_y, by_z};
  int longest = 0;
  for (int a = 1; a < 3; a++)
    if (node->high[a] - node->low[a] > node->high[longest] - node->low[longest]) longest = a;
  qsort(f->triangles + first, count, sizeof(Triangle), orders[longest]);
  build(f, first, count / 2);
  node->next = f->node_count;
  node->count = 0;
  build(f, first + count / 2, count - count / 2);
}

/* Finds the nearest triangle along a ray (Moeller, Trumbore 1997). */
static const Triangle *nearest(const Facets *f, const PolyptychRay *ray, double *distance) {
  const Triangle *best = NULL;
  uint32_t stack[64], depth = 0;
  *distance = INFINITY;
  if (f->triangle_count) stack[depth++] = 0;
  while (depth) {
    const Node *node = &f->nodes[stack[--depth]];
    double near = 0, far = *distance;
    for (int a = 0; a < 3; a++) {
      double s = (node->low[a] - ray->origin[a]) / ray->direction[a];
      double t = (node->high[a] - ray->origin[a]) / ray->direction[a];
      near = fmax(near, fmin(s, t)); /* 0 / 0 is not a number, which fmin and fmax pass over */
      far = fmin(far, fmax(s, t));
    }
    if (near > far * (1 + 1e-12)) continue;
    if (node->count == 0) {
      stack[depth++] = node->next;
      stack[depth++] = (uint32_t)(node - f->nodes) + 1;
    }
    for (uint32_t i = node->next; i < node->next + node->count; i++) {
      const Triangle *t = &f->triangles[i];
      double p[3], q[3], s[3];
      cross(ray->direction, t->edge[1], p);
      double determinant = dot(t->edge[0], p);
      sub(ray->origin, t->corner, s);
      cross(s, t->edge[0], q);
      double u = dot(s, p) / determinant, v = dot(ray->direction, q) / determinant;
      double d = dot(t->edge[1], q) / determinant;
      if (u >= 0 && v >= 0 && u + v <= 1 && d >= 0 && d < *distance) { *distance = d; best = t; }
    }
  }
  return best;
}

/* Says how each object is drawn; `plan` and `prepare` say the same. */
static void decide(const PolyptychScene *scene, const PolyptychHost *host) {
  for (uint32_t i = 0; i < scene->object_count; i++) {
    const PolyptychObject *object = polyptych_object(scene, i);
    const char *lost = NULL;
    for (uint32_t s = 0; s < object->material_count && object->materials[s] < scene->material_count; s++) {
      const PolyptychMaterial *m = polyptych_material(scene, object->materials[s]);
      if (m->texture) lost = "drawn without its texture";
      if (m->opacity < 1) lost = "drawn opaque";
    }
    if (!object->visible) host->decide(host, i, POLYPTYCH_SKIPPED, 0, "it is invisible");
    else host->decide(host, i, lost ? POLYPTYCH_APPROXIMATED : POLYPTYCH_EXACT, 0, lost);
  }
}
static int32_t plan(void *self, const PolyptychScene *scene, const PolyptychNeed *need, const PolyptychHost *host) {
  (void)self;
  decide(scene, host);
  host->estimate(host, need->width * (double)need->height * 1e-3);
  return POLYPTYCH_OK;
}

static void clear(Facets *f) {
  free(f->triangles); free(f->nodes); free(f->materials); free(f->lights);
  memset(f, 0, sizeof *f);
}

static void add(Facets *f, const PolyptychScene *scene, uint32_t index) {
  const PolyptychObject *o = polyptych_object(scene, index);
  const PolyptychMesh *mesh = o->visible && o->shape ? o->shape->mesh : NULL;
  for (uint64_t i = 0; mesh && i < mesh->triangle_count; i++) {
    Triangle *t = &f->triangles[f->triangle_count];
    double corner[3][3];
    for (int c = 0; c < 3; c++)
      for (int a = 0; a < 3; a++) {
        const float *p = mesh->positions + 3 * (size_t)mesh->triangles[3 * i + c];
        const double *m = o->world_from_object;
        corner[c][a] = m[a] * p[0] + m[3 + a] * p[1] + m[6 + a] * p[2] + m[9 + a];
      }
    memcpy(t->corner, corner[0], sizeof t->corner);
    sub(corner[1], corner[0], t->edge[0]);
    sub(corner[2], corner[0], t->edge[1]);
    for (int a = 0; a < 3; a++) t->center[a] = (corner[0][a] + corner[1][a] + corner[2][a]) / 3;
    uint32_t slot = mesh->slots ? mesh->slots[i] : 0;
    t->object = index;
    t->order = f->triangle_count;
    t->material = o->material_count == 0 ? 0 : o->materials[slot < o->material_count ? slot : 0];
    if (t->material > scene->material_count) t->material = scene->material_count; /* the gray one after the last */
    if (isfinite(dot(t->center, t->center))) f->triangle_count++;
  }
}

static int32_t prepare(void *self, const PolyptychScene *scene, const PolyptychNeed *need, const PolyptychHost *host) {
  Facets *f = self;
  uint64_t count = 0;
  (void)need;
  clear(f);
  for (uint32_t i = 0; i < scene->object_count; i++) {
    const PolyptychObject *o = polyptych_object(scene, i);
    if (o->shape && o->shape->mesh) count += o->shape->mesh->triangle_count;
  }
  f->triangles = malloc((count + 1) * sizeof *f->triangles);
  f->nodes = malloc((2 * count + 1) * sizeof *f->nodes);
  f->materials = calloc(scene->material_count + 1, sizeof *f->materials);
  f->lights = malloc((scene->light_count + 1) * sizeof *f->lights);
  if (!f->triangles || !f->nodes || !f->materials || !f->lights || count > UINT32_MAX / 2) {
    host->refuse(host, POLYPTYCH_NO_OBJECT, "there is not enough memory for the triangles");
    return POLYPTYCH_FAILED;
  }
  for (uint32_t i = 0; i < scene->material_count; i++) f->materials[i] = *polyptych_material(scene, i);
  f->materials[scene->material_count] = (PolyptychMaterial){.base_color = {0.75f, 0.72f, 0.68f}, .ambient = 1, .diffuse = 0.85f};
  for (uint32_t i = 0; i < scene->light_count; i++) f->lights[f->light_count++] = *polyptych_light(scene, i);
  f->environment = *scene->environment;
  for (uint32_t i = 0; i < scene->object_count && !*host->cancel; i++) add(f, scene, i);
  if (*host->cancel) return POLYPTYCH_CANCELLED;
  if (f->triangle_count) build(f, 0, f->triangle_count);
  decide(scene, host);
  host->bytes(host, count * sizeof *f->triangles + 2 * count * sizeof *f->nodes);
  f->ready = 1;
  return POLYPTYCH_OK;
}

/* The light that a facet sends back: emission, ambient, and what each lamp adds (Lambert). */
static void shade(const Facets *f, const PolyptychMaterial *m, const double *point, const double *normal, float *out) {
  for (int c = 0; c < 3; c++) out[c] = m->emission[c] + f->environment.ambient[c] * m->ambient * m->base_color[c];
  for (uint32_t i = 0; i < f->light_count; i++) {
    const PolyptychLight *light = &f->lights[i];
    double to_light[3], direction[3], share = light->intensity, cosine;
    memcpy(direction, light->direction, sizeof direction);
    normalize(direction);
    for (int a = 0; a < 3; a++) to_light[a] = -direction[a];
    if (light->kind != POLYPTYCH_DIRECTIONAL) {
      sub(light->position, point, to_light);
      double distance = normalize(to_light);
      share /= distance * distance;
    }
    if (light->kind == POLYPTYCH_SPOT) {
      double full = cos(light->inner), none = cos(light->outer), at = -dot(direction, to_light);
      double s = at >= full ? 1 : at <= none ? 0 : (at - none) / (full - none);
      share *= s * s * (3 - 2 * s);
    }
    cosine = dot(normal, to_light);
    for (int c = 0; c < 3 && cosine > 0 && isfinite(share); c++)
      out[c] += (float)(m->base_color[c] * m->diffuse * light->color[c] * cosine * share);
  }
}

typedef struct { const Facets *f; const PolyptychTarget *target; const PolyptychHost *host; } Frame;

static void draw_pixel(const Frame *frame, const PolyptychRay *ray, size_t i) {
  const Facets *f = frame->f;
  const PolyptychTarget *out = frame->target;
  double distance, normal[3] = {0, 0, 0}, point[3];
  const Triangle *t = dot(ray->direction, ray->direction) > 0 ? nearest(f, ray, &distance) : NULL;
  const PolyptychMaterial *m = t ? &f->materials[t->material] : NULL;
  float color[3] = {0, 0, 0}, height = (float)ray->direction[1];
  if (t) {
    cross(t->edge[0], t->edge[1], normal);
    normalize(normal);
    double side = dot(normal, ray->direction) > 0 ? -1 : 1;
    for (int a = 0; a < 3; a++) { normal[a] *= side; point[a] = ray->origin[a] + distance * ray->direction[a]; }
    if (out->color) shade(f, m, point, normal, color);
    float fog = f->environment.fog ? expf(-f->environment.fog_density * (float)distance) : 1;
    for (int c = 0; c < 3; c++) color[c] = f->environment.fog_color[c] + (color[c] - f->environment.fog_color[c]) * fog;
  } else if (dot(ray->direction, ray->direction) > 0) {
    const float *end = height >= 0 ? f->environment.above : f->environment.below, *mid = f->environment.horizon;
    for (int c = 0; c < 3; c++) color[c] = mid[c] + (end[c] - mid[c]) * fabsf(height);
  }
  for (int c = 0; c < 3; c++) {
    if (out->color) out->color[3 * i + c] = color[c];
    if (out->normal) out->normal[3 * i + c] = (float)normal[c];
    if (out->albedo) out->albedo[3 * i + c] = m ? m->base_color[c] : 0;
  }
  if (out->distance) out->distance[i] = t ? (float)distance : INFINITY;
  if (out->id) out->id[i] = t ? t->object + 1 : 0;
  if (out->shadow) out->shadow[i] = 1;
  if (out->coverage) out->coverage[i] = t ? 1 : 0;
}

static void draw_rows(void *data, uint64_t begin, uint64_t end) {
  const Frame *frame = data;
  PolyptychRay rays[64];
  for (uint32_t row = (uint32_t)begin; row < end; row++) {
    for (uint32_t first = 0; first < frame->target->width; first += 64) {
      uint32_t rest = frame->target->width - first, count = rest < 64 ? rest : 64;
      if (*frame->host->cancel) return;
      frame->host->rays(frame->host, frame->target->width, frame->target->height, row, first, count, rays);
      for (uint32_t x = 0; x < count; x++)
        draw_pixel(frame, &rays[x], (size_t)row * frame->target->width + first + x);
    }
  }
  frame->host->finished(frame->host, (uint32_t)begin, (uint32_t)(end - begin));
}

static int32_t render(void *self, const PolyptychCamera *camera, const PolyptychTarget *target, const PolyptychHost *host) {
  Frame frame = {self, target, host};
  (void)camera;
  if (!frame.f->ready) return POLYPTYCH_NOT_PREPARED;
  host->parallel_for(host, target->height, 4, draw_rows, &frame);
  return *host->cancel ? POLYPTYCH_CANCELLED : POLYPTYCH_OK;
}

static void *create(void) { return calloc(1, sizeof(Facets)); }
static void destroy(void *self) { clear(self); free(self); }

const PolyptychPlugin *polyptych_plugin(uint32_t host_major, uint32_t host_minor) {
  static const PolyptychInfo info = {
    .size = sizeof info, .native_shapes = POLYPTYCH_MESH, .accepted_shapes = POLYPTYCH_MESH,
    .channels = POLYPTYCH_ALL_CHANNELS & ~POLYPTYCH_SHADOW,
    .id = "facets", .name = "Flat facets, in C", .version = "1.0.0",
  };
  static const PolyptychPlugin plugin = {
    .size = sizeof plugin, .magic = POLYPTYCH_MAGIC, .major = POLYPTYCH_MAJOR, .minor = POLYPTYCH_MINOR,
    .info = &info, .create = create, .destroy = destroy, .plan = plan, .prepare = prepare, .render = render,
  };
  (void)host_major;
  (void)host_minor;
  return &plugin;
}
