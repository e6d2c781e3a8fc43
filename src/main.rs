//! The `polyptych` command.

mod cli;

fn main() -> std::process::ExitCode {
    polyptych::plugins::serve();
    cli::run()
}
