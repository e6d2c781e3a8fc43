//! What is reckoned for eight rays at once, in AVX2 registers and in plain numbers? The same operations twice, under
//! the same names: a kernel is written once over either.

/// Operations on registers of 256 bits.
#[cfg(target_arch = "x86_64")]
pub(super) mod wide {
    use std::arch::x86_64::*;

    pub(in super::super) type Floats = __m256;
    pub(in super::super) type Ints = __m256i;

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
        floats(f: &[f32; 8]) -> Floats { _mm256_setr_ps(f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7]) }
        ints(i: &[i32; 8]) -> Ints { _mm256_setr_epi32(i[0], i[1], i[2], i[3], i[4], i[5], i[6], i[7]) }
        splat(f: f32) -> Floats { _mm256_set1_ps(f) }
        all(i: i32) -> Ints { _mm256_set1_epi32(i) }
        whole(i: Ints) -> Floats { _mm256_cvtepi32_ps(i) }
        nearest(f: Floats) -> Ints { _mm256_cvtps_epi32(f) }
        plus(a: Floats, b: Floats) -> Floats { _mm256_add_ps(a, b) }
        minus(a: Floats, b: Floats) -> Floats { _mm256_sub_ps(a, b) }
        times(a: Floats, b: Floats) -> Floats { _mm256_mul_ps(a, b) }
        at_most(a: Floats, b: Floats) -> Ints { _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) }
        less(a: Floats, b: Floats) -> Ints { _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) }
        choose(mask: Ints, yes: Floats, no: Floats) -> Floats { _mm256_blendv_ps(no, yes, _mm256_castsi256_ps(mask)) }
        pick(mask: Ints, yes: Ints, no: Ints) -> Ints { _mm256_blendv_epi8(no, yes, mask) }
        add(a: Ints, b: Ints) -> Ints { _mm256_add_epi32(a, b) }
        subtract(a: Ints, b: Ints) -> Ints { _mm256_sub_epi32(a, b) }
        multiply(a: Ints, b: Ints) -> Ints { _mm256_mullo_epi32(a, b) }
        and(a: Ints, b: Ints) -> Ints { _mm256_and_si256(a, b) }
        or(a: Ints, b: Ints) -> Ints { _mm256_or_si256(a, b) }
        xor(a: Ints, b: Ints) -> Ints { _mm256_xor_si256(a, b) }
        without(a: Ints, b: Ints) -> Ints { _mm256_andnot_si256(b, a) }
        down(a: Ints, by: Ints) -> Ints { _mm256_srlv_epi32(a, by) }
        least(a: Ints, b: Ints) -> Ints { _mm256_min_epi32(a, b) }
        most(a: Ints, b: Ints) -> Ints { _mm256_max_epi32(a, b) }
        equal(a: Ints, b: Ints) -> Ints { _mm256_cmpeq_epi32(a, b) }
        below(a: Ints, b: Ints) -> Ints { _mm256_cmpgt_epi32(b, a) }
        bits(mask: Ints) -> u32 { _mm256_movemask_ps(_mm256_castsi256_ps(mask)) as u32 }
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

    /// Takes a register apart.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(in super::super) fn apart(a: Ints) -> [i32; 8] {
        let mut all = [0; 8];
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
    pub(in super::super) type Floats = [f32; 8];
    pub(in super::super) type Ints = [i32; 8];

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
        floats(f: &[f32; 8]) -> Floats { |i| f[i] }
        ints(all: &[i32; 8]) -> Ints { |i| all[i] }
        splat(f: f32) -> Floats { |_i| f }
        all(a: i32) -> Ints { |_i| a }
        whole(a: Ints) -> Floats { |i| a[i] as f32 }
        nearest(f: Floats) -> Ints { |i| f[i].round_ties_even() as i32 }
        plus(a: Floats, b: Floats) -> Floats { |i| a[i] + b[i] }
        minus(a: Floats, b: Floats) -> Floats { |i| a[i] - b[i] }
        times(a: Floats, b: Floats) -> Floats { |i| a[i] * b[i] }
        at_most(a: Floats, b: Floats) -> Ints { |i| mask(a[i] <= b[i]) }
        less(a: Floats, b: Floats) -> Ints { |i| mask(a[i] < b[i]) }
        choose(mask: Ints, yes: Floats, no: Floats) -> Floats { |i| if mask[i] < 0 { yes[i] } else { no[i] } }
        pick(mask: Ints, yes: Ints, no: Ints) -> Ints { |i| if mask[i] < 0 { yes[i] } else { no[i] } }
        add(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_add(b[i]) }
        subtract(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_sub(b[i]) }
        multiply(a: Ints, b: Ints) -> Ints { |i| a[i].wrapping_mul(b[i]) }
        and(a: Ints, b: Ints) -> Ints { |i| a[i] & b[i] }
        or(a: Ints, b: Ints) -> Ints { |i| a[i] | b[i] }
        xor(a: Ints, b: Ints) -> Ints { |i| a[i] ^ b[i] }
        without(a: Ints, b: Ints) -> Ints { |i| a[i] & !b[i] }
        down(a: Ints, by: Ints) -> Ints { |i| (a[i] as u32).wrapping_shr(by[i] as u32) as i32 }
        least(a: Ints, b: Ints) -> Ints { |i| a[i].min(b[i]) }
        most(a: Ints, b: Ints) -> Ints { |i| a[i].max(b[i]) }
        equal(a: Ints, b: Ints) -> Ints { |i| mask(a[i] == b[i]) }
        below(a: Ints, b: Ints) -> Ints { |i| mask(a[i] < b[i]) }
    }

    pub(in super::super) fn bits(mask: Ints) -> u32 {
        (0..8).map(|i| u32::from(mask[i] < 0) << i).sum()
    }

    pub(in super::super) fn fall<const BY: u32>(a: Ints) -> Ints {
        down(a, all(BY as i32))
    }

    pub(in super::super) fn rise<const BY: u32>(a: Ints) -> Ints {
        std::array::from_fn(|i| a[i] << BY)
    }

    pub(in super::super) fn apart(a: Ints) -> [i32; 8] {
        a
    }
}
