//! Receivers of pulses: an echo is a maximum of a beam's signal.

use super::gate::{self, NEAREST};
use super::{Detections, Gate, ReceivedBeam, ReturnRule};
use crate::echo::Peak;

/// Finds the echoes of a beam in its signal, and selects those to report by `rule`.
pub(super) fn detect(gate: &Gate, received: &ReceivedBeam, rule: &ReturnRule, found: &mut Detections) {
    let Detections { waveform, received: signal, peaks, order, chosen, .. } = found;
    let passes = |peak: &Peak, number: u32| {
        peak.range > 0.0 && gate.passes(received.beam, number, peak.power * peak.range * peak.range, peak.range)
    };
    if let Some(peak) = received.plain {
        if passes(&peak, NEAREST) {
            peaks.push(peak);
            chosen.extend((0..rule.copies()).map(|_| 0));
        }
        return;
    }
    waveform.peaks(signal, peaks);
    let nearest = peaks.iter().map(|peak| peak.range).find(|&range| range >= received.straight - waveform.sigma());
    peaks.retain(|peak| passes(peak, if Some(peak.range) == nearest { NEAREST } else { gate::numbered(peak.range) }));
    peaks.extend(received.alarms.iter().map(|&(_, peak)| peak));
    peaks.sort_unstable_by(|a, b| a.range.total_cmp(&b.range).then(a.power.total_cmp(&b.power)));
    rule.choose(peaks, order, chosen);
}
