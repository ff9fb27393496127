//! Draws the comparison.
//!
//! ```text
//! +---------------------------------------------------+
//! | map, seed, phase                                  |  header
//! | A method, preset        | B method, preset        |
//! | what D and preset are   | what D and preset are   |  unless they are obvious
//! | map          facts      | map          facts      |  facts: below if the map gains
//! | meaning of colours      | meaning of colours      |
//! | success over environment steps                    |  curves
//! | keys, or a notice                                 |  footer
//! +---------------------------------------------------+
//! ```

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use super::{Comparison, Side, curves, maze_of};
use crate::tui::action::{Action, Mode};
use crate::tui::layer::draw_dialog;
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::log::Notice;
use crate::tui::raster::{MapFrame, Viewport};
use crate::tui::render::{finish_frame, footer, too_small};
use crate::tui::scene::{Cache, maze};
use crate::tui::session::{Cx, Session};
use crate::tui::style::{BOLD, DIM, REVERSED};
use crate::tui::text::{fitted_lines, short};
use gdg::engine::Phase;
use gdg::text::{display_width, fitted, grouped};

/// The smallest screen with room for everything, in columns and rows.
pub const MIN_SIZE: (u16, u16) = (60, 18);

/// Columns of the facts beside a map.
const FACTS_WIDTH: u16 = 19;

/// Rows of the curves: a share of the screen's, within limits.
const CURVES_DIVISOR: u16 = 4;
const CURVES_ROWS: (u16, u16) = (7, 16);

/// Shares of the width: of the larger side, and of the other one.
const LARGER: (u16, u16) = (2, 1);

/// Where everything is.
pub struct Parts {
    pub layout: ScreenLayout,
    /// Both maps, with facts and titles.
    pub maps: Rect,
    /// The sides, unless the screen is too small.
    sides: Option<[ScreenLayout; 2]>,
}

/// Draws everything; returns what can be clicked.
pub fn draw(frame: &mut Frame, comparison: &mut Comparison) -> ScreenLayout {
    let mut caches = comparison.sessions.each_mut().map(|own| std::mem::take(&mut own.cache));
    let Parts { layout, sides, .. } = draw_parts(frame, comparison, caches.each_mut());
    for (session, cache) in comparison.sessions.iter_mut().zip(caches) {
        session.cache = cache;
    }
    let Some(mut drawn) = sides else { return layout };
    let Cx { screen, scene, .. } = &comparison.sessions[0].cx;
    draw_dialog(frame, screen, scene, &mut drawn[0]);
    finish_frame(frame, &screen.theme);
    // The same lines on both sides, from the next frame on.
    let interval = drawn.iter().filter_map(|side| side.own_contour_interval).fold(0.0, f32::max);
    for (session, drawn) in comparison.sessions.iter_mut().zip(drawn) {
        session.screen.least_contour_interval = interval;
        session.drawn(drawn);
    }
    layout
}

/// Draws everything but dialogs.
pub fn draw_parts(frame: &mut Frame, comparison: &Comparison, caches: [&mut Cache; 2]) -> Parts {
    let area = frame.area();
    let mut layout = ScreenLayout::new(area);
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        too_small(frame, "a comparison", MIN_SIZE);
        return Parts { layout, maps: Rect::default(), sides: None };
    }
    let rows = (area.height / CURVES_DIVISOR).clamp(CURVES_ROWS.0, CURVES_ROWS.1);
    let [head, body, below, foot] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(rows),
        Constraint::Length(1),
    ])
    .areas(area);
    header(frame, head, comparison, &mut layout);
    let share = |side: usize| match comparison.larger {
        Some(larger) if larger == side => Constraint::Fill(LARGER.0),
        Some(_) => Constraint::Fill(LARGER.1),
        None => Constraint::Fill(1),
    };
    // Equally large sides show their maps in the same size.
    let gap = 1 + u16::from(comparison.larger.is_none() && body.width.is_multiple_of(2));
    let [left, line, right] =
        Layout::horizontal([share(0), Constraint::Length(gap), share(1)]).areas(body);
    frame.render_widget(Block::new().borders(Borders::LEFT), line);
    let areas = [left, right];
    let facts = [0, 1].map(|own| {
        let (arrived, races) = comparison.race.results(own);
        facts(&comparison.sessions[own], arrived, races)
    });
    let texts = [0, 1].map(|own| text(&facts[own], areas[own].width));
    let most = texts.iter().map(Vec::len).max().unwrap_or(0);
    let explains = comparison.sides.iter().any(|side| side.about.is_some());
    let mut drawn = [ScreenLayout::new(area), ScreenLayout::new(area)];
    for (own, cache) in caches.into_iter().enumerate() {
        let title = Rect { height: 1, ..areas[own] };
        layout.add(title, Click::Act(Action::Larger(own)));
        draw_title(frame, title, comparison, own);
        let rest = Rect { y: title.y + 1, height: areas[own].height - 1, ..areas[own] };
        let [about, rest] =
            Layout::vertical([Constraint::Length(u16::from(explains)), Constraint::Min(0)])
                .areas(rest);
        draw_about(frame, about, &comparison.sides[own]);
        let rows = if comparison.larger.is_none() { most } else { texts[own].len() };
        let shown = (&*facts[own], rows as u16);
        draw_side(frame, rest, &comparison.sessions[own], shown, cache, &mut drawn[own]);
    }
    curves::draw(frame, below, comparison, &mut layout);
    draw_footer(frame, foot, comparison, &mut layout);
    Parts { layout, maps: body, sides: Some(drawn) }
}

fn header(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let Cx { screen, scene, .. } = &training_side(comparison).cx;
    let mut bar = ClickableLine::default();
    let act = |action| Some(Click::Act(action));
    bar.push(Span::styled(" gdg-tui compare ", BOLD.patch(REVERSED)), act(Action::Help));
    bar.push(Span::styled(format!(" {} ", comparison.maze(0).map.name()), BOLD), None);
    // Saved runs may have others, which their titles give.
    let [a, b] = comparison.sessions.each_ref().map(|session| session.screen.run().seed);
    if a == b {
        bar.push(Span::raw(format!("seed {a} ")), None);
    }
    let phase = if matches!(screen.snapshot.phase, Phase::Failed(_)) {
        "stopped".to_owned()
    } else {
        scene.phase(screen)
    };
    bar.push(Span::styled(format!(" {phase} "), BOLD), act(Action::TogglePause));
    let more = if comparison.is_past() {
        let [back, forth, close] =
            [Action::Back, Action::Forth, Action::Close].map(|action| screen.keymap.key_of(action));
        [
            format!(" looking back: {back} earlier, {forth} later, {close} the present"),
            format!(" looking back: {back} {forth} {close}"),
        ]
    } else {
        [" nothing is saved", ""].map(str::to_owned)
    };
    let room = usize::from(area.width).saturating_sub(bar.width());
    let [long, short] = more;
    let text = if display_width(&long) <= room { long } else { short };
    bar.push(Span::styled(text, DIM), None);
    bar.draw(frame, area, layout);
}

/// Returns the side that shows whether training runs: one that trains, if any does.
fn training_side(comparison: &Comparison) -> &Session {
    let [a, b] = &comparison.sessions;
    if b.is_training() && !a.is_training() { b } else { a }
}

/// Draws the title of a side: what it is, and whether it has stopped or shows its past.
fn draw_title(frame: &mut Frame, area: Rect, comparison: &Comparison, own: usize) {
    let (title, screen) = (&comparison.sides[own].title, &comparison.sessions[own].screen);
    let shown = grouped(comparison.shown_updates(own));
    let state = match (&screen.snapshot.phase, &screen.past) {
        (Phase::Failed(error), _) => format!("stopped: {error} "),
        (_, Some(past)) if screen.snapshot.is_edited_since(past.updates) => {
            format!("at update {shown}, walls of today ")
        }
        (_, Some(_)) => format!("at update {shown} "),
        (Phase::Paused, _) => "paused ".to_owned(),
        _ => String::new(),
    };
    let title = fitted(format!(" {title} {state}").trim_end(), usize::from(area.width));
    let title = Span::styled(format!("{title} "), BOLD);
    frame.render_widget(Block::new().borders(Borders::TOP).title(title), area);
}

/// Draws what the colours and the preset of a side mean, as long as there is room for.
fn draw_about(frame: &mut Frame, area: Rect, side: &Side) {
    let Some(texts) = &side.about else { return };
    let room = usize::from(area.width).saturating_sub(1);
    let text = texts.iter().find(|text| display_width(text) <= room).unwrap_or(&texts[1]);
    frame.render_widget(Span::styled(format!(" {}", fitted(text, room)), DIM), area);
}

/// Draws the map of a side, with its facts beside the map or in as many rows below it, and records
/// where it is.
fn draw_side(
    frame: &mut Frame,
    area: Rect,
    session: &Session,
    (facts, rows): (&[Fact], u16),
    cache: &mut Cache,
    layout: &mut ScreenLayout,
) {
    let Cx { screen, scene, .. } = &session.cx;
    let [inner, meaning] =
        Layout::vertical([Constraint::Min(0), Constraint::Length(1)]).areas(area);
    let beside =
        Layout::horizontal([Constraint::Min(0), Constraint::Length(FACTS_WIDTH)]).areas(inner);
    let below = Layout::vertical([Constraint::Min(0), Constraint::Length(rows)]).areas(inner);
    // The map as large as possible.
    let Some(maze) = scene.maze() else { return };
    let scale = |[room, _]: [Rect; 2]| {
        let frame = MapFrame::fit(room, &maze.map, screen.marker, Viewport::default());
        frame.map_or(0.0, |frame| frame.scale())
    };
    let ([room, known], lines) = if scale(beside) >= scale(below) {
        (beside, column(facts))
    } else {
        (below, text(facts, inner.width))
    };
    layout.map_pane = room;
    maze::draw(frame, [room, meaning], maze, screen, layout, cache);
    frame.render_widget(Paragraph::new(fitted_lines(lines, known.width)), known);
}

/// Draws a notice, or the available actions and their keys. The tools of the editor stay visible,
/// so notices are in the first row then.
fn draw_footer(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let Cx { screen, scene, .. } = &training_side(comparison).cx;
    let (notice, is_editing) = (comparison.notice(), comparison.is_editing());
    if let Some((text, notice)) = &notice {
        let at = if is_editing { Rect { y: 0, ..area } } else { area };
        footer::draw_notice(frame, at, &screen.theme, Notice { text, ..*notice });
    }
    if is_editing {
        let editor = &comparison.maze(comparison.editor_at).editor;
        footer::editing(screen, editor, area.width).draw(frame, area, layout);
    } else if notice.is_none() {
        footer::keys(screen, scene, Mode::Comparing, area.width, false).draw(frame, area, layout);
    }
}

/// Columns of the names in a column of facts.
const NAME_WIDTH: usize = 12;

/// A name and a value.
struct Fact {
    name: &'static str,
    value: String,
    style: Style,
    place: Place,
}

/// Facts that begin a new line of text, so that those of both sides line up.
const FIRST: [&str; 2] = ["success", "D error"];

/// How a fact follows the others in text.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Own,
    /// In brackets, as it explains the fact before it.
    Aside,
    /// The same without its name.
    NamelessAside,
}

impl Fact {
    fn new(name: &'static str, value: String) -> Self {
        Self { name, value, style: Style::new(), place: Place::Own }
    }
}

/// Returns the facts about a side, the most important first; its agent has finished
/// `arrived` of `races` races at the goal.
fn facts(session: &Session, arrived: u32, races: u32) -> Vec<Fact> {
    let (snapshot, walk) = (&session.screen.snapshot, &maze_of(session).view.walk);
    let mut facts = vec![
        Fact::new("steps", short(snapshot.counters.env_steps as f64)),
        Fact::new("updates", short(snapshot.counters.updates as f64)),
        Fact {
            place: Place::NamelessAside,
            ..Fact::new("rate", format!("{}/s", short(snapshot.rates.0)))
        },
    ];
    let success = session.screen.success();
    let rate = |rate: f64| format!("{rate:.2}");
    let value = success
        .map_or("-".to_owned(), |s| s.planned.or(s.greedy).map_or("no tasks".to_owned(), rate));
    facts.push(Fact { style: BOLD, ..Fact::new("success", value) });
    let unknown = || "-".to_owned();
    // Unknown values are shown too, so that what follows does not move.
    if session.screen.run().method.plans() {
        let greedy = success.and_then(|s| s.greedy).map_or_else(unknown, rate);
        facts.push(Fact { place: Place::Aside, ..Fact::new("greedy", greedy) });
    }
    facts.push(Fact::new("races", format!("{arrived}/{races}")));
    let latest = snapshot.evaluations.last();
    let error = latest.and_then(|(_, evaluation)| evaluation.distance_error);
    facts.push(Fact::new(
        "D error",
        error.map_or_else(unknown, |error| format!("{:.0} %", 100.0 * error.mape)),
    ));
    let updates = latest.map_or_else(unknown, |(updates, _)| short(*updates as f64));
    facts.push(Fact { place: Place::Aside, ..Fact::new("at update", updates) });
    let state = match walk {
        walk if walk.arrived => "arrived in",
        walk if walk.gave_up => "gave up at",
        _ => "walking",
    };
    facts.push(Fact::new(state, walk.steps.to_string()));
    facts.extend(
        walk.shortest
            .map(|steps| Fact { place: Place::Aside, ..Fact::new("shortest", steps.to_string()) }),
    );
    facts
}

fn column(facts: &[Fact]) -> Vec<Line<'static>> {
    let line = |fact: &Fact| {
        let name = format!(" {:<NAME_WIDTH$}", fact.name);
        Line::from(vec![Span::styled(name, DIM), Span::styled(fact.value.clone(), fact.style)])
    };
    facts.iter().map(line).collect()
}

/// Returns the facts one after the other, in lines of at most `width` columns.
fn text(facts: &[Fact], width: u16) -> Vec<Line<'static>> {
    let mut lines: Vec<Line> = vec![Line::default()];
    // A fact and what explains it stay together.
    for group in facts.chunk_by(|_, next| next.place != Place::Own) {
        let mut parts = Line::default();
        for fact in group {
            let (name, value) = match fact.place {
                Place::Own => (format!(" {} ", fact.name), fact.value.clone()),
                Place::Aside => (format!(" ({} ", fact.name), format!("{})", fact.value)),
                Place::NamelessAside => (" ".to_owned(), format!("({})", fact.value)),
            };
            parts.push_span(Span::styled(name, DIM));
            parts.push_span(Span::styled(value, fact.style));
        }
        let has_room = |line: &&mut Line| {
            let is_first = FIRST.contains(&group[0].name);
            line.spans.is_empty()
                || !is_first && line.width() + 1 + parts.width() <= usize::from(width)
        };
        match lines.last_mut().filter(has_room) {
            Some(line) if line.spans.is_empty() => *line = parts,
            // A wider gap between facts than within one.
            Some(line) => line.spans.extend(std::iter::once(Span::raw(" ")).chain(parts.spans)),
            None => lines.push(parts),
        }
    }
    lines
}
