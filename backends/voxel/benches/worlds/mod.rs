//! Which worlds are walked where speed and exactness are measured? Hills, caves, and specks that are worst for
//! whatever skips what is empty: as large as asked, the same on every machine.

use glam::DVec3;
use polyptych_core::scene::Voxels;

/// What fills a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Ground of five octaves of noise under an open sky.
    Terrain,
    /// Rock with hollows that are linked.
    Caves,
    /// One cell in a thousand.
    Specks,
}

impl Kind {
    /// All of them.
    pub(crate) const ALL: [Self; 3] = [Self::Terrain, Self::Caves, Self::Specks];

    /// Fills a grid; noise is as wide as in the largest, 1024 cells long.
    #[must_use]
    pub(crate) fn build(self, size: [u32; 3]) -> Voxels {
        let [nx, ny, nz] = size;
        let (wide, high) = (180.0 * nx as f32 / 1024.0, 200.0 * ny as f32 / 256.0);
        let heights: Vec<u32> = if self == Self::Terrain {
            (0..nx * nz)
                .map(|i| (hills((i % nx) as f32 / wide, (i / nx) as f32 / wide) * high) as u32)
                .collect()
        } else {
            Vec::new()
        };
        Voxels::from_fn(size, |x, y, z| {
            u8::from(match self {
                Self::Terrain => y < heights[(z * nx + x) as usize],
                Self::Caves => {
                    let at = [x, y, z].map(|c| c as f32);
                    noise(at.map(|c| c / 30.0)) * 0.7 + noise(at.map(|c| c / 9.0)) * 0.3 > 0.55
                }
                Self::Specks => hash([x, y, z].map(|c| c as i32)) < 0.001,
            })
        })
    }

    /// From where it is seen, and to where: places in a grid of 1024x256x1024 cells, moved with the size of the one
    /// at hand.
    #[must_use]
    pub(crate) fn view(self, voxels: &Voxels) -> (DVec3, DVec3) {
        let scale = f64::from(voxels.size()[0]) / 1024.0;
        let (mut eye, target) = match self {
            Self::Terrain => (DVec3::new(100.3, 230.2, 90.7), DVec3::new(600.0, 60.0, 650.0)),
            Self::Caves => (DVec3::new(512.3, 128.2, 512.4), DVec3::new(700.0, 120.0, 800.0)),
            Self::Specks => (DVec3::new(3.3, 128.2, 4.7), DVec3::new(600.0, 100.0, 650.0)),
        };
        eye *= scale;
        while voxels.get(eye.x as u32, eye.y as u32, eye.z as u32) != 0 {
            eye.x += 1.0;
        }
        (eye, target * scale)
    }
}

/// Returns a number in [0, 1) that looks random.
fn hash([x, y, z]: [i32; 3]) -> f32 {
    let mut h = (x as u32).wrapping_mul(374_761_393)
        ^ (y as u32).wrapping_mul(668_265_263)
        ^ (z as u32).wrapping_mul(2_246_822_519);
    h = (h ^ (h >> 13)).wrapping_mul(1_274_126_177);
    h ^= h >> 16;
    (h & 0x00ff_ffff) as f32 / 16_777_216.0
}

/// Returns smooth noise in [0, 1): random numbers at whole places, blended between.
fn noise(at: [f32; 3]) -> f32 {
    let first = at.map(f32::floor);
    let [u, v, w]: [f32; 3] = std::array::from_fn(|a| {
        let t = at[a] - first[a];
        t * t * (3.0 - 2.0 * t)
    });
    let [x, y, z] = first.map(|c| c as i32);
    let blend = |p: f32, q: f32, t: f32| p + (q - p) * t;
    let slab = |z: i32| {
        let row = |y: i32| blend(hash([x, y, z]), hash([x + 1, y, z]), u);
        blend(row(y), row(y + 1), v)
    };
    blend(slab(z), slab(z + 1), w)
}

/// Adds up five octaves of noise on a plane.
fn hills(x: f32, z: f32) -> f32 {
    let (mut sum, mut share, mut scale) = (0.0, 0.5, 1.0);
    for _ in 0..5 {
        sum += share * noise([x * scale, 0.5, z * scale]);
        share *= 0.5;
        scale *= 2.0;
    }
    sum
}
