//! Every language has every option of a scan, with the same default, or it says here why not.

use crate::common::stdout;
use echocast::{ScanOptions, Scenario};
use std::fs;
use std::path::Path;

/// How an option is provided that does not have its name.
#[derive(Clone, Copy)]
enum Provided {
    /// Under this name.
    As(&'static str),
    /// Not at all, for this reason.
    Not(&'static str),
}

use Provided::{As, Not};

const BY_FRAMES: Provided = Not("frames are selected by their numbers, their rate and a trajectory");
const UNTIL_REQUIRED: Provided = Not("no user of it has required it");

/// Fields of `echocast_scan_desc`.
const IN_C: &[(&str, Provided)] = &[
    ("fields", As("columns")),
    ("strip", UNTIL_REQUIRED),
    ("time_budget", As("time_budget_ns")),
    ("start_time", As("t0_ns")),
    ("trajectory_time", Not("the poses have times of the same clock as t0_ns")),
    ("frame_period", As("frame_period_ns")),
    ("reflectance_source", As("reflectance")),
    ("specular_depth", UNTIL_REQUIRED),
    ("estimated_trajectory", UNTIL_REQUIRED),
    ("clock_offset", UNTIL_REQUIRED),
];

/// Options of the program.
const IN_PROGRAM: &[(&str, Provided)] = &[
    ("frame", BY_FRAMES),
    ("start_time", BY_FRAMES),
    ("trajectory_time", BY_FRAMES),
    ("frame_period", BY_FRAMES),
    ("coordinates", As("frame")),
    ("image_boxes", Not("--annotations requests them")),
    ("mask", Not("--hide leaves objects out by name")),
    ("specular_depth", UNTIL_REQUIRED),
    ("time_budget", As("realtime")),
    ("environment", As("env")),
    ("estimated_trajectory", As("navigation")),
    ("clock_offset", Not("`navigation.time_offset_s` sets it")),
];

/// Keys of a scenario.
const IN_SCENARIO: &[(&str, Provided)] = &[
    ("frame", BY_FRAMES),
    ("strip", Not("`strips` numbers them")),
    ("start_time", BY_FRAMES),
    ("trajectory_time", BY_FRAMES),
    ("frame_period", BY_FRAMES),
    ("coordinates", As("frame")),
    ("boxes", Not("the styles of `outputs` request them")),
    ("box_time", As("boxes")),
    ("image_boxes", Not("the styles of `outputs` request them")),
    ("mask", Not("`scene.hide` leaves objects out by name")),
    ("time_budget", Not("data that a machine's speed changes cannot be repeated")),
    ("specular_depth", UNTIL_REQUIRED),
    ("estimated_trajectory", As("navigation")),
    ("clock_offset", Not("`navigation.time_offset_s` sets it")),
];

/// A default as the table of the library gives it.
enum Default {
    /// A number, `false`, or the name of a value.
    Word(String),
    /// All bits of a mask.
    AllBits,
    /// None, or that of another table.
    Other,
}

impl Default {
    fn of(expression: &str) -> Default {
        match expression.rsplit_once("::") {
            Some((_, "MAX")) => Default::AllBits,
            Some((_, "default()")) => Default::Other,
            Some((_, variant)) => Default::Word(variant.to_lowercase()),
            None if expression == "None" => Default::Other,
            None => Default::Word(expression.trim_end_matches(".0").to_owned()),
        }
    }
}

fn file(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)).unwrap()
}

/// What is in `text` between `from` and the next `to`.
fn between<'a>(text: &'a str, from: &str, to: &str) -> Option<&'a str> {
    Some(text.split_once(from)?.1.split_once(to)?.0)
}

/// Compares the options with those of `place`: `default_of` is the default there of an option by its name there, if it
/// is there; `expected` what the default must be, `None` for any.
fn compare(
    place: &str,
    provided: &[(&str, Provided)],
    default_of: impl Fn(&str) -> Option<String>,
    expected: impl Fn(&str, &Default) -> Option<String>,
) {
    for (option, _) in provided {
        assert!(ScanOptions::OPTIONS.iter().any(|known| known.name == *option), "there is no option {option}");
    }
    for option in ScanOptions::OPTIONS {
        let name = match provided.iter().find(|(name, _)| *name == option.name) {
            None => option.name,
            Some((_, As(name))) => name,
            Some((_, Not(why))) => {
                let of_other = provided.iter().any(|(_, other)| matches!(other, As(name) if *name == option.name));
                let absent = of_other || default_of(option.name).is_none();
                assert!(absent, "the option {} is in {place}, but said to be missing: {why}", option.name);
                continue;
            }
        };
        let Some(found) = default_of(name) else {
            let (kind, meaning) = (option.kind, option.meaning);
            panic!("the option {} ({kind}:{meaning}) is missing from {place}: `{name}` is not there", option.name);
        };
        if let Some(expected) = expected(name, &Default::of(option.default)) {
            assert_eq!(found, expected, "default of the option {} in {place}", option.name);
        }
    }
}

#[test]
fn c_and_cpp_have_the_options_of_a_scan() {
    let header = file("include/echocast.h");
    let fields = between(&header, "typedef struct echocast_scan_desc {", "\n}").unwrap();
    let fields = fields.lines().filter(|line| line.ends_with(';')).map(|line| {
        let name = line.trim_end_matches(';').rsplit([' ', '*']).next().unwrap();
        name.to_owned()
    });
    let initial = between(&header, "#define ECHOCAST_SCAN_DESC_INIT", "}").unwrap();
    let initial = initial.split_once('{').unwrap().1.split(',').map(|value| value.trim().to_owned());
    let defaults: Vec<(String, String)> = fields.zip(initial).collect();
    let default_of = |name: &str| defaults.iter().find(|(field, _)| field == name).map(|(_, value)| value.clone());
    let expected = |name: &str, default: &Default| {
        Some(match default {
            Default::AllBits => "0xffffffffu".to_owned(),
            Default::Word(word) if word.parse::<f64>().is_ok() => word.clone(),
            Default::Word(word) if word != "false" => {
                let constant = format!("#define ECHOCAST_{}_{} ", name.to_uppercase(), word.to_uppercase());
                between(&header, &constant, "\n").unwrap_or_else(|| panic!("there is no {constant}")).to_owned()
            }
            Default::Word(_) | Default::Other => "0".to_owned(),
        })
    };
    compare("include/echocast.h (echocast_scan_desc)", IN_C, default_of, expected);

    // C++ scans with the structure of C.
    assert!(file("include/echocast.hpp").contains("scan(const snapshot &snapshot, const echocast_scan_desc &desc,"));
    let binding = file("crates/echocast-capi/src/scan.rs");
    let read = |name: &str| binding.contains(&format!("desc.{name}")).then(String::new);
    compare("crates/echocast-capi/src/scan.rs", IN_C, read, |_, _| None);
}

#[test]
fn python_has_the_options_of_a_scan() {
    let stub = file("bindings/python/echocast/_echocast.pyi");
    let class = between(&stub, "class ScanOptions(TypedDict, total=False):", "\n\n").unwrap();
    let typed = |name: &str| class.contains(&format!("\n    {name}: ")).then(String::new);
    compare("bindings/python/echocast/_echocast.pyi (ScanOptions)", &[], typed, |_, _| None);

    let binding = file("bindings/python/src/options.rs");
    let converted = |name: &str| binding.contains(&format!("\n                \"{name}\" => ")).then(String::new);
    compare("bindings/python/src/options.rs (ScanRequest::of)", &[], converted, |_, _| None);

    let methods = file("bindings/python/src/scene.rs");
    let about = between(&methods, "/// Scans the scene with `sensor`", "#[pyo3").unwrap().replace("\n    ///", "");
    let default_of = |name: &str| {
        let meaning = between(&about, &format!(" * `{name}`:"), " * `")?.split_whitespace().collect::<Vec<_>>();
        Some(meaning.join(" ").rsplit_once("Default: ")?.1.trim_end_matches('.').to_owned())
    };
    let expected = |_: &str, default: &Default| match default {
        Default::AllBits => Some("all bits".to_owned()),
        Default::Word(word) if word == "false" => Some("False".to_owned()),
        Default::Word(word) if word.parse::<f64>().is_ok() => Some(word.clone()),
        Default::Word(word) => Some(format!("{word:?}")),
        Default::Other => None,
    };
    compare("bindings/python/src/scene.rs (Scene.scan)", &[], default_of, expected);
}

#[test]
fn the_program_has_the_options_of_a_scan() {
    let help = stdout(Path::new("."), "scan --help");
    let default_of = |name: &str| {
        let flag = format!("--{}", name.replace('_', "-"));
        let is_flag = |line: &&str| line.trim_start().split([' ', ',']).any(|word| word == flag);
        let mut lines = help.lines().skip_while(|line| !(line.trim_start().starts_with('-') && is_flag(line)));
        let takes_value = lines.next()?.contains('<');
        let about = lines.take_while(|line| !line.trim_start().starts_with("--"));
        let default = about.filter_map(|line| between(line, "[default: ", "]")).last();
        Some(if takes_value { default.unwrap_or_default().to_owned() } else { "false".to_owned() })
    };
    let expected = |_: &str, default: &Default| match default {
        Default::Word(word) => Some(word.clone()),
        Default::AllBits | Default::Other => None,
    };
    compare("echocast scan --help", IN_PROGRAM, default_of, expected);
}

#[test]
fn scenarios_have_the_options_of_a_scan() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("wall.obj"), "v 5 -1 0\nv 5 1 0\nv 5 0 2\nf 1 2 3\n").unwrap();
    // The options of a scan of a scenario with this line in addition.
    let options = |line: &str| -> echocast::Result<String> {
        let text = format!(
            "scene: {{files: wall.obj}}\nsensors: [{{sensor: velodyne_vlp16}}]\ntrajectory: {{position_m: [0, 0, 1]}}\n{line}\n"
        );
        let sample = Scenario::from_yaml(&text, folder.path())?.sample(0)?;
        Ok(format!("{:?}", sample.scans()[0].options(0)))
    };
    let plain = options("").unwrap();
    // The default is that of the library if setting it changes nothing.
    let default_of = |name: &str| {
        let option = ScanOptions::OPTIONS.iter().find(|option| {
            let provided = IN_SCENARIO.iter().find(|(known, _)| *known == option.name);
            match provided {
                Some((_, As(key))) => *key == name,
                Some((_, Not(_))) => false,
                None => option.name == name,
            }
        });
        let value = match option.map(|option| Default::of(option.default)) {
            Some(Default::Word(word)) => word,
            _ if name == "fields" => "default".to_owned(),
            _ => "null".to_owned(),
        };
        let found = options(&format!("{name}: {value}")).ok()?;
        Some(if found == plain { value } else { found })
    };
    let expected = |_: &str, default: &Default| match default {
        Default::Word(word) => Some(word.clone()),
        Default::AllBits | Default::Other => None,
    };
    compare("the keys of scenarios (scenario/spec.rs)", IN_SCENARIO, default_of, expected);
    let page = file("docs/scenario.md");
    let is_named = |name: &str| [format!("`{name}`"), format!("`{name}: ")].iter().any(|text| page.contains(text));
    compare("docs/scenario.md", IN_SCENARIO, |name| is_named(name).then(String::new), |_, _| None);
}
