//! How the world lies on the Earth, and poses in the terms of navigators.

use glam::{DMat3, DQuat, DVec3};
use ground::crs::{Crs, TransverseMercator};
use ground::error::{Error, Result};
use ground::pose::Pose;
use std::f64::consts::{FRAC_PI_2, PI};

/// Farthest offset, m: coordinates of any system are less.
const FARTHEST_M: f64 = 1e8;

/// Farthest from its central meridian that a projection is used, rad.
const WIDEST: f64 = 30.0 * PI / 180.0;

/// Greatest height above or below the ellipsoid, m.
const HIGHEST_M: f64 = 1e6;

/// The coordinate system of the world, and where in it the world's origin is.
#[derive(Clone, Debug, PartialEq)]
pub struct Georeference {
    crs: Crs,
    offset: DVec3,
}

/// A place and an attitude: latitude, longitude and angles in rad, the height above the ellipsoid in m. The angles are those
/// of an aircraft, about axes ahead, to starboard and down: the true heading, clockwise from north, then pitch, nose up,
/// then roll, starboard down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geographic {
    /// North of the equator.
    pub latitude: f64,
    /// East of Greenwich.
    pub longitude: f64,
    /// Above the ellipsoid, m.
    pub height: f64,
    /// Starboard down.
    pub roll: f64,
    /// Nose up.
    pub pitch: f64,
    /// Clockwise from true north.
    pub heading: f64,
}

impl Georeference {
    /// The world's origin has the coordinates `offset`, m, in `crs`: easting, northing and height.
    ///
    /// # Errors
    /// An offset that is not finite or beyond 1e8 m.
    pub fn new(crs: Crs, offset: DVec3) -> Result<Georeference> {
        if offset.is_finite() && offset.abs().max_element() <= FARTHEST_M {
            return Ok(Georeference { crs, offset });
        }
        let found = format!("{:?}", offset.to_array());
        Err(Error::invalid("offset", found, format!("three numbers from -{FARTHEST_M} to {FARTHEST_M} m")))
    }

    /// The coordinate system.
    pub fn crs(&self) -> &Crs {
        &self.crs
    }

    /// Coordinates of the world's origin in it, m.
    pub fn offset(&self) -> DVec3 {
        self.offset
    }

    /// Its projection.
    ///
    /// # Errors
    /// A system without one that is known.
    pub(super) fn projection(&self) -> Result<TransverseMercator> {
        self.crs.projection().ok_or_else(|| {
            let found = format!("{:?}, which has no projection that is known here", self.crs.name());
            Error::invalid("crs", found, "with latitudes and longitudes a UTM zone, such as EPSG:25832")
        })
    }

    /// The pose in the world of `place`, by this system's `projection`. Headings become those of the grid; the grid is taken
    /// as level, and not as curved as the Earth.
    pub(super) fn pose(&self, projection: &TransverseMercator, place: &Geographic) -> Result<Pose, String> {
        place.check()?;
        let from_meridian = place.longitude - projection.central_meridian();
        if (from_meridian - (from_meridian / (2.0 * PI)).round() * 2.0 * PI).abs() > WIDEST {
            return Err(format!(
                "longitude {} degrees is more than {} degrees from the central meridian of {}",
                place.longitude.to_degrees(),
                WIDEST.to_degrees().round(),
                self.crs.name()
            ));
        }
        let at = projection.forward(place.latitude, place.longitude);
        let position = DVec3::new(at.easting, at.northing, place.height) - self.offset;
        Ok(Pose { position, orientation: navigated([place.roll, place.pitch, place.heading - at.convergence]) })
    }

    /// The place of a pose, by this system's `projection`, with the convergence, rad, and the scale of the grid there.
    pub(super) fn place(&self, projection: &TransverseMercator, pose: &Pose) -> (Geographic, [f64; 2]) {
        let at = pose.position + self.offset;
        let [latitude, longitude] = projection.inverse(at.x, at.y);
        let grid = projection.forward(latitude, longitude);
        let [roll, pitch, heading] = navigation_angles(pose.orientation);
        let heading = heading + grid.convergence;
        let heading = heading - ((heading + PI) / (2.0 * PI)).floor() * 2.0 * PI;
        (Geographic { latitude, longitude, height: at.z, roll, pitch, heading }, [grid.convergence, grid.scale])
    }
}

impl Geographic {
    fn check(&self) -> Result<(), String> {
        let Geographic { latitude, longitude, height, roll, pitch, heading } = *self;
        for (name, value) in [
            ("latitude", latitude),
            ("longitude", longitude),
            ("height", height),
            ("roll", roll),
            ("pitch", pitch),
            ("heading", heading),
        ] {
            if !value.is_finite() {
                return Err(format!("{name} is {value}; allowed: finite numbers"));
            }
        }
        if latitude.abs() > FRAC_PI_2 {
            return Err(format!("latitude is {latitude} rad; allowed: {:.4} to {FRAC_PI_2:.4}", -FRAC_PI_2));
        }
        if longitude.abs() > 2.0 * PI {
            return Err(format!("longitude is {longitude} rad; allowed: {:.4} to {:.4}", -2.0 * PI, 2.0 * PI));
        }
        if height.abs() > HIGHEST_M {
            return Err(format!("height is {height} m; allowed: -{HIGHEST_M} to {HIGHEST_M}"));
        }
        Ok(())
    }
}

/// The orientation (x ahead, y to port, z up, in a world with y to the north and z up) of a roll to starboard, a pitch nose up
/// and a heading clockwise from y, rad, each about the axis as the later ones have turned it.
pub(crate) fn navigated([roll, pitch, heading]: [f64; 3]) -> DQuat {
    DQuat::from_rotation_z(FRAC_PI_2 - heading) * DQuat::from_rotation_y(-pitch) * DQuat::from_rotation_x(roll)
}

/// Roll, pitch and heading of an orientation, those of [`navigated`]; roll and heading within -pi to pi, pitch within half of
/// that.
pub(crate) fn navigation_angles(orientation: DQuat) -> [f64; 3] {
    let DMat3 { x_axis: ahead, y_axis: port, z_axis: up } = DMat3::from_quat(orientation);
    let pitch = ahead.z.atan2(ahead.x.hypot(ahead.y));
    [port.z.atan2(up.z), pitch, ahead.x.atan2(ahead.y)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_an_aircraft() {
        let turned = |roll: f64, pitch: f64, heading: f64| navigated([roll, pitch, heading].map(f64::to_radians));
        let close = |a: DVec3, b: DVec3| assert!((a - b).length() < 1e-12, "{a} is not {b}");
        close(turned(0.0, 0.0, 0.0) * DVec3::X, DVec3::Y);
        close(turned(0.0, 0.0, 90.0) * DVec3::X, DVec3::X);
        close(turned(0.0, 30.0, 0.0) * DVec3::X, DVec3::new(0.0, 0.75f64.sqrt(), 0.5));
        // Flying north, starboard is east: it goes down.
        close(turned(30.0, 0.0, 0.0) * DVec3::NEG_Y, DVec3::new(0.75f64.sqrt(), 0.0, -0.5));
        for angles in [[0.1, -0.2, 2.5], [-3.0, 1.4, -0.7], [0.0, 0.0, 3.1]] {
            let found = navigation_angles(navigated(angles));
            assert!(found.iter().zip(angles).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}, not {angles:?}");
        }
    }

    #[test]
    fn a_place_is_found_again() {
        let world = Georeference::new(Crs::parse("EPSG:25832").unwrap(), DVec3::new(6e5, 5.4e6, 100.0)).unwrap();
        let projection = world.projection().unwrap();
        let place =
            Geographic { latitude: 0.85, longitude: 0.2, height: 412.5, roll: 0.05, pitch: -0.02, heading: 3.0 };
        let pose = world.pose(&projection, &place).unwrap();
        let (found, [convergence, scale]) = world.place(&projection, &pose);
        let both = |of: &Geographic| [of.latitude, of.longitude, of.height * 1e-7, of.roll, of.pitch, of.heading];
        assert!(both(&found).iter().zip(both(&place)).all(|(a, b)| (a - b).abs() < 1e-13), "{found:?}");
        // The nose points along the heading of the grid.
        let ahead = pose.orientation * DVec3::X;
        assert!((ahead.x.atan2(ahead.y) - (3.0 - convergence)).abs() < 1e-12 && (scale - 1.0).abs() < 2e-4, "{scale}");
    }

    #[test]
    fn places_that_are_none_are_refused() {
        let world = Georeference::new(Crs::parse("EPSG:25832").unwrap(), DVec3::ZERO).unwrap();
        let projection = world.projection().unwrap();
        let good = Geographic { latitude: 0.85, longitude: 0.2, height: 1.0, roll: 0.0, pitch: 0.0, heading: 0.0 };
        for (place, expected) in [
            (Geographic { latitude: 48.7, ..good }, "latitude is 48.7 rad; allowed: -1.5708 to 1.5708"),
            (Geographic { longitude: -11.0, ..good }, "longitude is -11 rad"),
            (
                Geographic { longitude: 1.0, ..good },
                "more than 30 degrees from the central meridian of ETRS89 / UTM zone 32N",
            ),
            (Geographic { height: 2e6, ..good }, "height is 2000000 m"),
            (Geographic { roll: f64::NAN, ..good }, "roll is NaN; allowed: finite numbers"),
        ] {
            let message = world.pose(&projection, &place).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        // A longitude counted the other way round the Earth is the same.
        let other = world.pose(&projection, &Geographic { longitude: 0.2 - 2.0 * PI, ..good }).unwrap();
        assert!((other.position - world.pose(&projection, &good).unwrap().position).length() < 1e-6);
        assert!(Georeference::new(Crs::parse("local").unwrap(), DVec3::NAN).is_err());
        let local = Georeference::new(Crs::parse("local").unwrap(), DVec3::ZERO).unwrap();
        assert!(local.projection().unwrap_err().to_string().contains("\"local\", which has no projection"));
    }
}
