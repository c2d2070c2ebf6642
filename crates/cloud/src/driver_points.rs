//! Points as the ROS 2 drivers of LiDARs publish them: the bytes of a `sensor_msgs/PointCloud2`.

use super::driver::Driver;
use super::pack::room;
use super::record::{self, BLOCK_BYTES};
use super::{Field, FieldSet, Frame, PackItem, PackType, PointCloud};
use glam::{DMat3, DVec3};
use ground::error::{Error, Result};
use ground::parallel;
use ground::pose::Pose;
use std::ops::Range;

/// A number in each point of a driver's messages.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointField {
    /// Its name in the message.
    pub name: &'static str,
    /// Its type.
    pub kind: PackType,
    /// Its first byte in the point.
    pub offset: usize,
    value: Value,
}

/// What a field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Value {
    /// Coordinate in the sensor frame; x, y and z are the first fields, one after the other.
    Place,
    /// The column, times this.
    Column(Field, f64),
    /// The column, or without it the quantity computed from the position in the sensor frame, times this.
    Polar(Field, f64),
    /// Time since the stamp, s, times this.
    Since(f64),
    /// Intensity, 255 at its full scale.
    Reflectivity,
    /// Number of the return in bits 4 and 5.
    Tag,
    /// Which return it is, as Autoware numbers them.
    ReturnType,
    /// A quantity that is not simulated.
    Zero,
}

const fn field(name: &'static str, kind: PackType, offset: usize, value: Value) -> PointField {
    PointField { name, kind, offset, value }
}

const X: PointField = field("x", PackType::F32, 0, Value::Place);
const Y: PointField = field("y", PackType::F32, 4, Value::Place);
const Z: PointField = field("z", PackType::F32, 8, Value::Place);

/// github.com/ros-drivers/velodyne, branch ros2, velodyne_pointcloud/src/lib/pointcloudXYZIRT.cpp; times count from the
/// stamp.
const VELODYNE: [PointField; 6] = [
    X,
    Y,
    Z,
    field("intensity", PackType::F32, 12, Value::Column(Field::Intensity, 1.0)),
    field("ring", PackType::U16, 16, Value::Column(Field::Ring, 1.0)),
    field("time", PackType::F32, 18, Value::Since(1.0)),
];

/// `ouster_ros::Point` of github.com/ouster-lidar/ouster-ros, ouster-ros/include/ouster_ros/os_point.h, aligned to 16
/// bytes; times count from the stamp, in ns, and ranges are in mm.
const OUSTER: [PointField; 9] = [
    X,
    Y,
    Z,
    field("intensity", PackType::F32, 16, Value::Column(Field::Intensity, 1.0)),
    field("t", PackType::U32, 20, Value::Since(1e9)),
    field("reflectivity", PackType::U16, 24, Value::Reflectivity),
    field("ring", PackType::U16, 26, Value::Column(Field::Ring, 1.0)),
    field("ambient", PackType::U16, 28, Value::Zero),
    field("range", PackType::U32, 32, Value::Polar(Field::Range, 1e3)),
];

/// `ToRosMsg` of github.com/HesaiTechnology/HesaiLidar_ROS_2.0, src/manager/source_driver_ros2.hpp, and the points
/// `XYZIRT` of github.com/RoboSense-LiDAR/rslidar_sdk, src/source/source_pointcloud_ros.hpp; times are those of the
/// run, in s.
const HESAI: [PointField; 6] = [
    X,
    Y,
    Z,
    field("intensity", PackType::F32, 12, Value::Column(Field::Intensity, 1.0)),
    field("ring", PackType::U16, 16, Value::Column(Field::Ring, 1.0)),
    field("timestamp", PackType::F64, 18, Value::Column(Field::Time, 1.0)),
];

/// `LivoxPointXyzrtlt` of github.com/Livox-SDK/livox_ros_driver2, src/comm/comm.h, and its fields, src/lddc.cpp; times
/// are those of the run, in ns. Tags: "Livox HAP user manual", point cloud data.
const LIVOX: [PointField; 7] = [
    X,
    Y,
    Z,
    field("intensity", PackType::F32, 12, Value::Column(Field::Intensity, 1.0)),
    field("tag", PackType::U8, 16, Value::Tag),
    field("line", PackType::U8, 17, Value::Column(Field::Ring, 1.0)),
    field("timestamp", PackType::F64, 18, Value::Column(Field::Time, 1e9)),
];

/// `PointXYZIRCAEDT` of Autoware's drivers, github.com/tier4/nebula, docs/point_types.md; times count from the stamp,
/// in ns. The channel is the ring of the maker's driver (`point.channel` of its decoders).
const AUTOWARE: [PointField; 10] = [
    X,
    Y,
    Z,
    field("intensity", PackType::U8, 12, Value::Reflectivity),
    field("return_type", PackType::U8, 13, Value::ReturnType),
    field("channel", PackType::U16, 14, Value::Column(Field::Ring, 1.0)),
    field("azimuth", PackType::F32, 16, Value::Polar(Field::Azimuth, 1.0)),
    field("elevation", PackType::F32, 20, Value::Polar(Field::Elevation, 1.0)),
    field("distance", PackType::F32, 24, Value::Polar(Field::Range, 1.0)),
    field("time_stamp", PackType::U32, 28, Value::Since(1e9)),
];

impl Driver {
    /// The fields of each point that it publishes.
    pub fn point_fields(self) -> &'static [PointField] {
        match self {
            Driver::Velodyne => &VELODYNE,
            Driver::Ouster => &OUSTER,
            Driver::Hesai | Driver::Robosense => &HESAI,
            Driver::Livox => &LIVOX,
            Driver::Autoware => &AUTOWARE,
        }
    }

    /// Bytes of a point.
    pub fn point_step(self) -> usize {
        match self {
            Driver::Velodyne => 22,
            Driver::Ouster => 48,
            Driver::Hesai | Driver::Robosense | Driver::Livox => 26,
            Driver::Autoware => 32,
        }
    }

    /// The columns that [`PointCloud::pack_points`] needs.
    pub fn columns(self) -> FieldSet {
        self.point_fields().iter().flat_map(|field| field.value.columns()).copied().collect()
    }
}

impl Value {
    /// The columns that the value requires.
    fn columns(&self) -> &[Field] {
        match self {
            Value::Place => &[Field::X, Field::Y, Field::Z],
            Value::Column(field, _) => std::slice::from_ref(field),
            Value::Since(_) => &[Field::Time],
            Value::Reflectivity => &[Field::Intensity],
            Value::Tag => &[Field::ReturnNumber],
            Value::ReturnType => &[Field::ReturnNumber, Field::ReturnCount],
            Value::Polar(..) | Value::Zero => &[],
        }
    }
}

impl PointField {
    /// Whether `cloud` has the columns that it requires.
    pub(crate) fn is_in(&self, cloud: &PointCloud) -> bool {
        self.value.columns().iter().all(|&column| cloud.fields.contains(column))
    }

    /// How it is packed, if it is made from a column of `cloud`; times may count from `stamp`, s.
    #[doc(hidden)]
    pub fn item(&self, cloud: &PointCloud, stamp: f64) -> Option<PackItem> {
        let (field, shift, scale) = match self.value {
            Value::Column(field, scale) => (field, 0.0, scale),
            Value::Polar(field, scale) if cloud.fields.contains(field) => (field, 0.0, scale),
            Value::Since(scale) => (Field::Time, stamp, scale),
            Value::Reflectivity => {
                (Field::Intensity, 0.0, cloud.intensity_full_scale.map_or(1.0, |full| 255.0 / f64::from(full)))
            }
            Value::Place | Value::Polar(..) | Value::Tag | Value::ReturnType | Value::Zero => return None,
        };
        Some(PackItem { field, kind: self.kind, offset: self.offset, shift, scale })
    }
}

/// How a driver arranges the rows of an organised cloud.
pub(crate) struct Arrangement {
    /// Height and width.
    pub shape: [usize; 2],
    /// The row of the cloud at each place.
    pub rows: Vec<usize>,
}

impl PointCloud {
    /// Height and width of the messages that `driver` makes of it: for an organised cloud those of the driver's image,
    /// else one row of all points.
    pub fn driver_shape(&self, driver: Driver) -> [usize; 2] {
        self.order_of(driver).map_or_else(|| self.shape(), |order| order.shape)
    }

    /// Rows and columns of the sensor, or one row of all points.
    #[doc(hidden)]
    pub fn shape(&self) -> [usize; 2] {
        self.organised.map_or([1, self.len], |shape| shape.map(|count| count as usize))
    }

    /// How `driver` arranges it, a scan with one ring per row, if differently from the cloud: Velodyne's puts the rings
    /// side by side, the lowest first, and the firings one below the other (organized_cloudXYZIRT.cpp), RoboSense's
    /// likewise, in the order of its channels (source_pointcloud_ros.hpp), Ouster's puts the rings one below the other.
    pub(crate) fn order_of(&self, driver: Driver) -> Option<Arrangement> {
        let [height, width] = self.organised?.map(|count| count as usize);
        let rings = &self.columns.ring;
        if rings.is_empty() || width == 0 {
            return None;
        }
        let of_row = |row: usize| &rings[row * width..(row + 1) * width];
        if (0..height).any(|row| of_row(row).iter().any(|ring| *ring != of_row(row)[0])) {
            return None;
        }
        let mut lasers: Vec<usize> = (0..height).collect();
        lasers.sort_by_key(|&row| of_row(row)[0]);
        // Rings repeat where one cloud holds several frames.
        if height < 2 || !lasers.is_sorted_by(|&a, &b| of_row(a)[0] < of_row(b)[0]) {
            return None;
        }
        match driver {
            Driver::Ouster if lasers.is_sorted() => return None,
            Driver::Ouster => {
                let rows = lasers.into_iter().flat_map(|row| row * width..(row + 1) * width).collect();
                return Some(Arrangement { shape: [height, width], rows });
            }
            Driver::Velodyne => {}
            Driver::Robosense => lasers.sort_unstable(),
            Driver::Hesai | Driver::Livox | Driver::Autoware => return None,
        }
        let rows = (0..width).flat_map(|firing| lasers.iter().map(move |row| row * width + firing)).collect();
        Some(Arrangement { shape: [width, height], rows })
    }

    /// Writes the points to `to` as `driver` publishes them, [`Driver::point_step`] bytes each. Positions are in the
    /// frame of the sensor at the start of the scan; those of a cloud in sensor coordinates are left as they are, each
    /// in the frame of its own firing unless the cloud was deskewed. Times are relative to `stamp` (s, of the message)
    /// if the driver's are. Points of an organised cloud are in the order of the driver's image, whose height and width
    /// are [`PointCloud::driver_shape`]. If `azimuth`, `elevation` and `range` were not computed, they are derived from
    /// the positions.
    ///
    /// ```
    /// # use echocast::Driver;
    /// # let cloud = echocast::PointCloud::new(Driver::Velodyne.columns(), 0)?;
    /// let driver = cloud.driver.unwrap_or(Driver::Velodyne);
    /// let mut data = vec![0; cloud.len() * driver.point_step()];
    /// cloud.pack_points(driver, cloud.begins(), &mut data)?;
    /// # Ok::<(), echocast::Error>(())
    /// ```
    ///
    /// # Errors
    /// A column of [`Driver::columns`] that was not computed; times before the stamp or more than 4.29 s after it, if
    /// the driver's are 32-bit nanoseconds relative to it; a `to` that is shorter than the points; no memory.
    pub fn pack_points(&self, driver: Driver, stamp: f64, to: &mut [u8]) -> Result<()> {
        let needed = driver.columns();
        if let Some(missing) = needed.iter().find(|info| !self.fields.contains(info.field)) {
            let names: Vec<&str> = needed.iter().map(|info| info.name).collect();
            let found = format!("without the column {}", missing.name);
            let allowed =
                format!("clouds with {} for points in the layout of the driver {}", names.join(", "), driver.name());
            return Err(Error::invalid("the cloud", found, allowed));
        }
        if let Some(after) = self.time_beyond(driver, stamp) {
            let found = format!("with a point {after} s after the stamp, {stamp} s");
            let allowed = format!(
                "0 to {:.6} s, for points in the layout of the driver {}",
                u32::MAX as f64 * 1e-9,
                driver.name()
            );
            return Err(Error::invalid("the cloud", found, allowed));
        }
        let step = driver.point_step();
        let to = room(to, self.len, step)?;
        to.fill(0);
        let turned;
        let cloud = match self.order_of(driver) {
            Some(order) => {
                turned = self.select(&order.rows)?;
                &turned
            }
            None => self,
        };
        let items: Vec<PackItem> = driver.point_fields().iter().filter_map(|field| field.item(cloud, stamp)).collect();
        cloud.pack(&items, step, to)?;
        cloud.put_made(driver, step, &cloud.sensor_pose, to);
        Ok(())
    }

    /// Time, s after `stamp`, of a point that the times of `driver` cannot represent, if there is one.
    pub(crate) fn time_beyond(&self, driver: Driver, stamp: f64) -> Option<f64> {
        let since = driver.point_fields().iter().find_map(|field| match field.value {
            Value::Since(scale) if field.kind == PackType::U32 => Some(scale),
            _ => None,
        })?;
        // They are rounded.
        let fits = |after: f64| (-0.5..f64::from(u32::MAX) + 0.5).contains(&(after * since));
        self.columns.time.iter().map(|time| time - stamp).find(|&after| after.is_finite() && !fits(after))
    }

    /// Writes those fields of `driver` that are not columns into points of `step` bytes, with positions in the frame at
    /// `pose`.
    pub(crate) fn put_made(&self, driver: Driver, step: usize, pose: &Pose, points: &mut [u8]) {
        let c = &self.columns;
        let (to_frame, to_sensor) = (self.to_frame(pose), self.to_frame(&self.sensor_pose));
        let own = |row: usize| [c.x[row], c.y[row], c.z[row]];
        let made: Vec<&PointField> = driver.point_fields().iter().filter(|field| field.is_in(self)).collect();
        let rows = (BLOCK_BYTES / step).max(1);
        parallel::for_each_chunk(points, rows * step, |block, records| {
            let rows = block * rows..block * rows + records.len() / step;
            for &&PointField { kind, offset, value, .. } in &made {
                let rows = rows.clone();
                match value {
                    Value::Place if offset == 0 => record::put(records, step, 0, rows, |row| to_frame(own(row))),
                    Value::Polar(field, _) if self.fields.contains(field) => {}
                    Value::Polar(field, scale) => {
                        let value = |row| polar(field, to_sensor(own(row))) * scale;
                        match kind {
                            PackType::U32 => record::put(records, step, offset, rows, |row| value(row).round() as u32),
                            _ => record::put(records, step, offset, rows, |row| value(row) as f32),
                        }
                    }
                    Value::Tag => {
                        record::put(records, step, offset, &c.return_number[rows], |number| (*number).min(3) << 4);
                    }
                    Value::ReturnType => record::put(records, step, offset, rows, |row| self.return_type(row)),
                    Value::Place | Value::Column(..) | Value::Since(_) | Value::Reflectivity | Value::Zero => {}
                }
            }
        });
    }

    /// Type of the return of a row, as Autoware numbers them (`autoware_point_types`, `ReturnType`): 1 the only one, 3
    /// and 4 the strongest, if it is the first or the last, 5 and 6 a weaker one that is the first or the last, 7 one
    /// that is reported twice; 0, "invalid", one in the middle, no return, and one whose beam has lost other returns,
    /// so that its type is unknown.
    fn return_type(&self, row: usize) -> u8 {
        let c = &self.columns;
        let (number, count) = (usize::from(c.return_number[row]), usize::from(c.return_count[row]));
        if count < 2 || number == 0 || number > count {
            return u8::from(number == 1);
        }
        let Some(all) = self.returns_of(row) else { return 0 };
        let differ = |column: &[f32]| column[all.clone()].iter().any(|value| *value != column[row]);
        if ![&c.x, &c.y, &c.z].into_iter().any(|axis| differ(axis)) {
            return 7;
        }
        let is_strongest = c.intensity.is_empty() || c.intensity[all].iter().all(|&other| other <= c.intensity[row]);
        match (number == 1, number == count, is_strongest) {
            (true, _, true) => 3,
            (_, true, true) => 4,
            (true, _, false) => 5,
            (_, true, false) => 6,
            _ => 0,
        }
    }

    /// The rows of all returns of the beam of `row`, which are consecutive in a scan; `None` if one is missing, as it
    /// may be after points were selected or sorted.
    fn returns_of(&self, row: usize) -> Option<Range<usize>> {
        let c = &self.columns;
        let count = c.return_count[row];
        let start = (row + 1).checked_sub(usize::from(c.return_number[row]))?;
        let all = start..start + usize::from(count);
        // Every computed column that identifies the beam.
        let same = |other: usize| {
            c.return_count[other] == count
                && (c.time.is_empty() || c.time[other] == c.time[row])
                && [&c.ring, &c.channel].into_iter().all(|ids| ids.is_empty() || ids[other] == ids[row])
                && [&c.beam, &c.firing, &c.frame].into_iter().all(|ids| ids.is_empty() || ids[other] == ids[row])
        };
        let mut returns = (1..=count).zip(all.clone());
        let whole = all.end <= self.len && returns.all(|(number, row)| c.return_number[row] == number && same(row));
        whole.then_some(all)
    }

    /// Transforms positions to the frame at `pose`; those in the frame of the sensor are left as they are.
    #[doc(hidden)]
    pub fn to_frame(&self, pose: &Pose) -> impl Fn([f32; 3]) -> [f32; 3] + use<> {
        let pose = if self.frame == Frame::World { *pose } else { Pose::IDENTITY };
        let (turn, shift) = (DMat3::from_quat(pose.orientation.inverse()), self.origin - pose.position);
        move |place| (turn * (DVec3::from(place.map(f64::from)) + shift)).as_vec3().to_array()
    }
}

/// The quantity `field` of a point at `place` in the sensor frame: range, m, azimuth or elevation, rad.
fn polar(field: Field, place: [f32; 3]) -> f64 {
    let place = DVec3::from(place.map(f64::from));
    match field {
        Field::Azimuth => place.y.atan2(place.x),
        Field::Elevation => place.z.atan2(place.truncate().length()),
        _ => place.length(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ground::named::Named as _;

    /// The two returns of one beam, a single one, and one reported twice, seen from (10, 0, 2), facing left.
    fn cloud() -> PointCloud {
        let mut cloud = PointCloud { len: 5, origin: DVec3::new(10.0, 0.0, 0.0), ..PointCloud::default() };
        cloud.sensor_pose = Pose::at(10.0, 0.0, 2.0).with_rpy_deg(0.0, 0.0, 90.0);
        cloud.intensity_full_scale = Some(1.0);
        cloud.fields = FieldSet::parse("x,y,z,intensity,ring,time,return_number,return_count").unwrap();
        let c = &mut cloud.columns;
        c.x = vec![0.0, 0.0, -3.0, 0.0, 0.0];
        c.y = vec![4.0, 5.0, 4.0, 1.0, 1.0];
        c.z = vec![2.0, 2.0, 2.0, 3.0, 3.0];
        c.intensity = vec![0.2, 0.8, 1.0, 0.5, 0.5];
        c.ring = vec![0, 0, 300, 2, 2];
        c.time = vec![5.25, 5.25, 5.5, 5.75, 5.75];
        c.return_number = vec![1, 2, 1, 1, 2];
        c.return_count = vec![2, 2, 1, 2, 2];
        cloud
    }

    fn packed(cloud: &PointCloud, driver: Driver) -> Vec<Vec<u8>> {
        let mut bytes = vec![0xee; cloud.len * driver.point_step() + 3];
        cloud.pack_points(driver, 5.0, &mut bytes).unwrap();
        assert_eq!(bytes[cloud.len * driver.point_step()..], [0xee; 3]);
        bytes.chunks_exact(driver.point_step()).take(cloud.len).map(<[u8]>::to_vec).collect()
    }

    fn f32_at(point: &[u8], at: usize) -> f32 {
        f32::from_ne_bytes(point[at..at + 4].try_into().unwrap())
    }

    fn u16_at(point: &[u8], at: usize) -> u16 {
        u16::from_ne_bytes(point[at..at + 2].try_into().unwrap())
    }

    fn u32_at(point: &[u8], at: usize) -> u32 {
        u32::from_ne_bytes(point[at..at + 4].try_into().unwrap())
    }

    fn f64_at(point: &[u8], at: usize) -> f64 {
        f64::from_ne_bytes(point[at..at + 8].try_into().unwrap())
    }

    #[test]
    fn fields_lie_side_by_side_within_the_point() {
        for &(_, driver) in Driver::NAMES {
            let mut end = 0;
            for field in driver.point_fields() {
                assert!(field.offset >= end, "{driver:?} {}", field.name);
                end = field.offset + field.kind.size();
            }
            assert!(end <= driver.point_step());
            assert!(driver.columns().contains(Field::Z) && driver.columns().contains(Field::Ring));
        }
    }

    #[test]
    fn points_are_those_of_each_driver() {
        let cloud = cloud();
        for &(_, driver) in Driver::NAMES {
            let points = packed(&cloud, driver);
            // Ahead of the sensor is y of the world, its left is -x.
            let third = [0, 4, 8].map(|at| f32_at(&points[2], at));
            assert!(third.iter().zip([4.0, 3.0, 0.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{driver:?}: {third:?}");
        }
        let third = |driver| packed(&cloud, driver).swap_remove(2);
        let point = third(Driver::Velodyne);
        assert_eq!((f32_at(&point, 12), u16_at(&point, 16), f32_at(&point, 18)), (1.0, 300, 0.5));
        let point = third(Driver::Ouster);
        assert_eq!((f32_at(&point, 16), u32_at(&point, 20), u16_at(&point, 24)), (1.0, 500_000_000, 255));
        assert_eq!((u16_at(&point, 26), u16_at(&point, 28), u32_at(&point, 32)), (300, 0, 5000));
        assert!(point[12..16].iter().chain(&point[30..32]).chain(&point[36..]).all(|&byte| byte == 0));
        for driver in [Driver::Hesai, Driver::Robosense] {
            let point = third(driver);
            assert_eq!((f32_at(&point, 12), u16_at(&point, 16), f64_at(&point, 18)), (1.0, 300, 5.5));
        }
        let points = packed(&cloud, Driver::Livox);
        assert_eq!((points[2][16], points[2][17], f64_at(&points[2], 18)), (16, 255, 5.5e9));
        assert_eq!(points[1][16], 32);
        let points = packed(&cloud, Driver::Autoware);
        assert_eq!(points.iter().map(|point| point[13]).collect::<Vec<_>>(), [5, 4, 1, 7, 7]);
        let point = &points[2];
        assert_eq!((point[12], u16_at(point, 14), u32_at(point, 28)), (255, 300, 500_000_000));
        let polar = [16, 20, 24].map(|at| f32_at(point, at));
        assert!(polar.iter().zip([0.75f32.atan(), 0.0, 5.0]).all(|(a, b)| (a - b).abs() < 1e-6), "{polar:?}");
    }

    #[test]
    fn return_types_of_a_selection_are_those_of_all_or_none() {
        let mut cloud = cloud();
        // Two channels that fire simultaneously, with two returns each, and three returns of one beam.
        let c = &mut cloud.columns;
        for (ring, count) in [(4_u16, 2_u8), (5, 2), (6, 3)] {
            for number in 1..=count {
                let distance = f32::from(number);
                c.x.push(distance);
                c.y.push(0.0);
                c.z.push(f32::from(ring));
                c.intensity.push(if ring == 5 { 1.0 / distance } else { distance });
                c.ring.push(ring);
                c.time.push(6.0);
                c.return_number.push(number);
                c.return_count.push(count);
            }
        }
        cloud.len = cloud.columns.x.len();
        let types = |cloud: &PointCloud| -> Vec<u8> { packed(cloud, Driver::Autoware).iter().map(|p| p[13]).collect() };
        let all = types(&cloud);
        assert_eq!(all, [5, 4, 1, 7, 7, 5, 4, 3, 6, 5, 0, 4]);
        let mut known = 0;
        for chosen in 0..1_usize << cloud.len {
            let mut rows: Vec<usize> = (0..cloud.len).filter(|row| chosen >> row & 1 == 1).collect();
            if chosen % 2 == 1 {
                rows.reverse();
            }
            for (&row, found) in rows.iter().zip(types(&cloud.select(&rows).unwrap())) {
                assert!(found == 0 || found == all[row], "row {row} of {rows:?} is {found}, not {}", all[row]);
                known += usize::from(found > 1);
            }
        }
        assert!(known > 1000);
    }

    #[test]
    fn organised_points_come_as_the_driver_has_them() {
        let mut cloud = PointCloud { len: 6, organised: Some([3, 2]), ..PointCloud::default() };
        cloud.fields = FieldSet::parse("x,y,z,intensity,ring,time").unwrap();
        let c = &mut cloud.columns;
        c.x = (0..6_u8).map(f32::from).collect();
        (c.y, c.z, c.intensity, c.time) = (vec![0.0; 6], vec![0.0; 6], vec![0.0; 6], vec![5.0; 6]);
        c.ring = vec![1, 1, 2, 2, 0, 0];
        let placed = |driver| -> Vec<f32> { packed(&cloud, driver).iter().map(|point| f32_at(point, 0)).collect() };
        for (driver, shape, places) in [
            (Driver::Velodyne, [2, 3], [4.0, 0.0, 2.0, 5.0, 1.0, 3.0]),
            (Driver::Robosense, [2, 3], [0.0, 2.0, 4.0, 1.0, 3.0, 5.0]),
            (Driver::Ouster, [3, 2], [4.0, 5.0, 0.0, 1.0, 2.0, 3.0]),
            (Driver::Hesai, [3, 2], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        ] {
            assert_eq!((cloud.driver_shape(driver), placed(driver)), (shape, places.to_vec()), "{driver:?}");
        }
        assert_eq!(PointCloud { organised: None, ..cloud.clone() }.driver_shape(Driver::Velodyne), [1, 6]);
    }

    #[test]
    fn computed_columns_take_precedence_over_positions() {
        let mut cloud = cloud();
        cloud.fields = cloud.fields.with(Field::Range).with(Field::Azimuth);
        cloud.columns.range = vec![7.0005; 5];
        cloud.columns.azimuth = vec![0.25; 5];
        assert_eq!(u32_at(&packed(&cloud, Driver::Ouster)[2], 32), 7001);
        let point = &packed(&cloud, Driver::Autoware)[2];
        assert_eq!((f32_at(point, 16), f32_at(point, 24)), (0.25, 7.0005));
        // Without a return there is no position.
        cloud.fields = cloud.fields.without(Field::Range);
        cloud.columns.range = Vec::new();
        cloud.columns.x[2] = f32::NAN;
        assert_eq!(u32_at(&packed(&cloud, Driver::Ouster)[2], 32), 0);
    }

    /// Nanoseconds have 32 bits.
    #[test]
    fn times_that_do_not_fit_are_refused() {
        let mut cloud = cloud();
        for (time, fits) in [(5.0 + 4.294_967_295, true), (5.0 + 4.2951, false), (4.9, false), (f64::NAN, true)] {
            cloud.columns.time[1] = time;
            for &(_, driver) in Driver::NAMES {
                let counts = matches!(driver, Driver::Ouster | Driver::Autoware);
                let mut bytes = vec![0; cloud.len * driver.point_step()];
                let packed = cloud.pack_points(driver, 5.0, &mut bytes).map_err(|error| error.to_string());
                assert_eq!(packed.is_ok(), fits || !counts, "{driver:?} {time}: {packed:?}");
                assert!(
                    packed.err().is_none_or(|error| error.contains("s after the stamp, 5 s; allowed: 0 to 4.294967 s"))
                );
            }
        }
    }

    #[test]
    fn missing_columns_and_memory_are_reported() {
        let mut cloud = cloud();
        let error = cloud.pack_points(Driver::Hesai, 0.0, &mut [0; 129]).unwrap_err().to_string();
        assert_eq!(error, "memory to pack into is 129 bytes long; allowed: 130 bytes or more, 5 rows of 26 bytes");
        cloud.fields = cloud.fields.without(Field::Ring);
        cloud.columns.ring = Vec::new();
        let error = cloud.pack_points(Driver::Hesai, 0.0, &mut [0; 130]).unwrap_err().to_string();
        assert_eq!(
            error,
            "the cloud is without the column ring; allowed: clouds with x, y, z, intensity, ring, time for points in the \
             layout of the driver hesai"
        );
    }
}
