//! Records the frames of one sensor to files, for both `scan` and `run`.

use crate::interrupt;
use crate::output::{CloudWriter, OutputArgs};
use crate::progress::ProgressLine;
use crate::report::{Seconds, timed};
use anyhow::Result;
use echocast::emitter::NavigationSolution;
use echocast::emitter::pattern::Pattern;
use echocast::radar::{RadarFrame, RadarRecord};
use echocast::scenario::Scan;
use echocast::{
    BoxAxes, BuiltScene, Cause, Enclosure, Field, FieldSet, Ping, Pings, PointCloud, Profile, Report, ScanOptions,
    Sensor, Trajectory, shown,
};
use std::path::PathBuf;

/// Beams that must meet the bottom for a velocity.
const LEAST_LOCKED: usize = 3;

/// What is recorded.
pub struct Take<'t> {
    pub sensor: &'t Sensor,
    pub trajectory: &'t Trajectory,
    /// What it is mounted on, and what processing makes of the flight of that, if it has errors.
    pub carrier: &'t Trajectory,
    pub navigation: Option<&'t NavigationSolution>,
    /// Frames, or the pieces of strips, those of each strip together.
    pub frames: Vec<TakeFrame>,
    /// The scan whose strips these are, if they are.
    pub strips: Option<&'t Scan>,
    /// Options of all frames; `fields` are the columns of files.
    pub options: ScanOptions,
    pub output: &'t OutputArgs,
    /// Instances that seem to be a sky.
    pub skies: Vec<u32>,
}

/// What is scanned at once.
#[derive(Clone, Copy)]
pub struct TakeFrame {
    pub number: u32,
    /// Seconds since the start of the run.
    pub start: f64,
    /// Number of its strip; 0: none.
    pub strip: u16,
    /// Index of the strip in the scan, and of the piece in the strip.
    pub piece: [usize; 2],
}

impl TakeFrame {
    /// A frame that is no part of a strip.
    pub fn new(number: u32, start: f64) -> TakeFrame {
        TakeFrame { number, start, strip: 0, piece: [0; 2] }
    }
}

/// What has been recorded.
pub struct Recorded {
    pub beams: usize,
    /// Rays that were traced for them; for a sonar those that were sent.
    pub rays: u64,
    /// Most rays that a beam was given, least and greatest of all frames.
    pub most_rays: [u32; 2],
    pub points: usize,
    /// Number of points on what seems to be a sky.
    pub sky_points: usize,
    /// Causes of a sonar's points, and how many points each has.
    pub causes: Vec<(&'static str, usize)>,
    pub report: Report,
    pub files: Vec<PathBuf>,
    /// Why the recording is useless, if it is.
    pub nothing: Option<Nothing>,
}

impl Recorded {
    /// Most rays that a beam was given, if that is the same in all frames.
    pub fn one_limit(&self) -> Option<u32> {
        let [least, most] = self.most_rays;
        (least == most).then_some(most)
    }
}

/// Why a recording is useless.
pub enum Nothing {
    /// No beam has a return.
    Seen,
    /// A sonar receives only noise.
    ButNoise,
}

/// The scene as the frame that starts at a time, s, sees it.
pub type Build<'b> = &'b mut dyn FnMut(f64) -> echocast::Result<BuiltScene>;

/// What a frame of `sensor` is called.
pub fn frame_word(sensor: &Sensor) -> &'static str {
    if sensor.kind().makes_pings() { "ping" } else { "frame" }
}

impl Take<'_> {
    /// The options of a frame.
    pub fn options_of(&self, frame: &TakeFrame) -> ScanOptions {
        let shown = self.output.pictured().union(self.output.bagged(self.sensor));
        let fields = self.options.fields.union(shown).union(self.reported());
        let annotates = self.output.annotates();
        let boxes = self.options.boxes.or_else(|| annotates.then(BoxAxes::default));
        self.options
            .clone()
            .fields(fields)
            .frame(frame.number)
            .strip(frame.strip)
            .start_time(frame.start)
            .boxes(boxes)
            .image_boxes(annotates)
    }

    /// Columns for the report, which counts a sonar's points by cause, and those on a sky and in boxes by instance,
    /// whatever the files hold.
    fn reported(&self) -> FieldSet {
        let cause = if self.makes_pings() { FieldSet::EMPTY.with(Field::Cause) } else { FieldSet::EMPTY };
        // Boxes of pings and of radar frames need the times of their points.
        let timed = self.output.boxes().is_some() && (self.makes_pings() || self.radar_record().is_some());
        let cause = if timed { cause.with(Field::Time) } else { cause };
        if self.output.boxes().is_some() || !self.skies.is_empty() { cause.with(Field::InstanceId) } else { cause }
    }

    /// Number of points on what seems to be a sky.
    fn on_sky(&self, cloud: &PointCloud) -> usize {
        let instances = cloud.columns().instance_id();
        if self.skies.is_empty() || instances.is_empty() {
            return 0;
        }
        cloud.return_rows().filter(|&row| self.skies.contains(&instances[row])).count()
    }

    /// Warns if the sensor starts inside of an object, a building or the ground.
    fn warn_of_enclosure(&self, built: &BuiltScene, report: &mut Report) {
        /// Nothing that encloses a sensor by mistake is larger, m; a sky may be.
        const REACH: f64 = 100.0;
        let Some(first) = self.frames.first().filter(|_| !self.makes_pings()) else { return };
        let place = self.trajectory.at(first.start).position;
        let Some(Enclosure { name, part, within_m, .. }) = built.enclosure(place, REACH) else { return };
        let what = if name.is_empty() { "something".to_owned() } else { format!("{:?}", shown::text(&name)) };
        report.warn(format!(
            "the sensor at {:.2},{:.2},{:.2} seems to be inside of {what}: {:.0} % of the directions from the horizon up \
             meet the back of a surface within {within_m:.1} m; choose another place with --at, see echocast info SCENE \
             --preview map.png",
            place.x,
            place.y,
            place.z,
            100.0 * part
        ));
    }

    /// Warns if a Doppler velocity log has no velocity over ground in `lost` pings; `most_locked`: the most beams
    /// that met the bottom in any ping.
    fn warn_of_lost_bottom(&self, lost: usize, most_locked: usize, report: &mut Report) {
        let tracks = matches!(self.sensor.spec().pattern, Pattern::Dvl(_)) && self.options.profile == Profile::Physical;
        if !tracks || lost == 0 {
            return;
        }
        let reach = self.sensor.spec().range.max_m.unwrap_or(f64::INFINITY);
        let met = match most_locked {
            0 => "no beam met the bottom".to_owned(),
            _ => format!("fewer than {LEAST_LOCKED} beams met the bottom"),
        };
        report.warn(format!(
            "{met} within range.max_m, {reach} m, in {lost} of {} pings: they have no velocity over ground; perhaps the sonar \
             is too high, or tilted; --explain BEAM shows what happens to one beam",
            self.frames.len()
        ));
    }

    fn radar_record(&self) -> Option<RadarRecord> {
        self.output.radar_record()
    }

    fn makes_pings(&self) -> bool {
        self.sensor.kind().makes_pings()
    }

    /// Adds boxes to the `cloud` of a ping or radar frame, if they were requested.
    fn add_boxes(&self, built: &BuiltScene, options: &ScanOptions, cloud: &mut PointCloud) -> Result<()> {
        (cloud.boxes, cloud.time_zero) = (None, self.trajectory.time_zero());
        if options.boxes.is_some() {
            cloud.boxes = Some(built.boxes(self.sensor, self.trajectory, options, cloud)?);
        }
        Ok(())
    }

    /// Writes the cloud of the `index`th frame, or adds it to the files of its strip or of all frames; `all` are those that
    /// files still need.
    fn write_frame(
        &self,
        index: usize,
        cloud: &PointCloud,
        all: &mut PointCloud,
        writer: &mut CloudWriter,
    ) -> Result<()> {
        let (frame, single) = (&self.frames[index], self.output.single());
        let in_strips = self.strips.is_some();
        if single && !in_strips {
            return writer.write_frame(frame.number, cloud);
        }
        if self.frames.len() == 1 && !in_strips {
            return Ok(());
        }
        let strip = single.then_some(frame.strip);
        if writer.add(cloud, strip)? {
            all.append(cloud)?;
        }
        let ends = self.frames.get(index + 1).is_none_or(|next| next.strip != frame.strip);
        if let Some(strip) = strip.filter(|_| ends) {
            writer.write_strip(strip, all, cloud)?;
            *all = PointCloud::default();
        }
        Ok(())
    }

    /// What is wrong with scans that have no points, or none but of noise.
    fn nothing(&self, points: usize, causes: &Causes, received: bool) -> Option<Nothing> {
        let with_points = self.output.requests_clouds() || !self.makes_pings();
        let noise = self.makes_pings() && if with_points { causes.only(Cause::FalseAlarm) } else { !received };
        match () {
            () if points == 0 && with_points => Some(Nothing::Seen),
            () if noise => Some(Nothing::ButNoise),
            () => None,
        }
    }

    /// Scans all frames and writes what was requested. `built` is the scene as the first frame sees it; `build`
    /// rebuilds it for each frame if it moves.
    pub fn record(
        &self,
        mut built: BuiltScene,
        mut build: Option<Build>,
        progress: &ProgressLine,
        seconds: &mut Seconds,
    ) -> Result<Recorded> {
        let (sensor, trajectory, output) = (self.sensor, self.trajectory, self.output);
        let mut report = Report::default();
        if let Some(first) = self.frames.first().filter(|_| self.makes_pings()) {
            report.absorb(built.check_water(sensor, trajectory, &self.options_of(first))?);
        }
        self.warn_of_enclosure(&built, &mut report);
        let several = self.frames.len() > 1;
        let in_strips = self.strips.is_some();
        progress.count_frames(self.frames.len(), frame_word(sensor));
        let start = self.frames.first().map_or(0.0, |frame| frame.start);
        let bag = output.bags.options(sensor, [trajectory, self.carrier], self.navigation, self.options.seed, start);
        let mut writer = CloudWriter::new(output, bag)?;
        let mut images = output.begin_images(sensor)?;
        let mut all = PointCloud::default();
        let mut cloud = PointCloud::default();
        let (mut points, mut sky_points, mut causes) = (0, 0, Causes::default());
        let sent = if self.makes_pings() { sensor.ray_count() as u64 } else { 0 };
        let (mut rays, mut most_rays) = (0, [u32::MAX, 0]);
        // Pings of a Doppler velocity log without a velocity, and the most beams that met the bottom in any.
        let (mut lost, mut most_locked) = (0, 0);
        let mut beams = 0;
        // Whether anything but noise is received.
        let mut received = false;
        let mut boxes = Vec::new();
        let mut pings = Pings::default();
        let mut ping = Ping::default();
        let (record, mut radar_frame) = (self.radar_record(), RadarFrame::default());
        let pinged = output.pinged(self.options.fields).filter(|_| self.makes_pings());
        for (index, frame) in self.frames.iter().enumerate() {
            interrupt::check()?;
            let [strip, piece] = frame.piece;
            let of_strip = self.strips.map(|scan| scan.piece(strip, piece)).transpose()?;
            let sensor = of_strip.as_ref().map_or(sensor, |piece| &piece.sensor);
            let options = self.options_of(frame);
            if let Some(build) = &mut build {
                progress.phase("moving".into());
                built = timed(&mut seconds.build, || build(options.start_time))?;
            }
            progress.phase("scanning".into());
            timed(&mut seconds.scan, || -> Result<()> {
                if let Some(record) = record {
                    radar_frame = built.radar_frame(sensor, trajectory, &options, record, &mut cloud)?;
                    return self.add_boxes(&built, &options, &mut cloud);
                }
                // One ping gives both cells and points.
                let Some(kept) = pinged else { return Ok(built.scan_into(sensor, trajectory, &options, &mut cloud)?) };
                let requests_clouds = output.requests_clouds();
                let cells = if requests_clouds { Ping::cloud_fields(options.fields) } else { self.reported() };
                let cells = options.clone().fields(kept.union(cells));
                built.ping_into(sensor, trajectory, &cells, &mut ping)?;
                received |= ping.cells().cause().iter().any(|&cause| cause != Cause::FalseAlarm as u8);
                if requests_clouds {
                    cloud = ping.cloud(&options)?;
                    self.add_boxes(&built, &options, &mut cloud)?;
                }
                pings.push(ping.with(kept))?;
                Ok(())
            })?;
            if record.is_some() {
                progress.phase("writing".into());
                let last = self.frames.last().is_some_and(|last| last.number == frame.number);
                timed(&mut seconds.write, || writer.write_radar(&radar_frame, &cloud, trajectory, last))?;
            }
            if let Some(images) = &mut images {
                progress.phase("writing".into());
                report.absorb(timed(&mut seconds.write, || images.add(&cloud, frame.number, frame.start))?);
            }
            if self.options.boxes.is_none() {
                cloud.boxes = None;
            }
            // Files have the requested columns; the other ones that the picture shows are computed as well.
            cloud.set_fields(self.options.fields)?;
            points += cloud.return_rows().count();
            rays += sent + cloud.rays;
            most_rays = [most_rays[0].min(cloud.most_rays), most_rays[1].max(cloud.most_rays)];
            let locked = if pinged.is_some() { locked(&ping) } else { received_rows(&cloud).count() };
            lost += usize::from(locked < LEAST_LOCKED);
            most_locked = most_locked.max(locked);
            causes.count(&cloud);
            sky_points += self.on_sky(&cloud);
            boxes.extend(cloud.boxes.iter().flatten().copied());
            beams += sensor.beams().len();
            progress.phase("writing".into());
            timed(&mut seconds.write, || self.write_frame(index, &cloud, &mut all, &mut writer))?;
            progress.frame_done();
        }
        progress.phase("writing".into());
        timed(&mut seconds.write, || -> Result<()> {
            writer.write_pings(&pings)?;
            writer.write_boxes(&boxes, built.labels())?;
            writer.files.extend(output.flight.write(self.carrier, self.navigation)?);
            if let Some(images) = images.take() {
                writer.files.extend(images.finish()?);
            }
            match output.single() {
                true => writer.finish(),
                false => writer.write(if several || in_strips { &all } else { &cloud }, &cloud),
            }
        })?;
        report.absorb(writer.report);
        self.warn_of_lost_bottom(lost, most_locked, &mut report);
        let nothing = self.nothing(points, &causes, received);
        let reported = self.makes_pings() && self.options.profile == Profile::Physical;
        let causes = if reported { causes.reported() } else { Vec::new() };
        Ok(Recorded { beams, rays, most_rays, points, sky_points, causes, report, files: writer.files, nothing })
    }
}

/// Rows of a sonar's `cloud` that are more than noise.
fn received_rows(cloud: &PointCloud) -> impl Iterator<Item = usize> {
    cloud.return_rows().filter(|&row| cloud.columns().cause().get(row) != Some(&(Cause::FalseAlarm as u8)))
}

/// Beams of a ping with a sounding that is more than noise.
fn locked(ping: &Ping) -> usize {
    let cause = |cell: u32| ping.cells().cause().get(cell as usize);
    ping.soundings().iter().filter(|sounding| cause(sounding.cell) != Some(&(Cause::FalseAlarm as u8))).count()
}

/// Number of points for each cause.
#[derive(Default)]
struct Causes([usize; Cause::ALL.len()]);

impl Causes {
    /// Adds the points of `cloud`, if it has the column.
    fn count(&mut self, cloud: &PointCloud) {
        let causes = cloud.columns().cause();
        cloud.return_rows().filter_map(|row| causes.get(row)).for_each(|&cause| {
            if let Some(count) = self.0.get_mut(usize::from(cause)) {
                *count += 1;
            }
        });
    }

    /// Whether there are points, all of them with `cause`.
    fn only(&self, cause: Cause) -> bool {
        let all: usize = self.0.iter().sum();
        all > 0 && self.0[cause as usize] == all
    }

    /// Names and counts, the most frequent first.
    fn reported(&self) -> Vec<(&'static str, usize)> {
        let mut reported: Vec<_> =
            Cause::ALL.into_iter().map(Cause::name).zip(self.0).filter(|(_, count)| *count > 0).collect();
        reported.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
        reported
    }
}
