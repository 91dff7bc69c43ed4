//! Compression between plates: elements and steps against closed forms.

mod bodies;
mod calculix;
mod command;
mod decks;
mod elements;
mod ensemble;
mod experiments;
mod foot;
mod grain;
mod killed;
mod laws;
mod plastic;
mod press;
mod rests;
#[path = "../support/skip.rs"]
mod skip;
mod sphere;
mod told;
