//! A grain pressed between two rigid plates: explicit dynamics, contact, and what is read off.
//!
//! Units are those of Abaqus decks: mm, N, MPa, tonne, s. The plates are level; z is up.
//!
//! - [`Material`] and the table of its [`LAWS`], and closed forms for spheres to hold results against ([`hertz`]).
//! - [`Body`]: the mesh in the order and the batches in which it is computed, its masses, its internal forces.
//! - [`Rests`]: how a grain can come to lie, and how likely each is; [`rocking`]: how closing plates turn it before they hold it.
//! - [`ensemble`]: the same in many cases that a grain may as well be in, on surfaces that it may as well have ([`perturbed`]);
//!   [`indentation_mm`] and [`Surrogate`]: what few computed cases say of the others.
//! - [`time_step`]: the largest time step that central differences bear.
//! - [`Dynamics`]: the step itself, with plates, friction and damping, and every term of the energy balance.
//!
//! Equations stand beside the code: a material law each in `laws/`, `element.rs` (critical time step), `plates.rs`
//! (contact and Coulomb's friction), [`hertz`], [`Energy`].

// The kernels of lanes.rs and laws/ must be one straight piece of code for the compiler to work on several
// elements at once, and their loops run over the same index of several arrays.
#![allow(clippy::inline_always, clippy::needless_range_loop)]

mod body;
mod dynamics;
mod element;
mod ensemble;
mod error;
pub mod experiment;
mod fields;
mod foot;
pub mod hertz;
mod indentation;
mod instructions;
mod lanes;
mod laws;
mod material;
mod order;
mod perturbed;
mod plates;
mod press;
mod readoff;
pub mod rest;
mod rests;
mod rigid;
mod rocking;
mod section;
mod state;
mod surrogate;
pub mod time_step;
mod touch;

pub use body::Body;
pub use dynamics::{Dynamics, Energy, Motion};
pub use ensemble::{Drawn, Lying, Spread, ensemble};
pub use error::ContactError;
pub use fields::Fields;
pub use foot::Foot;
pub use indentation::indentation_mm;
pub use instructions::Instructions;
pub use laws::{LAWS, Law, Parameter, Program};
pub use material::Material;
pub use perturbed::{normal_vector, perturbed};
pub use plates::{Plates, Reaction};
pub use press::{Loading, Press, Sample};
pub use readoff::{
    Agreement, CurvePoint, HertzFit, QUASI_STATIC, QuasiStatic, SETTLED, Transition, agreement, fit_hertz,
    quasi_static, transition,
};
pub use rests::{Rest, Rests};
pub use rocking::{Contacts, Rocking, rocking};
pub use section::section;
pub use state::StateError;
pub use surrogate::Surrogate;
pub use touch::{Contact, Plate, Touch};
