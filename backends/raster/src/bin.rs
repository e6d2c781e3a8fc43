//! Which triangles touch which tile of the picture?
//!
//! The triangles of a model are cut into a number of runs that depends on the model alone. Each run is set up
//! and sorted into tiles by one thread, so bins hold the same records in the same order on any number of them.

use crate::clip::clip;
use crate::lens::Lens;
use crate::model::{Class, Model, Part, Role};
use crate::setup::{DepthPlane, Record, STEPS, ScreenPoint};
use crate::tile::{Placed, TileGrid};
use crate::transform::{ScreenVertex, border};
use polyptych_core::parallel::{Threads, for_each_mut};
use std::ops::Range;

/// Most runs: enough for a few times as many threads as there usually are.
pub(crate) const RUNS: usize = 32;
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
struct Run {
    solid: Bin<Record>,
    layers: Bin<Record>,
}

/// Returns the number of runs for so many triangles or lines.
pub(crate) fn runs_for(count: usize) -> usize {
    count.div_ceil(LEAST_IN_RUN).clamp(1, RUNS)
}

/// Returns which of all are in a run.
pub(crate) fn run_of(count: usize, run: usize, runs: usize) -> Range<usize> {
    count * run / runs..count * (run + 1) / runs
}

/// Records, and the same once more for each tile that they touch, tile by tile.
pub(crate) struct Bin<T> {
    pub(crate) records: Vec<T>,
    by_tile: Vec<T>,
    /// Where the records of a tile end in `by_tile`; they begin where those of the tile before end.
    ends: Vec<u32>,
}

impl Bins {
    /// Sets up and sorts all triangles of a pass.
    pub(crate) fn fill(
        &mut self,
        pass: &Pass<'_>,
        vertices: &[ScreenVertex],
        grid: &TileGrid,
        threads: &dyn Threads,
    ) {
        let triangles = pass.model.triangles as usize;
        self.used = runs_for(triangles);
        if self.runs.len() < self.used {
            self.runs.resize_with(self.used, Run::default);
        }
        let used = self.used;
        for_each_mut(threads, &mut self.runs[..used], 1, &|i, run| {
            run.fill(pass, vertices, run_of(triangles, i, used));
            run.solid.sort(grid);
            run.layers.sort(grid);
        });
    }

    /// Lists the solid triangles of a tile.
    pub(crate) fn solid(&self, tile: usize) -> impl Iterator<Item = &Record> {
        self.runs[..self.used].iter().flat_map(move |run| run.solid.of_tile(tile))
    }

    /// Lists the triangles of a tile that may let light through.
    pub(crate) fn layers(&self, tile: usize) -> impl Iterator<Item = &Record> {
        self.runs[..self.used].iter().flat_map(move |run| run.layers.of_tile(tile))
    }

    /// Tells whether nothing touches a tile.
    pub(crate) fn is_empty(&self, tile: usize) -> bool {
        self.solid(tile).next().is_none() && self.layers(tile).next().is_none()
    }

    /// Counts the triangles that are left after clipping and culling.
    pub(crate) fn triangles(&self) -> u64 {
        self.runs[..self.used].iter().map(|r| (r.solid.records.len() + r.layers.records.len()) as u64).sum()
    }

    /// Returns the bytes held.
    pub(crate) fn bytes(&self) -> u64 {
        self.runs.iter().map(|r| r.solid.bytes() + r.layers.bytes()).sum()
    }
}

impl Run {
    fn fill(&mut self, pass: &Pass<'_>, vertices: &[ScreenVertex], triangles: Range<usize>) {
        self.solid.records.clear();
        self.layers.records.clear();
        let parts = &pass.model.parts;
        let first = parts.partition_point(|p| p.first_triangle as usize <= triangles.start);
        for part in &parts[first.saturating_sub(1)..] {
            let begin = part.first_triangle as usize;
            if begin >= triangles.end {
                break;
            }
            let end = begin + part.mesh().triangles.len();
            let local = triangles.start.max(begin) - begin..triangles.end.min(end).saturating_sub(begin);
            self.fill_part(pass, part, vertices, local);
        }
    }

    fn fill_part(
        &mut self,
        pass: &Pass<'_>,
        part: &Part,
        vertices: &[ScreenVertex],
        triangles: Range<usize>,
    ) {
        let mesh = part.mesh();
        let screen_from_object = pass.lens.for_object(&part.world_from_object);
        let vertices = &vertices[part.first_vertex..];
        let reach = if pass.smooth { STEPS / 2 } else { 0 };
        for triangle in triangles {
            let slot = mesh.slot(triangle);
            let class = part.class(pass.role, slot);
            let records = match class {
                Class::Nothing => continue,
                Class::Solid => &mut self.solid.records,
                Class::Layer => &mut self.layers.records,
            };
            if pass.without.is_some_and(|w| w.leaves_out(part, triangle)) {
                continue;
            }
            let culls = pass.culls_back || (class == Class::Layer && part.one_sided_layers);
            let sides = part.sides(culls && pass.role == Role::Camera);
            let id = part.first_triangle + triangle as u32;
            let [a, b, c] = mesh.triangles[triangle];
            let [a, b, c] = [&vertices[a as usize], &vertices[b as usize], &vertices[c as usize]];
            let (all, any) = (a.beyond & b.beyond & c.beyond, a.beyond | b.beyond | c.beyond);
            if any & border::NOWHERE != 0 || all & border::HIDING != 0 {
                continue;
            }
            if any & border::CLIPPING == 0 {
                let point = |v: &ScreenVertex| ScreenPoint { x: v.x, y: v.y, depth: v.depth };
                let points = [point(a), point(b), point(c)];
                let plane = || DepthPlane::through(&points);
                records.extend(Record::new(&points, plane, id, sides, reach));
            } else {
                let corners = mesh.corners(triangle).map(|p| screen_from_object.apply(p.as_dvec3()));
                clip(pass.lens, corners, |points, plane| {
                    records.extend(Record::new(&points, || plane, id, sides, reach));
                });
            }
        }
    }
}

impl<T> Default for Bin<T> {
    fn default() -> Self {
        Self { records: Vec::new(), by_tile: Vec::new(), ends: Vec::new() }
    }
}

impl<T: Placed + Copy> Bin<T> {
    /// Sorts the records by tile, in their order within a tile: counts, sums, places.
    pub(crate) fn sort(&mut self, grid: &TileGrid) {
        self.ends.clear();
        self.ends.resize(grid.count(), 0);
        let mut total = 0;
        for record in &self.records {
            grid.for_each_touched(record, |tile| {
                self.ends[tile] += 1;
                total += 1;
            });
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += *end;
            *end = sum - *end;
        }
        let Some(&any) = self.records.first() else {
            self.by_tile.clear();
            return;
        };
        self.by_tile.resize(total, any);
        for record in &self.records {
            grid.for_each_touched(record, |tile| {
                self.by_tile[self.ends[tile] as usize] = *record;
                self.ends[tile] += 1;
            });
        }
    }

    pub(crate) fn of_tile(&self, tile: usize) -> &[T] {
        let begin = if tile == 0 { 0 } else { self.ends[tile - 1] as usize };
        &self.by_tile[begin..self.ends[tile] as usize]
    }

    pub(crate) fn bytes(&self) -> u64 {
        let records = (self.records.capacity() + self.by_tile.capacity()) * size_of::<T>();
        (records + self.ends.capacity() * 4) as u64
    }
}
