//! Compression between plates: elements and steps against closed forms.

mod bodies;
mod calculix;
mod command;
mod elements;
mod grain;
mod killed;
mod press;
mod sphere;
