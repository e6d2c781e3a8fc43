//! `polyptych plan`: what each back end would build, and why.

use super::arguments::PlanArguments;
use super::{Failure, input, print};
use polyptych::pace::Pace;
use polyptych::seam::{Need, Plan};
use serde_json::{Value, json};

pub(super) fn run(arguments: &PlanArguments) -> Result<(), Failure> {
    let scene = input::scene(&arguments.scene)?;
    let mut studio = input::studio(1, &arguments.draw.plugins)?;
    let default = ["reference", "raster", "voxel", "freeform", "stylized"];
    let backends = input::backends(&arguments.draw, studio.registry(), &default)?;
    let mut settings = input::settings(&arguments.draw, studio.registry(), &backends)?;
    let base = input::need(&arguments.draw, &scene)?;
    // Times are those of this machine; how fast it is was measured before, or is now, once.
    if !arguments.draw.quiet && Pace::known(studio.registry()).is_none() {
        eprintln!("measures how fast this machine is, once: some seconds");
    }
    let pace = Pace::of_this_machine(studio.registry()).map_err(Failure::running)?;
    let mut all = Vec::new();
    for backend in &backends {
        let need = Need { settings: settings.remove(backend).unwrap_or_default(), ..base.clone() };
        let mut plan = studio.renderer(backend).map_err(Failure::running)?.plan(&scene, &need);
        plan.estimated_ms *= pace.factor(backend);
        if arguments.draw.json {
            all.push(plan_json(backend, &plan));
        } else {
            print(&text(backend, &plan));
        }
    }
    if arguments.draw.json {
        print(&format!("{}\n", Value::Array(all)));
    }
    Ok(())
}

fn plan_json(backend: &str, plan: &Plan) -> Value {
    let objects: Vec<Value> = plan
        .objects
        .iter()
        .map(|o| {
            json!({"name": o.name, "shape": o.shape, "decision": o.decision.word(), "builds": o.builds,
                   "bytes": o.bytes, "bound": o.decision.bound(), "why": o.decision.why()})
        })
        .collect();
    json!({"backend": backend, "objects": objects, "passes": plan.passes, "bytes": plan.bytes,
           "estimated_ms": plan.estimated_ms})
}

fn text(backend: &str, plan: &Plan) -> String {
    let mut text =
        format!("{backend}: {} bytes, about {:.1} ms a frame on one thread\n", plan.bytes, plan.estimated_ms);
    for object in &plan.objects {
        let bound = match object.decision.bound() {
            Some(bound) if bound > 0.0 => format!(", at most {bound:.2e} m off"),
            _ => String::new(),
        };
        let builds = if object.builds.is_empty() { "nothing" } else { &object.builds };
        text.push_str(&format!(
            "  {} ({}): {}{bound}; builds {builds}, {} bytes",
            object.name,
            object.shape,
            object.decision.word(),
            object.bytes
        ));
        let why = object.decision.why();
        text.push_str(&if why.is_empty() { "\n".to_owned() } else { format!(": {why}\n") });
    }
    for pass in &plan.passes {
        text.push_str(&format!("  {} {}: {}\n", if pass.needed { "+" } else { "-" }, pass.name, pass.why));
    }
    text
}
