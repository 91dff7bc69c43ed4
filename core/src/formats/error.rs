//! Errors of reading and writing files.

/// Why a file was not written or not read.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The destination did not take the bytes.
    #[error("writing failed: {0}")]
    Io(#[from] std::io::Error),
    /// What should be written does not fit the format.
    #[error("{format} cannot hold this: {what}")]
    Unfit {
        /// The format.
        format: &'static str,
        /// What is wrong, with value and limit.
        what: String,
    },
    /// The bytes are not a file of a format, or hold nothing that is read.
    #[error("this is not a usable {format} file: {what}; export it again from where it comes from")]
    Read {
        /// The format.
        format: &'static str,
        /// What is wrong, with the line or the position.
        what: String,
    },
    /// A body too far from the origin for the coordinates to describe it.
    #[error(
        "the body in this {format} file is {longest} long and lies up to {far} from the origin, where coordinates in {kind} \
         precision are {step} apart (all in the file's unit): {steps:.0} steps over the body, at least {least} are needed; move \
         it to the origin before it is exported",
        steps = longest / step
    )]
    Resolution {
        /// The format.
        format: &'static str,
        /// `single`, `double`, or so many decimal digits.
        kind: &'static str,
        /// The longest side of the body's box, in the file's unit.
        longest: f64,
        /// Its greatest coordinate, in the file's unit.
        far: f64,
        /// From one coordinate to the next there, in the file's unit.
        step: f64,
        /// The steps that are needed over the body.
        least: f64,
    },
    /// The bytes are not an STL file.
    #[error("this is not a usable STL file: {0}; export it again from where it comes from")]
    Stl(String),
}
