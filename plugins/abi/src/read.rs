//! How is a struct read that another version may have made?

#![expect(unsafe_code, reason = "the border to other languages")]

use super::*;

/// A struct that begins with its size and may be filled with zeros.
///
/// # Safety
/// The first field is the `u32` size, and all bytes 0 are a valid value.
pub unsafe trait SizeFirst: Copy {}

macro_rules! size_first {
    ($($name:ident)*) => { $(
        // SAFETY: begins with `size: u32`; all fields are numbers, pointers and optional functions, which may be 0.
        unsafe impl SizeFirst for $name {}
    )* };
}

size_first!(PolyptychParameter PolyptychInfo PolyptychCamera PolyptychMesh PolyptychPrimitive PolyptychVoxels
    PolyptychFreeForm PolyptychHeightField PolyptychVolume PolyptychShape PolyptychObject PolyptychMaterial
    PolyptychTexture PolyptychLight PolyptychEnvironment PolyptychScene PolyptychNeed PolyptychTarget PolyptychHost
    PolyptychPlugin);

/// Reads a struct: what it holds as far as both sides know it, and 0 for the rest. Nothing for null.
///
/// # Safety
/// `from` is null or points at a struct of this kind of any version, of as many bytes as its first field says.
#[must_use]
pub unsafe fn read<T: SizeFirst>(from: *const T) -> Option<T> {
    if from.is_null() {
        return None;
    }
    // SAFETY: the caller promises a struct, which begins with its size.
    let size = unsafe { from.cast::<u32>().read_unaligned() } as usize;
    let mut whole = std::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: no more bytes are copied than either side has; zeros and what a version wrote are valid (`SizeFirst`).
    unsafe {
        std::ptr::copy_nonoverlapping(
            from.cast::<u8>(),
            whole.as_mut_ptr().cast::<u8>(),
            size.min(size_of::<T>()),
        );
        Some(whole.assume_init())
    }
}

/// Returns where an element of an array is: the first one's size is the distance of them all.
///
/// # Safety
/// `first` points at an array of more than `index` structs of this kind.
#[must_use]
pub unsafe fn element<T: SizeFirst>(first: *const T, index: u32) -> *const T {
    // SAFETY: the caller promises that the array reaches that far.
    unsafe {
        let size = first.cast::<u32>().read_unaligned() as usize;
        first.byte_add(size * index as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shorter_struct_is_filled_with_zeros_and_a_longer_one_is_cut() {
        // Two elements of a version whose struct has 12 bytes, then one of a version with 40.
        let short = [12u32, 7, 8, 12, 9, 10];
        let first = short.as_ptr().cast::<PolyptychPrimitive>();
        // SAFETY: the array holds two structs of 12 bytes, as they say.
        let second = unsafe { read(element(first, 1)) }.unwrap();
        assert_eq!((second.size, second.kind, second.numbers), (12, 9, [f64::from_bits(10), 0.0, 0.0, 0.0]));
        let mut long = [0u64; 8];
        long[0] = 64 | 6 << 32;
        long[4] = 2.5f64.to_bits();
        long[5] = u64::MAX;
        // SAFETY: 64 bytes, as they say.
        let primitive = unsafe { read(long.as_ptr().cast::<PolyptychPrimitive>()) }.unwrap();
        assert_eq!((primitive.kind, primitive.numbers[3]), (6, 2.5));
        // SAFETY: null is allowed.
        assert!(unsafe { read(std::ptr::null::<PolyptychPrimitive>()) }.is_none());
    }
}
