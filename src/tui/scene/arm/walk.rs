//! The followed arm: the one that reaches for the goal, or an exploring one.

use ratatui::text::Line;

use super::{ArmState, centimetres};
use crate::tui::scene::walk;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading};
use gdg::env::Scene;
use gdg::text::counted;

/// Returns the pane's lines.
pub fn lines(arm: &ArmState, screen: &Screen) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(screen),
        None => reacher(arm, screen),
    }
}

fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1} steps") }
}

fn format_metres(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{:.1} cm", 100.0 * distance) }
}

fn reacher(arm: &ArmState, screen: &Screen) -> Vec<Line<'static>> {
    let (view, reach) = (&arm.view, &arm.view.reach);
    let state = if reach.arrived { "arrived" } else { "reaching" };
    let most = match &screen.snapshot.scene {
        Scene::Arm(scene) if !reach.arrived => format!(" of {}", scene.episode_steps()),
        _ => String::new(),
    };
    let mut lines = vec![
        heading("x, y, z in cm"),
        fact("from", centimetres(&reach.start)),
        fact("grip @", centimetres(&view.pose.grip)),
        fact("to G", centimetres(&arm.goal)),
        fact(state, format!("{} steps{most}", reach.steps)),
        fact("left", format_metres(reach.left)),
        fact("D to goal", format_steps(reach.distances.0)),
    ];
    if screen.run().method.plans() {
        lines.extend([
            fact("waypoint", reach.waypoint.as_deref().map_or("the goal".to_owned(), centimetres)),
            fact("D to it", format_steps(reach.distances.1)),
            fact("ahead", counted(reach.path.len().saturating_sub(1) as u64, "waypoint")),
        ]);
    }
    lines.extend([
        heading("reaches"),
        fact("arrived", format!("{} of {}", reach.finished.0, reach.finished.1)),
        fact("then", screen.on_arrival.name()),
    ]);
    lines.extend(walk::keys(screen));
    lines
}

fn explorer(screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return vec![fact("agent", "...")] };
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
    lines.extend(walk::pursuit(screen, followed, centimetres, format_steps));
    lines
}
