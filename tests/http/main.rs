//! `grainrig serve` as a stranger uses it: the real program, its real port, a real run.

mod client;
mod compressions;
mod crowd;
mod daemon;
mod damage;
mod ending;
mod hostile;
mod resuming;
mod runs;
#[path = "../sse/mod.rs"]
mod sse;
