//! From when on guidance pays: biased search against guided search with inference included.

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use crate::automaton::{Limits, Task};
use crate::bench::stats::Ratio;
use crate::bench::{BenchError, Case, Comparison, Prediction, Strategy, Summary, compare};
use crate::dataset::maps::{Family, draw_map, draw_start};
use crate::dataset::missions::draw_pattern;
use crate::mission::{self, Question};
use crate::nn::Predictor;
use crate::planner::{Problem, Settings, Stop};
use crate::random::generator;
use crate::system::{Continuous, MapLayout, TransitionSystem};

/// Predictions of each mission; the median counts.
const PREDICTIONS: usize = 5;

/// What a mission takes until its first plan, in milliseconds (means over its runs).
#[derive(Clone, Debug, Serialize)]
pub struct MissionTimes {
    /// The mission.
    pub name: String,
    /// Biased search.
    pub biased_ms: f64,
    /// Guided search, inference left out.
    pub guided_ms: f64,
    /// The same by predictions that say nothing, and take nothing.
    pub flat_ms: f64,
    /// Encoding and inference, with networks that are loaded.
    pub inference_ms: f64,
}

/// From when on guidance pays.
#[derive(Clone, Debug, Serialize)]
pub struct BreakEven {
    /// What ran the networks.
    pub device: String,
    /// Runs of each mission with each sampler.
    pub trials: u64,
    /// Milliseconds of encoding and inference.
    pub inference_ms: Summary,
    /// Milliseconds of biased search.
    pub biased_ms: Summary,
    /// Milliseconds of guided search, inference left out.
    pub guided_ms: Summary,
    /// Guided search as a share of biased search, inference left out.
    pub search_ratio: Ratio,
    /// The control: what the rules do without networks, as a share of biased search.
    pub flat_ratio: Ratio,
    /// Guided search with inference as a share of biased search.
    pub total_ratio: Ratio,
    /// Share of the missions that guidance with inference finished sooner.
    pub sooner: f64,
    /// Milliseconds of biased search from which on guidance saves more than inference takes;
    /// none if it does not save any.
    pub break_even_ms: Option<f64>,
    /// The same for the ends of the ratio's 95 % interval: at best, at worst.
    pub break_even_range_ms: [Option<f64>; 2],
    /// Every mission.
    pub missions: Vec<MissionTimes>,
}

/// Missions that are generated: maps of all families in turn, formulas of robot patterns.
///
/// Those that no network of `labels` regions fits, or that are trivially impossible, are left out.
#[must_use]
pub fn generated_cases(seed: u64, count: usize, predictor: &mut Predictor) -> Vec<Case> {
    const FAMILIES: [Family; 3] = [Family::Paper, Family::Clutter, Family::Rooms];
    let mut cases = Vec::new();
    for index in 0..4 * count as u64 {
        if cases.len() == count {
            break;
        }
        let mut random = generator(seed, index);
        let map = draw_map(FAMILIES[index as usize % 3], &mut random);
        let Ok(workspace) = map.workspace().map(Arc::new) else {
            continue;
        };
        let start = draw_start(&workspace, &mut random);
        let (_, formula) = draw_pattern(map.regions.len(), &mut random);
        let places = MapLayout::new(Arc::clone(&workspace), start);
        let letters = workspace.alphabet().clone();
        let task = Task::on_map(&formula, letters, &Limits::default(), &places);
        let Ok(task) = task else { continue };
        let Ok(system) = Continuous::new(Arc::clone(&workspace), start) else {
            continue;
        };
        let question = Question {
            map: &workspace,
            system: &system,
            start: system.start(),
            task: &task,
        };
        let mut seconds = Vec::new();
        let mut guidance = None;
        for _ in 0..PREDICTIONS {
            system.forget();
            let begin = Instant::now();
            if let Ok(found) = mission::predict_with(predictor, question) {
                guidance = Some(found.guidance);
            }
            seconds.push(begin.elapsed().as_secs_f64());
        }
        let (Some(guidance), Some(times)) = (guidance, Summary::of(&seconds)) else {
            continue;
        };
        cases.push(Case {
            name: format!("{}-{index}", map.family.name()),
            family: Some(map.family.name().to_owned()),
            problem: Problem {
                start: system.start(),
                system: Arc::new(system),
                task: Arc::new(task),
                weight: 0.2,
            },
            translate_seconds: 0.0,
            predictions: vec![Prediction {
                device: predictor.device().to_owned(),
                guidance,
                encode_seconds: 0.0,
                infer_seconds: times.median,
                live: None,
            }],
            labels: None,
        });
    }
    cases
}

/// Searches every mission with both samplers, and the flat control, until its first plan.
///
/// Missions that neither finds a plan for in any run are left out. `None` if none is left.
///
/// # Errors
/// As [`compare`].
pub fn break_even(
    device: &str,
    cases: &[Case],
    trials: u64,
    settings: &Settings,
    stop: &Stop,
    progress: &mut dyn FnMut(usize),
) -> Result<Option<BreakEven>, BenchError> {
    let comparison = Comparison {
        contenders: [Strategy::Biased, Strategy::Guided, Strategy::Flat]
            .map(Into::into)
            .to_vec(),
        trials,
        settings: Settings {
            // What networks save is told apart from what they take.
            networks_first: true,
            ..settings.clone()
        },
    };
    let report = compare(cases, &comparison, stop, progress)?;
    let mut missions = Vec::new();
    for case in cases {
        let of = |strategy| {
            let runs = report.trials.iter();
            runs.filter(move |t| t.case == case.name && t.contender.strategy == strategy)
        };
        let mean_ms = |strategy| {
            let times: Vec<f64> = of(strategy).map(|t| 1e3 * t.times.search).collect();
            super::super::mean(&times)
        };
        let both = [Strategy::Biased, Strategy::Guided];
        if both.iter().any(|&s| of(s).count() == 0)
            || both.iter().all(|&s| of(s).all(|t| !t.solved()))
        {
            continue;
        }
        missions.push(MissionTimes {
            name: case.name.clone(),
            biased_ms: mean_ms(Strategy::Biased),
            guided_ms: mean_ms(Strategy::Guided),
            flat_ms: mean_ms(Strategy::Flat),
            inference_ms: 1e3 * case.predictions.first().map_or(0.0, Prediction::seconds),
        });
    }
    Ok(BreakEven::of(device, trials, missions))
}

impl BreakEven {
    /// What the missions' times say; `None` without missions.
    #[must_use]
    pub fn of(device: &str, trials: u64, missions: Vec<MissionTimes>) -> Option<Self> {
        let all = |f: fn(&MissionTimes) -> f64| missions.iter().map(f).collect::<Vec<f64>>();
        let pairs = |f: fn(&MissionTimes) -> f64| {
            let pair = |m: &MissionTimes| (f(m), m.biased_ms);
            missions.iter().map(pair).collect::<Vec<_>>()
        };
        let inference_ms = Summary::of(&all(|m| m.inference_ms))?;
        let search_ratio = Ratio::of_means(&pairs(|m| m.guided_ms))?;
        // A search of t ms biased takes t·ratio guided: both are even at t = inference / (1 − ratio).
        let even = |ratio: f64| (ratio < 1.0).then(|| inference_ms.median / (1.0 - ratio));
        let sooner = |m: &&MissionTimes| m.guided_ms + m.inference_ms < m.biased_ms;
        Some(Self {
            device: device.to_owned(),
            trials,
            inference_ms,
            biased_ms: Summary::of(&all(|m| m.biased_ms))?,
            guided_ms: Summary::of(&all(|m| m.guided_ms))?,
            search_ratio,
            flat_ratio: Ratio::of_means(&pairs(|m| m.flat_ms))?,
            total_ratio: Ratio::of_means(&pairs(|m| m.guided_ms + m.inference_ms))?,
            sooner: missions.iter().filter(sooner).count() as f64 / missions.len() as f64,
            break_even_ms: even(search_ratio.value),
            break_even_range_ms: [even(search_ratio.low), even(search_ratio.high)],
            missions,
        })
    }

    /// One line for people to read.
    #[must_use]
    pub fn line(&self) -> String {
        let basis = format!(
            "inference on {} takes {:.2} ms, guided search {:.2} [{:.2}, {:.2}] of biased search, with flat predictions {:.2} [{:.2}, {:.2}]",
            self.device,
            self.inference_ms.median,
            self.search_ratio.value,
            self.search_ratio.low,
            self.search_ratio.high,
            self.flat_ratio.value,
            self.flat_ratio.low,
            self.flat_ratio.high
        );
        let worst = match self.break_even_range_ms[1] {
            Some(ms) => format!("{ms:.1}"),
            None => "never".to_owned(),
        };
        match (self.break_even_ms, self.break_even_range_ms[0]) {
            (Some(ms), Some(best)) => format!(
                "guidance pays from {ms:.1} ms of biased search on [{best:.1}, {worst}]: {basis}"
            ),
            _ => format!("guidance does not pay in time here: {basis}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn missions(guided: f64) -> Vec<MissionTimes> {
        (1..=20)
            .map(|k| MissionTimes {
                name: k.to_string(),
                biased_ms: f64::from(k),
                guided_ms: guided * f64::from(k),
                flat_ms: 0.5 * f64::from(k),
                inference_ms: 3.0,
            })
            .collect()
    }

    #[test]
    fn both_are_even_where_savings_equal_inference() {
        let even = BreakEven::of("cpu", 1, missions(0.75)).unwrap();
        assert!((even.break_even_ms.unwrap() - 12.0).abs() < 1e-9);
        // From 13 ms on guidance is sooner: eight of twenty.
        assert!((even.sooner - 0.4).abs() < 1e-9);
        assert!(even.line().contains("pays from 12.0 ms"), "{}", even.line());
        assert!((even.flat_ratio.value - 0.5).abs() < 1e-9);
    }

    #[test]
    fn guidance_that_saves_nothing_never_pays() {
        let even = BreakEven::of("cpu", 1, missions(1.25)).unwrap();
        assert_eq!(even.break_even_ms, None);
        assert!(even.line().contains("does not pay"));
        assert!(BreakEven::of("cpu", 1, Vec::new()).is_none());
    }
}
