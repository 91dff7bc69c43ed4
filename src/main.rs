//! The `grainrig` program: parse, set up logging, run one command.

fn main() -> std::process::ExitCode {
    grainrig::cli::run()
}
