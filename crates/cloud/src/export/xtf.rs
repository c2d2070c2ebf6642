//! XTF: the channels of side-scan sonars and the soundings of swath sonars, in the form that survey programs read.
//!
//! Meanings, units and signs are those of `Xtf.h` of the eXtended Triton Format (Triton, 1998). Offsets, the format of
//! samples and the structure of soundings, which came later, are those that pyxtf 1.5.0 reads; the order of samples to
//! port follows from how it arranges them. Members that are not set here are 0.

use super::survey::{is_lost, record_length};
use crate::cells::{Layout, SonarView};
use crate::image::altitudes;
use crate::{Ping, Pings};
use bytemuck::NoUninit;
use ground::error::{Error, Result};
use ground::report::Report;
use ground::write::Sink;
use std::io::{self, Write as _};
use std::path::Path;

/// Maximum number of channels in the header of a file.
const MOST_CHANNELS: usize = 6;
/// Bytes of a file header (`XTFFILEHEADER`), of a channel in it (`CHANINFO`), of a packet's header (`XTFPINGHEADER`),
/// of a channel in it (`XTFPINGCHANHEADER`) and of a sounding (`XTFBEAMXYZA`).
const FILE_HEADER: usize = 1024;
const CHANNEL_INFO: usize = 128;
const PING_HEADER: usize = 256;
const CHANNEL_HEADER: usize = 64;
const SOUNDING: usize = 31;
/// Kinds of packets (`HeaderType`): samples of a side-scan sonar, soundings with their positions.
const SONAR: u8 = 0;
const BATHY_XYZA: u8 = 17;
/// The length of a packet of samples is a multiple of this. A packet of soundings ends after the last one: readers
/// compute their number from its length.
const GRANULE: usize = 64;
/// Steps of samples and amplitudes per decibel re 1 uPa.
const STEPS_PER_DB: f32 = 100.0;
/// The least and the greatest sample.
const STEPS: [f32; 2] = [0.0, u16::MAX as f32];
/// The note in the header, at most 64 bytes.
const NOTE: &[u8] = b"amplitudes: dB re 1 uPa x 100; the run starts on 1970-01-01";

/// Checks that the header has room for the channels.
pub(super) fn check(layout: &Layout) -> Result<()> {
    let beams = layout.beams();
    if layout.view == SonarView::Sidescan && beams > MOST_CHANNELS {
        return Err(Error::invalid("xtf: number of beams", beams, format!("1 to {MOST_CHANNELS}, one channel each")));
    }
    Ok(())
}

/// Writes `pings`, of a side-scan or swath sonar, to the file at `path`.
pub(super) fn write(pings: &Pings, layout: &Layout, path: &Path, report: &mut Report) -> io::Result<()> {
    let mut file = Sink::create(path)?;
    file.write_all(&file_header(layout))?;
    // Without any return of the bed, altitudes stay 0.
    let altitudes = altitudes(pings).unwrap_or_default();
    let mut packet = Vec::new();
    let mut clamped = false;
    for (index, ping) in pings.pings.iter().enumerate() {
        packet.clear();
        packet.resize(PING_HEADER, 0);
        let altitude = altitudes.get(index).copied().unwrap_or(0.0);
        put_ping(&mut packet, ping, altitude);
        if layout.view == SonarView::Sidescan {
            clamped |= add_channels(&mut packet, ping, altitude, pings.interval(index));
            packet.resize(packet.len().next_multiple_of(GRANULE), 0);
        } else {
            add_soundings(&mut packet, ping);
        }
        let length = record_length(packet.len())?;
        put(&mut packet, 10, length); // NumBytesThisRecord
        file.write_all(&packet)?;
    }
    if clamped {
        report.warn("xtf: levels that are not from 0 to 655.35 dB re 1 uPa clamped");
    }
    file.finish()
}

/// Writes `value` at `offset` of a record.
fn put<T: NoUninit>(record: &mut [u8], offset: usize, value: T) {
    record[offset..offset + size_of::<T>()].copy_from_slice(bytemuck::bytes_of(&value));
}

/// Writes as many bytes of `text` as there is `room` for.
fn put_text(record: &mut [u8], offset: usize, room: usize, text: &[u8]) {
    let text = &text[..text.len().min(room)];
    record[offset..offset + text.len()].copy_from_slice(text);
}

/// Whether a beam of a side-scan sonar points to port; otherwise to starboard.
fn is_port(axis: [f32; 2]) -> bool {
    axis[0] > 0.0
}

fn file_header(layout: &Layout) -> Vec<u8> {
    let mut header = vec![0; FILE_HEADER];
    let sides = layout.view == SonarView::Sidescan;
    put(&mut header, 0, 123u8); // FileFormat
    put(&mut header, 1, 1u8); // SystemType
    put_text(&mut header, 2, 8, b"echocast"); // RecordingProgramName
    put_text(&mut header, 10, 8, env!("CARGO_PKG_VERSION").as_bytes());
    put(&mut header, 34, if sides { 44u16 } else { 45 }); // SonarType: some side-scan or multibeam sonar
    put_text(&mut header, 36, 64, NOTE); // NoteString
    // NavUnits stays 0: metres. The numbers of channels: sonar or bathymetry.
    let channels: Vec<[f32; 2]> = if sides { layout.axes.clone() } else { vec![[0.0; 2]] };
    put(&mut header, if sides { 166 } else { 168 }, channels.len() as u16);
    for (info, &axis) in header[256..].chunks_exact_mut(CHANNEL_INFO).zip(&channels) {
        let (kind, name): (u8, &[u8]) = match (sides, is_port(axis)) {
            (false, _) => (3, b"Bathymetry"),
            (true, true) => (1, b"Port"),
            (true, false) => (2, b"Starboard"),
        };
        put(info, 0, kind); // TypeOfChannel
        put_text(info, 12, 16, name); // ChannelName
        put(info, 32, (layout.frequency / 1e3) as f32); // Frequency, kHz
        if sides {
            put(info, 2, 1u16); // CorrectionFlags: slant range
            put(info, 4, 1u16); // UniPolar
            put(info, 6, 2u16); // BytesPerSample
            put(info, 8, layout.bins as u32); // once SamplesPerChannel
            put(info, 40, -axis[1].to_degrees()); // TiltAngle
            put(info, 74, 3u8); // SampleFormat: two bytes, integer
        }
    }
    header
}

/// What samples and soundings of a ping have in common; the length of the packet is not known yet.
fn put_ping(header: &mut [u8], ping: &Ping, altitude: f64) {
    let layout = &*ping.layout;
    let sides = layout.view == SonarView::Sidescan;
    put(header, 0, 0xfaceu16); // MagicNumber
    put(header, 2, if sides { SONAR } else { BATHY_XYZA });
    put(header, 4, if sides { layout.beams() as u16 } else { 1 }); // NumChansToFollow
    let Date { year, month, day, day_of_year, time } = Date::of(ping.time);
    put(header, 14, year);
    put(header, 16, [month, day]);
    put(header, 18, time); // Hour to HSeconds
    put(header, 22, day_of_year); // JulianDay
    put(header, 28, ping.number);
    // Half the speed, for two-way travel; the speed itself is ComputedSoundVelocity.
    put(header, 32, (layout.believed_speed / 2.0) as f32);
    put(header, 72, layout.believed_speed as f32); // ComputedSoundVelocity
    let [heading, pitch, roll] = ping.pose.ship_angles().map(|angle| angle as f32);
    let [x, y, z] = ping.pose.position.to_array();
    // There is no ship other than the sonar: ShipYcoordinate and SensorYcoordinate.
    for coordinates in [128, 160] {
        put(header, coordinates, [y, x]);
    }
    put(header, 124, heading); // ShipGyro
    put(header, 192, [(layout.surface_z - z) as f32, altitude as f32]); // SensorDepth, SensorPrimaryAltitude
    put(header, 204, [pitch, roll, heading]);
    put(header, 224, (ping.time * 1e3).round() as u32); // AttitudeTimeTag, ms
}

/// Adds the samples of each side, starboard from the sonar outwards, port towards it, so that both side by side are a
/// row of a waterfall. Returns whether a level is lost.
fn add_channels(packet: &mut Vec<u8>, ping: &Ping, altitude: f64, interval: f64) -> bool {
    let layout = &*ping.layout;
    let reach = layout.reach();
    let ground = if altitude > 0.0 { (reach * reach - altitude * altitude).max(0.0).sqrt() } else { 0.0 };
    let mut clamped = false;
    for (beam, &axis) in layout.axes.iter().enumerate() {
        let mut header = [0; CHANNEL_HEADER];
        put(&mut header, 0, beam as u16); // ChannelNumber
        put(&mut header, 4, [reach as f32, ground as f32]); // SlantRange, GroundRange
        put(&mut header, 16, [(2.0 * reach / layout.believed_speed) as f32, interval as f32]); // TimeDuration, SecondsPerPing
        put(&mut header, 26, (layout.frequency / 1e3).round() as u16); // Frequency, kHz
        put(&mut header, 42, layout.bins as u32); // NumSamples
        packet.extend(header);
        let levels = ping.levels(beam);
        let mut add = |level: f32| {
            let steps = (STEPS_PER_DB * level).round();
            clamped |= is_lost(level, steps, STEPS, layout);
            packet.extend((steps as u16).to_le_bytes());
        };
        if is_port(axis) {
            levels.iter().rev().copied().for_each(&mut add);
        } else {
            levels.iter().copied().for_each(&mut add);
        }
    }
    clamped
}

/// Adds the positions of all soundings.
fn add_soundings(packet: &mut Vec<u8>, ping: &Ping) {
    let layout = &*ping.layout;
    for sounding in &ping.soundings {
        let at = ping.corrected_place(sounding);
        let offset = at - ping.pose.position;
        let mut record = [0; SOUNDING];
        put(&mut record, 0, [offset.x, offset.y]); // east and north of the sensor
        put(&mut record, 16, (layout.surface_z - at.z) as f32); // depth
        put(&mut record, 20, 2.0 * f64::from(sounding.range) / layout.believed_speed); // two-way
        put(&mut record, 28, (STEPS_PER_DB * sounding.level_db).round() as i16);
        put(&mut record, 30, (255.0 * sounding.quality).round() as u8);
        packet.extend(record);
    }
}

/// A time as in XTF.
#[derive(Debug, PartialEq)]
struct Date {
    year: u16,
    month: u8,
    day: u8,
    /// Days since 1 January.
    day_of_year: u16,
    /// Hours, minutes, seconds and hundredths.
    time: [u8; 4],
}

impl Date {
    /// `time` seconds after the start of 1970, until 2106.
    fn of(time: f64) -> Date {
        const DAY: u64 = 24 * 60 * 60 * 100;
        let hundredths = (time.clamp(0.0, u32::MAX.into()) * 100.0).round() as u64;
        let (mut left, within) = ((hundredths / DAY) as u16, hundredths % DAY);
        let mut year = 1970;
        let leaps =
            |year: u16| u16::from(year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400)));
        while left >= 365 + leaps(year) {
            left -= 365 + leaps(year);
            year += 1;
        }
        let day_of_year = left;
        let mut month = 1;
        for length in [31, 28 + leaps(year), 31, 30, 31, 30, 31, 31, 30, 31, 30] {
            if left < length {
                break;
            }
            left -= length;
            month += 1;
        }
        let time = [within / 360_000, within / 6000 % 60, within / 100 % 60, within % 100].map(|part| part as u8);
        Date { year, month, day: left as u8 + 1, day_of_year, time }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::synthetic::{SyntheticSidescan, moved, pings, swath};
    use glam::DVec3;

    #[test]
    fn port_starts_at_the_farthest_range_and_clamped_levels_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xtf");
        let mut track = pings(&SyntheticSidescan { pings: 2, ..SyntheticSidescan::default() });
        // A null in the noise.
        track.pings[1].cells.intensity[0] = -3.0;
        assert!(track.write(&path).unwrap().warnings.is_empty());
        let cells = &mut track.pings[1].cells.intensity;
        (cells[600], cells[1199]) = (655.4, 98.765);
        let warnings = track.write(&path).unwrap().warnings;
        assert_eq!(warnings, ["xtf: levels that are not from 0 to 655.35 dB re 1 uPa clamped"]);
        let bytes = std::fs::read(&path).unwrap();
        // A header, and twice 64 and 1200 bytes, rounded up to a multiple of 64.
        let length = 2816;
        assert_eq!(bytes.len(), 1024 + 2 * length);
        let packet = &bytes[1024 + length..];
        assert_eq!(packet[..14], [0xce, 0xfa, 0, 0, 2, 0, 0, 0, 0, 0, 0, 11, 0, 0]);
        let sample = |at: usize| u16::from_le_bytes([packet[at], packet[at + 1]]);
        let [port, starboard] = [256 + 64, 256 + 64 + 1200 + 64];
        assert_eq!(sample(port + 1198), 0);
        assert_eq!([sample(starboard), sample(starboard + 1198)], [65535, 9877]);
        assert!(packet[starboard + 1200..].iter().all(|&byte| byte == 0));
    }

    #[test]
    fn soundings_far_from_the_origin_are_precise() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xtf");
        let track = moved(swath(1), DVec3::new(5e5, 5.6e6, 0.0));
        track.write(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let packet = &bytes[FILE_HEADER..];
        let double = |at: usize| f64::from_le_bytes(packet[at..at + 8].try_into().unwrap());
        let ping = &track.pings[0];
        for (index, sounding) in ping.soundings.iter().enumerate() {
            let at = PING_HEADER + index * SOUNDING;
            let place = ping.corrected_place(sounding);
            // ShipYcoordinate comes first.
            let found = [double(136) + double(at), double(128) + double(at + 8)];
            let off = (found[0] - place.x).hypot(found[1] - place.y);
            assert!(off < 1e-3, "{index}: {off}");
        }
        assert!(ping.soundings.len() > 50);
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        let date = |time: f64| Date::of(time);
        let start = Date { year: 1970, month: 1, day: 1, day_of_year: 0, time: [0; 4] };
        assert_eq!(date(-5.0), start);
        assert_eq!(date(86_399.996), Date { day: 2, day_of_year: 1, ..date(0.0) });
        // date -u -d @951782399.25: Monday, 28 February 2000; a day later the 29th.
        let leap = Date { year: 2000, month: 2, day: 28, day_of_year: 58, time: [23, 59, 59, 25] };
        assert_eq!(date(951_782_399.25), leap);
        assert_eq!(date(951_868_799.25), Date { day: 29, day_of_year: 59, ..leap });
        let last = date(1_798_761_599.0);
        assert_eq!((last.year, last.month, last.day, last.day_of_year), (2026, 12, 31, 364));
        assert_eq!(date(f64::NAN).year, 1970);
        assert_eq!(date(1e300).year, 2106);
    }
}
