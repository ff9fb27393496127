//! Both success curves in one chart, over how far training had come.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::Span;
use ratatui::widgets::Paragraph;

use super::{Comparison, LETTERS};
use crate::experiment::plot::Axis;
use crate::tui::action::Action;
use crate::tui::layout::{ChartArea, Click, ScreenLayout};
use crate::tui::render::chart::{self, Curve};
use crate::tui::render::curves;
use crate::tui::session::Session;
use crate::tui::style::{BOLD, DIM};
use crate::tui::theme::{ColourDepth, blend};
use gdg::engine::Snapshot;
use gdg::train::{Evaluation, History};

/// How far the colour of the actor alone is from its method's to the page's.
const FAINT: f32 = 0.5;

/// Returns the curves of a side: its success, and that of the actor alone if the method plans.
fn curves_of(comparison: &Comparison, own: usize) -> Vec<Curve> {
    let screen = &comparison.sessions[own].screen;
    let (run, mono) = (screen.run(), screen.theme.depth == ColourDepth::Mono);
    let points = |value: &dyn Fn(&Evaluation) -> Option<f64>| {
        let evaluations = screen.snapshot.evaluations.iter();
        let point =
            |(updates, e): &(u64, Evaluation)| Some((comparison.along(own, *updates), value(e)?));
        evaluations.filter_map(point).collect()
    };
    // Without colours, other characters tell the sides apart: the second one is dotted.
    let marker = if mono && own == 1 { Marker::Custom('\u{2022}') } else { Marker::Braille };
    let style = if mono { Style::new() } else { curves::colour(&screen.theme, own) };
    // Not every terminal draws colours faintly by itself.
    let page = screen.theme.page.map_or((0, 0, 0), |(_, page)| page);
    let fainter = match style.fg {
        Some(Color::Rgb(r, g, b)) => style.fg(screen.theme.colour(blend((r, g, b), page, FAINT))),
        _ => style,
    };
    let name = format!("{} {}", LETTERS[own], run.method.name());
    let faint = fainter.add_modifier(Modifier::DIM);
    let actor = Curve {
        name: "greedy".to_owned(),
        style: faint,
        marker,
        points: points(&|e| e.greedy.success),
    };
    if run.method.plans() {
        let planned = points(&|e| e.planned.as_ref()?.success);
        vec![Curve { name, style: style.patch(BOLD), marker, points: planned }, actor]
    } else {
        vec![Curve { name, style: style.patch(BOLD), ..actor }]
    }
}

/// Returns where the map was edited, which is the same map for both.
fn edits(comparison: &Comparison, window: [f64; 2]) -> Vec<f64> {
    let of = |own: usize| {
        let edits = comparison.sessions[own].screen.snapshot.edits.iter();
        edits.map(move |at| comparison.along(own, *at))
    };
    let mut edits: Vec<f64> = (0..2).flat_map(of).collect();
    edits.sort_by(f64::total_cmp);
    curves::apart(edits.into_iter(), window)
}

/// Draws the chart; a click on its title changes the axis, one on the lines looks back. Upright
/// lines mark the moments of the past that are shown.
pub fn draw(frame: &mut Frame, area: Rect, comparison: &Comparison, layout: &mut ScreenLayout) {
    let all: Vec<Curve> = (0..2).flat_map(|own| curves_of(comparison, own)).collect();
    let now = |session: &Session| Moment::from(&*session.screen.snapshot).along(comparison.axis);
    let last = comparison.sessions.iter().map(now).fold(1.0, f64::max);
    let edits = edits(comparison, [0.0, last]);
    let edited = Span::styled(format!("  {} {}", curves::MARK, curves::EDITED), DIM);
    let names = all.iter().map(|curve| {
        Span::styled(format!("  {} {}", curves::symbol(curve.marker), curve.name), curve.style)
    });
    let names = names.chain(Some(edited).filter(|_| !edits.is_empty()));
    let title = Span::styled(format!(" success over {}", comparison.axis.label()), BOLD);
    let lines = chart::heading(&title, names, area.width);
    let [head, body] =
        Layout::vertical([Constraint::Length(lines.len() as u16), Constraint::Min(0)]).areas(area);
    layout.add(head, Click::Act(Action::Axis));
    frame.render_widget(Paragraph::new(lines), head);
    if all.iter().all(|curve| curve.points.is_empty()) {
        frame.render_widget(Paragraph::new(" not evaluated yet").style(DIM), body);
        return;
    }
    // The faint curves first, so that they do not hide the others.
    let (faint, strong): (Vec<&Curve>, Vec<&Curve>) =
        all.iter().partition(|curve| curve.style.add_modifier.contains(Modifier::DIM));
    let lines = faint.into_iter().chain(strong).map(Curve::line);
    let past = [0, 1].map(|side| comparison.past_at(side));
    let moments: Vec<_> = past.into_iter().flatten().map(|at| [(at, 0.0), (at, 1.0)]).collect();
    let edits: Vec<_> = edits.into_iter().map(|at| [(at, 0.0), (at, 1.0)]).collect();
    let upright = |style, points| chart::Line { style, marker: Marker::Braille, points };
    let lines = edits.iter().map(|points| upright(DIM, &points[..])).chain(lines);
    let uprights = moments.iter().map(|points| upright(BOLD, &points[..]));
    let y_labels = ["0.0".to_owned(), "1.0".to_owned()];
    let axes = chart::Axes { x: [0.0, last], over: comparison.axis, y: [0.0, 1.0], y_labels };
    let area = chart::draw(frame, body, axes, lines.chain(uprights));
    layout.charts.push(ChartArea { area, bounds: [0.0, last] });
}

/// Maximum number of moments kept; beyond it, every other one is dropped.
const MAX_MOMENTS: usize = 4096;

/// Progress at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moment {
    pub updates: f64,
    pub env_steps: f64,
    /// Training time, in seconds.
    pub seconds: f64,
}

impl Moment {
    pub fn along(self, axis: Axis) -> f64 {
        match axis {
            Axis::Updates => self.updates,
            Axis::Steps => self.env_steps,
            Axis::Seconds => self.seconds,
        }
    }
}

impl From<&Snapshot> for Moment {
    fn from(snapshot: &Snapshot) -> Self {
        let counters = snapshot.counters;
        Self {
            updates: counters.updates as f64,
            env_steps: counters.env_steps as f64,
            seconds: snapshot.seconds,
        }
    }
}

/// The moments of a run, from its start.
#[derive(Default)]
pub struct Pace(Vec<Moment>);

impl Pace {
    pub fn of(history: &History) -> Self {
        let mut pace = Self::default();
        for made in history.evaluations().iter().filter_map(|(at, _)| history.moment(*at)) {
            pace.add_moment(Moment {
                updates: made.updates as f64,
                env_steps: made.env_steps as f64,
                seconds: made.seconds,
            });
        }
        pace
    }

    pub fn add(&mut self, snapshot: &Snapshot) {
        self.add_moment(snapshot.into());
    }

    fn add_moment(&mut self, moment: Moment) {
        if self.0.last().is_some_and(|last| last.updates >= moment.updates) {
            return;
        }
        self.0.push(moment);
        if self.0.len() > MAX_MOMENTS {
            let mut i = 0;
            self.0.retain(|_| {
                i += 1;
                i % 2 == 0
            });
        }
    }

    /// Returns the moment of an update, between the known ones.
    pub fn at(&self, updates: f64) -> Moment {
        let next = self.0.partition_point(|moment| moment.updates < updates);
        let before = next.checked_sub(1).map_or(Moment::default(), |i| self.0[i]);
        let Some(after) = self.0.get(next) else { return Moment { updates, ..before } };
        let share = (updates - before.updates) / (after.updates - before.updates).max(1.0);
        let between = |from: f64, to: f64| from + share * (to - from);
        Moment {
            updates,
            env_steps: between(before.env_steps, after.env_steps),
            seconds: between(before.seconds, after.seconds),
        }
    }
}
