//! The steps of packets: which marked cells do their rays come to? One kernel, compiled for each kind of register.

use super::packet::{GridRays, Hits, Order, Packet};
use super::{Walk, lanes};
use crate::grid::Layer;
use polyptych_core::lanes::LANES;
#[cfg(target_arch = "x86_64")]
use polyptych_core::registers::Registers;

/// Where the walks of two packets came to, and how many cells and empty blocks they left.
pub(crate) type Found = ([Hits; 2], u32);

/// Goes on to the first marked cells of two packets, those at hand included. With AVX-512 both are one.
#[inline(always)]
pub(crate) fn find_marked(
    packets: &mut [Packet; 2],
    rays: &[GridRays; 2],
    layer: &Layer,
    order: Order,
) -> Found {
    #[cfg(target_arch = "x86_64")]
    match Registers::in_use() {
        Registers::Plain => {}
        width => {
            #[expect(
                unsafe_code,
                reason = "a kernel compiled for processor features can only be called so"
            )]
            // SAFETY: the processor has the features that the kernels were compiled for.
            return unsafe {
                match (width, order) {
                    (Registers::Avx512, Order::Exact) => widest::find::<true>(packets, rays, layer),
                    (Registers::Avx512, Order::Rounded) => widest::find::<false>(packets, rays, layer),
                    (_, Order::Exact) => wide::find::<true>(packets, rays, layer),
                    (_, Order::Rounded) => wide::find::<false>(packets, rays, layer),
                }
            };
        }
    }
    match order {
        Order::Exact => plain::find::<true>(packets, rays, layer),
        Order::Rounded => plain::find::<false>(packets, rays, layer),
    }
}

/// Does the same for one packet with each width of registers, beside another packet and after it, and holds the answers
/// against each other: no bit may depend on any of that.
#[cfg(test)]
pub(super) fn find_marked_in_all(
    (packet, rays): (&mut Packet, &GridRays),
    (other, other_rays): (&Packet, &GridRays),
    layer: &Layer,
    order: Order,
) -> Hits {
    let mut answers = Vec::new();
    for width in polyptych_core::registers::Registers::ALL {
        width.limit();
        for place in 0..2 {
            let (mut packets, mut both) = ([*other; 2], [*other_rays; 2]);
            (packets[place], both[place]) = (*packet, *rays);
            let (hits, steps) = find_marked(&mut packets, &both, layer, order);
            let [own, beside] = [place, 1 - place].map(|k| (hits[k], packets[k].cell, packets[k].entered));
            answers.push((own, beside, steps, packets[place]));
        }
    }
    for answer in &answers[1..] {
        let first = &answers[0];
        assert_eq!((answer.0, answer.1, answer.2), (first.0, first.1, first.2));
    }
    *packet = answers[0].3;
    answers[0].0.0
}

/// Leaves an empty block in double precision; returns the cell behind it and the axis of its face. Lanes that are in
/// doubt are few: each is taken by itself.
#[cold]
#[inline(never)]
fn leave(rays: &GridRays, lanes: u32, cell: [&[i32; 8]; 3], mask: &[i32; 8], next: [&mut [i32; 8]; 4]) {
    let [x, y, z, axis] = next;
    for lane in (0..LANES).filter(|lane| lanes >> lane & 1 == 1) {
        let cell = [cell[0][lane], cell[1][lane], cell[2][lane]];
        let size = [i32::MAX; 3];
        let mut walk = Walk { ray: rays.one(lane), size, cell, t: 0.0, entered: None, steps: 0 };
        walk.leave(mask[lane].count_ones());
        [x[lane], y[lane], z[lane]] = walk.cell;
        axis[lane] = walk.entered.map_or(3, |a| a as i32);
    }
}

/// The kernel, over operations that are in scope.
macro_rules! kernel {
    ($($feature:meta)?) => {
        use super::{Found, GridRays, Hits, Layer, Packet};
        use crate::occupancy::Occupancy;

        /// Returns the bits below a mask: numbers of children in their nodes, and words of the nodes.
        $(#[$feature])?
        #[inline]
        fn child([x, y, z]: [Ints; 3], node: Ints) -> (Ints, Ints) {
            let three = all(3);
            let bit = or(or(and(x, three), rise::<2>(and(y, three))), rise::<4>(and(z, all(1))));
            (or(rise::<1>(node), and(fall::<1>(z), all(1))), bit)
        }

        /// Tells which bits are set, and around which more is set in their octets.
        $(#[$feature])?
        #[inline]
        fn look(words: Ints, bit: Ints) -> (Mask, Mask) {
            let octet = all(Occupancy::OCTET as i32);
            let set = has_any(down(words, bit), all(1));
            (set, has_any(down(words, and(bit, all(0b0_1010))), octet))
        }

        $(#[$feature])?
        pub(super) fn find<const SURE: bool>(
            packets: &mut [Packet; 2],
            rays: &[GridRays; 2],
            layer: &Layer,
        ) -> Found {
            let (mut hits, mut steps) = ([Hits::default(); 2], 0);
            for first in (0..2).step_by(PACKETS) {
                let found = follow::<SURE>(&mut packets[first..first + PACKETS], &rays[first..], layer);
                for (own, bits) in [(0, found.0), (1, found.1)] {
                    for k in 0..PACKETS {
                        let bits = bits >> (8 * k) & 0xff;
                        let hits = &mut hits[first + k];
                        *(if own == 0 { &mut hits.marked } else { &mut hits.passed_empty }) = bits;
                    }
                }
                steps += found.2;
            }
            (hits, steps)
        }

        /// Follows the rays of as many packets as fill a register. Returns which met a marked cell, which passed empty
        /// ones before, and how many steps they took.
        $(#[$feature])?
        #[inline]
        fn follow<const SURE: bool>(packets: &mut [Packet], rays: &[GridRays], layer: &Layer) -> (u32, u32, u32) {
            macro_rules! load {
                ($of:ident, $p:ident => $value:expr) => {{
                    let mut given = [{ let $p = &packets[0]; $value }; PACKETS];
                    for k in 0..PACKETS {
                        given[k] = { let $p = &packets[k]; $value };
                    }
                    $of(given)
                }};
            }
            macro_rules! three {
                ($of:ident, $name:ident) => {
                    [load!($of, p => &p.$name[0]), load!($of, p => &p.$name[1]), load!($of, p => &p.$name[2])]
                };
            }
            let (origin, direction) = (three!(floats, origin), three!(floats, direction));
            let (inverse, fuzz) = (three!(floats, inverse), three!(floats, fuzz));
            let (slack, to) = (load!(floats, p => &p.slack), load!(floats, p => &p.to));
            let (flip, end, base) = (three!(ints, flip), three!(ints, end), three!(ints, base));
            let (mut cell, mut entered) = (three!(ints, cell), load!(ints, p => &p.entered));
            let mut active = [[0; 8]; PACKETS];
            for k in 0..PACKETS {
                for i in 0..8 {
                    active[k][i] = packets[k].active.0[i] as i32;
                }
            }
            let mut given = [&active[0]; PACKETS];
            for k in 0..PACKETS {
                given[k] = &active[k];
            }
            let mut left = has_any(ints(given), all(1));
            let (one, zero) = (all(1), all(0));
            let (row, slab) = (all(layer.row as i32), all(layer.slab as i32));
            let slots = &*layer.slots;
            let (top, middle) = (layer.masks.top.as_flattened(), layer.masks.middle.as_flattened());
            let bottom = layer.masks.bottom.as_flattened();
            let (mut marked, mut passed_empty, mut steps) = (0, 0, 0);
            let (mut chunk, mut slot) = (all(-1), zero);
            while bits(left) != 0 {
                // 1. Look the cells up.
                let [x, y, z] = [xor(cell[0], flip[0]), xor(cell[1], flip[1]), xor(cell[2], flip[2])];
                let next_chunk = add(fall::<6>(x), add(multiply(fall::<6>(y), row), multiply(fall::<6>(z), slab)));
                let (top_word, top_bit) = child([fall::<4>(x), fall::<4>(y), and(fall::<4>(z), all(3))], zero);
                let node = or(rise::<5>(top_word), top_bit);
                let (middle_word, middle_bit) = child([fall::<2>(x), fall::<2>(y), fall::<2>(z)], node);
                let middle_word = and(middle_word, all(0x7f));
                // Looking up is dear, and most steps end in the chunk that they began in.
                if bits(except(left, equal(chunk, next_chunk))) != 0 {
                    (chunk, slot) = (next_chunk, look_up(slots, next_chunk, left));
                }
                // One less than the edge of the empty block: of 4 or 8 cells, then of 16, 32 or 64, or of 1 or 2.
                let words = look_up(middle, or(rise::<7>(slot), middle_word), left);
                let (reaching, near) = look(words, middle_bit);
                let mut mask = pick(near, all(3), all(7));
                let bare = except(left, has_any(words, words));
                if bits(bare) != 0 {
                    let words = look_up(top, or(rise::<1>(slot), top_word), bare);
                    let (in_top, near) = look(words, top_bit);
                    // All slots but the first hold something.
                    let large = pick(has_any(slot, slot), pick(near, all(15), all(31)), all(63));
                    mask = pick(except(bare, in_top), large, mask);
                }
                if bits(both(reaching, left)) != 0 {
                    let node = or(rise::<5>(middle_word), middle_bit);
                    let (word, bit) = child([x, y, z], node);
                    let word = and(word, all(0x1fff));
                    let words = look_up(bottom, or(rise::<13>(slot), word), both(reaching, left));
                    let (set, near) = look(words, bit);
                    mask = pick(reaching, pick(near, zero, one), mask);
                    let met = both(both(reaching, set), left);
                    marked |= bits(met);
                    left = except(left, met);
                    if bits(left) == 0 {
                        break;
                    }
                }
                passed_empty |= bits(left);
                steps += bits(left).count_ones();
                // 2. Find the first of the three far planes of each block.
                let last = [or(cell[0], mask), or(cell[1], mask), or(cell[2], mask)];
                let far = [add(last[0], one), add(last[1], one), add(last[2], one)];
                let [tx, ty, tz] = [
                    times(minus(whole(subtract(far[0], base[0])), origin[0]), inverse[0]),
                    times(minus(whole(subtract(far[1], base[1])), origin[1]), inverse[1]),
                    times(minus(whole(subtract(far[2], base[2])), origin[2]), inverse[2]),
                ];
                let by_x = both(at_most(tx, ty), at_most(tx, tz));
                let by_y = except(at_most(ty, tz), by_x);
                let by_z = except(everywhere(), either(by_x, by_y));
                let by = [by_x, by_y, by_z];
                let t = choose(by_x, tx, choose(by_y, ty, tz));
                let mut axis = pick(by_x, zero, pick(by_y, one, all(2)));
                let goes = both(left, at_most(t, to));
                // 3. Find the cells behind them.
                let blur = choose(by_x, fuzz[0], choose(by_y, fuzz[1], fuzz[2]));
                let mut next = far;
                let mut unsure = except(left, left);
                for a in 0..3 {
                    let place = plus(origin[a], times(direction[a], t));
                    let near = add(nearest(minus(place, splat(0.5))), base[a]);
                    let aside = least(most(near, cell[a]), last[a]);
                    if SURE {
                        let within = minus(place, whole(subtract(aside, base[a])));
                        let slack = plus(slack, times(direction[a], blur));
                        let reached = either(less(slack, within), equal(aside, cell[a]));
                        let kept = less(within, minus(splat(1.0), slack));
                        unsure = either(unsure, except(goes, either(by[a], both(reached, kept))));
                    }
                    next[a] = pick(by[a], far[a], aside);
                }
                if SURE {
                    let lanes = bits(unsure);
                    if lanes != 0 {
                        let (cells, mask) = ([apart(cell[0]), apart(cell[1]), apart(cell[2])], apart(mask));
                        let [mut x, mut y, mut z, mut by] =
                            [apart(next[0]), apart(next[1]), apart(next[2]), apart(axis)];
                        for k in 0..PACKETS {
                            let cell = [&cells[0][k], &cells[1][k], &cells[2][k]];
                            let to = [&mut x[k], &mut y[k], &mut z[k], &mut by[k]];
                            super::leave(&rays[k], lanes >> (8 * k) & 0xff, cell, &mask[k], to);
                        }
                        next = [together(&x), together(&y), together(&z)];
                        axis = together(&by);
                    }
                }
                // 4. Go there, unless the grid or the ray ends.
                let within = both(below(next[0], end[0]), both(below(next[1], end[1]), below(next[2], end[2])));
                left = both(goes, within);
                for a in 0..3 {
                    cell[a] = pick(left, next[a], cell[a]);
                }
                entered = pick(left, axis, entered);
            }
            let (cells, entered) = ([apart(cell[0]), apart(cell[1]), apart(cell[2])], apart(entered));
            for k in 0..PACKETS {
                packets[k].cell = [cells[0][k], cells[1][k], cells[2][k]];
                packets[k].entered = entered[k];
            }
            (marked, passed_empty, steps)
        }

        $(#[$feature])?
        #[inline]
        fn together(all: &[[i32; 8]; PACKETS]) -> Ints {
            let mut given = [&all[0]; PACKETS];
            for k in 0..PACKETS {
                given[k] = &all[k];
            }
            ints(given)
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod widest {
    use super::lanes::widest::*;
    kernel!(target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,bmi1,bmi2"));
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::lanes::wide::*;
    kernel!(target_feature(enable = "avx2"));
}

mod plain {
    use super::lanes::plain::*;
    kernel!();
}
