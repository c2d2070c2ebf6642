//! What a depth camera, or a sensor that turns or sweeps, sees: a scan as an image.

use super::filled;
use crate::cloud::{Field, FieldSet, Frame, PointCloud};
use crate::emitter::{ImageGrid, Intrinsics};
use crate::ground::error::{Error, Result};
use crate::ground::pose::Pose;
use crate::scene::Labels;
use glam::{Quat, Vec3};
use std::sync::Arc;

/// A scan as an image: row by row from the top left, each pixel with the return of its beam; of several, the nearest.
/// What the cloud has no columns for is empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RangeImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Of a camera.
    pub intrinsics: Option<Intrinsics>,
    /// Measured slant range, m; NaN where there is no return.
    pub range: Vec<f32>,
    /// Measured distance along the axis of a camera, m, NaN where there is no return; empty for other sensors.
    pub depth: Vec<f32>,
    /// Semantic class; 0 = unlabelled, or no return.
    pub category_id: Vec<u32>,
    /// Part of the object; 0 = unlabelled, or no return.
    pub part_id: Vec<u32>,
    /// Object; 0 = unlabelled, or no return.
    pub instance_id: Vec<u32>,
    /// Base colour of the surface, sRGB; black where there is no return.
    pub color: Vec<[u8; 3]>,
    /// What the instrument reports; NaN where there is no return.
    pub intensity: Vec<f32>,
    /// Full scale of `intensity`; relative energy has none.
    pub intensity_full_scale: Option<f32>,
    /// Unit normals of the surfaces: right, up and back, towards who looks along the axis of the sensor (-y, z, -x of
    /// its frame); NaN where there is no return.
    pub normal: Vec<[f32; 3]>,
    /// World pose of the sensor as it starts.
    pub sensor_pose: Pose,
    /// Names of the numbers.
    pub labels: Arc<Labels>,
}

/// A pixel without a row of the cloud.
const NONE: u32 = u32::MAX;

impl RangeImage {
    /// The columns that an image is made from.
    pub fn fields() -> FieldSet {
        let own = [Field::Beam, Field::Range, Field::Depth, Field::CategoryId, Field::PartId, Field::InstanceId];
        let looks = [Field::Red, Field::Green, Field::Blue, Field::Intensity];
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ];
        own.into_iter().chain(looks).chain(normals).collect()
    }

    /// The image of `cloud`, one scan of the sensor that makes images like `grid` ([`Sensor::image_grid`]), with misses
    /// or without, in any order. It must have the columns `beam` and `range`.
    ///
    /// [`Sensor::image_grid`]: crate::Sensor::image_grid
    ///
    /// # Errors
    /// A cloud without these columns, or of another sensor; no memory.
    pub fn new(cloud: &PointCloud, grid: &ImageGrid) -> Result<RangeImage> {
        let columns = &cloud.columns;
        let (beams, ranges) = (&columns.beam, &columns.range);
        if [beams.len(), ranges.len()] != [cloud.len; 2] || cloud.len >= NONE as usize {
            let allowed = "a scan with the columns beam and range, from which images are made";
            return Err(Error::invalid("cloud", format!("{} points without them", cloud.len), allowed));
        }
        let mut rows = filled(grid.len(), NONE)?;
        for (row, (&beam, &range)) in beams.iter().zip(ranges).enumerate() {
            if range.is_nan() {
                continue;
            }
            let Some(pixel) = grid.pixel(beam) else {
                let found = format!("with beam {beam}, of another sensor");
                return Err(Error::invalid("cloud", found, format!("beams of {} pixels", grid.len())));
            };
            let known = &mut rows[pixel];
            if *known == NONE || range < ranges[*known as usize] {
                *known = row as u32;
            }
        }
        let take = Take { rows: &rows, len: cloud.len };
        let depth = if grid.intrinsics.is_some() { take.of(&columns.depth, f32::NAN)? } else { Vec::new() };
        Ok(RangeImage {
            width: grid.width,
            height: grid.height,
            intrinsics: grid.intrinsics,
            range: take.of(ranges, f32::NAN)?,
            depth,
            category_id: take.of(&columns.category_id, 0)?,
            part_id: take.of(&columns.part_id, 0)?,
            instance_id: take.of(&columns.instance_id, 0)?,
            color: take.three([&columns.red, &columns.green, &columns.blue], 0)?,
            intensity: take.of(&columns.intensity, f32::NAN)?,
            intensity_full_scale: cloud.intensity_full_scale,
            normal: normals(&take, cloud)?,
            sensor_pose: cloud.sensor_pose,
            labels: Arc::clone(&cloud.labels),
        })
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// How far away each pixel is, m, and what that is: along the axis of a camera, else the slant range.
    pub fn distance(&self) -> (&[f32], &'static str) {
        if self.depth.is_empty() { (&self.range, "slant range") } else { (&self.depth, "distance along the axis") }
    }
}

/// Takes values of a cloud to the pixels that show them.
struct Take<'t> {
    /// Row of the cloud of each pixel.
    rows: &'t [u32],
    len: usize,
}

impl Take<'_> {
    /// Of one column; empty if the cloud does not have it.
    fn of<T: Copy>(&self, column: &[T], nothing: T) -> Result<Vec<T>> {
        if column.len() != self.len {
            return Ok(Vec::new());
        }
        let mut pixels = filled(self.rows.len(), nothing)?;
        for (pixel, &row) in pixels.iter_mut().zip(self.rows) {
            if row != NONE {
                *pixel = column[row as usize];
            }
        }
        Ok(pixels)
    }

    /// Of three columns.
    fn three<T: Copy>(&self, [a, b, c]: [&[T]; 3], nothing: T) -> Result<Vec<[T; 3]>> {
        if [a.len(), b.len(), c.len()] != [self.len; 3] {
            return Ok(Vec::new());
        }
        let mut pixels = filled(self.rows.len(), [nothing; 3])?;
        for (pixel, &row) in pixels.iter_mut().zip(self.rows) {
            if row != NONE {
                let row = row as usize;
                *pixel = [a[row], b[row], c[row]];
            }
        }
        Ok(pixels)
    }
}

/// Normals to the right, up and back.
fn normals(take: &Take, cloud: &PointCloud) -> Result<Vec<[f32; 3]>> {
    let columns = &cloud.columns;
    let mut normals = take.three([&columns.normal_x, &columns.normal_y, &columns.normal_z], f32::NAN)?;
    let turn = match cloud.frame {
        Frame::World => cloud.sensor_pose.orientation.inverse().as_quat(),
        Frame::Sensor => Quat::IDENTITY,
    };
    for normal in &mut normals {
        let Vec3 { x, y, z } = turn * Vec3::from(*normal);
        *normal = [-y, z, -x];
    }
    Ok(normals)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::emitter::BeamTable;
    use crate::sensor::Sensor;

    /// A camera of 4 x 3 pixels.
    pub(crate) fn camera() -> Sensor {
        let yaml = "{name: eye, kind: tof, pattern: {type: pinhole, resolution: [4, 3], fov_deg: [90, 60]}}";
        Sensor::from_yaml(yaml, "").unwrap()
    }

    /// What a camera sees of a wall 2 m ahead, which has no return in beams 0 and 7: category 1 and instance 5 on the
    /// left, 2 and 70000 on the right.
    pub(crate) fn wall(beams: &BeamTable) -> PointCloud {
        let mut cloud =
            PointCloud { sensor_pose: Pose::IDENTITY.with_rpy_deg(0.0, 0.0, 90.0), ..PointCloud::default() };
        let columns = &mut cloud.columns;
        for beam in (0..beams.len()).filter(|beam| ![0, 7].contains(beam)) {
            let left = beam as u32 % beams.columns < beams.columns / 2;
            columns.beam.push(beam as u32);
            columns.range.push(2.0 / beams.dir_x[beam]);
            columns.depth.push(2.0);
            columns.category_id.push(if left { 1 } else { 2 });
            columns.instance_id.push(if left { 5 } else { 70_000 });
            [&mut columns.red, &mut columns.green, &mut columns.blue].into_iter().for_each(|column| column.push(9));
            columns.intensity.push(beam as f32);
            // Towards the camera, which looks along y of the world.
            columns.normal_x.push(0.0);
            columns.normal_y.push(-1.0);
            columns.normal_z.push(0.0);
        }
        cloud.len = columns.beam.len();
        cloud.fields = RangeImage::fields().without(Field::PartId);
        cloud
    }

    #[test]
    fn pixels_are_those_of_their_beams() {
        let camera = camera();
        let grid = camera.image_grid().unwrap();
        let image = RangeImage::new(&wall(camera.beams()), &grid).unwrap();
        assert_eq!([image.width, image.height], [4, 3]);
        for pixel in 0..12 {
            let nothing = [0, 7].contains(&pixel);
            assert_eq!([image.range[pixel].is_nan(), image.depth[pixel].is_nan()], [nothing; 2]);
            let expected = if nothing { 0 } else { 1 + pixel as u32 % 4 / 2 };
            assert_eq!(image.category_id[pixel], expected);
            if !nothing {
                assert_eq!((image.depth[pixel], image.intensity[pixel]), (2.0, pixel as f32));
                assert!(Vec3::from(image.normal[pixel]).abs_diff_eq(Vec3::Z, 1e-6), "{:?}", image.normal[pixel]);
            }
        }
        assert!(image.part_id.is_empty());
    }

    #[test]
    fn a_pixel_shows_its_nearest_return_in_any_order() {
        let camera = camera();
        let grid = camera.image_grid().unwrap();
        let mut cloud = wall(camera.beams());
        let one = RangeImage::new(&cloud, &grid).unwrap();
        let mut behind = cloud.clone();
        behind.columns.range.iter_mut().for_each(|range| *range += 1.0);
        behind.columns.category_id.fill(9);
        // A beam without a return, as organised clouds have it.
        behind.columns.range[3] = f32::NAN;
        behind.append(&cloud).unwrap();
        // NaN is not NaN, but looks the same.
        assert_eq!(format!("{:?}", RangeImage::new(&behind, &grid).unwrap()), format!("{one:?}"));
        cloud.columns.beam[0] = 12;
        let error = RangeImage::new(&cloud, &grid).unwrap_err().to_string();
        assert!(error.contains("beam 12, of another sensor"), "{error}");
        cloud.columns.beam.clear();
        let error = RangeImage::new(&cloud, &grid).unwrap_err().to_string();
        assert!(error.contains("columns beam and range"), "{error}");
    }

    #[test]
    fn sensors_without_rows_have_no_image() {
        let error = Sensor::preset("livox_avia").unwrap().image_grid().unwrap_err().to_string();
        assert!(error.contains("no rows and columns") && error.contains("pinhole"), "{error}");
        let error = Sensor::preset("sss_450").unwrap().image_grid().unwrap_err().to_string();
        assert!(error.contains("pings"), "{error}");
        assert!(Sensor::preset("vlp16").unwrap().image_grid().is_ok());
    }
}
