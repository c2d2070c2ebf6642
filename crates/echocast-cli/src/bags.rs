//! What goes into bags besides points.

use crate::choice;
use anyhow::{Context as _, Result, ensure};
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use echocast::emitter::{ImuModel, NavigationSolution};
use echocast::messages::{BagMotion, BagOptions, BagTopic};
use echocast::{FieldSet, Named, Pose, Sensor, Trajectory};
use serde_json::{Map, Value, json};
use std::sync::Arc;

/// Options for the messages of bags.
#[derive(Args, Clone, Default)]
pub struct BagArgs {
    /// Messages in bags (.mcap): `points`; `scan` and `echoes`, the LaserScan and MultiEchoLaserScan of a LiDAR with a single
    /// ring; `livox`, the CustomMsg of Livox's driver; `imu`, `odom` and `clock`, of what carries the sensor; `default`, what
    /// suits the sensor: points, its LaserScan and a Livox's CustomMsg
    #[arg(long, value_name = "LIST", requires = "output", value_delimiter = ',', value_parser = choice_of_messages(), hide_possible_values = true, help_heading = "Output")]
    messages: Vec<MessageChoice>,
    /// IMU that measures for `--messages imu` [default: xsens_mti10]
    #[arg(long, value_name = "MODEL", requires = "messages", value_parser = choice::of::<ImuModel>(), help_heading = "Output")]
    imu: Option<ImuModel>,
}

/// A word of `--messages`; `None`: what suits the sensor.
type MessageChoice = Option<BagTopic>;

const DEFAULT: &str = "default";

fn choice_of_messages() -> impl TypedValueParser<Value = MessageChoice> {
    let names = BagTopic::NAMES.iter().map(|(name, _)| *name).chain([DEFAULT]);
    PossibleValuesParser::new(names).map(|given| topic_called(&given).unwrap_or_default())
}

/// `None`: no such topic.
fn topic_called(given: &str) -> Option<MessageChoice> {
    let topic = BagTopic::NAMES.iter().find(|(name, _)| *name == given).map(|(_, topic)| Some(*topic));
    topic.or_else(|| (given == DEFAULT).then_some(None))
}

impl BagArgs {
    /// From the keys `messages` and `imu` of a scenario.
    pub fn from_keys(messages: Vec<String>, imu: Option<&str>) -> Result<BagArgs> {
        let list = |names: Vec<&str>| names.join(", ");
        let known = || list(BagTopic::NAMES.iter().map(|(name, _)| *name).chain([DEFAULT]).collect());
        let topic = |name: &String| {
            topic_called(name).with_context(|| format!("messages: {name:?} is none; allowed: {}", known()))
        };
        let models = || list(ImuModel::NAMES.iter().map(|(name, _)| *name).collect());
        let model = |name: &str| {
            let found = ImuModel::NAMES.iter().find(|(known, _)| *known == name).map(|(_, model)| *model);
            found.with_context(|| format!("imu: {name:?} is none; allowed: {}", models()))
        };
        Ok(BagArgs { messages: messages.iter().map(topic).collect::<Result<_>>()?, imu: imu.map(model).transpose()? })
    }

    /// The topics that were requested, if any were.
    fn topics(&self, sensor: &Sensor) -> Option<Vec<BagTopic>> {
        let mut topics = Vec::new();
        for choice in &self.messages {
            match choice {
                Some(topic) => topics.push(*topic),
                None => topics.extend(BagTopic::of_sensor(sensor.driver(), sensor.scan_line())),
            }
        }
        (!self.messages.is_empty()).then_some(topics)
    }

    /// Columns that bags of `sensor` need besides those of points.
    pub fn columns(&self, sensor: &Sensor) -> FieldSet {
        let topics = self.topics(sensor);
        BagTopic::columns(&topics.unwrap_or_else(|| BagTopic::of_sensor(sensor.driver(), sensor.scan_line())))
    }

    /// Checks the options for `sensor`; `bags`: whether a bag is written.
    pub fn check(&self, sensor: &Sensor, bags: bool) -> Result<()> {
        let Some(topics) = self.topics(sensor) else { return Ok(()) };
        ensure!(bags, "--messages: there is no bag; allowed: with a cloud file in .mcap");
        for topic in topics {
            let name = topic.name();
            let ring = sensor.scan_line().is_some();
            ensure!(
                ring || !matches!(topic, BagTopic::Scan | BagTopic::Echoes),
                "--messages {name}: the beams of the sensor {} are not in one plane; allowed: LiDARs with a single ring",
                sensor.name()
            );
            ensure!(
                topic != BagTopic::Livox || sensor.kind().is_optical(),
                "--messages {name}: the sensor is a {}; allowed: LiDARs and depth cameras",
                sensor.kind()
            );
        }
        Ok(())
    }

    /// What bags of `sensor` hold, which is on `trajectory` and `carrier`, from `start`, s, on.
    pub fn options(
        &self,
        sensor: &Sensor,
        [trajectory, carrier]: [&Trajectory; 2],
        navigation: Option<&NavigationSolution>,
        seed: u64,
        start: f64,
    ) -> BagOptions {
        let (on, own) = (carrier.at(start), trajectory.at(start));
        let back = on.orientation.conjugate();
        let mount = if trajectory == carrier {
            Pose::IDENTITY
        } else {
            Pose { position: back * (own.position - on.position), orientation: back * own.orientation }
        };
        let topics = self.topics(sensor);
        let moves = topics.iter().flatten().any(|topic| topic.is_of_motion());
        let motion = moves.then(|| BagMotion {
            carrier: Arc::new(carrier.clone()),
            estimate: navigation.map(|solution| Arc::new(solution.carrier.clone())),
            mount,
            imu: self.imu.unwrap_or_default(),
            seed,
            scan_time: sensor.beams().period.max(sensor.scan_time()),
        });
        BagOptions::default().topics(topics).motion(motion)
    }

    /// Adds the keys of a scenario.
    pub fn add_to(&self, keys: &mut Map<String, Value>) {
        if !self.messages.is_empty() {
            let names = self.messages.iter().map(|choice| choice.map_or(DEFAULT, BagTopic::name));
            keys.insert("messages".into(), names.collect());
            keys.insert("imu".into(), json!(self.imu.map(ImuModel::name)));
        }
    }
}
