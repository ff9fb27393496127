//! The followed agent: the one that reaches for the goal, or an exploring one.

use ratatui::text::Line;

use super::draw::short;
use super::{GoalsState, space};
use crate::tui::scene::walk;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading};
use gdg::env::GoalSpace;

/// The most components that are listed.
const MOST_COMPONENTS: usize = 8;

/// Returns the pane's lines.
pub fn lines(state: &GoalsState, screen: &Screen) -> Vec<Line<'static>> {
    match (space(screen), screen.following) {
        (None, _) => Vec::new(),
        (Some(space), Some(_)) => explorer(space, screen),
        (Some(space), None) => reacher(space, state, screen),
    }
}

/// Formats a place.
fn place(at: &[f32]) -> String {
    let shown: Vec<String> = at.iter().take(3).map(|value| short(*value)).collect();
    if at.is_empty() { "-".to_owned() } else { shown.join(", ") }
}

/// Returns a line for each component, with the agent's value and the goal's.
fn components(space: &GoalSpace, at: &[f32], goal: &[f32]) -> Vec<Line<'static>> {
    let both = at.iter().zip(goal).enumerate().take(MOST_COMPONENTS);
    let line = |(i, (at, goal)): (usize, (&f32, &f32))| {
        fact(&space.name(i), format!("{} \u{2192} {}", short(*at), short(*goal)))
    };
    let mut lines: Vec<_> = both.map(line).collect();
    if at.len() > MOST_COMPONENTS {
        lines.push(Line::from(format!(" and {} more", at.len() - MOST_COMPONENTS)));
    }
    lines
}

fn reacher(space: &GoalSpace, state: &GoalsState, screen: &Screen) -> Vec<Line<'static>> {
    let reach = &state.view.reach;
    let mut lines = vec![heading("agent @ \u{2192} goal G")];
    lines.extend(components(space, &reach.at, &state.goal));
    if let Some(failure) = &reach.failure {
        lines.extend(failure.lines().map(|line| Line::from(format!(" {line}"))));
    }
    lines.extend(walk::progress(screen, reach, space.episode_steps(), place, short));
    lines
}

fn explorer(space: &GoalSpace, screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return walk::no_agent(screen) };
    let (state, spec) = (&followed.state, space.spec());
    // The agent may be followed since an earlier run.
    let known = Some(state).filter(|state| state.len() == spec.state_dim());
    let at: Vec<f32> = known.map_or(Vec::new(), |state| spec.achieved(state).collect());
    let agents = screen.run().settings.train.agents;
    let mut lines = vec![
        heading("agent A \u{2192} goal \u{2691}"),
        fact("agent", format!("{} of {agents}", followed.agent)),
    ];
    lines.extend(components(space, &at, &followed.goal));
    lines.push(fact("steps", format!("{} of {}", followed.steps.0, followed.steps.1)));
    lines.extend(walk::pursuit(screen, followed, place, walk::format_steps));
    lines
}
