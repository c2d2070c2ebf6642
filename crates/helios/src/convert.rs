//! A survey as a scenario, sensors and a trajectory.

use crate::beams::{HeadTurn, LegBeams};
use crate::flight::{Flight, FlownLeg, note_settings};
use crate::ground_height::GroundMesh;
use crate::notes::NoteBook;
use crate::pattern::{ChannelGroup, HeadPlan, SensorPattern, groups, raised_deg};
use crate::platform::HeliosMovement;
use crate::scanner::{HeliosChannel, HeliosOptics};
use crate::scene::HeliosPart;
use crate::surfaces::{self, MtlSurface, MtlSurfaces};
use crate::survey::HeliosSurvey;
use crate::turning::{rpy_deg, with_our_axes};
use glam::{DQuat, DVec3};
use ground::error::{Error, Result};
use ground::pose::Pose;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, HashMap};

/// What a survey becomes.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Converted {
    /// The scenario; its trajectory is the file `trajectory.csv`, and its sensors are the files below.
    pub scenario: Value,
    /// Name and contents of each sensor file.
    pub sensors: Vec<(String, Value)>,
    /// Times from 0, s, and poses of the carrier, x ahead, y left, z up.
    pub trajectory: Vec<(f64, Pose)>,
}

/// Names of ASPRS classes (LAS 1.4 R15, table 17), which categories have.
const CLASSES: [(u8, &str); 12] = [
    (1, "unclassified"),
    (2, "ground"),
    (3, "low_vegetation"),
    (4, "medium_vegetation"),
    (5, "high_vegetation"),
    (6, "building"),
    (9, "water"),
    (10, "rail"),
    (11, "road"),
    (14, "wire"),
    (15, "tower"),
    (17, "bridge"),
];

/// Names of spectra of HELIOS++, and the materials here that are most like them.
const SPECTRA: [(&str, &str); 8] = [
    ("asphalt", "asphalt_dry"),
    ("concrete", "concrete"),
    ("conifer", "needle"),
    ("deciduous", "leaf"),
    ("grass", "grass"),
    ("shingle_red", "roof_tile"),
    ("soil", "soil"),
    ("wood", "wood"),
];

/// Speed of light in air, m/ns, over 2: distance for a time there and back (CODATA c over 1.000277).
const M_PER_NS: f64 = 0.149_854;

/// Full width at half maximum of a pulse of HELIOS++ over its length: of (t/tau)^2 e^(-t/tau), 3.39467 tau, with a tau of
/// a seventh of the length (WaveMaths.cpp, SingleScanner.cpp, 3dgeo-heidelberg/helios fd94d1f).
const FWHM_OF_LENGTH: f64 = 0.484_953;

impl Converted {
    /// Converts `survey`, and notes what is approximated.
    pub(crate) fn of(survey: &HeliosSurvey, notes: &NoteBook) -> Result<Converted> {
        let surfaces = survey.scene.parts.iter().map(|part| {
            let files = part.files.iter().map(|file| surfaces::of_mesh(file)).collect::<Result<Vec<MtlSurfaces>>>()?;
            Ok((part, files))
        });
        let parts: Vec<(&HeliosPart, Vec<MtlSurfaces>)> = surfaces.collect::<Result<_>>()?;
        if parts.is_empty() {
            let place = survey.scene.place;
            let message =
                format!("scene has nothing but parts of {}, which are not read yet", survey.scene.others.join(", "));
            return Err(Error::parse(notes.path(place), format!("line {}", place.line), message));
        }
        let on_ground = survey.legs.iter().any(|leg| leg.platform.flag("onGround") == Some(true));
        let ground = if on_ground { GroundMesh::load(&parts)? } else { GroundMesh::default() };

        let channels = &survey.scanner.channels;
        let mut beams: Vec<Vec<LegBeams>> = Vec::new();
        for channel in channels {
            let of_leg = |leg| LegBeams::of(&survey.scanner, channel, leg, notes);
            beams.push(survey.legs.iter().map(of_leg).collect::<Result<_>>()?);
        }
        let heads: Vec<HeadTurn> = beams[0].iter().map(|beams| beams.head).collect();
        let plan = head_plan(survey, &beams, &heads);
        note_settings(survey, notes);
        let mut flight = Flight::of(survey, &heads, plan, &|x, y| ground.height(x, y), notes)?;
        let mount = survey.platform.mount;
        if plan == HeadPlan::OfTrajectory {
            flight.turn_with(&heads, mount.rotation, survey.scanner.head_axis)?;
            for leg in &survey.legs {
                if let Some(place) = leg.scanner.place("headRotatePerSec_deg") {
                    notes.approximated(place, "headRotatePerSec_deg", "the trajectory turns with the head");
                }
            }
        }
        let fixed_head = match plan {
            HeadPlan::Fixed(angle) => DQuat::from_axis_angle(survey.scanner.head_axis, angle.to_radians()),
            _ => DQuat::IDENTITY,
        };
        let mounted = mount.rotation * fixed_head;
        // As there, offsets do not turn with the platform (Platform.cpp and ScanningDevice.cpp, fd94d1f).
        let offset = mount.offset + channels[0].origin.offset;
        let trajectory = flight.keys.iter().map(|(time, pose)| {
            (*time, Pose { position: pose.position + offset, orientation: with_our_axes(pose.orientation) })
        });
        let trajectory: Vec<(f64, Pose)> = trajectory.collect();
        let rig = Rig { survey, beams: &beams, plan, flight: &flight, mounted, notes };
        let RigFiles { sensors, entries, changes } = rig.sensors()?;
        let mut scenario = json!({"scene": scene(&parts, notes)});
        if let Some(visibility) = survey.scanner.visibility_m {
            scenario["environment"] = json!({"clear_air": {"visibility_m": visibility}});
        }
        scenario["sensors"] = entries.into();
        scenario["trajectory"] = json!({"file": "trajectory.csv"});
        scenario["strips"] = strips(survey, &flight, changes)?.into();
        if let Some(seed) = survey.seed {
            scenario["seed"] = seed.into();
        }
        if survey.runs > 1 {
            scenario["samples"] = survey.runs.into();
        }
        scenario["outputs"] = json!([{"style": "plain", "format": "laz"}]);
        Ok(Converted { scenario, sensors, trajectory })
    }
}

/// What turns the beams besides the mirrors: as much as patterns can do.
fn head_plan(survey: &HeliosSurvey, beams: &[Vec<LegBeams>], heads: &[HeadTurn]) -> HeadPlan {
    let moves_last = matches!(survey.platform.movement, HeliosMovement::Static | HeliosMovement::Interpolated);
    let count = survey.legs.len() - usize::from(!moves_last && survey.legs.len() > 1);
    let is_on = |leg: &usize| survey.legs[*leg].scanner.flag("active") != Some(false);
    let on: Vec<usize> = (0..count).filter(is_on).collect();
    let first = on.first().map_or(0.0, |leg| heads[*leg].from_deg);
    let stands = |head: &HeadTurn| head.rate_deg_s == 0.0 && head.from_deg == first;
    if on.iter().all(|leg| stands(&heads[*leg])) {
        return HeadPlan::Fixed(first);
    }
    let channels = &survey.scanner.channels;
    let upright = survey.scanner.head_axis.distance(DVec3::Z) < 1e-9;
    let turns = |leg: &usize| heads[*leg].rate_deg_s != 0.0;
    let mirror_stands = beams.iter().flat_map(|of| on.iter().map(|leg| of[*leg].scan_rate_hz)).all(|rate| rate == 0.0);
    let rotating = channels.iter().all(|channel| channel.optics == HeliosOptics::Rotating);
    if upright && rotating && mirror_stands && on.iter().all(turns) {
        return HeadPlan::Spinning;
    }
    let is_plain = |channel: &HeliosChannel| match (&channel.optics, raised_deg(channel.origin.rotation)) {
        (HeliosOptics::Rotating, Some(raised)) => raised.abs() <= 180.0,
        (HeliosOptics::Oscillating { .. } | HeliosOptics::Line { .. }, Some(raised)) => raised == 0.0,
        _ => false,
    };
    if upright && channels.iter().all(is_plain) && on.iter().all(|leg| heads[*leg].rate_deg_s > 0.0) {
        return HeadPlan::OfPattern;
    }
    HeadPlan::OfTrajectory
}

/// Keys that change on each flown leg.
type LegChanges = Vec<Map<String, Value>>;

/// What the sensors become.
struct RigFiles {
    /// Name and contents of each sensor file.
    sensors: Vec<(String, Value)>,
    /// Entries of the scenario.
    entries: Vec<Value>,
    changes: LegChanges,
}

/// What the sensors are made from.
struct Rig<'s> {
    survey: &'s HeliosSurvey,
    /// By channel, then by leg.
    beams: &'s [Vec<LegBeams>],
    plan: HeadPlan,
    flight: &'s Flight,
    /// Rotation of the head's mount on the platform.
    mounted: DQuat,
    notes: &'s NoteBook,
}

impl Rig<'_> {
    /// The sensor files, the entries of the scenario, and what changes on each flown leg.
    fn sensors(&self) -> Result<RigFiles> {
        let all = groups(&self.survey.scanner.channels, self.plan);
        let base = file_name(&self.survey.scanner.id);
        let (mut files, mut entries) = (Vec::new(), Vec::new());
        let legs = &self.flight.legs;
        let mut patterns: Vec<Vec<Value>> = Vec::new();
        for (index, group) in all.iter().enumerate() {
            let name = if all.len() == 1 { base.clone() } else { format!("{base}_{}", index + 1) };
            let channel_index = self.index_of(group);
            let pattern = |leg: &FlownLeg| {
                SensorPattern::of(group, self.mounted, self.plan, &self.beams[channel_index][leg.leg], leg.from_s)
            };
            let first = pattern(&legs[0]);
            patterns.push(legs.iter().map(|leg| pattern(leg).value).collect());
            let mut value = self.sensor(&name, group, channel_index);
            value["pattern"] = self.with_rates(first.value, channel_index);
            // Where it is on the carrier, whose position is that of the first channel.
            let aside = group.channels[0].origin.offset - self.survey.scanner.channels[0].origin.offset;
            let mut entry = json!({"name": name, "sensor": format!("{name}.yaml")});
            let [roll, pitch, yaw] = rpy_deg(first.mount);
            let mut mount = Map::new();
            if aside != DVec3::ZERO {
                // Ahead is their y.
                mount.insert("position_m".into(), json!([aside.y, -aside.x, aside.z]));
                let how = "offsets between channels turn with the platform";
                let origin = group.channels[0].place;
                self.notes.approximated(origin, "id", how);
            }
            if [roll, pitch, yaw] != [0.0; 3] {
                mount.insert("rpy_deg".into(), json!([roll, pitch, yaw]));
            }
            if !mount.is_empty() {
                entry["mount"] = mount.into();
            }
            files.push((name, ordered(value)));
            entries.push(entry);
        }
        let changes = (0..legs.len()).map(|flown| self.changes(&patterns, flown)).collect::<Result<_>>()?;
        Ok(RigFiles { sensors: files, entries, changes })
    }

    /// Number of the first channel of a group.
    fn index_of(&self, group: &ChannelGroup) -> usize {
        let first = |channel: &HeliosChannel| std::ptr::eq(channel, group.channels[0]);
        self.survey.scanner.channels.iter().position(first).unwrap_or(0)
    }

    /// The keys in which patterns, by sensor and flown leg, differ on a leg from those of the first, and the divergence of
    /// the leg.
    ///
    /// # Errors
    /// Sensors that do not change alike, as strips change all of them.
    fn changes(&self, patterns: &[Vec<Value>], flown: usize) -> Result<Map<String, Value>> {
        let leg = self.flight.legs[flown].leg;
        let mut changes = Map::new();
        let keys =
            patterns.iter().flat_map(|own| own[flown].as_object().into_iter().flatten().map(move |entry| (own, entry)));
        for (_, (key, value)) in keys.filter(|(own, (key, value))| own[0].get(key) != Some(value)) {
            if patterns.iter().any(|other| other[flown].get(key) != Some(value)) {
                let place = self.survey.legs[leg].place;
                let message = format!("leg changes {key} of its channels in different ways; allowed: the same for all");
                return Err(Error::parse(self.notes.path(place), format!("line {}", place.line), message));
            }
            changes.insert(format!("pattern.{key}"), value.clone());
        }
        if let Some(divergence) = self.beams[0][leg].divergence_rad {
            changes.insert("beam.divergence_mrad".into(), json!([divergence * 1000.0, divergence * 1000.0]));
        }
        Ok(changes)
    }

    /// A pattern with the pulse rates of the instrument, if all that are used are among them.
    fn with_rates(&self, mut pattern: Value, channel: usize) -> Value {
        let rates = &self.survey.scanner.pulse_rates_hz;
        let known = self.beams[channel].iter().all(|beams| rates.contains(&beams.pulse_rate_hz));
        let direct = pattern["pulse_rate_hz"].as_f64().is_some_and(|rate| rates.contains(&rate));
        // Of mirrors that turn more than once a line, only a part of the pulses may be there.
        let whole = self.survey.scanner.channels[channel].half_deg <= 180.0;
        if pattern["type"] == "line_scan" && known && direct && whole {
            pattern["settings"] = json!({"pulse_rates_hz": rates});
        }
        pattern
    }

    /// A sensor file without its pattern.
    fn sensor(&self, name: &str, group: &ChannelGroup, channel: usize) -> Value {
        let (survey, of) = (self.survey, group.channels[0]);
        let sampling = of.sampling;
        // prepareSimulation in ScanningDevice.cpp (fd94d1f): rings of as many rays as fit, about one in the middle.
        let rays = 1 + (1..sampling.quality).map(|ring| (std::f64::consts::TAU * f64::from(ring)) as u32).sum::<u32>();
        let rays = rays.min(1024);
        let divergence = of.divergence_rad * 1000.0;
        let window = sampling.window_ns.unwrap_or(of.pulse_ns / 4.0);
        let most = if of.most_returns == 0 { rays.min(255) } else { of.most_returns.min(255) };
        let tidy = |value: f64| (value * 1e6).round() / 1e6;
        let mut range = json!({"min_m": of.range_min_m});
        if let Some(max) = of.range_max_m.filter(|max| *max > of.range_min_m) {
            range["max_m"] = max.into();
        }
        let settings = self.flight.legs.first().map(|leg| self.beams[channel][leg.leg].pulse_rate_hz);
        json!({
            "name": name,
            "title": survey.scanner.name,
            "kind": "lidar",
            "source": format!("{} of a survey of HELIOS++{}", survey.scanner.id,
                settings.map_or(String::new(), |rate| format!(", {} kHz", rate / 1000.0))),
            "beam": {
                "wavelength_nm": of.wavelength_nm, "divergence_mrad": [tidy(divergence), tidy(divergence)],
                "pulse_ns": tidy(of.pulse_ns * FWHM_OF_LENGTH), "sub_rays": rays,
            },
            "range": range,
            "returns": {"mode": "all", "max": most, "separation_m": tidy(window * M_PER_NS)},
            "noise": {"range_sigma_m": of.accuracy_m},
        })
    }
}

/// A sensor file with its keys in the order in which people write them.
fn ordered(mut value: Value) -> Value {
    let mut sorted = Map::new();
    for key in ["name", "title", "kind", "source", "pattern", "beam", "range", "returns", "noise"] {
        if let Some(section) = value.as_object_mut().and_then(|keys| keys.remove(key)) {
            sorted.insert(key.to_owned(), section);
        }
    }
    sorted.into()
}

/// `id` as the name of a file.
fn file_name(id: &str) -> String {
    let name: String =
        id.chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).take(60).collect();
    let name = name.trim_matches('_').to_ascii_lowercase();
    if name.is_empty() { "scanner".to_owned() } else { name }
}

/// The key `strips`: one for each flown leg; those of one strip have its number.
fn strips(survey: &HeliosSurvey, flight: &Flight, changes: LegChanges) -> Result<Vec<Value>> {
    let mut numbers: HashMap<&str, usize> = HashMap::new();
    let mut used = 0;
    let mut strips: Vec<Value> = Vec::new();
    // As a strip that follows its own without a gap is the same strip, entries are merged.
    for (leg, set) in flight.legs.iter().zip(changes) {
        let number = match survey.legs[leg.leg].strip.as_deref() {
            Some(name) => *numbers.entry(name).or_insert_with(|| {
                used += 1;
                used
            }),
            None => {
                used += 1;
                used
            }
        };
        if number > usize::from(u16::MAX) {
            return Err(Error::invalid("legs", used, "up to 65535 strips"));
        }
        let set = Value::from(set);
        if let Some(last) = strips.last_mut() {
            let same = last["strip"] == number && last.get("set").unwrap_or(&json!({})) == &set;
            if same && last["to_s"].as_f64().is_some_and(|end| leg.from_s - end < 2e-3) {
                last["to_s"] = leg.to_s.into();
                continue;
            }
        }
        let mut strip = json!({"strip": number, "from_s": leg.from_s, "to_s": leg.to_s});
        if set.as_object().is_some_and(|set| !set.is_empty()) {
            strip["set"] = set;
        }
        strips.push(strip);
    }
    Ok(strips)
}

/// The key `scene`.
fn scene(parts: &[(&HeliosPart, Vec<MtlSurfaces>)], notes: &NoteBook) -> Value {
    let mut place = Vec::new();
    let mut materials: BTreeMap<String, Value> = BTreeMap::new();
    let mut classes: BTreeMap<String, Value> = BTreeMap::new();
    let mut contradicted = Vec::new();
    for (part, surfaces) in parts {
        let several = part.files.len() > 1;
        for (file, surfaces) in part.files.iter().zip(surfaces) {
            let stem = file.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
            let name = if several || part.name.parse::<u64>().is_ok() {
                format!("{stem}_{}", part.name)
            } else {
                part.name.clone()
            };
            let mut model = json!({"model": file.to_string_lossy(), "name": name});
            let mut at = Map::new();
            if part.offset != DVec3::ZERO {
                at.insert("position_m".into(), json!(part.offset.to_array()));
            }
            let turned = rpy_deg(part.rotation);
            if turned != [0.0; 3] {
                at.insert("rpy_deg".into(), json!(turned));
            }
            if !at.is_empty() {
                model["at"] = at.into();
            }
            if part.scale != 1.0 {
                model["scale"] = part.scale.into();
            }
            let mut own: Vec<u8> =
                surfaces.values().filter_map(|surface| surface.class).filter(|class| *class > 0).collect();
            own.dedup();
            if let Some(class) = own.first() {
                let known = CLASSES.iter().find(|(number, _)| number == class);
                let category = known.map_or_else(|| format!("class_{class}"), |(_, name)| (*name).to_owned());
                classes.insert(category.clone(), (*class).into());
                model["category"] = category.into();
                if own.iter().any(|other| other != class) {
                    notes.approximated(
                        part.place,
                        "",
                        format!("all of it has helios_classification {class}, the first of its materials'"),
                    );
                }
            }
            place.push(model);
            for (name, surface) in surfaces {
                let Some(rule) = rule(surface) else { continue };
                if materials.insert(name.clone(), rule.clone()).is_some_and(|other| other != rule) {
                    contradicted.push((part.place, name.clone()));
                }
            }
        }
    }
    for (part, name) in contradicted {
        notes.approximated(
            part,
            "",
            format!("the material {name} is another one in another file: the last one counts"),
        );
    }
    let mut scene = json!({"place": place});
    // Rules of labels apply to models that are placed, too.
    if !classes.is_empty() {
        scene["labels"]["las_class"] = json!(classes);
    }
    if !materials.is_empty() {
        scene["labels"]["surfaces"] = json!(materials);
    }
    scene
}

/// The rule for a material, if HELIOS++ says something about it.
fn rule(surface: &MtlSurface) -> Option<Value> {
    if let Some(reflectance) = surface.reflectance {
        return Some(json!({"reflectance": reflectance}));
    }
    let spectrum = surface.spectrum.as_deref()?;
    let (_, material) = SPECTRA.iter().find(|(name, _)| *name == spectrum)?;
    Some((*material).into())
}
