//! `echocast info`

use crate::input::{SceneArgs, positive};
use crate::pipe::ColumnArgs;
use crate::text::{self, thousands};
use crate::{cloud_info, names, picture, pipe, usage};
use anyhow::{Context as _, Result, anyhow, ensure};
use echocast::material::{Returned, Why};
use echocast::preview::{self, PreviewOptions};
use echocast::{ReflectanceSource, Scene, import, read, shown};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Show what is in a scene: triangles, instances, materials, labels, cameras, animations, bounds; or in a cloud:
/// points, bounds, columns, labels with their numbers of points, strips with their densities and overlap, and the
/// distribution of ranges or intensities
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  echocast generate street -o street.glb
  echocast info street.glb
  echocast info street.glb --labels semantic_kitti
  echocast info street.glb --json
  echocast info street.glb --preview map.png
  echocast scan street.glb --sensor velodyne_vlp16 --at 0,0,2 -o scan.las
  echocast info scan.las")]
pub struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Wavelength at which reflectances are listed, nm
    #[arg(long, value_name = "NM", default_value = "905", value_parser = positive)]
    wavelength: f64,
    /// List what a radar of this frequency sees of the materials, too, GHz: the law of each and where it comes from
    #[arg(long, value_name = "GHZ", value_parser = positive)]
    radar: Option<f64>,
    /// Draw a plan of the scene to choose `--at` of a scan from: the view from above in the colours of categories, with
    /// a coordinate grid, the heights where its lines cross, and the cameras. Rooms with a ceiling are cut open. Of a
    /// cloud, draw how many points there are per square metre
    #[arg(long, value_name = "FILE.png")]
    preview: Option<PathBuf>,
    /// Print one JSON object, with lengths in metres
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    columns: ColumnArgs,
}

pub fn run(args: &InfoArgs) -> Result<()> {
    if let [file] = &*args.scene.files
        && (pipe::is_standard(file) || args.columns.is_some() || import::is_cloud(file)?)
    {
        return cloud_info::run(file, &args.columns, args.preview.as_deref(), args.json);
    }
    let message = "--columns: is for clouds as text; allowed: with one cloud file";
    ensure!(!args.columns.is_some(), usage::wrong(anyhow!(message)));
    let options = PreviewOptions::default();
    if let Some(file) = &args.preview {
        picture::check_picture("--preview", file, &options).map_err(usage::wrong)?;
    }
    let (scene, read) = read::noting(|| args.scene.load(&args.scene.labels()?, &args.scene.materials()?));
    let scene = scene?;
    if let Some(file) = &args.preview {
        read.iter().try_for_each(|input| names::check_kept(file, input)).map_err(usage::wrong)?;
        let built = scene.build()?;
        preview::write_plan(&scene, &built, file, options.width).context("--preview")?;
    }
    if args.json {
        return text::print_json(&to_json(&args.scene.files, &scene, args.wavelength));
    }
    text::print(&describe(args, &scene)?)
}

/// The reflectance of the materials of `scene` and its reason, a line each.
fn write_materials(text: &mut String, scene: &Scene, wavelength_nm: f64) -> Result<()> {
    writeln!(text, "materials   {}, reflectance at {wavelength_nm} nm", scene.materials.len())?;
    for material in &scene.materials {
        let Returned { value, spread, by_image, why, .. } =
            material.returned(wavelength_nm, ReflectanceSource::Library);
        let spread = spread.map_or(String::new(), |spread| format!(" +- {spread:.2}"));
        let value = if by_image { "by image" } else { &format!("{value:.3}") };
        let source = match (why, &*material.source) {
            (Why::Given, source) if !source.is_empty() => format!(": {}", shown::text(source)),
            _ => String::new(),
        };
        let changes = if material.changes.is_some() { ", changes over time" } else { "" };
        let passes = material.told_alpha().map_or(String::new(), |message| format!("; {message}"));
        writeln!(text, "  {:<28} {value}{spread}, {why}{source}{changes}{passes}", shown::text(&material.name))?;
    }
    Ok(())
}

/// What a radar of `ghz` sees of the materials of `scene`: the power that each reflects at normal incidence if it is smooth,
/// what passes, its law and why, a line each.
fn write_radar(text: &mut String, scene: &Scene, ghz: f64) -> Result<()> {
    writeln!(text, "radar       {}, reflected at normal incidence at {ghz} GHz", scene.materials.len())?;
    for material in &scene.materials {
        let (law, why) = material.radar_source();
        let name = shown::text(&material.name);
        let surface = law.at(ghz * 1e9).with_context(|| format!("--radar: the material {name}"))?;
        let db = |power: f32| if power > 0.0 { format!("{:.1} dB", 10.0 * power.log10()) } else { "nothing".into() };
        let through = surface.transmit(1.0).power();
        let passes = if through > 0.0 { format!(", {} passes", db(through)) } else { String::new() };
        let warning = law.warning(ghz * 1e9).map_or(String::new(), |warning| format!("; {warning}"));
        writeln!(text, "  {name:<28} {}{passes}: {law}, {why}{warning}", db(surface.reflect(1.0).power()))?;
    }
    Ok(())
}

fn describe(args: &InfoArgs, scene: &Scene) -> Result<String> {
    let files = &args.scene;
    let mut text = format!("{}\n", files.names());
    let placed = scene.objects.len();
    writeln!(text, "triangles   {}", thousands(scene.triangle_count()))?;
    if scene.degenerate_triangles > 0 {
        writeln!(text, "            {} without area were left out", thousands(scene.degenerate_triangles))?;
    }
    let meshes = match scene.meshes().len() {
        1 => "1 mesh".to_owned(),
        count => format!("{} meshes", thousands(count)),
    };
    writeln!(text, "objects     {} of {meshes}", text::counted(placed, "instance"))?;
    if let Some((low, high)) = scene.bounds() {
        let [x, y, z] = (high - low).to_array();
        writeln!(
            text,
            "bounds      [{:.3}, {:.3}, {:.3}] to [{:.3}, {:.3}, {:.3}] m",
            low.x, low.y, low.z, high.x, high.y, high.z
        )?;
        writeln!(text, "size        {x:.3} x {y:.3} x {z:.3} m")?;
    }
    if let Some(units) = files.units() {
        writeln!(text, "units       {units}")?;
    }
    writeln!(text, "textures    {}", scene.textures().len())?;

    write_materials(&mut text, scene, args.wavelength)?;
    if let Some(ghz) = args.radar {
        write_radar(&mut text, scene, ghz)?;
    }

    let objects_of = objects_of(scene);
    writeln!(text, "categories  {}", scene.labels.category.ids().len())?;
    for (id, name) in scene.labels.category.iter() {
        let objects = text::counted(objects_of.get(&id).copied().unwrap_or(0), "object");
        writeln!(text, "  {id:>4} {:<23} {objects}", shown::text(name))?;
    }
    writeln!(text, "parts       {}", scene.labels.part.ids().len())?;
    for (id, name) in scene.labels.part.iter() {
        writeln!(text, "  {id:>4} {}", shown::text(name))?;
    }

    writeln!(text, "cameras     {}", scene.cameras.len())?;
    for camera in &scene.cameras {
        let (at, along) = (camera.pose.position, camera.pose.rotation().x_axis);
        writeln!(
            text,
            "  {:<28} at {:.3},{:.3},{:.3} looking along {:.3},{:.3},{:.3}",
            shown::text(&camera.name),
            at.x,
            at.y,
            at.z,
            along.x,
            along.y,
            along.z
        )?;
    }
    writeln!(text, "animations  {}", scene.animations.len())?;
    for (animation, length) in scene.animations.iter().zip(&scene.animation_lengths) {
        writeln!(text, "  {:<28} {length:.3} s", shown::text(animation))?;
    }
    for warning in &scene.report.warnings {
        writeln!(text, "warning: {warning}")?;
    }
    Ok(text)
}

/// Number of objects of each category.
fn objects_of(scene: &Scene) -> BTreeMap<u32, usize> {
    let mut objects_of = BTreeMap::new();
    for object in &scene.objects {
        *objects_of.entry(object.category_id).or_default() += 1;
    }
    objects_of
}

/// The content of [`describe`] as JSON.
fn to_json(files: &[PathBuf], scene: &Scene, wavelength_nm: f64) -> Value {
    let objects_of = objects_of(scene);
    let materials = scene.materials.iter().map(|material| {
        let Returned { value, spread, by_image, why, .. } =
            material.returned(wavelength_nm, ReflectanceSource::Library);
        let (radar, radar_why) = material.radar_source();
        json!({
            "name": material.name,
            "reflectance": value,
            "spread": spread,
            "by_image": by_image,
            "why": why.to_string(),
            "source": material.source,
            "radar": radar.to_string(),
            "radar_why": radar_why.to_string(),
            "changes": material.changes.is_some(),
            "alpha": material.alpha.name(),
            "opacity": material.base_color[3],
        })
    });
    let categories = scene
        .labels
        .category
        .iter()
        .map(|(id, name)| json!({ "id": id, "name": name, "objects": objects_of.get(&id).copied().unwrap_or(0) }));
    let cameras = scene.cameras.iter().map(|camera| {
        let (at, along) = (camera.pose.position, camera.pose.rotation().x_axis);
        json!({ "name": camera.name, "position": at.to_array(), "direction": along.to_array() })
    });
    let animations = scene.animations.iter().zip(&scene.animation_lengths);
    json!({
        "files": text::paths(files),
        "triangles": scene.triangle_count(),
        "degenerate_triangles": scene.degenerate_triangles,
        "meshes": scene.meshes().len(),
        "instances": scene.objects.len(),
        "bounds": scene.bounds().map(|(low, high)| json!({ "low": low.to_array(), "high": high.to_array() })),
        "textures": scene.textures().len(),
        "materials": materials.collect::<Vec<_>>(),
        "categories": categories.collect::<Vec<_>>(),
        "parts": scene.labels.part.iter().map(|(id, name)| json!({ "id": id, "name": name })).collect::<Vec<_>>(),
        "cameras": cameras.collect::<Vec<_>>(),
        "animations": animations.map(|(name, length)| json!({ "name": name, "length_s": length })).collect::<Vec<_>>(),
        "warnings": scene.report.warnings,
    })
}
