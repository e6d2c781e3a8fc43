//! What is built of a scene before it is drawn in a style: edges of its meshes, and meshes that carry their texture
//! coordinates in their colors?

use crate::edges::{Crossed, Edges};
use crate::hatch::Sticks;
use crate::look::Look;
use crate::outline::Body;
use crate::stroke::Kind;
use crate::style::Styles;
use glam::Vec3;
use polyptych_core::convert::{Converter, MeshModel};
use polyptych_core::scene::{AlphaMode, Material, Mesh, Object, Primitive, Scene, Shape};
use polyptych_core::seam::{Control, Decision, Need, RenderError, detail};
use std::collections::HashMap;
use std::sync::Arc;

/// Most cells along an edge of what is converted; polyhedra need none.
const FINEST: u32 = 256;

/// From what edges were found.
#[derive(Clone)]
enum Source {
    Given(Arc<Shape>),
    Converted(Arc<MeshModel>),
}

impl Source {
    fn mesh(&self) -> Option<&Mesh> {
        match self {
            Self::Converted(model) => Some(&model.mesh),
            Self::Given(shape) => match &**shape {
                Shape::Mesh(mesh) => Some(mesh),
                _ => None,
            },
        }
    }

    fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Given(a), Self::Given(b)) => Arc::ptr_eq(a, b),
            (Self::Converted(a), Self::Converted(b)) => Arc::ptr_eq(a, b),
            _ => false,
        }
    }
}

/// Edges of meshes, kept as long as these are drawn.
#[derive(Default)]
pub(crate) struct Outlines {
    kept: Vec<(Source, Arc<Edges>)>,
    /// The bodies that have their lines from their edges.
    pub(crate) bodies: Vec<Body>,
    /// The same, by object.
    pub(crate) outlined: Vec<bool>,
}

impl Outlines {
    /// Finds the edges of everything that the inner back end draws by its true faces.
    pub(crate) fn prepare(
        &mut self,
        scene: &Scene,
        decisions: &[Decision],
        styles: &Styles,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<(), RenderError> {
        let before = std::mem::take(&mut self.kept);
        let built = self.build(&before, scene, decisions, styles, need, converter, control);
        if built.is_err() {
            // The next try need not find again what was found.
            self.kept.extend(before);
        }
        built
    }

    #[expect(clippy::too_many_arguments, reason = "those of `prepare`, and what was found before")]
    fn build(
        &mut self,
        before: &[(Source, Arc<Edges>)],
        scene: &Scene,
        decisions: &[Decision],
        styles: &Styles,
        need: &Need,
        converter: &Converter,
        control: &Control<'_>,
    ) -> Result<(), RenderError> {
        self.bodies.clear();
        self.outlined.clear();
        self.outlined.resize(scene.objects.len(), false);
        if !styles.draw_lines() {
            return Ok(());
        }
        let crossings = styles.draw(Kind::Intersection);
        let mut found: HashMap<usize, usize> = HashMap::new();
        for (index, object) in scene.objects.iter().enumerate() {
            control.check()?;
            let is_drawn = decisions.get(index).is_some_and(keeps_faces) && object.is_drawable();
            let Some(source) = is_drawn.then(|| source(scene, object, need, converter, control)).flatten()
            else {
                continue;
            };
            let key = match &source {
                Source::Given(shape) => Arc::as_ptr(shape) as usize,
                Source::Converted(model) => Arc::as_ptr(model) as usize,
            };
            let at = if let Some(&at) = found.get(&key) {
                at
            } else {
                let serves = |edges: &Edges| !crossings || edges.crossed != Crossed::Unknown;
                let same = before.iter().find(|(old, edges)| old.is(&source) && serves(edges));
                let edges = match (same, source.mesh()) {
                    (Some((_, edges)), _) => edges.clone(),
                    (None, Some(mesh)) => Arc::new(Edges::new(mesh, crossings, control)?),
                    (None, None) => Arc::default(),
                };
                self.kept.push((source, edges));
                found.insert(key, self.kept.len() - 1);
                self.kept.len() - 1
            };
            let edges = self.kept[at].1.clone();
            self.outlined[index] = true;
            self.bodies.push(Body {
                object: index as u32,
                world_from_object: object.world_from_object,
                edges,
            });
        }
        // A body whose conversion was stopped looks like one that has no faces.
        Ok(control.check()?)
    }

    /// Lists the objects that cross themselves too often to find where.
    pub(crate) fn tangled(&self) -> impl Iterator<Item = usize> {
        let is_tangled = |body: &&Body| body.edges.crossed == Crossed::TooOften;
        self.bodies.iter().filter(is_tangled).map(|body| body.object as usize)
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.kept.iter().map(|(_, edges)| edges.bytes()).sum()
    }
}

/// Foretells the bytes of the edges of a scene's meshes; those of polyhedra are few.
pub(crate) fn outlines_forecast(scene: &Scene) -> u64 {
    let mut counted: Vec<*const Shape> = Vec::new();
    let bytes_of = |object: &Object| match &*object.shape {
        Shape::Mesh(mesh) if object.is_drawable() && !counted.contains(&Arc::as_ptr(&object.shape)) => {
            counted.push(Arc::as_ptr(&object.shape));
            Edges::forecast(mesh)
        }
        _ => 0,
    };
    scene.objects.iter().map(bytes_of).sum()
}

/// Tells whether what is drawn of an object has the faces that it was given.
fn keeps_faces(decision: &Decision) -> bool {
    match decision {
        Decision::Exact | Decision::Approximated { .. } => true,
        Decision::Converted { bound, .. } => *bound == 0.0,
        Decision::Skipped { .. } => false,
    }
}

/// Returns the faces of an object that has flat ones.
fn source(
    scene: &Scene,
    object: &Object,
    need: &Need,
    converter: &Converter,
    control: &Control<'_>,
) -> Option<Source> {
    match &*object.shape {
        Shape::Mesh(mesh) if !mesh.triangles.is_empty() => Some(Source::Given(object.shape.clone())),
        Shape::Primitive(
            Primitive::Sphere { .. }
            | Primitive::Cylinder { .. }
            | Primitive::Cone { .. }
            | Primitive::Torus { .. },
        ) => None,
        Shape::Primitive(_) => {
            let model = converter.mesh(scene, object, detail(object, need, FINEST), control).ok()?;
            (model.bound == 0.0).then_some(Source::Converted(model))
        }
        _ => None,
    }
}

/// Returns how each object takes paint.
pub(crate) fn looks(scene: &Scene, coded: &[bool]) -> Vec<Look> {
    let look = |(index, object): (usize, &Object)| {
        let material = scene.material(object, 0);
        let radius = object.shape.bounds().radius();
        Look {
            specular: material.specular,
            // A whole one is raised to in a few steps, and nobody sees the difference.
            shininess: material.shininess.round().clamp(1.0, 65536.0),
            faint: 0.002f32.powf(1.0 / material.shininess.max(1e-3)),
            is_coded: coded.get(index).copied().unwrap_or(false),
            period: if radius > 0.0 && radius.is_finite() { radius * 2.0 } else { 1.0 },
            ..Look::default()
        }
    };
    scene.objects.iter().enumerate().map(look).collect()
}

/// Tells which objects have lines between their colors: those of several materials without textures.
pub(crate) fn colorful(scene: &Scene, styles: &Styles) -> Vec<bool> {
    if !styles.draw(Kind::Material) {
        return Vec::new();
    }
    let is_plain = |object: &Object| {
        let slots = || (0..object.materials.len()).map(|slot| scene.material(object, slot));
        object.materials.len() > 1 && slots().all(|m| m.texture.is_none())
    };
    scene.objects.iter().map(is_plain).collect()
}

/// A scene whose meshes carry texture coordinates where others have colors, so that strokes can stick to them.
#[derive(Default)]
pub(crate) struct Coded {
    shapes: Vec<(Arc<Shape>, Arc<Shape>)>,
    scene: Option<(Arc<Scene>, Arc<Scene>)>,
    /// Which objects are so.
    pub(crate) objects: Vec<bool>,
}

impl Coded {
    /// Returns the scene that the inner back end is to draw.
    pub(crate) fn prepare(&mut self, scene: &Arc<Scene>, styles: &Styles, draws_meshes: bool) -> Arc<Scene> {
        let by_coordinates = |index: usize| {
            let style = &styles.all[usize::from(styles.index(index as u32 + 1))];
            style.hatching.as_ref().is_some_and(|h| h.sticks == Sticks::Uv)
        };
        let is_coded = |(index, object): (usize, &Object)| {
            let is_solid = (0..object.materials.len().max(1)).all(|slot| {
                let material = scene.material(object, slot);
                material.alpha == AlphaMode::Opaque
            });
            let has_coordinates =
                matches!(&*object.shape, Shape::Mesh(m) if !m.uvs.is_empty() && m.colors.is_empty());
            draws_meshes && by_coordinates(index) && is_solid && has_coordinates
        };
        let objects: Vec<bool> = scene.objects.iter().enumerate().map(is_coded).collect();
        if !objects.contains(&true) {
            *self = Self { objects, ..Self::default() };
            return scene.clone();
        }
        if let Some((given, coded)) = &self.scene
            && Arc::ptr_eq(given, scene)
            && objects == self.objects
        {
            return coded.clone();
        }
        let before = std::mem::take(&mut self.shapes);
        let mut coded = (**scene).clone();
        let first = coded.materials.len();
        for (index, _) in objects.iter().enumerate().filter(|(_, coded)| **coded) {
            let given = &scene.objects[index].shape;
            let known = before.iter().chain(&self.shapes).find(|(old, _)| Arc::ptr_eq(old, given));
            let shape = match (known, &**given) {
                (Some((_, shape)), _) => shape.clone(),
                (None, Shape::Mesh(mesh)) => Arc::new(Shape::Mesh(with_coordinates(mesh))),
                (None, _) => given.clone(),
            };
            self.shapes.push((given.clone(), shape.clone()));
            let slots = scene.objects[index].materials.len().max(1);
            let plain = |slot: usize| {
                let material = scene.material(&scene.objects[index], slot);
                Material { base_color: Vec3::ONE, texture: None, ..material.clone() }
            };
            let begin = coded.materials.len();
            coded.materials.extend((0..slots).map(plain));
            coded.objects[index].shape = shape;
            coded.objects[index].materials = (begin..begin + slots).collect();
        }
        debug_assert!(coded.materials.len() > first, "something is coded");
        let coded = Arc::new(coded);
        self.scene = Some((scene.clone(), coded.clone()));
        self.objects = objects;
        coded
    }
}

/// Puts texture coordinates and slots into the colors of a mesh. Corners that faces of several slots share are parted.
fn with_coordinates(mesh: &Mesh) -> Mesh {
    let mut coded = Mesh { slots: mesh.slots.clone(), ..Mesh::default() };
    let mut known: HashMap<(u32, usize), u32> = HashMap::new();
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let slot = mesh.slot(t);
        let corners = triangle.map(|corner| {
            *known.entry((corner, slot)).or_insert_with(|| {
                let i = corner as usize;
                coded.positions.push(mesh.positions[i]);
                coded.normals.extend(mesh.normals.get(i));
                let uv = mesh.uvs[i];
                let uv = if uv.is_finite() { uv } else { glam::Vec2::ZERO };
                coded.colors.push(uv.extend(slot as f32));
                coded.positions.len() as u32 - 1
            })
        });
        coded.triangles.push(corners);
    }
    coded
}
