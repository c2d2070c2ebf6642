"""Reads files of sonar pings and of their images with readers that have nothing to do with echocast, prints JSON.

usage: pings.py FILE...

One list element per file: for each array its type, shape and values as text, row by row. Arrays of XTF and KMALL have the
names of the structures' members.
"""

import json
import sys
import warnings

import h5py
import numpy
import pyxtf
from KMALL import kmall


def xtf(path):
    """What pyxtf finds."""
    # Packets that it does not know are warnings; so is a ping without soundings.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        header, packets = pyxtf.xtf_read(path)
    kind = pyxtf.XTFHeaderType
    assert set(packets) <= {kind.sonar, kind.bathy_xyza} and len(packets) == 1, packets.keys()
    pings = next(iter(packets.values()))
    channels = header.ChanInfo[: header.channel_count()]
    found = {
        "program": header.RecordingProgramName.decode(),
        "note": header.NoteString.decode(),
        "NavUnits": header.NavUnits,
        "channels": [info.ChannelName.decode() for info in channels],
        "time": [(ping.get_time() - numpy.datetime64(0, "s")) / numpy.timedelta64(1, "s") for ping in pings],
    }
    for member in ("TypeOfChannel", "Frequency", "TiltAngle"):
        found[f"channel_{member}"] = [getattr(info, member) for info in channels]
    for member in (
        "PingNumber SoundVelocity ComputedSoundVelocity SensorXcoordinate SensorYcoordinate SensorDepth ShipXcoordinate "
        "SensorPrimaryAltitude SensorPitch SensorRoll SensorHeading AttitudeTimeTag NumChansToFollow NumBytesThisRecord"
    ).split():
        found[member] = [getattr(ping, member) for ping in pings]
    if kind.sonar in packets:
        found["samples"] = [ping.data for ping in pings]
        for member in ("SlantRange", "GroundRange", "TimeDuration", "SecondsPerPing", "Frequency", "NumSamples"):
            found[member] = [[getattr(side, member) for side in ping.ping_chan_headers] for ping in pings]
        # As its users lay sides out: newest first, port on the left.
        sides = [pyxtf.concatenate_channel(pings, header, side) for side in range(len(channels))]
        found["waterfall"] = numpy.hstack(sides)[::-1]
    else:
        found["soundings"] = [len(ping.data) for ping in pings]
        for member in ("dPosOffsetTrX", "dPosOffsetTrY", "fDepth", "dTime", "usAmpl", "ucQuality"):
            found[member] = [getattr(sounding, member) for ping in pings for sounding in ping.data]
    return found


def kongsberg(path):
    """What pykmall finds."""
    file = kmall(path)
    file.index_file()
    kinds = [kind[3:6] for kind in file.msgtype]
    assert sum(file.msgsize) == file.file_size
    assert kinds == ["IIP"] + ["SKM", "MRZ", "MWC"] * (len(kinds) // 3), kinds
    found = {"MRZ_time": [], "SKM_time": [], "samples": []}

    def add(names, of, before=""):
        for name in names.split():
            found.setdefault(before + name, []).append(of[name])

    for kind, offset in zip(kinds, file.msgoffset):
        file.FID.seek(offset)
        read = getattr(file, f"read_EMdgm{kind}")()
        if kind == "IIP":
            installed = file.translate_installation_parameters_todict(read["install_txt"])
            found["installed"] = [installed["waterline_vertical_location"], installed["active_heading_sensor"]]
        elif kind == "SKM":
            sample = read["sample"]["KMdefault"]
            found["SKM_time"] += sample["dgtime"]
            add("latitude_deg longitude_deg roll_deg pitch_deg heading_deg ellipsoidHeight_m", sample, "SKM_")
        elif kind == "MRZ":
            found["MRZ_time"].append(read["header"]["dgtime"])
            add("pingCnt", read["cmnPart"])
            add(
                "latitude_deg longitude_deg headingVessel_deg soundSpeedAtTxDepth_mPerSec txTransducerDepth_m "
                "z_waterLevelReRefPoint_m frequencyMode_Hz pingRate_Hz",
                read["pingInfo"],
            )
            add("centreFreq_Hz", read["txSectorInfo"])
            add("numSoundingsValidMain WCSampleRate", read["rxInfo"])
            add(
                "detectionType detectionMethod detectionConfidenceLevel WCBeamNumb WCrange_samples reflectivity1_dB "
                "WCNomBeamAngleAcross_deg beamAngleReRx_deg twoWayTravelTime_sec deltaLatitude_deg deltaLongitude_deg "
                "z_reRefPoint_m y_reRefPoint_m x_reRefPoint_m",
                read["sounding"],
            )
        else:
            add("sampleFreq_Hz soundVelocity_mPerSec TVGoffset_dB TVGfunctionApplied", read["rxInfo"])
            beams = read["beamData"]
            add("beamPointAngReVertical_deg detectedRangeInSamplesHighResolution startRangeSampleNum", beams)
            found["samples"].append(beams["sampleAmplitude05dB_p"])
    found["lon_lat_z"] = file.extractLonLatZ()
    file.closeFile()
    return found


def arrays(path):
    for ending, reader in ((".xtf", xtf), (".kmall", kongsberg)):
        if path.endswith(ending):
            return {name: numpy.asarray(values) for name, values in reader(path).items()}
    if path.endswith(".npz"):
        with numpy.load(path) as file:
            return dict(file)
    with h5py.File(path) as file:
        for name, dataset in file.items():
            text = h5py.check_string_dtype(dataset.dtype)
            assert text or name.endswith("_ids") or dataset.attrs["meaning"], name
        read = {k: d.asstr()[()] if h5py.check_string_dtype(d.dtype) else d[()] for k, d in file.items()}
        return {name: numpy.asarray(value) for name, value in read.items()}


def plain(array):
    text = array.dtype.kind in "UO"
    kind = "text" if text else array.dtype.str.lstrip("<|")
    values = [str(value) if text else repr(value) for value in array.ravel().tolist()]
    return {"type": kind, "shape": list(array.shape), "values": values}


json.dump([{name: plain(array) for name, array in arrays(path).items()} for path in sys.argv[1:]], sys.stdout)
