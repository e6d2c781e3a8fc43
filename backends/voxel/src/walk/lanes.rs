//! What is reckoned for eight or sixteen rays at once, in AVX-512 registers, in AVX2 registers and in plain numbers? The
//! same operations under the same names: a kernel is written once over any of them.
//!
//! A packet is eight rays; `PACKETS` of them fill a register. Words are looked up by the processor's own gathers, which
//! no code over plain arrays compiles to.

/// Operations on registers of 512 bits, with a bit of a mask for each ray.
#[cfg(target_arch = "x86_64")]
pub(super) mod widest {
    use std::arch::x86_64::*;

    pub(in super::super) const PACKETS: usize = 2;
    pub(in super::super) type Floats = __m512;
    pub(in super::super) type Ints = __m512i;
    pub(in super::super) type Mask = __mmask16;

    macro_rules! operations {
        ($($name:ident($($a:ident: $t:ty),*) -> $r:ty { $value:expr })*) => {
            $(
                #[inline]
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,bmi1,bmi2")]
                pub(in super::super) fn $name($($a: $t),*) -> $r {
                    $value
                }
            )*
        };
    }
    operations! {
        floats(f: [&[f32; 8]; 2]) -> Floats {
            _mm512_setr_ps(
                f[0][0], f[0][1], f[0][2], f[0][3], f[0][4], f[0][5], f[0][6], f[0][7],
                f[1][0], f[1][1], f[1][2], f[1][3], f[1][4], f[1][5], f[1][6], f[1][7],
            )
        }
        ints(i: [&[i32; 8]; 2]) -> Ints {
            _mm512_setr_epi32(
                i[0][0], i[0][1], i[0][2], i[0][3], i[0][4], i[0][5], i[0][6], i[0][7],
                i[1][0], i[1][1], i[1][2], i[1][3], i[1][4], i[1][5], i[1][6], i[1][7],
            )
        }
        splat(f: f32) -> Floats { _mm512_set1_ps(f) }
        all(i: i32) -> Ints { _mm512_set1_epi32(i) }
        whole(i: Ints) -> Floats { _mm512_cvtepi32_ps(i) }
        nearest(f: Floats) -> Ints { _mm512_cvtps_epi32(f) }
        plus(a: Floats, b: Floats) -> Floats { _mm512_add_ps(a, b) }
        minus(a: Floats, b: Floats) -> Floats { _mm512_sub_ps(a, b) }
        times(a: Floats, b: Floats) -> Floats { _mm512_mul_ps(a, b) }
        at_most(a: Floats, b: Floats) -> Mask { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b) }
        less(a: Floats, b: Floats) -> Mask { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b) }
        choose(mask: Mask, yes: Floats, no: Floats) -> Floats { _mm512_mask_mov_ps(no, mask, yes) }
        pick(mask: Mask, yes: Ints, no: Ints) -> Ints { _mm512_mask_mov_epi32(no, mask, yes) }
        add(a: Ints, b: Ints) -> Ints { _mm512_add_epi32(a, b) }
        subtract(a: Ints, b: Ints) -> Ints { _mm512_sub_epi32(a, b) }
        multiply(a: Ints, b: Ints) -> Ints { _mm512_mullo_epi32(a, b) }
        and(a: Ints, b: Ints) -> Ints { _mm512_and_si512(a, b) }
        or(a: Ints, b: Ints) -> Ints { _mm512_or_si512(a, b) }
        xor(a: Ints, b: Ints) -> Ints { _mm512_xor_si512(a, b) }
        down(a: Ints, by: Ints) -> Ints { _mm512_srlv_epi32(a, by) }
        least(a: Ints, b: Ints) -> Ints { _mm512_min_epi32(a, b) }
        most(a: Ints, b: Ints) -> Ints { _mm512_max_epi32(a, b) }
        equal(a: Ints, b: Ints) -> Mask { _mm512_cmpeq_epi32_mask(a, b) }
        below(a: Ints, b: Ints) -> Mask { _mm512_cmplt_epi32_mask(a, b) }
        has_any(a: Ints, bits: Ints) -> Mask { _mm512_test_epi32_mask(a, bits) }
        both(a: Mask, b: Mask) -> Mask { a & b }
        either(a: Mask, b: Mask) -> Mask { a | b }
        except(a: Mask, b: Mask) -> Mask { a & !b }
        everywhere() -> Mask { u16::MAX }
        bits(mask: Mask) -> u32 { u32::from(mask) }
    }

    /// Shifts bits down by as many for all.
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(in super::super) fn fall<const BY: u32>(a: Ints) -> Ints {
        _mm512_srli_epi32::<BY>(a)
    }

    /// Shifts bits up by as many for all.
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(in super::super) fn rise<const BY: u32>(a: Ints) -> Ints {
        _mm512_slli_epi32::<BY>(a)
    }

    /// Looks words of a table up; zero for rays that do not ask, and for words that are not there.
    #[inline]
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,bmi1,bmi2")]
    pub(in super::super) fn look_up(table: &[u32], at: Ints, asks: Mask) -> Ints {
        let end = all(table.len().min(i32::MAX as usize) as i32);
        let asks = asks & _mm512_cmplt_epu32_mask(at, end);
        #[expect(unsafe_code, reason = "words can only be gathered so")]
        // SAFETY: only words of the table are read: numbers of all others were taken out of the mask, and no number is
        // above 2^31.
        unsafe {
            _mm512_mask_i32gather_epi32::<4>(_mm512_setzero_si512(), asks, at, table.as_ptr().cast())
        }
    }

    /// Takes a register apart.
    #[inline]
    #[target_feature(enable = "avx512f")]
    pub(in super::super) fn apart(a: Ints) -> [[i32; 8]; PACKETS] {
        let mut all = [[0; 8]; PACKETS];
        #[expect(unsafe_code, reason = "a register can only be stored so")]
        // SAFETY: there is place for sixteen numbers, and the store asks for no alignment.
        unsafe {
            _mm512_storeu_si512(all.as_mut_ptr().cast(), a);
        }
        all
    }
}

/// Operations on registers of 256 bits.
#[cfg(target_arch = "x86_64")]
pub(super) mod wide {
    use std::arch::x86_64::*;

    pub(in super::super) const PACKETS: usize = 1;
    pub(in super::super) type Floats = __m256;
    pub(in super::super) type Ints = __m256i;
    pub(in super::super) type Mask = __m256i;

    macro_rules! operations {
        ($($name:ident($($a:ident: $t:ty),*) -> $r:ty { $value:expr })*) => {
            $(
                #[inline]
                #[target_feature(enable = "avx2")]
                pub(in super::super) fn $name($($a: $t),*) -> $r {
                    $value
                }
            )*
        };
    }
    operations! {
        floats(f: [&[f32; 8]; 1]) -> Floats {
            _mm256_setr_ps(f[0][0], f[0][1], f[0][2], f[0][3], f[0][4], f[0][5], f[0][6], f[0][7])
        }
        ints(i: [&[i32; 8]; 1]) -> Ints {
            _mm256_setr_epi32(i[0][0], i[0][1], i[0][2], i[0][3], i[0][4], i[0][5], i[0][6], i[0][7])
        }
        splat(f: f32) -> Floats { _mm256_set1_ps(f) }
        all(i: i32) -> Ints { _mm256_set1_epi32(i) }
        whole(i: Ints) -> Floats { _mm256_cvtepi32_ps(i) }
        nearest(f: Floats) -> Ints { _mm256_cvtps_epi32(f) }
        plus(a: Floats, b: Floats) -> Floats { _mm256_add_ps(a, b) }
        minus(a: Floats, b: Floats) -> Floats { _mm256_sub_ps(a, b) }
        times(a: Floats, b: Floats) -> Floats { _mm256_mul_ps(a, b) }
        at_most(a: Floats, b: Floats) -> Mask { _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) }
        less(a: Floats, b: Floats) -> Mask { _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) }
        choose(mask: Mask, yes: Floats, no: Floats) -> Floats { _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(mask)) }
        pick(mask: Mask, yes: Ints, no: Ints) -> Ints { _mm256_blendv_epi8(no, yes, mask) }
        add(a: Ints, b: Ints) -> Ints { _mm256_add_epi32(a, b) }
        subtract(a: Ints, b: Ints) -> Ints { _mm256_sub_epi32(a, b) }
        multiply(a: Ints, b: Ints) -> Ints { _mm256_mullo_epi32(a, b) }
        and(a: Ints, b: Ints) -> Ints { _mm256_and_si256(a, b) }
        or(a: Ints, b: Ints) -> Ints { _mm256_or_si256(a, b) }
        xor(a: Ints, b: Ints) -> Ints { _mm256_xor_si256(a, b) }
        down(a: Ints, by: Ints) -> Ints { _mm256_srlv_epi32(a, by) }
        least(a: Ints, b: Ints) -> Ints { _mm256_min_epi32(a, b) }
        most(a: Ints, b: Ints) -> Ints { _mm256_max_epi32(a, b) }
        equal(a: Ints, b: Ints) -> Mask { _mm256_cmpeq_epi32(a, b) }
        below(a: Ints, b: Ints) -> Mask { _mm256_cmpgt_epi32(b, a) }
        has_any(a: Ints, bits: Ints) -> Mask {
            except(all(-1), _mm256_cmpeq_epi32(_mm256_and_si256(a, bits), _mm256_setzero_si256()))
        }
        both(a: Mask, b: Mask) -> Mask { _mm256_and_si256(a, b) }
        either(a: Mask, b: Mask) -> Mask { _mm256_or_si256(a, b) }
        except(a: Mask, b: Mask) -> Mask { _mm256_andnot_si256(b, a) }
        everywhere() -> Mask { _mm256_set1_epi32(-1) }
        bits(mask: Mask) -> u32 { _mm256_movemask_ps(_mm256_castsi256_ps(mask)) as u32 }
    }

    /// Shifts bits down by as many for all.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(in super::super) fn fall<const BY: i32>(a: Ints) -> Ints {
        _mm256_srli_epi32::<BY>(a)
    }

    /// Shifts bits up by as many for all.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(in super::super) fn rise<const BY: i32>(a: Ints) -> Ints {
        _mm256_slli_epi32::<BY>(a)
    }

    /// Looks words of a table up; zero for rays that do not ask, and for words that are not there.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(in super::super) fn look_up(table: &[u32], at: Ints, asks: Mask) -> Ints {
        let end = all(table.len().min(i32::MAX as usize) as i32);
        let is_there = _mm256_and_si256(below(at, end), _mm256_cmpgt_epi32(at, all(-1)));
        let asks = _mm256_and_si256(asks, is_there);
        #[expect(unsafe_code, reason = "words can only be gathered so")]
        // SAFETY: only words of the table are read: numbers of all others were taken out of the mask.
        unsafe {
            _mm256_mask_i32gather_epi32::<4>(_mm256_setzero_si256(), table.as_ptr().cast(), at, asks)
        }
    }

    /// Takes a register apart.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(in super::super) fn apart(a: Ints) -> [[i32; 8]; PACKETS] {
        let mut all = [[0; 8]; PACKETS];
        #[expect(unsafe_code, reason = "a register can only be stored so")]
        // SAFETY: there is place for eight numbers, and the store asks for no alignment.
        unsafe {
            _mm256_storeu_si256(all.as_mut_ptr().cast(), a);
        }
        all
    }
}

/// The same on arrays.
pub(super) mod plain {
    pub(in super::super) const PACKETS: usize = 1;
    pub(in super::super) type Floats = [f32; 8];
    pub(in super::super) type Ints = [i32; 8];
    pub(in super::super) type Mask = [i32; 8];

    macro_rules! operations {
        ($($name:ident($($a:ident: $t:ty),*) -> $r:ty { |$i:ident| $value:expr })*) => {
            $(
                #[inline(always)]
                pub(in super::super) fn $name($($a: $t),*) -> $r {
                    std::array::from_fn(|$i| $value)
                }
            )*
        };
    }

    fn mask(is: bool) -> i32 {
        -i32::from(is)
    }

    operations! {
        floats(f: [&[f32; 8]; 1]) -> Floats { |i| f[0][i] }
        ints(all: [&[i32; 8]; 1]) -> Ints { |i| all[0][i] }
        splat(f: f32) -> Floats { |_i| f }
        all(a: i32) -> Ints { |_i| a }
        whole(a: Ints) -> Floats { |i| a[i] as f32 }
        nearest(f: Floats) -> Ints { |i| f[i].round_ties_even() as i32 }
        plus(a: Floats, b: Floats) -> Floats { |i| a[i] + b[i] }
        minus(a: Floats, b: Floats) -> Floats { |i| a[i] - b[i] }
        times(a: Floats, b: Floats) -> Floats { |i| a[i] * b[i] }
        at_most(a: Floats, b: Floats) -> Mask { |i| mask(a[i] <= b[i]) }
        less(a: Floats, b: Floats) -> Mask { |i| mask(a[i] < b[i]) }
        choose(mask: Mask, yes: Floats, no: Floats) -> Floats { |i| if mask[i] < 0 { yes[i] } else { no[i] } }
        pick(mask: Mask, yes: Ints, no: Ints) -> Ints { |i| if mask[i] < 0 { yes[i] } else { no[i] } }
        add(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_add(b[i]) }
        subtract(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_sub(b[i]) }
        multiply(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_mul(b[i]) }
        and(a: Ints, b: Ints) -> Ints { |i| a[i] & b[i] }
        or(a: Ints, b: Ints) -> Ints { |i| a[i] | b[i] }
        xor(a: Ints, b: Ints) -> Ints { |i| a[i] ^ b[i] }
        down(a: Ints, by: Ints) -> Ints { |i| (a[i] as u32).wrapping_shr(by[i] as u32) as i32 }
        least(a: Ints, b: Ints) -> Ints { |i| a[i].min(b[i]) }
        most(a: Ints, b: Ints) -> Ints { |i| a[i].max(b[i]) }
        equal(a: Ints, b: Ints) -> Mask { |i| mask(a[i] == b[i]) }
        below(a: Ints, b: Ints) -> Mask { |i| mask(a[i] < b[i]) }
        has_any(a: Ints, bits: Ints) -> Mask { |i| mask(a[i] & bits[i] != 0) }
        both(a: Mask, b: Mask) -> Mask { |i| a[i] & b[i] }
        either(a: Mask, b: Mask) -> Mask { |i| a[i] | b[i] }
        except(a: Mask, b: Mask) -> Mask { |i| a[i] & !b[i] }
        everywhere() -> Mask { |_i| -1 }
    }

    pub(in super::super) fn bits(mask: Mask) -> u32 {
        (0..8).map(|i| u32::from(mask[i] < 0) << i).sum()
    }

    pub(in super::super) fn fall<const BY: u32>(a: Ints) -> Ints {
        down(a, all(BY as i32))
    }

    pub(in super::super) fn rise<const BY: u32>(a: Ints) -> Ints {
        std::array::from_fn(|i| a[i] << BY)
    }

    pub(in super::super) fn look_up(table: &[u32], at: Ints, asks: Mask) -> Ints {
        let word = |i: usize| table.get(at[i] as usize).map_or(0, |&word| word as i32);
        std::array::from_fn(|i| if asks[i] < 0 { word(i) } else { 0 })
    }

    pub(in super::super) fn apart(a: Ints) -> [[i32; 8]; PACKETS] {
        [a]
    }
}
