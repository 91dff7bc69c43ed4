//! Errors of a compression.

use crate::mesh::TetFault;

/// Why a grain cannot be compressed, or no further.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ContactError {
    /// A figure that looks like a slip of unit.
    #[error(transparent)]
    Doubt(#[from] crate::plausible::Doubt),
    /// A setting outside its limits.
    #[error("{name} = {value}{gap}{unit}: it must be {limit}; {remedy}", gap = if unit.is_empty() { "" } else { " " })]
    Setting {
        /// The setting.
        name: &'static str,
        /// What was given.
        value: f64,
        /// Its unit.
        unit: &'static str,
        /// What it must be.
        limit: &'static str,
        /// What to do.
        remedy: &'static str,
    },
    /// A parameter that the material's law does not take.
    #[error("{name}: the material {law} takes no such parameter; of its own it takes {known}")]
    Parameter {
        /// What was given.
        name: String,
        /// The law.
        law: &'static str,
        /// What it takes.
        known: String,
    },
    /// The mesh cannot be computed with.
    #[error("the mesh cannot be compressed: {0}; mesh the body again, or repair the file's elements")]
    Mesh(#[from] TetFault),
    /// The mesh is in several pieces that nothing joins.
    #[error(
        "the mesh has {pieces} pieces that share no node (the smaller ones have {detached} of {elements} tetrahedra): a \
         grain is one piece; leave out what is detached"
    )]
    Detached {
        /// How many pieces.
        pieces: usize,
        /// Tetrahedra that are not in the largest.
        detached: usize,
        /// All tetrahedra.
        elements: usize,
    },
    /// A body whose size is no grain's.
    #[error(
        "the body is {size_mm:.3e} mm long, which is no grain's size ({least:e} to {most:e} mm): the file's numbers seem to be \
         {guess}; scale them to mm"
    )]
    Size {
        /// The longest side of its box, mm.
        size_mm: f64,
        /// The least that is taken, mm.
        least: f64,
        /// The most that is taken, mm.
        most: f64,
        /// What the numbers seem to be.
        guess: &'static str,
    },
    /// A body that has no volume, or a corner that is no number.
    #[error(
        "all corners of the body lie in one plane, or one is no number: a grain has a volume; check the file"
    )]
    Flat,
    /// A rest that the body has not.
    #[error("rest {asked}: this grain has rests 1 to {count}; `grainrig rests` shows them")]
    NoRest {
        /// What was asked for.
        asked: usize,
        /// How many there are.
        count: usize,
    },
    /// The plates do not meet the body.
    #[error(
        "the plates at z = {lower_mm} and {upper_mm} mm miss the grain, which reaches from {bottom_mm} to {top_mm} mm; put \
         them at its ends; where a coarse mesh stands out of the surface that it was made of, make it finer where the plates touch \
         it (size_at_contact_mm)"
    )]
    Missed {
        /// The lower plate's height, mm.
        lower_mm: f64,
        /// The upper plate's height, mm.
        upper_mm: f64,
        /// The grain's lowest point, mm.
        bottom_mm: f64,
        /// Its highest point, mm.
        top_mm: f64,
    },
    /// A time step beyond the stable one.
    #[error(
        "a time step of {asked_s:.3e} s is above the stable one of {stable_s:.3e} s; leave it out, or let mass scaling raise it"
    )]
    Unstable {
        /// What was asked for, s.
        asked_s: f64,
        /// What central differences bear, s.
        stable_s: f64,
    },
    /// An element turned inside out or became no number.
    #[error(
        "element {element} {what} at t = {time_s:.6e} s (step {step}); the last good state is kept: use a finer mesh there, a \
         lower speed, or stop at a smaller approach"
    )]
    Broken {
        /// The element's number in the mesh, from 0.
        element: usize,
        /// What became of it.
        what: &'static str,
        /// When, s.
        time_s: f64,
        /// In which step.
        step: u64,
    },
}
