//! The layers of images of scans, one by one, for callers that use some of them in a loop.

use super::annotation::of_pixels;
use super::pixels::{PixelRows, has_every_beam};
use super::{Annotation, Layer, RangeImage};
use crate::{Column, Field, PointCloud};
use emitter::ImageGrid;
use ground::error::{Error, Result};
use ground::named::Named as _;

/// Layers of the image of a cloud, each made when it is first requested. Where the rows of the cloud are the pixels, as
/// in organised clouds of cameras, a layer of one column is that column. Memory is reused for the next cloud.
///
/// ```
/// use echocast::image::{Layer, Layers};
/// use echocast::cloud::Column;
/// use echocast::{PointCloud, Sensor};
///
/// # fn show(cloud: &PointCloud, sensor: &Sensor) -> echocast::Result<()> {
/// let grid = sensor.image_grid()?;
/// let mut layers = Layers::default();
/// if let Column::F32(metres) = layers.get(cloud, &grid, Layer::Depth)? {
///     println!("{} x {} pixels, the first is {} m away", grid.width, grid.height, metres[0]);
/// }
/// layers.clear(); // before those of the next cloud
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct Layers {
    /// The row that each pixel shows, if `found`.
    rows: PixelRows,
    found: bool,
    /// Values of the layers that have been made.
    image: RangeImage,
    made: [bool; Layer::NAMES.len()],
}

impl Layers {
    /// Discards the layers but keeps their memory: to be called when the cloud has changed.
    pub fn clear(&mut self) {
        self.found = false;
        self.made = [false; Layer::NAMES.len()];
    }

    /// A layer of the image of `cloud`, one scan of the sensor that makes images like `grid`: row by row from the top
    /// left, with the three numbers of a pixel one after the other in [`Layer::Color`] and [`Layer::Normal`].
    ///
    /// # Errors
    /// A cloud without the columns that the layer is made from: its own, and unless the cloud is organised, `beam` and
    /// `range`; a cloud of another sensor; no memory.
    pub fn get<'l>(&'l mut self, cloud: &'l PointCloud, grid: &ImageGrid, layer: Layer) -> Result<Column<'l>> {
        self.make(cloud, grid, layer)?;
        Ok(self.column(cloud, grid, layer))
    }

    /// What the image of `cloud` shows of each instance ([`super::annotations`]), with the boxes of the cloud.
    ///
    /// # Errors
    /// As [`Layers::get`] for [`Layer::Instance`] and [`Layer::Category`].
    pub fn annotations(&mut self, cloud: &PointCloud, grid: &ImageGrid) -> Result<Vec<Annotation>> {
        self.make(cloud, grid, Layer::Instance)?;
        self.make(cloud, grid, Layer::Category)?;
        let [instances, categories] =
            [Layer::Instance, Layer::Category].map(|layer| match self.column(cloud, grid, layer) {
                Column::U32(ids) => ids,
                _ => &[],
            });
        let boxes = cloud.boxes.as_deref().unwrap_or_default();
        Ok(of_pixels([grid.width, grid.height], instances, categories, boxes))
    }

    /// Makes a layer, unless it has been made.
    fn make(&mut self, cloud: &PointCloud, grid: &ImageGrid, layer: Layer) -> Result<()> {
        let missing = layer.missing(cloud, grid);
        if !missing.is_empty() {
            let others = Layer::NAMES.iter().filter(|(_, other)| other.missing(cloud, grid).is_empty());
            let others: Vec<&str> = others.map(|(name, _)| *name).collect();
            let others = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
            let found = format!("{}, for which the cloud lacks {}", layer.name(), missing.join(", "));
            return Err(Error::invalid("layer", found, format!("what the columns of the cloud show, {others}")));
        }
        let layer = layer.of(grid);
        if in_place(cloud, grid, layer).is_some() || self.made[layer as usize] {
            return Ok(());
        }
        if !self.found {
            self.rows.find(cloud, grid)?;
            self.found = true;
        }
        self.image.take(layer, cloud, &self.rows)?;
        self.made[layer as usize] = true;
        Ok(())
    }

    /// A layer that has been made.
    fn column<'l>(&'l self, cloud: &'l PointCloud, grid: &ImageGrid, layer: Layer) -> Column<'l> {
        let layer = layer.of(grid);
        if let Some(field) = in_place(cloud, grid, layer) {
            return cloud.column(field);
        }
        let image = &self.image;
        match layer {
            Layer::Depth => Column::F32(&image.depth),
            Layer::Range => Column::F32(&image.range),
            Layer::Category => Column::U32(&image.category_id),
            Layer::Part => Column::U32(&image.part_id),
            Layer::Instance => Column::U32(&image.instance_id),
            Layer::Color => Column::U8(image.color.as_flattened()),
            Layer::Intensity => Column::F32(&image.intensity),
            Layer::Normal => Column::F32(image.normal.as_flattened()),
        }
    }
}

/// The column of `cloud` whose rows are the pixels of `layer`, if there is one.
fn in_place(cloud: &PointCloud, grid: &ImageGrid, layer: Layer) -> Option<Field> {
    match layer.fields() {
        [field] if has_every_beam(cloud, grid) && grid.is_in_order() => Some(*field),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::Instrument as _;
    use crate::image::annotations;
    use crate::image::range_image::tests::wall;
    use crate::test_sensor::TestSensor;
    use emitter::BeamTable;

    /// The same values, NaN as NaN.
    fn same(found: Column, expected: Column, layer: Layer) {
        assert_eq!((found.kind(), found.len()), (expected.kind(), expected.len()), "{layer:?}");
        for pixel in 0..found.len() {
            let [found, expected] = [found, expected].map(|column| column.get_f64(pixel));
            assert!(found == expected || found.is_nan() && expected.is_nan(), "{layer:?}: {found}, not {expected}");
        }
    }

    /// Every layer of `image`.
    fn all(image: &RangeImage) -> [(Layer, Column<'_>); 7] {
        [
            (Layer::Depth, Column::F32(image.distance().0)),
            (Layer::Range, Column::F32(&image.range)),
            (Layer::Category, Column::U32(&image.category_id)),
            (Layer::Instance, Column::U32(&image.instance_id)),
            (Layer::Color, Column::U8(image.color.as_flattened())),
            (Layer::Intensity, Column::F32(&image.intensity)),
            (Layer::Normal, Column::F32(image.normal.as_flattened())),
        ]
    }

    /// The cloud with a row for every beam.
    fn organised(cloud: &PointCloud, beams: &BeamTable) -> PointCloud {
        let mut every = cloud.clone();
        every.columns.resize(every.fields, 0).unwrap();
        every.columns.resize(every.fields, beams.len()).unwrap();
        every.len = beams.len();
        every.organised = Some([beams.rows, beams.columns]);
        let (to, from) = (&mut every.columns, &cloud.columns);
        for column in
            [&mut to.range, &mut to.depth, &mut to.intensity, &mut to.normal_x, &mut to.normal_y, &mut to.normal_z]
        {
            column.fill(f32::NAN);
        }
        for (row, &beam) in from.beam.iter().enumerate() {
            let beam = beam as usize;
            to.range[beam] = from.range[row];
            to.depth[beam] = from.depth[row];
            to.intensity[beam] = from.intensity[row];
            to.normal_x[beam] = from.normal_x[row];
            to.normal_y[beam] = from.normal_y[row];
            to.normal_z[beam] = from.normal_z[row];
            to.category_id[beam] = from.category_id[row];
            to.instance_id[beam] = from.instance_id[row];
            [to.red[beam], to.green[beam], to.blue[beam]] = [from.red[row], from.green[row], from.blue[row]];
        }
        every
    }

    #[test]
    fn layers_are_those_of_the_whole_image() {
        let camera = TestSensor::camera();
        let sweep = "{type: raster, azimuth: {fov_deg: 90, step_deg: 30}, elevation: {fov_deg: 60, step_deg: 30}}";
        let sweep = TestSensor::new(sweep);
        let mut layers = Layers::default();
        for (sensor, in_order) in [(&camera, true), (&sweep, false)] {
            let grid = sensor.image_grid().unwrap();
            assert_eq!(grid.is_in_order(), in_order);
            let cloud = wall(sensor.beams());
            let image = RangeImage::new(&cloud, &grid).unwrap();
            for cloud in [&organised(&cloud, sensor.beams()), &cloud] {
                layers.clear();
                // The second time, it has been made.
                for (layer, expected) in all(&image).into_iter().chain(all(&image)) {
                    same(layers.get(cloud, &grid, layer).unwrap(), expected, layer);
                }
                let found = layers.get(cloud, &grid, Layer::Instance).unwrap().bytes().as_ptr();
                let column = cloud.column(Field::InstanceId).bytes().as_ptr();
                assert_eq!(found == column, in_order && cloud.organised.is_some());
                assert_eq!(layers.annotations(cloud, &grid).unwrap(), annotations(&image, &[]));
            }
        }
    }

    #[test]
    fn layers_without_columns_are_refused() {
        let camera = TestSensor::camera();
        let grid = camera.image_grid().unwrap();
        let mut cloud = wall(camera.beams());
        let mut layers = Layers::default();
        let error = layers.get(&cloud, &grid, Layer::Part).unwrap_err().to_string();
        assert_eq!(
            error,
            "layer is part, for which the cloud lacks part_id; allowed: what the columns of the cloud show, depth, range, \
             category, instance, color, intensity, normal"
        );
        cloud.fields = cloud.fields.without(Field::Beam).without(Field::Green);
        let error = layers.get(&cloud, &grid, Layer::Color).unwrap_err().to_string();
        assert!(error.contains("color, for which the cloud lacks beam, green; ") && error.ends_with("none"), "{error}");
        let error = Layer::from_name("dept").unwrap_err().to_string();
        assert!(error.starts_with("there is no image layer named \"dept\"; near: depth, ") && error.contains("normal"));
        // A cloud with a beam that the sensor lacks is another sensor's.
        cloud = wall(camera.beams());
        cloud.columns.beam[0] = 12;
        assert!(layers.get(&cloud, &grid, Layer::Range).is_err());
    }
}
