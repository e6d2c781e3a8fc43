//! Where are the masks of a grid's chunks? In one table for each level, so that many rays look their words up at once.

use crate::occupancy::{Nodes, NodesMut, Occupancy};

/// Masks of chunks, each in a slot of its own; chunks that are alike may share one.
#[derive(Clone, Debug)]
pub(crate) struct Masks {
    pub(crate) top: Vec<[u32; Occupancy::TOP]>,
    pub(crate) middle: Vec<[u32; Occupancy::MIDDLE]>,
    pub(crate) bottom: Vec<[u32; Occupancy::BOTTOM]>,
    /// How many places of layers show each slot.
    owners: Vec<u32>,
    free: Vec<u32>,
}

impl Default for Masks {
    fn default() -> Self {
        let mut masks = Self::NONE;
        masks.add();
        masks
    }
}

impl Masks {
    /// No slot at all, not even that of nothing: holds the place of masks while they are changed.
    pub(crate) const NONE: Self = Self {
        top: Vec::new(),
        middle: Vec::new(),
        bottom: Vec::new(),
        owners: Vec::new(),
        free: Vec::new(),
    };

    /// The slot in which nothing is marked, and the only one: what became empty goes back there.
    pub(crate) const NOTHING: u32 = 0;

    /// Slots whose words can be counted in 31 bits; larger grids are walked ray by ray.
    const MOST_COUNTED: usize = (1 << 31) / Occupancy::BOTTOM;

    /// Tells whether each word of the tables has a number of 31 bits.
    pub(crate) fn are_counted(&self) -> bool {
        self.owners.len() <= Self::MOST_COUNTED
    }

    /// Returns the masks in a slot.
    #[inline(always)]
    pub(crate) fn nodes(&self, slot: u32) -> Nodes<'_> {
        let slot = slot as usize;
        Nodes { top: &self.top[slot], middle: &self.middle[slot], bottom: &self.bottom[slot] }
    }

    /// Returns a slot for masks, which nobody shows yet; that of nothing where nothing is marked.
    pub(crate) fn put(&mut self, masks: Option<&Occupancy>) -> u32 {
        let Some(masks) = masks else { return Self::NOTHING };
        let slot = self.add();
        let at = slot as usize;
        (self.top[at], self.middle[at], self.bottom[at]) = (masks.top, masks.middle, masks.bottom);
        slot
    }

    /// Finds or makes a slot; what it holds is of no use.
    fn add(&mut self) -> u32 {
        if let Some(slot) = self.free.pop() {
            return slot;
        }
        self.top.push([0; Occupancy::TOP]);
        self.middle.push([0; Occupancy::MIDDLE]);
        self.bottom.push([0; Occupancy::BOTTOM]);
        self.owners.push(0);
        (self.owners.len() - 1) as u32
    }

    /// Makes place for as many more.
    pub(crate) fn reserve(&mut self, more: usize) {
        let more = more.saturating_sub(self.free.len());
        self.top.reserve(more);
        self.middle.reserve(more);
        self.bottom.reserve(more);
        self.owners.reserve(more);
    }

    /// Notes that one more place shows a slot.
    pub(crate) fn show(&mut self, slot: u32) {
        self.owners[slot as usize] += 1;
    }

    /// Notes that a place shows a slot no more.
    pub(crate) fn hide(&mut self, slot: u32) {
        let owners = &mut self.owners[slot as usize];
        *owners -= 1;
        if *owners == 0 && slot != Self::NOTHING {
            self.free.push(slot);
        }
    }

    /// Counts anew which slots are shown.
    pub(crate) fn count(&mut self, layers: [&[u32]; 2]) {
        self.owners.fill(0);
        for &slot in layers.into_iter().flatten() {
            self.owners[slot as usize] += 1;
        }
        self.free = (1..self.owners.len() as u32).filter(|&slot| self.owners[slot as usize] == 0).collect();
    }

    /// Changes what one place shows, or a copy where others show the same; returns where it is then.
    pub(crate) fn change(&mut self, slot: u32, change: impl FnOnce(&mut NodesMut<'_>)) -> u32 {
        let mut own = slot;
        if slot == Self::NOTHING || self.owners[slot as usize] > 1 {
            own = self.add();
            let (from, to) = (slot as usize, own as usize);
            (self.top[to], self.middle[to]) = (self.top[from], self.middle[from]);
            self.bottom.copy_within(from..=from, to);
            self.show(own);
            self.hide(slot);
        }
        let at = own as usize;
        let (top, middle) = (&mut self.top[at], &mut self.middle[at]);
        let mut nodes = NodesMut { top, middle, bottom: &mut self.bottom[at] };
        change(&mut nodes);
        if *nodes.top != [0; Occupancy::TOP] {
            return own;
        }
        self.hide(own);
        self.show(Self::NOTHING);
        Self::NOTHING
    }

    /// Returns how many slots hold masks.
    pub(crate) fn used(&self) -> u64 {
        (self.owners.len() - 1 - self.free.len()) as u64
    }
}
