//! A grid of heights over a rectangle about the z axis.

use glam::DVec3;
use ground::parallel;

/// The ground, as a sheet of triangles.
pub(super) struct Terrain {
    /// Extent along x and y, m.
    pub size: [f64; 2],
    /// Squares of the grid along x and y.
    pub cells: [usize; 2],
    /// Heights of the grid points, row by row along x.
    pub heights: Vec<f32>,
}

impl Terrain {
    /// A grid on which the height of each point is a function of its position.
    pub fn from_heights(size: [f64; 2], cells: [usize; 2], height: impl Fn(f64, f64) -> f64 + Sync) -> Self {
        let mut terrain = Terrain { size, cells, heights: Vec::new() };
        let mut heights = vec![0.0; (cells[0] + 1) * (cells[1] + 1)];
        parallel::for_each_chunk(&mut heights, cells[0] + 1, |row, heights| {
            for (column, value) in heights.iter_mut().enumerate() {
                let [x, y] = terrain.place(column, row);
                *value = height(x, y) as f32;
            }
        });
        terrain.heights = heights;
        terrain
    }

    /// Width of a square along x and y, m.
    pub fn step(&self) -> [f64; 2] {
        std::array::from_fn(|axis| self.size[axis] / self.cells[axis] as f64)
    }

    /// Width of a square along its longer side, m.
    pub fn widest(&self) -> f64 {
        self.step()[0].max(self.step()[1])
    }

    pub fn columns(&self) -> usize {
        self.cells[0] + 1
    }

    /// Position of a grid point.
    pub fn place(&self, column: usize, row: usize) -> [f64; 2] {
        let along = |axis: usize, index: usize| self.size[axis] * (index as f64 / self.cells[axis] as f64 - 0.5);
        [along(0, column), along(1, row)]
    }

    fn point(&self, column: usize, row: usize) -> DVec3 {
        let [x, y] = self.place(column, row);
        DVec3::new(x, y, self.heights[row * self.columns() + column].into())
    }

    /// Positions of all grid points.
    pub fn positions(&self) -> Vec<[f32; 3]> {
        let [columns, rows] = self.cells;
        let points = (0..=rows).flat_map(|row| (0..=columns).map(move |column| (column, row)));
        points.map(|(column, row)| self.point(column, row).as_vec3().to_array()).collect()
    }

    /// Unit normals of all grid points.
    pub fn normals(&self) -> Vec<[f32; 3]> {
        let [columns, rows] = self.cells;
        let mut normals = vec![[0.0; 3]; self.heights.len()];
        parallel::for_each_chunk(&mut normals, columns + 1, |row, normals| {
            for (column, normal) in normals.iter_mut().enumerate() {
                let x = self.point((column + 1).min(columns), row) - self.point(column.saturating_sub(1), row);
                let y = self.point(column, (row + 1).min(rows)) - self.point(column, row.saturating_sub(1));
                *normal = x.cross(y).normalize().as_vec3().to_array();
            }
        });
        normals
    }

    /// The two triangles of a square, normals up.
    pub fn triangles(&self, column: usize, row: usize) -> [[u32; 3]; 2] {
        let corner = |i: usize, j: usize| ((row + j) * self.columns() + column + i) as u32;
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        if falls(column, row) { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
    }

    /// Height of the ground at a position; outside, that of the nearest edge.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let split = |axis: usize, at: f64| {
            let cells = self.cells[axis];
            let along = ((at / self.size[axis] + 0.5) * cells as f64).clamp(0.0, cells as f64);
            let cell = (along as usize).min(cells - 1);
            (cell, along - cell as f64)
        };
        let ((column, fx), (row, fy)) = (split(0, x), split(1, y));
        let corner = |i: usize, j: usize| f64::from(self.heights[(row + j) * self.columns() + column + i]);
        let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
        match (falls(column, row), fx >= fy, fx + fy <= 1.0) {
            (false, true, _) => a + fx * (b - a) + fy * (c - b),
            (false, false, _) => a + fy * (d - a) + fx * (c - d),
            (true, _, true) => a + fx * (b - a) + fy * (d - a),
            (true, _, false) => c + (1.0 - fx) * (d - c) + (1.0 - fy) * (b - c),
        }
    }

    /// Rise per metre along x and y, over `reach` m.
    fn rise(&self, x: f64, y: f64, reach: f64) -> [f64; 2] {
        let half = reach / 2.0;
        let rise_x = self.height(x + half, y) - self.height(x - half, y);
        let rise_y = self.height(x, y + half) - self.height(x, y - half);
        [rise_x / reach, rise_y / reach]
    }

    /// Unit normal of the ground averaged over `reach` m, as for an object of that length resting on it.
    pub fn normal(&self, x: f64, y: f64, reach: f64) -> DVec3 {
        let [rise_x, rise_y] = self.rise(x, y, reach);
        DVec3::new(-rise_x, -rise_y, 1.0).normalize()
    }

    /// Rise per metre in the steepest direction, over 2 m or two squares.
    pub fn slope(&self, x: f64, y: f64) -> f64 {
        let [rise_x, rise_y] = self.rise(x, y, 2.0 * self.widest().max(1.0));
        rise_x.hypot(rise_y)
    }

    /// Lowest and highest point.
    pub fn height_range(&self) -> [f32; 2] {
        let all = self.heights.iter();
        all.fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], &height| [low.min(height), high.max(height)])
    }
}

/// Whether the diagonal of a square falls from the upper left to the lower right corner: squares alternate, so that no
/// direction stands out.
fn falls(column: usize, row: usize) -> bool {
    (column + row) % 2 == 1
}
