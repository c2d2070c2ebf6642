//! `echocast generate`

use crate::input::has_ending;
use crate::interrupt;
use crate::report::timed;
use crate::text::{self, counted, duration};
use crate::usage;
use anyhow::{Context as _, Result, anyhow};
use clap::Subcommand;
use echocast::generate::{GeneratedScene, HeightMap, Indoor, Landscape, Ripples, Seabed, Street};
use echocast::{Error, shown};
use std::fmt::Write as _;
use std::path::PathBuf;

/// Generate a labelled scene from rules and a seed, as binary glTF
#[derive(clap::Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  echocast generate indoor --seed 7 -o flat.glb
  echocast generate landscape --seed 7 -o forest.glb
  echocast generate seabed --seed 7 -o lake.glb
  echocast generate street --blocks 3,2 --seed 7 -o town.glb

See `echocast generate KIND --help` for more."
)]
pub struct GenerateArgs {
    #[command(subcommand)]
    kind: SceneKind,
}

/// Options of all kinds of scenes.
#[derive(clap::Args)]
struct MadeArgs {
    /// Seed of all random draws: same seed and options, same file
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// Scene file, .glb
    #[arg(short, long, value_name = "FILE.glb")]
    output: PathBuf,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Subcommand)]
enum SceneKind {
    Indoor(IndoorArgs),
    Seabed(SeabedArgs),
    Street(StreetArgs),
    Landscape(LandscapeArgs),
}

/// A lake bed for sonar: sand, gravel and mud, boulders, wrecks, pipes, mines, sea grass, a school of fish
///
/// The water surface is at z = 0, the bed is centred on the z axis. Categories are seabed, boulder, wreck, pipe, mine,
/// seagrass and fish; the bed has the parts sand, gravel and mud, a wreck hull, cabin and mast. The fish are children
/// of the node Swarm, which an animation moves against the x axis. The camera node Sonar is at the low end of x, just
/// below the surface, and looks along x.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate seabed -o lake.glb
  echocast generate seabed --size 200,80 --depth 25 --boulders 100 --wrecks 3 --seed 7 -o lake.glb
  echocast generate seabed --ripples 0.6,0.05,30 --fish 0 -o ripples.glb
  echocast generate seabed --pipes 1 --mines 6 --seagrass 5 --seed 7 -o harbour.glb
  echocast scan lake.glb --sensor fls_900 --set range.max_m=40 --camera Sonar --preview lake.png --view fan")]
pub struct SeabedArgs {
    /// Extent along x and y, metres
    #[arg(long, value_name = "X,Y", default_value = "60,40", value_parser = two_numbers, allow_hyphen_values = true)]
    size: [f64; 2],
    /// Mean depth of the bed below the surface, metres
    #[arg(long, value_name = "M", default_value_t = 12.0, allow_negative_numbers = true)]
    depth: f64,
    /// Spacing of the grid, metres [default: about 30,000 triangles, more where --ripples needs them]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    cell: Option<f64>,
    /// Ripples of the sand, metres from crest to crest and from trough to crest, and the direction across the crests,
    /// degrees counter-clockwise from x; height 0 means none [default: 0.6,0.05 where the cells are fine enough, in any
    /// direction]
    #[arg(long, value_name = "LENGTH,HEIGHT[,DIRECTION]", value_parser = ripples, allow_hyphen_values = true)]
    ripples: Option<Ripples>,
    /// Boulders of 0.3 to 1.5 m
    #[arg(long, value_name = "N", default_value_t = 20, allow_negative_numbers = true)]
    boulders: u32,
    /// Sunken boats
    #[arg(long, value_name = "N", default_value_t = 1, allow_negative_numbers = true)]
    wrecks: u32,
    /// Fish in the school, about 0.4 m long
    #[arg(long, value_name = "N", default_value_t = 60, allow_negative_numbers = true)]
    fish: u32,
    /// Pipes that lie across the bed
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pipes: u32,
    /// Mines: in turn a cylinder of 2 m, a ball of 1 m with horns, a blunt cone of 1 m
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    mines: u32,
    /// Patches of sea grass, 2 to 5 m wide
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    seagrass: u32,
    #[command(flatten)]
    made: MadeArgs,
}

/// A street, or a town of streets, with houses and trees, driving cars and walking people
///
/// The street runs along x and is 200 m long, a side street crosses it at 0,0; with --blocks there are streets around
/// blocks of houses, a crossing every 100 m along x and 84 m along y, one of them at 0,0. Categories are those of
/// SemanticKITTI: road, lane-marking, parking, sidewalk, terrain, building, fence, vegetation, trunk, pole,
/// traffic-sign (retro-reflectors), car, truck, bicycle, person and other-object. The animation Street moves cars and
/// their wheels, people, the flag and the lamps of the traffic lights. The camera node Lidar is on the roof of a moving
/// car, 1.9 m above the road; Corner is at the crossing at 0,0, 3 m high, and looks along the street.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast generate street --blocks 3,2 --seed 7 -o town.glb
  echocast generate street --cars 10 --people 20 --seconds 20 --seed 7 -o street.glb
  echocast scan street.glb --sensor velodyne_vlp32c --camera Lidar --preview street.png --view perspective")]
pub struct StreetArgs {
    /// Blocks of houses along x and y, 1 to 10 each, with streets around them [default: a single crossing]
    #[arg(long, value_name = "X,Y", value_parser = two_counts, allow_hyphen_values = true)]
    blocks: Option<[u32; 2]>,
    /// Cars that drive, 1 to 10 or, with --blocks, as many as there is room for; others are parked [default: 6, with
    /// --blocks two for each crossing]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    cars: Option<u32>,
    /// People who walk, as many as there is room for [default: 2, with --blocks two for each crossing]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    people: Option<u32>,
    /// Length of the animation, 8 to 30 s; the street is longer if it takes more than 10 s
    #[arg(long, value_name = "S", default_value_t = Street::default().seconds, allow_negative_numbers = true)]
    seconds: f64,
    #[command(flatten)]
    made: MadeArgs,
}

/// A landscape: hills, or a height map, with trees, bushes, grass, rocks, a path and a stream
///
/// The land is centred on the z axis. Categories are terrain, path, water, tree, bush, grass and rock; trees and bushes
/// have the parts trunk, branch and leaf, the terrain turf, soil, rock and sand. Every tree, bush and rock is an
/// instance, grass one for each patch of 24 tufts. The camera node Lidar is 1.8 m above the path, near the middle, and
/// looks along it; Overview looks down from a corner.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate landscape --size 200,200 --seed 7 -o forest.glb
  echocast generate landscape --trees-per-ha 1250 --grass-per-m2 0 --no-path -o wood.glb
  printf 'ncols 3\\nnrows 3\\nxllcorner 0\\nyllcorner 0\\ncellsize 40\\n0 5 9\\n2 12 8\\n1 4 6\\n' > hills.asc
  echocast generate landscape --height-map hills.asc -o hills.glb
  echocast scan forest.glb --sensor velodyne_vlp32c --camera Lidar --preview forest.png --view perspective")]
pub struct LandscapeArgs {
    /// Start from other values than the defaults: paper, the landscape of the paper (hills with trees, rocks and grass)
    #[arg(long, value_name = "NAME")]
    preset: Option<Preset>,
    /// Extent along x and y, metres; that of the height map if its file defines it [default: 100,100]
    #[arg(long, value_name = "X,Y", value_parser = two_numbers, allow_hyphen_values = true)]
    size: Option<[f64; 2]>,
    /// Spacing of the grid, metres [default: 0.5, or that of the height map]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    cell: Option<f64>,
    /// Height from the lowest to the highest point, metres; not used with a height map [default: 12]
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    relief: Option<f64>,
    /// Trees per hectare [default: 300]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    trees_per_ha: Option<f64>,
    /// Bushes per hectare [default: 200]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    bushes_per_ha: Option<f64>,
    /// Rocks of 0.2 to 2 m per hectare [default: 100]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    rocks_per_ha: Option<f64>,
    /// Tufts of grass per square metre of turf [default: 10]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    grass_per_m2: Option<f64>,
    /// No path
    #[arg(long)]
    no_path: bool,
    /// No stream
    #[arg(long)]
    no_stream: bool,
    /// Heights from a PNG of 16 bits, a GeoTIFF in metres or an ESRI ASCII grid
    #[arg(long, value_name = "FILE")]
    height_map: Option<PathBuf>,
    /// Heights of black and white in a PNG, metres
    #[arg(long, value_name = "LOW,HIGH", value_parser = two_numbers, allow_hyphen_values = true, requires = "height_map")]
    height_range: Option<[f64; 2]>,
    #[command(flatten)]
    made: MadeArgs,
}

/// Rooms with furniture, mirrors and panes of glass
///
/// The rooms are centred on 0,0, their floor is at z = 0; doors between them stand open. Categories are wall, floor,
/// ceiling, door, window, mirror, partition (a pane of glass that reaches into the room), table, chair, sofa, bed,
/// shelf, cupboard, lamp, plant and tv; parts are leg, seat, back and so on. The camera nodes Camera_1 and so on are in
/// a corner of each room, 1.5 m high, and look at its middle; Scanner is in the first room and looks along x.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate indoor -o flat.glb
  echocast generate indoor --rooms 4,3 --mirrors 6 --panes 4 --seed 7 -o office.glb
  echocast generate indoor --rooms 1,1 --room-size 12,9 --height 4 --no-ceiling -o hall.glb
  echocast scan flat.glb --sensor ouster_os1_128 --camera Scanner --preview flat.png --view perspective")]
pub struct IndoorArgs {
    /// Rooms along x and y, 1 to 10 each
    #[arg(long, value_name = "X,Y", default_value = "2,2", value_parser = two_counts, allow_hyphen_values = true)]
    rooms: [u32; 2],
    /// Usual extent of a room along x and y, metres, 3 to 20
    #[arg(long, value_name = "X,Y", default_value = "5,4.5", value_parser = two_numbers, allow_hyphen_values = true)]
    room_size: [f64; 2],
    /// Height of the rooms, metres
    #[arg(long, value_name = "M", default_value_t = Indoor::default().height_m, allow_negative_numbers = true)]
    height: f64,
    /// Amount of furniture, from 0, none, to 1
    #[arg(long, value_name = "PART", default_value_t = Indoor::default().furniture, allow_negative_numbers = true)]
    furniture: f64,
    /// Mirrors on walls, at most one in a room
    #[arg(long, value_name = "N", default_value_t = Indoor::default().mirrors, allow_negative_numbers = true)]
    mirrors: u32,
    /// Partitions of glass, at most one in a room
    #[arg(long, value_name = "N", default_value_t = Indoor::default().panes, allow_negative_numbers = true)]
    panes: u32,
    /// Leave out ceilings
    #[arg(long)]
    no_ceiling: bool,
    #[command(flatten)]
    made: MadeArgs,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Preset {
    Paper,
}

pub fn run(args: &GenerateArgs) -> Result<()> {
    match &args.kind {
        SceneKind::Indoor(args) => indoor(args),
        SceneKind::Seabed(args) => seabed(args),
        SceneKind::Street(args) => street(args),
        SceneKind::Landscape(args) => landscape(args),
    }
}

fn seabed(args: &SeabedArgs) -> Result<()> {
    let seabed = Seabed::default()
        .size_m(args.size)
        .depth_m(args.depth)
        .cell_m(args.cell)
        .ripples(args.ripples)
        .boulders(args.boulders)
        .wrecks(args.wrecks)
        .fish(args.fish)
        .pipes(args.pipes)
        .mines(args.mines)
        .seagrass(args.seagrass);
    make(|seed| seabed.scene(seed), &args.made)
}

fn indoor(args: &IndoorArgs) -> Result<()> {
    let indoor = Indoor::default()
        .rooms(args.rooms)
        .room_m(args.room_size)
        .height_m(args.height)
        .furniture(args.furniture)
        .mirrors(args.mirrors)
        .panes(args.panes)
        .ceiling(!args.no_ceiling);
    make(|seed| indoor.scene(seed), &args.made)
}

fn street(args: &StreetArgs) -> Result<()> {
    let street = Street::default().blocks(args.blocks).cars(args.cars).people(args.people).seconds(args.seconds);
    make(|seed| street.scene(seed), &args.made)
}

fn landscape(args: &LandscapeArgs) -> Result<()> {
    let usual = match args.preset {
        None => Landscape::default(),
        Some(Preset::Paper) => Landscape::paper(),
    };
    let range_m = args.height_range;
    let landscape = Landscape::default()
        .size_m(args.size.unwrap_or(usual.size_m))
        .cell_m(args.cell.or(usual.cell_m))
        .relief_m(args.relief.unwrap_or(usual.relief_m))
        .trees_per_ha(args.trees_per_ha.unwrap_or(usual.trees_per_ha))
        .bushes_per_ha(args.bushes_per_ha.unwrap_or(usual.bushes_per_ha))
        .rocks_per_ha(args.rocks_per_ha.unwrap_or(usual.rocks_per_ha))
        .grass_per_m2(args.grass_per_m2.unwrap_or(usual.grass_per_m2))
        .path(usual.path && !args.no_path)
        .stream(usual.stream && !args.no_stream)
        .height_map(args.height_map.clone().map(|file| HeightMap::new(file).range_m(range_m)));
    make(|seed| landscape.scene(seed), &args.made)
}

/// Makes a scene, writes it to `file` and prints a summary.
fn make(scene: impl FnOnce(u64) -> echocast::Result<GeneratedScene>, made: &MadeArgs) -> Result<()> {
    let MadeArgs { seed, output: file, quiet } = made;
    if !has_ending(file, &["glb"]) {
        return Err(usage::wrong(anyhow!("-o {}: scenes are written as .glb", shown::path(file))));
    }
    interrupt::listen().context("cannot listen for signals")?;
    let (mut making, mut writing) = (0.0, 0.0);
    let scene = match timed(&mut making, || scene(*seed)) {
        Ok(scene) => scene,
        Err(Error::InvalidParameter { name, value, allowed }) => {
            return Err(usage::wrong(anyhow!("{} is {value}; allowed: {allowed}", option(&name))));
        }
        Err(other) => return Err(other.into()),
    };
    timed(&mut writing, || scene.write(file))?;
    if *quiet {
        return Ok(());
    }
    let objects = scene.categories.iter().map(|(_, count)| count).sum();
    let categories: Vec<String> = scene.categories.iter().map(|(name, count)| format!("{count} {name}")).collect();
    let mut summary = format!(
        "{} in {}: {}\n",
        counted(scene.triangles, "triangle"),
        counted(objects, "object"),
        categories.join(", ")
    );
    for line in &scene.details {
        writeln!(summary, "  {line}")?;
    }
    writeln!(summary, "  made in {}, written in {}", duration(making), duration(writing))?;
    writeln!(summary, "  {}", shown::path(file))?;
    text::print(&summary)
}

/// The option for the parameter `name` of the library: `--ripples LENGTH` for `ripples.wavelength_m`.
fn option(name: &str) -> String {
    match name.split_once('.') {
        Some((option, "wavelength_m")) => format!("--{option} LENGTH"),
        Some((option, "height_m")) => format!("--{option} HEIGHT"),
        Some((option, "direction_deg")) => format!("--{option} DIRECTION"),
        Some(("height_map", "range_m")) => "--height-range".to_owned(),
        None if name == "room_m" => "--room-size".to_owned(),
        _ => format!("--{}", name.strip_suffix("_m").unwrap_or(name).replace('_', "-")),
    }
}

fn two_numbers(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or("expected two numbers, such as 60,40".into())
}

fn two_counts(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).ok_or("expected two whole numbers, such as 3,2".into())
}

fn ripples(text: &str) -> Result<Ripples, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[wavelength_m, height_m]) => {
            Ok(Ripples::default().wavelength_m(wavelength_m).height_m(height_m).direction_deg(None))
        }
        Some(&[wavelength_m, height_m, direction]) => {
            Ok(Ripples::default().wavelength_m(wavelength_m).height_m(height_m).direction_deg(direction))
        }
        _ => Err("expected two or three numbers, such as 0.6,0.05 or 0.6,0.05,30".into()),
    }
}
