//! Which obstacles wall a part of the free space in.

use nalgebra::Point2;

use super::mesh::{Mesh, WallEdge};
use super::{Side, Workspace};

/// A part of the free space that cannot be left, and what closes it off.
#[derive(Clone, Debug, PartialEq)]
pub struct Enclosure {
    /// Whether it is the first of the two points asked about that is enclosed; else the second.
    pub first: bool,
    /// The obstacles along its outer border, by number, ascending.
    pub obstacles: Vec<usize>,
    /// Whether the end of the map is part of that border.
    pub bounds: bool,
    /// Its area, in squared map units.
    pub area: f64,
    /// The regions of which some part lies inside, by number, ascending.
    pub regions: Vec<usize>,
}

impl Enclosure {
    /// What keeps `a` and `b` apart: the part that lies within the other one's border, or, of two
    /// that lie side by side, the smaller.
    pub(super) fn between(
        map: &Workspace,
        mesh: &Mesh,
        a: Point2<f64>,
        b: Point2<f64>,
    ) -> Option<Self> {
        let (of_a, of_b) = (mesh.component_at(a)?, mesh.component_at(b)?);
        if of_a == of_b {
            return None;
        }
        let outer = |component| mesh.walls(component).into_iter().next().unwrap_or_default();
        let (around_a, around_b) = (outer(of_a), outer(of_b));
        let (area_a, area_b) = (mesh.area(of_a), mesh.area(of_b));
        let first = match (encloses(&around_a, b), encloses(&around_b, a)) {
            (true, false) => false,
            (false, true) => true,
            _ => area_a < area_b,
        };
        let (walls, component, area) = if first {
            (around_a, of_a, area_a)
        } else {
            (around_b, of_b, area_b)
        };
        let mut enclosure = Self {
            first,
            obstacles: Vec::new(),
            bounds: false,
            area,
            regions: regions_in(map, mesh, component),
        };
        for [p, q] in walls {
            enclosure.add_wall(map, nalgebra::center(&p, &q));
        }
        enclosure.obstacles.sort_unstable();
        enclosure.obstacles.dedup();
        Some(enclosure)
    }

    /// Notes what the border at `p` belongs to.
    fn add_wall(&mut self, map: &Workspace, p: Point2<f64>) {
        let index = &map.obstacle_index;
        let near = 4.0 * map.tolerance;
        let touching = index
            .polygons_near(p)
            .into_iter()
            .filter(|&i| map.obstacles[i].side_of(p, near) != Side::Outside);
        let before = self.obstacles.len();
        self.obstacles.extend(touching);
        self.bounds |= self.obstacles.len() == before;
    }
}

/// The regions of which some part lies in a connected part of the free space.
fn regions_in(map: &Workspace, mesh: &Mesh, component: u32) -> Vec<usize> {
    let holds = |i: &usize| {
        let letters = map.alphabet().letters_with(*i);
        letters.iter().any(|letter| {
            let cells = map.cells(letter).iter();
            cells
                .map(|c| mesh.component_at(c.inner_point()))
                .any(|c| c == Some(component))
        })
    };
    (0..map.regions().len()).filter(holds).collect()
}

/// Whether `p` lies within a closed border.
fn encloses(border: &[WallEdge], p: Point2<f64>) -> bool {
    let crossed = |&&[a, b]: &&WallEdge| {
        (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x)
    };
    border.iter().filter(crossed).count() % 2 == 1
}
