//! Messages of ROS 2, serialised.

use crate::guard::{Failure, Outcome, echocast_status, guard};
use crate::pack::CallerBuffer;
use crate::pose::echocast_pose_key;
use crate::result::{echocast_result, look};
use crate::text;
use crate::time::seconds;
use echocast::emitter::{Imu, ImuModel};
use echocast::messages::{self, ScanMessage};
use echocast::{Named, Pose, Trajectory};
use std::ffi::{c_char, c_void};

/// sensor_msgs/LaserScan: the range of the first return of each beam of a LiDAR with a single ring.
pub const ECHOCAST_MESSAGE_LASER_SCAN: i32 = 1;
/// sensor_msgs/MultiEchoLaserScan: all returns, likewise.
pub const ECHOCAST_MESSAGE_MULTI_ECHO_LASER_SCAN: i32 = 2;
/// livox_ros_driver2/CustomMsg: points as Livox's driver publishes them in its own format.
pub const ECHOCAST_MESSAGE_LIVOX_CUSTOM: i32 = 3;

/// Xsens MTi-10: 100 measurements per second.
pub const ECHOCAST_IMU_XSENS_MTI10: i32 = 1;
/// VectorNav VN-200: 200 per second.
pub const ECHOCAST_IMU_VECTORNAV_VN200: i32 = 2;
/// Without errors: 200 per second.
pub const ECHOCAST_IMU_IDEAL: i32 = 3;

/// The value with a number from 1 on, which is the argument `name`.
fn of_number<T: Named>(number: i32, name: &str, prefix: &str) -> Outcome<T> {
    let index = usize::try_from(number).ok().and_then(|number| number.checked_sub(1));
    let found = index.and_then(|index| T::NAMES.get(index));
    let allowed = format!("1 to {}, an {prefix} number", T::NAMES.len());
    found.map(|(_, value)| *value).ok_or_else(|| Failure::argument(name, number, &allowed))
}

/// Puts `bytes` into `room`.
///
/// # Safety
/// Its `to` is a buffer and its `needed` an output, as [`text`] describes.
unsafe fn put(bytes: &[u8], room: CallerBuffer) -> Outcome {
    // SAFETY: as the caller promises.
    if let Some(to) = unsafe { room.bytes("message", "given", Some(bytes.len())) }? {
        to.copy_from_slice(bytes);
    }
    Ok(())
}

/// The poses as a trajectory whose time 0 is that of the first, and that time.
///
/// # Safety
/// `poses` is an array, as [`text`] describes.
unsafe fn path(poses: *const echocast_pose_key, count: usize) -> Outcome<(Trajectory, i64)> {
    // SAFETY: as the caller promises.
    let poses = unsafe { text::array(poses, count, "poses") }?;
    let Some(first) = poses.first() else {
        return Err(Failure::argument("pose_count", 0, "1 or more"));
    };
    let key = |(number, key): (usize, &echocast_pose_key)| -> Outcome<(f64, Pose)> {
        let pose = key.pose.rigid("poses[i].pose").map_err(|failure| failure.at("[i]", number))?;
        Ok((since(key.t_ns, first.t_ns, "poses[i].t_ns").map_err(|failure| failure.at("[i]", number))?, pose))
    };
    let keys = poses.iter().enumerate().map(key).collect::<Outcome<Vec<_>>>()?;
    Ok((Trajectory::new(keys)?, first.t_ns))
}

/// Time from `from` to `t_ns`, s.
fn since(t_ns: i64, from: i64, name: &str) -> Outcome<f64> {
    let since = t_ns.checked_sub(from).map(seconds);
    since.ok_or_else(|| Failure::argument(name, t_ns, "less than 292 years from the first pose"))
}

/// Writes a result, that of one scan, as a serialised message (an ECHOCAST_MESSAGE_ number) of ROS 2, in the frame
/// `frame_id` of the sensor: CDR, little endian, with its four-byte header, as a publisher of serialised messages takes it.
/// Ranges of a LaserScan are those of the points at the angles of the beams, in the order of firing, so that a sensor that
/// turns clockwise has a negative angle_increment; a beam without a return has the range +inf and the intensity 0. Without
/// the column "beam" beams are found by "azimuth", else by the points. A CustomMsg needs the columns
/// "x,y,z,intensity,return_number,ring,time". Stamps are times of the run. `capacity`: size of `to`, bytes; `*needed` (may
/// be NULL): those of the message; if `to` is NULL, only that is written.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such message, a result that cannot be one, too little room), ECHOCAST_E_HANDLE,
/// ECHOCAST_E_BUSY, ECHOCAST_E_MEMORY.
///
/// ```c
/// scan.columns = "range,intensity,return_number,beam";
/// echocast_scan(snapshot, &scan, &result);
/// size_t size;
/// echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", NULL, 0, &size);
/// unsigned char *data = malloc(size);
/// echocast_result_pack_message(result, ECHOCAST_MESSAGE_LASER_SCAN, "laser", data, size, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_result_pack_message(
    result: *const echocast_result,
    message: i32,
    frame_id: *const c_char,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let message: ScanMessage = of_number(message, "message", "ECHOCAST_MESSAGE_")?;
        // SAFETY: `frame_id` is a text (see `text`).
        let frame_id = unsafe { text::required(frame_id, "frame_id") }?;
        look(result, |points| {
            let bytes = points.cloud.message(message, frame_id)?;
            // SAFETY: `to` is a buffer and `needed` an output (see `text`).
            unsafe { put(&bytes, CallerBuffer { to, capacity, needed }) }
        })
    })
}

/// Writes what an IMU measures as a serialised sensor_msgs/Imu, in the frame `frame_id` of the IMU: angular velocity, rad/s,
/// and specific force, m/s2, which at rest is 9.80665 upwards, in the IMU's axes; no orientation. `imu`: an ECHOCAST_IMU_
/// number. `number`: that of the measurement, from time 0 of the run on, and so its time: number / rate. `poses`: those of
/// the IMU around that time, at rising times; the velocity is constant between two, and its changes are spread over the
/// halves of both neighbours, so that three poses or more are needed to feel an acceleration. Errors are functions of
/// `seed` and `number`. `to`, `capacity` and `needed` are as for echocast_result_pack_message.
///
/// Errors: ECHOCAST_E_ARGUMENT (no such IMU, no poses, times that do not rise, too little room), ECHOCAST_E_MEMORY.
///
/// ```c
/// echocast_pose_key path[3] = {{0, poses[0]}, {period, poses[1]}, {2 * period, poses[2]}};
/// echocast_pack_imu(path, 3, ECHOCAST_IMU_XSENS_MTI10, 7, 10, "imu_link", bytes, sizeof bytes, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pack_imu(
    poses: *const echocast_pose_key,
    pose_count: usize,
    imu: i32,
    seed: u64,
    number: i64,
    frame_id: *const c_char,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        let model: ImuModel = of_number(imu, "imu", "ECHOCAST_IMU_")?;
        // SAFETY: `frame_id` is a text (see `text`).
        let frame_id = unsafe { text::required(frame_id, "frame_id") }?;
        // SAFETY: `poses` is an array (see `text`).
        let (path, first) = unsafe { path(poses, pose_count) }?;
        // Rates divide a second into whole nanoseconds.
        let t_ns = number.checked_mul((1e9 / model.rate_hz()) as i64);
        let t_ns = t_ns.ok_or_else(|| Failure::argument("number", number, "a time within 292 years of 0"))?;
        let sample = Imu::new(model, seed).sample_at(&path, number, since(t_ns, first, "number")?);
        let bytes = messages::imu(&sample, frame_id)?;
        // SAFETY: `to` is a buffer and `needed` an output (see `text`).
        unsafe { put(&bytes, CallerBuffer { to, capacity, needed }) }
    })
}

/// Writes pose and velocities at `t_ns` as a serialised nav_msgs/Odometry: the pose in the frame `frame_id`, the twist in
/// the frame `child_frame_id` of what moves. `poses`: poses around that time, at rising times. `to`, `capacity` and
/// `needed` are as for echocast_result_pack_message.
///
/// Errors: ECHOCAST_E_ARGUMENT (no poses, times that do not rise, too little room), ECHOCAST_E_MEMORY.
///
/// ```c
/// echocast_pose_key step[2] = {{0, poses[0]}, {period, poses[1]}};
/// echocast_pack_odometry(step, 2, period / 2, "odom", "base_link", bytes, sizeof bytes, NULL);
/// ```
#[unsafe(no_mangle)]
pub unsafe extern "C" fn echocast_pack_odometry(
    poses: *const echocast_pose_key,
    pose_count: usize,
    t_ns: i64,
    frame_id: *const c_char,
    child_frame_id: *const c_char,
    to: *mut c_void,
    capacity: usize,
    needed: *mut usize,
) -> echocast_status {
    guard(|| {
        // SAFETY: both are texts (see `text`).
        let (frame_id, child) =
            unsafe { (text::required(frame_id, "frame_id")?, text::required(child_frame_id, "child_frame_id")?) };
        // SAFETY: `poses` is an array (see `text`).
        let (path, first) = unsafe { path(poses, pose_count) }?;
        let mut sample = path.odometry(since(t_ns, first, "t_ns")?);
        sample.time = seconds(t_ns);
        let bytes = messages::odometry(&sample, frame_id, child)?;
        // SAFETY: `to` is a buffer and `needed` an output (see `text`).
        unsafe { put(&bytes, CallerBuffer { to, capacity, needed }) }
    })
}
