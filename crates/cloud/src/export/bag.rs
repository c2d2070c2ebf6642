//! A bag that is being written, topic by topic.

use crate::messages::cdr::{CdrWriter, Stamp};
use crate::messages::definition;
use ::mcap::records::MessageHeader;
use ::mcap::{Compression, McapError, WriteOptions, Writer};
use ground::write::Sink;
use std::collections::BTreeMap;
use std::io;
use std::path::Path;

/// Fast enough for the number of points that drivers publish; higher levels save little, as the data is mostly noise.
const COMPRESSION_LEVEL: u32 = 1;

/// Quality of service of a topic whose last message is kept for late subscribers: history keep last (1), reliable (1),
/// transient local (1), liveliness automatic (1); durations are infinite.
const FOR_LATER: &str = "- history: 1
  depth: 1
  reliability: 1
  durability: 1
  deadline: {sec: 9223372036, nsec: 854775807}
  lifespan: {sec: 9223372036, nsec: 854775807}
  liveliness: 1
  liveliness_lease_duration: {sec: 9223372036, nsec: 854775807}
  avoid_ros_namespace_conventions: false
";

/// The file of a bag.
pub(super) struct BagFile {
    writer: Writer<Sink>,
    /// Memory of the last message.
    bytes: Vec<u8>,
}

/// A topic.
pub(super) struct McapChannel {
    id: u16,
    /// Messages so far.
    count: u32,
}

impl BagFile {
    pub fn create(path: &Path) -> io::Result<BagFile> {
        let options = WriteOptions::new()
            .profile("ros2")
            .library(concat!("echocast ", env!("CARGO_PKG_VERSION")))
            .compression(Some(Compression::Zstd))
            .compression_level(COMPRESSION_LEVEL)
            // Several threads would compress differently.
            .compression_threads(0);
        let writer = options.create(Sink::create(path)?).map_err(io_error)?;
        Ok(BagFile { writer, bytes: Vec::new() })
    }

    /// A topic with messages of the type `kind`, such as `std_msgs/String`.
    pub fn topic(&mut self, topic: &str, kind: &str) -> io::Result<McapChannel> {
        self.channel(topic, kind, "")
    }

    /// A topic whose last message late subscribers receive.
    pub fn latched(&mut self, topic: &str, kind: &str) -> io::Result<McapChannel> {
        self.channel(topic, kind, FOR_LATER)
    }

    fn channel(&mut self, topic: &str, kind: &str, service: &str) -> io::Result<McapChannel> {
        let (package, name) = kind.split_once('/').unwrap_or_default();
        let writer = &mut self.writer;
        let schema = writer.add_schema(&format!("{package}/msg/{name}"), "ros2msg", definition(kind).as_bytes());
        let metadata = BTreeMap::from([("offered_qos_profiles".to_owned(), service.to_owned())]);
        let id = schema.and_then(|schema| writer.add_channel(schema, topic, "cdr", &metadata));
        Ok(McapChannel { id: id.map_err(io_error)?, count: 0 })
    }

    /// A new message, in the memory of the last.
    pub fn message(&mut self) -> CdrWriter {
        CdrWriter::new(std::mem::take(&mut self.bytes))
    }

    pub fn send(&mut self, channel: &mut McapChannel, stamp: Stamp, message: CdrWriter) -> io::Result<()> {
        self.bytes = message.bytes();
        let (log_time, publish_time) = (stamp.log_time(), stamp.log_time());
        let header = MessageHeader { channel_id: channel.id, sequence: channel.count, log_time, publish_time };
        self.writer.write_to_known_channel(&header, &self.bytes).map_err(io_error)?;
        channel.count = channel.count.wrapping_add(1);
        Ok(())
    }

    pub fn finish(&mut self) -> io::Result<()> {
        self.writer.finish().map(drop).map_err(io_error)
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        McapError::Parse(error) => io::Error::other(error),
        other => io::Error::other(other),
    }
}
