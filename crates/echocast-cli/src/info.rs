//! `echocast info`

use crate::input::{SceneArgs, positive};
use crate::text::{self, thousands};
use anyhow::Result;
use echocast::material::{Returned, Why};
use echocast::{ReflectanceSource, Scene, shown};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Show what is in a scene: triangles, instances, materials, labels, cameras, animations, bounds
#[derive(clap::Args)]
#[command(after_help = "Example:\n  echocast info street.glb --labels street.labels.yaml")]
pub struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Wavelength at which reflectances are listed, nm
    #[arg(long, value_name = "NM", default_value = "905", value_parser = positive)]
    wavelength: f64,
}

pub fn run(args: &Args) -> Result<()> {
    let scene = args.scene.load(&args.scene.labels()?, &args.scene.materials()?)?;
    text::print(&describe(&args.scene.names(), &scene, args.wavelength)?)
}

/// How much light the materials of `scene` return, and why, a line each.
fn write_materials(text: &mut String, scene: &Scene, wavelength_nm: f64) -> Result<()> {
    writeln!(text, "materials   {}, reflectance at {wavelength_nm} nm", scene.materials.len())?;
    for material in &scene.materials {
        let Returned { value, spread, by_image, why } = material.returned(wavelength_nm, ReflectanceSource::Library);
        let spread = spread.map_or(String::new(), |spread| format!(" +- {spread:.2}"));
        let value = if by_image { "by image" } else { &format!("{value:.3}") };
        let source = match (why, &*material.source) {
            (Why::Given, source) if !source.is_empty() => format!(": {}", shown::text(source)),
            _ => String::new(),
        };
        let changes = if material.changes.is_some() { ", changes over time" } else { "" };
        writeln!(text, "  {:<28} {value}{spread}, {why}{source}{changes}", shown::text(&material.name))?;
    }
    Ok(())
}

fn describe(name: &str, scene: &Scene, wavelength_nm: f64) -> Result<String> {
    let mut text = format!("{name}\n");
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
    writeln!(text, "textures    {}", scene.textures().len())?;

    write_materials(&mut text, scene, wavelength_nm)?;

    let mut objects_of: BTreeMap<u32, usize> = BTreeMap::new();
    for object in &scene.objects {
        *objects_of.entry(object.category_id).or_default() += 1;
    }
    writeln!(text, "categories  {}", scene.labels.category.ids.len())?;
    for (id, name) in scene.labels.category.iter() {
        let objects = text::counted(objects_of.get(&id).copied().unwrap_or(0), "object");
        writeln!(text, "  {id:>4} {:<23} {objects}", shown::text(name))?;
    }
    writeln!(text, "parts       {}", scene.labels.part.ids.len())?;
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
