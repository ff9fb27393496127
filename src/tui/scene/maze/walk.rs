//! The followed agent: the walking one, or an exploring one.

use ratatui::text::Line;

use super::MazeState;
use crate::tui::scene::walk;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading};
use gdg::text::counted;

/// Returns the pane's lines.
pub fn lines(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(maze, screen),
        None => walker(maze, screen),
    }
}

fn format_position(at: &[f32]) -> String {
    format!("{:.1}, {:.1}", at[0], at[1])
}

fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1}") }
}

fn walker(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
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
        planned("ahead", ahead(maze.view.path.len())),
        heading("walks"),
        fact("arrived", format!("{} of {}", shown.finished_walks.0, shown.finished_walks.1)),
        fact("then", screen.on_arrival.name()),
    ];
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
