//! Parameters as data: the command line, the viewer's panel, plugins and charts are generated from these.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A declared parameter of a back end.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Dotted name, unique within the back end: `shadow.map_size`.
    pub name: &'static str,
    /// Type, range or choices.
    #[serde(flatten)]
    pub kind: ParameterKind,
    /// Value when nobody sets it.
    pub default: Value,
    /// Unit, empty for pure numbers.
    pub unit: &'static str,
    /// One line of help.
    pub help: &'static str,
    /// Meaning shared across back ends (`samples`, `shadow.quality`, `detail.tolerance`), or empty.
    pub tag: &'static str,
    /// Whether it trades time for accuracy; such parameters are swept by charts.
    pub quality_axis: bool,
}

/// The type of a parameter with what is allowed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ParameterKind {
    /// On or off.
    Bool,
    /// A whole number in a closed range.
    Int {
        /// Smallest value.
        min: i64,
        /// Largest value.
        max: i64,
    },
    /// A number in a closed range.
    Float {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// One of several words.
    Choice {
        /// The words.
        choices: &'static [&'static str],
    },
    /// A color, `#rrggbb`.
    Color,
    /// Any line of text: a file, a list, the name of something. It does not cross the plugin border.
    Text,
}

/// Most letters of a [`ParameterKind::Text`].
const LONGEST_TEXT: usize = 4096;

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
#[expect(missing_docs, reason = "one for each kind of parameter; colors are text")]
pub enum Value {
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
}

impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Bool(v) => write!(f, "{v}"),
            Self::Int(v) => write!(f, "{v}"),
            Self::Float(v) => write!(f, "{v}"),
            Self::Text(v) => write!(f, "{v}"),
        }
    }
}

/// Why a value was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the messages say it")]
pub enum ParameterError {
    #[error("{backend} has no parameter `{name}`; the nearest is `{nearest}`")]
    UnknownName { backend: String, name: String, nearest: String },
    #[error("{backend} has no parameters, so `{name}` cannot be set")]
    NoParameters { backend: String, name: String },
    #[error("`{name}` cannot be `{value}`: {allowed}")]
    NotAllowed { name: String, value: String, allowed: String },
}

impl Parameter {
    /// Parses and checks a value given as text.
    ///
    /// # Errors
    /// Says what is allowed when the text is not.
    pub fn parse(&self, text: &str) -> Result<Value, ParameterError> {
        let refuse = || ParameterError::NotAllowed {
            name: self.name.to_owned(),
            value: text.to_owned(),
            allowed: self.allowed(text),
        };
        let value = match self.kind {
            ParameterKind::Bool => match text {
                "true" | "on" | "yes" | "1" => Value::Bool(true),
                "false" | "off" | "no" | "0" => Value::Bool(false),
                _ => return Err(refuse()),
            },
            ParameterKind::Int { min, max } => match text.parse() {
                Ok(v) if (min..=max).contains(&v) => Value::Int(v),
                _ => return Err(refuse()),
            },
            ParameterKind::Float { min, max } => match text.parse() {
                Ok(v) if (min..=max).contains(&v) => Value::Float(v),
                _ => return Err(refuse()),
            },
            ParameterKind::Choice { choices } => match choices.iter().find(|c| **c == text) {
                Some(c) => Value::Text((*c).to_owned()),
                None => return Err(refuse()),
            },
            ParameterKind::Color => match crate::scene::color_text::parse_hex(text) {
                Ok(_) => Value::Text(text.to_owned()),
                Err(_) => return Err(refuse()),
            },
            ParameterKind::Text => {
                if text.len() > LONGEST_TEXT || text.contains(char::is_control) {
                    return Err(refuse());
                }
                Value::Text(text.to_owned())
            }
        };
        Ok(value)
    }

    /// Says what is allowed, with the nearest valid value for words that are none.
    fn allowed(&self, text: &str) -> String {
        match self.kind {
            ParameterKind::Bool => "write `true` or `false`".to_owned(),
            ParameterKind::Int { min, max } => format!("a whole number from {min} to {max}"),
            ParameterKind::Float { min, max } => format!("a number from {min} to {max}"),
            ParameterKind::Choice { choices } => {
                let nearest = nearest(text, choices.iter().copied()).unwrap_or_default();
                format!("one of {}; the nearest is `{nearest}`", choices.join(", "))
            }
            ParameterKind::Color => "a color is written #rrggbb".to_owned(),
            ParameterKind::Text => format!("one line of at most {LONGEST_TEXT} letters"),
        }
    }
}

/// Values for the parameters of one back end; what is not set has its default.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Settings {
    values: BTreeMap<String, Value>,
}

impl Settings {
    /// Sets a parameter from text.
    ///
    /// # Errors
    /// When the back end has no such parameter or the value is not allowed; the nearest valid one is named.
    pub fn set(
        &mut self,
        backend: &str,
        declared: &[Parameter],
        name: &str,
        text: &str,
    ) -> Result<(), ParameterError> {
        let Some(parameter) = declared.iter().find(|p| p.name == name) else {
            let (backend, name) = (backend.to_owned(), name.to_owned());
            return Err(match nearest(&name, declared.iter().map(|p| p.name)) {
                Some(nearest) => ParameterError::UnknownName { backend, name, nearest: nearest.to_owned() },
                None => ParameterError::NoParameters { backend, name },
            });
        };
        self.values.insert(name.to_owned(), parameter.parse(text)?);
        Ok(())
    }

    /// Returns what was set, without defaults.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.values.iter().map(|(name, value)| (name.as_str(), value))
    }

    /// Returns a value, or the default that the back end declared.
    ///
    /// # Panics
    /// When the back end asks for a parameter that it did not declare: a bug in the back end.
    #[must_use]
    pub fn get<'a>(&'a self, declared: &'a [Parameter], name: &str) -> &'a Value {
        self.values.get(name).unwrap_or_else(|| {
            let parameter = declared.iter().find(|p| p.name == name);
            &parameter.unwrap_or_else(|| panic!("parameter `{name}` is not declared")).default
        })
    }

    /// Returns a switch.
    #[must_use]
    pub fn bool(&self, declared: &[Parameter], name: &str) -> bool {
        matches!(self.get(declared, name), Value::Bool(true))
    }

    /// Returns a whole number.
    #[must_use]
    pub fn int(&self, declared: &[Parameter], name: &str) -> i64 {
        match self.get(declared, name) {
            Value::Int(v) => *v,
            other => panic!("parameter `{name}` holds {other}, not a whole number"),
        }
    }

    /// Returns a number.
    #[must_use]
    pub fn float(&self, declared: &[Parameter], name: &str) -> f64 {
        match self.get(declared, name) {
            Value::Float(v) => *v,
            Value::Int(v) => *v as f64,
            other => panic!("parameter `{name}` holds {other}, not a number"),
        }
    }

    /// Returns a word or the text of a color.
    #[must_use]
    pub fn text<'a>(&'a self, declared: &'a [Parameter], name: &str) -> &'a str {
        match self.get(declared, name) {
            Value::Text(v) => v,
            other => panic!("parameter `{name}` holds {other}, not a word"),
        }
    }

    /// Returns a color, linear.
    #[must_use]
    pub fn color(&self, declared: &[Parameter], name: &str) -> glam::Vec3 {
        crate::scene::color_text::parse_hex(self.text(declared, name)).unwrap_or_default()
    }
}

/// Returns the word with the smallest edit distance.
pub(crate) fn nearest<'a>(word: &str, among: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    among.min_by_key(|candidate| edit_distance(word, candidate))
}

/// Counts insertions, deletions and replacements (Levenshtein 1966).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared() -> Vec<Parameter> {
        vec![
            Parameter {
                name: "shadow.map_size",
                kind: ParameterKind::Int { min: 64, max: 8192 },
                default: Value::Int(2048),
                unit: "texels",
                help: "",
                tag: "shadow.quality",
                quality_axis: true,
            },
            Parameter {
                name: "shading",
                kind: ParameterKind::Choice { choices: &["flat", "gouraud", "phong"] },
                default: Value::Text("phong".to_owned()),
                unit: "",
                help: "",
                tag: "",
                quality_axis: false,
            },
        ]
    }

    #[test]
    fn refusals_name_the_nearest() {
        let (declared, mut settings) = (declared(), Settings::default());
        let message = |r: Result<(), ParameterError>| r.unwrap_err().to_string();
        assert_eq!(
            message(settings.set("raster", &declared, "shadow.mapsize", "1")),
            "raster has no parameter `shadow.mapsize`; the nearest is `shadow.map_size`"
        );
        assert_eq!(
            message(settings.set("raster", &declared, "shadow.map_size", "1")),
            "`shadow.map_size` cannot be `1`: a whole number from 64 to 8192"
        );
        assert_eq!(
            message(settings.set("raster", &declared, "shading", "fong")),
            "`shading` cannot be `fong`: one of flat, gouraud, phong; the nearest is `phong`"
        );
        settings.set("raster", &declared, "shadow.map_size", "512").unwrap();
        assert_eq!(settings.int(&declared, "shadow.map_size"), 512);
        assert_eq!(settings.text(&declared, "shading"), "phong");
    }
}
