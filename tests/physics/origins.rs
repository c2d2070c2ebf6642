//! Rays with their own origins and times, against a wall whose ranges are a division.

use echocast::emitter::RayColumns;
use echocast::{FieldSet, Frame, PointCloud, Pose, ScanOptions, Sensor, Trajectory};
use echocast_tests::reference::{SceneBuilder, Shape};
use glam::{DVec3, Vec3};

/// Where the wall is, m along x.
const WALL: f64 = 10.0;

const COUNT: usize = 700;

/// Rays all around x, from places as far as a metre from the sensor, one every 100 us; two in three go to the wall.
struct Rays {
    origin: Vec<[f32; 3]>,
    direction: Vec<[f32; 3]>,
    time: Vec<f64>,
    channel: Vec<u16>,
}

fn rays() -> Rays {
    let numbers = |step: f64, scale: f64| (0..COUNT).map(move |ray| scale * (step * ray as f64).sin());
    let place = |[x, y, z]: [f64; 3]| DVec3::new(x, y, z).as_vec3().to_array();
    let three = |steps: [f64; 3], scale: f64| {
        let [x, y, z] = steps.map(|step| numbers(step, scale));
        x.zip(y).zip(z).map(|((x, y), z)| [x, y, z]).collect::<Vec<_>>()
    };
    Rays {
        origin: three([1.1, 2.3, 0.7], 1.0).into_iter().map(place).collect(),
        direction: three([0.3, 1.7, 2.9], 0.6)
            .into_iter()
            .map(|[x, y, z]| DVec3::new(x + 0.4, y, z).normalize().as_vec3().to_array())
            .collect(),
        time: (0..COUNT).map(|ray| 1e-4 * ray as f64).collect(),
        channel: (0..COUNT).map(|ray| (ray % 7) as u16).collect(),
    }
}

fn sensor(rays: &Rays) -> Sensor {
    let Rays { origin, direction, time, channel } = rays;
    Sensor::from_rays("rays", &RayColumns::default().origin(origin).direction(direction).time(time).channel(channel))
        .unwrap()
}

fn scan(sensor: &Sensor, path: &Trajectory, coordinates: Frame, start_time: f64) -> PointCloud {
    let mut scene = SceneBuilder::new();
    let paint = scene.reflector(0.5);
    scene.stand(Shape::plate(DVec3::X * WALL, -DVec3::X, 1e3), Some(paint));
    let fields = FieldSet::all();
    let options = ScanOptions::default().fields(fields).organised(true).coordinates(coordinates).start_time(start_time);
    scene.finish().build().unwrap().scan(sensor, path, &options).unwrap()
}

/// Compares a scan along `path` with the wall, ray by ray at the pose of its own time; returns how many met it.
fn compare(rays: &Rays, path: &Trajectory, start_time: f64) -> usize {
    let sensor = sensor(rays);
    let [world, own] = [Frame::World, Frame::Sensor].map(|frame| scan(&sensor, path, frame, start_time));
    let mut met = 0;
    for ray in 0..COUNT {
        let (columns, time) = (world.columns(), start_time + rays.time[ray]);
        assert_eq!((columns.channel()[ray], columns.time()[ray]), (rays.channel[ray], time));
        let start = |time: f64| {
            let pose = path.at(time);
            pose.position + pose.orientation * Vec3::from(rays.origin[ray]).as_dvec3()
        };
        let direction = path.at(time).orientation * Vec3::from(rays.direction[ray]).as_dvec3();
        let range = (WALL - start(time).x) / direction.x;
        // Shallow rays meet it far away, or beside it.
        if !(0.0..100.0).contains(&range) {
            assert!(columns.range()[ray].is_nan() || columns.range()[ray] > 99.0, "ray {ray} of range {range}");
            continue;
        }
        met += 1;
        // Single precision of directions and places counts more at a slant.
        let slack = 4e-6 * (10.0 + range) / direction.x;
        assert!((f64::from(columns.range()[ray]) - range).abs() < slack, "ray {ray}: {} {range}", columns.range()[ray]);
        let point = |cloud: &PointCloud| {
            let columns = cloud.columns();
            cloud.origin + Vec3::new(columns.x()[ray], columns.y()[ray], columns.z()[ray]).as_dvec3()
        };
        assert!((point(&world) - (start(time) + range * direction)).length() < slack);
        let expected = Vec3::from(rays.origin[ray]).as_dvec3() + range * Vec3::from(rays.direction[ray]).as_dvec3();
        assert!((point(&own) - expected).length() < slack, "ray {ray}: {} {expected}", point(&own));
        assert!((f64::from(own.columns().depth()[ray]) - expected.x).abs() < slack);
        // The wall stands, so what changes is where the ray starts: a difference of places over a short time.
        let speed = (start(time + 1e-6) - start(time - 1e-6)).dot(direction) / 2e-6;
        let found = f64::from(columns.radial_velocity()[ray]);
        assert!((found + speed).abs() < 1e-4, "ray {ray}: {found} {speed}");
    }
    met
}

#[test]
fn rays_start_at_their_own_origins() {
    let path = Trajectory::fixed(Pose::at(1.0, 2.0, 3.0).with_rpy_deg(10.0, 20.0, 30.0));
    assert!(compare(&rays(), &path, 0.0) > COUNT / 3);
}

#[test]
fn rays_of_a_moving_sensor_start_where_it_is_at_their_own_time() {
    let a = Pose::at(1.0, 2.0, 3.0).with_rpy_deg(10.0, 20.0, 30.0);
    let b = Pose::at(2.0, 1.0, 2.5).with_rpy_deg(-5.0, 10.0, 60.0);
    let c = Pose::at(2.5, 1.5, 2.0).with_rpy_deg(0.0, -10.0, 20.0);
    // It stands still before and after.
    let path = Trajectory::new(vec![(5.01103, a), (5.04052, b), (5.06024, c)]).unwrap();
    assert!(compare(&rays(), &path, 5.0) > COUNT / 3);
}

/// The origins in a table are those of rays in code.
#[test]
fn origins_are_read_from_tables() {
    let folder = tempfile::tempdir().unwrap();
    let mut csv = String::from("origin_y_m,azimuth_deg,elevation_deg,time_us,origin_z_m\n");
    csv += "0.25,0,0,0,0\n-0.5,0,0,100,1\n";
    std::fs::write(folder.path().join("rays.csv"), &csv).unwrap();
    let text = "name: rays\nkind: lidar\npattern: {type: table, file: rays.csv, rate_hz: 10}\n";
    let table = Sensor::from_yaml(text, folder.path()).unwrap();
    let direction = [[1.0, 0.0, 0.0]; 2];
    let origin = [[0.0, 0.25, 0.0], [0.0, -0.5, 1.0]];
    let rays = RayColumns::default().origin(&origin).direction(&direction).time(&[0.0, 1e-4]);
    assert_eq!(table.beams(), Sensor::from_rays("rays", &rays).unwrap().beams());
    let cloud = scan(&table, &Trajectory::fixed(Pose::IDENTITY), Frame::Sensor, 0.0);
    assert_eq!((cloud.columns().y(), cloud.columns().z()), (&[0.25, -0.5][..], &[0.0, 1.0][..]));
    std::fs::write(folder.path().join("rays.csv"), csv.replace("-0.5", "-2e6")).unwrap();
    let error = Sensor::from_yaml(text, folder.path()).unwrap_err().to_string();
    assert!(error.ends_with("rays.csv: line 3: origin_y_m is -2000000; allowed: -1e6 to 1e6"), "{error}");
}

#[test]
fn columns_of_rays_are_checked() {
    let direction = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let fault = |rays: RayColumns| Sensor::from_rays("rays", &rays).unwrap_err().to_string();
    let rays = RayColumns::default().direction(&direction);
    assert_eq!(fault(rays.time(&[0.0])), "time is 1 rays long; allowed: 2 rays, or none");
    assert_eq!(fault(rays.origin(&[[0.0; 3]; 3])), "origin is 3 rays long; allowed: 2 rays, or none");
    let found = fault(rays.origin(&[[0.0; 3], [0.0, f32::NAN, 0.0]]));
    assert_eq!(found, "origin of beam 1 is (0, NaN, 0) m; allowed: -1000000 to 1000000 m");
    assert!(fault(rays.direction(&[])).starts_with("rows x columns is 1 x 0; allowed: 1 to "));
    assert!(fault(rays.period(0.0)).starts_with("period is 0; allowed: "));
    assert!(Sensor::from_rays("rays", &rays).is_ok());
}
