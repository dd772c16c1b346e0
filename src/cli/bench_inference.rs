//! `nngtl bench inference`.

use std::path::{Path, PathBuf};

use super::args::{BenchInferenceArgs, DeviceName};
use super::bench::missions;
use super::console::Console;
use super::failure::Failure;
use super::files;
use crate::bench::inference::{
    BenchDevice, InferenceBench, InferenceTable, Network, StartRow, Weights, break_even,
    generated_cases, paper_networks,
};
use crate::mission::MissionError;
use crate::nn::{DeviceChoice, LoadError, LoadOptions, MODEL_FILES, Predictor, embedded};
use crate::planner::Settings;

/// Where weights are looked for if none are named.
const MODELS: &str = "models";

/// Iterations of a search, at most.
const ITERATIONS: u64 = 50_000;

pub(super) fn run(args: &BenchInferenceArgs, console: &Console) -> Result<(), Failure> {
    let outputs = [&args.report, &args.csv, &args.plot];
    files::check_folders(outputs.into_iter().flatten().map(PathBuf::as_path))?;
    plot_format(args.plot.as_deref())?;
    let networks = networks(args, console)?;
    let devices: Vec<BenchDevice> = match args.device {
        None => BenchDevice::present(),
        // Without waking drivers, some of which have much to say.
        Some(DeviceName::Cpu) => vec![BenchDevice::Cpu],
        Some(name) => {
            let wanted = DeviceChoice::from(name).to_string();
            let mut present = BenchDevice::present();
            present.retain(|d| d.kind() == wanted || wanted == "auto");
            present
        }
    };
    if devices.is_empty() {
        return Err(Failure::input(
            "there is no such device here: `nngtl devices` lists those that are",
        ));
    }
    let mut table = InferenceTable::new(InferenceBench {
        runs: args.runs,
        seconds: args.seconds,
        threads: args.threads,
        ..InferenceBench::default()
    });
    let bar = console.progress((devices.len() * networks.len()) as u64, "networks");
    for device in &devices {
        table
            .measure(device, &networks, &mut || bar.inc(1))
            .map_err(|e| Failure::input(e.to_string()))?;
    }
    bar.finish_and_clear();
    let model = model(args);
    for device in &devices {
        // Opening an adapter takes its time.
        let runs = if device.kind() == "cpu" { 25 } else { 3 };
        let name = model.map_or_else(|| "built-in".to_owned(), |m| m.display().to_string());
        let row = StartRow::measure(&name, device, runs, |choice| load(model, choice.into()));
        table.start.extend(row.map_err(MissionError::from)?);
    }
    if args.missions > 0 {
        table.break_even = guidance(args, console)?;
    }
    if let Some(path) = &args.report {
        files::write(path, table.to_markdown().as_bytes(), console)?;
    }
    if let Some(path) = &args.csv {
        files::write(path, table.to_csv().as_bytes(), console)?;
    }
    if let Some(path) = &args.plot {
        let bytes = match plot_format(Some(path))? {
            Plot::Png => table.to_png().map_err(|e| Failure::input(e.to_string()))?,
            Plot::Svg => table.to_svg().into_bytes(),
        };
        files::write(path, &bytes, console)?;
    }
    let text = if console.json() {
        let object = serde_json::to_string(&table).map_err(|e| Failure::input(e.to_string()))?;
        format!("{object}\n")
    } else {
        table.to_markdown()
    };
    Ok(console.result(&text)?)
}

/// A format of plots.
#[derive(Clone, Copy)]
enum Plot {
    Png,
    Svg,
}

fn plot_format(path: Option<&Path>) -> Result<Plot, Failure> {
    let Some(path) = path else {
        return Ok(Plot::Svg);
    };
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("png") => Ok(Plot::Png),
        Some("svg") => Ok(Plot::Svg),
        _ => Err(Failure::input(format!(
            "{}: a plot's file ends in .png or .svg",
            path.display()
        ))),
    }
}

/// The networks that are named or found, the built-in ones, and the paper's with random weights.
fn networks(args: &BenchInferenceArgs, console: &Console) -> Result<Vec<Network>, Failure> {
    let mut found = Vec::new();
    let folders = match args.model.as_slice() {
        [] => folders_in(Path::new(MODELS)),
        named => named.to_vec(),
    };
    for folder in &folders {
        let files = if folder.is_file() {
            vec![folder.clone()]
        } else {
            MODEL_FILES.map(|name| folder.join(name)).to_vec()
        };
        for path in files {
            let bytes = std::fs::read(&path).map_err(|e| {
                Failure::input(format!("cannot read weight file {}: {e}", path.display()))
            })?;
            found.push(file_network(&path.display().to_string(), bytes));
        }
    }
    if args.model.is_empty()
        && let (true, Some(files)) = (folders.is_empty(), embedded())
    {
        for (name, bytes) in ["built-in PathNet", "built-in StateNet"]
            .into_iter()
            .zip(files)
        {
            found.push(file_network(name, bytes.to_vec()));
        }
    }
    if !args.no_paper {
        console.note("making the paper's networks with random weights");
        found.extend(paper_networks().map_err(|e| Failure::input(e.to_string()))?);
    }
    Ok(found)
}

fn file_network(name: &str, bytes: Vec<u8>) -> Network {
    Network {
        name: name.trim_end_matches(".safetensors").to_owned(),
        weights: Weights::File(bytes),
    }
}

/// The folders below this one that hold both networks, by name.
fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let whole = |path: &PathBuf| MODEL_FILES.iter().all(|name| path.join(name).is_file());
    let mut found: Vec<PathBuf> = entries.map(|e| e.path()).filter(whole).collect();
    found.sort();
    found
}

/// The folder that is named, if one is: else the built-in networks are meant.
fn model(args: &BenchInferenceArgs) -> Option<&Path> {
    let mut named = args.model.iter().map(PathBuf::as_path);
    named.find(|path| path.is_dir())
}

fn load(model: Option<&Path>, options: LoadOptions) -> Result<Predictor, LoadError> {
    match model {
        Some(folder) => Predictor::load(folder, options),
        None => Predictor::embedded(options),
    }
}

/// Biased search against guided search with inference included.
fn guidance(
    args: &BenchInferenceArgs,
    console: &Console,
) -> Result<Option<crate::bench::inference::BreakEven>, Failure> {
    let options = LoadOptions {
        device: args.device.map_or(DeviceChoice::Auto, DeviceChoice::from),
        threads: args.threads,
        ..LoadOptions::default()
    };
    let mut predictor = load(model(args), options).map_err(MissionError::from)?;
    let cases = if args.scenarios.is_empty() {
        generated_cases(args.seed, args.missions, &mut predictor)
    } else {
        missions(
            &args.scenarios,
            Some(args.missions),
            &mut predictor,
            console,
        )?
    };
    let settings = Settings {
        seed: args.seed,
        iterations: ITERATIONS,
        ..Settings::default()
    };
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(cases.len() as u64, "guided against biased");
    let device = predictor.device().to_owned();
    let even = break_even(
        &device,
        &cases,
        args.trials,
        &settings,
        &stop,
        &mut |done| {
            bar.set_position(done as u64);
        },
    )
    .map_err(|e| Failure::input(e.to_string()))?;
    bar.finish_and_clear();
    Ok(even)
}
