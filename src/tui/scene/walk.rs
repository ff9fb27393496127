//! The parts that the panes about a followed agent share.

use ratatui::text::Line;

use crate::tui::action::Action;
use crate::tui::screen::Screen;
use crate::tui::text::{fact, heading};
use gdg::engine::FollowedAgent;
use gdg::text::counted;
use gdg::viewer::Reach;

/// The meanings of the numbers, by their names in the pane.
pub const MEANINGS: &[(&str, &str)] = &[
    ("from S", "where this walk began"),
    ("to G", "where it leads: the goal"),
    ("walking", "steps taken on this walk so far"),
    ("arrived", "steps it took; below: walks that arrived"),
    ("shortest", "true steps from the start to the goal"),
    ("D to goal", "steps left, as learned"),
    ("waypoint", "what the agent heads for next"),
    ("target", "what the agent heads for"),
    ("D to it", "steps to that, as learned"),
    ("ahead", "waypoints of the plan still to come"),
    ("then", "what happens when the agent arrives"),
    ("path", "whether it follows a plan"),
];

/// Returns the keys that change what the walking agent does.
pub fn keys(screen: &Screen) -> [Line<'static>; 4] {
    let key = |action| screen.keymap.key_of(action);
    [
        Line::default(),
        Line::from(format!(" {} or click: new goal", key(Action::NewGoal))),
        Line::from(format!(" {} or right-click: new start", key(Action::NewStart))),
        Line::from(format!(" {}: follow an explorer", key(Action::Follow))),
    ]
}

/// Returns what is shown of a followed agent that is not there.
pub fn no_agent(screen: &Screen) -> Vec<Line<'static>> {
    if screen.snapshot.data.is_none() {
        return vec![fact("agent", "...")];
    }
    vec![fact("agents", "do not act:"), Line::from(" the run learns from data")]
}

/// Returns what an exploring agent pursues, with places and distances in the scene's format.
pub fn pursuit(
    screen: &Screen,
    followed: &FollowedAgent,
    format_place: impl Fn(&[f32]) -> String,
    format_steps: impl Fn(f32) -> String,
) -> [Line<'static>; 6] {
    let aim = if followed.aim == followed.goal {
        "the goal".to_owned()
    } else {
        format_place(&followed.aim)
    };
    [
        fact("D to goal", format_steps(followed.distances.1)),
        fact("target", aim),
        fact("D to it", format_steps(followed.distances.0)),
        fact("path", if followed.planned { "through bridges" } else { "actor alone" }),
        Line::default(),
        Line::from(format!(
            " {}: next, {}: back to @",
            screen.keymap.key_of(Action::Follow),
            screen.keymap.key_of(Action::Close)
        )),
    ]
}

/// Formats D.
pub fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1} steps") }
}

/// Returns how an agent that reaches for the goal gets on, with places and straight lines in the
/// scene's format. It gives up after `most` steps, if that is known.
pub fn progress(
    screen: &Screen,
    reach: &Reach,
    most: Option<u32>,
    format_place: impl Fn(&[f32]) -> String,
    format_length: impl Fn(f32) -> String,
) -> Vec<Line<'static>> {
    let state = if reach.arrived { "arrived" } else { "reaching" };
    let most = most.filter(|_| !reach.arrived).map_or(String::new(), |most| format!(" of {most}"));
    let mut lines = vec![
        fact(state, format!("{} steps{most}", reach.steps)),
        fact("left", format_length(reach.left)),
        fact("D to goal", format_steps(reach.distances.0)),
    ];
    if screen.run().method.plans() {
        lines.extend([
            fact("waypoint", reach.waypoint.as_deref().map_or("the goal".to_owned(), format_place)),
            fact("D to it", format_steps(reach.distances.1)),
            fact("ahead", counted(reach.path.len().saturating_sub(1) as u64, "waypoint")),
        ]);
    }
    lines.extend([
        heading("reaches"),
        fact("arrived", format!("{} of {}", reach.finished.0, reach.finished.1)),
        fact("then", screen.on_arrival.name()),
    ]);
    lines.extend(keys(screen));
    lines
}
