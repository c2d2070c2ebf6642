//! A scan of a sonar: one ping.

mod contributors;
mod explain;
mod goals;
mod layout;
mod ping;
mod plan;
mod rays;
mod tiles;
mod track;

use crate::scan::ScanOptions;
use crate::sensor::Sensor;
use crate::trace::BuiltScene;
use cloud::{Ping, PointCloud};
use contributors::LabelledCells;
use emitter::Trajectory;
use ground::error::Result;
use std::cell::Cell;

thread_local! {
    /// The last ping that this thread converted to points: buffers for the next one.
    static PING: Cell<Option<Box<Ping>>> = const { Cell::new(None) };
}

impl BuiltScene {
    /// The points of one ping, see [`BuiltScene::scan_into`].
    pub(in crate::scan) fn scan_sound(
        &self,
        sensor: &Sensor,
        trajectory: &Trajectory,
        options: &ScanOptions,
        cloud: &mut PointCloud,
    ) -> Result<()> {
        let with_cells = ScanOptions { fields: Ping::cloud_fields(options.fields), ..options.clone() };
        // For sonars that report depths, points are made from few cells.
        let labelled = if sensor.sonar_view().reports_depths() { LabelledCells::Soundings } else { LabelledCells::All };
        // A thread that is ending has none any more.
        let mut ping = PING.try_with(Cell::take).ok().flatten().unwrap_or_default();
        self.ping_labelled(sensor, trajectory, &with_cells, &mut ping, labelled)?;
        let done = ping.cloud_into(&options.into(), cloud);
        let _ = PING.try_with(|own| own.set(Some(ping)));
        done
    }
}
