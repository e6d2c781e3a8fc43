//! `polyptych validate`: does a plugin keep what every back end promises? Each check runs in a process of its own.

use super::arguments::ValidateArguments;
use super::{Failure, print};
use polyptych::conformance::{CHECKS, Check, Subject, find};
use polyptych::plugins::{Isolation, Limits, Options, PluginBackends};
use polyptych::seam::Registry;
use polyptych::{BuiltinBackends, picture};
use serde_json::{Value, json};
use std::io::Read as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What became of a check.
struct Outcome {
    check: &'static Check,
    /// Why it failed.
    fault: Option<String>,
    seconds: f64,
    /// What runs it again.
    command: String,
}

pub(super) fn run(arguments: &ValidateArguments) -> Result<(), Failure> {
    let mut checks = Vec::new();
    for name in &arguments.only {
        let all = || CHECKS.iter().map(|c| c.name).collect::<Vec<_>>().join(", ");
        checks.push(
            find(name).ok_or_else(|| Failure::wrong_use(format!("--only {name}: use one of {}", all())))?,
        );
    }
    let (registry, id) = registry(arguments)?;
    if !checks.is_empty() {
        return here(arguments, &registry, &id, &checks);
    }
    let program = std::env::current_exe().map_err(Failure::running)?;
    let mut outcomes = Vec::new();
    for check in &CHECKS {
        let outcome = apart(arguments, &program, check);
        if !arguments.json {
            let word = if outcome.fault.is_some() { "FAILED" } else { "ok" };
            print(&format!("{word:>6}  {:<16} {} ({:.1} s)\n", check.name, check.promise, outcome.seconds));
            if let Some(fault) = &outcome.fault {
                print(&format!("        {fault}\n        again: {}\n", outcome.command));
            }
        }
        outcomes.push(outcome);
    }
    let info = registry.info(&id).map_err(Failure::running)?;
    let failed = outcomes.iter().filter(|o| o.fault.is_some()).count();
    let report = json!({
        "plugin": arguments.plugin.to_string_lossy(), "id": id, "name": info.name, "version": info.version,
        "seed": arguments.seed, "passed": failed == 0,
        "checks": outcomes.iter().map(outcome_json).collect::<Vec<_>>(),
    });
    let page = page(&arguments.plugin.to_string_lossy(), &info.name, &outcomes);
    std::fs::create_dir_all(&arguments.output).map_err(Failure::running)?;
    for (file, text) in [("report.json", format!("{report:#}\n")), ("report.html", page)] {
        picture::write_whole(&arguments.output.join(file), text.as_bytes()).map_err(Failure::running)?;
    }
    if arguments.json {
        print(&format!("{report}\n"));
    } else {
        let (kept, all, folder) = (outcomes.len() - failed, outcomes.len(), arguments.output.display());
        print(&format!("{id}: {kept} of {all} promises are kept; wrote {folder}/report.html\n"));
    }
    if failed == 0 { Ok(()) } else { Err(Failure::Gate) }
}

/// Opens the plugin as the only back end besides the reference and the others built in.
fn registry(arguments: &ValidateArguments) -> Result<(Registry, String), Failure> {
    let isolation = if arguments.trust_plugins { Isolation::InProcess } else { Options::default().isolation };
    // A check ends before its time is up if the plugin hangs, and can say so.
    let silence = Duration::from_secs(arguments.timeout) / 4;
    let options =
        Options { isolation, limits: Limits { silence, ..Limits::default() }, ..Options::default() };
    let mut registry = Registry::builtin();
    let id = registry.load_with(&arguments.plugin, &options).map_err(Failure::input)?;
    if id == polyptych::compare::REFERENCE {
        return Err(Failure::input(format!("{}: takes the id of the reference", arguments.plugin.display())));
    }
    Ok((registry, id))
}

/// Runs checks in this process.
fn here(
    arguments: &ValidateArguments,
    registry: &Registry,
    id: &str,
    checks: &[&'static Check],
) -> Result<(), Failure> {
    let mut failed = false;
    for check in checks {
        let mut subject = Subject::new(registry.clone(), id);
        subject.seed = arguments.seed;
        subject.pictures = Some(arguments.output.join(check.name));
        match check.run(&subject) {
            Ok(()) => print(&format!("ok {}\n", check.name)),
            Err(fault) => {
                failed = true;
                print(&format!("FAILED {}: {}\n", check.name, fault.replace('\n', " ")));
            }
        }
    }
    if failed { Err(Failure::Gate) } else { Ok(()) }
}

/// Runs a check in a process of its own, which is ended when its time is up.
fn apart(arguments: &ValidateArguments, program: &Path, check: &'static Check) -> Outcome {
    let seed = arguments.seed.to_string();
    let timeout = arguments.timeout.to_string();
    let (plugin, output) = (arguments.plugin.to_string_lossy(), arguments.output.to_string_lossy());
    let mut words = vec!["validate", &*plugin, "--only", check.name, "--seed", &seed, "--timeout", &timeout];
    words.extend(["-o", &*output]);
    if arguments.trust_plugins {
        words.push("--trust-plugins");
    }
    let command = format!("polyptych {}", words.join(" "));
    let begin = Instant::now();
    let fault = child(program, &words, Duration::from_secs(arguments.timeout)).err();
    Outcome { check, fault, seconds: begin.elapsed().as_secs_f64(), command }
}

fn child(program: &Path, words: &[&str], timeout: Duration) -> Result<(), String> {
    let mut child = Command::new(program)
        .args(words)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|e| format!("the check cannot be started: {e}"))?;
    let begin = Instant::now();
    let status = loop {
        match child.try_wait().map_err(|e| e.to_string())? {
            Some(status) => break status,
            None if begin.elapsed() > timeout => {
                let _ = child.kill();
                let _ = child.wait();
                return Err(format!("it was not done after {} s and was ended", timeout.as_secs()));
            }
            None => std::thread::sleep(Duration::from_millis(5)),
        }
    };
    let mut printed = String::new();
    if let Some(mut out) = child.stdout.take() {
        // Lines are short: what a check prints fits into the pipe.
        let _ = out.read_to_string(&mut printed);
    }
    let line = printed.lines().rfind(|l| l.starts_with("FAILED ")).and_then(|l| l.split_once(": "));
    match (status.success(), line) {
        (true, _) => Ok(()),
        (false, Some((_, fault))) => Err(fault.to_owned()),
        (false, None) => Err(format!("the plugin took its process down: {status}")),
    }
}

fn outcome_json(outcome: &Outcome) -> Value {
    json!({
        "name": outcome.check.name, "promise": outcome.check.promise, "passed": outcome.fault.is_none(),
        "fault": outcome.fault, "seconds": outcome.seconds, "command": outcome.command,
    })
}

fn page(plugin: &str, name: &str, outcomes: &[Outcome]) -> String {
    let escape = |text: &str| text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    let row = |o: &Outcome| {
        let (class, fault) = match &o.fault {
            None => ("kept", String::new()),
            Some(fault) => ("broken", format!("{}<br><code>{}</code>", escape(fault), escape(&o.command))),
        };
        format!(
            "<tr class={class}><td>{}<td>{}<td>{:.1} s<td>{fault}\n",
            o.check.name,
            escape(o.check.promise),
            o.seconds
        )
    };
    let kept = outcomes.iter().filter(|o| o.fault.is_none()).count();
    format!(
        "<!doctype html><html lang=en><meta charset=utf-8><title>{name}: validation</title>\n\
         <style>body{{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem}}\
         table{{border-collapse:collapse;width:100%}}td,th{{text-align:left;vertical-align:top;padding:.4rem .8rem;\
         border-bottom:1px solid #ddd}}.broken td:first-child{{border-left:4px solid #b3261e}}\
         .kept td:first-child{{border-left:4px solid #2e7d32}}code{{font-size:13px;word-break:break-all}}</style>\n\
         <h1>{name}</h1><p><code>{}</code>: {kept} of {} promises are kept.\n\
         <table><tr><th>Check<th>Promise<th>Time<th>Fault\n{}</table></html>\n",
        escape(plugin),
        outcomes.len(),
        outcomes.iter().map(row).collect::<String>(),
        name = escape(name),
    )
}
