//! The one table of point-cloud columns. Everything that lists columns is generated from it: the cloud, the writers,
//! `--fields`, the help.

use bytemuck::allocation::try_zeroed_vec;
use echocast_memory::tried;
use ground::error::{Error, Result};

/// Element type of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColumnType {
    /// 32-bit IEEE float; NaN marks a miss in organised clouds.
    F32,
    /// 64-bit IEEE float.
    F64,
    /// Unsigned byte.
    U8,
    /// 16-bit unsigned.
    U16,
    /// 32-bit unsigned.
    U32,
}

impl ColumnType {
    /// Bytes of one element.
    pub const fn size(self) -> usize {
        match self {
            ColumnType::U8 => 1,
            ColumnType::U16 => 2,
            ColumnType::F32 | ColumnType::U32 => 4,
            ColumnType::F64 => 8,
        }
    }
}

/// A whole column, borrowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Column<'a> {
    /// See [`ColumnType::F32`].
    F32(&'a [f32]),
    /// See [`ColumnType::F64`].
    F64(&'a [f64]),
    /// See [`ColumnType::U8`].
    U8(&'a [u8]),
    /// See [`ColumnType::U16`].
    U16(&'a [u16]),
    /// See [`ColumnType::U32`].
    U32(&'a [u32]),
}

impl<'a> Column<'a> {
    /// Type of the elements.
    pub fn kind(self) -> ColumnType {
        match self {
            Column::F32(_) => ColumnType::F32,
            Column::F64(_) => ColumnType::F64,
            Column::U8(_) => ColumnType::U8,
            Column::U16(_) => ColumnType::U16,
            Column::U32(_) => ColumnType::U32,
        }
    }

    /// Elements as bytes in the machine's order.
    pub fn bytes(self) -> &'a [u8] {
        match self {
            Column::F32(c) => bytemuck::cast_slice(c),
            Column::F64(c) => bytemuck::cast_slice(c),
            Column::U8(c) => c,
            Column::U16(c) => bytemuck::cast_slice(c),
            Column::U32(c) => bytemuck::cast_slice(c),
        }
    }

    /// Number of elements.
    pub fn len(self) -> usize {
        match self {
            Column::F32(c) => c.len(),
            Column::F64(c) => c.len(),
            Column::U8(c) => c.len(),
            Column::U16(c) => c.len(),
            Column::U32(c) => c.len(),
        }
    }

    /// Whether there are no elements.
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Element `index` as f64 (exact for every column type).
    pub fn get_f64(self, index: usize) -> f64 {
        match self {
            Column::F32(c) => f64::from(c[index]),
            Column::F64(c) => c[index],
            Column::U8(c) => f64::from(c[index]),
            Column::U16(c) => f64::from(c[index]),
            Column::U32(c) => f64::from(c[index]),
        }
    }
}

/// A whole column, borrowed to be filled.
pub enum ColumnMut<'a> {
    /// See [`ColumnType::F32`].
    F32(&'a mut Vec<f32>),
    /// See [`ColumnType::F64`].
    F64(&'a mut Vec<f64>),
    /// See [`ColumnType::U8`].
    U8(&'a mut Vec<u8>),
    /// See [`ColumnType::U16`].
    U16(&'a mut Vec<u16>),
    /// See [`ColumnType::U32`].
    U32(&'a mut Vec<u32>),
}

/// Element types that columns may have.
pub trait Element: Copy + Default + bytemuck::Pod + Send + Sync {
    /// Type of a column with such elements.
    const TYPE: ColumnType;
    /// What a beam without a return holds in an organised cloud.
    const MISS: Self;
    /// These elements as a column, without copying them.
    fn column(slice: &[Self]) -> Column<'_>;
    /// The vector as a column that can be filled.
    fn column_mut(column: &mut Vec<Self>) -> ColumnMut<'_>;
}

macro_rules! element {
    ($($t:ty, $kind:ident, $miss:expr;)*) => {$(
        impl Element for $t {
            const TYPE: ColumnType = ColumnType::$kind;
            const MISS: Self = $miss;
            fn column(slice: &[Self]) -> Column<'_> { Column::$kind(slice) }
            fn column_mut(column: &mut Vec<Self>) -> ColumnMut<'_> { ColumnMut::$kind(column) }
        }
    )*};
}
element! { f32, F32, f32::NAN; f64, F64, f64::NAN; u8, U8, 0; u16, U16, 0; u32, U32, 0; }

/// What the values of a column come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FieldSource {
    /// The beam, whether it has a return or not.
    Beam,
    /// A return: what the instrument measures, and how it came about.
    Return,
    /// The surface that returned it: the truth.
    Surface,
    /// The motion of that surface and of the sensor.
    Motion,
    /// An instrument that measures radial velocities.
    Doppler,
    /// A sonar that measures depths.
    Sounding,
    /// A Doppler velocity log: its velocity over ground.
    BottomTrack,
    /// A Doppler velocity log: its velocity through a layer of water.
    WaterTrack,
    /// A radar: how strong a detection is, how sure, and by which path.
    Radar,
    /// A laser scanner: where in its line a pulse is, and what surveyors know of its echoes.
    Survey,
}

/// One row of the table of columns.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct FieldInfo {
    /// The column it describes.
    pub field: Field,
    /// Name in every format and language.
    pub name: &'static str,
    /// Element type.
    pub kind: ColumnType,
    /// What its values come from; where that is absent, they are NaN, or 0 for integers.
    pub source: FieldSource,
    /// SI unit, `1` for ratios, `dB` and its kin for levels, empty for counts and ids.
    pub unit: &'static str,
    /// Whether it is computed and written by default.
    pub default: bool,
    /// Name of the LAS dimension that carries it; `None`: carried as LAS extra bytes under `name`.
    pub las: Option<&'static str>,
    /// What it holds.
    pub meaning: &'static str,
}

macro_rules! columns {
    ($( $name:ident, $variant:ident, $t:ty, $source:ident, $unit:literal, $default:literal, $las:expr, $meaning:literal; )*) => {
        /// A point-cloud column.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        #[repr(u8)]
        #[non_exhaustive]
        pub enum Field { $( #[doc = $meaning] $variant ),* }

        /// The table of columns, in the order formats write them.
        pub const FIELDS: &[FieldInfo] = &[ $( FieldInfo {
            field: Field::$variant,
            name: stringify!($name),
            kind: <$t as Element>::TYPE,
            source: FieldSource::$source,
            unit: $unit,
            default: $default,
            las: $las,
            meaning: $meaning,
        } ),* ];

        /// The columns of a cloud; one that was not requested is empty.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Columns { $( #[doc(hidden)] pub $name: Vec<$t> ),* }

        impl Columns {
            $(
                #[doc = $meaning]
                pub fn $name(&self) -> &[$t] {
                    &self.$name
                }
            )*

            /// Column `field`; empty when it was not computed.
            pub fn get(&self, field: Field) -> Column<'_> {
                match field { $( Field::$variant => <$t as Element>::column(&self.$name) ),* }
            }

            /// Column `field`, to be filled.
            #[doc(hidden)]
            pub fn get_mut(&mut self, field: Field) -> ColumnMut<'_> {
                match field { $( Field::$variant => <$t as Element>::column_mut(&mut self.$name) ),* }
            }

            /// Makes every column of `fields` `len` long, and the others empty. Contents are kept only where a column
            /// need not grow.
            ///
            /// # Errors
            /// No memory.
            #[doc(hidden)]
            pub fn resize(&mut self, fields: FieldSet, len: usize) -> Result<()> {
                self.make_room(fields, len)?;
                $( if fields.contains(Field::$variant) {
                    self.$name.resize(len, <$t>::default());
                } )*
                Ok(())
            }

            /// Gives every column of `fields` memory for `len` rows and makes the others empty. Contents are kept only
            /// where a column already has the memory.
            ///
            /// # Errors
            /// No memory.
            #[doc(hidden)]
            pub fn make_room(&mut self, fields: FieldSet, len: usize) -> Result<()> {
                $( if !fields.contains(Field::$variant) {
                    self.$name = Vec::new();
                } else if self.$name.capacity() < len {
                    // Fresh zeroed memory costs nothing until it is touched; growing would copy.
                    self.$name = tried(|| try_zeroed_vec(len)).map_err(|()| no_memory(len))?;
                } )*
                Ok(())
            }

            /// Makes the columns of `fields`, which already have the memory, at least `len` long.
            #[doc(hidden)]
            pub fn lengthen(&mut self, fields: FieldSet, len: usize) {
                $( if fields.contains(Field::$variant) && self.$name.len() < len {
                    self.$name.resize(len, <$t>::default());
                } )*
            }

            /// Moves `count` rows from row `from` to row `to`, in every column that exists.
            #[doc(hidden)]
            pub fn move_rows(&mut self, from: usize, to: usize, count: usize) {
                $( if !self.$name.is_empty() { self.$name.copy_within(from..from + count, to) } )*
            }

            /// A copy of the columns of `fields`.
            #[doc(hidden)]
            pub fn with(&self, fields: FieldSet) -> Columns {
                Columns { $( $name: if fields.contains(Field::$variant) { self.$name.clone() } else { Vec::new() } ),* }
            }

            /// Makes room for the rows of `other`.
            ///
            /// # Errors
            /// No memory.
            pub(crate) fn reserve(&mut self, other: &Columns) -> Result<()> {
                $( tried(|| self.$name.try_reserve(other.$name.len())).map_err(|_| no_memory(other.$name.len()))?; )*
                Ok(())
            }

            /// Starts row `row`, in which nothing is known yet.
            #[doc(hidden)]
            pub fn start_row(&mut self, row: usize) {
                $( if let Some(place) = self.$name.get_mut(row) {
                    *place = <$t as Element>::MISS;
                } )*
            }

            /// Appends the rows of `other`, which must hold the same columns.
            #[doc(hidden)]
            pub fn append(&mut self, other: &Columns) {
                $( self.$name.extend_from_slice(&other.$name); )*
            }

            /// Moves row `order[i]` to row `i`, in every column.
            ///
            /// # Errors
            /// No memory; some columns are then in order and some are not.
            pub(crate) fn permute(&mut self, order: &[usize]) -> Result<()> {
                $( self.$name = gathered(&self.$name, order)?; )*
                Ok(())
            }

            /// The rows `rows`, in that order, of every column.
            ///
            /// # Errors
            /// No memory.
            #[doc(hidden)]
            pub fn gather(&self, rows: &[usize]) -> Result<Columns> {
                Ok(Columns { $( $name: gathered(&self.$name, rows)? ),* })
            }

            /// Mutable slices of rows `start..end` of every column that exists.
            #[doc(hidden)]
            pub fn slices(&mut self, start: usize, end: usize) -> Slices<'_> {
                Slices { $( $name: if self.$name.is_empty() { &mut [] } else { &mut self.$name[start..end] } ),* }
            }
        }

        /// Mutable rows of a cloud's columns; a column that was not requested is empty.
        #[derive(Debug, Default)]
        #[non_exhaustive]
        pub struct Slices<'a> { $( #[doc = $meaning] pub $name: &'a mut [$t] ),* }

        impl<'a> Slices<'a> {
            /// The first `count` rows, and the rest.
            #[doc(hidden)]
            pub fn split_at(self, count: usize) -> (Slices<'a>, Slices<'a>) {
                $( let $name = if self.$name.is_empty() { (Default::default(), Default::default()) } else { self.$name.split_at_mut(count) }; )*
                (Slices { $( $name: $name.0 ),* }, Slices { $( $name: $name.1 ),* })
            }

            /// Successive parts of as many rows as `counts` gives.
            #[doc(hidden)]
            pub fn parts(
                self,
                counts: impl ExactSizeIterator<Item = usize>,
            ) -> impl ExactSizeIterator<Item = Slices<'a>> {
                let mut rest = self;
                counts.map(move |count| {
                    let part;
                    (part, rest) = std::mem::take(&mut rest).split_at(count);
                    part
                })
            }

            /// Fills the first `count` rows of the columns that come from `sources`, which are absent.
            #[doc(hidden)]
            pub fn fill_absent(&mut self, sources: &[FieldSource], count: usize) {
                $( if !self.$name.is_empty() && sources.contains(&FieldSource::$source) {
                    self.$name[..count].fill(<$t as Element>::MISS);
                } )*
            }

            /// Whether any of these columns is present.
            #[doc(hidden)]
            pub fn has(&self, fields: &[Field]) -> bool {
                fields.iter().any(|field| match field { $( Field::$variant => !self.$name.is_empty() ),* })
            }

            /// Mutable rows from `start` on, reborrowed.
            #[doc(hidden)]
            pub fn rows_after(&mut self, start: usize) -> Slices<'_> {
                Slices { $( $name: if self.$name.is_empty() { &mut [] } else { &mut self.$name[start..] } ),* }
            }
        }
    };
}

/// The rows `rows` of `column`, which may be empty.
fn gathered<T: Copy>(column: &[T], rows: &[usize]) -> Result<Vec<T>> {
    let mut found = Vec::new();
    if !column.is_empty() {
        tried(|| found.try_reserve_exact(rows.len())).map_err(|_| no_memory(rows.len()))?;
        found.extend(rows.iter().map(|&row| column[row]));
    }
    Ok(found)
}

/// Writes values into those columns of a row that are present; `$columns` are [`Columns`] or [`Slices`].
#[macro_export]
macro_rules! put {
    ($columns:expr, $row:expr, $($column:ident: $value:expr),* $(,)?) => {$(
        if let Some(place) = $columns.$column.get_mut($row) {
            *place = $value;
        }
    )*};
}

columns! {
    // name, variant, type, source, unit, default, LAS dimension, meaning: up to a comma, colon or parenthesis it is, with the
    // unit, the description of an extra dimension in LAS, 31 bytes
    x, X, f32, Return, "m", true, Some("X"), "measured position, relative to the cloud's origin";
    y, Y, f32, Return, "m", true, Some("Y"), "measured position, relative to the cloud's origin";
    z, Z, f32, Return, "m", true, Some("Z"), "measured position, relative to the cloud's origin";
    range, Range, f32, Return, "m", true, None, "measured slant range";
    intensity, Intensity, f32, Return, "1", true, Some("intensity"), "reported intensity: 0..1, or 0..255 for 8-bit encodings; for sonars the echo level in dB";
    category_id, CategoryId, u32, Surface, "", true, None, "semantic class, 0 = unlabelled";
    part_id, PartId, u32, Surface, "", true, None, "part of the object, 0 = unlabelled";
    instance_id, InstanceId, u32, Surface, "", true, None, "individual object, 0 = unlabelled";
    material_id, MaterialId, u32, Surface, "", false, None, "material of the surface, 0 = none";
    return_number, ReturnNumber, u8, Return, "", true, Some("return_number"), "which return of its beam, from 1";
    return_count, ReturnCount, u8, Return, "", true, Some("number_of_returns"), "how many returns the beam has";
    channel, Channel, u16, Beam, "", true, None, "emitter index, the id of the laser; for sonars the beam";
    ring, Ring, u16, Beam, "", true, None, "ring number, as the manufacturer's driver counts: by rising elevation (Velodyne, RoboSense, and unknown manufacturers), from the top (Ouster), by channel (Hesai, Livox); for sonars the beam, not a default column";
    time, Time, f64, Beam, "s", true, Some("gps_time"), "time of the firing since the start of the run";
    frame, Frame, u32, Beam, "", false, None, "frame index";
    beam, Beam, u32, Beam, "", false, None, "index of the beam in its frame: row * columns + column; for side-scan and imaging sonars, whose range bins are points, beam * bins + bin";
    firing, Firing, u32, Beam, "", false, None, "index of the emission event: column of a spinning sensor, ping of a sonar";
    azimuth, Azimuth, f32, Beam, "rad", false, None, "reported azimuth, in the sensor frame, counter-clockwise from x";
    elevation, Elevation, f32, Beam, "rad", false, None, "reported elevation, in the sensor frame, up from the xy plane";
    red, Red, u8, Surface, "", true, Some("red"), "base colour of the surface, sRGB";
    green, Green, u8, Surface, "", true, Some("green"), "base colour of the surface, sRGB";
    blue, Blue, u8, Surface, "", true, Some("blue"), "base colour of the surface, sRGB";
    normal_x, NormalX, f32, Surface, "1", false, None, "unit surface normal, on the sensor's side, in the cloud's frame; NaN where there is no surface";
    normal_y, NormalY, f32, Surface, "1", false, None, "unit surface normal, on the sensor's side, in the cloud's frame; NaN where there is no surface";
    normal_z, NormalZ, f32, Surface, "1", false, None, "unit surface normal, on the sensor's side, in the cloud's frame; NaN where there is no surface";
    cos_incidence, CosIncidence, f32, Surface, "1", false, None, "cosine of incidence angle, 1 = head-on; NaN where there is no surface";
    depth, Depth, f32, Return, "m", false, None, "distance along x, measured, in the sensor frame";
    true_x, TrueX, f32, Surface, "m", false, None, "position without errors, relative to the cloud's origin; for sonars NaN where nothing scatters";
    true_y, TrueY, f32, Surface, "m", false, None, "position without errors, relative to the cloud's origin; for sonars NaN where nothing scatters";
    true_z, TrueZ, f32, Surface, "m", false, None, "position without errors, relative to the cloud's origin; for sonars NaN where nothing scatters";
    true_range, TrueRange, f32, Surface, "m", false, None, "slant range without errors; for sonars and radars NaN where nothing scatters";
    cause, Cause, u8, Return, "", false, None, "why the point is there: 0 surface, 1 seen in a mirror, 2 seen through glass, 3 rain, 4 fog, 5 snow, 6 dust, 7 noise (false alarm), 8 mixed (edge), 9 multipath, 10 sea surface";
    bounces, Bounces, u8, Return, "", false, None, "specular events on the path";
    first_category_id, FirstCategoryId, u32, Surface, "", false, None, "category of the first surface: the mirror or pane that the beam meets, if any";
    first_instance_id, FirstInstanceId, u32, Surface, "", false, None, "instance of the first surface: as for first_category_id";
    velocity_x, VelocityX, f32, Motion, "m/s", false, None, "velocity of the point: of the surface there, in world coordinates; of its image where it is seen in a mirror; for sonars that of the strongest scatterer, NaN where there is none";
    velocity_y, VelocityY, f32, Motion, "m/s", false, None, "velocity of the point: of the surface there, in world coordinates; of its image where it is seen in a mirror; for sonars that of the strongest scatterer, NaN where there is none";
    velocity_z, VelocityZ, f32, Motion, "m/s", false, None, "velocity of the point: of the surface there, in world coordinates; of its image where it is seen in a mirror; for sonars that of the strongest scatterer, NaN where there is none";
    radial_velocity, RadialVelocity, f32, Motion, "m/s", false, None, "rate of the true range: negative where point and sensor approach each other; for sonars and radars that of the strongest scatterer, NaN where there is none";
    flow_x, FlowX, f32, Motion, "m", false, None, "scene flow: position of the surface point one frame later minus its position now, in world coordinates; for sonars that of the strongest scatterer, NaN where there is none";
    flow_y, FlowY, f32, Motion, "m", false, None, "scene flow: position of the surface point one frame later minus its position now, in world coordinates; for sonars that of the strongest scatterer, NaN where there is none";
    flow_z, FlowZ, f32, Motion, "m", false, None, "scene flow: position of the surface point one frame later minus its position now, in world coordinates; for sonars that of the strongest scatterer, NaN where there is none";
    track_id, TrackId, u32, Surface, "", false, None, "object over all frames, 0 = unlabelled";
    doppler, Doppler, f32, Doppler, "m/s", false, None, "measured radial velocity: negative where point and sensor approach each other, NaN where the instrument measures none; for Doppler velocity logs that of the bottom along the beam, for radars folded into what the waveform can tell apart; a default column of sensors that measure it";
    quality, Quality, f32, Sounding, "1", false, None, "confidence in a sounding: 0 to 1, 0.5 for a standard error of the range of 0.25 %; NaN for other points; a default column of swath and single-beam sonars";
    corrected_x, CorrectedX, f32, Sounding, "m", false, None, "ray-traced sounding: position by the refracted ray through the assumed sound-speed profile, relative to the cloud's origin; NaN for other points; a default column of swath and single-beam sonars";
    corrected_y, CorrectedY, f32, Sounding, "m", false, None, "ray-traced sounding: position by the refracted ray through the assumed sound-speed profile, relative to the cloud's origin; NaN for other points; a default column of swath and single-beam sonars";
    corrected_z, CorrectedZ, f32, Sounding, "m", false, None, "ray-traced sounding: position by the refracted ray through the assumed sound-speed profile, relative to the cloud's origin; NaN for other points; a default column of swath and single-beam sonars";
    bottom_track_x, BottomTrackX, f32, BottomTrack, "m/s", false, None, "velocity over ground: of the sonar relative to the bottom, in its own frame, as a Doppler velocity log measures it with the ping; NaN with fewer than three beams that meet the bottom, and for other sensors; a default column of Doppler velocity logs";
    bottom_track_y, BottomTrackY, f32, BottomTrack, "m/s", false, None, "velocity over ground: of the sonar relative to the bottom, in its own frame, as a Doppler velocity log measures it with the ping; NaN with fewer than three beams that meet the bottom, and for other sensors; a default column of Doppler velocity logs";
    bottom_track_z, BottomTrackZ, f32, BottomTrack, "m/s", false, None, "velocity over ground: of the sonar relative to the bottom, in its own frame, as a Doppler velocity log measures it with the ping; NaN with fewer than three beams that meet the bottom, and for other sensors; a default column of Doppler velocity logs";
    bottom_track_error, BottomTrackError, f32, BottomTrack, "m/s", false, None, "ground error velocity: disagreement of the four beams; NaN with three, and for other sensors; a default column of Doppler velocity logs";
    water_track_x, WaterTrackX, f32, WaterTrack, "m/s", false, None, "velocity through water: of the sonar relative to a layer of water, in its own frame, NaN where none is tracked; a default column of logs that track one";
    water_track_y, WaterTrackY, f32, WaterTrack, "m/s", false, None, "velocity through water: of the sonar relative to a layer of water, in its own frame, NaN where none is tracked; a default column of logs that track one";
    water_track_z, WaterTrackZ, f32, WaterTrack, "m/s", false, None, "velocity through water: of the sonar relative to a layer of water, in its own frame, NaN where none is tracked; a default column of logs that track one";
    water_track_error, WaterTrackError, f32, WaterTrack, "m/s", false, None, "water error velocity: disagreement of the four beams, NaN with three or none; a default column of logs that track one";
    rcs, Rcs, f32, Radar, "dBsm", false, None, "radar cross-section, as the radar estimates it from power and range; a default column of radars, NaN for other sensors";
    snr, Snr, f32, Radar, "dB", false, None, "signal-to-noise ratio, in the cell of the detection; a default column of radars, NaN for other sensors";
    power, Power, f32, Radar, "dBm", false, None, "power at the receiver, of the echo at an element of the array; NaN for other sensors";
    path, Path, u8, Radar, "", false, None, "path of the wave: 0 direct, 1 ground, 2 wall, 3 internal (corner), 4 side lobe, 5 alias, 6 interference, 7 noise; a default column of radars, 0 for other sensors";
    true_rcs, TrueRcs, f32, Radar, "dBsm", false, None, "true radar cross-section, of the strongest scatterer; NaN where there is none and for other sensors";
    range_sigma, RangeSigma, f32, Radar, "m", false, None, "standard error of range, as the radar estimates it; NaN for other sensors";
    azimuth_sigma, AzimuthSigma, f32, Radar, "rad", false, None, "standard error of azimuth, as the radar estimates it; NaN for other sensors";
    elevation_sigma, ElevationSigma, f32, Radar, "rad", false, None, "std. error of elevation, as the radar estimates it; NaN where it measures none and for other sensors";
    velocity_sigma, VelocitySigma, f32, Radar, "m/s", false, None, "standard error of doppler, as the radar estimates it; NaN for other sensors";
    scan_angle, ScanAngle, f32, Survey, "rad", false, Some("scan_angle"), "scan angle: from straight down to the right of the heading, across it, roll of the platform included; a default column of line scanners that fly or drive, NaN for sonars and radars";
    scan_direction, ScanDirection, u8, Survey, "", false, Some("scan_direction_flag"), "direction of the scan: 1 while the mechanism of a line scanner sweeps to the right, otherwise 0; a default column of line scanners that fly or drive";
    edge_of_line, EdgeOfLine, u8, Survey, "", false, Some("edge_of_flight_line"), "edge of the flight line: 1 for the last point of a line of a line scanner, otherwise 0; a default column of line scanners that fly or drive";
    strip, Strip, u16, Survey, "", false, Some("point_source_id"), "strip: number of the flight line or station, 0 = none; a default column of line scanners";
    reflectance_db, ReflectanceDb, f32, Survey, "dB", false, None, "reflectance: power against that of a white Lambertian plate at the same range, head-on; a default column of line scanners, NaN for cameras, sonars and radars";
    amplitude_db, AmplitudeDb, f32, Survey, "dB", false, None, "amplitude: power over the least that is detected; a default column of line scanners, NaN for instruments without a threshold";
    pulse_width, PulseWidth, f32, Survey, "s", false, None, "width of the echo: full width at half maximum; a default column of line scanners, NaN without a pulse";
    deviation, Deviation, f32, Survey, "1", false, None, "pulse shape deviation: area between the echo and the emitted pulse of the same height, over the area of that; 0 for a single flat target; a default column of line scanners, NaN for sonars and radars";
}

impl Field {
    /// Its row of the table.
    pub fn info(self) -> &'static FieldInfo {
        &FIELDS[self as usize]
    }

    /// The column called `name`.
    ///
    /// # Errors
    /// [`Error::Missing`] with similar names.
    pub fn from_name(name: &str) -> Result<Field> {
        FIELDS
            .iter()
            .find(|info| info.name == name)
            .map(|info| info.field)
            .ok_or_else(|| Error::missing("column", name, FIELDS.iter().map(|info| info.name)))
    }
}

/// The columns that `velocity` stands for.
pub const VELOCITY: [Field; 3] = [Field::VelocityX, Field::VelocityY, Field::VelocityZ];

/// The columns that `flow` stands for.
pub const FLOW: [Field; 3] = [Field::FlowX, Field::FlowY, Field::FlowZ];

/// A set of columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct FieldSet(u128);

impl FieldSet {
    /// No column.
    pub const EMPTY: FieldSet = FieldSet(0);

    /// Every column.
    pub fn all() -> Self {
        FIELDS.iter().map(|info| info.field).collect()
    }

    /// Reads `"x,y,z,range"`, `"all"` or `"default"`; names may be mixed: `"default,normal_x"`. `velocity` and `flow`
    /// stand for their three columns each.
    ///
    /// # Errors
    /// [`Error::Missing`] for an unknown name, [`Error::InvalidParameter`] for an empty list.
    pub fn parse(list: &str) -> Result<Self> {
        FieldSet::parse_with(list, FieldSet::default())
    }

    /// [`FieldSet::parse`] where `"default"` stands for `default`, such as `Sensor::default_fields`.
    ///
    /// # Errors
    /// As [`FieldSet::parse`].
    pub fn parse_with(list: &str, default: FieldSet) -> Result<Self> {
        let mut set = FieldSet::EMPTY;
        for name in list.split(',').map(str::trim).filter(|name| !name.is_empty()) {
            set = match name {
                "all" => FieldSet::all(),
                "default" => set.union(default),
                "velocity" => set.union(VELOCITY.into_iter().collect()),
                "flow" => set.union(FLOW.into_iter().collect()),
                _ => set.with(Field::from_name(name)?),
            };
        }
        if set == FieldSet::EMPTY {
            return Err(Error::invalid(
                "fields",
                format!("{list:?}"),
                "column names separated by commas, \"default\" or \"all\"",
            ));
        }
        Ok(set)
    }

    /// The columns whose values come from `source`.
    #[doc(hidden)]
    pub fn from_source(source: FieldSource) -> FieldSet {
        FIELDS.iter().filter(|info| info.source == source).map(|info| info.field).collect()
    }

    /// Whether any column depends on motion.
    #[doc(hidden)]
    pub fn has_motion(self) -> bool {
        self.iter().any(|info| matches!(info.source, FieldSource::Motion | FieldSource::Doppler))
    }

    /// This set and `field`.
    #[must_use]
    pub const fn with(self, field: Field) -> Self {
        FieldSet(self.0 | 1 << field as u8)
    }

    /// This set without `field`.
    #[must_use]
    pub const fn without(self, field: Field) -> Self {
        FieldSet(self.0 & !(1 << field as u8))
    }

    /// Columns of either set.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        FieldSet(self.0 | other.0)
    }

    /// Whether `field` is in it.
    pub const fn contains(self, field: Field) -> bool {
        self.0 & (1 << field as u8) != 0
    }

    /// Whether any of `fields` is in it.
    pub fn contains_any(self, fields: &[Field]) -> bool {
        fields.iter().any(|&field| self.contains(field))
    }

    /// Its columns in table order.
    pub fn iter(self) -> impl Iterator<Item = &'static FieldInfo> {
        FIELDS.iter().filter(move |info| self.contains(info.field))
    }
}

impl Default for FieldSet {
    /// The columns written by default; `Sensor::default_fields` are those of a sensor.
    fn default() -> Self {
        FIELDS.iter().filter(|info| info.default).map(|info| info.field).collect()
    }
}

impl FromIterator<Field> for FieldSet {
    fn from_iter<I: IntoIterator<Item = Field>>(fields: I) -> Self {
        fields.into_iter().fold(FieldSet::EMPTY, FieldSet::with)
    }
}

fn no_memory(rows: usize) -> Error {
    Error::Memory(format!("{rows} rows of points"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_rows_are_at_their_field() {
        assert!(FIELDS.len() <= 128, "FieldSet holds 128 columns");
        for (row, info) in FIELDS.iter().enumerate() {
            assert_eq!(info.field as usize, row);
            assert_eq!(Field::from_name(info.name).unwrap(), info.field);
        }
    }

    #[test]
    fn lists_are_parsed() {
        assert_eq!(FieldSet::parse("all").unwrap().iter().count(), FIELDS.len());
        let set = FieldSet::parse(" x, normal_z").unwrap();
        assert!(set.contains(Field::X) && set.contains(Field::NormalZ) && !set.contains(Field::Y));
        assert!(FieldSet::parse("x,rnage").unwrap_err().to_string().contains("range"));
        assert!(FieldSet::parse(",").is_err());
        assert!(!FieldSet::default().contains(Field::Beam));
    }

    #[test]
    fn rows_move_split_and_permute() {
        let mut columns = Columns::default();
        columns.resize(FieldSet::EMPTY.with(Field::Range).with(Field::Beam), 4).unwrap();
        assert!(columns.x.is_empty());
        let (first, second) = columns.slices(0, 4).split_at(2);
        first.range.copy_from_slice(&[1.0, 2.0]);
        second.beam.copy_from_slice(&[7, 8]);
        columns.move_rows(2, 1, 2);
        assert_eq!(columns.beam, [0, 7, 8, 8]);
        columns.permute(&[2, 1]).unwrap();
        assert_eq!(columns.beam, [8, 7]);
    }
}
