//! Reading missions and writing files.

use std::path::Path;

use super::args::MissionArgs;
use super::console::Console;
use super::failure::Failure;
use crate::guidance::Heatmap;
use crate::plan::write_atomically;
use crate::render::{heatmap_npy, heatmap_png};
use crate::scenario::{Overrides, Scenario};

/// How many pixels a heatmap's cell gets in a picture of its own.
const HEATMAP_CELL: u32 = 4;

/// Loads the scenario that the arguments name, and says what is odd about it.
pub(super) fn scenario(args: &MissionArgs, console: &Console) -> Result<Scenario, Failure> {
    let overrides = Overrides {
        task: args.task.clone(),
        weight: args.weight,
    };
    let scenario = Scenario::load_with(&args.scenario, args.pick.as_deref(), &overrides)?;
    for warning in scenario.warnings() {
        console.warn(&format!("{}: {warning}", args.scenario.display()));
    }
    Ok(scenario)
}

/// Writes a file, whole or not at all, and says so.
pub(super) fn write(path: &Path, bytes: &[u8], console: &Console) -> Result<(), Failure> {
    write_atomically(path, bytes).map_err(|e| Failure::write(path, &e))?;
    console.note(&format!("wrote {}", path.display()));
    Ok(())
}

/// The heatmap in the format that the file's ending asks for.
pub(super) fn heatmap_bytes(path: &Path, heatmap: &Heatmap) -> Result<Vec<u8>, Failure> {
    let drawn = match heatmap_format(path)? {
        HeatmapFormat::Png => heatmap_png(heatmap, HEATMAP_CELL),
        HeatmapFormat::Npy => heatmap_npy(heatmap),
    };
    drawn.map_err(|e| Failure::input(e.to_string()))
}

/// A format of heatmaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum HeatmapFormat {
    /// A picture.
    Png,
    /// Numbers.
    Npy,
}

/// The format that the file's ending asks for; ask before hours of work, not after.
pub(super) fn heatmap_format(path: &Path) -> Result<HeatmapFormat, Failure> {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("png") => Ok(HeatmapFormat::Png),
        Some("npy") => Ok(HeatmapFormat::Npy),
        _ => Err(Failure::input(format!(
            "{}: a heatmap's file ends in .png (a picture) or .npy (the numbers)",
            path.display()
        ))),
    }
}

/// Refuses output into folders that are not there, before any work is done.
pub(super) fn check_folders<'a>(
    paths: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    for path in paths {
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
        if folder.is_some_and(|f| !f.is_dir()) {
            return Err(Failure::input(format!(
                "{}: cannot write: there is no such folder",
                path.display()
            )));
        }
    }
    Ok(())
}

/// HOA-PENDING
pub(super) fn automaton(file: &Path, _: &Scenario) -> Result<crate::automaton::Nba, Failure> {
    Err(Failure::input(format!("{}: HOA", file.display())))
}
