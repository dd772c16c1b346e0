//! `nngtl dataset generate` and `nngtl dataset merge`.

use std::path::Path;

use serde_json::json;

use super::args::{ExpertName, GenerateArgs, MergeArgs};
use super::console::Console;
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::dataset::{
    Expert, GenerateConfig, GenerateError, MANIFEST, Manifest, Outcome, generate, merge,
};

pub(super) fn run(args: &GenerateArgs, console: &Console) -> Result<(), Failure> {
    files::check_result_folder(&args.out)?;
    let usual = GenerateConfig::new(&args.out, args.seed, args.missions);
    let config = GenerateConfig {
        threads: args.threads,
        expert: match args.expert {
            ExpertName::Exact => Expert::Exact,
            ExpertName::TlRrtStar => Expert::TlRrtStar {
                iterations: Expert::PAPER_ITERATIONS,
            },
        },
        families: if args.families.is_empty() {
            usual.families.clone()
        } else {
            args.families.clone()
        },
        to: args.missions.div_ceil(args.per_map),
        missions_per_map: args.per_map as usize,
        random_share: args.random_share(),
        min_steps: args.min_steps,
        max_states: args.most_states,
        formulas: files::formulas(args.formulas.as_deref())?,
        ..usual
    };
    let config = match args.part {
        Some((part, of)) => config.part(part, of).map_err(|e| failure(&e))?,
        None => config,
    };
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(config.to - config.from, "maps");
    let outcome = generate(
        &config,
        &|p| {
            bar.set_position(p.maps);
            bar.set_message(format!("{} missions", p.missions));
        },
        stop.flag(),
    );
    bar.finish_and_clear();
    let outcome = outcome.map_err(|e| failure(&e))?;
    let complete = matches!(outcome, Outcome::Complete(_));
    let manifest = outcome.manifest();
    let outcome = if complete { "generated" } else { "interrupted" };
    tell(console, outcome, manifest, &args.out)?;
    if complete {
        return Ok(());
    }
    // What is missing is no result: scripts must not go on as if the set were whole.
    Err(Failure::negative(
        "interrupted",
        "interrupted; the same command continues from here",
    )
    .already_told())
}

pub(super) fn merge_parts(args: &MergeArgs, console: &Console) -> Result<(), Failure> {
    files::check_result_folder(&args.out)?;
    let manifest = merge(&args.parts, &args.out).map_err(|e| Failure::input(e.to_string()))?;
    tell(console, "merged", &manifest, &args.out)
}

fn tell(console: &Console, outcome: &str, manifest: &Manifest, out: &Path) -> Result<(), Failure> {
    let text = if console.json() {
        let object = json!({
            "version": JSON_VERSION,
            "outcome": outcome,
            "manifest": out.join(MANIFEST),
            "maps": manifest.maps,
            "missions": manifest.missions,
            "filtered": manifest.filtered,
            "gap": manifest.gap,
        });
        format!("{object}\n")
    } else {
        describe(manifest, &out.display().to_string())
    };
    Ok(console.result(&text)?)
}

fn describe(manifest: &Manifest, folder: &str) -> String {
    let count = |counts: &crate::dataset::Counts| {
        let parts = counts.iter().map(|(name, n)| format!("{n} {name}"));
        parts.collect::<Vec<_>>().join(", ")
    };
    let gap = manifest.gap.filter(|gap| gap.missions > 0);
    let gap = gap.map_or_else(String::new, |gap| {
        format!(
            "  optimum   plans cost at most {:.1} % more on average, {:.1} % at worst ({} missions looked at)\n",
            100.0 * gap.mean,
            100.0 * gap.worst,
            gap.missions
        )
    });
    format!(
        "{folder}: {} missions on {} maps in {} shards\n  maps      {}\n  missions  {}\n  dropped   {}\n{gap}",
        manifest.missions,
        manifest.maps,
        manifest.shards.len(),
        count(&manifest.families),
        count(&manifest.patterns),
        count(&manifest.filtered),
    )
}

fn failure(e: &GenerateError) -> Failure {
    Failure::input(e.to_string())
}
