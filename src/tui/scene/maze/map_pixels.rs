//! The map and everything on it, as characters or as a picture.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::style::Style;
use ratatui::widgets::{Block, Clear};

use super::MazeState;
use crate::tui::canvas::{Canvas, Ink, contour_interval, draw_contours};
use crate::tui::choices::{Marker, Overlay, Overlays};
use crate::tui::graphics::{Redraw, TerminalPicture};
use crate::tui::scene::ground::{self, Colours, GroundKind, Look};
use crate::tui::scene::overlays::{FRONTIER_SIGN, Painter};
use crate::tui::scene::{Drawing, SceneKind};
use crate::tui::screen::Screen;
use crate::tui::theme::{Theme, ThemeName, blend, ink};
use crate::tui::viewport::{MapFrame, Viewport};
use gdg::draw::{Raster, RasterPixel, positions_along};
use gdg::map::{Cell, Grid};
use gdg::viewer::{Exploration, Field, Knowledge, cell_of_goal, way_along};

/// Share of the wall colour in a pixel that a wall crosses: as characters, and in pictures at least.
const CROSSED_WALL_SHARE: f32 = 0.65;
const LEAST_WALL_SHARE: f32 = 0.5;

/// Width of the edge of the known world in a picture, as a share of a character's height.
const EDGE: f32 = 0.12;

/// Positions of a trail farther apart than this, in cells, are not connected: a new episode began.
const LONGEST_STEP: f32 = 3.0;

/// Radii of agents in pictures: a share of a cell's width, within shares of a character's height.
const AGENT_RADIUS: f32 = 0.35;
const AGENT_RADII: [f32; 2] = [0.12, 0.22];

/// While training has priority, the ground of a picture is redrawn after this multiple of its
/// drawing time, or after [`LONGEST_GROUND_REST`]: it takes several times as long as what moves on it.
const GROUND_REST_FACTOR: u32 = 100;
const LONGEST_GROUND_REST: Duration = Duration::from_secs(2);

/// Maximum columns and rows of the minimap, and maximum share of the pane's, as a divisor.
const MAX_MINIMAP: (u16, u16) = (24, 10);
const PANE_DIVISOR: u16 = 3;

/// What the next frame can reuse.
#[derive(Default)]
pub struct Cache {
    base: Option<BaseLayer>,
    /// Whether the terminal shows pictures.
    has_pictures: bool,
    picture: Option<TerminalPicture>,
    is_shown: bool,
}

impl Cache {
    /// Creates a cache for frames on a terminal, with pictures if it supports them.
    pub fn with_pictures() -> Self {
        Self { has_pictures: true, ..Self::default() }
    }

    /// Begins a frame: no picture has been drawn yet.
    pub fn begin(&mut self) {
        self.is_shown = false;
    }

    pub fn picture(&self) -> Option<&TerminalPicture> {
        self.picture.as_ref().filter(|_| self.is_shown)
    }
}

struct PixelsKey {
    frame: MapFrame,
    character: Option<(u16, u16)>,
    theme: ThemeName,
    overlays: Overlays,
    map: Arc<Grid>,
    field: Option<Arc<Vec<Vec<f32>>>>,
    exploration: Arc<Exploration>,
    cut_off: Arc<Vec<bool>>,
    farthest: f32,
    least_contour_interval: f32,
    /// The goal, the quantity, and the updates of the film's frame.
    subject: ((Option<Vec<f32>>, u64), Field, Option<u64>),
}

impl PixelsKey {
    fn new(frame: &MapFrame, size: Option<(u16, u16)>, maze: &MazeState, screen: &Screen) -> Self {
        let view = &maze.view;
        let is_computed = view.field().is_some_and(|(_, raster)| raster == frame.raster)
            && (view.past.is_some() || view.kind == screen.field);
        Self {
            frame: frame.clone(),
            character: size,
            theme: screen.theme.name,
            overlays: screen.overlays,
            map: maze.map.clone(),
            field: is_computed.then(|| view.fields.clone()),
            exploration: view.exploration.clone(),
            cut_off: view.cut_off.clone(),
            farthest: maze.farthest(screen),
            least_contour_interval: screen.least_contour_interval,
            subject: (view.goal.clone(), view.kind, view.past.as_ref().map(|past| past.updates)),
        }
    }

    fn same_place(&self, other: &Self) -> bool {
        (&self.frame, self.character) == (&other.frame, other.character)
            && Arc::ptr_eq(&self.map, &other.map)
    }

    fn same_style(&self, other: &Self) -> bool {
        (self.theme, self.overlays) == (other.theme, other.overlays) && self.same_place(other)
    }

    fn is(&self, other: &Self) -> bool {
        let pointer = |key: &Self| key.field.as_ref().map(Arc::as_ptr);
        let numbers = |key: &Self| [key.farthest, key.least_contour_interval].map(f32::to_bits);
        self.same_style(other)
            && pointer(self) == pointer(other)
            && Arc::ptr_eq(&self.exploration, &other.exploration)
            && Arc::ptr_eq(&self.cut_off, &other.cut_off)
            && numbers(self) == numbers(other)
            && self.subject.2.is_some() == other.subject.2.is_some()
    }
}

/// Map and field only, which change far less often than what moves on them.
struct BaseLayer {
    key: PixelsKey,
    canvas: Canvas,
    /// The canvas as characters, unless it is a picture.
    painted: Buffer,
    /// What the pixels of the field show.
    grounds: Vec<RasterPixel>,
    /// The contour interval outside of a comparison, if lines are drawn.
    own_interval: Option<f32>,
    /// Until when it may be kept while training has priority.
    rests_until: Instant,
}

pub fn draw(pane: Rect, maze: &MazeState, on: &mut Drawing) {
    let Drawing { frame, screen, layout, cache } = on;
    let marker = screen.marker.at(screen.theme.depth);
    let Some(map_frame) = MapFrame::fit(pane, &maze.map, marker, maze.viewport) else { return };
    layout.map = Some(map_frame.clone());
    let area = map_frame.area;
    let character = screen.picture_character().filter(|_| cache.has_pictures);
    let key = PixelsKey::new(&map_frame, character, maze, screen);
    let before = cache.base.take();
    let may_stay = |base: &BaseLayer| {
        let rests = match screen.redraw {
            Redraw::All => false,
            Redraw::Nothing => cache.picture.is_some(),
            Redraw::Moving => {
                Instant::now() < base.rests_until
                    && base.key.subject == key.subject
                    && base.key.field.is_some() == key.field.is_some()
            }
        };
        character.is_some() && rests && base.key.same_style(&key)
    };
    let base = match before {
        Some(base) if base.key.is(&key) || may_stay(&base) => base,
        before => BaseLayer::new(key, before, maze, screen),
    };
    layout.own_contour_interval = base.own_interval;
    layout.contour_interval = shown_interval(base.own_interval, screen);
    if character.is_some() {
        TerminalPicture::reserve(area, frame.buffer_mut());
        cache.is_shown = true;
        if screen.redraw != Redraw::Nothing || cache.picture.is_none() {
            let pixels = cache.picture.take().map_or_else(Vec::new, |before| before.pixels);
            let canvas = draw_moving(base.canvas.on_top(pixels), maze, screen);
            let columns = canvas.columns();
            cache.picture = Some(TerminalPicture { area, columns, pixels: canvas.pixels });
        }
    } else {
        let mut canvas = draw_moving(base.canvas.on_top(Vec::new()), maze, screen);
        for at in area.positions() {
            frame.buffer_mut()[at].clone_from(&base.painted[at]);
        }
        canvas.paint_changes(frame.buffer_mut(), &screen.theme);
        canvas.paint_signs(frame.buffer_mut(), &screen.theme);
    }
    cache.base = Some(base);
    draw_minimap(pane, maze, on);
}

/// Returns the contour interval to show, given the interval `own` outside of a comparison.
fn shown_interval(own: Option<f32>, screen: &Screen) -> Option<f32> {
    own.map(|own| own.max(screen.least_contour_interval))
}

impl BaseLayer {
    /// Draws map and field, with contour lines at the same interval as `before` if possible.
    fn new(key: PixelsKey, before: Option<Self>, maze: &MazeState, screen: &Screen) -> Self {
        let began = Instant::now();
        let is_fine = key.character.is_some();
        let theme = if is_fine { screen.theme.in_full_colour() } else { screen.theme };
        let mut canvas = Canvas::new(&key.frame, key.character);
        let (raster, columns) = (key.frame.raster, key.frame.raster.pixels.0);
        let interval = before.as_ref().and_then(|before| before.own_interval);
        let grounds = before.filter(|own| own.key.same_place(&key)).map(|own| own.grounds);
        let ground = |i: usize| raster.ground(&maze.map, i % columns, i / columns);
        let grounds = grounds.unwrap_or_else(|| (0..raster.len()).map(ground).collect());
        let known = Known::new(maze, screen);
        draw_ground(&mut canvas, &key, &grounds, &known, &theme);
        let shows_contours = known.field.is_distance() && screen.overlays.has(Overlay::Contours);
        let field = key.field.as_deref().filter(|_| shows_contours).map(|fields| &fields[0]);
        let own_interval = field.and_then(|field| {
            // Not at walls within pixels, which lines would follow as distances jump there, and
            // not where values mean nothing.
            let open = |(value, ground): (&f32, &RasterPixel)| match ground {
                RasterPixel::Free(at)
                    if !matches!(known.kind(*at), GroundKind::CutOff | GroundKind::Beyond) =>
                {
                    *value
                }
                _ => f32::NAN,
            };
            let open: Vec<f32> = field.iter().zip(&grounds).map(open).collect();
            let own = contour_interval(&[(&open, columns)], is_fine, interval);
            if let Some(interval) = shown_interval(own, screen) {
                draw_contours(&mut canvas, (&open, columns), interval, &theme);
            }
            own
        });
        let mut painted = Buffer::default();
        if !is_fine {
            painted = Buffer::empty(key.frame.area);
            canvas.paint(&mut painted, &theme);
        }
        let rests_until =
            Instant::now() + LONGEST_GROUND_REST.min(GROUND_REST_FACTOR * began.elapsed());
        Self { key, canvas, painted, grounds, own_interval, rests_until }
    }
}

fn shown_cell(maze: &MazeState) -> Cell {
    maze.past().and_then(|frame| cell_of_goal(&frame.goal, &maze.map)).unwrap_or(maze.goal)
}

struct Known<'a> {
    maze: &'a MazeState,
    field: Field,
    /// What has been explored, if not everything has and that is shown; films do not record it.
    exploration: Option<&'a Exploration>,
    /// The cells from which no path leads to the goal, if colours show distances to it.
    cut_off: &'a [bool],
}

impl<'a> Known<'a> {
    fn new(maze: &'a MazeState, screen: &Screen) -> Self {
        let (view, field, is_past) = (&maze.view, maze.shown_field(screen), maze.past().is_some());
        let shown = screen.overlays.has(Overlay::Unexplored) && !is_past;
        let exploration =
            Some(&*view.exploration).filter(|own| shown && !own.is_complete(&maze.map));
        let to_goal =
            matches!(field, Field::Learned | Field::Composed | Field::True | Field::Error);
        // The trainer may not know the map's latest edit yet.
        let is_current = view.cut_off.len() == maze.map.free().len();
        let cut_off = if to_goal && is_current && !is_past { &**view.cut_off } else { &[] };
        Self { maze, field, exploration, cut_off }
    }

    fn knowledge(&self, at: [f32; 2]) -> Option<Knowledge> {
        self.exploration.map(|exploration| exploration.at(at))
    }

    fn kind(&self, at: [f32; 2]) -> GroundKind {
        let cell = Cell::new(at[0] as usize, at[1] as usize);
        if self.cut_off.get(self.maze.map.index(cell)) == Some(&true) {
            return GroundKind::CutOff;
        }
        match self.knowledge(at) {
            Some(Knowledge::Beyond) if self.field.fades() => GroundKind::Beyond,
            _ => GroundKind::Plain,
        }
    }

    /// Returns the look of a free position in pixels that show `several` cells.
    fn look(&self, at: [f32; 2], several: bool) -> Look {
        let knowledge = self.knowledge(at);
        let is_edge = matches!(knowledge, Some(Knowledge::Edge | Knowledge::Pocket))
            || several && knowledge == Some(Knowledge::Known);
        Look { kind: self.kind(at), wall: 0.0, is_edge }
    }
}

fn draw_ground(
    canvas: &mut Canvas,
    key: &PixelsKey,
    grounds: &[RasterPixel],
    known: &Known,
    theme: &Theme,
) {
    let (map, raster, is_fine) = (&known.maze.map, canvas.raster, canvas.is_fine);
    let (columns, several) = (raster.pixels.0, raster.cells_per_pixel() > 1.0);
    let colours = Colours { theme, field: known.field, farthest: key.farthest };
    let field = key.field.as_deref().map(|fields| (&*fields[0], key.frame.raster.pixels.0));
    let [across, down] = spans(&raster);
    let mut before = None;
    let coarse = |y: usize, looks: &mut [Look]| {
        for (look, ground) in looks.iter_mut().zip(&grounds[y * columns..]) {
            *look = coarse_look(*ground, |at| known.look(at, several));
        }
    };
    let fine = |y: usize, looks: &mut [Look]| {
        let rows = down[y];
        // The rows of pixels of a cell look the same.
        if before.replace(rows) == Some(rows) {
            return;
        }
        for x in 0..columns {
            looks[x] = if x > 0 && across[x] == across[x - 1] {
                looks[x - 1]
            } else {
                block_look(across[x], rows, known, several)
            };
        }
    };
    let reach = if is_fine { (EDGE * canvas.character.1 as f32).max(1.0) as isize } else { 1 };
    let is_beside = |x: usize, y: usize| {
        let [left, top, ..] = raster.window;
        let [dx, dy] =
            [raster.window[2] / columns as f32, raster.window[3] / raster.pixels.1 as f32];
        (0..9).any(|n| {
            let by = [(n % 3 - 1) * reach, (n / 3 - 1) * reach].map(|by| by as f32 + 0.5);
            let at = [left + (x as f32 + by[0]) * dx, top + (y as f32 + by[1]) * dy];
            map.is_free_at(at[0], at[1]) && known.knowledge(at) == Some(Knowledge::Beyond)
        })
    };
    if is_fine {
        ground::draw(canvas, field, &colours, fine, is_beside);
    } else {
        ground::draw(canvas, field, &colours, coarse, is_beside);
    }
}

/// Returns the look of a pixel as characters show it, given that of free positions.
fn coarse_look(ground: RasterPixel, free: impl Fn([f32; 2]) -> Look) -> Look {
    match ground {
        RasterPixel::Outside => Look { kind: GroundKind::Outside, ..Look::plain(0.0) },
        RasterPixel::Wall => Look::plain(1.0),
        RasterPixel::Crossed(_) => Look::plain(CROSSED_WALL_SHARE),
        RasterPixel::Free(at) => free(at),
    }
}

/// Returns the look of the cells in these columns and rows (first, end): the more wall, the darker.
fn block_look(xs: (usize, usize), ys: (usize, usize), known: &Known, several: bool) -> Look {
    let map = &known.maze.map;
    if xs.0 >= map.width() || ys.0 >= map.height() {
        return Look { kind: GroundKind::Outside, ..Look::plain(0.0) };
    }
    let row =
        |y: usize| &map.free()[y * map.width() + xs.0..y * map.width() + xs.1.min(map.width())];
    let rows = ys.0..ys.1.min(map.height());
    let walls: usize = rows.map(|y| row(y).iter().filter(|free| !**free).count()).sum();
    if walls > 0 {
        let share = walls as f32 / ((xs.1 - xs.0) * (ys.1 - ys.0)) as f32;
        return Look::plain(share.max(LEAST_WALL_SHARE));
    }
    known.look(Cell::new(xs.0, ys.0).centre(), several)
}

/// Returns the cells (first, end) that each column of pixels shows, and each row: at least one.
fn spans(raster: &Raster) -> [Vec<(usize, usize)>; 2] {
    let [left, top, width, height] = raster.window;
    let all = [(left, width, raster.pixels.0), (top, height, raster.pixels.1)];
    all.map(|(from, shown, pixels)| {
        let at = |i: usize, off: f32| from + (i as f32 + off) / pixels as f32 * shown;
        let span = |i: usize| {
            // A pixel shows the cell of its middle, and others whose middles are in it.
            let (first, end) = ((at(i, 0.0) + 0.5) as usize, (at(i, 1.0) + 0.5) as usize);
            let middle = at(i, 0.5).max(0.0) as usize;
            if first < end && shown > pixels as f32 { (first, end) } else { (middle, middle + 1) }
        };
        (0..pixels).map(span).collect()
    })
}

/// Draws what changes from frame to frame, the most important last.
fn draw_moving(canvas: Canvas, maze: &MazeState, screen: &Screen) -> Canvas {
    let (raster, map, view) = (canvas.raster, &maze.map, &maze.view);
    let is_fine = canvas.is_fine;
    // Pixels of pictures show only what they contain.
    let on_floor = |at: [f32; 2]| if is_fine { at } else { raster.on_floor(map, at) };
    let place = |at: &[f32]| match at {
        [x, y, ..] => Some(on_floor([*x, *y])),
        _ => None,
    };
    let theme = if canvas.is_fine { screen.theme.in_full_colour() } else { screen.theme };
    let past = maze.past();
    let [least, most] = AGENT_RADII;
    let radius = canvas.heights(AGENT_RADIUS).clamp(least, most);
    let mut painter =
        Painter { canvas, screen, theme, place: &place, state: &place, sizes: [2, 2] };
    if past.is_none() {
        painter.edges(&view.graph, false);
        painter.candidates(&view.graph);
        let drawn = |way: Vec<[f32; 2]>| -> Vec<[f32; 2]> {
            if is_fine { way } else { samples(&way, &raster).into_iter().map(on_floor).collect() }
        };
        let stops = painter.places(&view.reach.path);
        let stops = &stops[..if is_fine { stops.len().saturating_sub(1) } else { 0 }];
        painter.plan(&drawn(maze.way()), stops);
        painter.search(|stops| drawn(way_along(map, stops)));
        draw_preview(&mut painter, maze);
        painter.own_trail(&painter.places(&view.reach.trail), LONGEST_STEP);
    }
    painter.explorers(past, LONGEST_STEP, radius);
    draw_signs(&mut painter, maze);
    painter.canvas
}

/// Returns positions along a way, at least one in each of its pixels.
fn samples(way: &[[f32; 2]], raster: &Raster) -> Vec<[f32; 2]> {
    let scale =
        [raster.pixels.0 as f32 / raster.window[2], raster.pixels.1 as f32 / raster.window[3]];
    let along = way.windows(2).flat_map(|ends| {
        let [x, y] = [0, 1].map(|axis| scale[axis] * (ends[1][axis] - ends[0][axis]).abs());
        positions_along([ends[0], ends[1]], x.max(y).ceil().max(1.0) as usize)
    });
    along.collect()
}

fn draw_preview(painter: &mut Painter, maze: &MazeState) {
    let Some((cells, free)) = maze.editor.preview() else { return };
    let theme = &painter.theme;
    let (rgb, mark) = if free { (theme.unknown, ' ') } else { (theme.wall, '#') };
    let ink = Ink::new(blend(rgb, theme.cursor, 0.25), 1.0, mark);
    cells.iter().for_each(|cell| painter.canvas.cell(*cell, ink));
}

/// Draws the map's own starts and goals, the agents' goals, the walk and the cursor.
fn draw_signs(painter: &mut Painter, maze: &MazeState) {
    let (theme, screen, is_past) = (painter.theme, painter.screen, maze.past().is_some());
    for (marks, letter) in [(maze.map.starts(), 's'), (maze.map.goals(), 'g')] {
        for cell in marks {
            let rgb = ink(painter.canvas.colour(cell.centre()));
            let at = (painter.place)(&cell.centre()).unwrap_or(cell.centre());
            painter.canvas.symbol(at, letter, Some(rgb));
        }
    }
    if painter.shows(Overlay::Agents) && !is_past {
        // A wall may have been drawn there since.
        let goals = screen.snapshot.frontier_goals.chunks_exact(2);
        for at in goals.filter(|at| maze.map.is_free_at(at[0], at[1])).filter_map(painter.place) {
            painter.canvas.mark(at, FRONTIER_SIGN, theme.frontier);
        }
    }
    if !is_past {
        painter.letter((painter.place)(&maze.view.reach.start), 'S', theme.walker, 0.36);
    }
    painter.letter((painter.place)(&shown_cell(maze).centre()), 'G', theme.goal, 0.45);
    // Without plans, @ is the actor alone.
    let shows = painter.shows(Overlay::Ghost) && screen.run().method.plans();
    if let Some(ghost) = maze.view.reach.ghost.as_ref().filter(|_| shows && !is_past) {
        painter.letter((painter.place)(&ghost.at), 'a', theme.ghost(), 0.42);
    }
    if !is_past {
        painter.letter((painter.place)(&maze.view.reach.at), '@', theme.walker, 0.42);
    }
    if let Some(end) = maze.editor.first_end() {
        painter.canvas.letter(end.centre(), 'x', theme.cursor, 0.36);
    }
    if let Some(cursor) = maze.editor.cursor.or(maze.inspecting) {
        painter.canvas.letter(cursor.centre(), '+', theme.cursor, 0.36);
    }
}

/// Draws the whole map in a corner of `area` while only a part of it is shown: in the upper right
/// one, unless it would hide the goal or the cursor there.
fn draw_minimap(area: Rect, maze: &MazeState, on: &mut Drawing) {
    let Drawing { frame, layout, screen: Screen { theme, .. }, .. } = on;
    let Some(shown) = layout.map.as_ref().filter(|_| maze.viewport.zoom > 1.0) else {
        return;
    };
    let room = Rect {
        width: MAX_MINIMAP.0.min(area.width / PANE_DIVISOR),
        height: MAX_MINIMAP.1.min(area.height / PANE_DIVISOR),
        ..area
    };
    let inner =
        Rect { width: room.width.saturating_sub(2), height: room.height.saturating_sub(2), ..area };
    let (marker, whole) = (Marker::Quadrant.at(theme.depth), Viewport::default());
    let Some(map_frame) = MapFrame::fit(inner, &maze.map, marker, whole) else { return };
    let (width, height) = (map_frame.area.width + 2, map_frame.area.height + 2);
    let (right, bottom) =
        (area.right().saturating_sub(width), area.bottom().saturating_sub(height));
    let corners = [(right, area.y), (area.x, area.y), (right, bottom), (area.x, bottom)];
    let corners = corners.map(|(x, y)| Rect { x, y, width, height });
    let seen = [Some(shown_cell(maze)), maze.inspecting, maze.editor.cursor].into_iter().flatten();
    let seen: Vec<Position> = seen.filter_map(|cell| shown.character_of(cell.centre())).collect();
    let outer = corners
        .into_iter()
        .find(|corner| !seen.iter().any(|at| corner.contains(*at)))
        .unwrap_or(corners[0]);
    let map_frame =
        MapFrame { area: Rect { x: outer.x + 1, y: outer.y + 1, ..map_frame.area }, ..map_frame };
    let mut canvas = Canvas::new(&map_frame, None);
    let [left, top, columns, rows] = shown.raster.window;
    let raster = map_frame.raster;
    let looks = |y: usize, looks: &mut [Look]| {
        for (x, look) in looks.iter_mut().enumerate() {
            *look = coarse_look(raster.ground(&maze.map, x, y), |_| Look::plain(0.0));
        }
    };
    // Floor stands out, and where it is shown stands out from it.
    let mut bright = *theme;
    bright.unknown = theme.distance_colour(0.5);
    let colours = Colours { theme: &bright, field: Field::Plain, farthest: 1.0 };
    ground::draw(&mut canvas, None, &colours, looks, |_, _| false);
    let part = [[left, top], [left + columns, top + rows]];
    canvas.rectangle(part, Ink { on_floor: true, ..Ink::new(theme.walker, 0.5, '.') });
    frame.render_widget(Clear, outer);
    frame.render_widget(Block::bordered().style(Style::new()), outer);
    canvas.paint(frame.buffer_mut(), theme);
    layout.minimap = Some(map_frame);
}
