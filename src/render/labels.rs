//! Finding room for names: a label goes where it hides least.

/// A point of the picture, in pixels from its upper-left corner.
pub(super) type Px = [f64; 2];

/// An axis-parallel box in pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rect {
    pub(super) min: Px,
    pub(super) max: Px,
}

impl Rect {
    pub(super) fn centred([x, y]: Px, width: f64, height: f64) -> Self {
        Self {
            min: [x - width / 2.0, y - height / 2.0],
            max: [x + width / 2.0, y + height / 2.0],
        }
    }

    pub(super) fn contains(&self, [x, y]: Px) -> bool {
        x >= self.min[0] && x <= self.max[0] && y >= self.min[1] && y <= self.max[1]
    }

    fn shared_area(&self, other: &Self) -> f64 {
        let along =
            |k: usize| (self.max[k].min(other.max[k]) - self.min[k].max(other.min[k])).max(0.0);
        along(0) * along(1)
    }

    fn probes(&self) -> [Px; 9] {
        let xs = [self.min[0], (self.min[0] + self.max[0]) / 2.0, self.max[0]];
        let ys = [self.min[1], (self.min[1] + self.max[1]) / 2.0, self.max[1]];
        std::array::from_fn(|i| [xs[i % 3], ys[i / 3]])
    }

    /// The length of the part of the segment that lies in the box (slab clipping).
    fn length_inside(&self, a: Px, b: Px) -> f64 {
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for k in 0..2 {
            let d = b[k] - a[k];
            let (s, t) = ((self.min[k] - a[k]) / d, (self.max[k] - a[k]) / d);
            if d == 0.0 {
                if a[k] < self.min[k] || a[k] > self.max[k] {
                    return 0.0;
                }
            } else {
                from = from.max(s.min(t));
                to = to.min(s.max(t));
            }
        }
        (to - from).max(0.0) * (b[0] - a[0]).hypot(b[1] - a[1])
    }
}

/// What is already in the picture, and what labels should keep clear of.
pub(super) struct Board {
    /// The map's frame; labels stay inside.
    pub(super) frame: Rect,
    /// Paths.
    pub(super) lines: Vec<(Px, Px)>,
    /// Markers and labels that are placed.
    pub(super) boxes: Vec<Rect>,
    /// Obstacles, as rings.
    pub(super) walls: Vec<Vec<Px>>,
}

impl Board {
    /// Where a label of this size is read best: inside `ring` if it can be, otherwise beside it.
    pub(super) fn room_in(&self, ring: &[Px], width: f64, height: f64) -> Rect {
        let (min, max) = extent(ring);
        let middle = [(min[0] + max[0]) / 2.0, (min[1] + max[1]) / 2.0];
        const STEPS: usize = 24;
        let reach = |k: usize, pad: f64, i: usize| {
            min[k] - pad + (max[k] - min[k] + 2.0 * pad) * i as f64 / STEPS as f64
        };
        let candidates = (0..=STEPS * (STEPS + 2)).map(|n| {
            let (i, j) = (n % (STEPS + 1), n / (STEPS + 1));
            [reach(0, width * 0.7, i), reach(1, height * 0.9, j)]
        });
        let own = |rect: &Rect, at: Px| {
            let outside = rect.probes().iter().filter(|&&p| !inside(ring, p)).count();
            6.0 * outside as f64 + 0.15 * (at[0] - middle[0]).hypot(at[1] - middle[1])
        };
        self.best(candidates, width, height, own)
    }

    /// Whether a label there would hide part of what is placed.
    pub(super) fn overlaps(&self, rect: &Rect) -> bool {
        self.boxes.iter().any(|b| rect.shared_area(b) > 0.0)
    }

    /// Places a label there. Returns its middle.
    pub(super) fn take(&mut self, rect: Rect) -> Px {
        self.boxes.push(rect);
        [0, 1].map(|k| (rect.min[k] + rect.max[k]) / 2.0)
    }

    /// Places a label of this size around a marker of radius `radius`.
    pub(super) fn place_beside(&mut self, at: Px, radius: f64, width: f64, height: f64) -> Px {
        let candidates = (0..24).map(|i| {
            let angle = f64::from(i) * std::f64::consts::TAU / 24.0;
            let (sin, cos) = angle.sin_cos();
            [
                at[0] + cos * (radius + width / 2.0),
                at[1] - sin * (radius + height / 2.0),
            ]
        });
        // Upwards and to the right reads best.
        let own = |_: &Rect, p: Px| 0.02 * ((at[0] - p[0]).max(0.0) + (p[1] - at[1]).max(0.0));
        let rect = self.best(candidates, width, height, own);
        self.take(rect)
    }

    /// Of the candidates for a label's middle the one that costs least.
    fn best(
        &self,
        candidates: impl Iterator<Item = Px>,
        width: f64,
        height: f64,
        own: impl Fn(&Rect, Px) -> f64,
    ) -> Rect {
        let cost = |at: Px| {
            let rect = Rect::centred(at, width, height);
            own(&rect, at) + self.crowding(&rect)
        };
        let best = candidates
            .map(|at| (cost(at), at))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(self.frame.min, |(_, at)| at);
        Rect::centred(best, width, height)
    }

    /// What a label at `rect` would hide; 0 if nothing.
    fn crowding(&self, rect: &Rect) -> f64 {
        let lines: f64 = self
            .lines
            .iter()
            .map(|&(a, b)| rect.length_inside(a, b))
            .sum();
        let boxes: f64 = self.boxes.iter().map(|b| rect.shared_area(b)).sum();
        let probes = rect.probes();
        let off = probes.iter().filter(|&&p| !self.frame.contains(p)).count();
        let walled = probes
            .iter()
            .filter(|&&p| self.walls.iter().any(|w| inside(w, p)))
            .count();
        0.8 * lines + 0.5 * boxes + 200.0 * off as f64 + 10.0 * walled as f64
    }
}

fn extent(ring: &[Px]) -> (Px, Px) {
    ring.iter().fold(
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
        |(lo, hi), p| {
            (
                [lo[0].min(p[0]), lo[1].min(p[1])],
                [hi[0].max(p[0]), hi[1].max(p[1])],
            )
        },
    )
}

/// Even-odd test; borders may go either way.
fn inside(ring: &[Px], [x, y]: Px) -> bool {
    let mut within = false;
    let mut a = ring[ring.len() - 1];
    for &b in ring {
        if (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]) {
            within = !within;
        }
        a = b;
    }
    within
}

#[cfg(test)]
mod tests {
    use super::*;

    fn board() -> Board {
        Board {
            frame: Rect {
                min: [0.0, 0.0],
                max: [400.0, 400.0],
            },
            lines: Vec::new(),
            boxes: Vec::new(),
            walls: Vec::new(),
        }
    }

    const SQUARE: [Px; 4] = [
        [100.0, 100.0],
        [200.0, 100.0],
        [200.0, 200.0],
        [100.0, 200.0],
    ];

    #[test]
    fn a_name_stands_in_the_middle_of_an_empty_region() {
        let mut board = board();
        let at = board.take(board.room_in(&SQUARE, 30.0, 14.0));
        assert!(
            (at[0] - 150.0).abs() < 8.0 && (at[1] - 150.0).abs() < 8.0,
            "{at:?}"
        );
    }

    #[test]
    fn a_name_moves_away_from_a_path_and_from_other_names() {
        let mut board = board();
        board.lines.push(([100.0, 150.0], [200.0, 150.0]));
        let first = board.take(board.room_in(&SQUARE, 30.0, 14.0));
        let second = board.take(board.room_in(&SQUARE, 30.0, 14.0));
        let rect = |at| Rect::centred(at, 30.0, 14.0);
        for at in [first, second] {
            assert!(inside(&SQUARE, at));
            assert_eq!(rect(at).length_inside([100.0, 150.0], [200.0, 150.0]), 0.0);
        }
        assert_eq!(rect(first).shared_area(&rect(second)), 0.0);
    }

    #[test]
    fn labels_stay_in_the_frame() {
        let at = board().place_beside([398.0, 2.0], 6.0, 60.0, 14.0);
        let rect = Rect::centred(at, 60.0, 14.0);
        assert!(
            rect.min[0] >= 0.0 && rect.max[0] <= 400.0 && rect.min[1] >= 0.0,
            "{rect:?}"
        );
    }
}
