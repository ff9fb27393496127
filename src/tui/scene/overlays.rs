//! The overlays of any scene: the bridge graph, searches, agents and plans.

use std::collections::{BTreeMap, HashMap};

use crate::tui::canvas::{Canvas, Ink};
use crate::tui::characters::CANDIDATE_MARK;
use crate::tui::choices::Overlay;
use crate::tui::screen::Screen;
use crate::tui::theme::{Rgb, Theme, ink};
use gdg::bridge::EdgeStatus;
use gdg::train::FilmFrame;
use gdg::viewer::{Candidate, Graph};

/// How edges look: their opacity, and their character without colours.
pub const EDGES: [(EdgeStatus, f32, char); 3] = [
    (EdgeStatus::Untried, 0.3, '-'),
    (EdgeStatus::Confirmed, 0.6, '='),
    (EdgeStatus::Demoted, 0.9, 'x'),
];

/// One candidate or edge is drawn per block of characters, given by its columns and rows.
const SPACING: (u16, u16) = (6, 3);

pub const FRONTIER_SIGN: char = '\u{25c6}';

pub const TRAIL_MARK: char = '\u{b7}';

/// Where places, `(goal_dim)`, and states are shown, in the unit of the canvas; `None` for those of
/// another world.
pub type Shown<'a> = &'a dyn Fn(&[f32]) -> Option<[f32; 2]>;

pub struct Painter<'a> {
    pub canvas: Canvas,
    pub screen: &'a Screen,
    pub theme: Theme,
    pub place: Shown<'a>,
    pub state: Shown<'a>,
    /// Numbers of a place, and of a state.
    pub sizes: [usize; 2],
}

impl Painter<'_> {
    pub fn shows(&self, overlay: Overlay) -> bool {
        self.screen.overlays.has(overlay) && self.screen.why_not(overlay).is_none()
    }

    pub fn places<'b>(&self, places: impl IntoIterator<Item = &'b Vec<f32>>) -> Vec<[f32; 2]> {
        places.into_iter().filter_map(|place| (self.place)(place)).collect()
    }

    /// Draws some walked and failed edges, since all of them would hide the ground: in each block the
    /// longest; below them all untried ones if they are wanted.
    pub fn edges(&mut self, graph: &Graph, with_untried: bool) {
        if !self.shows(Overlay::Edges) {
            return;
        }
        let (mut untried, mut longest) = (Vec::new(), BTreeMap::new());
        for (ends, status) in &graph.edges {
            let place = |i: usize| graph.candidates.get(i).and_then(|own| (self.place)(&own.at));
            let (Some(a), Some(b)) = (place(ends[0]), place(ends[1])) else { continue };
            let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
            let Some(at) = self.canvas.frame.character_of(middle) else { continue };
            let length = (a[0] - b[0]).hypot(a[1] - b[1]);
            let edge = (length, [a, b], *status);
            if *status != EdgeStatus::Untried {
                let block = (at.x / SPACING.0, at.y / SPACING.1, *status == EdgeStatus::Demoted);
                let kept = longest.entry(block).or_insert(edge);
                if kept.0 < length {
                    *kept = edge;
                }
            } else if with_untried {
                untried.push(edge);
            }
        }
        let shown: Vec<_> = untried.into_iter().chain(longest.into_values()).collect();
        let [walked, failed, other] = self.theme.edges;
        for ((status, opacity, mark), rgb) in EDGES.into_iter().zip([other, walked, failed]) {
            let own = shown.iter().filter(|(.., own)| *own == status).map(|(_, ends, _)| *ends);
            self.canvas.lines(own, 0.07, Ink::new(rgb, opacity, mark));
        }
    }

    /// Draws some bridge candidates, since all of them would hide the ground: in each block the one
    /// nearest to its middle, so that they stay the same while they are in place. In pictures, the
    /// better connected, the larger.
    pub fn candidates(&mut self, graph: &Graph) {
        if !self.shows(Overlay::Candidates) {
            return;
        }
        let frame = &self.canvas.frame;
        let mut nearest: HashMap<(u16, u16), (f32, usize)> = HashMap::new();
        for (i, candidate) in graph.candidates.iter().enumerate() {
            let at = (self.place)(&candidate.at).and_then(|at| frame.character_of(at));
            let Some(at) = at else { continue };
            let (column, row) = (at.x - frame.area.x, at.y - frame.area.y);
            let off = |at: u16, every: u16| f32::from(at % every) - 0.5 * f32::from(every - 1);
            let own = off(column, SPACING.0).abs() + 2.0 * off(row, SPACING.1).abs();
            let part = nearest.entry((column / SPACING.0, row / SPACING.1)).or_insert((own, i));
            if own < part.0 {
                *part = (own, i);
            }
        }
        let mut shown: Vec<usize> = nearest.into_values().map(|(_, i)| i).collect();
        shown.sort_unstable();
        for Candidate { at, degree } in shown.into_iter().map(|i| &graph.candidates[i]) {
            let Some(at) = (self.place)(at) else { continue };
            if self.canvas.is_fine {
                let rgb = ink(self.canvas.colour(at));
                let ink = Ink { on_floor: true, ..Ink::new(rgb, 0.8, CANDIDATE_MARK) };
                self.canvas.disc(at, 0.04 + 0.09 * degree, ink);
            } else {
                self.canvas.symbol(at, CANDIDATE_MARK, None);
            }
        }
    }

    /// Draws the latest search for a bridge: the places tried, and the way over the one found, which
    /// `way` leads around walls.
    pub fn search(&mut self, way: impl Fn(&[[f32; 2]]) -> Vec<[f32; 2]>) {
        let Some(search) = self.screen.search().filter(|_| self.shows(Overlay::Search)) else {
            return;
        };
        let [accepted, rejected] = self.theme.search;
        for at in search.rejected.chunks_exact(self.sizes[0]).filter_map(|at| (self.place)(at)) {
            if self.canvas.is_fine {
                self.canvas.symbol(at, 'x', Some(rejected));
            } else {
                let ink = Ink { on_floor: true, ..Ink::new(rejected, 1.0, 'x') };
                self.canvas.disc(at, 0.0, ink);
            }
        }
        let [from, to] = [(self.state)(&search.state), (self.place)(&search.goal)];
        let bridge = search.found.as_ref().and_then(|found| (self.place)(&found.point));
        if let (Some(from), Some(bridge), Some(to)) = (from, bridge, to) {
            self.canvas.route(&way(&[from, bridge, to]), 0.09, Ink::new(accepted, 0.8, '='));
            self.canvas.letter(bridge, 'B', accepted, 0.36);
        }
        for (at, letter) in [(from, '1'), (to, '2')] {
            if let Some(at) = at {
                if self.canvas.is_fine {
                    self.canvas.letter(at, letter, accepted, 0.28);
                } else {
                    self.canvas.symbol(at, letter, Some(accepted));
                }
            }
        }
    }

    /// Draws the waypoints ahead of the agent and the way along them.
    pub fn plan(&mut self, way: &[[f32; 2]], stops: &[[f32; 2]]) {
        if !self.shows(Overlay::Path) {
            return;
        }
        let ink = Ink::new(self.theme.path, 1.0, '+');
        self.canvas.route(way, 0.1, ink);
        stops.iter().for_each(|at| self.canvas.disc(*at, 0.17, ink));
    }

    /// Draws a trail that fades; a step farther than `longest` began a new episode.
    pub fn trail(&mut self, trail: &[[f32; 2]], longest: f32, width: f32, ink: Ink) {
        for (i, ends) in trail.windows(2).enumerate() {
            if (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]) <= longest {
                let share = ink.share * (i + 2) as f32 / trail.len() as f32;
                self.canvas.line(ends, width, Ink { share, on_floor: true, ..ink });
            }
        }
    }

    pub fn own_trail(&mut self, trail: &[[f32; 2]], longest: f32) {
        self.trail(trail, longest, 0.2, Ink::new(self.theme.walker, 0.85, TRAIL_MARK));
    }

    /// Draws the exploring agents and their trails; of the past, only the agents.
    pub fn explorers(&mut self, past: Option<&FilmFrame>, longest: f32, radius: f32) {
        if !self.shows(Overlay::Agents) {
            return;
        }
        let (rgb, snapshot, [of_place, of_state]) =
            (self.theme.agent, &self.screen.snapshot, self.sizes);
        let positions = |numbers: &[f32], size: usize, shown: Shown| -> Vec<[f32; 2]> {
            numbers.chunks_exact(size.max(1)).filter_map(shown).collect()
        };
        let agents = if let Some(frame) = past {
            positions(&frame.agents, of_place, self.place)
        } else {
            let ink = Ink { mark: None, ..Ink::new(rgb, 0.55, ' ') };
            for trail in snapshot.trails.iter() {
                self.trail(&positions(trail, of_state, self.state), longest, 0.08, ink);
            }
            positions(&snapshot.agents, of_state, self.state)
        };
        agents.into_iter().for_each(|at| self.canvas.agent(at, radius, Ink::new(rgb, 1.0, 'o')));
    }

    pub fn letter(&mut self, at: Option<[f32; 2]>, letter: char, rgb: Rgb, radius: f32) {
        if let Some(at) = at {
            self.canvas.letter(at, letter, rgb, radius);
        }
    }
}
