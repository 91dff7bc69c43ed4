//! Tetrahedra and triangles for a body given by a function.
