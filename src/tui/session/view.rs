//! Changes the view: fields, overlays, panes and colours.

use super::Cx;
use crate::tui::action::Action;
use crate::tui::marker::Marker;
use crate::tui::overlay::Overlays;
use crate::tui::panes::Pane;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Theme, ThemeName};
use gdg::viewer::{Field, OnArrival, Request};

pub fn set_on_arrival(cx: &mut Cx, on_arrival: OnArrival) {
    cx.screen.on_arrival = on_arrival;
    cx.link.request(Request::OnArrival(on_arrival));
}

pub fn next_on_arrival(cx: &mut Cx) {
    set_on_arrival(cx, cx.screen.on_arrival.next());
    cx.screen.say(&format!("at the goal @ will {}", cx.screen.on_arrival.name()));
}

pub fn show_field(cx: &mut Cx, field: Field) {
    cx.screen.field = field;
    cx.link.request(Request::Field(field));
}

pub fn next_field(cx: &mut Cx, forward: bool) {
    let next = cx.screen.field.cycle(forward, |field| cx.scene.has_field(field, &cx.screen));
    show_field(cx, next);
}

pub fn toggle_overlay(cx: &mut Cx, action: Action) {
    let Action::Toggle(overlay) = action else { return };
    let screen = &mut cx.screen;
    if let Some(why) = screen.why_not(overlay) {
        return screen.say(&why);
    }
    let shown = screen.overlays.toggle(overlay);
    cx.scene.act(action, screen, &mut cx.link);
    screen.say(&format!("{} {}", overlay.name(), if shown { "shown" } else { "hidden" }));
}

pub fn change_marker(cx: &mut Cx) {
    let screen = &mut cx.screen;
    let all = Marker::ALL;
    let at = all.iter().position(|m| *m == screen.marker).unwrap_or(0);
    screen.marker = all[(at + 1) % all.len()];
    let none = screen.marker == Marker::Pixels && screen.picture_character().is_none();
    let more = if none { " (not supported here: as auto)" } else { "" };
    screen.say(&format!("marker: {}{more}", screen.marker.name()));
}

pub fn set_theme(screen: &mut Screen, name: ThemeName) {
    let theme = Theme::new(name, ColourDepth::detect());
    // Overlays that the user has chosen are left alone.
    if screen.overlays == Overlays::by_default(screen.theme.depth) {
        screen.overlays = Overlays::by_default(theme.depth);
    }
    screen.theme = theme;
}

/// Shows a pane: instead of the map if there is no room beside it.
pub fn show(cx: &mut Cx, action: Action) {
    if let Action::Show(pane) = action {
        (cx.screen.pane, cx.screen.scrolled) = (pane, 0);
        cx.screen.maximised |= cx.screen.layout.lacks_panel;
    }
}

/// Shows the next pane. If there is no room beside the map, the map comes after the last one.
pub fn show_next(cx: &mut Cx) {
    let last = cx.screen.pane == Pane::ALL[Pane::ALL.len() - 1];
    match (cx.screen.layout.lacks_panel, cx.screen.maximised) {
        (true, true) if last => cx.screen.maximised = false,
        (true, false) => show(cx, Action::Show(Pane::ALL[0])),
        _ => show(cx, Action::Show(cx.screen.pane.next())),
    }
}

/// Leaves what is on top: the past, or something enlarged.
pub fn close_top(cx: &mut Cx) {
    if cx.return_to_present()
        || cx.scene.close(&cx.link)
        || std::mem::take(&mut cx.screen.maximised)
    {
        return;
    }
    if cx.screen.banner.is_none() || !std::mem::take(&mut cx.screen.explains) {
        cx.act_in_scene(Action::ZoomOff);
    }
}
