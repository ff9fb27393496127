//! The panel beside the map: how training goes.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Borders, Paragraph, Sparkline};

use crate::train::{DistanceScore, Score};
use crate::tui::app::App;

/// Draws the panes that have room, the most important first.
pub fn draw(frame: &mut Frame, area: Rect, app: &App) {
    let panes: [(&str, Vec<Line>); 4] = [
        ("training", training(app)),
        ("success", success(app)),
        ("walk @ \u{2192} G", walk(app)),
        ("bridges", bridges(app)),
    ];
    let mut heights = Vec::new();
    let mut left = area.height;
    for (_, lines) in &panes {
        let height = lines.len() as u16 + 1;
        if height > left {
            break;
        }
        left -= height;
        heights.push(Constraint::Length(height));
    }
    let count = heights.len();
    heights.push(Constraint::Min(0));
    let areas = Layout::vertical(heights).split(area);
    for ((title, lines), area) in panes.into_iter().zip(areas.iter()).take(count) {
        frame.render_widget(Paragraph::new(lines).block(pane(title)), *area);
    }
    if left >= 4 {
        curve(frame, areas[count], app);
    }
}

fn pane(title: &str) -> Block<'_> {
    Block::new().borders(Borders::TOP | Borders::LEFT).title(format!(" {title} "))
}

fn fact(name: &str, value: impl std::fmt::Display) -> Line<'static> {
    Line::from(vec![
        Span::styled(format!(" {name:<10}"), Style::new().add_modifier(Modifier::DIM)),
        Span::raw(value.to_string()),
    ])
}

fn training(app: &App) -> Vec<Line<'static>> {
    let snapshot = &app.snapshot;
    let (updates, steps) = snapshot.rates;
    vec![
        fact("elapsed", clock(snapshot.seconds)),
        fact("updates", format!("{} {}/s", short(snapshot.counters.updates as f64), short(updates))),
        fact("steps", format!("{} {}/s", short(snapshot.counters.env_steps as f64), short(steps))),
        fact("episodes", short(snapshot.counters.episodes as f64)),
        fact("D loss", format!("{:.4}", snapshot.losses.critic)),
        fact("f loss", format!("{:.4}", snapshot.losses.model)),
        fact("mu loss", format!("{:.1} steps", snapshot.losses.actor)),
    ]
}

fn success(app: &App) -> Vec<Line<'static>> {
    let Some((updates, evaluation)) = app.snapshot.evaluations.last() else {
        return vec![fact("evaluated", "not yet")];
    };
    let mut lines = Vec::new();
    let score = |name: &str, score: &Score| fact(name, format!("{:.2}  {}", score.success, bars(&score.by_distance)));
    lines.extend(evaluation.planned.as_ref().map(|planned| score("planned", planned)));
    lines.push(score("greedy", &evaluation.greedy));
    lines.push(fact("D error", format!("{:.0} %", 100.0 * evaluation.distance_error.mape)));
    lines.push(fact("at update", short(*updates as f64)));
    lines
}

/// One bar for each distance, near to far.
fn bars(by_distance: &[DistanceScore]) -> String {
    const BARS: [char; 9] =
        [' ', '\u{2581}', '\u{2582}', '\u{2583}', '\u{2584}', '\u{2585}', '\u{2586}', '\u{2587}', '\u{2588}'];
    by_distance.iter().map(|d| BARS[(d.success * 8.0).round() as usize]).collect()
}

fn walk(app: &App) -> Vec<Line<'static>> {
    let walk = &app.view.walk;
    let shortest = walk.shortest.map_or("no way".to_owned(), |s| s.to_string());
    let state = if walk.arrived { "arrived" } else { "walking" };
    let distance = if walk.distance.is_nan() { "-".to_owned() } else { format!("{:.1}", walk.distance) };
    vec![
        fact(state, format!("{} steps", walk.steps)),
        fact("shortest", shortest),
        fact("D to goal", distance),
        fact("arrived", format!("{} of {}", walk.journeys.0, walk.journeys.1)),
    ]
}

fn bridges(app: &App) -> Vec<Line<'static>> {
    if !app.run().method.plans() {
        return vec![fact("none", "method gdg walks alone")];
    }
    let search = app.snapshot.search.map_or("none yet".to_owned(), |s| match s.found {
        Some((_, gain)) => format!("{} tried, gain {gain:.0}", s.tried),
        None => format!("{} tried, none", s.tried),
    });
    let (edges, confirmed, demoted) = app.view.edges;
    vec![
        fact("points", format!("{}, {} edges", app.view.candidates.len(), short(edges as f64))),
        fact("walked", format!("{} good, {demoted} bad", short(confirmed as f64))),
        fact("search", search),
    ]
}

/// The critic's loss from the beginning on, on a logarithmic scale.
fn curve(frame: &mut Frame, area: Rect, app: &App) {
    let block = pane("D loss, log scale");
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = usize::from(inner.width).max(1);
    let count = app.losses.len();
    let shown = (0..width.min(count)).map(|i| app.losses[i * count / width.min(count)].max(1e-6).ln());
    let shown: Vec<f32> = shown.collect();
    let (low, high) = shown.iter().fold((f32::MAX, f32::MIN), |(low, high), l| (low.min(*l), high.max(*l)));
    // A sparkline counts in whole numbers; the lowest value still shows.
    let data: Vec<u64> = shown.iter().map(|l| 10 + (90.0 * (l - low) / (high - low).max(1e-3)) as u64).collect();
    let height = inner.height.min(5);
    frame.render_widget(Sparkline::default().data(data), Rect { height, ..inner });
}

/// A number in at most five characters: 950, 12.3k, 4.56M.
fn short(value: f64) -> String {
    match value {
        v if v < 1e4 => format!("{v:.0}"),
        v if v < 1e6 => format!("{:.1}k", v / 1e3),
        v => format!("{:.2}M", v / 1e6),
    }
}

fn clock(seconds: f64) -> String {
    let whole = seconds as u64;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
}
