//! `polyptych convert`: a scene as a model of one representation.

use super::arguments::{ConvertArguments, PluginArguments, Representation};
use super::{Failure, input, print};
use polyptych::convert::{Detail, Filling};
use polyptych::export::export;
use polyptych::seam::Control;
use serde_json::json;

pub(super) fn run(arguments: &ConvertArguments) -> Result<(), Failure> {
    let extension =
        arguments.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let fits: &[&str] = match arguments.to {
        Some(Representation::Mesh) => &["obj", "glb"],
        Some(Representation::Voxels) => &["vox"],
        Some(Representation::Volume) => &["nrrd"],
        None => &["obj", "glb", "vox", "nrrd"],
    };
    if !fits.contains(&extension.as_str()) {
        let names = fits.iter().map(|f| format!(".{f}")).collect::<Vec<_>>().join(" or ");
        return Err(Failure::wrong_use(format!(
            "{}: the file must end in {names}",
            arguments.output.display()
        )));
    }
    let scene = input::named_scene(&arguments.input, &arguments.reading)?;
    let longest = scene.bounds().size().max_element();
    let detail = match (arguments.tolerance, arguments.resolution) {
        (Some(tolerance), _) if tolerance > 0.0 && tolerance.is_finite() => {
            Detail { tolerance, max_resolution: 512 }
        }
        (Some(tolerance), _) => {
            return Err(Failure::wrong_use(format!(
                "--tolerance {tolerance}: must be a positive length in meters"
            )));
        }
        (None, Some(resolution)) => {
            Detail { tolerance: longest / f64::from(resolution) * 0.5, max_resolution: resolution }
        }
        (None, None) => Detail { tolerance: longest / 256.0, max_resolution: 128 },
    };
    let studio = input::studio(arguments.threads, &PluginArguments::default())?;
    let filling = arguments.filling.unwrap_or_default();
    if filling != Filling::Natural && extension != "vox" {
        return Err(Failure::wrong_use("--filling: only voxels are filled, write a .vox file"));
    }
    let control = Control::new(studio.pool());
    let done = export(&scene, &arguments.output, detail, filling, studio.converter(), &control)
        .map_err(Failure::running)?;
    if arguments.json {
        let out = arguments.output.to_string_lossy();
        print(&format!(
            "{}\n",
            json!({"out": out, "what": done.what, "bound": done.bound, "notes": done.notes})
        ));
    } else {
        print(&format!("{}: {}, at most {:.3e} m off\n", arguments.output.display(), done.what, done.bound));
        for note in &done.notes {
            eprintln!("note: {note}");
        }
    }
    Ok(())
}
