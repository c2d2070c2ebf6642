"""Frames of radars."""

from pathlib import Path

import numpy as np
import pytest

import echocast as ec

#: A small radar: 64 chirps of one transmitter, eight receivers half a wavelength apart.
RADAR = """
name: small
kind: radar
pattern: {type: radar, azimuth_deg: [-60, 60], elevation_deg: [-20, 20], rate_hz: 10}
radar:
  power_dbm: 12
  noise_figure_db: 12
  waveform: {type: fmcw, start_ghz: 77, slope_mhz_per_us: 30, samples: 128, sample_rate_mhz: 6, idle_us: 10,
    adc_start_us: 4, ramp_us: 30, chirps: 64}
  array: {rx: {count: 8}}
  clutter: false
"""

#: Of the plate, m.
DISTANCE = 20.0


@pytest.fixture(scope="module")
def radar(tmp_path_factory: pytest.TempPathFactory) -> ec.Sensor:
    path = tmp_path_factory.mktemp("radar") / "small.yaml"
    path.write_text(RADAR)
    return ec.Sensor(path)


@pytest.fixture(scope="module")
def plate() -> ec.Scene:
    """A plate that faces the radar, so that its middle is the specular point."""
    half = 0.5
    vertices = np.array([[DISTANCE, y, z] for y, z in [(-half, -half), (half, -half), (half, half), (-half, half)]])
    triangles = np.array([[0, 2, 1], [0, 3, 2]], dtype=np.uint32)
    return ec.Scene.from_objects(
        [
            {
                "name": "plate",
                "vertices": vertices.astype(np.float32),
                "triangles": triangles,
                "category": "plate",
                "material": "steel",
            }
        ]
    )


@pytest.fixture(scope="module")
def frame(plate: ec.Scene, radar: ec.Sensor) -> ec.RadarFrame:
    return plate.radar_frame(radar, at=(0, 0, 0), seed=1, samples=True)


def test_the_cube_is_at_the_range_of_the_target(frame: ec.RadarFrame) -> None:
    assert frame.cube is not None and frame.range_m is not None and frame.velocity is not None
    assert frame.cube.dtype == np.complex64 and not frame.cube.flags.writeable
    assert frame.cube.shape == (8, len(frame.velocity), len(frame.range_m)) and frame.elements.shape == (8, 3)
    power = (np.abs(frame.cube) ** 2).sum(axis=0)
    velocity, distance = np.unravel_index(power.argmax(), power.shape)
    step = frame.range_m[1] - frame.range_m[0]
    assert abs(frame.range_m[distance] - DISTANCE) < step and abs(frame.velocity[velocity]) < 0.2
    # It shares the memory of the frame.
    again = frame.cube
    assert again is not None and again.__array_interface__["data"] == frame.cube.__array_interface__["data"]


def test_samples_hold_the_beat_of_the_target(frame: ec.RadarFrame) -> None:
    assert frame.samples is not None and frame.samples.shape == (64, 1, 8, 128, 2) and frame.samples.dtype == np.int16
    # The frequency of the beat is 2 R slope / c, from 0 to the sampling rate.
    tone = frame.samples[..., 0].astype(float) + 1j * frame.samples[..., 1]
    spectrum = np.abs(np.fft.fft(tone, axis=3)).sum(axis=(0, 1, 2))
    beat = 2 * DISTANCE * 30e12 / 299_792_458
    assert abs(spectrum.argmax() * 6e6 / 128 - beat) < 6e6 / 128


def test_detections_are_those_of_a_scan(plate: ec.Scene, radar: ec.Sensor) -> None:
    frame = plate.radar_frame(radar, at=(0, 0, 0), seed=1)
    scan = plate.scan(radar, at=(0, 0, 0), seed=1)
    assert frame.samples is None and frame.polar is None and len(scan) > 0
    assert np.array_equal(frame.detections.xyz, scan.xyz) and frame.detections.fields == scan.fields
    bare = plate.radar_frame(radar, at=(0, 0, 0), seed=1, cube=False)
    assert bare.cube is None and bare.range_m is None and "detections alone" in repr(bare)
    with pytest.raises(ec.ArgumentError, match="cube"):
        bare.image("range_doppler")


def test_files_hold_the_arrays(frame: ec.RadarFrame, tmp_path: Path) -> None:
    assert frame.write(tmp_path / "frame.npz") == [] and frame.write(tmp_path / "adc.bin") == []
    kept = np.load(tmp_path / "frame.npz")
    assert frame.cube is not None and np.array_equal(kept["cube"], frame.cube)
    assert frame.samples is not None and np.array_equal(kept["adc"], frame.samples)
    assert (tmp_path / "adc.bin").stat().st_size == 2 * frame.samples.size


def test_images_show_power(frame: ec.RadarFrame) -> None:
    doppler, fan = frame.image("range_doppler"), frame.image("range_azimuth", width=400)
    assert doppler.kind == "range_doppler" and fan.kind == "polar_fan"
    # Its strongest pixel is ahead, at the range of the target.
    row, column = np.unravel_index(np.nanargmax(fan.values), fan.values.shape)
    right, ahead = fan.coordinates(int(column), int(row))
    assert abs(np.hypot(right, ahead) - DISTANCE) < 1 and abs(np.arctan2(right, ahead)) < 0.15
    assert frame.png("range_azimuth", width=400).startswith(b"\x89PNG")
    with pytest.raises(ec.ArgumentError, match="polar"):
        frame.image("polar")
    with pytest.raises(ec.ArgumentError, match="range_doppler, range_azimuth, polar"):
        frame.image("top")


def test_other_sensors_and_cancelling(plate: ec.Scene, radar: ec.Sensor) -> None:
    with pytest.raises(ec.Error, match="radar"):
        plate.radar_frame("velodyne_vlp16", at=(0, 0, 0))
    with pytest.raises(ec.CancelledError):
        plate.radar_frame(radar, at=(0, 0, 0), progress=lambda done: False)
    live = ec.LiveScene(plate)
    same = live.radar_frame(radar, at=(0, 0, 0), seed=1)
    once = plate.radar_frame(radar, at=(0, 0, 0), seed=1)
    assert same.cube is not None and once.cube is not None and np.array_equal(same.cube, once.cube)
