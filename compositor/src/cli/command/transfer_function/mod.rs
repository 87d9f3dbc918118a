//! `brickcast transfer-function`: what a transfer function is, before anything is rendered with it.

mod canvas;
mod chart;
mod picture;
mod plot;

use std::path::Path;

use anyhow::anyhow;
use brickcast_volume::transfer_function::suggest::{SuggestError, Suggestion, suggest};
use brickcast_volume::transfer_function::{Colormap, Preset};

use self::plot::Plot;
use crate::cli::args::{ConvertArgs, ShowArgs, SuggestArgs, TransferFunctionArgs, TransferFunctionCommand};
use crate::cli::failure::Failure;
use crate::cli::say::{say, tell};
use crate::cli::scene::preset_file::{self, Wanted};
use crate::cli::source::surveyed;
use crate::output::{OutputFormat, write_text};

/// # Errors
/// Files that cannot be read, understood or written; flags that are wrong.
pub fn run(args: TransferFunctionArgs, quiet: bool) -> Result<(), Failure> {
    match args.command {
        TransferFunctionCommand::Show(args) => show(&args, quiet),
        TransferFunctionCommand::Convert(args) => convert(&args, quiet),
        TransferFunctionCommand::Suggest(args) => suggested(&args, quiet),
    }
}

fn show(args: &ShowArgs, quiet: bool) -> Result<(), Failure> {
    if let Some(output) = &args.output
        && OutputFormat::from_path(output).ok() != Some(OutputFormat::Png)
    {
        return Err(Failure::usage(anyhow!("--output {}: a curve is drawn as a .png", output.display())));
    }
    let volume = args.volume.as_ref().map(|path| Ok::<_, Failure>(surveyed(path, &args.raw)?.manifest)).transpose()?;
    let wanted = Wanted { name: args.preset.as_deref(), range: args.transfer_function_range };
    let preset = preset_file::read(&args.file, wanted, volume.as_ref())?;
    let plot = Plot::new(&preset.function, preset.has_opacities || volume.is_some(), volume.as_ref());

    let mut lines = vec![heading(&args.file.display().to_string(), &preset)];
    if volume.is_none() && !preset.has_opacities {
        lines.push("no opacities in it: render gives it the volume's default, which --volume PATH shows".to_owned());
    }
    lines.extend(preset.notes.iter().cloned());
    if plot.has_opacities {
        lines.extend(chart::lines(&plot));
    }
    if let Some(path) = &args.volume {
        lines.push(format!("* opacity   : voxels of {}, logarithmic", path.display()));
    }
    lines.extend(chart::table(&plot));
    tell(&(lines.join("\n") + "\n"))?;
    if let Some(output) = &args.output {
        picture::write(output, &plot)?;
        say(quiet, &format!("wrote {}", output.display()))?;
    }
    Ok(())
}

fn convert(args: &ConvertArgs, quiet: bool) -> Result<(), Failure> {
    check_preset_target(&args.output, args.force)?;
    let wanted = Wanted { name: args.preset.as_deref(), range: args.transfer_function_range };
    let mut preset = preset_file::read(&args.input, wanted, None)?;
    if preset.name.is_none() {
        preset.name = args.input.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    }
    for note in &preset.notes {
        tracing::warn!("{}: {note}", args.input.display());
    }
    write_text(&args.output, &preset.to_json())?;
    say(quiet, &format!("wrote {}", heading(&args.output.display().to_string(), &preset)))
}

fn suggested(args: &SuggestArgs, quiet: bool) -> Result<(), Failure> {
    let colormap = Colormap::from_name(&args.colormap).map_err(Failure::usage)?;
    if let Some(output) = &args.output {
        check_preset_target(output, args.force)?;
    }
    let manifest = surveyed(&args.volume, &args.raw)?.manifest;
    let made = suggest(&manifest.histogram, manifest.range, args.classes, colormap);
    let suggestion = made.map_err(|error| match error {
        SuggestError::Classes { .. } => Failure::usage(anyhow!("--classes: {error}")),
        _ => Failure::Failed(anyhow!("{}: {error}", args.volume.display())),
    })?;
    let volume = args.volume.display().to_string();
    let mut lines = description(&volume, &suggestion);
    lines.extend(chart::lines(&Plot::new(&suggestion.function, true, Some(&manifest))));
    lines.push(format!("* opacity   : voxels of {volume}, logarithmic"));
    tell(&(lines.join("\n") + "\n"))?;
    let Some(output) = &args.output else {
        return say(quiet, "keep it with --output FILE.json, for render --transfer-function FILE.json");
    };
    let name = args.volume.file_stem().map(|stem| format!("suggested for {}", stem.to_string_lossy()));
    let preset =
        Preset { name, function: suggestion.function, has_opacities: true, is_categorical: false, notes: Vec::new() };
    write_text(output, &preset.to_json())?;
    let shown = output.display();
    say(quiet, &format!("wrote {shown}; brickcast render {volume} --transfer-function {shown} -o picture.png"))
}

/// A preset is hard to come by again: it is not overwritten by the way.
fn check_preset_target(path: &Path, force: bool) -> Result<(), Failure> {
    let shown = path.display();
    if !path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
        return Err(Failure::usage(anyhow!("{shown}: transfer functions are written as ParaView presets; use .json")));
    }
    if path.exists() && !force {
        return Err(anyhow!("{shown} exists and is not overwritten; give another name or --force").into());
    }
    Ok(())
}

fn heading(file: &str, preset: &Preset) -> String {
    let name = preset.name.as_ref().map(|name| format!(" {name:?}")).unwrap_or_default();
    let opacities = if preset.has_opacities { preset.function.opacities().len() } else { 0 };
    format!("{file}{name}: {} points of colour, {opacities} of opacity", preset.function.colors().len())
}

fn description(volume: &str, suggestion: &Suggestion) -> Vec<String> {
    let count = suggestion.classes.len();
    let mut lines = vec![
        format!(
            "{volume}: {count} classes by multi-level Otsu thresholding, {:.1} % of the variance",
            100.0 * suggestion.separability
        ),
        "  from        to          mean        voxels   opacity  colour".to_owned(),
    ];
    lines.extend(suggestion.classes.iter().map(|class| {
        let [from, to, mean] = [class.range.0, class.range.1, class.mean].map(plot::short);
        let clear = class.opacity == 0.0;
        let color = if clear { "clear".to_owned() } else { plot::hex(class.rgb) };
        format!("  {from:<11} {to:<11} {mean:<11} {:>5.1} %  {:<7.4}  {color}", 100.0 * class.share, class.opacity)
    }));
    lines
}
