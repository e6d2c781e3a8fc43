//! Which stretches of rows show nothing? Most pictures show bodies before a background: what goes over pixels passes the
//! background at once.

use crate::eight::{lacks, union};
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::seam::{Cancelled, Control};

/// Columns of a stretch.
pub(crate) const SPAN: usize = 64;
/// Stretches that are looked at by one worker at a time.
const GRAIN: usize = 1024;

/// What the pixels of a stretch show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stretch {
    /// None of them anything.
    #[default]
    Empty,
    /// Some of them something.
    Mixed,
    /// Each of them something.
    Full,
}

/// The stretches of a picture.
#[derive(Default)]
pub(crate) struct Spans {
    stretches: Vec<Stretch>,
    columns: usize,
}

impl Spans {
    /// Looks at a picture.
    pub(crate) fn fill(&mut self, visible: &Framebuffer, control: &Control<'_>) -> Result<(), Cancelled> {
        let (width, height) = (visible.width() as usize, visible.height() as usize);
        self.columns = width.div_ceil(SPAN);
        self.stretches.resize(self.columns * height, Stretch::Empty);
        let (columns, ids) = (self.columns, visible.id());
        control.for_each_mut(&mut self.stretches, GRAIN, &|index, stretch| {
            let (row, left) = (index / columns * width, index % columns * SPAN);
            let ids = &ids[row + left..row + width.min(left + SPAN)];
            *stretch = match (union::<SPAN>(ids) == 0, lacks::<SPAN>(ids)) {
                (true, _) => Stretch::Empty,
                (false, true) => Stretch::Mixed,
                (false, false) => Stretch::Full,
            };
        })
    }

    /// Returns the stretches of a row.
    #[inline(always)]
    pub(crate) fn row(&self, y: u32) -> &[Stretch] {
        &self.stretches[y as usize * self.columns..][..self.columns]
    }

    pub(crate) fn bytes(&self) -> u64 {
        self.stretches.capacity() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use polyptych_core::framebuffer::{Channel, Channels};
    use polyptych_core::parallel::OneThread;

    #[test]
    fn stretches_end_with_their_row() {
        let mut picture = Framebuffer::new(130, 3, Channels::of(&[Channel::Id]));
        picture.for_each_band(&OneThread, 3, &|band| {
            band.id[130..194].fill(7);
            band.id[193] = 0;
            band.id[2 * 130 - 2..].fill(1);
        });
        let mut spans = Spans::default();
        spans.fill(&picture, &Control::simple()).unwrap();
        let [empty, mixed, full] = [Stretch::Empty, Stretch::Mixed, Stretch::Full];
        assert_eq!(spans.row(0), [empty; 3]);
        assert_eq!(spans.row(1), [mixed, empty, full]);
        assert_eq!(spans.row(2)[0], full);
    }
}
