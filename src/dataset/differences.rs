//! What tells the settings of two data sets apart.

use serde_json::Value;

use super::record::Manifest;

/// A setting that two data sets do not share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// Its name.
    pub setting: String,
    /// What it is in the set that was there first.
    pub old: String,
    /// What it is in the other one.
    pub new: String,
}

/// Differences as part of a sentence, in which `new` stands before what is new.
pub(super) fn listed(differences: &[Difference], new: &str) -> String {
    let texts = differences
        .iter()
        .map(|d| format!("{} {}, {new} {}", d.setting, d.old, d.new));
    texts.collect::<Vec<_>>().join("; ")
}

/// The settings that decide a sample and differ, in the order of the manifests; the range of maps is none of them.
pub(super) fn differences(old: &Manifest, new: &Manifest) -> Vec<Difference> {
    let (old, new) = (settings(old), settings(new));
    let value = |of: &[(String, String)], setting: &str| {
        let found = of.iter().find(|(name, _)| name == setting);
        found.map_or_else(|| unwritten(setting), |(_, value)| value.clone())
    };
    let added = new.iter().filter(|n| old.iter().all(|o| o.0 != n.0));
    let names = old.iter().chain(added).map(|(name, _)| name);
    names
        .map(|setting| Difference {
            setting: setting.clone(),
            old: value(&old, setting),
            new: value(&new, setting),
        })
        .filter(|d| d.old != d.new)
        .collect()
}

/// Settings by name, with their values as text.
fn settings(manifest: &Manifest) -> Vec<(String, String)> {
    let own = [
        ("seed", manifest.seed.to_string()),
        ("version", manifest.generator.clone()),
    ];
    let others = manifest.settings.as_object().into_iter().flatten();
    let others = others.map(|(name, value)| (name.clone(), text(value)));
    let own = own.map(|(name, value)| (name.to_owned(), value));
    own.into_iter().chain(others).collect()
}

/// Objects as on the command line, in their order: that of the families decides which of them is drawn.
fn text(value: &Value) -> String {
    match value {
        Value::Object(parts) => {
            let parts = parts.iter().map(|(name, v)| format!("{name}={}", text(v)));
            parts.collect::<Vec<_>>().join(",")
        }
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}

/// What a setting is that a manifest does not name.
fn unwritten(setting: &str) -> String {
    match setting {
        "expert" => "exact",
        _ => "not given",
    }
    .to_owned()
}
