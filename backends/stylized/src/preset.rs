//! What does a named style hold: values for parameters, and a line on what it should evoke?

use crate::info::parameters;
use polyptych_core::seam::{Parameter, Settings, Value};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// A style as data: what a RON file in `assets/styles` holds. Parameters that it does not name keep their defaults.
///
/// ```
/// # use polyptych_stylized::Preset;
/// let pencil = Preset::builtin("pencil").unwrap();
/// assert_eq!(Preset::parse(&pencil.to_ron()).unwrap(), pencil);
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Preset {
    /// What a picture in this style should evoke, in one line.
    pub evokes: String,
    /// Values of parameters by their names.
    pub settings: BTreeMap<String, Value>,
}

/// Why a style cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum StyleError {
    #[error("there is no style `{name}`: use one of {all}, or name a .ron file")]
    Unknown { name: String, all: String },
    #[error("{file}: {reason}")]
    File { file: String, reason: String },
    #[error("{place}: {reason}")]
    Malformed { place: String, reason: String },
}

/// Most bytes of a style file: the largest of ours has 2,000.
const LARGEST: u64 = 1 << 20;

/// The styles that come with the program; the first is the default.
pub const STYLES: &[&str] = &["gooch", "toon", "pencil", "ink", "blueprint", "comic"];

/// Their files, in that order.
const FILES: [&str; 6] = [
    include_str!("../../../assets/styles/gooch.ron"),
    include_str!("../../../assets/styles/toon.ron"),
    include_str!("../../../assets/styles/pencil.ron"),
    include_str!("../../../assets/styles/ink.ron"),
    include_str!("../../../assets/styles/blueprint.ron"),
    include_str!("../../../assets/styles/comic.ron"),
];

impl Preset {
    /// Returns a style that comes with the program.
    ///
    /// # Errors
    /// Lists the names when there is none of that name.
    pub fn builtin(name: &str) -> Result<Self, StyleError> {
        let unknown = || StyleError::Unknown { name: name.to_owned(), all: STYLES.join(", ") };
        let index = STYLES.iter().position(|&s| s == name).ok_or_else(unknown)?;
        Self::parse(FILES[index])
    }

    /// Returns the style of that name, or in the file of that name if it ends in `.ron`.
    ///
    /// # Errors
    /// Says in one line what is wrong with name or file.
    pub fn named(name: &str) -> Result<Self, StyleError> {
        if name.ends_with(".ron") { Self::load(Path::new(name)) } else { Self::builtin(name) }
    }

    /// Reads a style from RON and checks every value.
    ///
    /// # Errors
    /// Names the line, or the parameter and what is allowed for it.
    pub fn parse(text: &str) -> Result<Self, StyleError> {
        let preset: Self = ron::from_str(text).map_err(|e| StyleError::Malformed {
            place: format!("line {}, column {}", e.span.start.line, e.span.start.col),
            reason: e.code.to_string(),
        })?;
        let (declared, mut settings) = (parameters(), Settings::default());
        for (name, value) in &preset.settings {
            let refuse = |reason: String| StyleError::Malformed { place: format!("`{name}`"), reason };
            if ["preset", "style", "styles"].contains(&name.as_str()) {
                return Err(refuse("a style cannot name another".to_owned()));
            }
            settings
                .set("stylized", &declared, name, &value.to_string())
                .map_err(|e| refuse(e.to_string()))?;
        }
        Ok(preset)
    }

    /// Reads a style from a file.
    ///
    /// # Errors
    /// Says in one line what is wrong with it and where.
    pub fn load(file: &Path) -> Result<Self, StyleError> {
        let name = file.display().to_string();
        let refuse = |reason: String| StyleError::File { file: name.clone(), reason };
        let length = std::fs::metadata(file).map_err(|e| refuse(e.to_string()))?.len();
        if length > LARGEST {
            return Err(refuse(format!("a style of {length} bytes: at most {LARGEST} are read")));
        }
        let text = std::fs::read_to_string(file).map_err(|e| refuse(e.to_string()))?;
        Self::parse(&text).map_err(|e| refuse(e.to_string()))
    }

    /// Collects a style from what was set: the preset that settings name with their own values over it.
    ///
    /// # Errors
    /// When they name a style that is none.
    pub fn of(settings: &Settings, evokes: &str) -> Result<Self, StyleError> {
        let declared = parameters();
        let mut preset = Self::chosen(settings, &declared)?;
        for (name, value) in settings.iter() {
            if !["preset", "style", "styles"].contains(&name) {
                preset.settings.insert(name.to_owned(), value.clone());
            }
        }
        preset.evokes = evokes.to_owned();
        Ok(preset)
    }

    /// Returns the style that settings name: a file, or else a preset.
    pub(crate) fn chosen(settings: &Settings, declared: &[Parameter]) -> Result<Self, StyleError> {
        match settings.text(declared, "style") {
            "" => Self::builtin(settings.text(declared, "preset")),
            name => Self::named(name),
        }
    }

    /// Writes the style as RON.
    #[must_use]
    pub fn to_ron(&self) -> String {
        let pretty = ron::ser::PrettyConfig::new().struct_names(true);
        ron::ser::to_string_pretty(self, pretty).unwrap_or_default() + "\n"
    }

    /// Lays settings over the style: the values that a picture is drawn with.
    ///
    /// # Errors
    /// When a value of the style is not allowed.
    pub(crate) fn under(&self, over: &Settings, declared: &[Parameter]) -> Result<Settings, StyleError> {
        let mut all = Settings::default();
        let own = self.settings.iter().map(|(name, value)| (name.as_str(), value));
        for (name, value) in own.chain(over.iter()) {
            let refuse = |reason: String| StyleError::Malformed { place: format!("`{name}`"), reason };
            all.set("stylized", declared, name, &value.to_string()).map_err(|e| refuse(e.to_string()))?;
        }
        Ok(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_style_is_read_and_says_what_it_evokes() {
        for name in STYLES {
            let preset = Preset::builtin(name).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert!(preset.evokes.len() > 20 && !preset.evokes.contains('\n'), "{name}");
            assert_eq!(Preset::parse(&preset.to_ron()).unwrap(), preset, "{name}");
        }
    }

    #[test]
    fn the_first_style_is_what_the_parameters_are_by_default() {
        let (preset, declared) = (Preset::builtin(STYLES[0]).unwrap(), parameters());
        for (name, value) in &preset.settings {
            let default = &declared.iter().find(|p| p.name == name).unwrap().default;
            assert_eq!(value.to_string(), default.to_string(), "{name}");
        }
    }

    #[test]
    fn styles_that_are_none_are_refused_in_one_line() {
        let refused = |text: &str| {
            let message = Preset::parse(text).unwrap_err().to_string();
            assert!(!message.contains('\n'), "{message}");
            message
        };
        let wrong = r#"Preset(evokes: "x", settings: {"tone.stepz": 3})"#;
        assert!(refused(wrong).contains("the nearest is `tone.steps`"));
        let wrong = r#"Preset(evokes: "x", settings: {"tone.steps": 900})"#;
        assert!(refused(wrong).contains("from 1 to 32"));
        assert!(refused("Preset(").starts_with("line 1"));
        assert!(refused(r#"Preset(evokes: "x", settings: {"preset": "ink"})"#).contains("cannot name"));
        assert!(Preset::named("etching").unwrap_err().to_string().contains("gooch, toon"));
        assert!(Preset::named("/nowhere/x.ron").unwrap_err().to_string().starts_with("/nowhere/x.ron: "));
    }

    #[test]
    fn what_is_set_is_kept_in_a_saved_style() {
        let (declared, mut settings) = (parameters(), Settings::default());
        settings.set("stylized", &declared, "preset", "ink").unwrap();
        settings.set("stylized", &declared, "tone.steps", "4").unwrap();
        let saved = Preset::parse(&Preset::of(&settings, "mine, from ink").unwrap().to_ron()).unwrap();
        let ink = Preset::builtin("ink").unwrap();
        assert_eq!(saved.settings["tone.steps"], Value::Int(4));
        assert_eq!(saved.settings.get("hatch"), ink.settings.get("hatch"));
    }
}
