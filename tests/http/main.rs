//! `grainrig serve` as a stranger uses it: the real program, its real port, a real run.

mod client;
mod compressions;
mod crowd;
mod daemon;
mod damage;
mod doors;
mod ending;
mod hostile;
mod jobs;
#[path = "../support/random.rs"]
mod random;
mod resuming;
mod runs;
#[path = "../support/skip.rs"]
mod skip;
#[path = "../support/sse/mod.rs"]
mod sse;
