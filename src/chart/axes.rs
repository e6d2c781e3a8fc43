//! Along which axes can a back end trade time for accuracy, and where on them are points?

use super::TOLERANCE;
use crate::scene::{Scene, Shape, ShapeKind};
use crate::seam::{BackendInfo, Parameter, ParameterKind, Value};

/// A quality axis with the values that a chart takes on it, coarse first.
#[derive(Clone, Debug, PartialEq)]
pub struct QualityAxis {
    /// The parameter's name, or [`TOLERANCE`].
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// Values, coarse first where that is known: whole numbers rise, lengths of steps and tolerances fall.
    pub values: Vec<Value>,
    /// The value when nobody sets it.
    pub default: Value,
}

/// Tolerances of edges in pixels: from what everybody sees to what nobody does.
const TOLERANCES: [f64; 7] = [8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125];

/// Most values on an axis of whole numbers, and of others: what is between is of no interest.
const MOST: [usize; 2] = [7, 5];

/// Returns the axes of a back end that can matter in a scene: its declared ones, and the tolerance of a need where it
/// converts shapes. `ruler_samples` bounds how many samples a pixel are worth comparing with the ruler.
#[must_use]
pub fn quality_axes(info: &BackendInfo, scene: &Scene, ruler_samples: u32) -> Vec<QualityAxis> {
    let has_volume = scene.objects.iter().any(|o| matches!(&*o.shape, Shape::Volume(_)));
    // Bodies of second order alone have closed forms, which are reckoned in double precision anyway.
    let has_form = scene.objects.iter().any(|o| match &*o.shape {
        Shape::FreeForm(_) => true,
        Shape::Volume(volume) => volume.shell.is_some(),
        _ => false,
    });
    let mut axes = Vec::new();
    // A renderer over a renderer draws nothing natively: its inner one may convert.
    let converts = ShapeKind::ALL
        .into_iter()
        .any(|kind| !info.draws(kind) && scene.objects.iter().any(|o| o.shape.kind() == kind));
    if converts {
        axes.push(QualityAxis {
            name: TOLERANCE.to_owned(),
            unit: "px".to_owned(),
            values: TOLERANCES.map(Value::Float).to_vec(),
            default: Value::Float(0.5),
        });
    }
    for parameter in info.parameters.iter().filter(|p| p.quality_axis) {
        let is_idle = (parameter.tag == "volume.step" && !has_volume)
            || (parameter.tag == "roots.precision" && !has_form)
            || (parameter.tag == "detail.tolerance" && !converts);
        if !is_idle {
            axes.push(of_parameter(parameter, ruler_samples));
        }
    }
    axes
}

fn of_parameter(parameter: &Parameter, ruler_samples: u32) -> QualityAxis {
    let values = match parameter.kind {
        ParameterKind::Bool => vec![Value::Bool(false), Value::Bool(true)],
        ParameterKind::Choice { choices } => choices.iter().map(|c| Value::Text((*c).to_owned())).collect(),
        ParameterKind::Color | ParameterKind::Text => Vec::new(),
        ParameterKind::Int { min, max } => {
            // A ruler of n samples has an error of its own: only a quarter as many are held against it.
            let max = if parameter.tag == "samples" { max.min(i64::from(ruler_samples) / 4) } else { max };
            halvings(max.max(min.max(1)) as f64, min.max(1) as f64, MOST[0])
                .into_iter()
                .rev()
                .map(|v| Value::Int(v.round() as i64))
                .collect()
        }
        ParameterKind::Float { min, max } => {
            let low = if min > 0.0 { min } else { max / 64.0 };
            halvings(max, low, MOST[1]).into_iter().map(Value::Float).collect()
        }
    };
    QualityAxis {
        name: parameter.name.to_owned(),
        unit: parameter.unit.to_owned(),
        values,
        default: parameter.default.clone(),
    }
}

/// Lists at most so many numbers at equal ratios from the largest down to the smallest: halves where they fit.
fn halvings(max: f64, min: f64, most: usize) -> Vec<f64> {
    let steps = (max / min).log2().max(0.0);
    if steps.fract() == 0.0 && steps < most as f64 {
        return (0..=steps as i32).map(|i| max * 0.5f64.powi(i)).collect();
    }
    let count = (steps.floor() as usize + 1).clamp(2, most);
    let factor = (min / max).powf(1.0 / (count - 1) as f64);
    let mut values: Vec<f64> = (0..count).map(|i| max * factor.powi(i as i32)).collect();
    // Three digits are all that a person wants to type.
    for value in &mut values {
        let digits = 10f64.powf(2.0 - value.abs().log10().floor());
        *value = ((*value * digits).round() / digits).clamp(min, max);
    }
    values.dedup();
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BuiltinBackends as _;
    use crate::seam::Registry;

    #[test]
    fn every_back_end_has_an_axis_with_four_values_that_it_takes() {
        let registry = Registry::builtin();
        let scene = crate::builtin::scene("atelier").unwrap();
        for (info, _) in registry.iter() {
            let axes = quality_axes(info, &scene, 32);
            let is_long = |axis: &QualityAxis| axis.values.len() >= 4;
            assert!(axes.iter().any(is_long), "{} has no axis", info.id);
            for axis in &axes {
                let parameter = info.parameters.iter().find(|p| p.name == axis.name);
                let is_choice = parameter.is_some_and(|p| matches!(p.kind, ParameterKind::Choice { .. }));
                assert!(is_choice || axis.values.len() >= 4, "{} {}: {:?}", info.id, axis.name, axis.values);
                if let Some(parameter) = parameter {
                    for value in &axis.values {
                        assert_eq!(parameter.parse(&value.to_string()).as_ref(), Ok(value));
                    }
                }
            }
        }
    }

    #[test]
    fn an_axis_that_cannot_matter_is_left_out() {
        let registry = Registry::builtin();
        let scene = crate::builtin::scene("terrain").unwrap();
        let names = |id: &str| -> Vec<String> {
            let axes = quality_axes(registry.info(id).unwrap(), &scene, 32);
            axes.into_iter().map(|a| a.name).collect()
        };
        assert!(names("freeform").is_empty(), "height fields are drawn as given");
        assert_eq!(names("reference"), ["samples"]);
        assert_eq!(names("raster"), [TOLERANCE, "shadow.map_size", "samples"]);
    }

    #[test]
    fn values_halve_between_the_ends() {
        assert_eq!(halvings(8192.0, 1024.0, 7), [8192.0, 4096.0, 2048.0, 1024.0]);
        assert_eq!(halvings(4.0, 0.05, 5), [4.0, 1.34, 0.447, 0.15, 0.05]);
    }
}
