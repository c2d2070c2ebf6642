//! Clouds, and their columns as arrays that share their memory.

use crate::argument;
use crate::array::{self, ColumnOwner, owned, shared};
use crate::boxes::PyBox;
use crate::error::{BindingError, BindingResult};
use crate::options::ColumnNames;
use crate::place::Pose;
use crate::sensor::Instrument;
use crate::sequence;
use echocast::cloud::FIELDS;
use echocast::preview::{ColorBy, PreviewOptions, View};
use echocast::scene::NameTable;
use echocast::{Driver, Field, Frame, PackType, Report, export, import, nearest, preview};
use numpy::PyReadonlyArray1;
use pyo3::exceptions::{PyAttributeError, PyKeyError, PyOverflowError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyCapsule, PyDict, PyIterator, PySlice};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// The points of a scan, or of a file: columns of equal length, read-only.
///
/// `cloud.range` and `cloud["range"]` are a column, as a NumPy array that shares the memory of the cloud and keeps it
/// alive. `len(cloud)` is the number of points. A slice, a mask (bool, as long as the cloud) or row numbers (integers,
/// negative ones from the end), as arrays or lists, give a cloud of some points; a single number gives a point, a NumPy
/// record with all columns: `cloud[3].range`. KeyError and AttributeError for a missing column, ArgumentError for a
/// mask of another length and for row numbers out of range, IndexError for a point out of range. Clouds can be pickled.
///
/// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
/// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"), seed=7)
/// >>> cloud.range.dtype, cloud["category_id"].dtype, cloud.xyz.shape == (len(cloud), 3)
/// (dtype('float32'), dtype('uint32'), True)
/// >>> near = cloud[cloud.range < 2]
/// >>> bool(near.range.max() < 2), len(cloud[:10]), len(cloud[[0, -1]])
/// (True, 10, 2)
/// >>> bool(cloud[-1].range == cloud.range[-1])
/// True
///
/// | columns | type | |
/// |---|---|---|
/// | `x`, `y`, `z` | float32 | measured position, m, relative to `origin` |
/// | `range` | float32 | measured slant range, m |
/// | `intensity` | float32 | what the instrument reports, up to `intensity_full_scale`; for sonars dB re 1 uPa |
/// | `category_id`, `part_id`, `instance_id`, `material_id` | uint32 | labels, 0: unlabelled |
/// | `return_number`, `return_count` | uint8 | number of the return of its beam, from 1, and how many there are |
/// | `channel` | uint16 | emitter, the id of the laser; for sonars the beam |
/// | `ring` | uint16 | number of the ring, as the maker's driver counts; for sonars the beam |
/// | `time` | float64 | time of measurement, s since the start of the run |
/// | `frame` | uint32 | number of the scan |
/// | `beam`, `firing` | uint32 | index of the beam, row x columns + column; of the emission |
/// | `azimuth`, `elevation` | float32 | reported direction, rad, in the sensor's axes |
/// | `red`, `green`, `blue` | uint8 | base colour of the surface, sRGB |
/// | `normal_x`, `normal_y`, `normal_z` | float32 | unit normal of the surface, on the sensor's side |
/// | `cos_incidence` | float32 | cosine of the angle of incidence |
/// | `depth` | float32 | measured distance along the sensor's x axis, m |
/// | `true_x`, `true_y`, `true_z`, `true_range` | float32 | without errors, m |
/// | `cause` | uint8 | what caused the point, see below |
/// | `bounces` | uint8 | mirrors and faces of glass on its path |
/// | `first_category_id`, `first_instance_id` | uint32 | labels of the first surface on its path |
/// | `velocity_x`, `velocity_y`, `velocity_z` | float32 | velocity of the point in the world, m/s |
/// | `radial_velocity`, `doppler` | float32 | rate of the true range, and as the instrument measures it, m/s |
/// | `flow_x`, `flow_y`, `flow_z` | float32 | displacement of the surface until one frame later, in the world, m |
/// | `track_id` | uint32 | object across all frames, 0: unlabelled |
/// | `quality` | float32 | confidence in a sounding of a sonar, 0 to 1 |
/// | `corrected_x`, `corrected_y`, `corrected_z` | float32 | sounding by a ray traced through the assumed cast, m |
/// | `bottom_track_x`, `bottom_track_y`, `bottom_track_z` | float32 | velocity of a DVL over ground, its own axes, m/s |
/// | `bottom_track_error` | float32 | disagreement of its four beams, m/s |
/// | `water_track_x`, `water_track_y`, `water_track_z`, `water_track_error` | float32 | likewise through a layer of water |
/// | `rcs`, `true_rcs` | float32 | radar cross-section as a radar estimates it, and of the strongest scatterer, dBsm |
/// | `snr`, `power` | float32 | signal-to-noise ratio of a detection, dB, and its power at the receiver, dBm |
/// | `path` | uint8 | how the wave of a detection travelled, see below |
/// | `range_sigma`, `azimuth_sigma`, `elevation_sigma`, `velocity_sigma` | float32 | standard errors, m, rad, m/s |
/// | `scan_angle` | float32 | from straight down to the right of the heading, roll included, rad |
/// | `scan_direction`, `edge_of_line` | uint8 | 1 while a line scanner sweeps to the right; for the last point of its line |
/// | `strip` | uint16 | number of the flight line or station, 0: none |
/// | `reflectance_db`, `amplitude_db` | float32 | power against that of a white plate, and over the least detected, dB |
/// | `pulse_width`, `deviation` | float32 | width of the echo, s, and how far its shape is from that of the pulse |
///
/// Causes: 0 surface, 1 seen in a mirror, 2 seen through glass, 3 rain, 4 fog, 5 snow, 6 dust, 7 noise, 8 mixed at an
/// edge, 9 multipath, 10 sea surface.
///
/// Paths: 0 direct, 1 ground, 2 wall, 3 internal, 4 side lobe, 5 alias, 6 interference, 7 noise.
#[pyclass(frozen, module = "echocast")]
pub struct PointCloud(Arc<echocast::PointCloud>);

/// NumPy's name for a type, in the machine's byte order.
fn numpy_type(kind: PackType) -> &'static str {
    match kind {
        PackType::F32 => "f4",
        PackType::F64 => "f8",
        PackType::U8 => "u1",
        PackType::U16 => "u2",
        PackType::U32 => "u4",
        PackType::I8 => "i1",
        PackType::I16 => "i2",
        PackType::I32 => "i4",
        PackType::I64 => "i8",
        PackType::U64 => "u8",
    }
}

impl PointCloud {
    pub fn of(cloud: echocast::PointCloud) -> PointCloud {
        PointCloud(Arc::new(cloud))
    }

    /// The column `field` as an array.
    fn array<'py>(&self, py: Python<'py>, field: Field) -> PyResult<Bound<'py, PyAny>> {
        shared(py, ColumnOwner::Cloud(self.0.clone(), field), &[self.0.len()])
    }
}

#[pymethods]
impl PointCloud {
    /// Reads a cloud file, of echocast or of another program: LAS, LAZ, E57, PCD, PLY, HDF5, CSV, NPZ or MCAP.
    ///
    /// `read_cloud` also returns what a cloud cannot hold. NotFoundError for a missing file, FormatError for a broken
    /// one.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> room.scan("velodyne_vlp16", at=room.camera("Scanner")).write("room.npz")
    /// []
    /// >>> ec.PointCloud.read("room.npz").coordinates
    /// 'world'
    #[staticmethod]
    fn read(py: Python<'_>, #[pyo3(from_py_with = argument::path)] path: PathBuf) -> BindingResult<PointCloud> {
        read_cloud(py, path).map(|(cloud, _)| cloud)
    }

    /// Writes it to `path` in one of the `formats`, selected by `format` or by the ending of `path`. Returns what the
    /// format cannot hold, a sentence each. UnsupportedError for unknown endings, FileError if the file cannot be
    /// written (its subclass NotFoundError for a missing folder); an existing file then stays as it was.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"))
    /// >>> warnings = cloud.write("room.las")
    /// >>> len(ec.PointCloud.read("room.las")) == len(cloud)
    /// True
    #[pyo3(signature = (path, format = None))]
    fn write(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = argument::path)] path: PathBuf,
        #[pyo3(from_py_with = argument::format)] format: Option<&str>,
    ) -> BindingResult<Vec<String>> {
        Ok(py.detach(|| export::write(&self.0, &path, format))?.warnings)
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// Names of its columns.
    #[getter]
    fn fields(&self) -> Vec<&'static str> {
        self.0.fields().iter().map(|info| info.name).collect()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, key: &Bound<'py, PyAny>) -> BindingResult<Bound<'py, PyAny>> {
        if let Ok(name) = key.extract::<String>() {
            return match Field::from_name(&name) {
                Ok(field) if self.0.fields().contains(field) => Ok(self.array(py, field)?),
                Ok(_) => Err(PyKeyError::new_err(not_computed(&name)).into()),
                Err(error) => {
                    Err(PyKeyError::new_err(format!("{error}; there are {}", self.fields().join(", "))).into())
                }
            };
        }
        match key.extract::<isize>() {
            // True and False are integers in Python, but not rows.
            _ if key.is_instance_of::<PyBool>() => {}
            Ok(index) => {
                let point = PointCloud::of(self.0.select(&[sequence::place("point", index, self.0.len())?])?);
                return Ok(records(py, point)?.get_item(0)?);
            }
            Err(error) if error.is_instance_of::<PyOverflowError>(py) => {
                return Err(sequence::missing("point", key, self.0.len()).into());
            }
            Err(_) => {}
        }
        let rows = self.rows(py, key)?;
        let cloud = py.detach(|| self.0.select(&rows))?;
        Ok(Bound::new(py, PointCloud::of(cloud))?.into_any())
    }

    fn __iter__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyIterator>> {
        records(slf.py(), slf)?.try_iter()
    }

    fn __getattr__<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let cloud = slf.get();
        let message = match Field::from_name(name) {
            Ok(field) if cloud.0.fields().contains(field) => return cloud.array(slf.py(), field),
            Ok(_) => not_computed(name),
            // What Python and notebooks look for.
            Err(_) if name.starts_with('_') => format!("a PointCloud has no {name:?}"),
            Err(_) => {
                let known = Self::__dir__(slf)?.into_iter().filter(|known| !known.starts_with('_'));
                let near = nearest(name, known).join(", ");
                let near = if near.is_empty() { near } else { format!("; near: {near}") };
                format!("a PointCloud has no {name:?}{near}")
            }
        };
        Err(PyAttributeError::new_err(message))
    }

    fn __dir__(slf: &Bound<'_, Self>) -> PyResult<Vec<String>> {
        let own: Vec<String> =
            slf.get_type().call_method0("mro")?.try_iter()?.try_fold(Vec::new(), |mut all, class| {
                all.extend(
                    class?
                        .getattr("__dict__")?
                        .call_method0("keys")?
                        .try_iter()?
                        .filter_map(|name| name.ok()?.extract().ok()),
                );
                Ok::<_, PyErr>(all)
            })?;
        Ok(own.into_iter().chain(slf.get().fields().into_iter().map(str::to_owned)).collect())
    }

    /// Positions relative to `origin`: n x 3 float32, m; a copy.
    #[getter]
    fn xyz<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let column = |field: Field| match self.0.fields().contains(field) {
            true => self.array(py, field),
            false => Err(PyAttributeError::new_err(not_computed(field.info().name))),
        };
        let [x, y, z] = [Field::X, Field::Y, Field::Z].map(column);
        py.import("numpy")?.call_method1("column_stack", ((x?, y?, z?),))
    }

    /// The point that positions are relative to: x, y, z in the world (or the sensor's axes), m.
    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.0.origin.to_array()
    }

    /// Rows and columns of the sensor, if every beam has its point; else None.
    #[getter]
    fn organised(&self) -> Option<[u32; 2]> {
        self.0.organised()
    }

    /// "world" or "sensor": the axes of positions, normals and boxes.
    #[getter]
    fn coordinates(&self) -> &'static str {
        match self.0.frame {
            Frame::World => "world",
            Frame::Sensor => "sensor",
        }
    }

    /// Pose of the sensor at the start of the scan.
    #[getter]
    fn sensor_pose(&self) -> Pose {
        Pose(self.0.sensor_pose)
    }

    /// Full scale of `intensity`: 1 or 255; None for energies and levels.
    #[getter]
    fn intensity_full_scale(&self) -> Option<f32> {
        self.0.intensity_full_scale
    }

    /// Most rays that a beam was given, apart from those behind mirrors and glass: what `beam.sub_rays` allows, or less
    /// with a `time_budget`; 0 for clouds that do not come from a scan, and for sonars.
    #[getter]
    fn most_rays(&self) -> u32 {
        self.0.most_rays
    }

    /// The maker whose ROS 2 driver publishes such clouds ("velodyne", for instance), if known; else None.
    #[getter]
    fn driver(&self) -> Option<&'static str> {
        self.0.driver.map(Driver::name)
    }

    /// The points as a ROS 2 driver publishes them: a structured array with the names, types, offsets and size that the
    /// messages have, so that `tobytes()` is the `data` of a `sensor_msgs/PointCloud2`. For an organised cloud its
    /// shape is the `height` and `width` of the message, in the order of the driver: Velodyne and RoboSense have a
    /// column for each ring and a row for each firing. Positions are in the frame of the sensor at the start of the
    /// scan; those of a scan with `coordinates="sensor"` and without `deskew` stay in the frame of their own firing.
    ///
    /// `driver`: "velodyne", "ouster", "hesai", "robosense", "livox" or "autoware"; None: that of the sensor's maker,
    /// or Velodyne's if that is not known. `stamp`: the stamp of the message, s since the start of the run, from which
    /// the times of Velodyne, Ouster and Autoware count; None: the start of the scan. ArgumentError for another driver
    /// and for missing columns.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"))
    /// >>> points = cloud.to_ros()
    /// >>> points.dtype.names, points.dtype.itemsize, bool((points["ring"] == cloud.ring).all())
    /// (('x', 'y', 'z', 'intensity', 'ring', 'time'), 22, True)
    /// >>> cloud.to_ros("ouster")["t"].dtype
    /// dtype('uint32')
    /// >>> whole = room.scan("velodyne_vlp16", at=room.camera("Scanner"), organised=True)
    /// >>> height, width = whole.to_ros().shape
    /// >>> width == 16, height * width == len(whole)
    /// (True, True)
    #[pyo3(signature = (driver = None, *, stamp = None))]
    fn to_ros<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::driver)] driver: Option<&str>,
        #[pyo3(from_py_with = argument::stamp)] stamp: Option<f64>,
    ) -> BindingResult<Bound<'py, PyAny>> {
        let driver = driver.map(|name| crate::sensor::named("driver", name)).transpose()?;
        let driver: Driver = driver.or(self.0.driver).unwrap_or(Driver::Velodyne);
        let step = driver.point_step();
        let mut bytes = vec![0; self.0.len() * step];
        let stamp = stamp.unwrap_or_else(|| self.0.begins());
        py.detach(|| self.0.pack_points(driver, stamp, &mut bytes))?;
        let fields = driver.point_fields();
        let kind = PyDict::new(py);
        kind.set_item("names", fields.iter().map(|field| field.name).collect::<Vec<_>>())?;
        kind.set_item("formats", fields.iter().map(|field| numpy_type(field.kind)).collect::<Vec<_>>())?;
        kind.set_item("offsets", fields.iter().map(|field| field.offset).collect::<Vec<_>>())?;
        kind.set_item("itemsize", step)?;
        let kind = py.import("numpy")?.call_method1("dtype", (kind,))?;
        let points = owned(py, bytes, &[self.0.len() * step])?.call_method1("view", (kind,))?;
        Ok(if self.0.organised().is_some() {
            points.call_method1("reshape", (self.0.driver_shape(driver),))?
        } else {
            points
        })
    }

    /// The cloud, that of one frame, as a message of ROS 2 in the frame `frame_id` of the sensor: serialised bytes (CDR,
    /// little endian), as rclpy's `serialize_message` makes them. `message`: "sensor_msgs/LaserScan" or
    /// "sensor_msgs/MultiEchoLaserScan", of a LiDAR with a single ring, in the order of its beams, +inf where one has no
    /// return; "livox_ros_driver2/CustomMsg", in the order of time. ArgumentError for other messages, for clouds of other
    /// sensors or of several frames, and for missing columns.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("hokuyo_ust10lx", at=room.camera("Scanner"))
    /// >>> len(cloud.to_message("sensor_msgs/LaserScan", frame_id="laser"))
    /// 8708
    #[pyo3(signature = (message, *, frame_id = "sensor"))]
    fn to_message<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::message)] message: &str,
        #[pyo3(from_py_with = argument::frame_id)] frame_id: &str,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let message = crate::sensor::named("message", message)?;
        let bytes = py.detach(|| self.0.message(message, frame_id))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Names of the numbers in `category_id`.
    #[getter]
    fn categories(&self) -> BTreeMap<u32, String> {
        names(&self.0.labels.category)
    }

    /// Names of the numbers in `part_id`.
    #[getter]
    fn parts(&self) -> BTreeMap<u32, String> {
        names(&self.0.labels.part)
    }

    /// Names of the numbers in `instance_id`.
    #[getter]
    fn instances(&self) -> BTreeMap<u32, String> {
        names(&self.0.labels.instance)
    }

    /// Names of the numbers in `material_id`.
    #[getter]
    fn materials(&self) -> BTreeMap<u32, String> {
        names(&self.0.labels.material)
    }

    /// Boxes around labelled instances, if they were requested (`boxes=True`); else None.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"), boxes=True)
    /// >>> box = max(cloud.boxes, key=lambda box: box.points)
    /// >>> int((cloud.instance_id == box.instance_id).sum()) == box.points
    /// True
    #[getter]
    fn boxes(&self) -> Option<Vec<PyBox>> {
        self.0.boxes.as_ref().map(|_| PyBox::all(&self.0))
    }

    /// The image of `sensor`, which made the cloud: rows x columns. For an organised scan of a camera, layers of one
    /// column share the memory of the cloud.
    ///
    /// `layer`: "depth" (along the axis of a camera; else the range), "range" (both float32, m; NaN without a return),
    /// "category", "part", "instance" (uint32; 0 without a return), "color" (x 3 uint8, sRGB), "intensity" (float32) or
    /// "normal" (x 3 float32: right, up, back). UnsupportedError for sensors without rows and columns, ArgumentError
    /// for unknown layers and those whose columns the cloud lacks.
    ///
    /// >>> camera = ec.Sensor("kinect_v2")
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan(camera, at=room.camera("Camera_1"), organised=True, fields="default,depth")
    /// >>> cloud.image("depth", camera).shape, cloud.image("category", camera).dtype
    /// ((424, 512), dtype('uint32'))
    fn image<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::layer)] layer: &str,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
    ) -> BindingResult<Bound<'py, PyAny>> {
        crate::image::layer(py, &self.0, layer, sensor)
    }

    /// The instances in the image of `sensor`, a dict for each:
    ///
    /// * `instance_id`, `category_id`: its label numbers.
    /// * `bounds`: first column, first row, number of columns and of rows of the visible part, pixels.
    /// * `area`: number of its pixels.
    /// * `amodal`: left, top, right and bottom of the whole instance, pixels; `truncation` and `occlusion`, 0 to 1: how
    ///   much of it is outside the image, and how much is hidden. None unless `image_boxes` were requested.
    ///
    /// >>> camera = ec.Sensor("kinect_v2")
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan(camera, at=room.camera("Camera_1"), organised=True, fields="default,depth")
    /// >>> seen = cloud.annotations(camera)[0]
    /// >>> int((cloud.image("instance", camera) == seen["instance_id"]).sum()) == seen["area"]
    /// True
    fn annotations<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::sensor)] sensor: Instrument<'_>,
    ) -> BindingResult<Vec<Bound<'py, PyDict>>> {
        crate::image::annotations(py, &self.0, &sensor.sensor()?)
    }

    /// A picture as PNG, bytes.
    ///
    /// `color`: "label", "cause", "intensity", "range", "height", "velocity", "radial_velocity", "doppler",
    /// "density", "ground_density", "strip" or "path"; None: "label". `view`: "top", "perspective" (from behind the sensor) or "range" (as the sensor
    /// sees it). `width`: 320 to 4096 pixels; None: 1600.
    #[pyo3(signature = (*, color = None, view = "top", width = None))]
    fn png<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = argument::color)] color: Option<&str>,
        #[pyo3(from_py_with = argument::view)] view: &str,
        #[pyo3(from_py_with = argument::width)] width: Option<u32>,
    ) -> BindingResult<Bound<'py, PyBytes>> {
        let view: View = crate::sensor::named("view", view)?;
        let color: ColorBy = color.map(|color| crate::sensor::named("color", color)).transpose()?.unwrap_or_default();
        let mut options = PreviewOptions::default().view(view).color(color);
        if let Some(width) = width {
            options.width = width;
        }
        let bytes = py.detach(|| {
            let mut report = Report::default();
            let picture = preview::render(&self.0, &options, &mut report)?;
            picture.to_png().map_err(|source| echocast::Error::Io { path: "picture".into(), source })
        })?;
        Ok(PyBytes::new(py, &bytes))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyBytes>> {
        self.png(py, None, "top", Some(640)).ok()
    }

    /// What notebooks show: its picture, and a table of its columns.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("echocast._look")?.call_method1("html", (slf,))
    }

    /// Like `echocast.show`: in the viewer of Rerun or to a recording, `path`; without rerun-sdk its picture is opened.
    #[pyo3(signature = (**options))]
    fn show(slf: &Bound<'_, Self>, options: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        slf.py().import("echocast._look")?.getattr("show")?.call((slf,), options).map(drop)
    }

    /// Draws it with matplotlib, m, in the coordinates of the world or of the sensor; returns the axes.
    ///
    /// `color`: "category", "part", "instance", "material" or a column. `view`: "top", "side" (along y) or "3d". `ax`:
    /// axes to draw in, which have the projection "3d" for that view. ArgumentError for others, ImportError without
    /// matplotlib.
    #[pyo3(signature = (**options))]
    fn plot<'py>(slf: &Bound<'py, Self>, options: Option<&Bound<'py, PyDict>>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("echocast._look")?.getattr("plot")?.call((slf,), options)
    }

    /// The Arrow C stream interface: `pyarrow.table(cloud)`, `polars.DataFrame(cloud)`, without copies.
    /// `requested_schema` is ignored, as the interface allows.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> BindingResult<Bound<'py, PyCapsule>> {
        let _ = requested_schema;
        crate::arrow::stream(py, &self.0)
    }

    /// Columns by name, arrays that share the memory of the cloud; positions are relative to `origin`.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"), fields="x,y,z,range")
    /// >>> list(cloud.to_dict())
    /// ['x', 'y', 'z', 'range']
    fn to_dict<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        converted(slf, "to_dict")
    }

    /// A pandas.DataFrame of all columns; positions are relative to `origin`, which is in its `attrs`, as are
    /// `categories`. ImportError without pandas.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"))
    /// >>> mean = cloud.to_pandas().groupby("category_id")["range"].mean()
    /// >>> bool(mean.max() < 15)
    /// True
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        converted(slf, "to_pandas")
    }

    /// An open3d.t.geometry.PointCloud with all columns; positions are relative to `origin`. ImportError without
    /// Open3D.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"))
    /// >>> thinned = cloud.to_open3d().voxel_down_sample(0.05)
    /// >>> len(thinned.point.positions) < len(cloud)
    /// True
    fn to_open3d<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        converted(slf, "to_open3d")
    }

    /// Tensors by name, copies: those of `columns`, or of all; integers as int64, the type that networks expect for
    /// classes. ImportError without PyTorch.
    ///
    /// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
    /// >>> cloud = room.scan("velodyne_vlp16", at=room.camera("Scanner"))
    /// >>> cloud.to_torch(["range", "category_id"])["category_id"].dtype
    /// torch.int64
    #[pyo3(signature = (columns = None))]
    fn to_torch<'py>(
        slf: &Bound<'py, Self>,
        #[pyo3(from_py_with = argument::columns)] columns: Option<ColumnNames>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let columns = columns.map(ColumnNames::names);
        slf.py().import("echocast._convert")?.call_method1("to_torch", (slf, columns))
    }

    /// A structured array with a member for each column: `numpy.asarray(cloud)`; a copy.
    #[pyo3(signature = (dtype = None, copy = None))]
    fn __array__<'py>(
        slf: &Bound<'py, Self>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("echocast._convert")?.call_method1("structured", (slf, dtype, copy))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<(Py<PyAny>, (Py<PyAny>,))> {
        let module = slf.py().import("echocast._pickle")?;
        let bytes = module.call_method1("to_bytes", (slf,))?;
        Ok((module.getattr("from_bytes")?.unbind(), (bytes.unbind(),)))
    }

    fn __repr__(&self) -> String {
        format!("<PointCloud: {} points; {}>", self.0.len(), self.fields().join(", "))
    }
}

impl PointCloud {
    /// Numbers of the rows that `key` selects: a slice, a mask or numbers.
    fn rows(&self, py: Python<'_>, key: &Bound<'_, PyAny>) -> BindingResult<Vec<usize>> {
        let count = self.0.len();
        if let Ok(slice) = key.cast::<PySlice>() {
            let found = slice.indices(count as isize)?;
            return Ok((0..found.slicelength).map(|n| (found.start + n as isize * found.step) as usize).collect());
        }
        let key = py.import("echocast._arrays")?.call_method1("rows", (key,))?;
        if let Ok(mask) = key.extract::<PyReadonlyArray1<'_, bool>>() {
            let mask = mask.as_array();
            if mask.len() != count {
                return Err(BindingError::argument("mask", format!("{} long", mask.len()), format!("{count} long")));
            }
            return Ok(mask.iter().enumerate().filter(|(_, selected)| **selected).map(|(row, _)| row).collect());
        }
        let numbers: PyReadonlyArray1<'_, i64> = key.extract()?;
        let row = |&number: &i64| {
            let row = if number < 0 { number + count as i64 } else { number };
            let fits = (0..count as i64).contains(&row);
            fits.then_some(row as usize)
                .ok_or_else(|| BindingError::argument("row", number, format!("-{count} to {}", count as i64 - 1)))
        };
        numbers.as_array().iter().map(row).collect()
    }
}

/// The message for the column `name`, which a cloud may have.
fn not_computed(name: &str) -> String {
    format!("there is no column {name:?}: it was not computed; ask for it with fields=\"default,{name}\"")
}

/// Names of all columns that clouds may have, with their types, units ("1" for ratios, "" for counts and numbers) and
/// meanings.
#[pyfunction]
pub fn columns() -> Vec<(&'static str, &'static str, &'static str, &'static str)> {
    FIELDS.iter().map(|info| (info.name, array::kind_name(info.kind), info.unit, info.meaning)).collect()
}

/// The points of `cloud` as an array of records.
fn records<'py>(py: Python<'py>, cloud: impl IntoPyObject<'py>) -> PyResult<Bound<'py, PyAny>> {
    py.import("echocast._convert")?.call_method1("records", (cloud,))
}

/// `cloud`, converted by the function `name` of the Python module.
fn converted<'py>(cloud: &Bound<'py, PointCloud>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    cloud.py().import("echocast._convert")?.call_method1(name, (cloud,))
}

pub fn names(table: &NameTable) -> BTreeMap<u32, String> {
    table.iter().map(|(id, name)| (id, name.to_owned())).collect()
}

/// The cloud in the file at `path`, and what the file contains that a cloud cannot hold, a sentence each. Errors as for
/// `PointCloud.read`.
///
/// >>> room = ec.Scene.generate("indoor", rooms=[1, 1])
/// >>> warnings = room.scan("velodyne_vlp16", at=room.camera("Scanner")).write("room.las")
/// >>> cloud, left_out = ec.read_cloud("room.las")
/// >>> len(cloud) > 1000, left_out
/// (True, [])
#[pyfunction]
pub fn read_cloud(
    py: Python<'_>,
    #[pyo3(from_py_with = argument::path)] path: PathBuf,
) -> BindingResult<(PointCloud, Vec<String>)> {
    let mut report = Report::default();
    let cloud = py.detach(|| import::read(&path, &mut report))?;
    Ok((PointCloud::of(cloud), report.warnings))
}

/// Names of the formats that clouds are written in, with a description of each.
///
/// >>> "las" in dict(ec.formats())
/// True
#[pyfunction]
pub fn formats() -> Vec<(&'static str, &'static str)> {
    export::FORMATS.iter().map(|format| (format.name(), format.info().description)).collect()
}
