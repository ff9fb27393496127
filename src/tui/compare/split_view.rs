//! Draws the comparison.
//!
//! ```text
//! +---------------------------------------------------+
//! | map, seed, phase                                  |  header
//! | A method, what differs  | B method, what differs  |
//! | map                     | map                     |
//! | meaning of colours      | meaning of colours      |
//! | facts                   | facts                   |
//! | success over updates                              |  curves
//! | keys, or a notice                                 |  footer
//! +---------------------------------------------------+
//! ```

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph};

use super::{Comparison, LETTERS};
use crate::experiment::plot::Measure;
use crate::tui::action::{Action, Mode};
use crate::tui::layout::{Click, ClickableLine, ScreenLayout};
use crate::tui::pane_text::in_pairs;
use crate::tui::render::curves::{Axes, ChartLine, PaneCurve, draw_chart, draw_heading};
use crate::tui::render::dialog::draw_dialog;
use crate::tui::render::side::training;
use crate::tui::render::{bars, curves, finish_frame, too_small};
use crate::tui::scene::{Drawing, SceneKind, legend};
use crate::tui::session::{Cx, Session};
use crate::tui::theme::{BOLD, ColourDepth, DIM, REVERSED};
use gdg::engine::Phase;
use gdg::text::{fitted, grouped};
use gdg::train::Evaluation;

/// The smallest screen with room for everything, in columns and rows.
pub const MIN_SIZE: (u16, u16) = (60, 18);

/// Rows of the curves: a share of the screen's, within limits.
const CURVES_DIVISOR: u16 = 4;
const CURVES_ROWS: (u16, u16) = (7, 16);

pub fn draw(frame: &mut Frame, comparison: &mut Comparison) -> ScreenLayout {
    let area = frame.area();
    let mut layout = ScreenLayout::new(area);
    if area.width < MIN_SIZE.0 || area.height < MIN_SIZE.1 {
        too_small(frame, "a comparison", MIN_SIZE);
        return layout;
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
    // Both show their maps in the same size.
    let (half, gap) = (Constraint::Fill(1), 1 + u16::from(body.width.is_multiple_of(2)));
    let [left, line, right] = Layout::horizontal([half, Constraint::Length(gap), half]).areas(body);
    frame.render_widget(Block::new().borders(Borders::LEFT), line);
    let areas = [left, right];
    let facts = [0, 1].map(|own| facts(comparison, own, areas[own].width));
    let most = facts.iter().map(Vec::len).max().unwrap_or(0);
    let mut drawn = [ScreenLayout::new(area), ScreenLayout::new(area)];
    for (own, facts) in facts.into_iter().enumerate() {
        let [title, map, meaning, below] = Layout::vertical([
            Constraint::Length(1),
            Constraint::Min(0),
            Constraint::Length(1),
            Constraint::Length(most as u16),
        ])
        .areas(areas[own]);
        draw_title(frame, title, comparison, own);
        drawn[own].map_pane = map;
        let Session { cx: Cx { screen, scene, .. }, cache, .. } = &mut comparison.sessions[own];
        if let Some(maze) = scene.maze() {
            let layout = &mut drawn[own];
            maze.draw([map, meaning], Drawing { frame, screen, layout, cache });
        }
        frame.render_widget(Paragraph::new(facts), below);
        if let Some(last) = below.rows().next_back().filter(|_| screen.past.is_none()) {
            let walks = bars::walks(screen, scene);
            bars::draw_first_that_fits(frame, last, walks);
        }
    }
    draw_curves(frame, below, comparison, &mut layout);
    draw_footer(frame, foot, comparison, &mut layout);
    let Cx { screen, .. } = &comparison.sessions[0].cx;
    if let Some(notice) = comparison.notice().filter(|_| screen.dialogs.is_empty()) {
        let foot = Rect { y: drawn[0].map_pane.bottom(), ..foot };
        bars::draw_notice(frame, foot, &screen.theme, notice);
    }
    draw_dialog(frame, screen, comparison.notice(), &mut drawn[0]);
    finish_frame(frame, &screen.theme);
    // The same lines on both sides, from the next frame on.
    let interval = drawn.iter().filter_map(|side| side.own_contour_interval).fold(0.0, f32::max);
    for (session, drawn) in comparison.sessions.iter_mut().zip(drawn) {
        session.screen.least_contour_interval = interval;
        session.drawn(drawn);
    }
    layout
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
    let is_saved = comparison.sessions.iter().all(|session| {
        let snapshot = &session.screen.snapshot;
        snapshot.saved.is_some() && snapshot.unsaved_updates() == 0
    });
    let text = if is_saved { " saved" } else { " unsaved" };
    let room = usize::from(area.width).saturating_sub(bar.width());
    bar.push(Span::styled(fitted(text, room), DIM), None);
    bar.draw(frame, area, layout);
}

/// Returns the side that shows whether training runs: one that trains, if any does.
fn training_side(comparison: &Comparison) -> &Session {
    let [a, b] = &comparison.sessions;
    if b.is_training() && !a.is_training() { b } else { a }
}

/// Draws the title of a side: what it is, and whether it has stopped or shows its past.
fn draw_title(frame: &mut Frame, area: Rect, comparison: &Comparison, own: usize) {
    let (title, screen) = (&comparison.titles[own], &comparison.sessions[own].screen);
    let state = match (&screen.snapshot.phase, &screen.past) {
        (Phase::Failed(error), _) => format!("stopped: {error} "),
        (_, Some(past)) => {
            let is_edited = screen.snapshot.is_edited_since(past.updates);
            let walls = if is_edited { ", walls of today" } else { "" };
            format!("at update {}{walls} ", grouped(screen.snapshot.learned(past.updates)))
        }
        (Phase::Paused, _) => "paused ".to_owned(),
        _ => String::new(),
    };
    let title = fitted(format!(" {title} {state}").trim_end(), usize::from(area.width));
    let title =
        Span::styled(format!("{title} "), curves::colour(&screen.theme, [own; 2]).patch(BOLD));
    frame.render_widget(Block::new().borders(Borders::TOP).title(title), area);
}

/// Draws the keys of what is on top of either side, or else those of actions that either has.
fn draw_footer(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let [first, a, b] =
        [training_side(comparison), &comparison.sessions[0], &comparison.sessions[1]]
            .map(|session| (&session.screen, &session.scene));
    [a, b]
        .into_iter()
        .find_map(|(screen, scene)| bars::on_top(screen, scene, area.width))
        .unwrap_or_else(|| bars::keys(&[first, a, b], Mode::Comparing, area.width, false))
        .draw(frame, area, layout);
}

/// Returns what the panes of a single run say: how far it is, what it has learned and how @ walks; and
/// its races.
fn facts(comparison: &Comparison, own: usize, width: u16) -> Vec<Line<'static>> {
    let Session { cx: Cx { screen, scene, .. }, .. } = &comparison.sessions[own];
    let (arrived, races) = (comparison.race.results.0[own], comparison.race.results.1);
    let raced = if races > 0 { format!("{arrived} of {races}") } else { "none yet".to_owned() };
    let [updates, steps] = training::counters(screen);
    let [planned, alone, error] = training::scores(screen);
    let [walk, shortest] = legend::walk(&**scene);
    let arrivals = ("arrivals", raced, String::new());
    in_pairs(&[updates, steps, planned, alone, error, arrivals, walk, shortest], width)
}

/// Returns the curves of a side: its success and, if the method plans, that of the actor alone. Colours say
/// of which side, as in lists of runs, and characters which it is.
fn curves_of(comparison: &Comparison, own: usize) -> Vec<PaneCurve> {
    let screen = &comparison.sessions[own].screen;
    let (method, theme) = (&screen.run().method, &screen.theme);
    let curve = |of: Measure, name: String| {
        let sign = of.colour(method.plans());
        let point =
            |(updates, e): &(u64, Evaluation)| Some((comparison.along(own, *updates), of.of(e)?));
        // Without colours, characters say of which side, too.
        let both = if theme.depth == ColourDepth::Mono { LETTERS.len() * own } else { 0 };
        let points = screen.snapshot.evaluations.iter().filter_map(point).collect();
        PaneCurve {
            name,
            style: curves::colour(theme, [own; 2]),
            marker: curves::sign(sign + both),
            points,
        }
    };
    let kind = if method.plans() { "planned" } else { "alone" };
    let title = comparison.titles[own].split(" (").next().unwrap_or_default();
    let success = curve(Measure::Success, format!("{title} {kind}"));
    let alone = || curve(Measure::Alone, format!("{} alone", LETTERS[own]));
    std::iter::once(success).chain(method.plans().then(alone)).collect()
}

/// Draws both success curves in one chart, over how far training had come; a click on its title
/// changes the axis. Upright lines mark the moments of the past that are shown.
fn draw_curves(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let all: Vec<PaneCurve> = (0..2).flat_map(|own| curves_of(comparison, own)).collect();
    let now =
        |own| comparison.along(own, comparison.sessions[own].screen.snapshot.counters.updates);
    let last = [0, 1].map(now).into_iter().fold(1.0, f64::max);
    let title = curves::title(Measure::Success, comparison.axis);
    let [head, body] = draw_heading(frame, area, title, all.iter().map(PaneCurve::label));
    layout.add(head, Click::Act(Action::Axis));
    if all.iter().all(|curve| curve.points.is_empty()) {
        frame.render_widget(Paragraph::new(" not evaluated yet").style(DIM), body);
        return;
    }
    // The first ones last, on top.
    let lines = all.iter().rev().map(PaneCurve::line);
    let past = [0, 1].map(|own| {
        let frame = comparison.sessions[own].screen.past.as_ref()?;
        Some(comparison.along(own, frame.updates))
    });
    let moments: Vec<_> = past.into_iter().flatten().map(|at| [(at, 0.0), (at, 1.0)]).collect();
    let upright = |points| ChartLine { style: BOLD, marker: Marker::Braille, points };
    let uprights = moments.iter().map(|points| upright(&points[..]));
    let y_labels = ["0.0".to_owned(), "1.0".to_owned()];
    let axes = Axes { x: [0.0, last], over: comparison.axis, y: [0.0, 1.0], y_labels };
    draw_chart(frame, body, axes, lines.chain(uprights));
}
