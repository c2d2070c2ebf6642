//! KMALL: soundings and water columns of swath sonars, in the form that programs for Kongsberg's multibeam sonars read.
//!
//! Layout, names and units of members are those that pykmall 1.1.1 reads, which takes them from Kongsberg's description
//! of the format: version 1 of `#SKM`, 3 of `#MRZ` and 2 of `#MWC`. Members that are not set here are 0. The reference
//! point of the vessel is the sonar.

use super::survey::{is_lost, record_length};
use crate::cells::{Layout, Sounding};
use crate::{Ping, Pings};
use bytemuck::NoUninit;
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::report::Report;
use ground::write::Sink;
use std::io::{self, Write as _};
use std::path::Path;

/// Metres of a degree of latitude and longitude at 0 N 0 E on the ellipsoid of WGS 84: `pi / 180` times `a (1 - e^2)`
/// and `a`. Degrees have the same length everywhere in the file, so that they can be converted back to metres.
const DEGREE: [f64; 2] = [110_574.275_821, 111_319.490_793];
/// Steps of samples per decibel.
const STEPS_PER_DB: f32 = 2.0;
/// The least and the greatest sample.
const STEPS: [f32; 2] = [i8::MIN as f32, i8::MAX as f32];
/// Installation settings, one per line in the order in which readers expect them: one transmitter, one receiver and
/// sensors at the reference point, not rotated. Readers treat the first letter as a member of its own.
const INSTALLATION: &str = "OSCV:Empty,EMXV:echocast,\nPU_0,\nSN=0,\nIP=0.0.0.0:0x00000000,\nUDP=0,\nTYPE=echocast,\n\
    VERSIONS:,\nVERSIONS-END,\nSERIALno:,\nSERIALno-END,\nDCL:0,\nKMALL:Rev I,\nSYSTEM:Single Tx single Rx,\n\
    EMXI:SWLZ=0.000,\n\
    TRAI_TX1:N=0;X=0.000;Y=0.000;Z=0.000;R=0.000;P=0.000;H=0.000;S=1.0,\n\
    TRAI_RX1:N=0;X=0.000;Y=0.000;Z=0.000;R=0.000;P=0.000;H=0.000;S=1.0,\n\
    POSI_1:X=0.000;Y=0.000;Z=0.000;D=0.000;U=ACTIVE,\n\
    ATTI_1:X=0.000;Y=0.000;Z=0.000;R=0.000;P=0.000;H=0.000;D=0.000;U=ACTIVE,\n";

/// Checks that the datagrams can represent the numbers of beams and bins and the positions.
pub(super) fn check(pings: &Pings, layout: &Layout) -> Result<()> {
    for (name, count) in [("beams", layout.beams()), ("bins", layout.bins)] {
        if count > u16::MAX.into() {
            return Err(Error::invalid(format!("kmall: number of {name}"), count, format!("1 to {}", u16::MAX)));
        }
    }
    let reach = [180.0 * DEGREE[1], 90.0 * DEGREE[0]];
    for (index, ping) in pings.pings.iter().enumerate() {
        let [x, y, _] = ping.pose.position.to_array();
        if x.abs() > reach[0] || y.abs() > reach[1] {
            let allowed = format!("x within {:.0} m and y within {:.0} m of 0, which are degrees", reach[0], reach[1]);
            return Err(Error::invalid(format!("kmall: position of ping {index}"), format!("{x}, {y}"), allowed));
        }
    }
    Ok(())
}

/// Writes `pings`, of a swath sonar, to the file at `path`: pose, soundings and water column of each.
pub(super) fn write(pings: &Pings, path: &Path, report: &mut Report) -> io::Result<()> {
    let mut file = Sink::create(path)?;
    let offset = gain_offset(pings);
    let mut bytes = Vec::new();
    let mut clamped = false;
    for (index, ping) in pings.pings.iter().enumerate() {
        bytes.clear();
        if index == 0 {
            installation(&mut bytes, ping)?;
        }
        let place = ShipPose::of(ping);
        attitude(&mut bytes, ping, &place)?;
        soundings(&mut bytes, ping, &place, pings.interval(index))?;
        clamped |= water_column(&mut bytes, ping, &place, offset)?;
        file.write_all(&bytes)?;
    }
    if clamped {
        let [least, most] = STEPS.map(|steps| steps / STEPS_PER_DB - f32::from(offset));
        report.warn(format!("kmall: levels that are not from {least} to {most} dB re 1 uPa clamped"));
    }
    file.finish()
}

/// The gain in whole decibels, `TVGoffset_dB`, with which the cell of the highest level is among the greatest samples.
fn gain_offset(pings: &Pings) -> i8 {
    let levels = pings.pings.iter().flat_map(|ping| &ping.cells.intensity);
    let strongest = levels.copied().filter(|level| level.is_finite()).reduce(f32::max).unwrap_or(0.0);
    (STEPS[1] / STEPS_PER_DB - strongest).floor() as i8
}

/// Where a ping was sent from, in a ship's terms.
struct ShipPose {
    latitude: f64,
    longitude: f64,
    /// Height over 0, m.
    z: f64,
    /// Below the water surface, m.
    depth: f64,
    /// Heading, pitch and roll, degrees.
    angles: [f32; 3],
    /// Rotation from the world to ahead, to port and up.
    level: DQuat,
}

impl ShipPose {
    fn of(ping: &Ping) -> ShipPose {
        let [x, y, z] = ping.pose.position.to_array();
        let angles = ping.pose.ship_angles();
        ShipPose {
            latitude: y / DEGREE[0],
            longitude: x / DEGREE[1],
            z,
            depth: ping.layout.surface_z - z,
            angles: angles.map(|angle| angle as f32),
            level: DQuat::from_rotation_z((angles[0] - 90.0).to_radians()),
        }
    }
}

/// Angle of a direction ahead, to port and up, degrees from straight down to port: the sense of rotation about x with
/// axes ahead, to starboard and down.
fn to_port(direction: DVec3) -> f32 {
    direction.y.atan2(-direction.z).to_degrees() as f32
}

/// A datagram that is being written after others.
struct Datagram<'b> {
    bytes: &'b mut Vec<u8>,
    start: usize,
}

impl Datagram<'_> {
    /// Starts a datagram with its header (`EMdgmHeader`); the length is filled in last.
    fn begin<'b>(bytes: &'b mut Vec<u8>, kind: [u8; 4], version: u8, ping: &Ping) -> Datagram<'b> {
        let start = bytes.len();
        let mut datagram = Datagram { bytes, start };
        datagram.put(&[0u32]);
        datagram.put(&kind);
        datagram.put(&[version, 0]); // systemID
        datagram.put(&[0u16]); // echoSounderID
        datagram.put(&stamp(ping));
        datagram
    }

    /// Starts a datagram of a ping, with `EMdgmMpartition` and `EMdgmMbody`.
    fn of_ping<'b>(bytes: &'b mut Vec<u8>, kind: [u8; 4], version: u8, ping: &Ping) -> Datagram<'b> {
        let mut datagram = Datagram::begin(bytes, kind, version, ping);
        datagram.put(&[1u16, 1]); // numOfDgms, dgmNum
        datagram.put(&[12, ping.number as u16]); // numBytesCmnPart, pingCnt, which restarts after 65535
        datagram.put(&[1u8, 0, 1, 0, 0, 0, 1, 0]); // one fan, swath, transmitter and receiver
        datagram
    }

    fn put<T: NoUninit>(&mut self, values: &[T]) {
        self.bytes.extend_from_slice(bytemuck::cast_slice(values));
    }

    fn zeros(&mut self, count: usize) {
        self.bytes.resize(self.bytes.len() + count, 0);
    }

    /// Completes the datagram with its length at both ends, a multiple of four.
    fn end(mut self) -> io::Result<()> {
        let odd = (self.bytes.len() - self.start) % 4;
        self.zeros((4 - odd) % 4);
        let length = record_length(self.bytes.len() - self.start + 4)?;
        self.put(&[length]);
        self.bytes[self.start..self.start + 4].copy_from_slice(&length.to_le_bytes());
        Ok(())
    }
}

/// Seconds and nanoseconds since the start of 1970, which is the start of the run.
fn stamp(ping: &Ping) -> [u32; 2] {
    let nanoseconds = (ping.time.clamp(0.0, u32::MAX.into()) * 1e9).round() as u64;
    [nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000].map(|part| part as u32)
}

/// `#IIP`: how the sonar is installed.
fn installation(bytes: &mut Vec<u8>, ping: &Ping) -> io::Result<()> {
    let mut datagram = Datagram::begin(bytes, *b"#IIP", 0, ping);
    datagram.put(&[6 + INSTALLATION.len() as u16, 0, 0]); // numBytesCmnPart, info, status
    datagram.put(INSTALLATION.as_bytes());
    datagram.end()
}

/// `#SKM`: position and attitude, one sample.
fn attitude(bytes: &mut Vec<u8>, ping: &Ping, place: &ShipPose) -> io::Result<()> {
    /// Bytes of `EMdgmSKMsample`.
    const SAMPLE: u16 = 132;
    /// Bits of `sensorDataContents`: position, roll and pitch, heading.
    const HELD: u16 = 0b111;
    let mut datagram = Datagram::begin(bytes, *b"#SKM", 1, ping);
    datagram.put(&[12u16]); // numBytesInfoPart
    datagram.put(&[0u8, 1]); // sensorSystem, sensorStatus: active
    datagram.put(&[1, 1, SAMPLE, HELD]); // sensorInputFormat: KM binary; numSamplesArray
    datagram.put(b"#KMB");
    datagram.put(&[SAMPLE, 1]); // version
    datagram.put(&stamp(ping));
    datagram.put(&[u32::from(!HELD & 0x7f)]); // status: what is invalid
    datagram.put(&[place.latitude, place.longitude]);
    let [heading, pitch, roll] = place.angles;
    datagram.put(&[place.z as f32, roll, pitch, heading]);
    datagram.zeros(4 * 17); // heave, rates, velocities, errors, accelerations
    datagram.zeros(12); // KMdelayedHeave
    datagram.end()
}

/// `#MRZ`: a sounding for each beam; for a beam without one, a rejected one.
fn soundings(bytes: &mut Vec<u8>, ping: &Ping, place: &ShipPose, interval: f64) -> io::Result<()> {
    /// Bytes of `EMdgmMRZ_pingInfo`, `txSectorInfo`, `rxInfo` and `sounding`.
    const SIZES: [u16; 4] = [152, 48, 32, 120];
    let layout = &*ping.layout;
    let frequency = layout.frequency as f32;
    let mut of_beams: Vec<Option<&Sounding>> = vec![None; layout.beams()];
    for sounding in &ping.soundings {
        of_beams[sounding.beam as usize] = Some(sounding);
    }
    let valid = of_beams.iter().flatten().count();

    let mut datagram = Datagram::of_ping(bytes, *b"#MRZ", 3, ping);
    datagram.put(&[SIZES[0], 0]);
    datagram.put(&[if interval > 0.0 { (1.0 / interval) as f32 } else { 0.0 }]); // pingRate_Hz
    datagram.zeros(8); // modes
    datagram.put(&[frequency; 3]); // frequencyMode_Hz, freqRangeLowLim_Hz, freqRangeHighLim_Hz
    datagram.zeros(64); // pulse, coverage, settings
    datagram.put(&[1, SIZES[1]]); // numTxSectors
    let speed = layout.believed_speed as f32;
    // headingVessel_deg, soundSpeedAtTxDepth_mPerSec, txTransducerDepth_m, z_waterLevelReRefPoint_m, down
    datagram.put(&[place.angles[0], speed, place.depth as f32, -place.depth as f32]);
    datagram.zeros(12); // x_kmallToall_m, y_kmallToall_m, sensors that are valid
    datagram.put(&[place.latitude, place.longitude]);
    datagram.put(&[place.z as f32]); // ellipsoidHeightReRefPoint_m
    datagram.zeros(8); // corrections, modes

    datagram.zeros(20); // txSectorInfo: numbers, tilt, level, focus
    datagram.put(&[frequency]); // centreFreq_Hz
    datagram.zeros(24);

    datagram.put(&[SIZES[2], layout.beams() as u16, valid as u16, SIZES[3]]);
    datagram.put(&[sample_rate(layout), sample_rate(layout)]); // WCSampleRate, seabedImageSampleRate
    datagram.zeros(16);

    for (beam, sounding) in of_beams.into_iter().enumerate() {
        let axis = layout.axis(beam);
        let across = to_port(place.level * (ping.pose.orientation * axis));
        datagram.put(&[beam as u16]); // soundingIndex
        // txSectorNumb, detectionType: normal or rejected; detectionMethod: amplitude or none
        datagram.put(&if sounding.is_some() { [0u8, 0, 1] } else { [0, 2, 0] });
        datagram.zeros(4);
        let quality = sounding.map_or(0.0, |sounding| sounding.quality);
        datagram.put(&[(100.0 * quality).round() as u8, 0, 0]); // detectionConfidenceLevel, %
        datagram.put(&[100f32]); // rangeFactor, %
        datagram.zeros(20); // uncertainties and lengths
        let range = sounding.map_or(0.0, |sounding| f64::from(sounding.range));
        datagram.put(&[beam as u16, (range / layout.bin_m).round() as u16]); // WCBeamNumb, WCrange_samples
        let level = sounding.map_or(0.0, |sounding| sounding.level_db);
        // WCNomBeamAngleAcross_deg, meanAbsCoeff_dbPerkm, reflectivity1_dB, reflectivity2_dB: without corrections, so
        // that they are the level of the echo.
        datagram.put(&[across, 0.0, level, level]);
        datagram.zeros(16);
        datagram.put(&[to_port(axis), 0.0, (2.0 * range / layout.believed_speed) as f32, 0.0]);
        let from = sounding.map_or(DVec3::ZERO, |sounding| ping.corrected_place(sounding) - ping.pose.position);
        let level = place.level * from;
        // deltaLatitude_deg, deltaLongitude_deg, z, y and x from the reference point: down, to starboard, ahead
        let deltas = [from.y / DEGREE[0], from.x / DEGREE[1], -level.z, -level.y, level.x];
        datagram.put(&deltas.map(|delta| delta as f32));
        datagram.zeros(12); // beamIncAngleAdj_deg, no seabed image
    }
    datagram.end()
}

/// Samples of the water column per second: one for each bin.
fn sample_rate(layout: &Layout) -> f32 {
    (layout.believed_speed / (2.0 * layout.bin_m)) as f32
}

/// `#MWC`: the levels of all bins. Returns whether a level is lost.
fn water_column(bytes: &mut Vec<u8>, ping: &Ping, place: &ShipPose, offset: i8) -> io::Result<bool> {
    let layout = &*ping.layout;
    let mut datagram = Datagram::of_ping(bytes, *b"#MWC", 2, ping);
    // EMdgmMWCtxInfo: one sector, no heave.
    datagram.put(&[12u16, 1, 16, 0]);
    datagram.put(&[0f32]);
    // EMdgmMWCtxSectorData
    datagram.put(&[0.0, layout.frequency as f32, 0.0]);
    datagram.put(&[0u16, 0]);
    // EMdgmMWCrxInfo: bytes of a beam, no phase, no time-varied gain.
    datagram.put(&[16, layout.beams() as u16]);
    datagram.put(&[16u8, 0, 0, offset as u8]);
    datagram.put(&[sample_rate(layout), layout.believed_speed as f32]);
    let mut ranges = vec![0.0; layout.beams()];
    for sounding in &ping.soundings {
        ranges[sounding.beam as usize] = f64::from(sounding.range) / layout.bin_m;
    }
    let mut clamped = false;
    for (beam, range) in ranges.into_iter().enumerate() {
        datagram.put(&[to_port(place.level * (ping.pose.orientation * layout.axis(beam)))]);
        // startRangeSampleNum, detectedRangeInSamples, beamTxSectorNum, numSampleData, and the unrounded range
        datagram.put(&[0, range.round() as u16, 0, layout.bins as u16]);
        datagram.put(&[range as f32]);
        datagram.bytes.extend(ping.levels(beam).iter().map(|level| {
            let steps = (STEPS_PER_DB * (level + f32::from(offset))).round();
            clamped |= is_lost(*level, steps, STEPS, layout);
            (steps as i8).to_le_bytes()[0]
        }));
    }
    datagram.end()?;
    Ok(clamped)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::synthetic::{moved, swath};

    #[test]
    fn datagrams_say_their_length_at_both_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.kmall");
        let mut track = swath(2);
        track.pings[1].soundings.truncate(7);
        assert!(track.write(&path).unwrap().warnings.is_empty());
        let bytes = std::fs::read(&path).unwrap();
        let mut rest = &bytes[..];
        let mut found = Vec::new();
        while let Some(head) = rest.first_chunk() {
            let length = u32::from_le_bytes(*head) as usize;
            assert_eq!(rest[length - 4..length], *head);
            found.push((String::from_utf8_lossy(&rest[5..8]).into_owned(), length));
            rest = &rest[length..];
        }
        // 81 beams of 500 bins; missing soundings take as much.
        let [skm, mrz, mwc] = [
            ("SKM", 20 + 12 + 132 + 4),
            ("MRZ", 36 + 152 + 48 + 32 + 81 * 120 + 4),
            ("MWC", 36 + 12 + 16 + 16 + 81 * (16 + 500) + 4),
        ]
        .map(|(name, length)| (name.to_owned(), length));
        let installation = ("IIP".to_owned(), (26 + INSTALLATION.len()).next_multiple_of(4) + 4);
        assert_eq!(found, [installation, skm.clone(), mrz.clone(), mwc.clone(), skm, mrz, mwc]);
    }

    #[test]
    fn soundings_far_from_the_origin_are_precise() {
        let track = moved(swath(1), DVec3::new(5e5, 5.6e6, 0.0));
        let ping = &track.pings[0];
        let mut bytes = Vec::new();
        soundings(&mut bytes, ping, &ShipPose::of(ping), 0.5).unwrap();
        let double = |at: usize| f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
        let single = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
        // latitude_deg and longitude_deg of the ping, deltaLatitude_deg and deltaLongitude_deg of each sounding.
        let (of_ping, first, size) = (36 + 124, 36 + 152 + 48 + 32, 120);
        for sounding in &ping.soundings {
            let at = first + sounding.beam as usize * size + 88;
            let y = (double(of_ping) + single(at)) * DEGREE[0];
            let x = (double(of_ping + 8) + single(at + 4)) * DEGREE[1];
            let place = ping.corrected_place(sounding);
            assert!((x - place.x).hypot(y - place.y) < 1e-3, "{x} {y} {place}");
        }
        assert!(ping.soundings.len() > 50);
    }

    #[test]
    fn the_strongest_cell_is_among_the_greatest_samples() {
        let folder = tempfile::tempdir().unwrap();
        let mut track = swath(1);
        assert_eq!(gain_offset(&track), -28); // 90.7 dB
        let cells = &mut track.pings[0].cells.intensity;
        cells.fill(50.0);
        (cells[0], cells[1], cells[2]) = (163.7, f32::NEG_INFINITY, f32::NAN);
        assert_eq!(gain_offset(&track), -101);
        let mut bytes = Vec::new();
        let ping = &track.pings[0];
        assert!(water_column(&mut bytes, ping, &ShipPose::of(ping), -101).unwrap());
        let samples = &bytes[36 + 12 + 16 + 16 + 16..];
        assert_eq!(samples[..4].iter().map(|&byte| byte as i8).collect::<Vec<_>>(), [125, -128, 0, -102]);
        let warnings = track.write(folder.path().join("a.kmall")).unwrap().warnings;
        assert_eq!(warnings, ["kmall: levels that are not from 37 to 164.5 dB re 1 uPa clamped"]);
        track.pings[0].cells.intensity.fill(f32::NEG_INFINITY);
        assert_eq!(gain_offset(&track), 63);
    }
}
