//! The map pane: two pixels a character cell, one above the other.

use std::sync::Arc;

use ratatui::Frame;
use ratatui::buffer::Buffer;
use ratatui::layout::{Position, Rect};
use ratatui::style::{Modifier, Style};

use crate::map::Grid;
use crate::tui::app::App;
use crate::tui::colour::{self, Depth, Rgb};
use crate::tui::raster::{Ground, MapFrame, Raster};

/// Contour lines lie this many steps apart, or a multiple, so that there are not too many.
const CONTOUR_STEPS: f32 = 10.0;
const MOST_CONTOURS: f32 = 14.0;

/// Bridge candidates are drawn from so many pixels a cell on.
const LEAST_SCALE_FOR_BRIDGES: f32 = 0.75;

/// Draws the map and everything on it.
pub fn draw(frame: &mut Frame, area: Rect, app: &mut App) {
    let Some(place) = MapFrame::fit(area, &app.map().clone()) else { return };
    app.set_frame(place.clone());
    let base = app.base.take().filter(|base| base.shows(&place.raster, app));
    let base = base.unwrap_or_else(|| Base::new(&place.raster, app));
    let canvas = Canvas::new(&place, &base, app);
    app.base = Some(base);
    canvas.paint(frame.buffer_mut(), &place, app.depth);
    let mut glyphs = Glyphs { place: &place, depth: app.depth, buffer: frame.buffer_mut() };
    let start = app.view.walk.start;
    glyphs.put(start, 'S', colour::WALKER);
    glyphs.put(app.goal.centre(), 'G', colour::GOAL);
    if let Some(at) = app.view.trail.last() {
        glyphs.put(*at, '@', colour::WALKER);
    }
    if let Some(cursor) = app.editor.cursor {
        glyphs.put(cursor.centre(), '+', colour::CURSOR);
    }
}

/// Map and distance field alone: they change far more rarely than what moves on them.
#[derive(Clone)]
pub struct Base {
    raster: Raster,
    map: Arc<Grid>,
    field: Option<Arc<Vec<f32>>>,
    canvas: Canvas,
}

impl Base {
    fn new(raster: &Raster, app: &App) -> Self {
        let (columns, rows) = raster.pixels;
        let mut canvas = Canvas { columns, pixels: vec![None; columns * rows], marks: vec![' '; columns * rows] };
        canvas.terrain(raster, app.map());
        let field = Self::field_on(raster, app).cloned();
        if let Some(field) = &field {
            canvas.field(field);
        }
        Self { raster: *raster, map: app.map().clone(), field, canvas }
    }

    /// The field that belongs on `raster`, if it has been computed.
    fn field_on<'a>(raster: &Raster, app: &'a App) -> Option<&'a Arc<Vec<f32>>> {
        (app.view.raster == Some(*raster)).then_some(&app.view.field)
    }

    /// Whether this is what is to be shown now.
    fn shows(&self, raster: &Raster, app: &App) -> bool {
        let same_field = match (&self.field, Self::field_on(raster, app)) {
            (Some(own), Some(now)) => Arc::ptr_eq(own, now),
            (own, now) => own.is_none() && now.is_none(),
        };
        self.raster == *raster && same_field && Arc::ptr_eq(&self.map, app.map())
    }
}

/// The pixels, before they become characters.
#[derive(Clone)]
struct Canvas {
    columns: usize,
    /// Colour of each pixel; `None` outside the map.
    pixels: Vec<Option<Rgb>>,
    /// What a terminal without colours shows there.
    marks: Vec<char>,
}

impl Canvas {
    /// What moves, drawn on `base`.
    fn new(place: &MapFrame, base: &Base, app: &App) -> Self {
        let mut canvas = base.canvas.clone();
        // On a shrunken map they would hide the rest.
        if app.show_bridges && place.raster.scale() >= LEAST_SCALE_FOR_BRIDGES {
            for point in app.view.candidates.iter() {
                canvas.ground_dot(place, *point, colour::CANDIDATE, ':');
            }
        }
        let mut from = app.view.trail.last().copied();
        for to in &app.view.path {
            if let Some(from) = from {
                canvas.line(place, from, *to);
            }
            from = Some(*to);
        }
        if let Some((cells, free)) = app.editor.stroke() {
            let (rgb, mark) = if free { (colour::UNKNOWN, ' ') } else { (colour::WALL, '#') };
            for cell in cells {
                canvas.dot(place, cell.centre(), rgb, mark);
            }
        }
        if app.show_agents {
            for at in app.snapshot.agents.chunks_exact(2) {
                canvas.dot(place, [at[0], at[1]], colour::AGENT, 'o');
            }
        }
        canvas
    }

    /// Walls and floor.
    fn terrain(&mut self, raster: &Raster, map: &Grid) {
        for i in 0..self.pixels.len() {
            let (colour, mark) = match raster.ground(map, i % self.columns, i / self.columns) {
                Ground::Outside => (None, ' '),
                Ground::Wall => (Some(colour::WALL), '#'),
                Ground::Free(_) => (Some(colour::UNKNOWN), ' '),
            };
            self.pixels[i] = colour;
            self.marks[i] = mark;
        }
    }

    /// The distance field as colours, with contour lines.
    fn field(&mut self, field: &[f32]) {
        let farthest = field.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max);
        let apart = (farthest / MOST_CONTOURS / CONTOUR_STEPS).ceil().max(1.0) * CONTOUR_STEPS;
        let band = |i: usize| (field[i] / apart).floor();
        for i in 0..self.pixels.len() {
            let wall = self.marks[i] == '#';
            if wall || !field[i].is_finite() {
                continue;
            }
            let neighbours = [(i + 1, !(i + 1).is_multiple_of(self.columns)), (i + self.columns, true)];
            let contour = neighbours.iter().any(|(n, same_row)| {
                *same_row && *n < self.pixels.len() && field[*n].is_finite() && band(*n) != band(i)
            });
            self.pixels[i] = Some(if contour {
                colour::contour(field[i] / farthest)
            } else {
                colour::of_distance(field[i] / farthest)
            });
            self.marks[i] = if contour { '\u{b7}' } else { ' ' };
        }
    }

    /// A dot, but not on a wall that its pixel shows.
    fn ground_dot(&mut self, place: &MapFrame, at: [f32; 2], rgb: Rgb, mark: char) {
        let pixel = place.raster.pixel_of(at).map(|(column, row)| row * self.columns + column);
        if pixel.is_some_and(|i| self.marks[i] != '#') {
            self.dot(place, at, rgb, mark);
        }
    }

    fn dot(&mut self, place: &MapFrame, at: [f32; 2], rgb: Rgb, mark: char) {
        if let Some((column, row)) = place.raster.pixel_of(at) {
            self.pixels[row * self.columns + column] = Some(rgb);
            self.marks[row * self.columns + column] = mark;
        }
    }

    fn line(&mut self, place: &MapFrame, from: [f32; 2], to: [f32; 2]) {
        let cells = (to[0] - from[0]).abs().max((to[1] - from[1]).abs());
        let samples = (cells * place.raster.scale()).ceil().max(1.0) as usize;
        for i in 0..=samples {
            let t = i as f32 / samples as f32;
            let at = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
            self.dot(place, at, colour::PATH, '+');
        }
    }

    /// Writes the pixels as characters: upper half block, foreground above and background below.
    fn paint(&self, buffer: &mut Buffer, place: &MapFrame, depth: Depth) {
        for row in 0..place.area.height {
            for column in 0..place.area.width {
                let above = 2 * usize::from(row) * self.columns + usize::from(column);
                let below = above + self.columns;
                let at = Position::new(place.area.x + column, place.area.y + row);
                let Some(cell) = buffer.cell_mut(at) else { continue };
                if depth == Depth::Mono {
                    // The more telling of the two pixels.
                    let (a, b) = (self.marks[above], self.marks[below]);
                    cell.set_char(if a == ' ' || a == '#' && b != ' ' { b } else { a });
                    continue;
                }
                let (top, bottom) = (self.pixels[above], self.pixels[below]);
                let mut style = Style::new();
                if let Some(rgb) = bottom {
                    style = style.bg(depth.colour(rgb));
                }
                if let Some(rgb) = top {
                    style = style.fg(depth.colour(rgb));
                    cell.set_char('\u{2580}');
                }
                cell.set_style(style);
            }
        }
    }
}

/// Letters on top of the pixels.
struct Glyphs<'a> {
    place: &'a MapFrame,
    depth: Depth,
    buffer: &'a mut Buffer,
}

impl Glyphs<'_> {
    fn put(&mut self, at: [f32; 2], letter: char, rgb: Rgb) {
        let Some((column, row)) = self.place.raster.pixel_of(at) else { return };
        let at = Position::new(self.place.area.x + column as u16, self.place.area.y + row as u16 / 2);
        let Some(cell) = self.buffer.cell_mut(at) else { return };
        let style = match self.depth {
            Depth::Mono => Style::new().add_modifier(Modifier::REVERSED | Modifier::BOLD),
            depth => {
                let black = depth.colour((0, 0, 0));
                Style::new().bg(depth.colour(rgb)).fg(black).add_modifier(Modifier::BOLD)
            }
        };
        cell.set_char(letter).set_style(style);
    }
}
