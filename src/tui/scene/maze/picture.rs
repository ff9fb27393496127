//! The map as a picture, in the terminal's pixels. `ground` and `contours` draw what changes
//! rarely; what moves is drawn on top here.

mod contours;
mod ground;

use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::Frame;

use super::MazeState;
use super::candidates;
use super::edges;
use super::key::{Key, open_field, show_interval, shown_goal, shown_interval};
use super::unexplored::Unexplored;
use crate::tui::contours as intervals;
use crate::tui::graphics::{Picture, Redraw};
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::raster::MapFrame;
use crate::tui::screen::Screen;
use crate::tui::sheet::{Ink, Sheet};
use crate::tui::theme::{Rgb, Theme, contour, ink};
use gdg::bridge::EdgeStatus;
use gdg::draw::Ground;
use gdg::map::Cell;
use gdg::viewer::Field;
use ground::Scale;

/// Minimum average distance between contour lines, in pixels of the field: half of that in
/// characters.
const CONTOUR_SPACING: f32 = 3.0;

/// While training has priority, the ground is redrawn after this multiple of its drawing time, or
/// after [`LONGEST_GROUND_REST`]: it takes several times as long as what moves on it.
const GROUND_REST_FACTOR: u32 = 100;
const LONGEST_GROUND_REST: Duration = Duration::from_secs(2);

/// Positions of a trail farther apart than this, in cells, are not connected: a new episode began.
const LONGEST_STEP: f32 = 3.0;

/// Black outlines make signs stand out on any ground.
const SHADOW: Rgb = (0, 0, 0);

/// What the next frame can reuse.
#[derive(Default)]
pub struct PictureCache {
    base: Option<Base>,
    picture: Option<Picture>,
    /// Whether the picture is on the screen.
    is_shown: bool,
}

impl PictureCache {
    /// Begins a frame: no picture has been drawn yet.
    pub fn begin(&mut self) {
        self.is_shown = false;
    }

    /// Returns whether the latest picture may be kept for a while: it shows the same part of the
    /// same map in the same style.
    fn is_up_to_date_enough(
        &self,
        map_frame: &MapFrame,
        size: (u32, u32),
        maze: &MazeState,
        screen: &Screen,
    ) -> bool {
        self.picture.is_some()
            && self.base.as_ref().is_some_and(|base| base.same_style(map_frame, size, maze, screen))
    }

    /// Returns the picture, if it is on the screen.
    pub fn shown(&self) -> Option<&Picture> {
        self.picture.as_ref().filter(|_| self.is_shown)
    }
}

/// Map and field only.
struct Base {
    key: Key,
    directions: Arc<Vec<([f32; 2], [f32; 2])>>,
    /// The kind of ground of each value of the field.
    grounds: Vec<Ground>,
    sheet: Sheet,
    /// The contour interval outside of a comparison, if lines are drawn.
    own_interval: Option<f32>,
    subject: Subject,
    /// Until when it may be kept while training has priority.
    rests_until: Instant,
}

/// What a field shows: its goal, the quantity, and the updates of the film's frame.
type Subject = ((Option<Cell>, u64), Field, Option<u64>);

/// Draws the map and everything on it; `character` is a character's size in pixels.
pub fn draw(
    frame: &mut Frame,
    map_frame: &MapFrame,
    character: (u16, u16),
    maze: &MazeState,
    screen: &Screen,
    layout: &mut ScreenLayout,
    cache: &mut PictureCache,
) {
    let area = map_frame.area;
    let size = (
        u32::from(area.width) * u32::from(character.0),
        u32::from(area.height) * u32::from(character.1),
    );
    if screen.redraw == Redraw::Nothing && cache.is_up_to_date_enough(map_frame, size, maze, screen)
    {
        Picture::reserve(area, frame.buffer_mut());
        show_interval(cache.base.as_ref().and_then(|base| base.own_interval), screen, layout);
        cache.is_shown = true;
        return;
    }
    let scale = Scale::new(map_frame.raster.window, size, character);
    let base = match cache.base.take() {
        Some(base)
            if base.shows(map_frame, size, maze, screen)
                || base.may_stay(map_frame, size, maze, screen) =>
        {
            Some(base)
        }
        before => Base::new(map_frame, &scale, before, maze, screen),
    };
    let Some(base) = base else { return };
    show_interval(base.own_interval, screen, layout);
    let mut drawn = match cache
        .picture
        .take()
        .filter(|picture| picture.pixmap.data().len() == base.sheet.0.data().len())
    {
        Some(picture) => {
            let mut sheet = Sheet(picture.pixmap);
            sheet.0.data_mut().copy_from_slice(base.sheet.0.data());
            sheet
        }
        None => base.sheet.clone(),
    };
    let theme = screen.theme.in_full_colour();
    Moving { sheet: &mut drawn, scale: &scale, maze, screen, theme }.draw(map_frame);
    Picture::reserve(area, frame.buffer_mut());
    *cache = PictureCache {
        base: Some(base),
        picture: Some(Picture { area, pixmap: drawn.0 }),
        is_shown: true,
    };
}

impl Base {
    /// Draws map and field, with contour lines at the same interval as `before` if possible; `None`
    /// if out of memory.
    fn new(
        map_frame: &MapFrame,
        scale: &Scale,
        before: Option<Self>,
        maze: &MazeState,
        screen: &Screen,
    ) -> Option<Self> {
        let began = Instant::now();
        let key = Key::new(map_frame, maze, screen);
        let (columns, rows) = map_frame.raster.pixels;
        let map = &maze.map;
        let interval = before.as_ref().and_then(|before| before.own_interval);
        let (grounds, sheet) = match before {
            Some(Self { key: own, grounds, sheet, .. }) => {
                (Some(grounds).filter(|_| own.same_place(map_frame, maze)), Some(sheet))
            }
            None => (None, None),
        };
        let ground = |i: usize| map_frame.raster.ground(map, i % columns, i / columns);
        let grounds = grounds.unwrap_or_else(|| (0..columns * rows).map(ground).collect());
        // Every pixel is overwritten, so the sheet can be reused.
        let sheet = sheet.filter(|sheet: &Sheet| (sheet.0.width(), sheet.0.height()) == scale.size);
        let mut sheet = sheet.or_else(|| Sheet::new(scale.size))?;
        let field = key.field.as_deref().map(Vec::as_slice);
        ground::draw(&mut sheet, scale, field, columns, maze, screen);
        let shows_contours =
            maze.shown_field(screen).is_distance() && screen.overlays.has(Overlay::Contours);
        let field = key.field.as_deref().filter(|_| shows_contours);
        let own_interval = field.and_then(|field| {
            let unexplored = Unexplored::new(&grounds, maze, screen);
            let open = open_field(field, &grounds, &unexplored);
            let own = intervals::interval(&[(&open, columns)], CONTOUR_SPACING, interval);
            if let Some(interval) = shown_interval(own, screen) {
                let known = contours::Known { field: &open, columns, grounds: &grounds };
                contours::draw(&mut sheet, scale, known, interval, maze, screen);
            }
            own
        });
        ground::draw_walls(&mut sheet, scale, map, screen.theme.in_full_colour().wall);
        ground::draw_edge(&mut sheet, scale, maze, screen);
        if screen.overlays.has(Overlay::Directions) && maze.past().is_none() {
            draw_directions(&mut sheet, scale, maze);
        }
        let directions = maze.view.directions.clone();
        let rests_until =
            Instant::now() + LONGEST_GROUND_REST.min(GROUND_REST_FACTOR * began.elapsed());
        Some(Self {
            key,
            directions,
            grounds,
            sheet,
            own_interval,
            subject: subject(maze),
            rests_until,
        })
    }

    /// Returns the columns and rows of pixels.
    fn size(&self) -> (u32, u32) {
        (self.sheet.0.width(), self.sheet.0.height())
    }

    /// Returns whether this is still up to date.
    fn shows(
        &self,
        map_frame: &MapFrame,
        size: (u32, u32),
        maze: &MazeState,
        screen: &Screen,
    ) -> bool {
        let same_directions = Arc::ptr_eq(&self.directions, &maze.view.directions);
        self.size() == size && same_directions && self.key.is_current(map_frame, maze, screen)
    }

    /// Returns whether this is out of date only in what was learned recently, and may be kept.
    fn may_stay(
        &self,
        map_frame: &MapFrame,
        size: (u32, u32),
        maze: &MazeState,
        screen: &Screen,
    ) -> bool {
        screen.redraw == Redraw::Moving
            && Instant::now() < self.rests_until
            && self.subject == subject(maze)
            && self.same_style(map_frame, size, maze, screen)
            && self.key.field.is_some() == Key::field_on(&map_frame.raster, maze, screen).is_some()
    }

    /// Returns whether this shows the same part of the same map in the same style and size.
    fn same_style(
        &self,
        map_frame: &MapFrame,
        size: (u32, u32),
        maze: &MazeState,
        screen: &Screen,
    ) -> bool {
        self.size() == size && self.key.same_style(map_frame, maze, screen)
    }
}

/// Returns what the field on the screen shows.
fn subject(maze: &MazeState) -> Subject {
    let view = &maze.view;
    (view.goal, view.kind, view.past.as_ref().map(|past| past.updates))
}

/// Draws the directions that the actor would take.
fn draw_directions(sheet: &mut Sheet, scale: &Scale, maze: &MazeState) {
    let unit = scale.unit();
    for (at, [x, y]) in maze.view.directions.iter() {
        let at = scale.pixel(*at);
        let Some(ground) = sheet.colour(at[0] as i32, at[1] as i32) else { continue };
        let (own, length) = (Ink(ink(ground), 0.7), x.hypot(*y));
        if x.abs().max(y.abs()) < 0.1 {
            sheet.disc(at, 0.08 * unit, own);
        } else {
            sheet.arrow(at, [x / length, y / length], 1.1 * unit, 0.08 * unit, own);
        }
    }
}

/// The parts that change from frame to frame.
struct Moving<'a> {
    sheet: &'a mut Sheet,
    scale: &'a Scale,
    maze: &'a MazeState,
    screen: &'a Screen,
    theme: Theme,
}

impl Moving<'_> {
    /// Converts a share of a character's height to pixels.
    fn of(&self, share: f32) -> f32 {
        share * self.scale.unit()
    }

    /// Draws everything, the most important last; of the past, only the agents.
    fn draw(&mut self, map_frame: &MapFrame) {
        let shows = |overlay| self.screen.overlays.has(overlay);
        if let Some(past) = self.maze.past() {
            if shows(Overlay::Agents) {
                self.discs(past.agents.as_chunks::<2>().0);
            }
            return self.signs(false);
        }
        let [edges, candidates, path, search, agents] =
            [Overlay::Edges, Overlay::Candidates, Overlay::Path, Overlay::Search, Overlay::Agents]
                .map(shows);
        if edges {
            self.edges(map_frame);
        }
        if candidates {
            self.candidates(map_frame);
        }
        if path {
            self.path();
        }
        if search {
            self.search();
        }
        self.preview();
        self.trail();
        if agents {
            self.agents();
        }
        self.signs(agents);
    }

    fn edges(&mut self, map_frame: &MapFrame) {
        let [walked, failed, _] = self.theme.edges;
        let width = self.of(0.07).max(1.0);
        for (status, opacity, edges) in edges::groups(map_frame, self.maze) {
            let rgb = if status == EdgeStatus::Confirmed { walked } else { failed };
            for ends in edges {
                self.sheet.line(
                    &ends.map(|at| self.scale.pixel(at)),
                    false,
                    width,
                    Ink(rgb, opacity),
                );
            }
        }
    }

    fn candidates(&mut self, map_frame: &MapFrame) {
        for candidate in candidates::shown(map_frame, self.maze) {
            let at = self.scale.pixel(candidate.at);
            let Some(ground) = self.sheet.colour(at[0] as i32, at[1] as i32) else { continue };
            // The better connected, the larger.
            let radius = self.of(0.04 + 0.09 * candidate.degree).max(0.7);
            self.sheet.disc(at, radius, Ink(contour(contour(ground)), 0.8));
        }
    }

    /// Draws a line with a shadow.
    fn route(&mut self, stops: &[[f32; 2]], width: f32, ink: Ink) {
        let stops: Vec<[f32; 2]> = stops.iter().map(|at| self.scale.pixel(*at)).collect();
        self.sheet.line(&stops, false, width + 2.0, Ink(SHADOW, 0.35 * ink.1));
        self.sheet.line(&stops, false, width, ink);
    }

    fn path(&mut self) {
        let view = &self.maze.view;
        let ink = Ink(self.theme.path, 1.0);
        self.route(&view.way, self.of(0.1).max(1.5), ink);
        for stop in view.path.iter().take(view.path.len().saturating_sub(1)) {
            self.sheet.disc(self.scale.pixel(*stop), self.of(0.17).max(2.0), ink);
        }
    }

    fn search(&mut self) {
        let Some(search) = self.screen.search() else { return };
        let [accepted, rejected] = self.theme.search;
        let at = |numbers: &[f32]| [numbers[0], numbers[1]];
        for tried in search.rejected.chunks_exact(2) {
            let ([x, y], arm) = (self.scale.pixel(at(tried)), self.of(0.12));
            for side in [1.0, -1.0] {
                let ends = [[x - arm, y - side * arm], [x + arm, y + side * arm]];
                self.sheet.line(&ends, false, self.of(0.07), Ink(rejected, 1.0));
            }
        }
        let [from, to] = [&search.state, &search.goal].map(|numbers| at(numbers));
        if let Some(bridge) = &search.found {
            let bridge = at(&bridge.point);
            self.route(&[from, bridge, to], self.of(0.09), Ink(accepted, 0.9));
            self.badge('B', bridge, 0.36, accepted);
        }
        self.badge('a', from, 0.28, accepted);
        self.badge('g', to, 0.28, accepted);
    }

    /// Draws the cells that the editor would change.
    fn preview(&mut self) {
        let Some((cells, free)) = self.maze.editor.preview() else { return };
        let theme = self.theme;
        let rgb = if free { theme.unknown } else { theme.wall };
        for cell in cells.iter() {
            let area = self.scale.cell(*cell);
            self.sheet.rectangle(area, Ink(rgb, 1.0));
            self.sheet.rectangle(area, Ink(theme.cursor, 0.25));
        }
    }

    /// Draws a trail that fades towards its beginning.
    fn fading(&mut self, positions: &[[f32; 2]], width: f32, Ink(rgb, opacity): Ink) {
        for (i, ends) in positions.windows(2).enumerate() {
            if (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]) <= LONGEST_STEP {
                let share = opacity * (i + 2) as f32 / positions.len() as f32;
                let ends = [ends[0], ends[1]].map(|at| self.scale.pixel(at));
                self.sheet.line(&ends, false, width, Ink(rgb, share));
            }
        }
    }

    fn trail(&mut self) {
        self.fading(&self.maze.view.trail, self.of(0.2), Ink(self.theme.walker, 0.9));
    }

    fn agents(&mut self) {
        let rgb = self.theme.agent;
        for trail in self.screen.snapshot.trails.iter() {
            self.fading(trail.as_chunks::<2>().0, self.of(0.08).max(1.0), Ink(rgb, 0.6));
        }
        self.discs(self.screen.snapshot.agents.as_chunks::<2>().0);
    }

    /// Draws an agent at each position.
    fn discs(&mut self, positions: &[[f32; 2]]) {
        let radius = (0.35 * self.scale.cell_width()).clamp(self.of(0.12), self.of(0.22));
        for at in positions {
            let at = self.scale.pixel(*at);
            self.sheet.disc(at, radius + 1.2, Ink(SHADOW, 0.7));
            self.sheet.disc(at, radius, Ink(self.theme.agent, 1.0));
        }
    }

    /// Draws a letter on a disc whose radius is a share of a character's height.
    fn badge(&mut self, letter: char, at: [f32; 2], radius: f32, rgb: Rgb) {
        self.sheet.badge(letter, self.scale.pixel(at), self.of(radius), rgb, ink(rgb));
    }

    /// Draws a flag whose pole stands at a position.
    fn flag(&mut self, at: [f32; 2], rgb: Rgb) {
        let ([x, y], unit) = (self.scale.pixel(at), self.of(1.0));
        let cloth = [[x, y - 0.8 * unit], [x + 0.5 * unit, y - 0.6 * unit], [x, y - 0.4 * unit]];
        for (more, ink) in [(2.0, Ink(SHADOW, 0.6)), (0.0, Ink(rgb, 1.0))] {
            self.sheet.line(&[[x, y], [x, y - 0.8 * unit]], false, 0.08 * unit + more, ink);
            self.sheet.line(&[cloth[0], cloth[1], cloth[2]], false, 1.0 + more, ink);
        }
        self.sheet.polygon(&cloth, Ink(rgb, 1.0));
    }

    fn signs(&mut self, shows_agents: bool) {
        let Self { maze, screen, theme, .. } = *self;
        let is_past = maze.past().is_some();
        for (marks, letter) in [(maze.map.starts(), "s"), (maze.map.goals(), "g")] {
            for cell in marks {
                let at = self.scale.pixel(cell.centre());
                let Some(ground) = self.sheet.colour(at[0] as i32, at[1] as i32) else { continue };
                self.sheet.text(letter, at, self.of(0.8), 0.0, true, Ink(ink(ground), 1.0));
            }
        }
        if shows_agents {
            for at in screen.snapshot.frontier_goals.as_chunks::<2>().0 {
                self.flag(*at, theme.frontier);
            }
        }
        if let Some(followed) = screen.snapshot.followed.as_ref().filter(|_| !is_past) {
            self.flag([followed.goal[0], followed.goal[1]], theme.agent);
            self.badge('A', [followed.state[0], followed.state[1]], 0.4, theme.agent);
        }
        if !is_past {
            self.badge('S', maze.view.walk.start, 0.36, theme.walker);
        }
        self.badge('G', shown_goal(maze).centre(), 0.45, theme.goal);
        if let Some(at) = maze.view.trail.last().filter(|_| !is_past) {
            self.badge('@', *at, 0.42, theme.walker);
        }
        if let Some(cursor) = maze.editor.cursor.or(maze.inspecting) {
            let ([x, y], arm) = (self.scale.pixel(cursor.centre()), self.of(0.6));
            for (more, ink) in [(2.0, Ink(SHADOW, 0.6)), (0.0, Ink(theme.cursor, 1.0))] {
                for [dx, dy] in [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]] {
                    let ends =
                        [0.25, 1.0].map(|share| [x + share * arm * dx, y + share * arm * dy]);
                    self.sheet.line(&ends, false, self.of(0.1) + more, ink);
                }
            }
        }
    }
}
