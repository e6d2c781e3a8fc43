//! What does the file beside a library say, so that it can be listed without being run?

use crate::refusal::Refusal;
use crate::table::{Loaded, check_parameter, is_id};
use crate::words::keep;
use polyptych_core::framebuffer::{Channel, Channels};
use polyptych_core::scene::ShapeKind;
use polyptych_core::seam::{BackendInfo, Parameter, ParameterKind, Value};
use polyptych_plugin_abi as abi;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Most bytes of a manifest.
const LONGEST: u64 = 1 << 20;

/// A library's manifest: what its table says, as text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Short name on the command line.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Its version.
    pub version: String,
    /// Version of the interface: `1.0`.
    pub abi: String,
    /// The library's file beside the manifest; without a dot the system's own form of it: `lib<name>.so`.
    pub library: String,
    /// Shapes that are drawn as given.
    #[serde(default)]
    pub native: Vec<ShapeKind>,
    /// Shapes that are taken; all others are converted before.
    pub accepts: Vec<ShapeKind>,
    /// Channels that it delivers.
    pub channels: Vec<Channel>,
    /// Whether its colors are those of the lighting equation.
    #[serde(default)]
    pub photometric: bool,
    /// Processor features that it needs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cpu: Vec<String>,
    /// Its parameters.
    #[serde(default, skip_serializing_if = "Vec::is_empty", rename = "parameter")]
    pub parameters: Vec<ParameterEntry>,
}

/// A parameter in a manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(missing_docs, reason = "as in `Parameter`")]
pub struct ParameterEntry {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: String,
    pub default: Value,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min: Option<Value>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max: Option<Value>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub choices: Vec<String>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    #[serde(default)]
    pub help: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub tag: String,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub quality_axis: bool,
}

impl Manifest {
    /// Reads a manifest.
    ///
    /// # Errors
    /// Says in one line what is wrong.
    pub fn read(path: &Path) -> Result<Self, Refusal> {
        let unreadable = |e: std::io::Error| Refusal::Unreadable { path: path.into(), what: e.to_string() };
        let wrong = |what: String| Refusal::WrongManifest { path: path.into(), what };
        if path.metadata().map_err(unreadable)?.len() > LONGEST {
            return Err(wrong(format!("is longer than {LONGEST} bytes")));
        }
        let text = std::fs::read_to_string(path).map_err(unreadable)?;
        let manifest: Self = toml::from_str(&text).map_err(|e| {
            let line = e.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            wrong(format!("line {line}: {}", e.message().replace('\n', " ")))
        })?;
        manifest.check().map_err(wrong)?;
        let (major, minor) = manifest.abi_version().unwrap_or_default();
        if major != abi::POLYPTYCH_MAJOR {
            let ours = format!("{}.{}", abi::POLYPTYCH_MAJOR, abi::POLYPTYCH_MINOR);
            return Err(Refusal::OtherMajor { path: path.into(), major, minor, ours });
        }
        Ok(manifest)
    }

    /// Describes an opened library.
    #[must_use]
    pub fn of(loaded: &Loaded) -> Self {
        let info = &loaded.info;
        let [major, minor] = loaded.abi;
        let file = loaded.path.file_name().unwrap_or_default().to_string_lossy();
        let plain = file
            .strip_prefix(std::env::consts::DLL_PREFIX)
            .and_then(|f| f.strip_suffix(std::env::consts::DLL_SUFFIX))
            .filter(|f| !f.contains('.'));
        Self {
            id: info.id.clone(),
            name: info.name.clone(),
            version: info.version.clone(),
            abi: format!("{major}.{minor}"),
            library: plain.unwrap_or(&file).to_owned(),
            native: info.native.clone(),
            accepts: loaded.accepts.clone(),
            channels: info.channels.iter().collect(),
            photometric: info.photometric,
            cpu: loaded.cpu.clone(),
            parameters: info.parameters.iter().map(ParameterEntry::of).collect(),
        }
    }

    /// Writes the manifest as text.
    #[must_use]
    pub fn to_text(&self) -> String {
        toml::to_string(self).unwrap_or_default()
    }

    /// Returns what the back end says of itself.
    #[must_use]
    pub fn info(&self) -> BackendInfo {
        BackendInfo {
            id: self.id.clone(),
            name: self.name.clone(),
            version: self.version.clone(),
            native: self.native.clone(),
            channels: Channels::of(&self.channels),
            photometric: self.photometric,
            parameters: self.parameters.iter().filter_map(|p| p.parameter().ok()).collect(),
        }
    }

    /// Returns where the library lies, given where the manifest does.
    #[must_use]
    pub fn library_path(&self, manifest: &Path) -> PathBuf {
        let file = if self.library.contains('.') {
            self.library.clone()
        } else {
            format!("{}{}{}", std::env::consts::DLL_PREFIX, self.library, std::env::consts::DLL_SUFFIX)
        };
        manifest.with_file_name(file)
    }

    /// Names what an opened library says otherwise.
    pub(crate) fn differs_from(&self, said: &Self) -> Option<&'static str> {
        let fields = [
            (self.id != said.id, "the id"),
            (self.version != said.version, "the version"),
            (self.abi != said.abi, "the version of the interface"),
            (self.native != said.native, "the shapes that it draws"),
            (self.accepts != said.accepts, "the shapes that it takes"),
            (self.info().channels != said.info().channels, "the channels"),
            (self.photometric != said.photometric, "its colors"),
            (self.info().parameters != said.info().parameters, "the parameters"),
        ];
        fields.into_iter().find(|(differs, _)| *differs).map(|(_, what)| what)
    }

    fn abi_version(&self) -> Option<(u32, u32)> {
        let (major, minor) = self.abi.split_once('.')?;
        Some((major.parse().ok()?, minor.parse().ok()?))
    }

    fn check(&self) -> Result<(), String> {
        if !is_id(&self.id) {
            return Err(format!("`{}` is no id: use lower-case letters, digits, `-` and `_`", self.id));
        }
        if self.abi_version().is_none() {
            return Err(format!("abi `{}`: write major.minor, as in \"1.0\"", self.abi));
        }
        if self.library.is_empty() || self.library.contains(['/', '\\']) || self.library.starts_with('.') {
            return Err(format!(
                "library `{}`: must be the name of a file beside the manifest",
                self.library
            ));
        }
        for entry in &self.parameters {
            entry
                .parameter()
                .and_then(|p| check_parameter(&p))
                .map_err(|e| format!("parameter `{}`: {e}", entry.name))?;
        }
        Ok(())
    }
}

impl ParameterEntry {
    fn of(parameter: &Parameter) -> Self {
        let (kind, min, max, choices) = match parameter.kind {
            ParameterKind::Bool => ("bool", None, None, &[][..]),
            ParameterKind::Int { min, max } => ("int", Some(Value::Int(min)), Some(Value::Int(max)), &[][..]),
            ParameterKind::Float { min, max } => {
                ("float", Some(Value::Float(min)), Some(Value::Float(max)), &[][..])
            }
            ParameterKind::Choice { choices } => ("choice", None, None, choices),
            ParameterKind::Color => ("color", None, None, &[][..]),
            ParameterKind::Text => ("text", None, None, &[][..]),
        };
        Self {
            name: parameter.name.to_owned(),
            kind: kind.to_owned(),
            default: parameter.default.clone(),
            min,
            max,
            choices: choices.iter().map(|&c| c.to_owned()).collect(),
            unit: parameter.unit.to_owned(),
            help: parameter.help.to_owned(),
            tag: parameter.tag.to_owned(),
            quality_axis: parameter.quality_axis,
        }
    }

    fn parameter(&self) -> Result<Parameter, String> {
        let int = |v: &Option<Value>, end: i64| match v {
            None => Ok(end),
            Some(Value::Int(v)) => Ok(*v),
            Some(other) => Err(format!("{other} is no whole number")),
        };
        let float = |v: &Option<Value>, end: f64| match v {
            None => Ok(end),
            Some(Value::Int(v)) => Ok(*v as f64),
            Some(Value::Float(v)) => Ok(*v),
            Some(other) => Err(format!("{other} is no number")),
        };
        let kind = match self.kind.as_str() {
            "bool" => ParameterKind::Bool,
            "int" => ParameterKind::Int { min: int(&self.min, i64::MIN)?, max: int(&self.max, i64::MAX)? },
            "float" => {
                ParameterKind::Float { min: float(&self.min, f64::MIN)?, max: float(&self.max, f64::MAX)? }
            }
            "choice" => {
                let choices: Vec<&'static str> = self.choices.iter().map(|c| keep(c)).collect();
                ParameterKind::Choice { choices: choices.leak() }
            }
            "color" => ParameterKind::Color,
            "text" => ParameterKind::Text,
            other => return Err(format!("type `{other}`: use bool, int, float, choice or color")),
        };
        Ok(Parameter {
            name: keep(&self.name),
            kind,
            default: self.default.clone(),
            unit: keep(&self.unit),
            help: keep(&self.help),
            tag: keep(&self.tag),
            quality_axis: self.quality_axis,
        })
    }
}
