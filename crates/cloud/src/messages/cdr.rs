//! The bytes of messages: CDR (OMG, DDS-XTypes 1.3, 7.4.1), little endian: each number is at a multiple of its size,
//! counted from the end of the four-byte header.

use echocast_memory::tried;
use glam::{DQuat, DVec3};
use ground::pose::Pose;
use std::io;

/// A time, ns since the start of the run.
#[derive(Clone, Copy)]
pub(crate) struct Stamp(pub i64);

impl Stamp {
    /// `time` in s.
    pub fn of(time: f64) -> Stamp {
        Stamp((time * 1e9).round() as i64)
    }

    /// As bags count time: never below 0.
    pub fn log_time(self) -> u64 {
        self.0.max(0) as u64
    }

    pub fn seconds(self) -> f64 {
        self.0 as f64 / 1e9
    }
}

/// The bytes of a message that is being written.
pub(crate) struct CdrWriter(Vec<u8>);

/// Bytes before a message: its encoding.
const HEADER: [u8; 4] = [0, 1, 0, 0];

#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only bags need all of it"))]
impl CdrWriter {
    /// An empty message in the memory of `bytes`.
    pub fn new(mut bytes: Vec<u8>) -> CdrWriter {
        bytes.clear();
        bytes.extend(HEADER);
        CdrWriter(bytes)
    }

    pub fn bytes(self) -> Vec<u8> {
        self.0
    }

    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let at = (self.0.len() - HEADER.len()).next_multiple_of(N) + HEADER.len();
        self.0.resize(at, 0);
        self.0.extend(bytes);
    }

    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn i8(&mut self, value: i8) {
        self.number(value.to_le_bytes());
    }

    pub fn u16(&mut self, value: u16) {
        self.number(value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.number(value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.number(value.to_le_bytes());
    }

    pub fn f32s(&mut self, values: &[f32]) {
        values.iter().for_each(|value| self.number(value.to_le_bytes()));
    }

    pub fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.number(value.to_le_bytes()));
    }

    /// The number of bytes or members that follow.
    pub fn count(&mut self, count: usize) -> io::Result<()> {
        let count = u32::try_from(count).map_err(|_| {
            let reason = format!("{count} bytes of a frame are too many for a message, which holds {}", u32::MAX);
            io::Error::new(io::ErrorKind::FileTooLarge, reason)
        })?;
        self.u32(count);
        Ok(())
    }

    pub fn text(&mut self, text: &str) -> io::Result<()> {
        // It is terminated by a zero.
        let text = text.split('\0').next().unwrap_or_default();
        self.count(text.len() + 1)?;
        self.0.extend(text.as_bytes());
        self.0.push(0);
        Ok(())
    }

    pub fn time(&mut self, stamp: Stamp) {
        const SECOND: i64 = 1_000_000_000;
        let seconds = stamp.0.div_euclid(SECOND).clamp(i32::MIN.into(), i32::MAX.into()) as i32;
        self.number(seconds.to_le_bytes());
        self.u32(stamp.0.rem_euclid(SECOND) as u32);
    }

    pub fn header(&mut self, stamp: Stamp, frame: &str) -> io::Result<()> {
        self.time(stamp);
        self.text(frame)
    }

    pub fn vector(&mut self, vector: DVec3) {
        self.f64s(&vector.to_array());
    }

    pub fn quaternion(&mut self, quaternion: DQuat) {
        self.f64s(&quaternion.to_array());
    }

    /// A pose, or a transform.
    pub fn pose(&mut self, pose: &Pose) {
        self.vector(pose.position);
        self.quaternion(pose.orientation);
    }

    /// Bytes as they are.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }

    /// Adds `count` and as many zeros, to be filled.
    pub fn zeros(&mut self, count: usize) -> io::Result<&mut [u8]> {
        self.count(count)?;
        let start = self.0.len();
        tried(|| self.0.try_reserve(count + 8)).map_err(|_| io::ErrorKind::OutOfMemory)?;
        self.0.resize(start + count, 0);
        Ok(&mut self.0[start..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_at_multiples_of_their_size_behind_the_header() {
        let mut message = CdrWriter::new(vec![7; 3]);
        message.u8(1);
        message.u32(2);
        message.text("ab").unwrap();
        message.f64s(&[1.0]);
        let numbers = [0, 1, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3, 0, 0, 0, b'a', b'b', 0, 0];
        assert_eq!(message.0, [&numbers[..], &1f64.to_le_bytes()].concat());
        assert!(message.count(1 << 32).unwrap_err().to_string().contains("too many for a message"));
    }

    #[test]
    fn times_have_whole_seconds_below_them() {
        let mut message = CdrWriter::new(Vec::new());
        message.header(Stamp::of(-0.25), "").unwrap();
        assert_eq!(message.0[4..8], (-1i32).to_le_bytes());
        assert_eq!(message.0[8..12], 750_000_000u32.to_le_bytes());
        assert_eq!((Stamp::of(-0.25).log_time(), Stamp::of(2.5).log_time()), (0, 2_500_000_000));
    }
}
