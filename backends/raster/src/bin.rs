//! Which triangles touch which tile of the picture?
//!
//! The triangles of a model are cut into runs. Each is set up and sorted into tiles by one thread, and a tile looks at
//! them one after the other, so that it sees the same records in the same order on any number of threads.

use crate::clip::clip;
use crate::grid::{Placed, TileGrid};
use crate::lens::{Lens, ScreenFromObject};
use crate::model::{Class, Model, Part, Role};
use crate::setup::{Corners, DepthPlane, Record, STEPS};
use crate::sieve;
use crate::transform::{PartOnScreen, ScreenVertices, border};
use polyptych_core::lanes::LANES;
use polyptych_core::registers::fetch;
use polyptych_core::seam::{Cancelled, Control};
use std::ops::Range;

/// Runs for each thread: enough that none waits long for the others, and few, for the records of a tile lie in as many
/// places.
const RUNS: usize = 4;
/// Triangles or lines that are worth a run of their own.
const LEAST_IN_RUN: usize = 512;

/// What a pass over the model draws.
#[derive(Clone, Copy)]
pub(crate) struct Pass<'a> {
    pub(crate) model: &'a Model,
    pub(crate) lens: &'a Lens,
    pub(crate) role: Role,
    /// Whether sides that look away are left out.
    pub(crate) culls_back: bool,
    /// Whether triangles count that cover no pixel's center, but another place in it.
    pub(crate) smooth: bool,
    /// Leaves out triangles of one part, given by their corners in object space.
    pub(crate) without: Option<&'a dyn Without>,
}

/// Triangles that a pass leaves out.
pub(crate) trait Without: Sync {
    /// Tells whether a triangle is left out.
    fn leaves_out(&self, part: &Part, triangle: usize) -> bool;
}

/// The triangles of a pass by tile.
#[derive(Default)]
pub(crate) struct Bins {
    runs: Vec<Run>,
    used: usize,
}

/// The triangles of one run.
#[derive(Default)]
pub(crate) struct Run {
    /// Solid ones that turn their outside to the viewer.
    pub(crate) facing: Bin<Record>,
    /// Other solid ones, which are mostly hidden.
    pub(crate) averted: Bin<Record>,
    /// Those that may have holes or let light through.
    pub(crate) layers: Bin<Record>,
}

/// Returns the number of runs for so many triangles or lines.
pub(crate) fn runs_for(count: usize, control: &Control<'_>) -> usize {
    count.div_ceil(LEAST_IN_RUN).clamp(1, RUNS * control.threads.count())
}

/// Returns which of all are in a run.
pub(crate) fn run_of(count: usize, run: usize, runs: usize) -> Range<usize> {
    count * run / runs..count * (run + 1) / runs
}

/// Records by tile, in the order in which they were added.
pub(crate) struct Bin<T> {
    /// In blocks of [`BLOCK`], those of a tile chained.
    records: Vec<T>,
    /// For each block the next one of its tile.
    next: Vec<u32>,
    tiles: Vec<List>,
    /// Those that touch a tile, each counted once.
    count: u64,
}

/// Triangles or lines that are set up between two looks at the stop sign.
pub(crate) const PIECE: usize = 1024;
/// Records of a tile that lie together in memory.
const BLOCK: usize = 8;

/// The records of a tile: chained blocks, all but the last one full.
#[derive(Clone, Copy, Default)]
struct List {
    first: u32,
    last: u32,
    count: u32,
}

/// The records of a tile in a bin.
pub(crate) struct Records<'a, T> {
    bin: &'a Bin<T>,
    /// Those of the block at hand that are left.
    block: std::slice::Iter<'a, T>,
    /// As many of the next block: each is brought near while one of this block is drawn.
    ahead: std::slice::Iter<'a, T>,
    /// The blocks that are left.
    list: List,
}

impl<'a, T> Iterator for Records<'a, T> {
    type Item = &'a T;

    #[inline(always)]
    fn next(&mut self) -> Option<&'a T> {
        if let Some(record) = self.block.next() {
            if let Some(ahead) = self.ahead.next() {
                fetch(ahead);
            }
            return Some(record);
        }
        let some = BLOCK.min(self.list.count as usize);
        if some == 0 {
            return None;
        }
        let block = self.list.first as usize;
        self.list.count -= some as u32;
        self.list.first = self.bin.next[block];
        self.block = self.bin.records[block * BLOCK..][..some].iter();
        if self.list.count > 0 {
            self.ahead = self.bin.records[self.list.first as usize * BLOCK..][..BLOCK].iter();
        }
        self.block.next()
    }
}

impl Bins {
    /// Sets up and sorts all triangles of a pass.
    pub(crate) fn fill(
        &mut self,
        pass: &Pass<'_>,
        vertices: &[ScreenVertices],
        grid: &TileGrid,
        control: &Control<'_>,
    ) -> Result<(), Cancelled> {
        let triangles = pass.model.triangles as usize;
        self.used = runs_for(triangles, control);
        if self.runs.len() < self.used {
            self.runs.resize_with(self.used, Run::default);
        }
        let used = self.used;
        control.for_each_mut(&mut self.runs[..used], 1, &|i, run| {
            run.fill(pass, vertices, grid, run_of(triangles, i, used), control);
        })
    }

    /// Lists the runs, by rising ids of their triangles.
    pub(crate) fn runs(&self) -> &[Run] {
        &self.runs[..self.used]
    }

    /// Tells whether nothing touches a tile.
    pub(crate) fn is_empty(&self, tile: usize) -> bool {
        self.runs().iter().all(|run| run.bins().iter().all(|bin| bin.is_empty(tile)))
    }

    /// Counts the triangles that are left after clipping and culling.
    pub(crate) fn triangles(&self) -> u64 {
        self.runs().iter().flat_map(Run::bins).map(|bin| bin.count).sum()
    }

    /// Returns the bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        self.runs.iter().flat_map(Run::bins).map(Bin::bytes).sum()
    }
}

impl Run {
    fn bins(&self) -> [&Bin<Record>; 3] {
        [&self.facing, &self.averted, &self.layers]
    }

    fn fill(
        &mut self,
        pass: &Pass<'_>,
        vertices: &[ScreenVertices],
        grid: &TileGrid,
        triangles: Range<usize>,
        control: &Control<'_>,
    ) {
        for bin in [&mut self.facing, &mut self.averted, &mut self.layers] {
            bin.clear(grid);
        }
        let parts = &pass.model.parts;
        let first = parts.partition_point(|p| p.first_triangle as usize <= triangles.start);
        for part in &parts[first.saturating_sub(1)..] {
            let begin = part.first_triangle as usize;
            if begin >= triangles.end {
                break;
            }
            let end = begin + part.mesh().triangles.len();
            let local = triangles.start.max(begin) - begin..triangles.end.min(end).saturating_sub(begin);
            let setup = Setup::new(pass, part, vertices, grid);
            for piece in local.clone().step_by(PIECE) {
                if control.is_cancelled() {
                    return;
                }
                self.fill_part(&setup, piece..local.end.min(piece + PIECE));
            }
        }
    }

    fn fill_part(&mut self, setup: &Setup<'_>, triangles: Range<usize>) {
        let all = &setup.part.mesh().triangles;
        for first in triangles.clone().step_by(LANES) {
            let eight = &all[first..triangles.end.min(first + LANES)];
            let mut left = sieve::may_cover(setup.vertices, eight, setup.reach);
            while left != 0 {
                let lane = left.trailing_zeros() as usize;
                left &= left - 1;
                self.add(setup, first + lane);
            }
        }
    }

    /// Sets up a triangle and puts it into the tiles that it touches.
    fn add(&mut self, setup: &Setup<'_>, triangle: usize) {
        let Setup { pass, part, vertices, .. } = setup;
        let mesh = part.mesh();
        let class = part.class(pass.role, mesh.slot(triangle));
        if class == Class::Nothing || pass.without.is_some_and(|w| w.leaves_out(part, triangle)) {
            return;
        }
        let id = part.first_triangle + triangle as u32;
        let indices = mesh.triangles[triangle];
        let is_clipped = |vertex: u32| vertices.snapped(vertex).2 & border::CLIPPING != 0;
        if indices.into_iter().any(is_clipped) {
            let corners = mesh.corners(triangle).map(|p| setup.screen_from_object.apply(p.as_dvec3()));
            clip(pass.lens, corners, |points, plane| {
                self.put(setup, (class, id), &Corners::snapped(points), Some(plane));
            });
        } else {
            self.put(setup, (class, id), &vertices.corners(indices), None);
        }
    }

    /// Puts a triangle, or a piece of one with the plane of its depth, into the tiles that it touches.
    #[inline]
    fn put(
        &mut self,
        setup: &Setup<'_>,
        (class, id): (Class, u32),
        corners: &Corners,
        plane: Option<DepthPlane>,
    ) {
        let Setup { pass, part, .. } = setup;
        let culls = pass.culls_back || (class == Class::Layer && part.one_sided_layers);
        let area = corners.area();
        if !part.sides(culls && pass.role == Role::Camera).draws(area) {
            return;
        }
        let plane = || plane.unwrap_or_else(|| DepthPlane::through(&corners.points));
        let Some(record) = Record::new(corners, area, plane, id, setup.reach) else { return };
        let bin = match class {
            Class::Layer => &mut self.layers,
            _ if (area < 0) != part.mirrored => &mut self.facing,
            _ => &mut self.averted,
        };
        bin.add(setup.grid, record);
    }
}

/// A part about to be set up.
struct Setup<'a> {
    pass: &'a Pass<'a>,
    part: &'a Part,
    vertices: PartOnScreen<'a>,
    grid: &'a TileGrid,
    screen_from_object: ScreenFromObject,
    /// How far from a pixel's center triangles may be looked at, in steps.
    reach: i32,
}

impl<'a> Setup<'a> {
    fn new(pass: &'a Pass<'a>, part: &'a Part, vertices: &'a [ScreenVertices], grid: &'a TileGrid) -> Self {
        Self {
            pass,
            part,
            vertices: PartOnScreen::of(vertices, part),
            grid,
            screen_from_object: pass.lens.for_object(&part.world_from_object),
            reach: if pass.smooth { STEPS / 2 } else { 0 },
        }
    }
}

impl<T> Default for Bin<T> {
    fn default() -> Self {
        Self { records: Vec::new(), next: Vec::new(), tiles: Vec::new(), count: 0 }
    }
}

impl<T: Placed + Copy> Bin<T> {
    /// Forgets all records.
    pub(crate) fn clear(&mut self, grid: &TileGrid) {
        self.records.clear();
        self.next.clear();
        self.tiles.clear();
        self.tiles.resize(grid.count(), List::default());
        self.count = 0;
    }

    /// Adds a record to the tiles that it touches.
    #[inline(always)]
    pub(crate) fn add(&mut self, grid: &TileGrid, record: T) {
        let mut touches = false;
        grid.for_each_touched(&record, |tile| {
            touches = true;
            let list = &mut self.tiles[tile];
            let place = list.count as usize % BLOCK;
            if place == 0 {
                let block = self.next.len() as u32;
                self.records.resize(self.records.len() + BLOCK, record);
                self.next.push(0);
                if list.count == 0 {
                    list.first = block;
                } else {
                    self.next[list.last as usize] = block;
                }
                list.last = block;
            } else {
                self.records[list.last as usize * BLOCK + place] = record;
            }
            list.count += 1;
        });
        self.count += u64::from(touches);
    }

    pub(crate) fn is_empty(&self, tile: usize) -> bool {
        self.tiles[tile].count == 0
    }

    /// Lists the records of a tile.
    #[inline(always)]
    pub(crate) fn of_tile(&self, tile: usize) -> Records<'_, T> {
        Records { bin: self, block: [].iter(), ahead: [].iter(), list: self.tiles[tile] }
    }

    pub(crate) fn bytes(&self) -> u64 {
        let records = self.records.capacity() * size_of::<T>() + self.next.capacity() * size_of::<u32>();
        (records + self.tiles.capacity() * size_of::<List>()) as u64
    }
}
