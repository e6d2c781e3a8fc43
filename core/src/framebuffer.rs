//! Pictures: planes of color, distance, normal, id, albedo, shadow and coverage.

use crate::parallel::Threads;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// One plane of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Linear RGB.
    Color,
    /// Euclidean distance from the eye (orthographic: from the picture plane) in meters; infinity = nothing.
    Distance,
    /// Unit normal in world space on the viewer's side; zero = nothing.
    Normal,
    /// Index of the object plus one; 0 = nothing.
    Id,
    /// Base color with texture, unlit.
    Albedo,
    /// Share of the scene's shadow-casting lights that reach the point and that it does not face away from:
    /// 1 = all, 0 = none. 1 where nothing is seen.
    Shadow,
    /// Share of the pixel that objects cover.
    Coverage,
}

impl Channel {
    /// All channels.
    pub const ALL: [Self; 7] =
        [Self::Color, Self::Distance, Self::Normal, Self::Id, Self::Albedo, Self::Shadow, Self::Coverage];

    /// Returns the name used on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Distance => "distance",
            Self::Normal => "normal",
            Self::Id => "id",
            Self::Albedo => "albedo",
            Self::Shadow => "shadow",
            Self::Coverage => "coverage",
        }
    }
}

/// A set of channels. A channel that nobody asked for is neither computed nor stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Channels(u8);

impl Channels {
    /// No channel.
    pub const NONE: Self = Self(0);
    /// All channels.
    pub const ALL: Self = Self(0x7f);
    /// The color alone.
    pub const COLOR: Self = Self(1);

    /// Builds a set.
    #[must_use]
    pub fn of(channels: &[Channel]) -> Self {
        channels.iter().fold(Self::NONE, |set, &c| set.with(c))
    }

    /// Returns the set with one more channel.
    #[must_use]
    pub const fn with(self, channel: Channel) -> Self {
        Self(self.0 | 1 << channel as u8)
    }

    /// Tells whether a channel is in the set.
    #[must_use]
    pub const fn has(self, channel: Channel) -> bool {
        self.0 >> channel as u8 & 1 == 1
    }

    /// Tells whether any channel but color is in the set.
    #[must_use]
    pub const fn has_geometry(self) -> bool {
        self.0 & !1 != 0
    }

    /// Returns the set as bits: bit `i` stands for the `i`th of [`Channel::ALL`].
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Builds a set from bits; those that stand for no channel are ignored.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Self {
        Self(bits & Self::ALL.0)
    }

    /// Lists the channels.
    pub fn iter(self) -> impl Iterator<Item = Channel> {
        Channel::ALL.into_iter().filter(move |&c| self.has(c))
    }
}

/// Everything a pixel can hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// See [`Channel::Color`].
    pub color: Vec3,
    /// See [`Channel::Distance`].
    pub distance: f32,
    /// See [`Channel::Normal`].
    pub normal: Vec3,
    /// See [`Channel::Id`].
    pub id: u32,
    /// See [`Channel::Albedo`].
    pub albedo: Vec3,
    /// See [`Channel::Shadow`].
    pub shadow: f32,
    /// See [`Channel::Coverage`].
    pub coverage: f32,
}

impl Pixel {
    /// A pixel that sees nothing but a background color.
    #[must_use]
    pub const fn background(color: Vec3) -> Self {
        Self {
            color,
            distance: f32::INFINITY,
            normal: Vec3::ZERO,
            id: 0,
            albedo: Vec3::ZERO,
            shadow: 1.0,
            coverage: 0.0,
        }
    }
}

/// A picture with the channels that were asked for; planes of other channels are empty.
#[derive(Clone, Debug)]
pub struct Framebuffer {
    width: u32,
    height: u32,
    channels: Channels,
    color: Plane<Vec3>,
    distance: Plane<f32>,
    normal: Plane<Vec3>,
    id: Plane<u32>,
    albedo: Plane<Vec3>,
    shadow: Plane<f32>,
    coverage: Plane<f32>,
    /// Changes whenever something may be written.
    stamp: u64,
    /// The stamp with which each plane may last have been written to, in the order of [`Channel::ALL`].
    written: [u64; 7],
    _owner: Option<Owner>,
}

/// Returns a number that no picture had before.
fn next_stamp() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed)
}

/// The numbers of one channel: the framebuffer's own, or in memory that it is lent.
#[derive(Debug)]
enum Plane<T: 'static> {
    Own(Vec<T>),
    Lent(&'static mut [T]),
}

/// Keeps lent memory alive.
#[derive(Clone)]
struct Owner(#[expect(dead_code, reason = "it is there to be dropped")] Arc<dyn Any + Send + Sync>);

impl std::fmt::Debug for Owner {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Owner")
    }
}

impl<T> Plane<T> {
    fn is_lent(&self) -> bool {
        matches!(self, Self::Lent(_))
    }
}

impl<T: Clone> Clone for Plane<T> {
    fn clone(&self) -> Self {
        Self::Own(self.to_vec())
    }
}

impl<T> Deref for Plane<T> {
    type Target = [T];
    fn deref(&self) -> &[T] {
        match self {
            Self::Own(numbers) => numbers,
            Self::Lent(numbers) => numbers,
        }
    }
}

impl<T> DerefMut for Plane<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match self {
            Self::Own(numbers) => numbers,
            Self::Lent(numbers) => numbers,
        }
    }
}

impl Framebuffer {
    /// Builds an empty (black, infinitely far) picture.
    #[must_use]
    pub fn new(width: u32, height: u32, channels: Channels) -> Self {
        let n = width as usize * height as usize;
        let len = |c: Channel| if channels.has(c) { n } else { 0 };
        let stamp = next_stamp();
        Self {
            width,
            height,
            channels,
            color: Plane::Own(vec![Vec3::ZERO; len(Channel::Color)]),
            distance: Plane::Own(vec![f32::INFINITY; len(Channel::Distance)]),
            normal: Plane::Own(vec![Vec3::ZERO; len(Channel::Normal)]),
            id: Plane::Own(vec![0; len(Channel::Id)]),
            albedo: Plane::Own(vec![Vec3::ZERO; len(Channel::Albedo)]),
            shadow: Plane::Own(vec![1.0; len(Channel::Shadow)]),
            coverage: Plane::Own(vec![0.0; len(Channel::Coverage)]),
            stamp,
            written: [stamp; 7],
            _owner: None,
        }
    }

    /// Builds a picture whose planes lie in memory of somebody else, with what it holds. `owner` is kept as long
    /// as the picture: the one to whom the memory belongs. A clone has planes of its own.
    ///
    /// # Errors
    /// When a plane has not as many pixels as the picture, or none for a channel that is left out.
    pub fn lent(
        channels: Channels,
        planes: Band<'static>,
        owner: Arc<dyn Any + Send + Sync>,
    ) -> Result<Self, String> {
        let Band { width, rows: height, color, distance, normal, id, albedo, shadow, coverage, .. } = planes;
        let n = width as usize * height as usize;
        let lengths =
            [color.len(), distance.len(), normal.len(), id.len(), albedo.len(), shadow.len(), coverage.len()];
        for (channel, length) in Channel::ALL.into_iter().zip(lengths) {
            let wanted = if channels.has(channel) { n } else { 0 };
            if length != wanted {
                return Err(format!("{length} pixels of {} where {wanted} are needed", channel.name()));
            }
        }
        let stamp = next_stamp();
        Ok(Self {
            width,
            height,
            channels,
            color: Plane::Lent(color),
            distance: Plane::Lent(distance),
            normal: Plane::Lent(normal),
            id: Plane::Lent(id),
            albedo: Plane::Lent(albedo),
            shadow: Plane::Lent(shadow),
            coverage: Plane::Lent(coverage),
            stamp,
            written: [stamp; 7],
            _owner: Some(Owner(owner)),
        })
    }

    /// Returns the number of columns.
    #[must_use]
    pub fn width(&self) -> u32 {
        self.width
    }
    /// Returns the number of rows.
    #[must_use]
    pub fn height(&self) -> u32 {
        self.height
    }
    /// Returns the channels it holds.
    #[must_use]
    pub fn channels(&self) -> Channels {
        self.channels
    }
    /// Returns the color plane, rows from the top.
    #[must_use]
    pub fn color(&self) -> &[Vec3] {
        &self.color
    }
    /// Returns the distance plane.
    #[must_use]
    pub fn distance(&self) -> &[f32] {
        &self.distance
    }
    /// Returns the normal plane.
    #[must_use]
    pub fn normal(&self) -> &[Vec3] {
        &self.normal
    }
    /// Returns the id plane.
    #[must_use]
    pub fn id(&self) -> &[u32] {
        &self.id
    }
    /// Returns the albedo plane.
    #[must_use]
    pub fn albedo(&self) -> &[Vec3] {
        &self.albedo
    }
    /// Returns the shadow plane.
    #[must_use]
    pub fn shadow(&self) -> &[f32] {
        &self.shadow
    }
    /// Returns the coverage plane.
    #[must_use]
    pub fn coverage(&self) -> &[f32] {
        &self.coverage
    }

    /// Exchanges planes with another picture of the same size: each of the channels that both have. What is lent is
    /// exchanged with its memory, so lending twice brings every plane back to where it was.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn exchange(&mut self, other: &mut Self, channels: Channels) {
        use std::mem::swap;
        assert_eq!((self.width, self.height), (other.width, other.height), "pictures of one size");
        self.touch();
        other.touch();
        for channel in channels.iter().filter(|&c| self.channels.has(c) && other.channels.has(c)) {
            match channel {
                Channel::Color => swap(&mut self.color, &mut other.color),
                Channel::Distance => swap(&mut self.distance, &mut other.distance),
                Channel::Normal => swap(&mut self.normal, &mut other.normal),
                Channel::Id => swap(&mut self.id, &mut other.id),
                Channel::Albedo => swap(&mut self.albedo, &mut other.albedo),
                Channel::Shadow => swap(&mut self.shadow, &mut other.shadow),
                Channel::Coverage => swap(&mut self.coverage, &mut other.coverage),
            }
            swap(&mut self.written[channel as usize], &mut other.written[channel as usize]);
        }
    }

    /// Returns what tells this content from that of every other picture and time: as long as it is the same, nothing was
    /// written. Clones share it until they are written to. Nothing for lent memory, to which others may write.
    #[must_use]
    pub fn stamp(&self) -> Option<u64> {
        (!self.is_lent()).then_some(self.stamp)
    }

    /// Returns the same plane by plane, in the order of [`Channel::ALL`]: a plane that is exchanged takes its number
    /// along, and [`Framebuffer::touch`] leaves all as they are.
    #[must_use]
    pub fn written(&self) -> Option<[u64; 7]> {
        (!self.is_lent()).then_some(self.written)
    }

    fn is_lent(&self) -> bool {
        self.color.is_lent()
            || self.distance.is_lent()
            || self.normal.is_lent()
            || self.id.is_lent()
            || self.albedo.is_lent()
            || self.shadow.is_lent()
            || self.coverage.is_lent()
    }

    /// Makes the picture count as another one, so that a back end draws it again: what measures drawing asks for that.
    pub fn touch(&mut self) {
        self.stamp = next_stamp();
    }

    /// Returns the bytes held.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        (self.color.len() * 12
            + self.normal.len() * 12
            + self.albedo.len() * 12
            + (self.distance.len() + self.id.len() + self.shadow.len() + self.coverage.len()) * 4)
            as u64
    }

    /// Returns the whole picture as one band.
    pub fn band(&mut self) -> Band<'_> {
        self.touch();
        self.written = [self.stamp; 7];
        Band {
            width: self.width,
            first_row: 0,
            rows: self.height,
            color: &mut self.color,
            distance: &mut self.distance,
            normal: &mut self.normal,
            id: &mut self.id,
            albedo: &mut self.albedo,
            shadow: &mut self.shadow,
            coverage: &mut self.coverage,
        }
    }

    /// Draws the picture in bands of `rows` rows, in parallel; band borders lie at multiples of `rows`. From the middle
    /// outward: what is looked at is mostly there, and threads are done together where the last bands are cheap ones.
    ///
    /// Allocates nothing. The result does not depend on the number of threads as long as `draw` writes only
    /// what follows from the band's place.
    pub fn for_each_band(&mut self, threads: &dyn Threads, rows: u32, draw: &(impl Fn(Band<'_>) + Sync)) {
        /// Rows of the upper half.
        fn half_of(height: u32, rows: u32) -> u32 {
            height.div_ceil(rows) / 2 * rows
        }
        fn halve(
            threads: &dyn Threads,
            band: Band<'_>,
            rows: u32,
            middle: u32,
            draw: &(impl Fn(Band<'_>) + Sync),
        ) {
            if band.rows <= rows {
                draw(band);
                return;
            }
            let is_upper = band.first_row < middle;
            let half = half_of(band.rows, rows);
            let (upper, lower) = band.split(half);
            let (first, second) = if is_upper { (lower, upper) } else { (upper, lower) };
            let (mut first, mut second) = (Some(first), Some(second));
            let go_on = |band: &mut Option<Band<'_>>| {
                if let Some(band) = band.take() {
                    halve(threads, band, rows, middle, draw);
                }
            };
            threads.join(&mut || go_on(&mut first), &mut || go_on(&mut second));
        }
        if self.width > 0 && self.height > 0 {
            let rows = rows.max(1);
            let middle = half_of(self.height, rows);
            halve(threads, self.band(), rows, middle, draw);
        }
    }

    /// Compares all planes bit by bit; signs of zero and patterns of NaN count.
    #[must_use]
    pub fn same_bits(&self, other: &Self) -> bool {
        let bits = |v: &[f32]| v.iter().map(|f| f.to_bits()).collect::<Vec<_>>();
        let bits3 = |v: &[Vec3]| v.iter().map(|c| c.to_array().map(f32::to_bits)).collect::<Vec<_>>();
        self.width == other.width
            && self.height == other.height
            && self.channels == other.channels
            && self.id() == other.id()
            && bits3(&self.color) == bits3(&other.color)
            && bits(&self.distance) == bits(&other.distance)
            && bits3(&self.normal) == bits3(&other.normal)
            && bits3(&self.albedo) == bits3(&other.albedo)
            && bits(&self.shadow) == bits(&other.shadow)
            && bits(&self.coverage) == bits(&other.coverage)
    }

    /// Counts numbers that are not finite (infinite distances are the mark of nothing and do not count).
    #[must_use]
    pub fn count_not_finite(&self) -> usize {
        let wild = |v: &[Vec3]| v.iter().filter(|c| !c.is_finite()).count();
        wild(&self.color)
            + wild(&self.normal)
            + wild(&self.albedo)
            + self.distance.iter().filter(|d| d.is_nan() || **d < 0.0).count()
            + self.shadow.iter().chain(self.coverage()).filter(|v| !v.is_finite()).count()
    }
}

/// Some rows of a picture, to be written by one thread. Planes that were not asked for are empty.
pub struct Band<'a> {
    /// Number of columns.
    pub width: u32,
    /// Row of the picture at which the band begins.
    pub first_row: u32,
    /// Number of rows.
    pub rows: u32,
    /// Color, rows from the top of the band.
    pub color: &'a mut [Vec3],
    /// Distance.
    pub distance: &'a mut [f32],
    /// Normal.
    pub normal: &'a mut [Vec3],
    /// Id.
    pub id: &'a mut [u32],
    /// Albedo.
    pub albedo: &'a mut [Vec3],
    /// Shadow.
    pub shadow: &'a mut [f32],
    /// Coverage.
    pub coverage: &'a mut [f32],
}

impl<'a> Band<'a> {
    /// Cuts the band before a row, counted from its first.
    #[must_use]
    pub fn split(self, row: u32) -> (Self, Self) {
        fn cut<T>(plane: &mut [T], at: usize) -> (&mut [T], &mut [T]) {
            let at = at.min(plane.len());
            plane.split_at_mut(at)
        }
        let at = row as usize * self.width as usize;
        let (color, color2) = cut(self.color, at);
        let (distance, distance2) = cut(self.distance, at);
        let (normal, normal2) = cut(self.normal, at);
        let (id, id2) = cut(self.id, at);
        let (albedo, albedo2) = cut(self.albedo, at);
        let (shadow, shadow2) = cut(self.shadow, at);
        let (coverage, coverage2) = cut(self.coverage, at);
        let width = self.width;
        (
            Band {
                width,
                first_row: self.first_row,
                rows: row,
                color,
                distance,
                normal,
                id,
                albedo,
                shadow,
                coverage,
            },
            Band {
                width,
                first_row: self.first_row + row,
                rows: self.rows - row,
                color: color2,
                distance: distance2,
                normal: normal2,
                id: id2,
                albedo: albedo2,
                shadow: shadow2,
                coverage: coverage2,
            },
        )
    }

    /// Writes a pixel into all planes that are there; `row` counts from the first row of the band.
    pub fn put(&mut self, x: u32, row: u32, pixel: &Pixel) {
        let i = row as usize * self.width as usize + x as usize;
        if let Some(v) = self.color.get_mut(i) {
            *v = pixel.color;
        }
        if let Some(v) = self.distance.get_mut(i) {
            *v = pixel.distance;
        }
        if let Some(v) = self.normal.get_mut(i) {
            *v = pixel.normal;
        }
        if let Some(v) = self.id.get_mut(i) {
            *v = pixel.id;
        }
        if let Some(v) = self.albedo.get_mut(i) {
            *v = pixel.albedo;
        }
        if let Some(v) = self.shadow.get_mut(i) {
            *v = pixel.shadow;
        }
        if let Some(v) = self.coverage.get_mut(i) {
            *v = pixel.coverage;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel::{OneThread, Pool};

    #[test]
    fn bands_are_drawn_from_the_middle_outward() {
        for (height, first) in [(96, vec![3, 4, 5, 2, 1, 0]), (100, vec![3, 4, 5, 6, 2, 1, 0]), (16, vec![0])]
        {
            let drawn = std::sync::Mutex::new(Vec::new());
            let mut picture = Framebuffer::new(1, height, Channels::COLOR);
            picture.for_each_band(&crate::parallel::OneThread, 16, &|band| {
                drawn.lock().unwrap().push(band.first_row / 16);
            });
            assert_eq!(drawn.into_inner().unwrap(), first, "{height}");
        }
    }

    #[test]
    fn bands_cover_every_row_once() {
        let pool = Pool::new(2).unwrap();
        for (width, height) in [(0, 0), (1, 1), (7, 1), (1, 131), (13, 97)] {
            for threads in [&OneThread as &dyn Threads, &pool] {
                let mut picture = Framebuffer::new(width, height, Channels::of(&[Channel::Id]));
                picture.for_each_band(threads, 16, &|mut band| {
                    assert_eq!(band.first_row % 16, 0);
                    for row in 0..band.rows {
                        for x in 0..band.width {
                            let id = (band.first_row + row) * band.width + x + 1;
                            band.put(x, row, &Pixel { id, ..Pixel::background(Vec3::ZERO) });
                        }
                    }
                });
                assert!(picture.id().iter().enumerate().all(|(i, &id)| id as usize == i + 1));
                assert!(picture.color().is_empty());
            }
        }
    }
}
