//! One slice: the common part of all views' strips on a row.

use super::cut::{Chain, Corner, clip, dot};
use super::directions::Direction;

/// Edges shorter than this share of the farthest coordinate are rounding.
const SHORT: f64 = 1e-12;

/// Scratch buffers for rows, so that a row whose outlines are single intervals allocates nothing.
#[derive(Debug, Default)]
pub(super) struct ScratchBuffers {
    chain: Chain,
    h: Vec<f64>,
    /// Pieces before and after a gap, while gaps are cut out.
    pieces: Vec<Vec<Corner>>,
    next: Vec<Vec<Corner>>,
}

impl ScratchBuffers {
    /// Adds the slice's convex pieces to `corners`, and the end of each to `ends`.
    ///
    /// First each view's strip from its first to its last interval, all in one go; then the gaps between intervals,
    /// which leave up to two pieces of each piece that they cross.
    pub(super) fn slice(
        &mut self,
        directions: &[Direction],
        normals: &[[f64; 2]],
        row: usize,
        corners: &mut Vec<Corner>,
        ends: &mut Vec<u32>,
    ) {
        let n = directions.len();
        self.h.clear();
        self.h.resize(2 * n, 0.0);
        let mut single = true;
        for (j, d) in directions.iter().enumerate() {
            let Some([low, high]) = d.extent(row) else { return };
            self.h[j] = high;
            self.h[j + n] = -low;
            single = single && d.count(row) == 1;
        }
        let first = corners.len();
        if !self.chain.intersect(normals, &self.h, corners) {
            return;
        }
        if single {
            ends.push(corners.len() as u32);
            return;
        }
        self.pieces.clear();
        self.pieces.push(corners.drain(first..).collect());
        for (j, d) in directions.iter().enumerate() {
            for i in 1..d.count(row) {
                let gap = [d.interval(row, i - 1)[1], d.interval(row, i)[0]];
                self.cut_out(gap, [normals[j], normals[j + n]], [j as u32, (j + n) as u32]);
            }
        }
        for piece in &self.pieces {
            corners.extend_from_slice(piece);
            ends.push(corners.len() as u32);
        }
    }

    /// Takes the gap from all pieces: what is below it keeps its upper side as an edge, what is above its lower side.
    fn cut_out(&mut self, [from, to]: [f64; 2], [up, down]: [[f64; 2]; 2], [below, above]: [u32; 2]) {
        self.next.clear();
        for piece in self.pieces.drain(..) {
            let reach = |side: [f64; 2]| piece.iter().map(|c| dot(side, c.at)).fold(f64::MIN, f64::max);
            if reach(up) <= from || reach(down) <= -to {
                self.next.push(piece);
                continue;
            }
            for (side, h, edge) in [(up, from, below), (down, -to, above)] {
                let mut part = Vec::with_capacity(piece.len() + 1);
                clip(&piece, side, h, edge, &mut part);
                drop_short(&mut part);
                if part.len() > 2 {
                    self.next.push(part);
                }
            }
        }
        std::mem::swap(&mut self.pieces, &mut self.next);
    }
}

/// Drops edges that are rounding, where several lines meet in one point: a cut through it may put them out of order.
fn drop_short(piece: &mut Vec<Corner>) {
    let reach = piece.iter().fold(0.0, |m: f64, c| m.max(c.at[0].abs()).max(c.at[1].abs()));
    let mut k = 0;
    while k < piece.len() && piece.len() > 2 {
        let (a, b) = (piece[k].at, piece[(k + 1) % piece.len()].at);
        if (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) <= SHORT * reach {
            piece.remove(k);
        } else {
            k += 1;
        }
    }
}
