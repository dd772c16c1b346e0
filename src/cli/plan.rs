//! `nngtl plan`.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use nalgebra::Point2;
use serde_json::{Value, json};

use super::args::{PlanArgs, SamplerName};
use super::console::{Console, rest, seconds};
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::automaton::Task;
use crate::mission::{self, MissionError, Options, Planned, SamplerChoice};
use crate::planner::{EndReason, NotFound, PlanError, Progress, Settings, Stop};
use crate::render::Picture;
use crate::scenario::Scenario;
use crate::verify::Lasso;

/// Pixels of a PNG for each pixel of the SVG.
const PNG_SCALE: f64 = 1.5;

pub(super) fn run(args: &PlanArgs, console: &Console) -> Result<(), Failure> {
    let began = Instant::now();
    let (scenario, task, translate) = read(args, console)?;
    let options = options(args);
    let search = |stop: &Stop, observe: &mut dyn FnMut(Progress)| {
        mission::plan_task(&scenario, task, &options, stop, observe)
    };
    let (mut planned, ended) = watched(&scenario, &options, console, search)?;
    planned.notices.extend(ignored(&options));
    finish(&mut planned, ended, began, translate, console);
    write_files(args, &scenario, &planned, &[], console)?;
    let text = if console.json() {
        format!("{}\n", to_json(args, &scenario, &planned))
    } else {
        describe(&scenario, &planned)
    };
    Ok(console.result(&text)?)
}

/// What is said where settings were chosen that mean nothing.
fn ignored(options: &Options) -> Option<String> {
    let limit_alone = Settings {
        time_limit: options.settings.time_limit,
        ..Settings::default()
    };
    let is_ignored = options.sampler == SamplerChoice::Exact && options.settings != limit_alone;
    is_ignored.then(|| {
        "--sampler exact draws no samples: of the settings of the search only --time-limit means something to it".to_owned()
    })
}

/// Reads the mission: the scenario, its automaton, and the seconds that the translation took.
/// Refuses outputs that could not be written, before any work is done.
pub(super) fn read(args: &PlanArgs, console: &Console) -> Result<(Scenario, Task, f64), Failure> {
    let outputs = [&args.out, &args.svg, &args.png, &args.heatmap];
    let outputs: Vec<&Path> = outputs.into_iter().flatten().map(|p| p.as_path()).collect();
    files::keep_inputs(&[&args.mission.scenario], &outputs)?;
    files::check_folders(outputs)?;
    if let Some(heatmap) = &args.heatmap {
        files::heatmap_format(heatmap)?;
    }
    let mut mission_args = args.mission.clone();
    if args.automaton.is_some() {
        // The automaton takes the formula's place; the scenario need not have one.
        mission_args.task = Some("true".to_owned());
    }
    let scenario = files::scenario(&mission_args, console)?;
    let limits = (&args.limits).into();
    let translated = Instant::now();
    let task = match &args.automaton {
        Some(file) => Task::from_nba(files::automaton(file, &scenario, &limits)?)
            .map_err(MissionError::from)?,
        None => mission::task_within(&scenario, &limits)?,
    };
    Ok((scenario, task, translated.elapsed().as_secs_f64()))
}

/// Whether a search was ended by an interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    Early,
    ByItself,
}

/// Completes the statistics, and says what a user should know.
pub(super) fn finish(
    planned: &mut Planned,
    ended: Ended,
    began: Instant,
    translate: f64,
    console: &Console,
) {
    if ended == Ended::Early {
        let says = "interrupted: this is the best so far".to_owned();
        planned.notices.push(says);
    }
    if let Some(stats) = &mut planned.file.stats {
        stats.seconds.translate = translate;
        stats.seconds.total = began.elapsed().as_secs_f64();
    }
    for notice in &planned.notices {
        console.warn(notice);
    }
}

pub(super) fn options(args: &PlanArgs) -> Options {
    let search = &args.search;
    Options {
        sampler: match args.sampler {
            SamplerName::Auto => SamplerChoice::Auto,
            SamplerName::Uniform => SamplerChoice::Uniform,
            SamplerName::Biased => SamplerChoice::Biased,
            SamplerName::Directed => SamplerChoice::Directed,
            SamplerName::Guided => SamplerChoice::Guided,
            SamplerName::Exact => SamplerChoice::Exact,
        },
        device: args.network.device.into(),
        model: args.network.model.clone(),
        await_networks: args.heatmap.is_some(),
        settings: Settings {
            seed: search.seed,
            iterations: search.iterations,
            time_limit: search.time_limit,
            threads: search.threads,
            first: search.first,
            radius: search.radius,
            max_radius: search.max_radius,
            shorten: search.shorten,
            informed: search.informed,
            neighbours: search.neighbours,
            range: search.range,
            p_closest: search.p_closest,
            y_rand: search.y_rand,
            p_target: search.p_target,
            distance_deviation: search.distance_deviation,
            angle_deviation: search.angle_deviation,
            alpha: search.alpha,
            lead: search.guided.lead,
            p_region: search.guided.p_region,
            corner: search.guided.corner,
            networks_first: search.guided.networks_first,
        },
    }
}

/// Searches with a progress bar; Ctrl-C ends the search with the best plan so far.
pub(super) fn watched<T>(
    scenario: &Scenario,
    options: &Options,
    console: &Console,
    search: impl FnOnce(&Stop, &mut dyn FnMut(Progress)) -> Result<T, MissionError>,
) -> Result<(T, Ended), Failure> {
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(options.settings.iterations, "planning");
    let alphabet = scenario.workspace.alphabet();
    let planned = search(&stop, &mut |p: Progress| {
        bar.set_position(p.iterations);
        match p.cost {
            Some(cost) => bar.set_message(format!("best cost {cost:.4}")),
            None => bar.set_message(format!("no plan yet, {} nodes", p.nodes)),
        }
    });
    bar.finish_and_clear();
    let ended = match stop.is_raised() {
        true => Ended::Early,
        false => Ended::ByItself,
    };
    let found = planned.map_err(|e| match e {
        MissionError::Plan(PlanError::NotFound(found)) => {
            found.notices.iter().for_each(|notice| console.warn(notice));
            let missing: Vec<String> = found.missing.iter().map(|l| alphabet.show(l)).collect();
            not_found(scenario, &found, &missing)
        }
        other => Failure::from(other),
    });
    Ok((found?, ended))
}

fn not_found(scenario: &Scenario, found: &NotFound, missing: &[String]) -> Failure {
    let ended = match found.reason {
        EndReason::First | EndReason::Iterations => {
            format!("within {} iterations", found.stats.iterations)
        }
        EndReason::Time => format!("within {}", seconds(found.stats.seconds)),
        EndReason::Stopped => format!(
            "before the interruption after {} iterations",
            found.stats.iterations
        ),
    };
    let mut message = format!("{}: no plan found {ended}", scenario.name);
    let [reached, states] = found.states;
    let _ = write!(
        message,
        "; it reached {reached} of the automaton's {states} states"
    );
    if found.stats.goals > 0 {
        let _ = write!(
            message,
            " and {} ways to an accepting state, but no loop from there",
            found.stats.goals
        );
    } else if !missing.is_empty() {
        let _ = write!(
            message,
            ", came within {} of acceptance, and still needed to see {}",
            match found.steps_left {
                1 => "one automaton step".to_owned(),
                steps => format!("{steps} automaton steps"),
            },
            missing.join(" or ")
        );
    }
    let more = match found.reason {
        EndReason::Time => "a longer --time-limit",
        _ => "more --iterations",
    };
    let _ = write!(message, "; give it {more}, or another --sampler");
    Failure::negative("not-found", message).with_details(json!({
        "scenario": scenario.name,
        "notices": found.notices,
        "stats": found.stats,
        "states_reached": reached,
        "states": states,
        "steps_left": found.steps_left,
        "missing": missing,
    }))
}

/// Writes plan, heatmap and pictures where asked; `reused` are the legs that came from a library.
pub(super) fn write_files(
    args: &PlanArgs,
    scenario: &Scenario,
    planned: &Planned,
    reused: &[(Point2<f64>, Point2<f64>)],
    console: &Console,
) -> Result<(), Failure> {
    if let Some(path) = &args.out {
        planned.file.write(path)?;
        console.note(&format!("wrote {}", path.display()));
    }
    if let Some(path) = &args.heatmap {
        match &planned.guidance {
            Some(guidance) => {
                let bytes = files::heatmap_bytes(path, &guidance.heatmap)?;
                files::write(path, &bytes, console)?;
            }
            None => {
                console.warn(&unwritten(path));
            }
        }
    }
    if args.svg.is_none() && args.png.is_none() {
        return Ok(());
    }
    let legs = reused.iter().copied();
    let picture = picture(args, scenario, planned).bands("reused skill", legs);
    if let Some(path) = &args.svg {
        files::write(path, picture.to_svg().as_bytes(), console)?;
    }
    if let Some(path) = &args.png {
        let png = picture.to_png(PNG_SCALE);
        let png = png.map_err(|e| Failure::input(e.to_string()))?;
        files::write(path, &png, console)?;
    }
    Ok(())
}

fn picture<'a>(args: &PlanArgs, scenario: &'a Scenario, planned: &'a Planned) -> Picture<'a> {
    let mut picture = Picture::new(&scenario.workspace)
        .start(scenario.start)
        .title(&scenario.name)
        .path(&planned.path);
    match &args.automaton {
        Some(file) => picture = picture.subtitle(file.display().to_string()),
        None => picture = picture.subtitle(&scenario.task),
    }
    if let Some(guidance) = &planned.guidance {
        picture = picture.heatmap(&guidance.heatmap);
    }
    if args.tree {
        picture = picture.tree(planned.edges.iter().map(|&[a, b]| (a, b)));
    }
    picture
}

/// Why there is no heatmap at a place where one was asked for.
fn unwritten(heatmap: &Path) -> String {
    format!(
        "{} was not written: the search ended before it asked the networks, or went by another sampler (--sampler guided --networks-first waits for them, nngtl heatmap does nothing else)",
        heatmap.display()
    )
}

/// The summary for programs.
pub(super) fn to_json(args: &PlanArgs, scenario: &Scenario, planned: &Planned) -> Value {
    let heatmap = args.heatmap.as_deref();
    let (written, missing) = match planned.guidance {
        Some(_) => (heatmap, None),
        None => (None, heatmap),
    };
    let files = [&args.out, &args.svg, &args.png].into_iter().flatten();
    let files: Vec<&Path> = files.map(|p| p.as_path()).chain(written).collect();
    // What is odd about the scenario was told when it was read.
    let odd = scenario.warnings().into_iter();
    let notices: Vec<String> = odd
        .chain(planned.notices.iter().cloned())
        .chain(missing.map(unwritten))
        .collect();
    json!({
        "version": JSON_VERSION,
        "outcome": "planned",
        "word": shown(scenario, &planned.verified.word),
        "verified": true,
        "notices": notices,
        "files": files,
        "plan": planned.file,
    })
}

/// The word of a plan as people read it: on a grid every waypoint is a letter, elsewhere only changes of letters count.
pub(super) fn shown(scenario: &Scenario, word: &Lasso) -> String {
    let alphabet = scenario.workspace.alphabet();
    match scenario.grid {
        Some(_) => word.show_counted(alphabet),
        None => word.show(alphabet),
    }
}

/// The summary for people.
pub(super) fn describe(scenario: &Scenario, planned: &Planned) -> String {
    let file = &planned.file;
    let sampler = file.sampler.as_deref().unwrap_or("unknown");
    let device = match &file.device {
        Some(device) => format!(", networks on {device}"),
        None if sampler == "guided" => ", over before it needed the networks".to_owned(),
        None => String::new(),
    };
    let done = format!("planned and verified ({sampler} sampler{device})");
    describe_as(scenario, planned, &done)
}

/// As [`describe`], with what was `done` to the plan.
pub(super) fn describe_as(scenario: &Scenario, planned: &Planned, done: &str) -> String {
    let file = &planned.file;
    let mut text = format!("{}: {done}\n", scenario.name);
    let word = shown(scenario, &planned.verified.word);
    let _ = writeln!(text, "  sees    {word}");
    let (cost, weight) = (planned.verified.cost, scenario.weight);
    let _ = writeln!(
        text,
        "  cost    {:.4} = {weight} × prefix {:.4} + {} × suffix {:.4}",
        cost.total,
        cost.prefix,
        rest(weight),
        cost.suffix
    );
    if let Some(bound) = &file.bound {
        let product = bound.product.filter(|&least| least > bound.cost);
        let product = product.map(|least| (least, 100.0 * (cost.total / least - 1.0)));
        let closes = "whose loop closes in its automaton state";
        let all = bound.gap.map(|gap| {
            let percent = 100.0 * gap;
            let least = bound.cost;
            format!("no plan costs less than {least:.4}: at most {percent:.1} % above the optimum")
        });
        let said = match (all, product) {
            (Some(all), None) => all,
            (Some(all), Some((least, percent))) => {
                format!("{all}; none {closes} less than {least:.4} ({percent:.1} %)")
            }
            (None, Some((least, percent))) => {
                format!("no plan {closes} costs less than {least:.4} ({percent:.1} %)")
            }
            (None, None) => "none is known".to_owned(),
        };
        let _ = writeln!(text, "  bound   {said} ({})", seconds(bound.seconds));
    }
    if let Some(first) = &file.first {
        let _ = writeln!(
            text,
            "  first   cost {:.4} after {} iterations, {} nodes, {}",
            first.cost,
            first.iterations,
            first.nodes,
            seconds(first.seconds)
        );
    }
    if let Some(stats) = file.stats.as_ref().filter(|s| s.nodes > 0) {
        let _ = writeln!(
            text,
            "  search  {} iterations, {} nodes at {} places",
            stats.iterations, stats.nodes, stats.sites
        );
    }
    if let Some(stats) = &file.stats {
        let s = &stats.seconds;
        let _ = writeln!(
            text,
            "  time    {} in all: translate {}, encode {}, infer {}, search {}",
            seconds(s.total),
            seconds(s.translate),
            seconds(s.encode),
            seconds(s.infer),
            seconds(s.search)
        );
    }
    text
}
