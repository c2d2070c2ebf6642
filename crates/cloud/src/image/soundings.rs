//! Depth map: the heights of soundings on the map.

use super::grid::{Grid, fitting, span};
use super::{Image, ImageKind, PixelSource, check_view, filled, layers};
use crate::Pings;
use crate::cells::SonarView;
use glam::DVec3;
use ground::error::{Error, Result};
use std::sync::Arc;

/// Mean height (z in the world, m) of the soundings in squares of `cell_m` metres, along straight beams at their
/// reported range; NaN without any. The label is that of the strongest sounding.
///
/// # Errors
/// Pings that do not fit together, report no depths at all or are from a side-scan or imaging sonar; a cell that is not
/// a length or makes too many pixels.
pub fn depth_map(pings: &Pings, cell_m: f64) -> Result<Image> {
    let soundings = soundings(pings)?;
    let grid = Grid::new(span(soundings.iter().map(|sounding| sounding.at.truncate())), cell_m)?;
    let mut sums = filled(grid.len(), (0f64, 0u32))?;
    let mut strongest = filled(grid.len(), f32::NEG_INFINITY)?;
    let mut sources = filled(grid.len(), PixelSource::NONE)?;
    for sounding in &soundings {
        let pixel = grid.index(sounding.at.truncate());
        sums[pixel].0 += sounding.at.z;
        sums[pixel].1 += 1;
        if sounding.level_db >= strongest[pixel] {
            strongest[pixel] = sounding.level_db;
            sources[pixel] = sounding.source;
        }
    }
    let values = sums.iter().map(|&(sum, count)| if count > 0 { (sum / f64::from(count)) as f32 } else { f32::NAN });
    Ok(Image {
        kind: ImageKind::DepthMap,
        width: grid.width,
        height: grid.height,
        values: values.collect(),
        layers: layers(&pings.pings, &sources)?,
        place: grid.place(),
        labels: pings.pings.first().map(|ping| Arc::clone(&ping.labels)).unwrap_or_default(),
    })
}

/// Cell size with which the depth map fits into a picture of `pixels` and has few holes.
///
/// # Errors
/// As [`depth_map`].
pub fn fitting_cell(pings: &Pings, pixels: [u32; 2]) -> Result<f64> {
    let soundings = soundings(pings)?;
    let [low, high] = span(soundings.iter().map(|sounding| sounding.at.truncate()));
    // Nine soundings a square if evenly spread.
    let spread = 3.0 * ((high - low).element_product() / soundings.len() as f64).sqrt();
    Ok(fitting([low, high], pixels).max(spread))
}

struct PlacedSounding {
    at: DVec3,
    level_db: f32,
    source: PixelSource,
}

/// Where all soundings are in the world; at least one.
fn soundings(pings: &Pings) -> Result<Vec<PlacedSounding>> {
    let words = "swath and single sonars, and Doppler velocity logs";
    check_view(pings, "depth map", &[SonarView::Swath, SonarView::Single, SonarView::Janus], words)?;
    let mut places = Vec::new();
    for (index, ping) in pings.pings.iter().enumerate() {
        for sounding in &ping.soundings {
            let at = ping.corrected_place(sounding);
            let source = PixelSource { ping: index as u32, cell: sounding.cell };
            places.push(PlacedSounding { at, level_db: sounding.level_db, source });
        }
    }
    places.retain(|place| place.at.is_finite());
    if places.is_empty() {
        return Err(Error::invalid("depth map", "requested for pings without soundings", "pings that report depths"));
    }
    Ok(places)
}

#[cfg(test)]
mod tests {
    use super::super::synthetic::{TARGET, swath};
    use super::*;
    use crate::Field;

    #[test]
    fn soundings_make_the_bed() {
        // A flat bed at z = -10 m with a block of 2 m x 2 m x 1 m around 10, 4.
        let pings = swath(60);
        let image = depth_map(&pings, 0.5).unwrap();
        let at = |x: f64, y: f64| image.index([x, y]).unwrap();
        assert!((image.values[at(10.1, 4.1)] + 9.0).abs() < 0.1, "{}", image.values[at(10.1, 4.1)]);
        assert!((image.values[at(10.1, -4.1)] + 10.0).abs() < 0.1);
        let ids = image.layer(Field::CategoryId).unwrap();
        assert_eq!((ids[at(10.1, 4.1)], ids[at(10.1, -4.1)]), (TARGET, 1));
        let mut none = pings;
        for ping in &mut none.pings {
            ping.soundings.clear();
        }
        assert!(depth_map(&none, 0.5).unwrap_err().to_string().contains("without soundings"));
    }
}
