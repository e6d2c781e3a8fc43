//! Is a file a library at all, and is it whole? Opening a cut-off one can end the program, so it is asked before.

use crate::refusal::Refusal;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// Checks the head of a library's file.
pub(crate) fn check(path: &Path) -> Result<(), Refusal> {
    let unreadable = |e: std::io::Error| Refusal::Unreadable { path: path.into(), what: e.to_string() };
    let mut file = File::open(path).map_err(unreadable)?;
    let metadata = file.metadata().map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(Refusal::NotALibrary { path: path.into(), what: "it is no file".to_owned() });
    }
    let mut head = [0u8; 64];
    match file.read_exact(&mut head) {
        Ok(()) => {}
        Err(e) if e.kind() == ErrorKind::UnexpectedEof => {
            let what = format!("it has {} bytes", metadata.len());
            return Err(Refusal::NotALibrary { path: path.into(), what });
        }
        Err(e) => return Err(unreadable(e)),
    }
    check_head(path, &head, metadata.len())
}

#[cfg(not(any(target_os = "linux", target_os = "android", target_os = "freebsd")))]
fn check_head(_: &Path, _: &[u8; 64], _: u64) -> Result<(), Refusal> {
    Ok(())
}

/// Checks the head of an ELF file: the table of sections stands at its end, so the head says how long it is.
#[cfg(any(target_os = "linux", target_os = "android", target_os = "freebsd"))]
fn check_head(path: &Path, head: &[u8; 64], length: u64) -> Result<(), Refusal> {
    let no = |what: &str| Err(Refusal::NotALibrary { path: path.into(), what: what.to_owned() });
    if &head[..4] != b"\x7fELF" {
        return no("it does not begin like one");
    }
    let word = if cfg!(target_pointer_width = "64") { 2 } else { 1 };
    let order = if cfg!(target_endian = "little") { 1 } else { 2 };
    if head[4] != word || head[5] != order {
        return no("it is made for another kind of machine");
    }
    if word == 1 {
        return Ok(());
    }
    let u16_at = |i: usize| u64::from(u16::from_ne_bytes([head[i], head[i + 1]]));
    let u64_at = |i: usize| {
        let mut bytes = [0u8; 8];
        bytes.copy_from_slice(&head[i..i + 8]);
        u64::from_ne_bytes(bytes)
    };
    if u16_at(16) != 3 {
        return no("it is a program or an object file, not a shared library");
    }
    let machine = match std::env::consts::ARCH {
        "x86_64" => 62,
        "aarch64" => 183,
        "riscv64" => 243,
        _ => u16_at(18),
    };
    if u16_at(18) != machine {
        return no("it is made for another processor");
    }
    let segments = u64_at(32).saturating_add(u16_at(54) * u16_at(56));
    let sections = u64_at(40).saturating_add(u16_at(58) * u16_at(60));
    let wanted = segments.max(sections);
    if wanted > length {
        return Err(Refusal::Truncated { path: path.into(), length, wanted });
    }
    Ok(())
}
