//! Merges corners at the same position into one vertex.

use model::is_degenerate;

/// No vertex.
const NONE: u32 = u32::MAX;

/// Most vertices that are compared before a corner gets a vertex of its own: a file may be crafted so that all hash to
/// one slot of the table.
const LONGEST_SEARCH: usize = 200;

/// Collects triangles and gives them shared vertices.
pub(super) struct Welder {
    pub positions: Vec<[f32; 3]>,
    pub triangles: Vec<[u32; 3]>,
    /// Triangles without area, which are left out.
    pub degenerate: usize,
    /// Hash table of the vertices; a power of two long, and never more than half full.
    table: Vec<u32>,
}

impl Welder {
    /// For about `triangles` triangles, which usually have half as many vertices.
    pub fn new(triangles: usize) -> Welder {
        Welder {
            positions: Vec::with_capacity(triangles / 2 + 3),
            triangles: Vec::with_capacity(triangles),
            degenerate: 0,
            table: vec![NONE; (triangles + 8).next_power_of_two()],
        }
    }

    /// Adds a triangle of finite corners, if it has area.
    pub fn add(&mut self, corners: [[f32; 3]; 3]) {
        let [a, b, c] = corners;
        if is_degenerate(a, b, c) {
            self.degenerate += 1;
            return;
        }
        let triangle = corners.map(|corner| self.vertex(corner));
        self.triangles.push(triangle);
    }

    fn vertex(&mut self, position: [f32; 3]) -> u32 {
        // -0 becomes 0.
        let position = position.map(|x| x + 0.0);
        let mask = self.table.len() - 1;
        let mut place = place(position) & mask;
        let mut free = None;
        for _ in 0..LONGEST_SEARCH {
            let vertex = self.table[place];
            if vertex == NONE {
                free = Some(place);
                break;
            }
            if self.positions[vertex as usize] == position {
                return vertex;
            }
            place = (place + 1) & mask;
        }
        let vertex = self.positions.len() as u32;
        self.positions.push(position);
        if let Some(place) = free {
            self.table[place] = vertex;
            if self.positions.len() * 2 > self.table.len() {
                self.grow();
            }
        }
        vertex
    }

    fn grow(&mut self) {
        let mask = self.table.len() * 2 - 1;
        self.table = vec![NONE; mask + 1];
        for (vertex, position) in self.positions.iter().enumerate() {
            let places = (0..LONGEST_SEARCH).map(|step| (place(*position) + step) & mask);
            if let Some(place) = places.into_iter().find(|&place| self.table[place] == NONE) {
                self.table[place] = vertex as u32;
            }
        }
    }
}

/// Hash of `position`, not yet reduced to the length of the table.
fn place(position: [f32; 3]) -> usize {
    // Odd constants spread the bits upwards: the digits of the golden ratio and of square roots.
    let [x, y, z] = position.map(|value| u64::from(value.to_bits()));
    let mixed = x.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ y.wrapping_mul(0xbb67_ae85_84ca_a73b);
    let mixed = (mixed ^ z).wrapping_mul(0x3c6e_f372_fe94_f82b);
    (mixed ^ (mixed >> 32)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_different_corners_are_welded_too() {
        let mut welder = Welder::new(0);
        let at = |i: u32| [i as f32, (i * i % 7919) as f32 * 0.1, -(i as f32)];
        for round in 0..2 {
            for i in 0..5000 {
                welder.add([at(i), at(i + 1), at(i + 2)]);
            }
            assert_eq!((welder.positions.len(), welder.degenerate), (5002, 0), "round {round}");
        }
        assert!(welder.triangles[..5000] == welder.triangles[5000..]);
    }
}
