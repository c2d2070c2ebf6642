//! Integrals of patterns.

/// Simpson's rule over `panels` of equal width, see [`integral_over`].
pub(super) fn integral(f: &impl Fn(f64) -> f64, [from, to]: [f64; 2], panels: usize, tolerance: f64) -> f64 {
    let width = (to - from) / panels as f64;
    integral_over(f, (0..=panels).map(|edge| from + width * edge as f64), tolerance)
}

/// Simpson's rule over the panels between rising `edges`, each halved until its integral changes by no more than
/// `tolerance`.
pub(super) fn integral_over(f: &impl Fn(f64) -> f64, edges: impl IntoIterator<Item = f64>, tolerance: f64) -> f64 {
    /// Enough to isolate 1e-6 of a panel at an edge.
    const MOST_HALVINGS: u32 = 24;
    let mut edges = edges.into_iter();
    let Some(mut start) = edges.next() else { return 0.0 };
    let (mut sum, mut at_start) = (0.0, f(start));
    for end in edges {
        if end <= start {
            continue;
        }
        let (at_middle, at_end) = (f(0.5 * (start + end)), f(end));
        sum += halved(f, [start, end], [at_start, at_middle, at_end], tolerance, MOST_HALVINGS);
        (start, at_start) = (end, at_end);
    }
    sum
}

/// One panel, with `f` known at both ends and in the middle.
fn halved(f: &impl Fn(f64) -> f64, [a, b]: [f64; 2], [fa, fm, fb]: [f64; 3], tolerance: f64, halvings: u32) -> f64 {
    let (middle, sixth) = (0.5 * (a + b), (b - a) / 6.0);
    let (left, right) = (f(0.5 * (a + middle)), f(0.5 * (middle + b)));
    let whole = sixth * (fa + 4.0 * fm + fb);
    let halves = 0.5 * sixth * (fa + 4.0 * left + 2.0 * fm + 4.0 * right + fb);
    let change = halves - whole;
    if halvings == 0 || change.abs() <= tolerance || change.is_nan() {
        // What further halvings would change, by the rule's fourth order.
        return halves + change / 15.0;
    }
    halved(f, [a, middle], [fa, left, fm], tolerance, halvings - 1)
        + halved(f, [middle, b], [fm, right, fb], tolerance, halvings - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_of_curves_and_edges() {
        let third = integral(&|x: f64| x * x, [0.0, 1.0], 1, 1e-9);
        assert!((third - 1.0 / 3.0).abs() < 1e-12);
        let edge = integral(&|x: f64| f64::from(u8::from(x < 0.3)), [-1.0, 1.0], 4, 1e-9);
        assert!((edge - 1.3).abs() < 1e-7, "{edge}");
        let peak = integral(&|x: f64| (-(x / 0.01).powi(2)).exp(), [-1.0, 1.0], 64, 1e-9);
        assert!((peak - 0.01 * std::f64::consts::PI.sqrt()).abs() < 1e-8, "{peak}");
    }
}
