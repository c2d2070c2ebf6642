//! Cloud files: any bytes are refused, or give a cloud that keeps its promises.
//!
//! The first byte says which format the rest is shown as: that its reader is reached, it begins as such a file does.
//! `cargo fuzz run -s none cloud fuzz/corpus/cloud fuzz/seeds/cloud`

use echocast::{Field, PointCloud, Report, import};
use std::cell::OnceCell;
use std::fs;
use std::sync::Once;

/// How files of each format begin, shorter than any of them is.
const BEGINNINGS: [&[u8]; 9] =
    [b"", b"LASF", b"ply\n", b"# .PCD", b"ASTM-E57", b"PK\x03\x04", b"x,y,z\n", b"FIELDS ", b"\x89MCAP0\r\n"];

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(data: &[u8]) {
    /// Crates that panic on damaged files, which is caught.
    static CAUGHT: Once = Once::new();
    CAUGHT.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let file = panic.location().map_or("", |place| place.file());
            if !["/laz-", "/e57-", "/lzf-", "/mcap-"].iter().any(|name| file.contains(name)) {
                before(panic);
            }
        }));
    });
    let Some((first, rest)) = data.split_first() else { return };
    let beginning = BEGINNINGS[usize::from(*first) % BEGINNINGS.len()];
    let mut file = rest.to_vec();
    if file.len() < beginning.len() {
        file.resize(beginning.len(), 0);
    }
    file[..beginning.len()].copy_from_slice(beginning);
    if beginning == b"ASTM-E57" {
        check_pages(&mut file);
    }
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the file")).path();
        let path = folder.join("a.cloud");
        fs::write(&path, &file).expect("the file can be written");
        let mut report = Report::default();
        let read = import::read(&path, &mut report);
        if let Ok(cloud) = &read {
            check(cloud);
        }
        let _ = import::is_cloud(&path);
    });
}

/// Puts the right sum at the end of each page of an E57 file: no reader looks at what is in others.
fn check_pages(file: &mut [u8]) {
    for page in file.chunks_exact_mut(1024) {
        let (bytes, sum) = page.split_at_mut(1020);
        // CRC-32C.
        let step = |crc: u32| if crc & 1 == 1 { crc >> 1 ^ 0x82f6_3b78 } else { crc >> 1 };
        let crc = bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc)));
        sum.copy_from_slice(&(!crc).to_be_bytes());
    }
}

/// Its columns are as long as it is, and positions are within reach or empty.
fn check(cloud: &PointCloud) {
    for info in cloud.fields().iter() {
        assert_eq!(cloud.column(info.field).len(), cloud.len(), "{}", info.name);
    }
    let places = [Field::X, Field::Y, Field::Z].map(|field| cloud.column(field));
    for place in places {
        assert!((0..place.len()).all(|row| place.get_f64(row).is_nan() || place.get_f64(row).abs() <= 1e18));
    }
    assert!(cloud.origin.abs().max_element() <= 1.1e18 && cloud.sensor_pose.orientation.is_normalized());
    if let Some([rows, columns]) = cloud.organised() {
        assert_eq!(u64::from(rows) * u64::from(columns), cloud.len() as u64);
    }
}
