//! Errors of reading a test's export.

/// Why a file is no usable test.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExperimentError {
    /// No column of displacement or force.
    #[error(
        "no column of {what} is known in the header `{header}`; known are {known} (in English or Chinese): export the channel \
         under one of these names"
    )]
    Column {
        /// What is missing.
        what: &'static str,
        /// The header as it stands.
        header: String,
        /// Names that are known.
        known: &'static str,
    },
    /// A unit that is not known, or none.
    #[error(
        "the unit `{unit}` of {what} is not known in the header `{header}`; known are {known}: export in one of these"
    )]
    Unit {
        /// Of what.
        what: &'static str,
        /// The unit.
        unit: String,
        /// The header as it stands.
        header: String,
        /// Units that are known.
        known: &'static str,
    },
    /// A line that is no row of numbers.
    #[error("line {line}: `{text}` is no number; the header is `{header}`")]
    Number {
        /// The line, from 1.
        line: usize,
        /// What stands there.
        text: String,
        /// The header.
        header: String,
    },
    /// Too little to compare.
    #[error("{rows} rows of numbers, {what}; at least 5 are needed, of which 3 after contact")]
    Short {
        /// Rows found.
        rows: usize,
        /// What is missing.
        what: &'static str,
    },
    /// A compliance that makes no sense.
    #[error(
        "a compliance of {value} µm/N: it must be zero or more, and finite; a stiff machine has 0.01 to 0.1 µm/N"
    )]
    Compliance {
        /// What was given or measured.
        value: f64,
    },
}
