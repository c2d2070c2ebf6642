//! What `<compiler>` says, and the poses that depend on it.

use super::defaults::Classed;
use glam::{DAffine3, DMat3, DQuat, DVec3};
use ground::error::Result;
use ground::read::xml::Xml;

/// How a model is meant.
#[derive(Clone, Debug)]
pub(super) struct MjcfCompiler {
    /// Whether angles are degrees.
    pub degrees: bool,
    /// Axes of Euler angles; upper case: fixed ones.
    euler: Vec<char>,
    /// Folder of meshes.
    pub mesh_folder: String,
    /// Whether joints with a range are limited.
    pub auto_limits: bool,
    /// Whether folders in names of files do not count.
    pub strips: bool,
}

impl Default for MjcfCompiler {
    fn default() -> Self {
        MjcfCompiler {
            degrees: true,
            euler: vec!['x', 'y', 'z'],
            mesh_folder: String::new(),
            auto_limits: true,
            strips: false,
        }
    }
}

impl MjcfCompiler {
    /// Takes over what one `<compiler>` says.
    pub fn read(&mut self, compiler: Xml<'_>) -> Result<()> {
        match compiler.attribute("angle") {
            None => {}
            Some("degree") => self.degrees = true,
            Some("radian") => self.degrees = false,
            Some(_) => return Err(compiler.wrong("angle", "degree, radian")),
        }
        if let Some(sequence) = compiler.attribute("eulerseq") {
            self.euler = sequence.chars().collect();
            if self.euler.len() != 3 || !self.euler.iter().all(|axis| "xyzXYZ".contains(*axis)) {
                return Err(compiler.wrong("eulerseq", "three of x, y, z, X, Y, Z"));
            }
        }
        let folder = compiler.attribute("meshdir").or(compiler.attribute("assetdir"));
        if let Some(folder) = folder {
            self.mesh_folder = folder.to_owned();
        }
        for (name, value) in [("autolimits", &mut self.auto_limits), ("strippath", &mut self.strips)] {
            match compiler.attribute(name) {
                None => {}
                Some("true") => *value = true,
                Some("false") => *value = false,
                Some(_) => return Err(compiler.wrong(name, "true, false")),
            }
        }
        Ok(())
    }

    /// An angle of the file, radians.
    pub fn radians(&self, angle: f64) -> f64 {
        if self.degrees { angle.to_radians() } else { angle }
    }

    /// The pose of an element: `pos`, and one of `quat`, `axisangle`, `euler`, `xyaxes` and `zaxis`.
    pub fn pose(&self, element: Classed<'_, '_>) -> Result<DAffine3> {
        let at = element.numbers::<3>("pos")?.map_or(DVec3::ZERO, DVec3::from);
        Ok(DAffine3::from_rotation_translation(self.orientation(element)?.unwrap_or(DQuat::IDENTITY), at))
    }

    /// The orientation of an element, if it has one.
    fn orientation(&self, element: Classed<'_, '_>) -> Result<Option<DQuat>> {
        let unit = |axis: DVec3, attribute: &str| {
            axis.try_normalize().ok_or_else(|| element.wrong(attribute, "directions, not of length 0"))
        };
        if let Some([w, x, y, z]) = element.numbers::<4>("quat")? {
            let quaternion = DQuat::from_xyzw(x, y, z, w);
            if quaternion.length_squared() == 0.0 {
                return Err(element.wrong("quat", "a quaternion, not of length 0"));
            }
            return Ok(Some(quaternion.normalize()));
        }
        if let Some([x, y, z, angle]) = element.numbers::<4>("axisangle")? {
            let axis = unit(DVec3::new(x, y, z), "axisangle")?;
            return Ok(Some(DQuat::from_axis_angle(axis, self.radians(angle))));
        }
        if let Some(angles) = element.numbers::<3>("euler")? {
            let mut turned = DQuat::IDENTITY;
            for (axis, angle) in self.euler.iter().zip(angles) {
                let about = match axis.to_ascii_lowercase() {
                    'x' => DVec3::X,
                    'y' => DVec3::Y,
                    _ => DVec3::Z,
                };
                let step = DQuat::from_axis_angle(about, self.radians(angle));
                // About the axes as turned so far, or about those of the parent.
                turned = if axis.is_lowercase() { turned * step } else { step * turned };
            }
            return Ok(Some(turned));
        }
        if let Some(n) = element.numbers::<6>("xyaxes")? {
            let x = unit(DVec3::new(n[0], n[1], n[2]), "xyaxes")?;
            let y = DVec3::new(n[3], n[4], n[5]);
            let y = unit(y - x * x.dot(y), "xyaxes")?;
            return Ok(Some(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)))));
        }
        if let Some(z) = element.numbers::<3>("zaxis")? {
            return Ok(Some(DQuat::from_rotation_arc(DVec3::Z, unit(DVec3::from(z), "zaxis")?)));
        }
        Ok(None)
    }
}
