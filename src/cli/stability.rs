//! `polyptych stability`: where methods fail.

use super::arguments::StabilityArguments;
use super::{Failure, input, print};
use indicatif::{ProgressBar, ProgressStyle};
use polyptych::Studio;
use polyptych::framebuffer::Channel;
use polyptych::report::stability as report;
use polyptych::stability::{Case, cases, stability};
use std::time::Duration;

pub(super) fn run(arguments: &StabilityArguments) -> Result<(), Failure> {
    let mut studio = input::studio(usize::from(arguments.threads), &arguments.plugins)?;
    let all = cases();
    let chosen: Vec<Case> = if arguments.cases.is_empty() {
        all
    } else {
        for name in &arguments.cases {
            if !all.iter().any(|c| c.id == name) {
                let ids: Vec<_> = all.iter().map(|c| c.id).collect();
                return Err(Failure::wrong_use(format!(
                    "{name}: there is no such case: use some of {}",
                    ids.join(", ")
                )));
            }
        }
        all.into_iter().filter(|c| arguments.cases.iter().any(|n| n == c.id)).collect()
    };
    let backends: Vec<String> = if arguments.backend.is_empty() {
        ["reference", "raster", "voxel", "freeform", "stylized"].map(str::to_owned).to_vec()
    } else {
        arguments.backend.clone()
    };
    for id in &backends {
        studio.registry().info(id).map_err(|e| Failure::wrong_use(format!("--backend {id}: {e}")))?;
    }
    if let Some(value) = arguments.at {
        return backends.iter().try_for_each(|b| {
            chosen.iter().try_for_each(|case| probe(arguments, &mut studio, case, b, value))
        });
    }
    let known = arguments
        .check
        .as_ref()
        .map(|path| {
            std::fs::read_to_string(path).map_err(|e| Failure::input(format!("{}: {e}", path.display())))
        })
        .transpose()?;

    let bar = ProgressBar::new(1);
    bar.set_style(
        ProgressStyle::with_template("{spinner} {pos}/{len} {msg}").unwrap_or(ProgressStyle::default_bar()),
    );
    bar.enable_steady_tick(Duration::from_millis(100));
    let outcomes = stability(&mut studio, &chosen, &backends, &mut |done, all, what| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
        bar.set_message(what.to_owned());
    });
    bar.finish_and_clear();
    let command = std::env::args().collect::<Vec<_>>().join(" ");
    report::write(&chosen, &outcomes, &arguments.output, &command).map_err(Failure::running)?;
    if arguments.json {
        print(&format!("{}\n", report::numbers(&outcomes)));
    } else if !arguments.quiet {
        for o in &outcomes {
            let at = o.breaks_at.map_or("never breaks".to_owned(), |v| format!("breaks at {v:e}"));
            let way = o.method.map_or(String::new(), |m| format!(" ({m})"));
            print(&format!("{:<18} {:<10} {at}{way}\n", o.case, o.backend));
        }
        let folder = arguments.output.display();
        print(&format!("wrote {folder}/index.html, {folder}/LIMITS.md, {folder}/stability.json\n"));
    }
    let worse = report::check(&chosen, &outcomes, known.as_deref().unwrap_or(""));
    for line in &worse {
        eprintln!("worse: {line}");
    }
    if worse.is_empty() { Ok(()) } else { Err(Failure::Gate) }
}

/// Draws one value of a case and tells its error and a pixel.
fn probe(
    arguments: &StabilityArguments,
    studio: &mut Studio,
    case: &Case,
    backend: &str,
    value: f64,
) -> Result<(), Failure> {
    let probe = case
        .probe(studio, backend, value, arguments.better)
        .map_err(|e| Failure::running(format!("{}: {backend} at {value:e}: {e}", case.id)))?;
    print(&format!(
        "{}: {backend} at {} {value:e}: error {:.4e} ({}), limit {}\n",
        case.id, case.parameter, probe.error, case.counted, case.limit
    ));
    let Some([x, y]) = arguments.pixel.or(probe.worst_pixel()) else { return Ok(()) };
    for (who, picture) in [(backend, &probe.picture), ("held against", &probe.reference)] {
        let Some(picture) = picture else { continue };
        if x >= picture.width() || y >= picture.height() {
            let (width, height) = (picture.width(), picture.height());
            return Err(Failure::wrong_use(format!(
                "--pixel {x},{y}: the picture has {width} x {height} pixels"
            )));
        }
        let i = (y * picture.width() + x) as usize;
        let mut line = format!("  pixel {x},{y} {who}: color {:?}", picture.color()[i].to_array());
        if picture.channels().has(Channel::Id) {
            line.push_str(&format!(
                ", object {}, distance {:e}, normal {:?}, shadow {}",
                picture.id()[i],
                picture.distance()[i],
                picture.normal()[i].to_array(),
                picture.shadow()[i]
            ));
        }
        print(&format!("{line}\n"));
        let path = arguments.output.join(format!("{}-{value:e}-{}.png", case.id, who.replace(' ', "-")));
        polyptych::picture::save(picture, Channel::Color, &path).map_err(Failure::running)?;
        print(&format!("  wrote {}\n", path.display()));
    }
    Ok(())
}
