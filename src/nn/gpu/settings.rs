//! How adapters are used.

use std::env;
use std::path::PathBuf;

/// The environment variable that names the folder of compiled kernels, or says `off`.
pub const CACHE_VARIABLE: &str = "NNGTL_KERNEL_CACHE";

/// The environment variable for [`GpuSettings::narrow`]: `auto`, `on` or `off`.
pub const NARROW_VARIABLE: &str = "NNGTL_GPU_F16";

/// The environment variable for [`GpuSettings::subgroups`]: `auto`, `on` or `off`.
pub const SUBGROUPS_VARIABLE: &str = "NNGTL_GPU_SUBGROUPS";

/// Whether to use an ability of the adapter. Without the ability it is never used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Use {
    /// Where it is expected to pay.
    #[default]
    Auto,
    /// Wherever there is the ability.
    On,
    /// Never.
    Off,
}

impl Use {
    /// Whether to use an ability that is there or not, and that is expected to pay or not.
    #[must_use]
    pub fn decide(self, there: bool, pays: bool) -> bool {
        there
            && match self {
                Self::Auto => pays,
                Self::On => true,
                Self::Off => false,
            }
    }
}

/// How adapters are used. The default keeps nothing on disk; [`Self::from_env`] is what the
/// program runs with.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GpuSettings {
    /// The folder in which compiled kernels are kept from one run to the next, if any.
    pub kernel_cache: Option<PathBuf>,
    /// Products in 16-bit floats (sums of sixteen at a time; those are added up in 32 bits).
    /// `Auto`: on hardware GPUs, for networks whose files store 16-bit floats.
    pub narrow: Use,
    /// Subgroup operations in kernels that add up. `Auto`: on hardware GPUs.
    pub subgroups: Use,
}

impl GpuSettings {
    /// What the environment says: [`CACHE_VARIABLE`] (unset: `nngtl/kernels` in the user's cache
    /// folder), [`NARROW_VARIABLE`] and [`SUBGROUPS_VARIABLE`].
    #[must_use]
    pub fn from_env() -> Self {
        let kernel_cache = match env::var_os(CACHE_VARIABLE) {
            None => user_cache().map(|folder| folder.join("nngtl").join("kernels")),
            Some(value) if value.is_empty() || value == "off" => None,
            Some(folder) => Some(folder.into()),
        };
        Self {
            kernel_cache,
            narrow: choice(NARROW_VARIABLE),
            subgroups: choice(SUBGROUPS_VARIABLE),
        }
    }
}

fn choice(variable: &str) -> Use {
    let Ok(value) = env::var(variable) else {
        return Use::Auto;
    };
    match value.as_str() {
        "" | "auto" => Use::Auto,
        "on" => Use::On,
        "off" => Use::Off,
        other => {
            log::warn!("{variable} is `{other}`, expected auto, on or off: taken as auto");
            Use::Auto
        }
    }
}

/// The folder where programs of this user keep what they can make again.
fn user_cache() -> Option<PathBuf> {
    let folder = |variable: &str| {
        let path = PathBuf::from(env::var_os(variable)?);
        // The XDG base directory specification has relative paths ignored.
        path.is_absolute().then_some(path)
    };
    if cfg!(windows) {
        return folder("LOCALAPPDATA");
    }
    let home = || folder("HOME");
    if cfg!(target_os = "macos") {
        return home().map(|home| home.join("Library/Caches"));
    }
    folder("XDG_CACHE_HOME").or_else(|| home().map(|home| home.join(".cache")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ability_that_is_not_there_is_never_used() {
        for choice in [Use::Auto, Use::On, Use::Off] {
            assert!(!choice.decide(false, true));
            assert_eq!(choice.decide(true, true), choice != Use::Off);
            assert_eq!(choice.decide(true, false), choice == Use::On);
        }
    }
}
