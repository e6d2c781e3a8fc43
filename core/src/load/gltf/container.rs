//! Takes a glTF file apart: the JSON text and the binary chunk of a `.glb`, checked before anything is parsed.

use super::document::{Asset, Document, Head};
use crate::load::error::{Fault, one_line};

/// Deepest nesting of the JSON text. The deepest of real files is 12; parsers recurse.
const DEEPEST: usize = 100;

/// Extensions that a file may require. All others would draw something else than the author meant.
const KNOWN: [&str; 5] = [
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Splits a file into its JSON text and its binary chunk.
pub(super) fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>), Fault> {
    if !bytes.starts_with(b"glTF") {
        let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        return match text.trim_ascii_start().first() {
            Some(b'{') => Ok((text, None)),
            Some(_) => Err(Fault::malformed("this is neither glTF JSON nor a .glb")
                .advise("check that it is a glTF file")),
            None => Err(Fault::malformed("the file is empty")),
        };
    }
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let (Some(version), Some(total)) = (word(4), word(8)) else {
        return Err(Fault::malformed("byte 4: the header is cut off"));
    };
    if version != 2 {
        return Err(Fault::unsupported(
            format!("byte 4: glTF version {version}, only 2 is read"),
            "export it as glTF 2.0",
        ));
    }
    if total as usize > bytes.len() || total < 20 {
        return Err(Fault::malformed(format!(
            "byte 8: the header says {total} bytes, the file has {}",
            bytes.len()
        )));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at < total as usize {
        let (Some(length), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(Fault::malformed(format!("byte {at}: a chunk header is cut off")));
        };
        let start = at + 8;
        let Some(chunk) = bytes.get(start..start.saturating_add(length as usize)) else {
            return Err(Fault::malformed(format!(
                "byte {at}: a chunk of {length} bytes goes past the end of the file"
            )));
        };
        match (&kind.to_le_bytes(), at) {
            (b"JSON", 12) => json = Some(chunk),
            (b"BIN\0", _) if binary.is_none() => binary = Some(chunk),
            _ => {}
        }
        at = start + length as usize;
    }
    match json {
        Some(json) => Ok((json, binary)),
        None => Err(Fault::malformed("byte 12: the first chunk is not JSON")),
    }
}

/// Parses the JSON text and checks its version and the extensions that it requires.
pub(super) fn parse(json: &[u8]) -> Result<Document, Fault> {
    check_depth(json)?;
    let document: Document = serde_json::from_slice(json).map_err(|error| {
        // A document of another version has other types: say that instead.
        if let Ok(Head { asset: Some(asset) }) = serde_json::from_slice(json)
            && let Err(fault) = check_version(&asset)
        {
            return fault;
        }
        let text = error.to_string();
        let cause = text.split(" at line ").next().unwrap_or(&text);
        Fault::malformed(format!("line {} column {} of the JSON: {cause}", error.line(), error.column()))
    })?;
    let Some(asset) = &document.asset else {
        return Err(Fault::malformed("field `asset` is missing"));
    };
    check_version(asset)?;
    for extension in &document.extensions_required {
        if extension == "KHR_draco_mesh_compression" || extension == "EXT_meshopt_compression" {
            let what = format!(
                "field `extensionsRequired`: the geometry is compressed ({extension}), which is not read"
            );
            return Err(Fault::unsupported(what, "export it without mesh compression"));
        }
        if !KNOWN.contains(&extension.as_str()) {
            let what = format!("field `extensionsRequired`: `{}` is not known", one_line(extension));
            return Err(Fault::unsupported(what, "export it without this extension"));
        }
    }
    Ok(document)
}

fn check_version(asset: &Asset) -> Result<(), Fault> {
    let wanted = asset.min_version.as_ref().unwrap_or(&asset.version);
    let readable = if asset.min_version.is_some() { wanted == "2.0" } else { wanted.starts_with("2.") };
    if readable {
        return Ok(());
    }
    let what = format!("field `asset`: glTF version {}, only 2.0 is read", one_line(wanted));
    Err(Fault::unsupported(what, "export it as glTF 2.0"))
}

/// Measures the nesting byte by byte, since the parser would recurse.
fn check_depth(json: &[u8]) -> Result<(), Fault> {
    let (mut depth, mut in_text, mut escaped) = (0usize, false, false);
    for (at, &byte) in json.iter().enumerate() {
        if in_text {
            (in_text, escaped) = (escaped || byte != b'"', !escaped && byte == b'\\');
            continue;
        }
        match byte {
            b'"' => in_text = true,
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > DEEPEST {
            return Err(Fault::malformed(format!(
                "byte {at} of the JSON: it is nested more than {DEEPEST} deep"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_in_text_are_no_nesting() {
        let text = format!("{{\"a\": \"{}\\\"{}\"}}", "[".repeat(500), "{".repeat(500));
        assert_eq!(check_depth(text.as_bytes()), Ok(()));
        assert!(check_depth("[".repeat(101).as_bytes()).is_err());
    }

    #[test]
    fn required_extensions_are_named() {
        let json = br#"{"asset":{"version":"2.0"},"extensionsRequired":["EXT_strange"]}"#;
        assert!(parse(json).err().unwrap().what().contains("`EXT_strange`"));
        let wrong = parse(b"{\"asset\":\n{\"version\":2}}").err().unwrap().what();
        assert!(wrong.starts_with("line 2 column 12 of the JSON: invalid type"), "{wrong}");
    }
}
