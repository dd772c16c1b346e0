//! The `config` of a weight file: which network it is, and its sizes.

use serde::{Deserialize, Serialize};

use super::weights::{FORMAT_VERSION, Fault};
use crate::alphabet::MAX_PROPOSITIONS;
use crate::encoding::Encoding;

/// Constant features of the pool node.
pub const POOL_WIDTH: usize = 128;

/// The largest width of a layer that is accepted.
const MAX_WIDTH: usize = 8192;

/// The largest number of layers of one kind that is accepted.
const MAX_LAYERS: usize = 64;

/// Fields that every configuration may have; `dropout` concerns training alone.
const COMMON: [&str; 5] = ["format", "encoding", "kind", "variant", "dropout"];

/// How the automaton's feature meets the map's at PathNet's bottleneck.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fusion {
    /// One value per channel and cell.
    Dense,
    /// One value per channel, the same in every cell.
    Broadcast,
}

/// Whether the paper's PathNet has its skip connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Skip {
    /// At the third level (`nngtl.md`, IV-C).
    Third,
    /// None, as in the published code.
    None,
}

/// The residual blocks of StateNet's trunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Trunk {
    /// Three convolutions, four times wider at the end: ResNet-50 and its kin.
    #[serde(alias = "resnet50")]
    Bottleneck,
    /// Two convolutions.
    Basic,
}

/// PathNet as in the paper (IV-C).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPaper {
    /// Region channels.
    pub labels: usize,
    /// Cells per side of the raster and of the output: 200 in the paper.
    pub resolution: usize,
    /// Width of the first block.
    pub n1: usize,
    /// Widths of the graph layers.
    pub graph: Vec<usize>,
    /// The fusion at the bottleneck.
    pub fusion: Fusion,
    /// The skip connection.
    pub skip: Skip,
}

/// Our PathNet, which paints embeddings of regions onto their cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PathPaint {
    /// Region channels.
    pub labels: usize,
    /// Cells per side of the raster.
    pub resolution: usize,
    /// Widths of the graph layers.
    pub graph: Vec<usize>,
    /// Whether edges lead backwards too.
    pub reverse: bool,
    /// Cells per side at which the automaton's nodes see where regions lie; 0: they do not.
    #[serde(default)]
    pub look: usize,
    /// Values per region.
    pub embedding: usize,
    /// The U-Net.
    #[serde(flatten)]
    pub unet: UNet,
    /// Width of the last block.
    pub top: usize,
    /// Cells per side of the output: 200 in shipped weights.
    pub output: usize,
    /// Exponent that sharpens the heatmap.
    #[serde(default = "one")]
    pub power: f32,
}

fn one() -> f32 {
    1.0
}

/// The map network that our variants share.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UNet {
    /// Widths by level.
    pub widths: Vec<usize>,
    /// Stride of the first block: 1, 2 or 4.
    pub stem: usize,
    /// How many residual blocks stand at the bottleneck.
    pub middle: usize,
}

impl UNet {
    /// Cells per side by level.
    #[must_use]
    pub fn sizes(&self, resolution: usize) -> Vec<usize> {
        let first = resolution / self.stem.max(1);
        std::iter::successors(Some(first), |s| Some(s / 2))
            .take(self.widths.len())
            .collect()
    }
}

fn yes() -> bool {
    true
}

/// StateNet as in the paper (IV-C), with a choice of trunk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StatePaper {
    /// Region channels.
    pub labels: usize,
    /// Cells per side of the raster.
    pub resolution: usize,
    /// The kind of residual blocks.
    pub trunk: Trunk,
    /// Widths of the trunk's layers.
    pub trunk_widths: Vec<usize>,
    /// Blocks of each layer.
    pub trunk_blocks: Vec<usize>,
    /// Values that describe the map.
    pub map_feature: usize,
    /// Width of the first graph layer.
    pub first: usize,
    /// Whether a ReLU follows the first graph layer; the published network has none there.
    #[serde(default = "yes")]
    pub first_relu: bool,
    /// Widths of the other graph layers.
    pub graph: Vec<usize>,
}

/// Our StateNet, whose nodes look the map up where they need it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateLookup {
    /// Region channels.
    pub labels: usize,
    /// Cells per side of the raster.
    pub resolution: usize,
    /// The U-Net.
    #[serde(flatten)]
    pub unet: UNet,
    /// The level at which the map is looked up.
    pub stop: usize,
    /// Widths of the graph layers.
    pub graph: Vec<usize>,
    /// Whether edges lead backwards too.
    pub reverse: bool,
    /// Width of the head.
    pub head: usize,
}

/// Our StateNet that knows how far the regions are from each other and does not see the map otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StateWays {
    /// Region channels.
    pub labels: usize,
    /// Widths of the graph layers.
    pub graph: Vec<usize>,
    /// Whether edges lead backwards too.
    pub reverse: bool,
    /// Width of the head.
    pub head: usize,
}

/// The configuration of a network.
#[derive(Clone, Debug, PartialEq)]
pub enum Config {
    /// `pathnet`, `paper`.
    PathPaper(PathPaper),
    /// `pathnet`, `paint`.
    PathPaint(PathPaint),
    /// `statenet`, `paper`.
    StatePaper(StatePaper),
    /// `statenet`, `lookup`.
    StateLookup(StateLookup),
    /// `statenet`, `ways`.
    StateWays(StateWays),
}

/// What a network predicts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Where good paths run.
    PathNet,
    /// Which automaton states they visit.
    StateNet,
}

impl Config {
    /// Reads and checks a configuration.
    ///
    /// # Errors
    /// Versions other than ours, an unknown kind or variant, missing fields, numbers out of range.
    pub fn parse(value: &serde_json::Value) -> Result<Self, Vec<Fault>> {
        let text = |key: &str| value.get(key).and_then(|v| v.as_str()).unwrap_or_default();
        let mut faults = Vec::new();
        let known = [
            ("format", FORMAT_VERSION, FORMAT_VERSION),
            ("encoding", 1, Encoding::NEWEST),
        ];
        for (what, oldest, expected) in known {
            match value.get(what).and_then(serde_json::Value::as_u64) {
                Some(found) if (u64::from(oldest)..=u64::from(expected)).contains(&found) => {}
                Some(found) => faults.push(Fault::Version {
                    what,
                    found,
                    expected,
                }),
                None => faults.push(bad(format!("`{what}` is missing or not a whole number"))),
            }
        }
        let parsed = match (text("kind"), text("variant")) {
            ("pathnet", "paper") => read(value).map(Self::PathPaper),
            ("pathnet", "paint") => read(value).map(Self::PathPaint),
            ("statenet", "paper") => read(value).map(Self::StatePaper),
            ("statenet", "lookup") => read(value).map(Self::StateLookup),
            ("statenet", "ways") => read(value).map(Self::StateWays),
            (kind, variant) => Err(bad(format!(
                "kind `{kind}` and variant `{variant}` are unknown, expected pathnet (paper, paint) or statenet (paper, lookup, ways)"
            ))),
        };
        match parsed {
            Ok(config) => {
                faults.extend(config.check());
                faults.extend(config.unknown_fields(value));
                if faults.is_empty() {
                    Ok(config)
                } else {
                    Err(faults)
                }
            }
            Err(fault) => {
                faults.push(fault);
                Err(faults)
            }
        }
    }

    /// What the network predicts.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::PathPaper(_) | Self::PathPaint(_) => Kind::PathNet,
            Self::StatePaper(_) | Self::StateLookup(_) | Self::StateWays(_) => Kind::StateNet,
        }
    }

    /// The name of the variant.
    #[must_use]
    pub fn variant(&self) -> &'static str {
        match self {
            Self::PathPaper(_) | Self::StatePaper(_) => "paper",
            Self::PathPaint(_) => "paint",
            Self::StateLookup(_) => "lookup",
            Self::StateWays(_) => "ways",
        }
    }

    /// How many region channels the network has.
    #[must_use]
    pub fn labels(&self) -> usize {
        match self {
            Self::PathPaper(c) => c.labels,
            Self::PathPaint(c) => c.labels,
            Self::StatePaper(c) => c.labels,
            Self::StateLookup(c) => c.labels,
            Self::StateWays(c) => c.labels,
        }
    }

    /// Cells per side of the raster that the network reads; 0 if it reads none.
    #[must_use]
    pub fn resolution(&self) -> usize {
        match self {
            Self::PathPaper(c) => c.resolution,
            Self::PathPaint(c) => c.resolution,
            Self::StatePaper(c) => c.resolution,
            Self::StateLookup(c) => c.resolution,
            Self::StateWays(_) => 0,
        }
    }

    /// Whether the network reads the lengths of ways between regions.
    #[must_use]
    pub fn reads_ways(&self) -> bool {
        matches!(self, Self::StateWays(_))
    }

    /// The exponent that sharpens the heatmap; 1 for most.
    #[must_use]
    pub fn power(&self) -> f32 {
        match self {
            Self::PathPaint(c) => c.power,
            _ => 1.0,
        }
    }

    /// Fields that say nothing to this variant: mostly a name that is misspelt, whose default would hold silently.
    fn unknown_fields(&self, value: &serde_json::Value) -> Vec<Fault> {
        let known = match self {
            Self::PathPaper(c) => serde_json::to_value(c),
            Self::PathPaint(c) => serde_json::to_value(c),
            Self::StatePaper(c) => serde_json::to_value(c),
            Self::StateLookup(c) => serde_json::to_value(c),
            Self::StateWays(c) => serde_json::to_value(c),
        };
        let known = known.unwrap_or_default();
        let is_known = |name: &str| COMMON.contains(&name) || known.get(name).is_some();
        let fields = value.as_object().into_iter().flatten();
        let unknown = fields.filter(|(name, _)| !is_known(name));
        unknown
            .map(|(name, _)| bad(format!("`{name}` is no field of this variant")))
            .collect()
    }

    fn check(&self) -> Vec<Fault> {
        let mut c = Checks(Vec::new());
        c.number("labels", self.labels(), 1..=MAX_PROPOSITIONS);
        if !self.reads_ways() {
            c.number("resolution", self.resolution(), 8..=1024);
        }
        match self {
            Self::PathPaper(p) => {
                c.number("resolution", p.resolution, 32..=1024);
                c.number("n1", p.n1, 1..=MAX_WIDTH / 16);
                c.widths("graph", &p.graph, if p.skip == Skip::Third { 3 } else { 1 });
            }
            Self::PathPaint(p) => {
                if p.look > 0 && p.resolution % p.look != 0 {
                    c.fault(
                        "look",
                        p.look.to_string(),
                        "0 or a divisor of the resolution",
                    );
                }
                c.number("embedding", p.embedding, 1..=MAX_WIDTH);
                c.number("top", p.top, 1..=MAX_WIDTH);
                c.number("output", p.output, 8..=1024);
                c.widths("graph", &p.graph, 1);
                c.unet(&p.unet, p.resolution);
                if !(p.power > 0.0 && p.power <= 64.0) {
                    c.fault("power", p.power.to_string(), "above 0 and at most 64");
                }
            }
            Self::StatePaper(s) => {
                c.number("map_feature", s.map_feature, 1..=MAX_WIDTH);
                c.number("first", s.first, 1..=MAX_WIDTH);
                c.widths("graph", &s.graph, 1);
                c.widths("trunk_widths", &s.trunk_widths, 1);
                c.widths("trunk_blocks", &s.trunk_blocks, s.trunk_widths.len());
                c.number(
                    "trunk_blocks",
                    s.trunk_blocks.len(),
                    0..=s.trunk_widths.len(),
                );
                c.number(
                    "trunk_blocks",
                    s.trunk_blocks.iter().fold(0, |a, &b| b.saturating_add(a)),
                    1..=256,
                );
                c.number("resolution", s.resolution, 32..=1024);
            }
            Self::StateWays(s) => {
                c.number("head", s.head, 1..=MAX_WIDTH);
                c.widths("graph", &s.graph, 1);
            }
            Self::StateLookup(s) => {
                c.number("head", s.head, 1..=MAX_WIDTH);
                c.widths("graph", &s.graph, 1);
                c.unet(&s.unet, s.resolution);
                c.number("stop", s.stop, 0..=s.unet.widths.len().saturating_sub(2));
                if let Some(&side) = s.unet.sizes(s.resolution).get(s.stop)
                    && (side == 0 || s.resolution % side != 0)
                {
                    c.fault(
                        "stop",
                        s.stop.to_string(),
                        "a level whose size divides the resolution",
                    );
                }
            }
        }
        c.0
    }
}

fn read<'a, T: Deserialize<'a>>(value: &'a serde_json::Value) -> Result<T, Fault> {
    T::deserialize(value).map_err(|e| bad(e.to_string()))
}

fn bad(reason: String) -> Fault {
    Fault::BadMetadata {
        entry: "config",
        reason,
    }
}

struct Checks(Vec<Fault>);

impl Checks {
    fn fault(&mut self, field: &'static str, found: String, expected: &str) {
        self.0.push(Fault::Config {
            field,
            found,
            expected: expected.to_owned(),
        });
    }

    fn number(
        &mut self,
        field: &'static str,
        found: usize,
        range: std::ops::RangeInclusive<usize>,
    ) {
        if !range.contains(&found) {
            let expected = format!("{} to {}", range.start(), range.end());
            self.fault(field, found.to_string(), &expected);
        }
    }

    fn widths(&mut self, field: &'static str, widths: &[usize], least: usize) {
        if widths.len() < least || widths.len() > MAX_LAYERS {
            self.fault(
                field,
                format!("{} numbers", widths.len()),
                &format!("{least} to {MAX_LAYERS} numbers"),
            );
        }
        if let Some(&wrong) = widths.iter().find(|&&w| w == 0 || w > MAX_WIDTH) {
            self.fault(field, wrong.to_string(), &format!("1 to {MAX_WIDTH}"));
        }
    }

    fn unet(&mut self, unet: &UNet, resolution: usize) {
        self.widths("widths", &unet.widths, 2);
        if ![1, 2, 4].contains(&unet.stem) {
            self.fault("stem", unet.stem.to_string(), "1, 2 or 4");
        }
        self.number("middle", unet.middle, 0..=MAX_LAYERS);
        if unet.sizes(resolution).last().is_none_or(|&side| side == 0) {
            self.fault(
                "widths",
                format!("{} levels", unet.widths.len()),
                "no more levels than the resolution can be halved",
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_fault_of_a_config_is_told() {
        let config = json!({"format": 2, "encoding": 3, "kind": "pathnet", "variant": "paper", "labels": 0,
            "resolution": 7, "n1": 8, "graph": [64, 0], "fusion": "dense", "skip": "third"});
        let faults = Config::parse(&config).unwrap_err();
        let text: Vec<String> = faults.iter().map(ToString::to_string).collect();
        for part in [
            "format version 2",
            "encoding version 3",
            "`labels` is 0",
            "`resolution` is 7",
            "`graph` is 2 numbers",
            "`graph` is 0",
        ] {
            assert!(text.iter().any(|t| t.contains(part)), "{part}: {text:?}");
        }
    }

    #[test]
    fn unknown_variants_and_missing_fields_are_named() {
        let text = |v| Config::parse(&v).unwrap_err()[0].to_string();
        assert!(
            text(json!({"format": 1, "encoding": 1, "kind": "pathnet", "variant": "x"}))
                .contains("variant `x`")
        );
        let config = json!({"format": 1, "encoding": 1, "kind": "statenet", "variant": "lookup", "labels": 7});
        assert!(text(config).contains("resolution"));
        assert!(text(json!(null)).contains("format"));
    }
}
