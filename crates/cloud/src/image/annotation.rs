//! What is seen of each instance in an image: boxes, masks, how much of it is cut off or hidden.

use super::RangeImage;
use crate::InstanceBox;
use std::collections::HashMap;

/// What an image shows of an instance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Annotation {
    /// Object; never 0.
    pub instance_id: u32,
    /// Category of most of its pixels; 0 = unlabelled.
    pub category_id: u32,
    /// First column, first row, columns and rows of the box around its pixels.
    pub bounds: [u32; 4],
    /// Number of its pixels.
    pub area: u32,
    /// Left, top, right and bottom, pixels, of the whole object, regardless of occlusion and of the borders of the
    /// image; `None`: unknown.
    pub amodal: Option<[f64; 4]>,
    /// Fraction of the area of the amodal box that is outside the image, 0 to 1; `None`: unknown.
    pub truncation: Option<f64>,
    /// Fraction hidden by what is in front of it, 0 to 1 ([`InstanceBox::visible`]); `None`: unknown.
    pub occlusion: Option<f64>,
}

/// Where an instance is in an image, while its pixels are counted.
struct Seen {
    /// First and last column and row.
    low: [u32; 2],
    high: [u32; 2],
    area: u32,
    /// Categories and their numbers of pixels.
    categories: Vec<(u32, u32)>,
}

/// What `image` shows of each instance, by ascending number. `boxes` are those of the scan, with boxes in the image
/// ([`InstanceBox::image`]), as far as they are known.
pub fn annotations(image: &RangeImage, boxes: &[InstanceBox]) -> Vec<Annotation> {
    of_pixels([image.width, image.height], &image.instance_id, &image.category_id, boxes)
}

/// [`annotations`] of an image of this width and height, from the layers that this requires.
pub(super) fn of_pixels(
    size: [usize; 2],
    instance_id: &[u32],
    category_id: &[u32],
    boxes: &[InstanceBox],
) -> Vec<Annotation> {
    let boxes: HashMap<u32, &InstanceBox> = boxes.iter().map(|found| (found.instance_id, found)).collect();
    let mut all: Vec<Annotation> = seen(size[0], instance_id, category_id)
        .into_iter()
        .map(|(instance_id, seen)| {
            let category = seen.categories.iter().max_by_key(|(id, count)| (*count, std::cmp::Reverse(*id)));
            let whole = boxes.get(&instance_id);
            let amodal = whole.and_then(|whole| whole.image);
            Annotation {
                instance_id,
                category_id: category.map_or(0, |(id, _)| *id),
                bounds: [seen.low[0], seen.low[1], seen.high[0] - seen.low[0] + 1, seen.high[1] - seen.low[1] + 1],
                area: seen.area,
                amodal,
                truncation: amodal.map(|amodal| truncation(amodal, size.map(|count| count as f64))),
                occlusion: whole.map(|whole| 1.0 - whole.visible),
            }
        })
        .collect();
    all.sort_by_key(|found| found.instance_id);
    all
}

/// Where instances are in an image of this width.
fn seen(width: usize, instance_id: &[u32], category_id: &[u32]) -> HashMap<u32, Seen> {
    let mut all: HashMap<u32, Seen> = HashMap::new();
    for (row, line) in instance_id.chunks(width.max(1)).enumerate() {
        let mut column = 0;
        for run in line.chunk_by(|a, b| a == b) {
            let first = [column as u32, row as u32];
            column += run.len();
            if run[0] == 0 {
                continue;
            }
            let last = [column as u32 - 1, row as u32];
            let new = || Seen { low: first, high: last, area: 0, categories: Vec::new() };
            let seen = all.entry(run[0]).or_insert_with(new);
            seen.low = [0, 1].map(|axis| seen.low[axis].min(first[axis]));
            seen.high = [0, 1].map(|axis| seen.high[axis].max(last[axis]));
            seen.area += run.len() as u32;
            let from = row * width + first[0] as usize;
            for run in category_id.get(from..from + run.len()).unwrap_or_default().chunk_by(|a, b| a == b) {
                match seen.categories.iter_mut().find(|(id, _)| *id == run[0]) {
                    Some((_, count)) => *count += run.len() as u32,
                    None => seen.categories.push((run[0], run.len() as u32)),
                }
            }
        }
    }
    all
}

/// Fraction of the area of a box that is outside an image of this size; for a box without an area, 1 if it is outside,
/// else 0.
fn truncation([left, top, right, bottom]: [f64; 4], size: [f64; 2]) -> f64 {
    let part = |low: f64, high: f64, size: f64| {
        let inside = high.min(size) - low.max(0.0);
        if high > low { (inside / (high - low)).clamp(0.0, 1.0) } else { f64::from(u8::from(inside >= 0.0)) }
    };
    1.0 - part(left, right, size[0]) * part(top, bottom, size[1])
}

/// The pixels of an instance as COCO counts them: column by column, how many are not of it, then how many are, and so
/// on; the counts add up to all pixels.
pub type Runs = Vec<u32>;

/// The pixels of every instance of `image`, by number; none if it has no instances.
pub fn masks(image: &RangeImage) -> HashMap<u32, Runs> {
    let (width, height) = (image.width, image.height);
    if image.instance_id.len() != image.len() {
        return HashMap::new();
    }
    let columns = transposed(&image.instance_id, width, height);
    let mut all: HashMap<u32, (Runs, u32)> = HashMap::new();
    let mut at = 0;
    for run in columns.chunk_by(|a, b| a == b) {
        let end = at + run.len() as u32;
        if run[0] != 0 {
            let (runs, to) = all.entry(run[0]).or_default();
            runs.extend([at - *to, end - at]);
            *to = end;
        }
        at = end;
    }
    let finish = |(id, (mut runs, to)): (u32, (Runs, u32))| {
        if to < at {
            runs.push(at - to);
        }
        (id, runs)
    };
    all.into_iter().map(finish).collect()
}

/// `pixels`, which are row by row, in the order column by column.
fn transposed(pixels: &[u32], width: usize, height: usize) -> Vec<u32> {
    /// Squares of this side stay in the cache.
    const SIDE: usize = 32;
    let mut columns = vec![0; pixels.len()];
    for top in (0..height).step_by(SIDE) {
        for left in (0..width).step_by(SIDE) {
            for column in left..(left + SIDE).min(width) {
                for row in top..(top + SIDE).min(height) {
                    columns[column * height + row] = pixels[row * width + column];
                }
            }
        }
    }
    columns
}

/// Runs as the text that COCO's files hold (maskApi.c of the COCO API, rleToString): each count from the fourth on as
/// its difference from the one two before, in digits of 5 bits, the least significant first, coded from the character
/// `0` on.
pub fn runs_text(runs: &[u32]) -> String {
    let mut text = String::with_capacity(2 * runs.len());
    for (index, &run) in runs.iter().enumerate() {
        let before = if index > 2 { runs[index - 2] } else { 0 };
        let mut rest = i64::from(run) - i64::from(before);
        loop {
            let digit = (rest & 0x1f) as u8;
            rest >>= 5;
            // The highest bit of the last digit is the sign.
            let more = rest != if digit & 0x10 == 0 { 0 } else { -1 };
            text.push(char::from(b'0' + digit + if more { 0x20 } else { 0 }));
            if !more {
                break;
            }
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::range_image::tests::wall;
    use super::*;
    use crate::export::Instrument as _;
    use crate::test_sensor::TestSensor;
    use glam::DVec3;
    use ground::pose::Pose;

    fn image() -> RangeImage {
        let camera = TestSensor::camera();
        RangeImage::new(&wall(camera.beams()), &camera.image_grid().unwrap()).unwrap()
    }

    #[test]
    fn boxes_bound_their_pixels() {
        let image = image();
        let whole = |instance_id, visible, image| InstanceBox {
            frame: 0,
            time: 0.0,
            track_id: instance_id,
            instance_id,
            category_id: 1,
            pose: Pose::IDENTITY,
            size: DVec3::ONE,
            velocity: DVec3::ZERO,
            points: 1,
            visible,
            image,
        };
        let boxes = [whole(5, 0.75, Some([-2.0, 0.0, 2.0, 6.0])), whole(6, 1.0, None)];
        let found = annotations(&image, &boxes);
        let all: Vec<_> = found.iter().map(|a| (a.instance_id, a.category_id, a.bounds, a.area)).collect();
        assert_eq!(all, [(5, 1, [0, 0, 2, 3], 5), (70_000, 2, [2, 0, 2, 3], 5)]);
        assert_eq!((found[0].truncation, found[0].occlusion), (Some(0.75), Some(0.25)));
        assert_eq!((found[1].amodal, found[1].truncation, found[1].occlusion), (None, None, None));
    }

    #[test]
    fn what_is_outside_is_truncated() {
        let size = [100.0, 50.0];
        assert_eq!(truncation([10.0, 10.0, 20.0, 20.0], size), 0.0);
        assert_eq!(truncation([-10.0, 10.0, 10.0, 20.0], size), 0.5);
        assert_eq!(truncation([90.0, 40.0, 110.0, 60.0], size), 0.75);
        assert_eq!(truncation([-20.0, 10.0, -10.0, 20.0], size), 1.0);
        assert_eq!((truncation([5.0; 4], size), truncation([-5.0; 4], size)), (0.0, 1.0));
    }

    #[test]
    fn masks_count_column_by_column_and_part_the_image() {
        let image = image();
        let masks = masks(&image);
        // Pixel 0 is the first of its column, pixel 7 the middle of the last.
        assert_eq!(masks[&5], [1, 5, 6]);
        assert_eq!(masks[&70_000], [6, 4, 1, 1]);
        for (id, runs) in &masks {
            assert_eq!(runs.iter().sum::<u32>(), 12, "{id}");
            let area: u32 = runs.iter().skip(1).step_by(2).sum();
            assert_eq!(area, image.instance_id.iter().filter(|other| *other == id).count() as u32);
        }
    }

    #[test]
    fn texts_of_runs_are_those_of_coco() {
        // By pycocotools 2.0.11, mask.frPyObjects.
        for (runs, text) in
            [(&[1, 5, 6][..], "156"), (&[6, 4, 1, 1], "641M"), (&[0, 3, 100, 40, 7, 1000, 2], "03T3U1SMPn0K")]
        {
            assert_eq!(runs_text(runs), text, "{runs:?}");
        }
    }
}
