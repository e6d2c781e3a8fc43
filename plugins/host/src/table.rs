//! Does a library's table of functions fit, and what does the back end say of itself?

#![expect(unsafe_code, reason = "the border to plugins")]

use crate::refusal::Refusal;
use crate::words::{keep, words};
use polyptych_core::framebuffer::Channels;
use polyptych_core::scene::ShapeKind;
use polyptych_core::seam::{BackendInfo, Parameter, ParameterKind, Value};
use polyptych_plugin_abi::{self as abi, PolyptychInfo, PolyptychParameter, PolyptychPlugin};
use std::ffi::c_char;
use std::path::{Path, PathBuf};

/// A library that was opened and fits. It stays open for ever.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// Where it lies.
    pub path: PathBuf,
    /// What the back end says of itself.
    pub info: BackendInfo,
    /// Kinds of shape that it takes.
    pub accepts: Vec<ShapeKind>,
    /// Version of the interface that it was built for.
    pub abi: [u32; 2],
    /// Names of the processor features that it needs.
    pub cpu: Vec<String>,
    pub(crate) table: PolyptychPlugin,
}

// SAFETY: the table's pointers lead to what the plugin keeps for ever and does not change; its functions may be called
// from any thread, by the contract of the header.
unsafe impl Send for Loaded {}
// SAFETY: as above.
unsafe impl Sync for Loaded {}

/// Bytes of structs in version 1.0: later versions add behind them, and less cuts a field in two.
const LEAST_TABLE: u32 = (std::mem::offset_of!(PolyptychPlugin, render) + size_of::<usize>()) as u32;
const LEAST_INFO: u32 = (std::mem::offset_of!(PolyptychInfo, parameters) + size_of::<usize>()) as u32;
const LEAST_PARAMETER: u32 =
    (std::mem::offset_of!(PolyptychParameter, quality_axis) + size_of::<u32>()) as u32;

/// Checks the table that a library returned.
///
/// # Safety
/// The table is null or readable as far as its size says, and what it points at is as the header says.
pub(crate) unsafe fn check(path: &Path, table: *const PolyptychPlugin) -> Result<Loaded, Refusal> {
    let path = path.to_path_buf();
    if table.is_null() {
        return Err(Refusal::NullTable { path });
    }
    // SAFETY: the first four words are there in every version.
    let [size, magic, major, minor] = unsafe { table.cast::<[u32; 4]>().read_unaligned() };
    if magic != abi::POLYPTYCH_MAGIC {
        return Err(Refusal::WrongMagic { path, magic });
    }
    if major != abi::POLYPTYCH_MAJOR {
        let ours = format!("{}.{}", abi::POLYPTYCH_MAJOR, abi::POLYPTYCH_MINOR);
        return Err(Refusal::OtherMajor { path, major, minor, ours });
    }
    let least = LEAST_TABLE;
    if size < least {
        return Err(Refusal::ShortTable { path, size, least });
    }
    // SAFETY: the caller's promise.
    let table = unsafe { abi::read(table) }.ok_or_else(|| Refusal::NullTable { path: path.clone() })?;
    let cpu = cpu_names(table.cpu);
    refuse_missing_cpu(&path, &cpu)?;
    for (there, function) in [
        (table.create.is_some(), "create"),
        (table.destroy.is_some(), "destroy"),
        (table.prepare.is_some(), "prepare"),
        (table.render.is_some(), "render"),
    ] {
        if !there {
            return Err(Refusal::NoFunction { path, function });
        }
    }
    let wrong = |what: String| Refusal::WrongInfo { path: path.clone(), what };
    // SAFETY: the caller's promise.
    let flat = unsafe { abi::read(table.info) }.ok_or_else(|| wrong("there is nothing".to_owned()))?;
    check_size(flat.size, LEAST_INFO).map_err(wrong)?;
    // SAFETY: the caller's promise.
    let info = unsafe { info(&flat) }.map_err(wrong)?;
    let accepts = kinds(flat.accepted_shapes);
    if !accepts.contains(&ShapeKind::Mesh) && !accepts.contains(&ShapeKind::Voxels) {
        return Err(wrong(
            "it takes neither meshes nor voxels, into which the others are converted".to_owned(),
        ));
    }
    Ok(Loaded { path, info, accepts, abi: [major, minor], cpu, table })
}

/// Names the processor features of a set; unknown bits by their number.
fn cpu_names(bits: u64) -> Vec<String> {
    let name = |bit: u32| match 1u64 << bit {
        abi::POLYPTYCH_CPU_AVX => "avx".to_owned(),
        abi::POLYPTYCH_CPU_AVX2 => "avx2".to_owned(),
        abi::POLYPTYCH_CPU_FMA => "fma".to_owned(),
        abi::POLYPTYCH_CPU_AVX512F => "avx512f".to_owned(),
        _ => format!("feature {bit}"),
    };
    (0..64).filter(|bit| bits >> bit & 1 == 1).map(name).collect()
}

/// Refuses where the processor lacks a feature.
pub(crate) fn refuse_missing_cpu(path: &Path, names: &[String]) -> Result<(), Refusal> {
    let missing: Vec<&str> = names.iter().map(String::as_str).filter(|name| !has_cpu(name)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(Refusal::MissingCpu { path: path.into(), features: missing.join(", ") })
}

fn has_cpu(name: &str) -> bool {
    #[cfg(target_arch = "x86_64")]
    match name {
        "avx" => return is_x86_feature_detected!("avx"),
        "avx2" => return is_x86_feature_detected!("avx2"),
        "fma" => return is_x86_feature_detected!("fma"),
        "avx512f" => return is_x86_feature_detected!("avx512f"),
        _ => {}
    }
    let _ = name;
    false
}

fn kinds(bits: u32) -> Vec<ShapeKind> {
    ShapeKind::ALL.into_iter().filter(|&kind| bits >> kind as u32 & 1 == 1).collect()
}

/// Tells whether a word may be the id of a back end.
pub(crate) fn is_id(id: &str) -> bool {
    (1..=64).contains(&id.len())
        && id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'-' || b == b'_')
}

fn check_size(size: u32, least: u32) -> Result<(), String> {
    if size < least { Err(format!("has {size} bytes, at least {least} are needed")) } else { Ok(()) }
}

unsafe fn info(flat: &PolyptychInfo) -> Result<BackendInfo, String> {
    // SAFETY: the plugin's text, as the header says.
    let [id, name, version] = unsafe { [words(flat.id), words(flat.name), words(flat.version)] };
    if !is_id(&id) {
        return Err(format!("`{id}` is no id: use lower-case letters, digits, `-` and `_`"));
    }
    if flat.parameter_count > 1000 {
        return Err(format!("{} parameters", flat.parameter_count));
    }
    let mut parameters = Vec::new();
    for index in 0..flat.parameter_count {
        if flat.parameters.is_null() {
            return Err(format!("{} parameters at no place", flat.parameter_count));
        }
        // SAFETY: the plugin has as many parameters as it says.
        let Some(parameter) = (unsafe { abi::read(abi::element(flat.parameters, index)) }) else { continue };
        check_size(parameter.size, LEAST_PARAMETER).map_err(|e| format!("parameter {index}: {e}"))?;
        // SAFETY: as above.
        let parameter =
            unsafe { self::parameter(&parameter) }.map_err(|e| format!("parameter {index}: {e}"))?;
        if parameters.iter().any(|p: &Parameter| p.name == parameter.name) {
            return Err(format!("there are two parameters `{}`", parameter.name));
        }
        parameters.push(parameter);
    }
    Ok(BackendInfo {
        id,
        name,
        version,
        native: kinds(flat.native_shapes),
        channels: Channels::from_bits(flat.channels as u8),
        photometric: flat.photometric != 0,
        parameters,
    })
}

unsafe fn parameter(flat: &PolyptychParameter) -> Result<Parameter, String> {
    // SAFETY: the plugin's text, as the header says.
    let [name, unit, help, tag, word] =
        unsafe { [flat.name, flat.unit, flat.help, flat.tag, flat.initial.text].map(|t| words(t)) };
    let kind = match flat.kind {
        abi::POLYPTYCH_BOOL => ParameterKind::Bool,
        abi::POLYPTYCH_INT => ParameterKind::Int { min: flat.least.integer, max: flat.most.integer },
        abi::POLYPTYCH_FLOAT => ParameterKind::Float { min: flat.least.number, max: flat.most.number },
        // SAFETY: as above.
        abi::POLYPTYCH_CHOICE => ParameterKind::Choice { choices: unsafe { choices(flat) }? },
        abi::POLYPTYCH_RGB => ParameterKind::Color,
        other => return Err(format!("`{name}` is of a kind ({other}) that this program does not know")),
    };
    let default = match kind {
        ParameterKind::Bool => Value::Bool(flat.initial.integer != 0),
        ParameterKind::Int { .. } => Value::Int(flat.initial.integer),
        ParameterKind::Float { .. } => Value::Float(flat.initial.number),
        ParameterKind::Choice { .. } | ParameterKind::Color | ParameterKind::Text => Value::Text(word),
    };
    let parameter = Parameter {
        name: keep(&name),
        kind,
        default,
        unit: keep(&unit),
        help: keep(&help),
        tag: keep(&tag),
        quality_axis: flat.quality_axis != 0,
    };
    check_parameter(&parameter)?;
    Ok(parameter)
}

/// Checks that a parameter has a name and that its default is allowed.
pub(crate) fn check_parameter(parameter: &Parameter) -> Result<(), String> {
    if parameter.name.is_empty() || parameter.name.contains(|c: char| c.is_whitespace() || c == '=') {
        return Err(format!("`{}` is no name", parameter.name));
    }
    parameter.parse(&parameter.default.to_string()).map(|_| ()).map_err(|e| format!("its default: {e}"))
}

unsafe fn choices(flat: &PolyptychParameter) -> Result<&'static [&'static str], String> {
    if flat.choices.is_null() || flat.choice_count == 0 || flat.choice_count > 1000 {
        return Err(format!("a choice of {} words", flat.choice_count));
    }
    let choice = |index: u32| {
        // SAFETY: the plugin has as many words as it says.
        let word: *const c_char = unsafe { flat.choices.add(index as usize).read() };
        // SAFETY: the plugin's text.
        keep(&unsafe { words(word) })
    };
    Ok((0..flat.choice_count).map(choice).collect::<Vec<_>>().leak())
}
