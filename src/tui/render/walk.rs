//! The followed agent: the walking one, or an exploring one.

use ratatui::text::Line;

use super::text::{fact, heading};
use crate::tui::action::Action;
use crate::tui::screen::Screen;

/// Returns the pane's lines.
pub fn lines(screen: &Screen) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(screen),
        None => walker(screen),
    }
}

fn place(at: &[f32]) -> String {
    format!("{:.1}, {:.1}", at[0], at[1])
}

fn steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1}") }
}

fn walker(screen: &Screen) -> Vec<Line<'static>> {
    let walk = &screen.view.walk;
    let shortest = walk.shortest.map_or("no path".to_owned(), |s| s.to_string());
    let state = if walk.arrived { "arrived" } else { "walking" };
    let mut lines = vec![
        fact("from S", place(&walk.start)),
        fact("to G", place(&screen.goal.centre())),
        fact(state, format!("{} steps", walk.steps)),
        fact("shortest", shortest),
        fact("D to goal", steps(walk.distances.0)),
        fact("waypoint", walk.waypoint.map_or("the goal".to_owned(), |at| place(&at))),
        fact("D to it", steps(walk.distances.1)),
        fact("ahead", format!("{} waypoints", screen.view.path.len().saturating_sub(1))),
        heading("walks"),
        fact("arrived", format!("{} of {}", walk.journeys.0, walk.journeys.1)),
        fact("then", screen.tour.name()),
    ];
    lines.push(Line::default());
    let key = |action| screen.keymap.key_of(action);
    lines.push(Line::from(format!(" {} or click: new goal", key(Action::NewGoal))));
    lines.push(Line::from(format!(" {} or right-click: new start", key(Action::NewStart))));
    lines.push(Line::from(format!(" {}: follow an explorer", key(Action::Follow))));
    lines
}

fn explorer(screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return vec![fact("agent", "...")] };
    let aim = if followed.aim == followed.goal { "the goal".to_owned() } else { place(&followed.aim) };
    vec![
        fact("agent", format!("{} of {}", followed.agent, screen.snapshot.agents.len() / 2)),
        fact("from", place(&followed.start)),
        fact("at A", place(&followed.state)),
        fact("goal \u{2691}", place(&followed.goal)),
        fact("steps", format!("{} of {}", followed.steps, screen.run().settings.train.episode_steps)),
        fact("shortest", screen.view.followed_steps.map_or("no path".to_owned(), |s| s.to_string())),
        fact("D to goal", steps(followed.distances.1)),
        fact("target", aim),
        fact("D to it", steps(followed.distances.0)),
        fact("path", if followed.planned { "through bridges" } else { "actor alone" }),
        Line::default(),
        Line::from(format!(" {}: next agent", screen.keymap.key_of(Action::Follow))),
    ]
}
