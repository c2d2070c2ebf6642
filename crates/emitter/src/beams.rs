//! The beams of one scan, direction by direction: what every pattern compiles to.

use echocast_memory::tried;
use glam::{DVec3, Vec3};
use ground::builder;
use ground::error::{Error, Result};

/// How beams share firings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum FiringOrder {
    /// All beams of a column belong to one firing (spinning sensors).
    Columns,
    /// Every beam is a firing of its own (raster, table).
    #[default]
    Beams,
    /// The whole frame is one exposure (pinhole).
    Frame,
}

/// Most beams of one scan; fewer for fuzzers, which would spend their time on computing beams.
pub(crate) const MAX_BEAMS: u64 = if cfg!(fuzzing) { 1_000_000 } else { 64_000_000 };

/// Greatest distance of the origin of a beam from the sensor, m: farther away, single precision is worse than
/// decimetres.
pub(crate) const FARTHEST_ORIGIN_M: f64 = 1e6;

/// The beams of one scan in beam order, one column per quantity; directions are unit vectors in the sensor frame (x
/// forward, y left, z up).
///
/// Beam `row * columns + column`; neighbours in a row are neighbours in angle, so that packets are
/// coherent.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct BeamTable {
    /// Rows of the range image: channels of a spinning sensor, pixel rows of a camera.
    pub rows: u32,
    /// Columns of the range image.
    pub columns: u32,
    /// x of the direction.
    pub dir_x: Vec<f32>,
    /// y of the direction.
    pub dir_y: Vec<f32>,
    /// z of the direction.
    pub dir_z: Vec<f32>,
    /// Time of the firing since the start of the scan, s.
    pub time: Vec<f64>,
    /// Emitter index.
    pub channel: Vec<u16>,
    /// Nearest range that is reported, m, beam by beam; empty: the sensor's for all.
    pub range_min: Vec<f32>,
    /// Farthest range that is reported, m, beam by beam; empty: the sensor's for all.
    pub range_max: Vec<f32>,
    /// x, y and z of the origin of the beam, m in the sensor frame, from which its ranges count; all empty: every beam
    /// starts at the origin of the frame.
    pub origin: [Vec<f32>; 3],
    /// How beams share firings.
    pub firing_order: FiringOrder,
    /// Time from the start of one scan to the start of the next, s.
    pub period: f64,
}

builder! {
    /// Rays of your own for `Sensor::from_rays`: columns with an element for each ray. Neighbours in order
    /// should be neighbours in angle: this is several times as fast. The default: no rays, 10 scans per second.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct RayColumns<'a> {
        /// Their origins, m in the sensor frame, from which their ranges count; empty: all at the origin of the frame.
        pub origin: &'a [[f32; 3]] = &[],
        /// Their directions in the sensor frame (x forward, y left, z up): unit vectors.
        pub direction: &'a [[f32; 3]] = &[],
        /// When they fire, s since the start of the scan; empty: all at its start.
        pub time: &'a [f64] = &[],
        /// Emitter indices; empty: all 0.
        pub channel: &'a [u16] = &[],
        /// Time from the start of one scan to the start of the next, s.
        pub period: f64 = 0.1,
    }
}

impl BeamTable {
    /// One row of beams, each of them a firing of its own.
    ///
    /// # Errors
    /// A column that is neither empty nor as long as `direction`, the errors of [`BeamTable::check`], out of memory.
    pub fn from_rays(rays: &RayColumns) -> Result<BeamTable> {
        let count = rays.direction.len();
        let lengths = [("origin", rays.origin.len()), ("time", rays.time.len()), ("channel", rays.channel.len())];
        if let Some((name, length)) = lengths.into_iter().find(|&(_, length)| length != 0 && length != count) {
            return Err(Error::invalid(name, format!("{length} rays long"), format!("{count} rays, or none")));
        }
        let mut table = BeamTable::with_size(1, count, FiringOrder::Beams, rays.period)?;
        for (ray, direction) in rays.direction.iter().enumerate() {
            let time = rays.time.get(ray).copied().unwrap_or(0.0);
            table.push(direction.map(f64::from), time, rays.channel.get(ray).copied().unwrap_or(0));
        }
        for (axis, column) in table.origin.iter_mut().enumerate() {
            *column = room(rays.origin.len())?;
            column.extend(rays.origin.iter().map(|origin| origin[axis]));
        }
        table.check()?;
        Ok(table)
    }

    /// An empty table of `rows` x `columns` beams, with room for them.
    ///
    /// # Errors
    /// Out of memory.
    #[doc(hidden)]
    pub fn with_size(rows: usize, columns: usize, firing_order: FiringOrder, period: f64) -> Result<BeamTable> {
        let beams = rows * columns;
        Ok(BeamTable {
            rows: rows as u32,
            columns: columns as u32,
            dir_x: room(beams)?,
            dir_y: room(beams)?,
            dir_z: room(beams)?,
            time: room(beams)?,
            channel: room(beams)?,
            range_min: Vec::new(),
            range_max: Vec::new(),
            origin: Default::default(),
            firing_order,
            period,
        })
    }

    /// Removes the beams, but keeps what they have in common.
    #[doc(hidden)]
    pub fn clear(&mut self) {
        let BeamTable { dir_x, dir_y, dir_z, time, channel, range_min, range_max, origin, .. } = self;
        [dir_x, dir_y, dir_z, range_min, range_max].into_iter().chain(origin).for_each(Vec::clear);
        time.clear();
        channel.clear();
    }

    /// Adds a beam: unit direction, time in s, channel.
    #[doc(hidden)]
    pub fn push(&mut self, [x, y, z]: [f64; 3], time: f64, channel: u16) {
        self.dir_x.push(x as f32);
        self.dir_y.push(y as f32);
        self.dir_z.push(z as f32);
        self.time.push(time);
        self.channel.push(channel);
    }

    /// Normalises the directions as well as f32 can, because ranges count in them; those that are unit vectors already
    /// are left alone.
    #[doc(hidden)]
    pub fn normalize(&mut self) {
        for ((x, y), z) in self.dir_x.iter_mut().zip(&mut self.dir_y).zip(&mut self.dir_z) {
            let direction = DVec3::new((*x).into(), (*y).into(), (*z).into());
            if (direction.length() - 1.0).abs() > 2e-7 {
                (*x, *y, *z) = direction.normalize().as_vec3().into();
            }
        }
    }

    /// Direction of beam `beam`.
    #[doc(hidden)]
    pub fn direction(&self, beam: usize) -> Vec3 {
        Vec3::new(self.dir_x[beam], self.dir_y[beam], self.dir_z[beam])
    }

    /// Directions of beams `first .. first + count`, by axis.
    #[doc(hidden)]
    pub fn directions(&self, first: usize, count: usize) -> [&[f32]; 3] {
        [&self.dir_x, &self.dir_y, &self.dir_z].map(|axis| &axis[first..first + count])
    }

    /// Whether beams have origins other than that of the sensor frame.
    #[doc(hidden)]
    pub fn has_origins(&self) -> bool {
        !self.origin[0].is_empty()
    }

    /// Origin of beam `beam`, m in the sensor frame.
    #[doc(hidden)]
    pub fn origin(&self, beam: usize) -> Vec3 {
        if self.has_origins() { Vec3::from(self.origin.each_ref().map(|axis| axis[beam])) } else { Vec3::ZERO }
    }

    /// Time of the last firing since the start of the scan, s.
    pub fn last_time(&self) -> f64 {
        let later = |a: f64, b: f64| if b > a { b } else { a };
        // Side by side: every scan begins with this, and one after the other it takes a nanosecond a beam.
        let (rows, rest) = self.time.as_chunks::<16>();
        let mut last = [0.0; 16];
        for row in rows {
            for (last, &time) in last.iter_mut().zip(row) {
                *last = later(*last, time);
            }
        }
        last.into_iter().chain(rest.iter().copied()).fold(0.0, later)
    }

    /// Number of beams.
    pub fn len(&self) -> usize {
        self.dir_x.len()
    }

    /// Whether there are no beams.
    pub fn is_empty(&self) -> bool {
        self.dir_x.is_empty()
    }

    /// Whether neighbours in beam order are neighbours in angle: rays are then traced in coherent packets.
    #[doc(hidden)]
    pub fn is_coherent(&self) -> bool {
        /// A packet of 16 beams 1 degree apart still gains from being traced together.
        const WIDEST_PACKET: usize = 16;
        const COS_LIMIT: f32 = 0.94;
        /// One packet in this many is checked.
        const STRIDE: usize = 61 * WIDEST_PACKET;
        let dot = |a: usize, b: usize| {
            self.dir_x[a] * self.dir_x[b] + self.dir_y[a] * self.dir_y[b] + self.dir_z[a] * self.dir_z[b]
        };
        let (mut seen, mut close) = (0, 0);
        for first in (0..self.len()).step_by(STRIDE) {
            let last = (first + WIDEST_PACKET).min(self.len());
            seen += 1;
            close += usize::from((first..last).all(|beam| dot(first, beam) > COS_LIMIT));
        }
        2 * close > seen
    }

    /// Firing that beam `beam` belongs to.
    pub fn firing(&self, beam: u32) -> u32 {
        match self.firing_order {
            FiringOrder::Columns => beam % self.columns.max(1),
            FiringOrder::Beams => beam,
            FiringOrder::Frame => 0,
        }
    }

    /// Checks that the table can be scanned: columns of equal length, unit directions (to 1e-4), finite times, ranges
    /// at least 0 with the nearest below the farthest, origins within 1000 km, a period above 0.
    ///
    /// # Errors
    /// Names the column and the beam that is wrong, and what is allowed.
    pub fn check(&self) -> Result<()> {
        let beams = u64::from(self.rows) * u64::from(self.columns);
        if beams == 0 || beams > MAX_BEAMS {
            return Err(Error::invalid(
                "rows x columns",
                format!("{} x {}", self.rows, self.columns),
                format!("1 to {MAX_BEAMS} beams"),
            ));
        }
        let lengths = [
            ("dir_x", self.dir_x.len(), false),
            ("dir_y", self.dir_y.len(), false),
            ("dir_z", self.dir_z.len(), false),
            ("time", self.time.len(), false),
            ("channel", self.channel.len(), false),
            ("range_min", self.range_min.len(), true),
            ("range_max", self.range_max.len(), true),
        ];
        for (name, length, optional) in lengths {
            if length as u64 != beams && !(optional && length == 0) {
                let allowed = if optional { format!("{beams} beams, or none") } else { format!("{beams} beams") };
                return Err(Error::invalid(name, format!("{length} beams long"), allowed));
            }
        }
        let [x, y, z] = self.origin.each_ref().map(Vec::len);
        if [x, y, z] != [0; 3] && [x, y, z].map(|length| length as u64) != [beams; 3] {
            let found = format!("{x}, {y} and {z} beams long");
            return Err(Error::invalid("origin", found, format!("{beams} beams on each axis, or none")));
        }
        for beam in 0..self.len() {
            let [x, y, z] = [self.dir_x[beam], self.dir_y[beam], self.dir_z[beam]];
            let length = (x * x + y * y + z * z).sqrt();
            if !(0.9999..=1.0001).contains(&length) {
                return Err(Error::invalid(
                    format!("direction of beam {beam}"),
                    format!("({x}, {y}, {z}), of length {length}"),
                    "unit vectors",
                ));
            }
            if !self.time[beam].is_finite() {
                return Err(Error::invalid(format!("time of beam {beam}"), self.time[beam], "finite numbers"));
            }
            let origin = self.origin(beam);
            if !origin.to_array().iter().all(|x| x.abs() <= FARTHEST_ORIGIN_M as f32) {
                return Err(Error::invalid(
                    format!("origin of beam {beam}"),
                    format!("({}, {}, {}) m", origin.x, origin.y, origin.z),
                    format!("-{FARTHEST_ORIGIN_M} to {FARTHEST_ORIGIN_M} m"),
                ));
            }
            let near = self.range_min.get(beam).copied().unwrap_or(0.0);
            let far = self.range_max.get(beam).copied().unwrap_or(f32::INFINITY);
            if !(0.0 <= near && near < far) {
                return Err(Error::invalid(
                    format!("ranges of beam {beam}"),
                    format!("{near} to {far} m"),
                    "0 or more, the nearest below the farthest",
                ));
            }
        }
        if !(self.period > 0.0 && self.period.is_finite()) {
            return Err(Error::invalid("period", self.period, "finite numbers above 0"));
        }
        Ok(())
    }
}

fn room<T>(beams: usize) -> Result<Vec<T>> {
    let mut column = Vec::new();
    tried(|| column.try_reserve_exact(beams)).map_err(|_| Error::Memory(format!("{beams} beams")))?;
    Ok(column)
}

/// Unit vector in the sensor frame from an azimuth, degrees, and the sine and cosine of the elevation, which a row of
/// beams shares.
pub fn direction(azimuth_deg: f64, (sin_el, cos_el): (f64, f64)) -> [f64; 3] {
    let (sin_az, cos_az) = azimuth_deg.to_radians().sin_cos();
    [cos_el * cos_az, cos_el * sin_az, sin_el]
}
