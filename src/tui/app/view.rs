//! What is shown, and how: fields, overlays, panes, colours and the followed agent.

use crate::tui::action::Action;
use crate::tui::layers::{Overlay, Overlays};
use crate::tui::link::Link;
use crate::tui::marker::Marker;
use crate::tui::panes::Pane;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Theme, ThemeName};
use gdg::bridge::EdgeStatus;
use gdg::engine::Command;
use gdg::viewer::{Field, OnArrival, Request};

/// Performs an action on what is shown; returns whether it is one.
pub fn act(action: Action, scene: &mut Scene, screen: &mut Screen, link: &mut Link) -> bool {
    match action {
        Action::OnArrival => {
            set_on_arrival(screen.on_arrival.next(), screen, link);
            screen.say(&format!("at the goal @ will {}", screen.on_arrival.name()));
        }
        Action::Follow => follow_next(screen, link),
        Action::Field(forward) => {
            let next = screen.field.cycle(forward, |field| scene.has_field(field, screen));
            show_field(next, screen, link);
        }
        Action::Toggle(overlay) => toggle_overlay(overlay, scene, screen, link),
        Action::Marker => change_marker(screen),
        Action::Show(pane) => show(pane, screen),
        Action::NextPane => show_next(screen),
        Action::Maximise => screen.maximised = !screen.maximised,
        Action::Scroll(by) => screen.scrolled = screen.scrolled.saturating_add_signed(-by),
        Action::LogScale => change_curve_scale(screen),
        _ => return false,
    }
    true
}

/// Changes what the walking agent does at the goal.
pub fn set_on_arrival(on_arrival: OnArrival, screen: &mut Screen, link: &Link) {
    screen.on_arrival = on_arrival;
    link.request(Request::OnArrival(on_arrival));
}

/// Colours the scene by a field.
pub fn show_field(field: Field, screen: &mut Screen, link: &Link) {
    screen.field = field;
    link.request(Request::Field(field));
}

/// Shows or hides an overlay.
fn toggle_overlay(overlay: Overlay, scene: &mut Scene, screen: &mut Screen, link: &mut Link) {
    if overlay.needs_bridges() && !screen.run().method.plans() {
        let key = screen.keymap.key_of(Action::Method);
        let method = screen.run().method.name();
        return screen.say(&format!("{method} has no bridges: {key} chooses another method"));
    }
    let shown = screen.overlays.toggle(overlay);
    scene.act(Action::Toggle(overlay), screen, link);
    let tried = |status| scene.edge_count(status) > 0;
    let none = overlay == Overlay::Edges
        && shown
        && ![EdgeStatus::Confirmed, EdgeStatus::Demoted].into_iter().any(tried);
    let more = if none { ", but agents have not tried any yet" } else { "" };
    screen.say(&format!("{} {}{more}", overlay.name(), if shown { "shown" } else { "hidden" }));
}

/// Draws the map with the next marker.
fn change_marker(screen: &mut Screen) {
    let all = Marker::ALL;
    let at = all.iter().position(|m| *m == screen.marker).unwrap_or(0);
    screen.marker = all[(at + 1) % all.len()];
    let none = screen.marker == Marker::Pixels && screen.picture_character().is_none();
    let more = match screen.theme.depth {
        ColourDepth::Mono => {
            ", once there are colours: without them, the map is drawn in characters"
        }
        _ if none => " (not supported here: as auto)",
        _ => "",
    };
    screen.say(&format!("marker: {}{more}", screen.marker.name()));
}

/// Switches the curves between linear and logarithmic scales.
fn change_curve_scale(screen: &mut Screen) {
    screen.log_scale = !screen.log_scale;
    let scale = if screen.log_scale { "logarithmic scales" } else { "linear scales" };
    screen.say(&format!("curves of losses and distances on {scale}"));
}

/// Changes the theme.
pub fn set_theme(name: ThemeName, screen: &mut Screen) {
    let theme = Theme::new(name, ColourDepth::detect());
    // Overlays that the user has chosen are left alone.
    if screen.overlays == Overlays::by_default(screen.theme.depth) {
        screen.overlays = Overlays::by_default(theme.depth);
    }
    screen.theme = theme;
}

fn follow_next(screen: &mut Screen, link: &Link) {
    let agents = screen.run().settings.train.agents;
    let next = match screen.following {
        None => Some(0),
        Some(agent) if agent + 1 < agents => Some(agent + 1),
        Some(_) => None,
    };
    follow(next, screen, link);
}

/// Follows an exploring agent, or the walking one again.
pub fn follow(agent: Option<usize>, screen: &mut Screen, link: &Link) {
    screen.following = agent;
    link.command(Command::Follow(agent), screen);
    let who =
        agent.map_or("the walking agent @".to_owned(), |agent| format!("exploring agent {agent}"));
    screen.notify(&format!("following {who}"));
    screen.pane = Pane::Walk;
}

/// Shows a pane: instead of the map if there is no room beside it.
fn show(pane: Pane, screen: &mut Screen) {
    (screen.pane, screen.scrolled) = (pane, 0);
    screen.maximised |= screen.layout.lacks_panel;
}

/// Shows the next pane. If there is no room beside the map, the map comes after the last one.
fn show_next(screen: &mut Screen) {
    let last = screen.pane == Pane::ALL[Pane::ALL.len() - 1];
    match (screen.layout.lacks_panel, screen.maximised) {
        (true, true) if last => screen.maximised = false,
        (true, false) => show(Pane::ALL[0], screen),
        _ => show(screen.pane.next(), screen),
    }
}
