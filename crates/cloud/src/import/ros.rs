//! Messages of ROS 2, as bags hold them: numbers in CDR, at multiples of their size after a header.

use super::names::{self, NamedColumn};
use super::number::{Member, value};
use crate::{Driver, Field, PointField};
use glam::DVec3;
use ground::named::Named as _;
use ground::pose::Pose;
use ground::read::number::Number;
use ground::report::Report;

/// The bytes of a message, read from the start.
pub(super) struct CdrReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

/// What is wrong with a message; follows the name of its topic.
pub(super) type MessageFault = String;

impl<'a> CdrReader<'a> {
    /// # Errors
    /// An unknown encoding.
    pub(super) fn new(bytes: &'a [u8]) -> Result<CdrReader<'a>, MessageFault> {
        match bytes {
            [0, 1, _, _, bytes @ ..] => Ok(CdrReader { bytes, at: 0 }),
            [high, low, ..] => Err(format!("is encoded as {high:#04x}{low:02x}; allowed: 0x0001, little-endian CDR")),
            _ => Err(cut_off()),
        }
    }

    /// The next `count` bytes.
    fn bytes(&mut self, count: usize) -> Result<&'a [u8], MessageFault> {
        let bytes = self.bytes.get(self.at..).and_then(|rest| rest.get(..count)).ok_or_else(cut_off)?;
        self.at += count;
        Ok(bytes)
    }

    fn number<const N: usize>(&mut self) -> Result<[u8; N], MessageFault> {
        self.at = self.at.next_multiple_of(N);
        Ok(self.bytes(N)?.first_chunk().copied().unwrap_or([0; N]))
    }

    fn u8(&mut self) -> Result<u8, MessageFault> {
        self.number().map(u8::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, MessageFault> {
        self.number().map(u32::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N], MessageFault> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.number()?);
        }
        Ok(numbers)
    }

    /// A text, terminated by a zero.
    pub(super) fn text(&mut self) -> Result<String, MessageFault> {
        let length = self.u32()? as usize;
        let bytes = self.bytes(length)?;
        Ok(String::from_utf8_lossy(bytes.strip_suffix(b"\0").unwrap_or(bytes)).into_owned())
    }

    /// Time, s, and the name of a frame.
    fn header(&mut self) -> Result<(f64, String), MessageFault> {
        let seconds = i32::from_le_bytes(self.number()?);
        let nanoseconds = self.u32()?;
        Ok((f64::from(seconds) + f64::from(nanoseconds) * 1e-9, self.text()?))
    }
}

fn cut_off() -> MessageFault {
    "is cut off".into()
}

/// The pose of a frame in another at a time.
pub(super) struct Transform {
    /// s
    pub time: f64,
    pub parent: String,
    pub child: String,
    pub pose: Pose,
}

/// The transforms of a `tf2_msgs/TFMessage`.
///
/// # Errors
/// A message of another type.
pub(super) fn transforms(bytes: &[u8]) -> Result<Vec<Transform>, MessageFault> {
    let mut message = CdrReader::new(bytes)?;
    let mut transforms = Vec::new();
    for _ in 0..message.u32()? {
        let (time, parent) = message.header()?;
        let child = message.text()?;
        let [px, py, pz, qx, qy, qz, qw] = message.f64s()?;
        let pose = super::about::pose([px, py, pz], [qx, qy, qz, qw])?;
        transforms.push(Transform { time, parent, child, pose });
    }
    Ok(transforms)
}

/// A `sensor_msgs/PointCloud2`.
pub(super) struct CloudMessage<'a> {
    /// s
    pub time: f64,
    /// Name of the frame of its positions.
    pub frame: String,
    pub height: usize,
    pub width: usize,
    fields: Vec<CloudField>,
    pub big_endian: bool,
    /// Bytes from point to point.
    pub step: usize,
    /// Bytes from row to row.
    row_step: usize,
    data: &'a [u8],
}

struct CloudField {
    name: String,
    number: Number,
    at: usize,
    /// Whether it is a single number; several are not a column.
    single: bool,
}

impl CloudField {
    /// Red, green and blue in one number.
    fn is_packed(&self) -> bool {
        matches!(&*self.name, "rgb" | "rgba") && self.number.size() == 4 && self.single
    }
}

impl<'a> CloudMessage<'a> {
    /// # Errors
    /// A message of another type, or whose points are not within it.
    pub(super) fn read(bytes: &'a [u8]) -> Result<CloudMessage<'a>, MessageFault> {
        let mut message = CdrReader::new(bytes)?;
        let (time, frame) = message.header()?;
        let [height, width] = [message.u32()? as usize, message.u32()? as usize];
        let mut fields = Vec::new();
        for _ in 0..message.u32()? {
            let name = message.text()?;
            let (at, kind, count) = (message.u32()? as usize, message.u8()?, message.u32()?);
            let number =
                number(kind).ok_or_else(|| format!("its field {name:?} is of type {kind}; allowed: 1 to 8"))?;
            fields.push(CloudField { name, number, at, single: count <= 1 });
        }
        let big_endian = message.u8()? != 0;
        let [step, row_step, length] = [message.u32()? as usize, message.u32()? as usize, message.u32()? as usize];
        let data = message.bytes(length)?;
        let points = CloudMessage { time, frame, height, width, fields, big_endian, step, row_step, data };
        if let Some(field) = points.fields.iter().find(|field| field.at + field.number.size() > step) {
            return Err(format!("its field {:?} is not within the {step} bytes of a point", field.name));
        }
        let row = width.checked_mul(step).filter(|&row| row <= row_step || height <= 1);
        let before = height.saturating_sub(1).checked_mul(row_step);
        let whole = row.zip(before).and_then(|(row, before)| row.checked_add(before));
        if step == 0 || whole.is_none_or(|whole| whole > length) {
            return Err(format!("says it has {height} x {width} points of {step} bytes in {length} bytes"));
        }
        Ok(points)
    }

    pub(super) fn len(&self) -> usize {
        self.height * self.width
    }

    /// Its points, row by row, or all at once where there is no padding between rows.
    pub(super) fn rows(&self) -> impl Iterator<Item = &'a [u8]> {
        let row = self.width * self.step;
        let together = self.height <= 1 || row == self.row_step;
        let (count, length) = if together { (1, row * self.height) } else { (self.height, row) };
        let (data, step) = (self.data, self.row_step);
        (0..count).map(move |index| &data[index * step..][..length])
    }

    /// The driver that publishes such points, if it can be identified.
    pub(super) fn driver(&self) -> Option<Driver> {
        let is = |required: &PointField| {
            let same = |field: &CloudField| field.name == required.name && field.number.size() == required.kind.size();
            self.fields.iter().any(same)
        };
        let mut drivers = Driver::NAMES.iter().map(|(_, driver)| *driver);
        let found = drivers.find(|driver| driver.point_fields().iter().all(is));
        // These two publish the same, except for rows and columns.
        found.map(|driver| if driver == Driver::Hesai && self.height > 1 { Driver::Robosense } else { driver })
    }

    /// Its numbers that are read into columns; `full_scale` is that of the intensity. Fields that a cloud cannot hold
    /// are added to `report`.
    pub(super) fn members(&self, full_scale: f32, report: &mut Report) -> Vec<Member> {
        let mut columns = Vec::new();
        let mut places = Vec::new();
        let has = |name: &str| self.fields.iter().any(|field| field.name == name);
        let livox = has("tag") && has("line");
        let autoware = has("return_type") && has("time_stamp");
        for field in &self.fields {
            if field.is_packed() {
                // 0x00RRGGBB
                let bytes = if self.big_endian { [1, 2, 3] } else { [2, 1, 0] };
                columns.extend(["red", "green", "blue"].map(|name| NamedColumn::new(name, Number::U8)));
                places.extend(bytes.map(|byte| field.at + byte));
            } else {
                let name = match &*field.name {
                    "channel" if autoware => "ring",
                    name if field.single => name,
                    name => &format!("{name}[]"),
                };
                columns.push(NamedColumn::new(name, field.number));
                places.push(field.at);
            }
        }
        let goals = names::goals(&columns, "mcap", report);
        let mut members = Vec::new();
        for ((goal, column), at) in goals.into_iter().zip(&columns).zip(places) {
            let Some(mut goal) = goal else { continue };
            match (goal.field, column.number) {
                // Livox counts nanoseconds in f64.
                (Field::Time, Number::F64) if livox && column.name == "timestamp" => goal.factor = 1e-9,
                // Drivers count from the stamp where the number has too few bits for absolute time.
                (Field::Time, Number::F32 | Number::I32 | Number::U32) => goal.shift = self.time,
                // Ouster's are in mm.
                (Field::Range, Number::U32) => goal.factor = 1e-3,
                (Field::Intensity, Number::U8) if autoware => goal.factor = f64::from(full_scale) / 255.0,
                _ => {}
            }
            members.push(Member { goal, number: column.number, at });
        }
        members
    }

    /// The positions of the points, m, in its frame.
    pub(super) fn positions(&self, members: &[Member; 3]) -> Vec<DVec3> {
        let value = |point: &[u8], member: Member| value(member.number, &point[member.at..], self.big_endian);
        let place = |point: &[u8]| DVec3::from_array(members.map(|member| value(point, member)));
        self.rows().flat_map(|row| row.chunks_exact(self.step)).map(place).collect()
    }
}

/// Type of the number `kind` of `sensor_msgs/PointField`.
fn number(kind: u8) -> Option<Number> {
    use Number::{F32, F64, I8, I16, I32, U8, U16, U32};
    [I8, U8, I16, U16, I32, U32, F32, F64].get(usize::from(kind).checked_sub(1)?).copied()
}
