//! Pictures of maps, heatmaps, trees and plans: SVG and PNG, without a screen, a browser or fonts
//! of the system.
//!
//! ```
//! use nngtl::{render::Picture, scenario::Scenario};
//! let scenario = Scenario::load("scenarios/case-study.toml")?;
//! let svg = Picture::new(&scenario.workspace)
//!     .start(scenario.start)
//!     .title(&scenario.name)
//!     .subtitle(&scenario.task)
//!     .to_svg();
//! assert!(svg.starts_with("<svg") && svg.contains(">l2</text>"));
//! # Ok::<(), nngtl::scenario::ScenarioError>(())
//! ```

pub(crate) mod chart;
mod colour;
mod labels;
mod legend;
mod raster;
mod shapes;
mod svg;
mod text;

use nalgebra::Point2;

use crate::guidance::Heatmap;
use crate::plan::Path;
use crate::workspace::Workspace;

pub(crate) use raster::svg_png;
pub use raster::{RenderError, heatmap_npy, heatmap_png};

/// A picture of a map and of what was found on it; build it up, then write it out.
#[derive(Clone, Debug)]
pub struct Picture<'a> {
    workspace: &'a Workspace,
    start: Option<Point2<f64>>,
    heatmap: Option<&'a Heatmap>,
    tree: Vec<(Point2<f64>, Point2<f64>)>,
    bands: Vec<(Point2<f64>, Point2<f64>)>,
    bands_meaning: &'static str,
    path: Option<&'a Path>,
    title: Option<String>,
    subtitle: Option<String>,
}

impl<'a> Picture<'a> {
    /// A picture of the map: obstacles hatched in grey, regions in pastel with their names.
    #[must_use]
    pub fn new(workspace: &'a Workspace) -> Self {
        Self {
            workspace,
            start: None,
            heatmap: None,
            tree: Vec::new(),
            bands: Vec::new(),
            bands_meaning: "",
            path: None,
            title: None,
            subtitle: None,
        }
    }

    /// Marks where the robot stands at first.
    #[must_use]
    pub fn start(mut self, at: Point2<f64>) -> Self {
        self.start = Some(at);
        self
    }

    /// Lays a heatmap under the map, scaled to its largest value.
    #[must_use]
    pub fn heatmap(mut self, heatmap: &'a Heatmap) -> Self {
        self.heatmap = Some(heatmap);
        self
    }

    /// Draws the edges of a search tree, in map units.
    #[must_use]
    pub fn tree(mut self, edges: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>) -> Self {
        self.tree.extend(edges);
        self
    }

    /// Lays a broad band under these lines, in map units, and explains it with one word or two: the
    /// skills of a library, or the parts of a plan that were reused.
    #[must_use]
    pub fn bands(
        mut self,
        meaning: &'static str,
        lines: impl IntoIterator<Item = (Point2<f64>, Point2<f64>)>,
    ) -> Self {
        self.bands.extend(lines);
        self.bands_meaning = meaning;
        self
    }

    /// Draws a plan: the prefix solid with arrows, the suffix dashed, a ring where the robot
    /// stays; visits of regions are numbered in order.
    #[must_use]
    pub fn path(mut self, path: &'a Path) -> Self {
        self.path = Some(path);
        self
    }

    /// Sets the heading.
    #[must_use]
    pub fn title(mut self, title: impl Into<String>) -> Self {
        self.title = Some(title.into());
        self
    }

    /// Sets the line below the heading, usually the mission.
    #[must_use]
    pub fn subtitle(mut self, subtitle: impl Into<String>) -> Self {
        self.subtitle = Some(subtitle.into());
        self
    }

    /// The picture as an SVG document.
    #[must_use]
    pub fn to_svg(&self) -> String {
        svg::draw(self, svg::Layers::All).text
    }

    /// The picture as a PNG file, `scale` times as large as the SVG (which is about 900 pixels
    /// wide); between 0.1 and 8.
    ///
    /// # Errors
    /// If `scale` is out of range, or the picture cannot be drawn.
    pub fn to_png(&self, scale: f64) -> Result<Vec<u8>, RenderError> {
        raster::picture_png(self, scale)
    }
}

#[cfg(test)]
mod tests;
