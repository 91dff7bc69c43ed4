//! The visual hull and its measures.
