//! Texts of variable length in HDF5 files: whatever their heap and what leads there say, the file is refused, or gives a
//! cloud. All else of such files is read by the C library, which is not ours to fuzz: only these bytes of a sound file
//! are replaced, by those of the input.
//!
//! `cargo fuzz run -s none hdf5 fuzz/corpus/hdf5 fuzz/seeds/hdf5`

use echocast::{Report, import};
use std::cell::OnceCell;
use std::fs;
use std::ops::Range;
use std::sync::LazyLock;

static SOUND: LazyLock<Sound> = LazyLock::new(|| {
    let bytes = include_bytes!("../../tests/data/clouds/variable_texts.h5").to_vec();
    let heap = bytes.windows(4).position(|four| four == b"GCOL").expect("a heap");
    let address = (heap as u64).to_le_bytes();
    // Texts of a dataset follow each other; a single one may be an attribute, which nobody reads.
    let leads = |at: usize| bytes.get(at + 4..at + 12) == Some(&address);
    let elements = (0..bytes.len()).filter(|&at| leads(at) && (leads(at + 16) || at >= 16 && leads(at - 16)));
    let mut replaced: Vec<_> = elements.map(|at| at..at + 16).collect();
    assert!(replaced.len() > 10, "datasets of texts");
    replaced.push(heap..heap + 4096);
    Sound { bytes, replaced }
});

struct Sound {
    bytes: Vec<u8>,
    replaced: Vec<Range<usize>>,
}

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// Runs it with one input.
pub fn run(data: &[u8]) {
    let mut file = SOUND.bytes.clone();
    let places = SOUND.replaced.iter().cloned().flatten();
    places.zip(data).for_each(|(at, &byte)| file[at] = byte);
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder for the file")).path();
        let path = folder.join("a.h5");
        fs::write(&path, &file).expect("the file can be written");
        if let Ok(cloud) = import::read(&path, &mut Report::default()) {
            assert_eq!(cloud.len(), 121);
            let names = cloud.labels.category.names().iter().chain(cloud.labels.material.names());
            assert!(names.map(String::len).sum::<usize>() <= 3 * file.len());
        }
    });
}
