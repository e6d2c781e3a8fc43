//! The command: one file for each subcommand, and one place where errors become exit codes.

mod animate;
mod arguments;
mod auto;
mod backends;
mod bench;
mod chart;
mod compare;
mod convert;
mod input;
mod plan;
mod render;
mod stability;
mod validate;
mod view;

use arguments::{Arguments, Command};
use clap::Parser as _;
use std::process::ExitCode;

/// Why the command ends without success.
#[derive(Debug)]
enum Failure {
    /// Something failed while running.
    Running(String),
    /// The command was used wrongly.
    Use(String),
    /// An input was refused.
    Input(String),
    /// A gate did not hold; what failed was printed already.
    Gate,
}

impl Failure {
    fn running(error: impl std::fmt::Display) -> Self {
        Self::Running(error.to_string())
    }
    fn wrong_use(error: impl std::fmt::Display) -> Self {
        Self::Use(error.to_string())
    }
    fn input(error: impl std::fmt::Display) -> Self {
        Self::Input(error.to_string())
    }
}

/// Runs the command line; 0 done, 1 failed while running, 2 wrong use, 3 input refused, 4 a gate did not hold.
pub(crate) fn run() -> ExitCode {
    // A reader that stops early (`| head`) or an interrupt ends the program at once: files appear whole or not
    // at all, so nothing else has to be put in order.
    let stopped = ctrlc::set_handler(|| {
        polyptych::picture::discard_unfinished();
        eprintln!("error: interrupted");
        std::process::exit(1);
    });
    if let Err(error) = stopped {
        eprintln!("warning: an interrupt will not remove unfinished files: {error}");
    }
    let result = match Arguments::parse().command {
        None => compare::run(&arguments::CompareArguments::default()),
        Some(Command::Compare(arguments)) => compare::run(&arguments),
        Some(Command::Render(arguments)) => render::run(&arguments),
        Some(Command::Chart(arguments)) => chart::run(&arguments),
        Some(Command::Stability(arguments)) => stability::run(&arguments),
        Some(Command::Plan(arguments)) => plan::run(&arguments),
        Some(Command::Bench(arguments)) => bench::run(&arguments),
        Some(Command::Animate(arguments)) => animate::run(&arguments),
        Some(Command::Convert(arguments)) => convert::run(&arguments),
        Some(Command::Backends(arguments)) => backends::run(&arguments),
        Some(Command::Validate(arguments)) => validate::run(&arguments),
        Some(Command::View(arguments)) => view::run(&arguments),
    };
    let (message, code) = match result {
        Ok(()) => return ExitCode::SUCCESS,
        Err(Failure::Running(message)) => (message, 1),
        Err(Failure::Use(message)) => (message, 2),
        Err(Failure::Input(message)) => (message, 3),
        Err(Failure::Gate) => return ExitCode::from(4),
    };
    eprintln!("error: {}", message.replace('\n', " "));
    ExitCode::from(code)
}

/// Prints to standard output; a reader that went away ends the program quietly.
fn print(text: &str) {
    use std::io::Write as _;
    if std::io::stdout().write_all(text.as_bytes()).is_err() {
        std::process::exit(0);
    }
}
