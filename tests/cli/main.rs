//! Bad input, as a user of the program meets it: every error says what is wrong and what to do, the exit code
//! says whose fault it is, what was captured stays, and nothing panics.

mod config;
mod disk;
#[path = "../support/kit/mod.rs"]
mod kit;
mod log;
mod manage;
mod names;
mod next;
mod pictures;
mod quality;
mod rehearsal;
mod sessions;
mod settings;
#[path = "../support/skip.rs"]
mod skip;
mod streams;
mod units;
