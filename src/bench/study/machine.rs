//! What the measurements were made on.

use serde::Serialize;

/// The machine and the program.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// The processor, as the system calls it; its architecture where the system does not say.
    pub cpu: String,
    /// Cores that this process may use.
    pub cores: usize,
    /// The operating system.
    pub system: String,
    /// The program's version.
    pub version: String,
    /// `release`, or `debug` for a build whose times mean little.
    pub build: String,
    /// What ran the networks; none if they did not run.
    pub devices: Vec<String>,
}

impl Machine {
    /// This machine; `devices` are what ran the networks.
    #[must_use]
    pub fn here(devices: Vec<String>) -> Self {
        let debug = cfg!(debug_assertions);
        Self {
            cpu: cpu().unwrap_or_else(|| std::env::consts::ARCH.to_owned()),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            build: if debug { "debug" } else { "release" }.to_owned(),
            devices,
        }
    }

    /// One line for people to read.
    #[must_use]
    pub fn line(&self) -> String {
        let devices = match self.devices.as_slice() {
            [] => "no networks".to_owned(),
            some => format!("networks on {}", some.join(", ")),
        };
        format!(
            "{}, {} core{}, {}; nngtl {} ({} build), {devices}",
            self.cpu,
            self.cores,
            if self.cores == 1 { "" } else { "s" },
            self.system,
            self.version,
            self.build,
        )
    }
}

/// The processor's name where the system tells it in a file (Linux).
fn cpu() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let names = text.lines().filter_map(|line| {
        let (key, name) = line.split_once(':')?;
        let is_name = ["model name", "Model", "Hardware"].contains(&key.trim());
        is_name.then(|| name.trim().to_owned())
    });
    names.into_iter().find(|name| !name.is_empty())
}
