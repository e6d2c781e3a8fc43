//! What is a line of a drawing?

/// Why there is a line. Where several cross in a pixel that is equally covered, the later one is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u8)]
pub enum Kind {
    /// An edge of a triangle, shown for study.
    Wire,
    /// Between materials of one body.
    Material,
    /// Along a fold.
    Crease,
    /// Where bodies cross.
    Intersection,
    /// Along an open edge of a sheet.
    Border,
    /// Where a body ends before what is behind it.
    Silhouette,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 6] =
        [Self::Wire, Self::Material, Self::Crease, Self::Intersection, Self::Border, Self::Silhouette];

    /// Returns the names of its parameters: switch, color, width.
    pub(crate) fn parameters(self) -> [&'static str; 3] {
        match self {
            Self::Wire => ["wireframe", "wireframe.color", ""],
            Self::Material => ["material", "material.color", "material.width"],
            Self::Crease => ["crease", "crease.color", "crease.width"],
            Self::Intersection => ["intersection", "intersection.color", "intersection.width"],
            Self::Border => ["border", "border.color", "border.width"],
            Self::Silhouette => ["silhouette", "silhouette.color", "silhouette.width"],
        }
    }
}

/// A straight piece of a line on the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stroke {
    /// Where it begins, pixels from the picture's top left corner.
    pub from: [f32; 2],
    /// Where it ends.
    pub to: [f32; 2],
    /// Why it is there.
    pub kind: Kind,
    /// Which style it is drawn in: 0 for that of all objects without one of their own.
    pub style: u8,
    /// Whether surfaces hide it.
    pub is_hidden: bool,
    /// The object whose line it is, by its index in the scene.
    pub object: u32,
}

/// How lines of one kind look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pen {
    pub(crate) is_drawn: bool,
    /// Pixels.
    pub(crate) width: f32,
    /// Linear.
    pub(crate) color: glam::Vec3,
}
