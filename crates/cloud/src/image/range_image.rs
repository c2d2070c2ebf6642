//! What a depth camera, or a sensor that spins or sweeps, sees: a scan as an image.

use super::Layer;
use super::pixels::PixelRows;
use crate::{Field, FieldSet, Frame, PointCloud};
use emitter::{ImageGrid, Intrinsics};
use glam::{Quat, Vec3};
use ground::error::Result;
use ground::named::Named as _;
use ground::pose::Pose;
use model::Labels;
use std::sync::Arc;

/// A scan as an image: row by row from the top left, each pixel with the return of its beam, the nearest if there are
/// several. Values for which the cloud has no columns are empty.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct RangeImage {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Of a camera; other sensors have none.
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
    /// Unit normals of the surfaces: right, up and back, towards a viewer who looks along the axis of the sensor (-y,
    /// z, -x of its frame); NaN where there is no return.
    pub normal: Vec<[f32; 3]>,
    /// World pose of the sensor at the start of the scan.
    pub sensor_pose: Pose,
    /// Names of the numbers.
    pub labels: Arc<Labels>,
}

impl RangeImage {
    /// The columns that an image is made from.
    pub fn fields() -> FieldSet {
        let own = [Field::Beam, Field::Range, Field::Depth, Field::CategoryId, Field::PartId, Field::InstanceId];
        let looks = [Field::Red, Field::Green, Field::Blue, Field::Intensity];
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ];
        own.into_iter().chain(looks).chain(normals).collect()
    }

    /// The image of `cloud`, one scan of the sensor that makes images like `grid` (`Sensor::image_grid`), with misses
    /// or without, in any order. Unless it is organised, it must have the columns `beam` and `range`.
    ///
    /// # Errors
    /// A cloud without these columns, or of another sensor; no memory.
    pub fn new(cloud: &PointCloud, grid: &ImageGrid) -> Result<RangeImage> {
        let mut rows = PixelRows::default();
        rows.find(cloud, grid)?;
        let mut image = RangeImage {
            width: grid.width,
            height: grid.height,
            intrinsics: grid.intrinsics,
            intensity_full_scale: cloud.intensity_full_scale,
            sensor_pose: cloud.sensor_pose,
            labels: Arc::clone(&cloud.labels),
            ..RangeImage::default()
        };
        for &(_, layer) in Layer::NAMES {
            if layer != Layer::Depth || grid.intrinsics.is_some() {
                image.take(layer, cloud, &rows)?;
            }
        }
        Ok(image)
    }

    /// Takes the values of a layer from the `rows` of `cloud` that the pixels show; they become empty if the cloud
    /// lacks them.
    pub(super) fn take(&mut self, layer: Layer, cloud: &PointCloud, rows: &PixelRows) -> Result<()> {
        let columns = &cloud.columns;
        let len = cloud.len;
        match layer {
            Layer::Depth => rows.take(len, [&columns.depth], |[depth]| depth, f32::NAN, &mut self.depth),
            Layer::Range => rows.take(len, [&columns.range], |[range]| range, f32::NAN, &mut self.range),
            Layer::Category => rows.take(len, [&columns.category_id], |[id]| id, 0, &mut self.category_id),
            Layer::Part => rows.take(len, [&columns.part_id], |[id]| id, 0, &mut self.part_id),
            Layer::Instance => rows.take(len, [&columns.instance_id], |[id]| id, 0, &mut self.instance_id),
            Layer::Color => {
                rows.take(len, [&columns.red, &columns.green, &columns.blue], |rgb| rgb, [0; 3], &mut self.color)
            }
            Layer::Intensity => rows.take(len, [&columns.intensity], |[it]| it, f32::NAN, &mut self.intensity),
            Layer::Normal => {
                let turn = match cloud.frame {
                    Frame::World => cloud.sensor_pose.orientation.inverse().as_quat(),
                    Frame::Sensor => Quat::IDENTITY,
                };
                let seen = |normal| {
                    let Vec3 { x, y, z } = turn * Vec3::from_array(normal);
                    [-y, z, -x]
                };
                let parts = [&columns.normal_x, &columns.normal_y, &columns.normal_z].map(Vec::as_slice);
                rows.take(len, parts, seen, [f32::NAN; 3], &mut self.normal)
            }
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.width * self.height
    }

    /// Whether there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Distance of each pixel, m, and what it is: along the axis of a camera, else the slant range.
    pub fn distance(&self) -> (&[f32], &'static str) {
        if self.depth.is_empty() { (&self.range, "slant range") } else { (&self.depth, "distance along the axis") }
    }
}

/// Tests, and a cloud of pixels for those of other modules.
#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::export::Instrument as _;
    use crate::test_sensor::TestSensor;
    use emitter::BeamTable;

    /// What a camera sees of a wall 2 m ahead, which has no return in beams 0 and 7: category 1 and instance 5 on the
    /// left, 2 and 70000 on the right.
    pub fn wall(beams: &BeamTable) -> PointCloud {
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
        let camera = TestSensor::camera();
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
        let camera = TestSensor::camera();
        let grid = camera.image_grid().unwrap();
        let mut cloud = wall(camera.beams());
        let one = RangeImage::new(&cloud, &grid).unwrap();
        let mut behind = cloud.clone();
        behind.columns.range.iter_mut().for_each(|range| *range += 1.0);
        behind.columns.category_id.fill(9);
        // A beam without a return, as in organised clouds.
        behind.columns.range[3] = f32::NAN;
        behind.append(&cloud).unwrap();
        // NaN does not equal NaN, but prints the same.
        assert_eq!(format!("{:?}", RangeImage::new(&behind, &grid).unwrap()), format!("{one:?}"));
        cloud.columns.beam[0] = 12;
        let error = RangeImage::new(&cloud, &grid).unwrap_err().to_string();
        assert!(error.contains("beam 12, of another sensor"), "{error}");
        cloud.columns.beam.clear();
        let error = RangeImage::new(&cloud, &grid).unwrap_err().to_string();
        assert!(error.contains("columns beam and range"), "{error}");
    }
}
