//! The plan: which sets there are. Each is written out, so that a name always means the same pictures.

mod bright;
mod clear;
mod dark;
mod optics;
mod stand;

use super::plan::Row;

/// Shapes of grains, as their files are called.
mod shapes {
    /// A rounded natural sand grain.
    pub const ROUND: &str = "sand_ma107_00002";
    /// A flat natural sand grain.
    pub const FLAT: &str = "sand_ma107_00107";
    /// Crushed gravel.
    pub const CRUSHED: &str = "gravel_az_00002";
    /// Angular grains.
    pub const ANGULAR: [&str; 4] =
        ["ct_ma160_00357", "ct_ma160_00593", "ct_ma160_02444", "ct_cement140_02210"];
    /// A ball.
    pub const BALL: &str = "analytic_Sphere_R_1";
    /// An ellipsoid with axes as 1 : 2 : 3.
    pub const ELLIPSOID: &str = "analytic_Ellipsoid_R_1_2_3";
    /// A sand grain of 250 facets, and the same subdivided.
    pub const FACETS: [&str; 2] = ["lsdem_sand", "lsdem_sand_finer"];
}

/// All sets, the kinds mixed, so that any first part of them is varied.
pub fn all() -> Vec<Row> {
    let mut kinds =
        [bright::rows(), clear::rows(), dark::rows(), stand::rows(), optics::rows()].map(Vec::into_iter);
    let mut out = Vec::new();
    loop {
        let before = out.len();
        out.extend(kinds.iter_mut().filter_map(Iterator::next));
        if out.len() == before {
            return out;
        }
    }
}
