//! Reading missions and writing files.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use super::args::MissionArgs;
use super::console::Console;
use super::failure::Failure;
use crate::automaton::{Limits, Nba, read_hoa, read_hoa_stream};
use crate::dataset::{FormulaList, FormulaListError};
use crate::guidance::Heatmap;
use crate::plan::write_atomically;
use crate::render::{heatmap_npy, heatmap_png};
use crate::scenario::{Overrides, Scenario, ScenarioText, snippet};

/// How many pixels a heatmap's cell gets in a picture of its own.
const HEATMAP_CELL: u32 = 4;

/// Automaton files beyond this size are refused.
const MAX_HOA_BYTES: u64 = 16 << 20;

/// Loads the scenario that the arguments name, and says what is odd about it.
pub(super) fn scenario(args: &MissionArgs, console: &Console) -> Result<Scenario, Failure> {
    scenario_of(&scenario_text(args)?, args, console)
}

/// The file that the arguments name.
pub(super) fn scenario_text(args: &MissionArgs) -> Result<ScenarioText, Failure> {
    Ok(ScenarioText::read(&args.scenario, args.pick.as_deref())?)
}

/// As [`scenario`], of a file that was read.
pub(super) fn scenario_of(
    text: &ScenarioText,
    args: &MissionArgs,
    console: &Console,
) -> Result<Scenario, Failure> {
    let scenario = text.scenario(&overrides(args))?;
    for warning in scenario.warnings() {
        console.warn(&format!("{}: {warning}", args.scenario.display()));
    }
    Ok(scenario)
}

fn overrides(args: &MissionArgs) -> Overrides {
    Overrides {
        task: args.task.clone(),
        task_of: args.task_of.clone(),
        weight: args.weight,
    }
}

/// Refuses a result's folder that is a file.
pub(super) fn check_result_folder(path: &Path) -> Result<(), Failure> {
    if path.exists() && !path.is_dir() {
        let message = format!("{}: this is a file, expected a folder", path.display());
        return Err(Failure::input(message));
    }
    Ok(())
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

/// Refuses outputs that cannot be written, before any work is done, and two of them to one file.
pub(super) fn check_folders<'a>(paths: impl IntoIterator<Item = &'a Path>) -> Result<(), Failure> {
    let mut seen = HashSet::new();
    for path in paths {
        if path == Path::new("-") {
            let why =
                "`-` is no file: name one, or /dev/stdout (--json prints the result there, too)";
            return Err(Failure::input(why));
        }
        let device = std::fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir());
        if !device && !seen.insert(path) {
            return Err(Failure::input(format!(
                "{}: two results would be written to this file: give each its own",
                path.display()
            )));
        }
        let cannot = |why: &str| Failure::input(format!("{}: cannot write: {why}", path.display()));
        match std::fs::metadata(path) {
            Ok(there) if there.is_dir() => return Err(cannot("it is a folder")),
            Ok(there) if !there.is_file() => continue,
            _ => {}
        }
        let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
        if folder.is_some_and(|f| !f.is_dir()) {
            return Err(cannot("there is no such folder"));
        }
        let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let folder = target.parent().filter(|f| !f.as_os_str().is_empty());
        if let Err(e) = tempfile::tempfile_in(folder.unwrap_or(Path::new("."))) {
            return Err(cannot(&format!(
                "its folder refuses new files ({})",
                e.kind()
            )));
        }
    }
    Ok(())
}

/// Refuses to write over what is read.
pub(super) fn keep_inputs(inputs: &[&Path], outputs: &[&Path]) -> Result<(), Failure> {
    let same = |a: &Path, b: &Path| match (a.canonicalize(), b.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    };
    for &output in outputs {
        if inputs.iter().any(|input| same(input, output)) {
            return Err(Failure::input(format!(
                "{}: would be written over, but it is read as input: choose another file",
                output.display()
            )));
        }
    }
    Ok(())
}

/// Reads an automaton (HOA) over the letters of the scenario's map. A robot that moves
/// continuously may cross a region in any number of steps, so the automaton must not count them.
pub(super) fn automaton(file: &Path, scenario: &Scenario, limits: &Limits) -> Result<Nba, Failure> {
    let name = file.display().to_string();
    let text = read_text(file).map_err(|e| Failure::input(format!("{name}: {e}")))?;
    let letters = Arc::clone(scenario.workspace.alphabet());
    let nba = read_hoa(&text, letters, limits).map_err(|e| Failure::from(&e).of(&name))?;
    let accept_nothing = |all: Vec<Nba>| all.iter().all(|nba| nba.trimmed().is_empty());
    if nba.trimmed().is_empty() && read_hoa_stream(&text, limits).is_ok_and(accept_nothing) {
        let says = "the automaton accepts nothing, on any map: no cycle that can be reached from `Start:` is accepting";
        return Err(Failure::negative(
            "unsatisfiable",
            format!("{name}: {says}"),
        ));
    }
    if scenario.grid.is_some() {
        // On a grid every waypoint is a letter, so counting them means something.
        return Ok(nba);
    }
    match nba.is_stutter_invariant(limits) {
        Ok(true) => Ok(nba),
        Ok(false) => Err(Failure::input(format!(
            "{name}: the automaton counts repeated letters, which have no meaning while a robot moves continuously: give one without X (next)"
        ))),
        Err(e) => {
            let what = "whether the automaton counts repeated letters could not be decided";
            Err(Failure::from(e).of(&format!("{name}: {what}")))
        }
    }
}

/// The formulas of a file, if one is named.
pub(super) fn formulas(file: Option<&Path>) -> Result<Option<FormulaList>, Failure> {
    let Some(file) = file else { return Ok(None) };
    let name = file.display();
    let text = read_text(file).map_err(|e| Failure::input(format!("{name}: {e}")))?;
    let list = FormulaList::parse(&text).map_err(|e| {
        let lines = match &e {
            FormulaListError::Formula { line, source } => {
                Some(snippet::show(&source.text, *line, &source.span))
            }
            _ => None,
        };
        Failure::input(format!("{name}: {e}")).with_snippet(lines)
    })?;
    Ok(Some(list))
}

/// The text of a file of reasonable size.
fn read_text(file: &Path) -> std::io::Result<String> {
    use std::io::Read as _;
    let mut text = String::new();
    std::fs::File::open(file)?
        .take(MAX_HOA_BYTES + 1)
        .read_to_string(&mut text)?;
    if text.len() as u64 > MAX_HOA_BYTES {
        let message = format!(
            "larger than {} MiB, which is no automaton and no list of formulas to plan with",
            MAX_HOA_BYTES >> 20
        );
        return Err(std::io::Error::other(message));
    }
    Ok(text)
}
