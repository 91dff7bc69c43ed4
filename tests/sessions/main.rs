//! Sessions from the first picture to the products: made, killed, resumed, replayed, merged.

mod kills;
#[path = "../support/kit/mod.rs"]
mod kit;
mod merge;
mod pictures;
#[path = "../support/random.rs"]
mod random;
mod real_data;
mod replay;
mod resume;
#[path = "../support/skip.rs"]
mod skip;
