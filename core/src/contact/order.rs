//! Renumbering of elements and nodes along Morton's curve: neighbours in space are neighbours in memory.

use crate::mesh::TetMesh;

/// Bits of a Morton number for each axis.
const BITS: u32 = 20;

/// Spreads the lowest 21 bits so that two empty bits follow each.
fn spread(x: u64) -> u64 {
    let mut x = x & 0x1f_ffff;
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        x = (x | (x << shift)) & mask;
    }
    x
}

/// The tetrahedra's numbers along Morton's curve through their centres.
pub(super) fn elements(mesh: &TetMesh) -> Vec<u32> {
    let mut low = [f64::INFINITY; 3];
    let mut high = [f64::NEG_INFINITY; 3];
    for p in &mesh.nodes {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let side = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let scale = f64::from((1u32 << BITS) - 1) / side;
    let key = |t: usize| {
        let corners = mesh.corners(t);
        (0..3).fold(0, |key, k| {
            let middle = 0.25 * corners.iter().map(|p| p[k]).sum::<f64>();
            key | spread(((middle - low[k]) * scale) as u64) << k
        })
    };
    let mut keyed: Vec<(u64, u32)> = (0..mesh.tets.len()).map(|t| (key(t), t as u32)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, t)| t).collect()
}

/// The nodes' numbers in the order in which these elements first name them.
pub(super) fn nodes(mesh: &TetMesh, elements: &[u32]) -> Vec<u32> {
    let mut seen = vec![false; mesh.nodes.len()];
    let mut out = Vec::with_capacity(mesh.nodes.len());
    for &t in elements {
        for n in mesh.tets[t as usize] {
            if !std::mem::replace(&mut seen[n as usize], true) {
                out.push(n);
            }
        }
    }
    out
}
