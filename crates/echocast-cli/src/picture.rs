//! Pictures of clouds.

use crate::choice;
use crate::input::has_ending;
use anyhow::{Context as _, Result, ensure};
use clap::Args;
use echocast::preview::{self, ColorBy, PreviewOptions, View};
use echocast::shown;
use std::path::{Path, PathBuf};

/// A picture of one sample.
#[derive(Args)]
pub struct PictureArgs {
    /// Write a picture of the sample instead of adding it to the set
    #[arg(long, value_name = "FILE.png", requires = "sample")]
    pub preview: Option<PathBuf>,
    /// What the colours of the picture show
    #[arg(long, requires = "preview", default_value = "label", value_parser = choice::of::<ColorBy>())]
    pub color: ColorBy,
    /// How the picture shows the cloud
    #[arg(long, requires = "preview", default_value = "top", value_parser = choice::of::<View>())]
    pub view: View,
}

/// Checks before the work that a picture could be written to `file`, which was given with `option`.
pub fn check_picture(option: &'static str, file: &Path, options: &PreviewOptions) -> Result<()> {
    ensure!(has_ending(file, &["png"]), "{option} {}: pictures are written as .png", shown::path(file));
    preview::check(file, options).context(option)
}
