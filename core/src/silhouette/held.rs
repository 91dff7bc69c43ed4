//! Where the other views' hull lies in a picture.

/// The part of a picture in which the lines of sight pass through what the other views leave of the grain, in square cells.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldByOthers {
    /// Column and row of the middle of the first cell.
    pub origin: [usize; 2],
    /// Edge of a cell, pixels.
    pub pitch: usize,
    /// Cells along a row and along a column.
    pub size: [usize; 2],
    /// `[row, column]`, row-major.
    pub cells: Vec<bool>,
}

impl HeldByOthers {
    /// Whether the cell at a pixel of the picture is held; nothing beyond the cells is.
    pub fn holds(&self, column: usize, row: usize) -> bool {
        let cell = |k: usize, at: usize| {
            let n = (at + self.pitch / 2).checked_sub(self.origin[k])? / self.pitch;
            (n < self.size[k]).then_some(n)
        };
        (cell(0, column).zip(cell(1, row))).is_some_and(|(x, y)| self.cells[y * self.size[0] + x])
    }
}
