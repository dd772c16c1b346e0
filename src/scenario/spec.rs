//! What a scenario file says, before anything is checked.

use std::fmt;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::pair::{self, Vertices};
use crate::maps::{Format, MapOptions, Units};

/// The weight λ of a scenario that names none (the published TL-RRT* planner's).
pub const DEFAULT_WEIGHT: f64 = 0.2;

/// A scenario as it stands in its file: plain numbers and names, nothing checked.
///
/// Write one with serde to make a scenario file; turn it into a
/// [`Scenario`](super::Scenario) with [`Scenario::from_spec`](super::Scenario::from_spec).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScenarioSpec {
    /// What the scenario is called; a file without a name is called like the file.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Where the robot stands at first, in map units.
    #[serde(deserialize_with = "pair::one")]
    pub start: [f64; 2],
    /// The mission, as an LTL formula over the names of the regions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub task: Option<String>,
    /// λ in `[0, 1]`, the weight of the prefix in the cost (0.2 if not given).
    #[serde(default = "default_weight")]
    pub weight: f64,
    /// The map.
    pub workspace: WorkspaceSpec,
}

/// A scenario as it stands in its file, where a map file and a robot's radius may take the place of
/// bounds and obstacles.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ScenarioFile {
    #[serde(default)]
    pub(super) name: String,
    #[serde(default, deserialize_with = "pair::maybe")]
    pub(super) start: Option<[f64; 2]>,
    pub(super) task: Option<String>,
    #[serde(default = "default_weight")]
    pub(super) weight: f64,
    #[serde(default)]
    pub(super) robot_radius: f64,
    pub(super) map: Option<MapSpec>,
    pub(super) workspace: Option<WorkspaceFile>,
}

/// The `[workspace]` of a [`ScenarioFile`].
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorkspaceFile {
    #[serde(default, deserialize_with = "pair::maybe_corners")]
    pub(super) bounds: Option<[[f64; 2]; 2]>,
    #[serde(default, deserialize_with = "pair::polygons")]
    pub(super) obstacles: Vec<Vec<[f64; 2]>>,
    #[serde(default)]
    pub(super) regions: RegionSpecs,
    pub(super) grid: Option<GridSpec>,
}

/// The `[map]` of a scenario file: which map file, and how to read it.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MapSpec {
    pub(super) file: String,
    tolerance: Option<f64>,
    unknown: Option<Ground>,
    swamp: Option<Ground>,
    water: Option<Ground>,
    cell: Option<f64>,
    units: Option<Units>,
    #[serde(default, deserialize_with = "pair::maybe")]
    reference: Option<[f64; 2]>,
}

/// What a kind of cell is for the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Ground {
    Free,
    Obstacle,
}

impl MapSpec {
    /// A setting that is given and means nothing in maps of this format.
    pub(super) fn foreign(&self, format: Format) -> Option<&'static str> {
        let given = [
            ("tolerance", self.tolerance.is_some()),
            ("unknown", self.unknown.is_some()),
            ("cell", self.cell.is_some()),
            ("water", self.water.is_some()),
            ("swamp", self.swamp.is_some()),
            ("units", self.units.is_some()),
            ("reference", self.reference.is_some()),
        ];
        let known: &[&str] = match format {
            Format::Ros => &["tolerance", "unknown"],
            Format::MovingAi => &["tolerance", "cell", "water", "swamp"],
            Format::GeoJson => &["units", "reference"],
        };
        let foreign = given
            .into_iter()
            .find(|(name, is)| *is && !known.contains(name));
        foreign.map(|(name, _)| name)
    }

    pub(super) fn options(&self, robot_radius: f64) -> MapOptions {
        MapOptions {
            robot_radius,
            tolerance: self.tolerance,
            unknown_is_free: self.unknown == Some(Ground::Free),
            swamp_is_obstacle: self.swamp == Some(Ground::Obstacle),
            water_is_free: self.water == Some(Ground::Free),
            cell: self.cell,
            units: self.units,
            reference: self.reference,
        }
    }
}

/// The map part of a [`ScenarioSpec`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkspaceSpec {
    /// Lower-left and upper-right corner, in map units.
    #[serde(deserialize_with = "pair::corners")]
    pub bounds: [[f64; 2]; 2],
    /// Simple polygons that the robot must not enter; they may overlap.
    #[serde(default, deserialize_with = "pair::polygons")]
    pub obstacles: Vec<Vec<[f64; 2]>>,
    /// The labelled regions, in file order; they may overlap.
    #[serde(default)]
    pub regions: RegionSpecs,
    /// A grid over the map, between whose cell centres the robot moves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridSpec>,
}

/// A grid over a map: the robot moves between centres of cells, along rows and columns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridSpec {
    /// How many cells along x and along y.
    pub cells: [u32; 2],
    /// Side of a cell, in map units.
    pub cell: f64,
}

/// Named regions in the order of the file: a map `name → vertices` on paper.
///
/// A name that occurs twice is an error when read, where a plain map would silently keep one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegionSpecs(pub Vec<(String, Vec<[f64; 2]>)>);

fn default_weight() -> f64 {
    DEFAULT_WEIGHT
}

impl Serialize for RegionSpecs {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, vertices) in &self.0 {
            map.serialize_entry(name, vertices)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for RegionSpecs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(RegionsVisitor)
    }
}

struct RegionsVisitor;

impl<'de> Visitor<'de> for RegionsVisitor {
    type Value = RegionSpecs;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table of regions: name = [[x, y], [x, y], [x, y], …]")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RegionSpecs, A::Error> {
        let mut regions: Vec<(String, Vec<[f64; 2]>)> = Vec::new();
        while let Some(name) = map.next_key::<String>()? {
            if regions.iter().any(|(n, _)| *n == name) {
                return Err(A::Error::custom(format_args!(
                    "region `{name}` is there twice: give each region a name of its own"
                )));
            }
            regions.push((name, map.next_value::<Vertices>()?.0));
        }
        Ok(RegionSpecs(regions))
    }
}
