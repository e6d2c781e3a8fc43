//! How wide are the processor's registers? A kernel is written once over [`lanes`](crate::lanes), compiled for each
//! width by [`for_registers!`](crate::for_registers), and chosen at run time; its bytes do not depend on the width.

use std::sync::atomic::{AtomicU8, Ordering};

/// The instructions that kernels are compiled for, each with all those before.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Registers {
    /// What every processor has.
    Plain,
    /// 256 bits: AVX2, BMI1 and BMI2.
    Avx2,
    /// 512 bits and masks: AVX-512 F, BW, DQ and VL.
    Avx512,
}

/// Asks for a value to be brought near, for it will be read soon; it is not waited for.
#[inline(always)]
pub fn fetch<T>(value: &T) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        #[expect(unsafe_code, reason = "the instruction takes a place by its address")]
        // SAFETY: nothing is read or written, and every processor of this kind has the instruction.
        unsafe {
            _mm_prefetch::<_MM_HINT_T0>(std::ptr::from_ref(value).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = value;
}

impl Registers {
    /// All, narrow ones first.
    pub const ALL: [Self; 3] = [Self::Plain, Self::Avx2, Self::Avx512];

    /// Returns the name by which `POLYPTYCH_REGISTERS` asks for it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Returns the widest that the processor has.
    #[must_use]
    pub fn of_processor() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            if has!("avx2") && has!("bmi1") && has!("bmi2") {
                let wider = has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl");
                return if wider { Self::Avx512 } else { Self::Avx2 };
            }
        }
        Self::Plain
    }

    /// Returns those that kernels use: the processor's widest, or less where the environment's `POLYPTYCH_REGISTERS`
    /// or [`Registers::limit`] say so.
    #[must_use]
    #[inline]
    pub fn in_use() -> Self {
        match IN_USE.load(Ordering::Relaxed) {
            0 => Self::Plain,
            1 => Self::Avx2,
            2 => Self::Avx512,
            _ => Self::find(),
        }
    }

    /// Keeps all kernels of the process to these or narrower ones: for tests and measurements.
    pub fn limit(self) {
        IN_USE.store(self.min(Self::of_processor()) as u8, Ordering::Relaxed);
    }

    #[cold]
    fn find() -> Self {
        let asked = std::env::var("POLYPTYCH_REGISTERS").ok();
        let limit = Self::ALL.into_iter().find(|r| Some(r.name()) == asked.as_deref());
        limit.unwrap_or(Self::Avx512).limit();
        Self::in_use()
    }
}

/// A number of [`Registers`], or another one where nobody has asked yet.
static IN_USE: AtomicU8 = AtomicU8::new(u8::MAX);

/// Writes a function that calls the form of a kernel that is compiled for the widest registers in use. The kernel
/// itself is named last; it and what it calls for every pixel must be `#[inline(always)]`. A kernel that AVX-512 does
/// not make faster names two forms, and has AVX2 also where there is more.
///
/// ```
/// use polyptych_core::for_registers;
/// use polyptych_core::lanes::F32x8;
///
/// for_registers! {
///     /// Adds eight numbers to others.
///     fn add(sum: &mut F32x8, more: F32x8) = add_512, add_256, add_here;
/// }
///
/// #[inline(always)]
/// fn add_here(sum: &mut F32x8, more: F32x8) {
///     *sum = *sum + more;
/// }
///
/// let mut sum = F32x8::splat(1.0);
/// add(&mut sum, F32x8::splat(2.0));
/// assert_eq!(sum, F32x8::splat(3.0));
/// ```
#[macro_export]
macro_rules! for_registers {
    ($(#[$about:meta])* $seen:vis fn $name:ident $(<$life:lifetime>)? (&mut $self:ident $(, $arg:ident: $ty:ty)* $(,)?)
        $(-> $to:ty)? = $avx512:ident, $avx2:ident, $here:ident;) => {
        $crate::for_registers! {
            @form [$(#[$about])*] [$seen] $name [$($life)?] [&mut $self,] [$self,] [$($arg: $ty),*] [$(-> $to)?]
            [Self::$avx512] [Self::$avx2] [Self::$here] $avx512 $avx2
        }
    };
    ($(#[$about:meta])* $seen:vis fn $name:ident $(<$life:lifetime>)? (&$($of:lifetime)? $self:ident $(, $arg:ident: $ty:ty)* $(,)?)
        $(-> $to:ty)? = $avx512:ident, $avx2:ident, $here:ident;) => {
        $crate::for_registers! {
            @form [$(#[$about])*] [$seen] $name [$($life)?] [&$($of)? $self,] [$self,] [$($arg: $ty),*] [$(-> $to)?]
            [Self::$avx512] [Self::$avx2] [Self::$here] $avx512 $avx2
        }
    };
    ($(#[$about:meta])* $seen:vis fn $name:ident (&$self:ident $(, $arg:ident: $ty:ty)* $(,)?)
        $(-> $to:ty)? = $avx2:ident, $here:ident;) => {
        $(#[$about])*
        #[allow(unsafe_code, reason = "a kernel compiled for processor features can only be called so")]
        $seen fn $name(&$self $(, $arg: $ty)*) $(-> $to)? {
            #[cfg(target_arch = "x86_64")]
            if $crate::registers::Registers::in_use() > $crate::registers::Registers::Plain {
                // SAFETY: the processor has the features that the kernel was compiled for.
                return unsafe { $self.$avx2($($arg),*) };
            }
            $self.$here($($arg),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2")]
        fn $avx2(&$self $(, $arg: $ty)*) $(-> $to)? {
            $self.$here($($arg),*)
        }
    };
    ($(#[$about:meta])* $seen:vis fn $name:ident $(<$life:lifetime>)? ($($arg:ident: $ty:ty),* $(,)?)
        $(-> $to:ty)? = $avx512:ident, $avx2:ident, $here:ident;) => {
        $crate::for_registers! {
            @form [$(#[$about])*] [$seen] $name [$($life)?] [] [] [$($arg: $ty),*] [$(-> $to)?]
            [$avx512] [$avx2] [$here] $avx512 $avx2
        }
    };
    (@form [$($about:tt)*] [$seen:vis] $name:ident [$($life:lifetime)?] [$($me:tt)*] [$($pass:tt)*] [$($arg:ident: $ty:ty),*] [$($to:tt)*]
        [$($call512:tt)*] [$($call2:tt)*] [$($here:tt)*] $avx512:ident $avx2:ident) => {
        $($about)*
        #[allow(unsafe_code, reason = "a kernel compiled for processor features can only be called so")]
        $seen fn $name $(<$life>)? ($($me)* $($arg: $ty),*) $($to)* {
            #[cfg(target_arch = "x86_64")]
            match $crate::registers::Registers::in_use() {
                // SAFETY: the processor has the features that the kernel was compiled for.
                $crate::registers::Registers::Avx512 => return unsafe { $($call512)*($($pass)* $($arg),*) },
                // SAFETY: as above.
                $crate::registers::Registers::Avx2 => return unsafe { $($call2)*($($pass)* $($arg),*) },
                $crate::registers::Registers::Plain => {}
            }
            $($here)*($($pass)* $($arg),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,bmi1,bmi2")]
        fn $avx512 $(<$life>)? ($($me)* $($arg: $ty),*) $($to)* {
            $($here)*($($pass)* $($arg),*)
        }

        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx2,bmi1,bmi2")]
        fn $avx2 $(<$life>)? ($($me)* $($arg: $ty),*) $($to)* {
            $($here)*($($pass)* $($arg),*)
        }
    };
}

#[cfg(test)]
mod tests {
    use super::Registers;

    #[test]
    fn a_limit_holds_and_no_processor_gets_more_than_it_has() {
        let all = Registers::of_processor();
        for limit in Registers::ALL {
            limit.limit();
            assert_eq!(Registers::in_use(), limit.min(all));
        }
    }
}
