//! MCAP, the bag format of ROS 2: the clouds of one topic, transformed into one frame.

use super::about::About;
use super::ros::{CdrReader, CloudMessage, Transform, transforms};
use super::rows::Rows;
use super::target::FieldTarget;
use super::{MOST_OF_ONE, Source, contained};
use crate::{Field, Frame, PointCloud};
use ::mcap::McapError;
use ::mcap::records::op;
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use emitter::Trajectory;
use glam::{DMat3, DVec3};
use ground::error::{Error, Result};
use ground::pose::{Pose, on};
use ground::report::Report;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read as _};

/// Longest record, bytes: longer than the cloud of a frame.
const LONGEST: u64 = 1 << 30;
/// Bytes that are requested at once: memory for a record grows as its bytes arrive, not by the length that it claims.
const PIECE: usize = 1 << 20;
/// Bytes and records that are accepted in a file, however short it is.
const BELIEVED_BYTES: u64 = 64 << 20;
const BELIEVED_RECORDS: u64 = 1 << 16;
/// Maximum number of frames from one to the world.
const DEPTH: usize = 100;

/// Kinds of messages that are read.
const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
const TEXT: &str = "std_msgs/msg/String";

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    // Transforms may come after the clouds that need them.
    let mut frames = TransformTree::default();
    messages(source, |topic, bytes| {
        if topic.kind == TRANSFORMS {
            transforms(bytes).map_err(|fault| topic.error(source, fault))?.into_iter().for_each(|t| frames.add(t));
        }
        Ok(())
    })?;
    let mut bag = BagCloud::default();
    messages(source, |topic, bytes| bag.take(source, topic, bytes, &mut frames, report))?;
    bag.finish(source, report)
}

/// A stream of messages of one kind.
struct Topic {
    name: String,
    kind: String,
}

impl Topic {
    fn error(&self, source: &Source, fault: String) -> Error {
        Error::parse(source.path, format!("a message of {}", self.name), fault)
    }
}

/// Calls `work` with each message of `source`, in the order of the file.
///
/// # Errors
/// A file that is cut off or damaged, or that decompresses to more than its bytes can hold; errors of `work`.
fn messages(source: &Source, mut work: impl FnMut(&Topic, &[u8]) -> Result<()>) -> Result<()> {
    let mut file = source.from(0)?;
    let most = source.length.saturating_mul(MOST_OF_ONE).max(BELIEVED_BYTES);
    let options = LinearReaderOptions::default().with_record_length_limit(LONGEST.min(most) as usize);
    let mut reader = LinearReader::new_with_options(options.with_validate_chunk_crcs(true));
    let mut kinds = BTreeMap::new();
    let mut topics = BTreeMap::new();
    let failed = |error| source.failed(error, "its messages");
    // Each record takes at least a byte, however well it is compressed.
    let (mut records_left, mut bytes_left) = (source.length.max(BELIEVED_RECORDS), most);
    loop {
        let event = contained(|| reader.next_event().transpose().map_err(io_error)).map_err(failed)?;
        let requested = match event {
            None => return Ok(()),
            Some(LinearReadEvent::ReadRequest(count)) => count.min(PIECE),
            Some(LinearReadEvent::Record { opcode, data }) => {
                let left = records_left.checked_sub(1).zip(bytes_left.checked_sub(data.len() as u64));
                (records_left, bytes_left) = left
                    .ok_or_else(|| source.error("is more when decompressed than its bytes can hold: it is damaged"))?;
                let mut record = Fields(data);
                let cut_off = || failed(io::ErrorKind::UnexpectedEof.into());
                match opcode {
                    op::SCHEMA => {
                        let (id, name) = record.schema().ok_or_else(cut_off)?;
                        kinds.insert(id, name);
                    }
                    op::CHANNEL => {
                        let (id, schema, name, encoding) = record.channel().ok_or_else(cut_off)?;
                        if encoding == "cdr" {
                            let kind = kinds.get(&schema).cloned().unwrap_or_default();
                            topics.insert(id, Topic { name, kind });
                        }
                    }
                    op::MESSAGE => {
                        let (id, data) = record.message().ok_or_else(cut_off)?;
                        topics.get(&id).map_or(Ok(()), |topic| work(topic, data))?;
                    }
                    _ => {}
                }
                continue;
            }
        };
        let count = file.read(reader.insert(requested)).map_err(failed)?;
        reader.notify_read(count);
    }
}

/// The rest of a record, read from the start; `None`: it ends too early. By our own code, because the crate allocates
/// memory for any length that a text claims.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.first_chunk().copied()
    }

    fn u16(&mut self) -> Option<u16> {
        self.number().map(u16::from_le_bytes)
    }

    fn text(&mut self) -> Option<String> {
        let length = self.number().map(u32::from_le_bytes)?;
        self.bytes(length as usize).map(|bytes| String::from_utf8_lossy(bytes).into_owned())
    }

    /// Number and name.
    fn schema(&mut self) -> Option<(u16, String)> {
        Some((self.u16()?, self.text()?))
    }

    /// Number, that of the schema, name and encoding of messages.
    fn channel(&mut self) -> Option<(u16, u16, String, String)> {
        Some((self.u16()?, self.u16()?, self.text()?, self.text()?))
    }

    /// Number of the channel, and the message, which follows its sequence number and two times.
    fn message(&mut self) -> Option<(u16, &'a [u8])> {
        let channel = self.u16()?;
        self.bytes(4 + 8 + 8)?;
        Some((channel, self.0))
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        McapError::UnexpectedEof => io::ErrorKind::UnexpectedEof.into(),
        McapError::UnsupportedCompression(name) => {
            io::Error::other(format!("are compressed by {name:?}; allowed: zstd, or not compressed"))
        }
        other => io::Error::other(other),
    }
}

/// Poses of frames in others over time.
#[derive(Default)]
struct TransformTree {
    /// By child: the parent, and poses in it with their times, s.
    keys: BTreeMap<String, (String, Vec<(f64, Pose)>)>,
    /// The same, sorted.
    paths: BTreeMap<String, (String, Trajectory)>,
}

impl TransformTree {
    fn add(&mut self, transform: Transform) {
        let (parent, keys) = self.keys.entry(transform.child).or_default();
        *parent = transform.parent;
        keys.push((transform.time, transform.pose));
    }

    /// Pose of `frame` at `time`, s, in the root frame; `None`: it is a root itself.
    fn pose(&mut self, frame: &str, time: f64) -> Result<Option<Pose>> {
        for (child, (parent, mut keys)) in std::mem::take(&mut self.keys) {
            keys.sort_by(|(a, _), (b, _)| a.total_cmp(b));
            keys.dedup_by(|(later, _), (time, _)| later == time);
            self.paths.insert(child, (parent, Trajectory::new(keys)?));
        }
        let mut pose = None;
        let mut frame = frame;
        for _ in 0..DEPTH {
            let Some((parent, path)) = self.paths.get(frame) else { break };
            let in_parent = path.at(time);
            pose = Some(pose.map_or(in_parent, |pose| on(&in_parent, &pose)));
            frame = parent;
        }
        Ok(pose)
    }
}

/// The cloud of a bag while it is read.
#[derive(Default)]
struct BagCloud {
    about: About,
    has_legend: bool,
    /// The topic of its clouds, once there is one.
    topic: Option<String>,
    rows: Option<Rows>,
    /// Clouds read so far.
    count: usize,
    /// Whether they are in the frame of the sensor for lack of transforms.
    untransformed: bool,
    /// Topics that a cloud cannot hold.
    left: BTreeSet<String>,
}

impl BagCloud {
    fn take(
        &mut self,
        source: &Source,
        topic: &Topic,
        bytes: &[u8],
        frames: &mut TransformTree,
        report: &mut Report,
    ) -> Result<()> {
        let mine = self.topic.as_ref().is_none_or(|mine| *mine == topic.name);
        match &*topic.kind {
            CLOUD if mine => {
                self.topic = Some(topic.name.clone());
                let points = CloudMessage::read(bytes).map_err(|fault| topic.error(source, fault))?;
                self.add(source, topic, &points, frames, report)
            }
            TEXT if topic.name == "/legend" && self.rows.is_none() => {
                let text = CdrReader::new(bytes).and_then(|mut message| message.text());
                // Another program may use this topic for something else.
                if let Some(about) = text.ok().and_then(|text| About::parse(source.path, text.as_bytes()).ok()) {
                    (self.about, self.has_legend) = (about, true);
                }
                Ok(())
            }
            TRANSFORMS => Ok(()),
            _ => {
                self.left.insert(topic.name.clone());
                Ok(())
            }
        }
    }

    /// Appends `points`.
    fn add(
        &mut self,
        source: &Source,
        topic: &Topic,
        points: &CloudMessage,
        frames: &mut TransformTree,
        report: &mut Report,
    ) -> Result<()> {
        // Fields that a cloud cannot hold are reported for the first message only.
        let mut repeated = Report::default();
        let full_scale = self.about.intensity_full_scale.flatten().unwrap_or(255.0);
        let members = points.members(full_scale, if self.count == 0 { report } else { &mut repeated });
        let fields = members.iter().map(|member| member.goal.field).collect();
        let pose = frames.pose(&points.frame, points.time)?;
        if self.count == 0 {
            self.untransformed = pose.is_none();
            self.about.driver = self.about.driver.or_else(|| points.driver().filter(|_| !self.has_legend));
            self.about.frame = self.about.frame.or(pose.is_none().then_some(Frame::Sensor));
            self.about.sensor_pose = self.about.sensor_pose.or(pose);
            self.about.shape = u32::try_from(points.height).ok().zip(u32::try_from(points.width).ok()).map(Into::into);
        }
        self.about.shape = self.about.shape.filter(|&[rows, _]| self.count == 0 && rows > 1);
        self.count += 1;
        let mut rows = match self.rows.take() {
            Some(rows) => rows,
            None => Rows::new(fields, points.len(), Some(&self.about))?,
        };
        if rows.fields() != fields {
            return Err(topic.error(source, "has other fields than the first".to_owned()));
        }
        let [x, y, z] = [Field::X, Field::Y, Field::Z].map(|f| members.iter().find(|member| member.goal.field == f));
        let moved = pose.filter(|_| self.about.frame != Some(Frame::Sensor));
        let places = x.zip(y).zip(z).zip(moved).map(|(((&x, &y), &z), pose)| {
            let turn = DMat3::from_quat(pose.orientation);
            let mut places = points.positions(&[x, y, z]);
            places.iter_mut().for_each(|place| *place = turn * *place + pose.position);
            places
        });
        for member in &members {
            let axis = [Field::X, Field::Y, Field::Z].iter().position(|&field| field == member.goal.field);
            match (axis, &places) {
                (Some(axis), Some(places)) => {
                    let along = places.iter().map(|place: &DVec3| place[axis]);
                    rows.add(FieldTarget::from(member.goal.field), along)?;
                }
                _ => points.rows().try_for_each(|row| member.take(row, points.step, points.big_endian, &mut rows))?,
            }
        }
        self.rows = Some(rows);
        Ok(())
    }

    fn finish(self, source: &Source, report: &mut Report) -> Result<PointCloud> {
        let BagCloud { about, rows, count, untransformed, left, .. } = self;
        let Some(rows) = rows else {
            return Err(source.error(format!("has no message of {CLOUD}; allowed: bags of ROS 2 with clouds")));
        };
        if untransformed && count > 1 {
            report.warn(format!("mcap: without transforms, its {count} clouds all stay in the frame of the sensor"));
        }
        if !left.is_empty() {
            let left = left.into_iter().collect::<Vec<_>>().join(", ");
            report.warn(format!("mcap: a cloud cannot hold the topics {left}"));
        }
        side_by_side(rows.finish(source.path, "mcap", about, report)?)
    }
}

/// The cloud with a row for each laser if it has a column for each, as drivers arrange firings; otherwise the cloud
/// unchanged.
///
/// # Errors
/// No memory.
fn side_by_side(cloud: PointCloud) -> Result<PointCloud> {
    let Some([height, width]) = cloud.organised else { return Ok(cloud) };
    let [firings, lasers] = [height, width].map(|count| count as usize);
    let (ring, x) = (&cloud.columns.ring, &cloud.columns.x);
    if ring.is_empty() || x.is_empty() {
        return Ok(cloud);
    }
    let mut known = Vec::new();
    for laser in 0..lasers {
        // A row without a point may have no ring.
        let mut rings = (laser..ring.len()).step_by(lasers).filter(|&row| !x[row].is_nan()).map(|row| ring[row]);
        let first = rings.next();
        if rings.any(|ring| Some(ring) != first) {
            return Ok(cloud);
        }
        known.extend(first);
    }
    known.sort_unstable();
    if known.len() < 2 || known.windows(2).any(|pair| pair[0] == pair[1]) {
        return Ok(cloud);
    }
    let of_laser = |laser| (0..firings).map(move |firing| firing * lasers + laser);
    let order: Vec<usize> = (0..lasers).flat_map(of_laser).collect();
    Ok(PointCloud { organised: Some([width, height]), ..cloud.select(&order)? })
}
