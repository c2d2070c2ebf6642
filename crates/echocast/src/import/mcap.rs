//! MCAP, the bags of ROS 2: the clouds of one topic, put by the transforms into one frame.

use super::about::About;
use super::ros::{Message, Points, Transform, transforms};
use super::rows::{Goal, Rows};
use super::{MOST_OF_ONE, Source, contained};
use crate::cloud::{Field, Frame, PointCloud};
use crate::emitter::Trajectory;
use crate::ground::error::{Error, Result};
use crate::ground::pose::{Pose, on};
use crate::ground::report::Report;
use ::mcap::McapError;
use ::mcap::records::op;
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use glam::{DMat3, DVec3};
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Read as _};

/// Longest record, bytes: more than the cloud of a frame.
const LONGEST: u64 = 1 << 30;
/// Bytes that are asked for at once: a record takes memory as its bytes come, not by the length that it claims.
const PIECE: usize = 1 << 20;
/// Bytes and records that are believed to be in a file, however short it is.
const BELIEVED_BYTES: u64 = 64 << 20;
const BELIEVED_RECORDS: u64 = 1 << 16;
/// Most frames from one to the world.
const DEPTH: usize = 100;

/// Kinds of messages that are read.
const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
const TEXT: &str = "std_msgs/msg/String";

pub(super) fn read(source: &Source, report: &mut Report) -> Result<PointCloud> {
    // Transforms may come behind the clouds that need them.
    let mut frames = Frames::default();
    messages(source, |topic, bytes| {
        if topic.kind == TRANSFORMS {
            transforms(bytes).map_err(|fault| topic.error(source, fault))?.into_iter().for_each(|t| frames.add(t));
        }
        Ok(())
    })?;
    let mut bag = Bag::default();
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

/// Does `work` with each message of `source`, in the order of the file.
///
/// # Errors
/// A file that is cut off or damaged, or that is more when decompressed than its bytes can be; those of `work`.
fn messages(source: &Source, mut work: impl FnMut(&Topic, &[u8]) -> Result<()>) -> Result<()> {
    let mut file = source.from(0)?;
    let most = source.length.saturating_mul(MOST_OF_ONE).max(BELIEVED_BYTES);
    let options = LinearReaderOptions::default().with_record_length_limit(LONGEST.min(most) as usize);
    let mut reader = LinearReader::new_with_options(options.with_validate_chunk_crcs(true));
    let mut kinds = BTreeMap::new();
    let mut topics = BTreeMap::new();
    let failed = |error| source.failed(error, "its messages");
    // A record of its own takes at least a byte, however well it is compressed.
    let (mut records_left, mut bytes_left) = (source.length.max(BELIEVED_RECORDS), most);
    loop {
        let event = contained(|| reader.next_event().transpose().map_err(io_error)).map_err(failed)?;
        let wanted = match event {
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
        let count = file.read(reader.insert(wanted)).map_err(failed)?;
        reader.notify_read(count);
    }
}

/// The rest of a record, from the front; `None`: it ends before. By our own code, for the crate takes memory for whatever
/// length a text claims.
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

    /// Number of the channel, and the message, behind its number and two times.
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

/// Where frames are in others over time.
#[derive(Default)]
struct Frames {
    /// By child: the parent, and poses in it with their times, s.
    keys: BTreeMap<String, (String, Vec<(f64, Pose)>)>,
    /// The same, in order.
    paths: BTreeMap<String, (String, Trajectory)>,
}

impl Frames {
    fn add(&mut self, transform: Transform) {
        let (parent, keys) = self.keys.entry(transform.child).or_default();
        *parent = transform.parent;
        keys.push((transform.time, transform.pose));
    }

    /// Where `frame` is at `time`, s, in the frame that is in no other; `None`: it is in no other itself.
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

/// The cloud of a bag, as it is read.
#[derive(Default)]
struct Bag {
    about: About,
    /// The topic of its clouds, once there is one.
    topic: Option<String>,
    rows: Option<Rows>,
    /// Clouds so far.
    count: usize,
    /// Whether they are in the frame of the sensor for want of transforms.
    untransformed: bool,
    /// Topics that a cloud has no place for.
    left: BTreeSet<String>,
}

impl Bag {
    fn take(
        &mut self,
        source: &Source,
        topic: &Topic,
        bytes: &[u8],
        frames: &mut Frames,
        report: &mut Report,
    ) -> Result<()> {
        let mine = self.topic.as_ref().is_none_or(|mine| *mine == topic.name);
        match &*topic.kind {
            CLOUD if mine => {
                self.topic = Some(topic.name.clone());
                let points = Points::read(bytes).map_err(|fault| topic.error(source, fault))?;
                self.add(source, topic, &points, frames, report)
            }
            TEXT if topic.name == "/legend" && self.rows.is_none() => {
                let text = Message::new(bytes).and_then(|mut message| message.text());
                // Another program may have something else there.
                if let Some(about) = text.ok().and_then(|text| About::parse(source.path, text.as_bytes()).ok()) {
                    self.about = about;
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
        points: &Points,
        frames: &mut Frames,
        report: &mut Report,
    ) -> Result<()> {
        // Those of the first tell what has no place.
        let mut told_before = Report::default();
        let members = points.members(if self.count == 0 { report } else { &mut told_before });
        let fields = members.iter().map(|member| member.goal.field).collect();
        let pose = frames.pose(&points.frame, points.time)?;
        if self.count == 0 {
            self.untransformed = pose.is_none();
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
                    rows.add(Goal::from(member.goal.field), along)?;
                }
                _ => points.rows().try_for_each(|row| member.take(row, points.step, points.big_endian, &mut rows))?,
            }
        }
        self.rows = Some(rows);
        Ok(())
    }

    fn finish(self, source: &Source, report: &mut Report) -> Result<PointCloud> {
        let Bag { about, rows, count, untransformed, left, .. } = self;
        let Some(rows) = rows else {
            return Err(source.error(format!("has no message of {CLOUD}; allowed: bags of ROS 2 with clouds")));
        };
        if untransformed && count > 1 {
            report.warn(format!("mcap: without transforms, its {count} clouds are all as the sensor sees them"));
        }
        if !left.is_empty() {
            let left = left.into_iter().collect::<Vec<_>>().join(", ");
            report.warn(format!("mcap: a cloud has no place for the topics {left}"));
        }
        rows.finish(source.path, "mcap", about, report)
    }
}
