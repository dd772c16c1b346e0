//! The measurements as Markdown and CSV.

use std::fmt::Write as _;

use super::{InferenceTable, LeftOut};

impl InferenceTable {
    /// The table as Markdown, and the line that says from when on guidance pays.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let mut text = format!(
            "{}; batch 1, f32, {} thread{} on the CPU, an automaton of 12 states and 60 transitions. Times in ms; GFLOP/s are those of the fastest run.\n\n",
            self.machine,
            self.settings.threads,
            if self.settings.threads == 1 { "" } else { "s" }
        );
        for device in &self.devices {
            let _ = writeln!(
                text,
                "- {} ({}): {:.1} GFLOP/s in a large matrix product",
                device.name, device.kind, device.peak_gflops
            );
        }
        if !self.start.is_empty() {
            text.push_str("\n| before the first inference | device | load, median | least | first prediction, median | least |\n| --- | --- | ---: | ---: | ---: | ---: |\n");
        }
        for r in &self.start {
            let (load, first) = (&r.load_ms, &r.first_ms);
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.2} | {:.2} | {:.2} |",
                r.model, r.device, load.median, load.min, first.median, first.min
            );
        }
        text.push_str("\n| network | device | GFLOP | start | first run | median | 95 % | least | CPU time | GFLOP/s | of peak |\n");
        text.push_str(
            "| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |\n",
        );
        for r in &self.rows {
            let _ = writeln!(
                text,
                "| {} | {} | {:.2} | {:.1} | {:.2} | {:.2} | {:.2} | {:.2} | {} | {:.1} | {:.0} % |",
                r.network,
                r.device,
                2e-9 * r.multiply_adds as f64,
                r.start_ms,
                r.first_ms,
                r.steady_ms.median,
                r.steady_ms.p95,
                r.steady_ms.min,
                r.cpu_ms.map_or("–".to_owned(), |ms| format!("{ms:.2}")),
                r.best_gflops,
                100.0 * r.peak_share
            );
        }
        for LeftOut {
            network,
            device,
            reason,
        } in &self.left_out
        {
            let _ = writeln!(text, "\nNot measured: {network} on {device}, {reason}.");
        }
        if let Some(even) = &self.break_even {
            let _ = writeln!(
                text,
                "\n| {} missions, {} runs each | median | mean | 95 % |\n| --- | ---: | ---: | ---: |",
                even.missions.len(),
                even.trials
            );
            let rows = [
                ("biased search", &even.biased_ms),
                ("guided search", &even.guided_ms),
                ("encoding and inference", &even.inference_ms),
            ];
            for (name, s) in rows {
                let _ = writeln!(
                    text,
                    "| {name}, ms | {:.2} | {:.2} | {:.2} |",
                    s.median, s.mean, s.p95
                );
            }
            let total = even.total_ratio;
            let _ = writeln!(
                text,
                "\nGuided with inference takes {:.2} [{:.2}, {:.2}] of biased search and is sooner on {:.0} % of the missions.\n\n{}",
                total.value,
                total.low,
                total.high,
                100.0 * even.sooner,
                even.line()
            );
        }
        text
    }

    /// One line for each network and device.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from(
            "network,device,multiply_adds,start_ms,first_ms,runs,median_ms,p95_ms,min_ms,cpu_ms,gflops,best_gflops,peak_share\n",
        );
        for r in &self.rows {
            let _ = writeln!(
                text,
                "\"{}\",\"{}\",{},{},{},{},{},{},{},{},{},{},{}",
                r.network.replace('"', "'"),
                r.device.replace('"', "'"),
                r.multiply_adds,
                r.start_ms,
                r.first_ms,
                r.steady_ms.count,
                r.steady_ms.median,
                r.steady_ms.p95,
                r.steady_ms.min,
                r.cpu_ms.map_or(String::new(), |ms| ms.to_string()),
                r.gflops,
                r.best_gflops,
                r.peak_share
            );
        }
        text
    }
}
