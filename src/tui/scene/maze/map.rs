//! The map and everything on it.

use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};

use super::MazeState;
use super::candidates;
use super::edges;
use super::key::{Key, open_field, show_interval, shown_goal, shown_interval};
use super::picture::{self, PictureCache};
use super::unexplored::Unexplored;
use crate::tui::canvas::{CANDIDATE_MARK, Canvas, Pen, WALL_MARK, shade};
use crate::tui::contours::{self, Label};
use crate::tui::glyphs::Glyphs;
use crate::tui::graphics::Picture;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::raster::MapFrame;
use crate::tui::scene::scale::MAX_SHOWN_ERROR;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Rgb, Theme, blend};
use gdg::bridge::SearchOutcome;
use gdg::draw::Ground;
use gdg::viewer::Field;

/// Minimum characters per cell for drawing bridge candidates, and for drawing them in sizes.
const MIN_BRIDGE_SCALE: f32 = 0.75;
const MIN_SIZED_CANDIDATE_SCALE: f32 = 2.0;

/// Share of the wall colour in a pixel that a wall crosses.
const CROSSED_WALL_SHARE: f32 = 0.65;

/// The sign of a goal at the frontier.
pub const FRONTIER_SIGN: char = '\u{25c6}';

/// The walking agent's trail without colours.
pub const TRAIL_MARK: char = '\u{b7}';

/// Draws the map and everything on it.
pub fn draw(
    frame: &mut Frame,
    area: Rect,
    maze: &MazeState,
    screen: &Screen,
    layout: &mut ScreenLayout,
    cache: &mut Cache,
) {
    let Some(map_frame) = MapFrame::fit(area, &maze.map, screen.marker, maze.viewport) else {
        return;
    };
    layout.map = Some(map_frame.clone());
    if let Some(pictures) = &mut cache.pictures
        && let Some(character) = screen.picture_character()
    {
        return picture::draw(frame, &map_frame, character, maze, screen, layout, pictures);
    }
    let before = cache.base.take();
    let interval = before.as_ref().and_then(|base| base.own_interval);
    let base = before.filter(|base| base.key.is_current(&map_frame, maze, screen));
    let base = base.unwrap_or_else(|| Base::new(&map_frame, interval, maze, screen));
    show_interval(base.own_interval, screen, layout);
    let mut canvas = base.canvas.clone();
    draw_moving_parts(&mut canvas, &map_frame, maze, screen);
    for at in map_frame.area.positions() {
        frame.buffer_mut()[at].clone_from(&base.painted[at]);
    }
    canvas.paint_changes(frame.buffer_mut(), &map_frame, &screen.theme);
    let labels =
        base.labels.iter().filter(|label| !is_covered(label, &canvas, &map_frame, &screen.theme));
    let mut glyphs =
        Glyphs { map_frame: &map_frame, theme: &screen.theme, buffer: frame.buffer_mut() };
    draw_symbols(&mut glyphs, labels.collect(), maze, screen);
    cache.base = Some(base);
}

/// The part of the map that later frames can reuse.
#[derive(Default)]
pub struct Cache {
    base: Option<Base>,
    /// The map as a picture, if the terminal supports pictures.
    pictures: Option<PictureCache>,
}

impl Cache {
    /// Creates a cache for frames on a terminal, with pictures if it supports them.
    pub fn with_pictures() -> Self {
        Self { pictures: Some(PictureCache::default()), ..Self::default() }
    }

    /// Begins a frame: no picture has been drawn yet.
    pub fn begin(&mut self) {
        self.pictures.iter_mut().for_each(PictureCache::begin);
    }

    /// Returns the picture that belongs to the frame, if there is one.
    pub fn picture(&self) -> Option<&Picture> {
        self.pictures.as_ref().and_then(PictureCache::shown)
    }
}

/// Map and field only, which change far less often than what moves on them.
struct Base {
    key: Key,
    canvas: Canvas,
    /// The canvas as characters.
    painted: Buffer,
    /// The contour interval outside of a comparison, if lines are drawn, and their labels.
    own_interval: Option<f32>,
    labels: Vec<Label>,
}

impl Base {
    /// Draws map and field, with contour lines at the same interval as `before` if possible.
    fn new(map_frame: &MapFrame, before: Option<f32>, maze: &MazeState, screen: &Screen) -> Self {
        let mut canvas = Canvas::new(map_frame);
        let columns = canvas.columns();
        let grounds: Vec<Ground> = (0..canvas.len())
            .map(|i| map_frame.raster.ground(&maze.map, i % columns, i / columns))
            .collect();
        terrain(&mut canvas, &grounds, &screen.theme);
        let key = Key::new(map_frame, maze, screen);
        let unexplored = Unexplored::new(&grounds, maze, screen);
        let (mut own_interval, mut labels) = (None, Vec::new());
        if let Some(field) = &key.field {
            colour(&mut canvas, field, maze, screen);
            if maze.shown_field(screen).is_distance() && screen.overlays.has(Overlay::Contours) {
                let open = open_field(field, &grounds, &unexplored);
                own_interval = contours::interval(&[(&open, columns)], contours::SPACING, before);
                let goal = map_frame.raster.pixel_of(shown_goal(maze).centre());
                if let Some(interval) = shown_interval(own_interval, screen) {
                    let near = goal.unwrap_or_default();
                    labels = contours::draw(
                        &mut canvas,
                        map_frame,
                        &open,
                        interval,
                        near,
                        &screen.theme,
                    );
                }
            }
        }
        unexplored.draw(&mut canvas, map_frame, screen);
        let mut painted = Buffer::empty(map_frame.area);
        canvas.paint(&mut painted, map_frame, &screen.theme);
        Self { key, canvas, painted, own_interval, labels }
    }
}

/// Draws walls and floor.
fn terrain(canvas: &mut Canvas, grounds: &[Ground], theme: &Theme) {
    for (i, ground) in grounds.iter().enumerate() {
        let (rgb, mark) = ground_style(*ground, theme);
        canvas.set(i, rgb, mark);
    }
}

/// Returns the style of ground without a known value, with colours and without.
pub fn ground_style(ground: Ground, theme: &Theme) -> (Option<Rgb>, char) {
    match ground {
        Ground::Outside => (None, ' '),
        Ground::Wall => (Some(theme.wall), WALL_MARK),
        Ground::Crossed(_) => {
            (Some(blend(theme.unknown, theme.wall, CROSSED_WALL_SHARE)), WALL_MARK)
        }
        Ground::Free(_) => (Some(theme.unknown), ' '),
    }
}

/// Draws the field as colours.
fn colour(canvas: &mut Canvas, field: &[f32], maze: &MazeState, screen: &Screen) {
    let (theme, farthest) = (&screen.theme, maze.farthest(screen));
    let mono = theme.depth == ColourDepth::Mono;
    for (i, value) in field.iter().copied().enumerate().filter(|(_, value)| value.is_finite()) {
        let share = match maze.shown_field(screen) {
            Field::Error => value.abs() / MAX_SHOWN_ERROR,
            Field::Visits => 1.0 - (1.0 + value).ln() / (1.0 + farthest).ln(),
            _ => value / farthest,
        };
        let rgb = match maze.shown_field(screen) {
            Field::Error => theme.error_colour(value / MAX_SHOWN_ERROR),
            _ => theme.distance_colour(share),
        };
        if canvas.is_wall(i) {
            canvas.set(i, Some(blend(rgb, theme.wall, CROSSED_WALL_SHARE)), WALL_MARK);
        } else {
            // Without colours, the edges of shades show where distances are equal.
            canvas.set(i, Some(rgb), if mono { shade(share) } else { ' ' });
        }
    }
}

/// Returns whether the planned path or an agent covers a label.
fn is_covered(label: &Label, canvas: &Canvas, map_frame: &MapFrame, theme: &Theme) -> bool {
    label.pixels(map_frame).any(|i| [theme.path, theme.agent].map(Some).contains(&canvas.colour(i)))
}

/// Draws what changes from frame to frame, as pixels: of the past, only the agents.
fn draw_moving_parts(canvas: &mut Canvas, map_frame: &MapFrame, maze: &MazeState, screen: &Screen) {
    let (theme, shows) = (&screen.theme, |overlay| screen.overlays.has(overlay));
    let on_floor = |at: [f32; 2]| map_frame.raster.on_floor(&maze.map, at);
    let draw_agents = |canvas: &mut Canvas, agents: &[f32]| {
        let positions = agents.as_chunks::<2>().0.iter();
        positions.for_each(|at| canvas.dot(map_frame, on_floor(*at), theme.agent, 'o'));
    };
    if let Some(past) = maze.past() {
        if shows(Overlay::Agents) {
            draw_agents(canvas, &past.agents);
        }
        return;
    }
    // On a map scaled down, candidates would hide the rest; on a large one they are drawn as signs.
    let are_dots = (MIN_BRIDGE_SCALE..MIN_SIZED_CANDIDATE_SCALE).contains(&map_frame.scale());
    if shows(Overlay::Edges) {
        edges::draw(canvas, map_frame, maze, screen);
    }
    if shows(Overlay::Candidates) && are_dots {
        for candidate in candidates::shown(map_frame, maze) {
            // The better connected, the darker.
            let share = 0.25 + 0.5 * candidate.degree;
            let mark = Some(CANDIDATE_MARK);
            canvas.faint_dot(map_frame, on_floor(candidate.at), theme.candidate, share, mark);
        }
    }
    if shows(Overlay::Path) {
        let ends = maze.view.way.windows(2).map(|ends| [ends[0], ends[1]]);
        let pen = Pen { rgb: theme.path, share: 1.0, mark: '+' };
        canvas.lines_via(map_frame, ends, pen, on_floor);
    }
    if let (true, Some(search)) = (shows(Overlay::Search), screen.search()) {
        draw_search(canvas, map_frame, search, maze, theme);
    }
    draw_preview(canvas, map_frame, maze, theme);
    let trail: Vec<[f32; 2]> = maze.view.trail.iter().copied().map(on_floor).collect();
    draw_trail(canvas, map_frame, &trail, theme.walker, 0.8, Some(TRAIL_MARK));
    if shows(Overlay::Agents) {
        for trail in screen.snapshot.trails.iter() {
            let positions = trail.as_chunks::<2>().0.iter().copied();
            let positions: Vec<[f32; 2]> = positions.map(on_floor).collect();
            draw_trail(canvas, map_frame, &positions, theme.agent, 0.5, None);
        }
        draw_agents(canvas, &screen.snapshot.agents);
    }
}

/// Draws the places tried in a search for a bridge, and the way over the bridge that it found.
fn draw_search(
    canvas: &mut Canvas,
    map_frame: &MapFrame,
    search: &SearchOutcome,
    maze: &MazeState,
    theme: &Theme,
) {
    let [accepted, rejected] = theme.search;
    let on_floor = |at: [f32; 2]| map_frame.raster.on_floor(&maze.map, at);
    for tried in search.rejected.as_chunks::<2>().0 {
        canvas.ground_dot(map_frame, on_floor(*tried), rejected, 'x');
    }
    if let Some(bridge) = &search.found {
        let [from, bridge, to] =
            [&search.state, &bridge.point, &search.goal].map(|numbers| [numbers[0], numbers[1]]);
        let ends = [[from, bridge], [bridge, to]].into_iter();
        canvas.lines(map_frame, ends, Pen { rgb: accepted, share: 0.8, mark: '=' });
    }
}

/// Draws the cells that the editor would change.
fn draw_preview(canvas: &mut Canvas, map_frame: &MapFrame, maze: &MazeState, theme: &Theme) {
    let Some((cells, free)) = maze.editor.preview() else { return };
    let (rgb, mark) = if free { (theme.unknown, ' ') } else { (theme.wall, WALL_MARK) };
    for cell in cells.iter() {
        canvas.dot(map_frame, cell.centre(), blend(rgb, theme.cursor, 0.25), mark);
    }
}

/// Draws a trail that fades towards its beginning, from an opacity at its end.
fn draw_trail(
    canvas: &mut Canvas,
    map_frame: &MapFrame,
    trail: &[[f32; 2]],
    rgb: Rgb,
    opacity: f32,
    mark: Option<char>,
) {
    for (i, at) in trail.iter().enumerate() {
        let share = opacity * (i + 1) as f32 / trail.len() as f32;
        canvas.faint_dot(map_frame, *at, rgb, share, mark);
    }
}

/// Draws letters and signs, and the `labels` that they do not cover.
fn draw_symbols(glyphs: &mut Glyphs, labels: Vec<&Label>, maze: &MazeState, screen: &Screen) {
    let is_past = maze.past().is_some();
    let shows = |overlay| screen.overlays.has(overlay) && !is_past;
    if shows(Overlay::Candidates) && glyphs.map_frame.scale() >= MIN_SIZED_CANDIDATE_SCALE {
        draw_candidate_signs(glyphs, maze);
    }
    if shows(Overlay::Directions) {
        for (at, action) in maze.view.directions.iter() {
            glyphs.symbol(*at, arrow(*action), None);
        }
    }
    let under = |label: &Label, buffer: &Buffer| {
        label.area.positions().map(|at| buffer[at].clone()).collect::<Vec<_>>()
    };
    let labels: Vec<_> =
        labels.into_iter().map(|label| (label, under(label, glyphs.buffer))).collect();
    if let (true, Some(search)) = (shows(Overlay::Search), screen.search()) {
        let rgb = screen.theme.search[0];
        let raster = glyphs.map_frame.raster;
        let place = |numbers: &[f32]| raster.on_floor(&maze.map, [numbers[0], numbers[1]]);
        if let Some(bridge) = &search.found {
            glyphs.letter(place(&bridge.point), 'B', rgb);
        }
        glyphs.symbol(place(&search.state), 'a', Some(rgb));
        glyphs.symbol(place(&search.goal), 'g', Some(rgb));
    }
    draw_marks(glyphs, maze, screen);
    for (label, before) in labels {
        if under(label, glyphs.buffer) == before {
            glyphs.label(label);
        }
    }
}

/// Draws bridge candidates as signs: the better connected, the larger.
fn draw_candidate_signs(glyphs: &mut Glyphs, maze: &MazeState) {
    // A sign would leave a hole in a wall that shares its character.
    let is_open = |at: Position| {
        let cells = glyphs.map_frame.cells_at(at, &maze.map);
        cells.into_iter().all(|cell| maze.map.is_free(cell))
    };
    let open = |at| glyphs.map_frame.character_of(at).is_some_and(is_open);
    let shown = candidates::shown(glyphs.map_frame, maze);
    let open: Vec<_> = shown.into_iter().filter(|candidate| open(candidate.at)).collect();
    for candidate in open {
        let symbol = match candidate.degree {
            d if d < 0.34 => '\u{b7}',
            d if d < 0.67 => '\u{2022}',
            _ => '\u{25cf}',
        };
        glyphs.symbol(candidate.at, symbol, None);
    }
}

/// Draws the map's own starts and goals, the agents' goals, the walk and the cursor, the most
/// important last.
fn draw_marks(glyphs: &mut Glyphs, maze: &MazeState, screen: &Screen) {
    let (theme, is_past) = (&screen.theme, maze.past().is_some());
    let raster = glyphs.map_frame.raster;
    let place = |numbers: &[f32]| raster.on_floor(&maze.map, [numbers[0], numbers[1]]);
    for (marks, letter) in [(maze.map.starts(), 's'), (maze.map.goals(), 'g')] {
        marks.iter().for_each(|cell| glyphs.symbol(cell.centre(), letter, None));
    }
    if screen.overlays.has(Overlay::Agents) && !is_past {
        for at in screen.snapshot.frontier_goals.as_chunks::<2>().0 {
            glyphs.symbol(place(at), FRONTIER_SIGN, Some(theme.frontier));
        }
    }
    if let Some(followed) = screen.snapshot.followed.as_ref().filter(|_| !is_past) {
        glyphs.letter(place(&followed.state), 'A', theme.agent);
        glyphs.symbol(place(&followed.goal), '\u{2691}', Some(theme.agent));
    }
    if !is_past {
        glyphs.letter(place(&maze.view.walk.start), 'S', theme.walker);
    }
    glyphs.letter(shown_goal(maze).centre(), 'G', theme.goal);
    if let Some(at) = maze.view.trail.last().filter(|_| !is_past) {
        glyphs.letter(place(at), '@', theme.walker);
    }
    if let Some(cursor) = maze.editor.cursor.or(maze.inspecting) {
        glyphs.letter(cursor.centre(), '+', theme.cursor);
    }
}

/// Returns the arrow nearest to a direction, or a dot for standing still.
fn arrow([x, y]: [f32; 2]) -> char {
    const ARROWS: [char; 8] = [
        '\u{2192}', '\u{2198}', '\u{2193}', '\u{2199}', '\u{2190}', '\u{2196}', '\u{2191}',
        '\u{2197}',
    ];
    if x.abs().max(y.abs()) < 0.1 {
        return '\u{b7}';
    }
    let eighth = (y.atan2(x) / std::f32::consts::FRAC_PI_4).round() as i32;
    ARROWS[eighth.rem_euclid(8) as usize]
}
