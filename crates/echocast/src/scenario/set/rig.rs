//! Which sensors of a rig a style takes, and pinhole sensors as cameras.

use crate::cloud::PointCloud;
use crate::emitter::pattern::{Pattern, Rays};
use crate::ground::error::{Error, Result};
use crate::scenario::{Sample, Scan};
use crate::sensor::{Sensor, SensorKind};
use glam::{DMat3, DVec3};

/// The kinds of sensors that styles take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Lidar,
    /// Pinhole sensors, whatever they measure ranges with.
    Camera,
    Sonar,
}

/// What `scan` is made with.
pub(super) fn kind(scan: &Scan) -> Kind {
    match (scan.sensor().kind(), &scan.sensor().spec().pattern) {
        (SensorKind::Sonar, _) => Kind::Sonar,
        (_, Pattern::Pinhole(_)) => Kind::Camera,
        _ => Kind::Lidar,
    }
}

/// Number of the scan of `sample` with the sensor called `asked`, which is of this kind; without a name, of the only one.
///
/// # Errors
/// There is none, with what could be added; several.
pub(super) fn find(sample: &Sample, key: &str, asked: Option<&str>, wanted: Kind) -> Result<usize> {
    let scans = sample.scans();
    let fitting: Vec<usize> = (0..scans.len()).filter(|&scan| kind(&scans[scan]) == wanted).collect();
    let names = |which: &[usize]| which.iter().map(|&scan| scans[scan].name()).collect::<Vec<_>>().join(", ");
    let add = match wanted {
        Kind::Lidar => {
            "a LiDAR in `sensors`, such as {sensor: velodyne_hdl64e}; sonars are written by plain, webdataset"
        }
        Kind::Camera => {
            "a camera in `sensors`, such as {name: camera, sensor: {name: camera, kind: lidar, pattern: {type: pinhole, \
             resolution: [1242, 375], fov_deg: [81, 29]}}}"
        }
        Kind::Sonar => "a sonar in `sensors`",
    };
    let allowed = || if fitting.is_empty() { add.to_owned() } else { names(&fitting) };
    let all: Vec<usize> = (0..scans.len()).collect();
    match (asked, fitting.as_slice()) {
        (Some(name), _) => {
            let found = fitting.iter().find(|&&scan| scans[scan].name() == name);
            found.copied().ok_or_else(|| Error::invalid(key, format!("{name:?}"), allowed()))
        }
        (None, [only]) => Ok(*only),
        (None, []) => Err(Error::invalid(key, format!("missing among the sensors {}", names(&all)), add)),
        (None, several) => {
            let found = format!("missing, and there are {} such sensors", several.len());
            Err(Error::invalid(key, found, format!("one of {}", names(several))))
        }
    }
}

/// How a pinhole sensor projects what it sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Camera {
    /// Columns, rows.
    pub size: [u32; 2],
    /// Focal lengths, pixels.
    pub focal: [f64; 2],
    /// Where the axis meets the image, pixels; the middle of the first pixel is 0, 0.
    pub centre: [f64; 2],
}

impl Camera {
    /// That of `sensor`, if it is one.
    pub fn of(sensor: &Sensor) -> Option<Camera> {
        let Pattern::Pinhole(pinhole) = &sensor.spec().pattern else { return None };
        let half = pinhole.fov_deg.map(|fov| (0.5 * fov).to_radians().tan());
        let count = pinhole.resolution.map(f64::from);
        let axis = |axis: usize| match pinhole.rays {
            Rays::Centres => (0.5 * count[axis] / half[axis], 0.5 * count[axis] - 0.5),
            Rays::Edges => (0.5 * (count[axis] - 1.0).max(1.0) / half[axis], 0.5 * (count[axis] - 1.0)),
        };
        let [(fx, cx), (fy, cy)] = [axis(0), axis(1)];
        Some(Camera { size: pinhole.resolution, focal: [fx, fy], centre: [cx, cy] })
    }

    /// From a sensor's axes (x ahead, y left, z up) to those of a camera (x right, y down, z ahead).
    pub fn axes() -> DMat3 {
        DMat3::from_cols(DVec3::Z, -DVec3::X, -DVec3::Y)
    }

    /// Where a point in the camera's axes is in the image, pixels.
    pub fn project(&self, point: DVec3) -> [f64; 2] {
        [0, 1].map(|axis| self.focal[axis] * point[axis] / point.z + self.centre[axis])
    }

    /// The image as PNG, as it would be in even light from all sides: the colours of the first return of each pixel of
    /// `cloud`, black where there is none.
    pub fn png(&self, cloud: &PointCloud) -> std::io::Result<Vec<u8>> {
        let columns = &cloud.columns;
        let [width, height] = self.size;
        let mut pixels = vec![[0_u8; 3]; width as usize * height as usize];
        let mut drawn = vec![false; pixels.len()];
        for row in 0..cloud.len {
            let pixel = columns.beam[row] as usize;
            if columns.x[row].is_finite() && pixel < pixels.len() && !drawn[pixel] {
                pixels[pixel] = [columns.red[row], columns.green[row], columns.blue[row]];
                drawn[pixel] = true;
            }
        }
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.write_header().and_then(|mut image| image.write_image_data(pixels.as_flattened()))?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where the beam of a pixel goes, that pixel is.
    #[test]
    fn pixels_are_where_their_beams_go() {
        for rays in ["centres", "edges"] {
            let text = format!(
                "{{name: a, kind: lidar, pattern: {{type: pinhole, resolution: [7, 4], fov_deg: [80, 50], rays: {rays}}}}}"
            );
            let sensor = Sensor::from_yaml(&text, "").unwrap();
            let camera = Camera::of(&sensor).unwrap();
            for pixel in 0..28 {
                let beams = sensor.beams();
                let [x, y, z] = [beams.dir_x[pixel], beams.dir_y[pixel], beams.dir_z[pixel]].map(f64::from);
                let [u, v] = camera.project(Camera::axes() * DVec3::new(x, y, z));
                let wanted = [(pixel % 7) as f64, (pixel / 7) as f64];
                assert!((u - wanted[0]).abs() < 1e-5 && (v - wanted[1]).abs() < 1e-5, "{pixel}: {u} {v}");
            }
        }
    }
}
