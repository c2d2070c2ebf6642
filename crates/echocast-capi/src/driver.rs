//! Points as ROS 2 drivers publish them.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::pack::{CallerBuffer, number_of_packed};
use crate::result::{echocast_result, look};
use crate::text;
use crate::time::seconds;
use echocast::{Driver, Named as _};
use std::ffi::{CString, c_char, c_void};
use std::ptr;
use std::sync::OnceLock;

/// Velodyne's driver, velodyne_pointcloud: points XYZIRT.
pub const ECHOCAST_DRIVER_VELODYNE: i32 = 1;
/// Ouster's driver, ouster_ros: points `original`.
pub const ECHOCAST_DRIVER_OUSTER: i32 = 2;
/// Hesai's driver, HesaiLidar_ROS_2.0.
pub const ECHOCAST_DRIVER_HESAI: i32 = 3;
/// RoboSense's driver, rslidar_sdk: points XYZIRT.
pub const ECHOCAST_DRIVER_ROBOSENSE: i32 = 4;
/// Livox's driver, livox_ros_driver2.
pub const ECHOCAST_DRIVER_LIVOX: i32 = 5;
/// Autoware's drivers: PointXYZIRCAEDT.
pub const ECHOCAST_DRIVER_AUTOWARE: i32 = 6;

/// A field of the points in a driver's messages, as in sensor_msgs/PointField.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_point_field {
    /// Name.
    pub name: *const c_char,
    /// Type: an ECHOCAST_TYPE_ number.
    pub kind: i32,
    /// Offset of its first byte in the point.
    pub offset: u32,
}

/// The points that a driver publishes; ECHOCAST_DRIVER_INFO_INIT is empty.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct echocast_driver_info {
    /// sizeof(echocast_driver_info).
    pub struct_size: usize,
    /// The columns that a scan must compute, for scan_desc.columns: "x,y,z,intensity,ring,time".
    pub columns: *const c_char,
    /// Size of a point, bytes.
    pub point_step: usize,
    /// Number of fields.
    pub field_count: usize,
    /// The fields.
    pub fields: [echocast_point_field; 16],
}

impl Default for echocast_driver_info {
    fn default() -> Self {
        echocast_driver_info {
            struct_size: size_of::<Self>(),
            columns: ptr::null(),
            point_step: 0,
            field_count: 0,
            fields: [echocast_point_field { name: ptr::null(), kind: 0, offset: 0 }; 16],
        }
    }
}

text::versioned!(echocast_driver_info { struct_size, columns, point_step, field_count, fields });

/// The driver that has an ECHOCAST_DRIVER_ number.
fn driver_of(number: i32) -> Outcome<Driver> {
    let index = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
    let found = index.and_then(|index| Driver::NAMES.get(index));
    let allowed = format!("1 to {}, an ECHOCAST_DRIVER_ number", Driver::NAMES.len());
    found.map(|(_, driver)| *driver).ok_or_else(|| Failure::argument("driver", number, &allowed))
}

/// The ECHOCAST_DRIVER_ number of a driver; 0 for none.
pub(crate) fn number_of(driver: Option<Driver>) -> i32 {
    let at = Driver::NAMES.iter().position(|(_, known)| Some(*known) == driver);
    at.map_or(0, |index| index as i32 + 1)
}

/// The texts of a driver as C strings.
struct Texts {
    columns: CString,
    fields: Vec<CString>,
}

fn texts(driver: Driver) -> &'static Texts {
    static ALL: OnceLock<Vec<Texts>> = OnceLock::new();
    let text = |name: &str| CString::new(name).unwrap_or_default();
    let all = ALL.get_or_init(|| {
        let of = |driver: Driver| Texts {
            columns: text(&driver.columns().iter().map(|info| info.name).collect::<Vec<_>>().join(",")),
            fields: driver.point_fields().iter().map(|field| text(field.name)).collect(),
        };
        Driver::NAMES.iter().map(|(_, driver)| of(*driver)).collect()
    });
    &all[number_of(Some(driver)) as usize - 1]
}

/// Gets the layout of the points that a driver publishes: names, types and offsets of the fields, for the message, and
/// the columns that a scan must compute. The caller sets struct_size of `*info`. Texts are static.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such driver).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_driver_get_info(driver: i32, info: *mut echocast_driver_info) -> echocast_status {
    guard(|| {
        let driver = driver_of(driver)?;
        let texts = texts(driver);
        let mut found = echocast_driver_info {
            columns: texts.columns.as_ptr(),
            point_step: driver.point_step(),
            field_count: driver.point_fields().len(),
            ..echocast_driver_info::default()
        };
        for (to, (field, name)) in found.fields.iter_mut().zip(driver.point_fields().iter().zip(&texts.fields)) {
            *to = echocast_point_field {
                name: name.as_ptr(),
                kind: number_of_packed(field.kind),
                offset: field.offset as u32,
            };
        }
        // SAFETY: `info` is a structure (see `text`).
        unsafe { text::put_structure(found, info, "info") }
    })
}

/// Gets the height and width of the message that a driver would publish for a result: for organised results those of
/// the driver's image, in which Velodyne and RoboSense have a column for each ring and a row for each firing; otherwise
/// 1 and the number of points.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such driver), ECHOCAST_E_HANDLE, ECHOCAST_E_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_driver_shape(
    result: *const echocast_result,
    driver: i32,
    height: *mut u32,
    width: *mut u32,
) -> echocast_status {
    guard(|| {
        let driver = driver_of(driver)?;
        look(result, |points| {
            let [rows, columns] = points.cloud.driver_shape(driver);
            for (count, to, name) in [(rows, height, "height"), (columns, width, "width")] {
                // SAFETY: `to` is an output (see `text`).
                unsafe { text::output(to, name) }?.write(u32::try_from(count).unwrap_or(u32::MAX));
            }
            Ok(())
        })
    })
}

/// Writes the points as a driver publishes them, point i at `to + i * point_step`. Positions are in the sensor frame at
/// the start of the scan; those of a scan with ECHOCAST_COORDINATES_SENSOR and without scan_desc.deskew stay in the
/// frame of their own firing. Times count from `stamp_ns`, the stamp of the message, for drivers that do so (Velodyne,
/// Ouster, Autoware), otherwise from the start of the run; the ring is the column `ring`. Points of organised results
/// are in the order of the driver's image (echocast_result_driver_shape). All bytes are written, those outside of
/// fields as 0. Azimuth, elevation and range that were not computed are derived from the positions. `capacity`: size of
/// `to`, bytes; `*needed` (may be NULL): point_step * points; if `to` is NULL, only that is written.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such driver, a column that was not computed, too little room), ECHOCAST_E_HANDLE,
/// ECHOCAST_E_BUSY, ECHOCAST_E_MEMORY.
///
/// ```c
/// echocast_driver_info velodyne = ECHOCAST_DRIVER_INFO_INIT;
/// echocast_driver_get_info(ECHOCAST_DRIVER_VELODYNE, &velodyne);
/// scan.columns = velodyne.columns;
/// echocast_scan(snapshot, &scan, &result);
/// echocast_result_pack_driver(result, ECHOCAST_DRIVER_VELODYNE, scan.t0_ns, bytes, sizeof bytes, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_pack_driver(
    result: *const echocast_result,
    driver: i32,
    stamp_ns: i64,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let driver = driver_of(driver)?;
        look(result, |points| {
            let cloud = &points.cloud;
            let room = CallerBuffer { to, capacity, needed };
            // SAFETY: `to` is a buffer and `needed` an output (see `text`).
            let to = unsafe { room.bytes("driver", driver.name(), cloud.packed_len(driver.point_step())) }?;
            let Some(to) = to else { return Ok(()) };
            Ok(points.context.engine.install(|| cloud.pack_points(driver, seconds(stamp_ns), to))?)
        })
    })
}
