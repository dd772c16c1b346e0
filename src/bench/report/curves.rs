//! Which share of the runs has found a plan by when.

use super::super::Trial;

/// The share of these runs that has found a plan, as steps (value, share) upwards from 0; runs without a plan
/// count among all. Values that a picture could not tell apart (0.2 %) are put together.
pub(in crate::bench) fn success(trials: &[&Trial], value: impl Fn(&Trial) -> f64) -> Vec<[f64; 2]> {
    let solved = trials.iter().filter(|t| t.solved());
    let mut values: Vec<f64> = solved.map(|t| value(t)).collect();
    values.sort_by(f64::total_cmp);
    let all = trials.len() as f64;
    let mut steps: Vec<[f64; 2]> = Vec::new();
    for (k, value) in values.into_iter().enumerate() {
        let share = (k + 1) as f64 / all;
        match steps.last_mut() {
            Some(last) if value <= last[0] * 1.002 => last[1] = share,
            _ => {
                let before = k as f64 / all;
                steps.extend([[value, before], [value, share]]);
            }
        }
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::super::tests::trial;
    use super::*;
    use crate::bench::Strategy;

    #[test]
    fn runs_without_a_plan_never_count_as_done() {
        let runs: Vec<Trial> = [Some(10), Some(10), Some(400), None]
            .map(|n| trial("m", None, Strategy::Biased, n))
            .to_vec();
        let runs: Vec<&Trial> = runs.iter().collect();
        let steps = success(&runs, |t| t.iterations_until(t.plan));
        assert_eq!(
            steps,
            [[10.0, 0.0], [10.0, 0.5], [400.0, 0.5], [400.0, 0.75]]
        );
        assert!(success(&runs[3..], |t| t.iterations_until(t.plan)).is_empty());
    }
}
