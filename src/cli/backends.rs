//! `polyptych backends`: what is there, and what can be set.

use super::arguments::BackendsArguments;
use super::{Failure, input, print};
use polyptych::plugins::{Manifest, Refusal, open};
use polyptych::scene::ShapeKind;
use polyptych::seam::{BackendInfo, Origin, Parameter, ParameterKind};
use serde_json::{Value, json};

pub(super) fn run(arguments: &BackendsArguments) -> Result<(), Failure> {
    if let Some(library) = &arguments.manifest {
        let loaded = open(library).map_err(Failure::input)?;
        print(&Manifest::of(loaded).to_text());
        return Ok(());
    }
    let (registry, refused) = input::registry(&arguments.plugins)?;
    let mut list: Vec<Value> = registry.iter().map(|(info, origin)| backend_json(info, origin)).collect();
    list.extend(refused.iter().map(refused_json));
    if arguments.json {
        print(&format!("{}\n", Value::Array(list)));
        return Ok(());
    }
    for (info, origin) in registry.iter() {
        print(&format!("{}: {} {} ({})\n", info.id, info.name, info.version, origin_text(origin)));
        let native: Vec<_> = info.native.iter().map(|k| k.name()).collect();
        print(&format!("  draws as given: {}; converts the rest\n", native.join(", ")));
        let channels: Vec<_> = info.channels.iter().map(polyptych::prelude::Channel::name).collect();
        print(&format!("  channels: {}\n", channels.join(", ")));
        for p in &info.parameters {
            let unit = if p.unit.is_empty() { String::new() } else { format!(" {}", p.unit) };
            print(&format!("  {} = {}{unit} ({}): {}\n", p.name, p.default, allowed(p), p.help));
        }
    }
    for refusal in &refused {
        print(&format!("refused: {refusal}\n"));
    }
    Ok(())
}

fn refused_json(refusal: &Refusal) -> Value {
    json!({
        "id": Value::Null, "name": Value::Null, "version": Value::Null,
        "origin": refusal.path().to_string_lossy(), "status": format!("refused: {refusal}"),
        "shapes": {}, "channels": [], "parameters": [],
    })
}

fn origin_text(origin: &Origin) -> String {
    match origin {
        Origin::BuiltIn => "built-in".to_owned(),
        Origin::Library(path) => path.display().to_string(),
    }
}

fn allowed(parameter: &Parameter) -> String {
    match parameter.kind {
        ParameterKind::Bool => "true or false".to_owned(),
        ParameterKind::Int { min, max } => format!("{min} to {max}"),
        ParameterKind::Float { min, max } => format!("{min} to {max}"),
        ParameterKind::Choice { choices } => choices.join(", "),
        ParameterKind::Color => "#rrggbb".to_owned(),
        ParameterKind::Text => "text".to_owned(),
    }
}

fn backend_json(info: &BackendInfo, origin: &Origin) -> Value {
    let shapes: serde_json::Map<String, Value> = ShapeKind::ALL
        .into_iter()
        .map(|kind| (kind.name().to_owned(), json!(if info.draws(kind) { "native" } else { "converted" })))
        .collect();
    let parameters: Vec<Value> = info.parameters.iter().map(parameter_json).collect();
    json!({
        "id": info.id, "name": info.name, "version": info.version, "origin": origin_text(origin),
        "status": "ready", "shapes": shapes,
        "channels": info.channels.iter().map(polyptych::prelude::Channel::name).collect::<Vec<_>>(),
        "parameters": parameters,
    })
}

fn parameter_json(p: &Parameter) -> Value {
    let (kind, min, max, choices) = match p.kind {
        ParameterKind::Bool => ("bool", Value::Null, Value::Null, Value::Null),
        ParameterKind::Int { min, max } => ("int", json!(min), json!(max), Value::Null),
        ParameterKind::Float { min, max } => ("float", json!(min), json!(max), Value::Null),
        ParameterKind::Choice { choices } => ("choice", Value::Null, Value::Null, json!(choices)),
        ParameterKind::Color => ("color", Value::Null, Value::Null, Value::Null),
        ParameterKind::Text => ("text", Value::Null, Value::Null, Value::Null),
    };
    json!({
        "name": p.name, "type": kind, "default": p.default, "min": min, "max": max, "choices": choices,
        "unit": p.unit, "help": p.help, "tag": p.tag, "quality_axis": p.quality_axis,
    })
}
