//! What the pictures, the hull and its figures come to, held against truths that are known: a simulation's, other people's data,
//! plain loops.

mod hard_pictures;
mod hull_volume;
#[path = "../support/kit/mod.rs"]
mod kit;
#[path = "../support/random.rs"]
mod random;
mod rendered_truth;
mod simulated_truth;
#[path = "../support/skip.rs"]
mod skip;
mod study;
mod tone_curve;
mod volume_estimate;
