//! What keys do while a run is watched: training, looking back at the film of how distance was learned,
//! and the view: fields, overlays, panes and colours.

use std::sync::Arc;

use super::{Cx, Session};
use crate::tui::action::Action;
use crate::tui::choices::{Marker, Overlay, Overlays, Pane};
use crate::tui::render::curves::along;
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, Theme, ThemeName};
use gdg::engine::{EngineCommand, Step};
use gdg::train::FilmFrame;
use gdg::viewer::{Field, OnArrival, Request};

pub fn set_on_arrival(cx: &mut Cx, on_arrival: OnArrival) {
    cx.screen.on_arrival = on_arrival;
    cx.screen.request(Request::OnArrival(on_arrival));
}

pub fn next_on_arrival(cx: &mut Cx) {
    set_on_arrival(cx, cx.screen.on_arrival.next());
    cx.screen.say(&format!("at the goal @ will {}", cx.screen.on_arrival.name()));
}

pub fn show_field(cx: &mut Cx, field: Field) {
    cx.screen.field = field;
    cx.screen.request(Request::Field(field));
}

pub fn next_field(cx: &mut Cx, forward: bool) {
    let next = cx.screen.field.cycle(forward, |field| cx.scene.has_field(field, &cx.screen));
    show_field(cx, next);
    // The line below the map has the cursor's cell then.
    if cx.scene.maze().is_some_and(|maze| maze.inspecting.is_some()) {
        cx.screen.say(next.name());
    }
}

pub fn toggle_overlay(cx: &mut Cx, action: Action) {
    let Action::Toggle(overlay) = action else { return };
    let screen = &mut cx.screen;
    if let Some(why) = screen.why_not(overlay) {
        return screen.say(&why);
    }
    let shown = screen.overlays.toggle(overlay);
    cx.scene.act(action, screen);
    if (overlay, shown) == (Overlay::Ghost, true) {
        screen.explains = false;
        // In a comparison, a race goes on.
        if screen.on_arrival != OnArrival::Wait {
            screen.request(Request::Start(Some(cx.scene.view().reach.start.clone())));
        }
    }
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
        cx.screen.pane = pane;
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

/// Leaves what is on top: the past, something enlarged, or a run that is watched from a list.
pub fn close_top(session: &mut Session) {
    let cx = &mut session.cx;
    if cx.screen.return_to_present()
        || cx.scene.close(&mut cx.screen)
        || std::mem::take(&mut cx.screen.maximised)
    {
        return;
    }
    if cx.screen.from_list && cx.screen.elsewhere.is_some() {
        session.quit();
    } else if cx.screen.banner.is_none() || !std::mem::take(&mut cx.screen.explains) {
        cx.scene.act(Action::ZoomOff, &mut cx.screen);
    }
}

/// Selectable speed limits, in updates per second; beyond the last one there is no limit.
const SPEEDS: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 400.0, 800.0, 1600.0];

pub fn toggle_pause(cx: &mut Cx) {
    let trains = cx.snapshots().borrow().phase.is_training();
    if cx.screen.command(if trains { EngineCommand::Pause } else { EngineCommand::Resume }) {
        cx.screen.pausing = trains;
    }
}

/// Runs a step, pausing training first if necessary.
pub fn step(cx: &mut Cx, step: Step) {
    if cx.screen.snapshot.phase.is_training() && cx.screen.command(EngineCommand::Pause) {
        cx.screen.pausing = true;
    }
    cx.screen.command(EngineCommand::Step(step));
}

pub fn change_speed(cx: &mut Cx, faster: bool) {
    // Without a limit, the next slower speed is the first one below the actual rate. A method that
    // does not learn has a limit of its own.
    let snapshot = &cx.screen.snapshot;
    let learns = snapshot.learns;
    let rate = Some(snapshot.rates.0).filter(|rate| (!faster || !learns) && *rate > 0.0);
    let now = snapshot.speed.or(rate).unwrap_or(f64::INFINITY);
    let speed = if faster {
        let next = SPEEDS.into_iter().find(|speed| *speed > now);
        next.or(SPEEDS.last().copied().filter(|_| !learns))
    } else {
        SPEEDS.into_iter().rev().find(|speed| *speed < now).or(Some(SPEEDS[0]))
    };
    if cx.screen.command(EngineCommand::LimitSpeed(speed)) {
        cx.screen.say(&match speed {
            Some(speed) => format!("at most {speed:.0} updates per second"),
            None => "no speed limit".to_owned(),
        });
    }
}

/// Goes back to the frame before the moment shown, or forth to the one after it; from the last one
/// to the present. Only frames at updates that `other` has, if given, are shown, unless there are none.
pub fn step_through_film(cx: &mut Cx, forth: bool, other: Option<&[Arc<FilmFrame>]>) {
    if let Some(problem) = cannot_look_back(&cx.screen) {
        return cx.screen.say(&problem);
    }
    let mut film = cx.screen.snapshot.film.to_vec();
    let is_in = |own: &Arc<FilmFrame>| {
        other.is_none_or(|other| other.iter().any(|other| other.updates == own.updates))
    };
    if film.iter().any(is_in) {
        film.retain(is_in);
    }
    let shown = cx.screen.past.as_ref().map(|frame| frame.updates);
    match (forth, shown) {
        (true, None) => {
            let key = cx.screen.keymap.key_of(Action::Back);
            cx.screen.say(&format!("this is the present: {key} goes back"));
        }
        (true, Some(shown)) => {
            look_at(cx, film.iter().find(|frame| frame.updates > shown).cloned());
        }
        (false, shown) => {
            match film.iter().rfind(|frame| shown.is_none_or(|shown| frame.updates < shown)) {
                Some(frame) => look_at(cx, Some(frame.clone())),
                None => cx.screen.say("this is the first picture of the film"),
            }
        }
    }
}

/// Goes to the frame nearest to a place along the curves.
pub fn look_at_curves(cx: &mut Cx, at: f64) {
    if let Some(problem) = cannot_look_back(&cx.screen) {
        return cx.screen.say(&problem);
    }
    let off = |frame: &FilmFrame| (along(&cx.screen, frame.updates) - at).abs();
    let film = cx.screen.snapshot.film.iter();
    let nearest = film.min_by(|a, b| off(a).total_cmp(&off(b))).cloned();
    look_at(cx, nearest);
}

/// Returns to the present, for an action that is about it, and says so.
pub fn leave_past(cx: &mut Cx) {
    if cx.screen.return_to_present() {
        cx.screen.say("back in the present");
    }
}

pub fn look_at(cx: &mut Cx, frame: Option<Arc<FilmFrame>>) {
    if frame.is_none() {
        cx.screen.return_to_present();
    } else {
        cx.screen.past.clone_from(&frame);
        cx.screen.request(Request::Past(frame));
    }
}

fn cannot_look_back(screen: &Screen) -> Option<String> {
    if screen.tour.is_some() {
        return Some("the tour shows the present: go back in time after it".to_owned());
    }
    let why = if screen.snapshot.learns {
        "the film begins with the next picture"
    } else {
        "this method does not learn"
    };
    screen.snapshot.film.is_empty().then(|| format!("no film yet: {why}"))
}
