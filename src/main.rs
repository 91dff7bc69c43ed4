//! The `grainrig` program: parse, set up logging, run one command.

fn main() {}
