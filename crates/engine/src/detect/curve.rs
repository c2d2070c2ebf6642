//! Functions of range given by points.

/// A function of range, linear between its points and constant outside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RangeCurve {
    ranges: Vec<f32>,
    values: Vec<f32>,
}

impl RangeCurve {
    /// `points`: range, m, ascending, and the value there.
    pub fn new(points: impl Iterator<Item = (f64, f64)>) -> RangeCurve {
        let (ranges, values) = points.map(|(range, value)| (range as f32, value as f32)).unzip();
        RangeCurve { ranges, values }
    }

    /// Whether it has no points.
    pub fn is_empty(&self) -> bool {
        self.ranges.is_empty()
    }

    /// Its value at `range` m; 0 if it has no points.
    // Separate from the loops that call it, to keep these short enough for vector instructions.
    #[inline(never)]
    pub fn at(&self, range: f32) -> f32 {
        let behind = self.ranges.partition_point(|&from| from <= range);
        match (behind.checked_sub(1), self.values.get(behind)) {
            (Some(before), Some(&to)) => {
                let (from, value) = (self.ranges[before], self.values[before]);
                value + (to - value) * ((range - from) / (self.ranges[behind] - from))
            }
            (None, Some(&value)) => value,
            (Some(last), None) => self.values[last],
            (None, None) => 0.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_linear_between_points_and_constant_outside() {
        let curve = RangeCurve::new([(2.0, 10.0), (4.0, 20.0), (8.0, 0.0)].into_iter());
        for (range, expected) in
            [(0.0, 10.0), (2.0, 10.0), (3.0, 15.0), (4.0, 20.0), (7.0, 5.0), (8.0, 0.0), (1e9, 0.0)]
        {
            assert_eq!(curve.at(range), expected, "{range}");
        }
        assert_eq!((curve.at(f32::INFINITY), curve.at(f32::NAN)), (0.0, 10.0));
        assert_eq!((RangeCurve::default().at(3.0), RangeCurve::default().is_empty()), (0.0, true));
    }
}
