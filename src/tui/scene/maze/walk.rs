//! The followed agent: the walking one, or an exploring one.

use ratatui::text::Line;

use super::MazeState;
use crate::tui::scene::walk;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading, wrapped};
use gdg::text::counted;

/// Columns that sentences have at least.
const MIN_TEXT_WIDTH: usize = 20;

/// Returns the pane's lines, with sentences within `width` columns.
pub fn lines(maze: &MazeState, screen: &Screen, width: usize) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(maze, screen),
        None => walker(maze, screen, width),
    }
}

fn format_position(at: &[f32]) -> String {
    format!("{:.1}, {:.1}", at[0], at[1])
}

fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1}") }
}

fn walker(maze: &MazeState, screen: &Screen, width: usize) -> Vec<Line<'static>> {
    let shown = &maze.view.walk;
    let has_path = shown.shortest.is_some();
    let shortest = shown.shortest.map_or("no path".to_owned(), |s| s.to_string());
    let state = if shown.arrived { "arrived" } else { "walking" };
    // There is no plan without a path, and none is left after arrival.
    let is_planned = has_path && !shown.arrived;
    let planned = |name, value: String| fact(name, if is_planned { value } else { "-".to_owned() });
    let mut lines = vec![
        fact("from S", format_position(&shown.start)),
        fact("to G", format_position(&maze.goal.centre())),
        fact(state, counted(u64::from(shown.steps), "step")),
        fact("shortest", shortest),
        fact(
            "D to goal",
            format_steps(shown.distances.0) + if has_path { "" } else { " (meaningless)" },
        ),
        planned(
            "waypoint",
            shown.waypoint.map_or("the goal".to_owned(), |at| format_position(&at)),
        ),
        planned("D to it", format_steps(shown.distances.1)),
    ];
    let plan = bridges(maze, width);
    if plan.is_empty() {
        lines.push(planned("ahead", ahead(maze.view.path.len())));
    }
    lines.extend(plan);
    lines.extend([
        heading("walks"),
        fact("arrived", format!("{} of {}", shown.finished_walks.0, shown.finished_walks.1)),
        fact("then", screen.on_arrival.name()),
    ]);
    lines.extend(walk::keys(screen));
    lines
}

/// Describes a plan of that many stops, the goal included.
fn ahead(stops: usize) -> String {
    match stops {
        0 => "actor alone".to_owned(),
        1 => "straight to G".to_owned(),
        _ => counted(stops as u64 - 1, "waypoint"),
    }
}

/// Says what bridges do for the plan of the walking agent, if there are any ahead, within `width`
/// columns.
fn bridges(maze: &MazeState, width: usize) -> Vec<Line<'static>> {
    let (bridges, walk) = (maze.view.path.len().saturating_sub(1), &maze.view.walk);
    if bridges == 0 || walk.arrived || walk.along.is_nan() {
        return Vec::new();
    }
    let (direct, along) = (walk.distances.0.round(), walk.along.round());
    let effect = if along < direct {
        format!("{:.0} steps shorter", direct - along)
    } else {
        "no shorter, but each hop is short enough to trust".to_owned()
    };
    let text = format!(
        "{}; direct D says {direct:.0}, along bridges {along:.0}: {effect}",
        counted(bridges as u64, "waypoint")
    );
    // A blank on either side.
    let columns = width.saturating_sub(2).max(MIN_TEXT_WIDTH);
    wrapped(&text, columns).into_iter().map(|row| Line::raw(format!(" {row}"))).collect()
}

fn explorer(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return walk::no_agent(screen) };
    let mut lines = vec![
        fact("agent", format!("{} of {}", followed.agent, screen.snapshot.agents.len() / 2)),
        fact("from", format_position(&followed.start)),
        fact("at A", format_position(&followed.state)),
        fact("goal \u{2691}", format_position(&followed.goal)),
        fact("steps", format!("{} of {}", followed.steps.0, followed.steps.1)),
        fact("shortest", maze.view.followed_steps.map_or("no path".to_owned(), |s| s.to_string())),
    ];
    lines.extend(walk::pursuit(screen, followed, format_position, format_steps));
    lines
}
