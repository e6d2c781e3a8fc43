//! What does the library say of itself: the table, the info and the parameters, made once and kept for ever.

#![expect(unsafe_code, reason = "the border to the host")]

use crate::abi::{self, PolyptychInfo, PolyptychParameter, PolyptychPlugin, PolyptychValue};
use crate::host::text;
use crate::instance::Instance;
use crate::panics;
use polyptych_core::scene::ShapeKind;
use polyptych_core::seam::{BackendInfo, Parameter, ParameterKind, Renderer, Value};
use std::ffi::c_char;
use std::sync::OnceLock;

/// The table of a library.
pub struct Table(PolyptychPlugin);

// SAFETY: everything that the table points at is leaked and never written again.
unsafe impl Send for Table {}
// SAFETY: as above.
unsafe impl Sync for Table {}

/// Makes the table of a back end at the first call; null where the back end panics while it is made.
pub fn table<B: Renderer + Default + 'static>(
    table: &'static OnceLock<Table>,
    accepts: &[ShapeKind],
) -> *const PolyptychPlugin {
    panics::listen();
    let made = panics::caught(|| table.get_or_init(|| make::<B>(accepts)));
    made.map_or(std::ptr::null(), |table| &raw const table.0)
}

fn make<B: Renderer + Default + 'static>(accepts: &[ShapeKind]) -> Table {
    Table(PolyptychPlugin {
        size: size_of::<PolyptychPlugin>() as u32,
        magic: abi::POLYPTYCH_MAGIC,
        major: abi::POLYPTYCH_MAJOR,
        minor: abi::POLYPTYCH_MINOR,
        cpu: needed_cpu(),
        info: leak(flat_info(B::default().info(), accepts)),
        create: Some(Instance::<B>::create),
        destroy: Some(Instance::<B>::destroy),
        plan: Some(Instance::<B>::plan),
        prepare: Some(Instance::<B>::prepare),
        render: Some(Instance::<B>::render),
    })
}

/// Tells which features the compiler was allowed to use everywhere.
fn needed_cpu() -> u64 {
    let features = [
        (cfg!(target_feature = "avx"), abi::POLYPTYCH_CPU_AVX),
        (cfg!(target_feature = "avx2"), abi::POLYPTYCH_CPU_AVX2),
        (cfg!(target_feature = "fma"), abi::POLYPTYCH_CPU_FMA),
        (cfg!(target_feature = "avx512f"), abi::POLYPTYCH_CPU_AVX512F),
    ];
    features.into_iter().filter(|(used, _)| *used).fold(0, |all, (_, bit)| all | bit)
}

fn bits(kinds: &[ShapeKind]) -> u32 {
    kinds.iter().fold(0, |all, &kind| all | 1 << kind as u32)
}

fn flat_info(info: &BackendInfo, accepts: &[ShapeKind]) -> PolyptychInfo {
    let parameters: Vec<PolyptychParameter> = crossing(info).map(flat_parameter).collect();
    PolyptychInfo {
        size: size_of::<PolyptychInfo>() as u32,
        native_shapes: bits(&info.native),
        accepted_shapes: bits(accepts),
        channels: u32::from(info.channels.bits()),
        photometric: u32::from(info.photometric),
        parameter_count: parameters.len() as u32,
        id: leak_text(&info.id),
        name: leak_text(&info.name),
        version: leak_text(&info.version),
        parameters: parameters.leak().as_ptr(),
    }
}

const NO_VALUE: PolyptychValue = PolyptychValue { integer: 0, number: 0.0, text: std::ptr::null() };

/// Lists the parameters that cross the border: lines of text do not.
pub(crate) fn crossing(info: &BackendInfo) -> impl Iterator<Item = &Parameter> {
    info.parameters.iter().filter(|p| p.kind != ParameterKind::Text)
}

fn flat_parameter(parameter: &Parameter) -> PolyptychParameter {
    let int = |v: i64| PolyptychValue { integer: v, ..NO_VALUE };
    let float = |v: f64| PolyptychValue { number: v, ..NO_VALUE };
    let (kind, least, most, choices) = match parameter.kind {
        ParameterKind::Bool => (abi::POLYPTYCH_BOOL, NO_VALUE, NO_VALUE, &[][..]),
        ParameterKind::Int { min, max } => (abi::POLYPTYCH_INT, int(min), int(max), &[][..]),
        ParameterKind::Float { min, max } => (abi::POLYPTYCH_FLOAT, float(min), float(max), &[][..]),
        ParameterKind::Choice { choices } => (abi::POLYPTYCH_CHOICE, NO_VALUE, NO_VALUE, choices),
        ParameterKind::Color => (abi::POLYPTYCH_RGB, NO_VALUE, NO_VALUE, &[][..]),
        ParameterKind::Text => unreachable!("lines of text do not cross the border"),
    };
    let initial = match &parameter.default {
        Value::Bool(v) => int(i64::from(*v)),
        Value::Int(v) => PolyptychValue { number: *v as f64, ..int(*v) },
        Value::Float(v) => float(*v),
        Value::Text(v) => {
            let index = choices.iter().position(|c| c == v).unwrap_or(0);
            PolyptychValue { text: leak_text(v), ..int(index as i64) }
        }
    };
    let words: Vec<*const c_char> = choices.iter().map(|c| leak_text(c)).collect();
    PolyptychParameter {
        size: size_of::<PolyptychParameter>() as u32,
        kind,
        name: leak_text(parameter.name),
        unit: leak_text(parameter.unit),
        help: leak_text(parameter.help),
        tag: leak_text(parameter.tag),
        initial,
        least,
        most,
        choice_count: words.len() as u32,
        choices: words.leak().as_ptr(),
        quality_axis: u32::from(parameter.quality_axis),
    }
}

fn leak<T>(value: T) -> *const T {
    Box::leak(Box::new(value))
}

fn leak_text(words: &str) -> *const c_char {
    text(words).into_raw()
}
