//! What do the two processes say to each other, byte by byte? Nothing that comes from a child is trusted.

use crate::call::{LogLine, Severity, Told};
use crate::words::keep;
use glam::{DMat3, DVec3};
use polyptych_core::camera::{Camera, Projection, WarpTable};
use polyptych_core::seam::{Counter, Decision, PassPlan};
use std::sync::Arc;
use std::time::Duration;

/// Longest message.
pub(super) const LONGEST: usize = 1 << 26;

/// Kinds of messages to the child.
pub(super) const PLAN: u8 = 1;
pub(super) const PREPARE: u8 = 2;
pub(super) const RENDER: u8 = 3;
/// Kinds of messages from the child.
pub(super) const HELLO: u8 = 11;
pub(super) const REFUSED: u8 = 12;
pub(super) const DONE: u8 = 13;
pub(super) const FAILED: u8 = 14;
pub(super) const FINISHED: u8 = 15;
pub(super) const LOG: u8 = 16;

/// Writes a message: its length, its kind, and what follows.
pub(super) struct Writer(Vec<u8>);

impl Writer {
    pub(super) fn new(kind: u8) -> Self {
        Self(vec![0, 0, 0, 0, kind])
    }
    pub(super) fn u32(&mut self, v: u32) -> &mut Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    pub(super) fn u64(&mut self, v: u64) -> &mut Self {
        self.0.extend(v.to_le_bytes());
        self
    }
    pub(super) fn f64(&mut self, v: f64) -> &mut Self {
        self.u64(v.to_bits())
    }
    pub(super) fn text(&mut self, v: &str) -> &mut Self {
        self.u32(v.len() as u32);
        self.0.extend(v.as_bytes());
        self
    }
    pub(super) fn finish(mut self) -> Vec<u8> {
        let length = self.0.len() as u32 - 4;
        self.0[..4].copy_from_slice(&length.to_le_bytes());
        self.0
    }
}

/// Reads a message.
pub(super) struct Reader<'a>(pub(super) &'a [u8]);

impl<'a> Reader<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }
    pub(super) fn u8(&mut self) -> Option<u8> {
        self.bytes(1).map(|b| b[0])
    }
    pub(super) fn u32(&mut self) -> Option<u32> {
        self.bytes(4)?.try_into().ok().map(u32::from_le_bytes)
    }
    pub(super) fn u64(&mut self) -> Option<u64> {
        self.bytes(8)?.try_into().ok().map(u64::from_le_bytes)
    }
    pub(super) fn f64(&mut self) -> Option<f64> {
        self.u64().map(f64::from_bits)
    }
    pub(super) fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        Some(String::from_utf8_lossy(self.bytes(length)?).into_owned())
    }
    /// Reads as many things as a count says, and no more than there are bytes.
    fn list<T>(&mut self, mut item: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = self.u32()? as usize;
        (0..count).map(|_| item(self)).collect()
    }
}

pub(super) fn put_camera(to: &mut Writer, camera: &Camera) {
    let (kind, a, b) = match &camera.projection {
        Projection::Perspective { fov_y } => (0, *fov_y, 0.0),
        Projection::Orthographic { height } => (1, *height, 0.0),
        Projection::Fisheye { fov } => (2, *fov, 0.0),
        Projection::Cylindrical { fov_x, fov_y } => (3, *fov_x, *fov_y),
        Projection::Warp(_) => (4, 0.0, 0.0),
    };
    to.u32(kind).f64(a).f64(b);
    let numbers = camera.eye.to_array().into_iter().chain(camera.world_from_camera.to_cols_array());
    numbers.for_each(|v| {
        to.f64(v);
    });
    if let Projection::Warp(table) = &camera.projection {
        to.u32(table.columns()).u32(table.rows());
        table.directions().iter().flat_map(DVec3::to_array).for_each(|v| {
            to.f64(v);
        });
    }
}

pub(super) fn get_camera(from: &mut Reader<'_>) -> Option<Camera> {
    let (kind, a, b) = (from.u32()?, from.f64()?, from.f64()?);
    let mut numbers = [0.0; 12];
    for number in &mut numbers {
        *number = from.f64()?;
    }
    let projection = match kind {
        0 => Projection::Perspective { fov_y: a },
        1 => Projection::Orthographic { height: a },
        2 => Projection::Fisheye { fov: a },
        3 => Projection::Cylindrical { fov_x: a, fov_y: b },
        _ => {
            let (columns, rows) = (from.u32()?, from.u32()?);
            let count = u64::from(columns) * u64::from(rows);
            let direction = |from: &mut Reader<'_>| Some(DVec3::new(from.f64()?, from.f64()?, from.f64()?));
            let directions = (0..count).map(|_| direction(from)).collect::<Option<Vec<_>>>()?;
            Projection::Warp(Arc::new(WarpTable::new(columns, rows, directions).ok()?))
        }
    };
    Some(Camera {
        eye: DVec3::from_slice(&numbers[..3]),
        world_from_camera: DMat3::from_cols_slice(&numbers[3..]),
        projection,
    })
}

/// Writes what a plugin told.
pub(super) fn put_told(to: &mut Writer, told: &Told) {
    to.u32(told.decisions.len() as u32);
    for (object, decision) in &told.decisions {
        let (kind, bound) = match decision {
            Decision::Exact => (0, 0.0),
            Decision::Converted { bound, .. } => (1, *bound),
            Decision::Approximated { .. } => (2, 0.0),
            Decision::Skipped { .. } => (3, 0.0),
        };
        to.u32(*object).u32(kind).f64(bound).text(decision.why());
    }
    to.u32(told.builds.len() as u32);
    for (object, what, bytes) in &told.builds {
        to.u32(*object).text(what).u64(*bytes);
    }
    to.u32(told.passes.len() as u32);
    for pass in &told.passes {
        to.text(&pass.name).u32(u32::from(pass.needed)).text(&pass.why);
    }
    to.f64(told.estimated_ms).u64(told.bytes);
    to.u32(told.counters.iter().flatten().count() as u32);
    for counter in told.counters.iter().flatten() {
        to.text(counter.name).u64(counter.count);
    }
    to.u32(told.phases.iter().count() as u32);
    for (name, time) in told.phases.iter() {
        to.text(name).u64(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
    }
    match &told.refusal {
        None => to.u32(0),
        Some((object, why)) => to.u32(1).u32(*object).text(why),
    };
}

/// Reads what a plugin told.
pub(super) fn get_told(from: &mut Reader<'_>, told: &mut Told) -> Option<()> {
    *told = Told::default();
    told.decisions = from.list(|from| {
        let (object, kind, bound, why) = (from.u32()?, from.u32()?, from.f64()?, from.text()?);
        let decision = match kind {
            0 => Decision::Exact,
            1 => Decision::Converted { bound: bound.max(0.0), why },
            2 => Decision::Approximated { why },
            _ => Decision::Skipped { why },
        };
        Some((object, decision))
    })?;
    told.builds = from.list(|from| Some((from.u32()?, from.text()?, from.u64()?)))?;
    told.passes =
        from.list(|from| Some(PassPlan { name: from.text()?, needed: from.u32()? != 0, why: from.text()? }))?;
    (told.estimated_ms, told.bytes) = (from.f64()?, from.u64()?);
    let counters = from.list(|from| Some(Counter { name: keep(&from.text()?), count: from.u64()? }))?;
    for (place, counter) in told.counters.iter_mut().zip(counters) {
        *place = Some(counter);
    }
    for (name, time) in from.list(|from| Some((from.text()?, from.u64()?)))? {
        told.phases.add(keep(&name), Duration::from_nanos(time));
    }
    if from.u32()? == 1 {
        told.refusal = Some((from.u32()?, from.text()?));
    }
    Some(())
}

pub(super) fn log_message(line: &LogLine) -> Vec<u8> {
    let mut to = Writer::new(LOG);
    to.u32(line.severity as u32).u32(line.object.unwrap_or(u32::MAX)).text(&line.text);
    to.finish()
}

pub(super) fn get_log(from: &mut Reader<'_>, backend: &str) -> Option<LogLine> {
    let severity = match from.u32()? {
        0 => Severity::Debug,
        1 => Severity::Note,
        2 => Severity::Warning,
        _ => Severity::Error,
    };
    let object = from.u32()?;
    let object = (object != u32::MAX).then_some(object);
    Some(LogLine { backend: backend.to_owned(), severity, object, text: from.text()? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_told_is_read_back_and_cut_off_messages_are_refused() {
        let mut told =
            Told { bytes: 9, estimated_ms: 2.5, refusal: Some((3, "no".to_owned())), ..Told::default() };
        told.decisions.push((1, Decision::Converted { bound: 0.5, why: "a ä".to_owned() }));
        told.passes.push(PassPlan { name: "p".to_owned(), needed: true, why: "w".to_owned() });
        told.counters[0] = Some(Counter { name: "rays", count: 7 });
        told.phases.add("draw", Duration::from_nanos(11));
        let mut to = Writer::new(DONE);
        put_told(&mut to, &told);
        let bytes = to.finish();
        let mut read = Told::default();
        get_told(&mut Reader(&bytes[5..]), &mut read).unwrap();
        assert_eq!(
            (read.decisions, read.passes, read.counters),
            (told.decisions, told.passes, told.counters)
        );
        assert_eq!((read.bytes, read.estimated_ms, read.refusal), (9, 2.5, told.refusal));
        assert_eq!(read.phases.iter().collect::<Vec<_>>(), [("draw", Duration::from_nanos(11))]);
        for end in 5..bytes.len() {
            assert!(get_told(&mut Reader(&bytes[5..end]), &mut Told::default()).is_none(), "{end}");
        }
    }

    #[test]
    fn cameras_of_all_projections_are_read_back() {
        let table = WarpTable::new(2, 2, vec![DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X]).unwrap();
        for projection in [
            Projection::Perspective { fov_y: 0.7 },
            Projection::Orthographic { height: 2.0 },
            Projection::Fisheye { fov: 3.0 },
            Projection::Cylindrical { fov_x: 3.0, fov_y: 1.0 },
            Projection::Warp(Arc::new(table)),
        ] {
            let camera = Camera::look_at(DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO, DVec3::Y, projection);
            let mut to = Writer::new(RENDER);
            put_camera(&mut to, &camera);
            assert_eq!(get_camera(&mut Reader(&to.finish()[5..])), Some(camera));
        }
    }
}
