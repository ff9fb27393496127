//! The followed arm: the one that reaches for the goal, or an exploring one.

use ratatui::text::Line;

use super::{ArmState, centimetres};
use crate::tui::scene::walk;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading};
use gdg::env::Scene;

/// Returns the pane's lines.
pub fn lines(arm: &ArmState, screen: &Screen) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(screen),
        None => reacher(arm, screen),
    }
}

fn format_metres(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{:.1} cm", 100.0 * distance) }
}

fn reacher(arm: &ArmState, screen: &Screen) -> Vec<Line<'static>> {
    let reach = &arm.view.reach;
    let most = match &screen.snapshot.scene {
        Scene::Arm(scene) => Some(scene.episode_steps()),
        _ => None,
    };
    let mut lines = vec![
        heading("x, y, z in cm"),
        fact("from", centimetres(&reach.start)),
        fact("grip @", centimetres(&arm.view.pose.grip)),
        fact("to G", centimetres(&arm.goal)),
    ];
    lines.extend(walk::progress(screen, reach, most, centimetres, format_metres));
    lines
}

fn explorer(screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return walk::no_agent(screen) };
    let left = followed
        .state
        .iter()
        .zip(&followed.goal)
        .take(3)
        .map(|(s, g)| (s - g).powi(2))
        .sum::<f32>()
        .sqrt();
    let mut lines = vec![
        heading("x, y, z in cm"),
        fact("agent", format!("{} of {}", followed.agent, screen.run().settings.train.agents)),
        fact("from", centimetres(&followed.start)),
        fact("at A", centimetres(&followed.state)),
        fact("goal \u{2691}", centimetres(&followed.goal)),
        fact("steps", format!("{} of {}", followed.steps.0, followed.steps.1)),
        fact("left", format_metres(left)),
    ];
    lines.extend(walk::pursuit(screen, followed, centimetres, walk::format_steps));
    lines
}
