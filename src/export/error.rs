//! What can go wrong between a mesh and a file.

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
        /// What is wrong, with the line or the place.
        what: String,
    },
    /// The bytes are not an STL file.
    #[error("this is not a usable STL file: {0}; export it again from where it comes from")]
    Stl(String),
}
