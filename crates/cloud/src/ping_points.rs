//! From pings to points.

use crate::cells::{Layout, SonarView};
use crate::{CELL_FIELDS, Columns, Field, FieldSet, Frame, Ping, PointCloud, put};
use glam::{DVec3, Vec3};
use ground::angle::direction;
use ground::error::{Error, Result};

/// Whether an azimuth is so far from that of an imaging sonar's beam that several beams are in between.
fn far_aside(layout: &Layout, beam: usize, azimuth: f32) -> bool {
    /// Beams, about as many as receive a single echo.
    const FAR: f32 = 8.0;
    let axis = |beam: usize| layout.axes[beam][0];
    let next = if beam + 1 < layout.beams() { beam + 1 } else { beam.saturating_sub(1) };
    layout.view == SonarView::Fan && (azimuth - axis(beam)).abs() > FAR * (axis(next) - axis(beam)).abs()
}

/// What points of a ping are requested: a part of the options of a scan.
#[derive(Clone, Copy, Debug)]
pub struct PointOptions {
    /// Columns of the cloud.
    pub fields: FieldSet,
    /// The frame of its coordinates.
    pub coordinates: Frame,
    /// Whether every beam or cell has a row.
    pub organised: bool,
    /// Number of the scan.
    pub frame: u32,
    /// Number of the strip.
    pub strip: u16,
}

/// A point of a ping: its cell, and what the sonar reports for it.
struct PingPoint {
    cell: usize,
    beam: usize,
    /// NaN: a miss, in an organised cloud.
    range: f32,
    /// Azimuth and elevation in the sensor's frame, rad.
    aim: [f32; 2],
    /// Quality and corrected position of a sounding; NaN: it is not one.
    quality: f32,
    corrected: Vec3,
}

impl Ping {
    /// The columns of cells that a cloud of `fields` is made from.
    pub fn cloud_fields(fields: FieldSet) -> FieldSet {
        let cells = CELL_FIELDS.into_iter().filter(|&field| fields.contains(field) && field != Field::Time);
        let aim = [Field::Intensity, Field::Azimuth, Field::Elevation, Field::Cause];
        let truth = [Field::TrueX, Field::TrueY, Field::TrueZ, Field::TrueRange];
        let first = [
            (Field::FirstCategoryId, Field::CategoryId),
            (Field::FirstInstanceId, Field::InstanceId),
            (Field::TrackId, Field::InstanceId),
        ];
        let first = first.into_iter().filter(|(first, _)| fields.contains(*first)).map(|(_, of)| of);
        let normals = [Field::NormalX, Field::NormalY, Field::NormalZ];
        let normals = normals.into_iter().filter(|_| fields.contains_any(&normals));
        cells.chain(aim).chain(truth).chain(first).chain(normals).collect()
    }

    /// Its echoes as labelled points, as requested by `options`: for swaths and single beams the sounding of each beam,
    /// along the beam's axis; for side-scan and imaging sonars every cell above the threshold, in the direction in
    /// which the sound of its strongest contributor left, or along the beam's axis where nothing scatters (cause 7) or
    /// the contributor is far beside an imaging sonar's beam, which receives it through its side lobes. Points are at
    /// the range that the sonar reports; where the sound really was is in `true_x` to `true_range`.
    ///
    /// `intensity` is the echo level, dB re 1 uPa; `firing` the number of the ping; `channel` and `ring` the beam;
    /// `beam` the beam for a sounding, and the cell, `beam * bins + bin`, for other points.
    ///
    /// # Errors
    /// A ping without [`Ping::cloud_fields`], or with columns that do not fit its layout; no memory.
    pub fn cloud(&self, options: impl Into<PointOptions>) -> Result<PointCloud> {
        let mut cloud = PointCloud::default();
        self.cloud_into(&options.into(), &mut cloud)?;
        Ok(cloud)
    }

    /// [`Ping::cloud`] into the memory of `cloud`, which is unchanged if the ping is invalid, and empty if there is no
    /// memory.
    #[doc(hidden)]
    pub fn cloud_into(&self, options: &PointOptions, cloud: &mut PointCloud) -> Result<()> {
        let needed = Ping::cloud_fields(options.fields);
        if let Some(missing) = needed.iter().find(|info| !self.fields.contains(info.field)) {
            return Err(Error::invalid("ping", format!("without {}", missing.name), "pings with Ping::cloud_fields"));
        }
        self.check("ping")?;
        let points = self.points(options.organised);
        let fields = options.fields;
        let mut columns = std::mem::take(cloud).columns;
        columns.resize(fields, points.len())?;
        for (row, point) in points.iter().enumerate() {
            self.fill(&mut columns, row, point, options);
        }
        *cloud = PointCloud {
            len: points.len(),
            fields,
            frame: options.coordinates,
            origin: if options.coordinates == Frame::World { self.origin } else { DVec3::ZERO },
            organised: options.organised.then(|| self.shape()),
            sensor_pose: self.pose,
            start_time: Some(self.time),
            intensity_full_scale: None,
            labels: self.labels.clone(),
            columns,
            ..PointCloud::default()
        };
        Ok(())
    }

    /// Rows and columns of an organised cloud.
    fn shape(&self) -> [u32; 2] {
        let beams = self.layout.beams() as u32;
        if self.reports_depths() { [1, beams] } else { [beams, self.layout.bins as u32] }
    }

    fn reports_depths(&self) -> bool {
        self.layout.view.reports_depths()
    }

    fn points(&self, organised: bool) -> Vec<PingPoint> {
        let layout = &*self.layout;
        if self.reports_depths() {
            let none = |beam: usize| PingPoint {
                cell: layout.cell(beam, 0, 0),
                beam,
                range: f32::NAN,
                aim: layout.axes[beam],
                quality: f32::NAN,
                corrected: Vec3::NAN,
            };
            let found = self.soundings.iter().map(|sounding| PingPoint {
                cell: sounding.cell as usize,
                range: sounding.range,
                quality: sounding.quality,
                corrected: sounding.corrected,
                ..none(sounding.beam as usize)
            });
            if !organised {
                return found.collect();
            }
            let mut points: Vec<PingPoint> = (0..layout.beams()).map(none).collect();
            for point in found {
                let beam = point.beam;
                points[beam] = point;
            }
            return points;
        }
        let mut points = Vec::new();
        let cells = &self.cells;
        for beam in 0..layout.beams() {
            for bin in 0..layout.bins {
                let cell = layout.cell(beam, 0, bin);
                let seen = bin >= layout.first_bin && cells.intensity[cell] > layout.threshold_db[bin];
                if !(seen || organised) {
                    continue;
                }
                let (azimuth, elevation) = (cells.azimuth[cell], cells.elevation[cell]);
                let by_sidelobes = azimuth.is_nan() || far_aside(layout, beam, azimuth);
                let aim = if by_sidelobes { layout.axes[beam] } else { [azimuth, elevation] };
                let range = if seen { layout.range(bin) as f32 } else { f32::NAN };
                points.push(PingPoint { cell, beam, range, aim, quality: f32::NAN, corrected: Vec3::NAN });
            }
        }
        points
    }

    /// The velocities of a Doppler velocity log, the same in all rows of its ping.
    fn fill_tracks(&self, columns: &mut Columns, row: usize) {
        let [bottom, water] = [self.bottom_track, self.water_track].map(Option::unwrap_or_default);
        put!(columns, row,
            bottom_track_x: bottom.velocity.x,
            bottom_track_y: bottom.velocity.y,
            bottom_track_z: bottom.velocity.z,
            bottom_track_error: bottom.error,
            water_track_x: water.velocity.x,
            water_track_y: water.velocity.y,
            water_track_z: water.velocity.z,
            water_track_error: water.error,
        );
    }

    fn fill(&self, columns: &mut Columns, row: usize, point: &PingPoint, options: &PointOptions) {
        let PingPoint { cell, beam, range, aim, quality, corrected } = *point;
        let cells = &self.cells;
        macro_rules! copy {
            ($($column:ident),* $(,)?) => { put!(columns, row, $($column: cells.$column[cell]),*) };
        }
        let reported = direction(aim) * range;
        let [azimuth, elevation] = aim;
        let rotation = self.pose.rotation();
        let place = match options.coordinates {
            Frame::Sensor => reported,
            Frame::World => (rotation * reported.as_dvec3() + self.pose.position - self.origin).as_vec3(),
        };
        let own =
            |place: Vec3| (rotation.transpose() * (place.as_dvec3() + self.origin - self.pose.position)).as_vec3();
        let corrected = if options.coordinates == Frame::World { corrected } else { own(corrected) };
        columns.start_row(row);
        put!(columns, row,
            quality: quality,
            corrected_x: corrected.x,
            corrected_y: corrected.y,
            corrected_z: corrected.z,
            x: place.x,
            y: place.y,
            z: place.z,
            range: range,
            depth: reported.x,
            azimuth: azimuth,
            elevation: elevation,
            return_number: u8::from(!range.is_nan()),
            return_count: u8::from(!range.is_nan()),
            channel: beam as u16,
            ring: beam as u16,
            time: self.time,
            frame: options.frame,
            strip: options.strip,
            beam: if self.reports_depths() { beam as u32 } else { cell as u32 },
            firing: self.number,
            doppler: self.bottom_track.map_or(f32::NAN, |track| track.radial[beam]),
        );
        self.fill_tracks(columns, row);
        if range.is_nan() {
            // A miss of an organised cloud.
            return;
        }
        copy!(intensity, category_id, part_id, instance_id, material_id, red, green, blue, cos_incidence);
        copy!(true_range, cause, bounces);
        copy!(velocity_x, velocity_y, velocity_z, radial_velocity, flow_x, flow_y, flow_z);
        put!(columns, row, first_category_id: cells.category_id[cell], first_instance_id: cells.instance_id[cell]);
        put!(columns, row, track_id: cells.instance_id[cell]);
        let truth = Vec3::new(cells.true_x[cell], cells.true_y[cell], cells.true_z[cell]);
        match options.coordinates {
            Frame::World => {
                put!(columns, row, true_x: truth.x, true_y: truth.y, true_z: truth.z);
                copy!(normal_x, normal_y, normal_z);
            }
            Frame::Sensor => {
                let back = rotation.transpose();
                let truth = own(truth);
                put!(columns, row, true_x: truth.x, true_y: truth.y, true_z: truth.z);
                if options.fields.contains_any(&[Field::NormalX, Field::NormalY, Field::NormalZ]) {
                    let normal = Vec3::new(cells.normal_x[cell], cells.normal_y[cell], cells.normal_z[cell]);
                    let own = back.as_mat3() * normal;
                    put!(columns, row, normal_x: own.x, normal_y: own.y, normal_z: own.z);
                }
            }
        }
    }
}
