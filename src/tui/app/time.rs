//! Training and time: pausing, stepping, speed, freezing, and looking back at the film of how
//! distance was learned.

use std::sync::Arc;

use crate::tui::action::Action;
use crate::tui::link::Link;
use crate::tui::render::curves::along;
use crate::tui::screen::Screen;
use gdg::engine::{Command, Step};
use gdg::train::FilmFrame;
use gdg::viewer::Request;

/// Selectable speed limits, in updates per second; beyond the last one there is no limit.
const SPEEDS: [f64; 9] = [1.0, 3.0, 10.0, 30.0, 100.0, 200.0, 400.0, 800.0, 1600.0];

/// Performs an action on training or time; returns whether it is one.
pub fn act(action: Action, screen: &mut Screen, link: &Link) -> bool {
    match action {
        Action::TogglePause => toggle_pause(screen, link),
        Action::StepUpdate => step(Step::Update, screen, link),
        Action::StepEpisode => step(Step::Episode, screen, link),
        Action::Slower => change_speed(false, screen, link),
        Action::Faster => change_speed(true, screen, link),
        Action::Freeze => screen.frozen = !screen.frozen,
        Action::Evaluate => drop(link.command(Command::Evaluate, screen)),
        Action::Back => step_through_film(false, screen, link),
        Action::Forth => step_through_film(true, screen, link),
        _ => return false,
    }
    true
}

fn toggle_pause(screen: &mut Screen, link: &Link) {
    let trains = link.engine().snapshots().borrow().phase.is_training();
    if link.command(if trains { Command::Pause } else { Command::Resume }, screen) {
        screen.pausing = trains;
    }
}

/// Runs a step, pausing training first if necessary.
fn step(step: Step, screen: &mut Screen, link: &Link) {
    if screen.snapshot.phase.is_training() && link.command(Command::Pause, screen) {
        screen.pausing = true;
    }
    link.command(Command::Step(step), screen);
}

fn change_speed(faster: bool, screen: &mut Screen, link: &Link) {
    // Without a limit, the next slower speed is the first one below the actual rate. A method that
    // does not learn has a limit of its own.
    let learns = screen.snapshot.learns;
    let rate = Some(screen.snapshot.rates.0).filter(|rate| (!faster || !learns) && *rate > 0.0);
    let now = screen.snapshot.speed.or(rate).unwrap_or(f64::INFINITY);
    let speed = if faster {
        let next = SPEEDS.into_iter().find(|speed| *speed > now);
        next.or(SPEEDS.last().copied().filter(|_| !learns))
    } else {
        SPEEDS.into_iter().rev().find(|speed| *speed < now).or(Some(SPEEDS[0]))
    };
    if link.command(Command::LimitSpeed(speed), screen) {
        screen.say(&match speed {
            Some(speed) => format!("at most {speed:.0} updates per second"),
            None => "no speed limit".to_owned(),
        });
    }
}

/// Goes back to the frame before the moment shown, or forth to the one after it; from the last one
/// to the present.
fn step_through_film(forth: bool, screen: &mut Screen, link: &Link) {
    if let Some(problem) = cannot_look_back(screen) {
        return screen.say(&problem);
    }
    let film = screen.snapshot.film.clone();
    let shown = screen.past.as_ref().map(|frame| frame.updates);
    match (forth, shown) {
        (true, None) => {
            let key = screen.keymap.key_of(Action::Back);
            screen.say(&format!("this is the present: {key} goes back"));
        }
        (true, Some(shown)) => {
            let next = film.iter().find(|frame| frame.updates > shown).cloned();
            look_at(next, screen, link);
        }
        (false, shown) => {
            match film.iter().rfind(|frame| shown.is_none_or(|shown| frame.updates < shown)) {
                Some(frame) => look_at(Some(frame.clone()), screen, link),
                None => screen.say("this is the first picture of the film"),
            }
        }
    }
}

/// Goes to the frame nearest to a place along the curves.
pub fn look_at_curves(at: f64, screen: &mut Screen, link: &Link) {
    if let Some(problem) = cannot_look_back(screen) {
        return screen.say(&problem);
    }
    let off = |frame: &FilmFrame| (along(screen, frame.updates) - at).abs();
    let film = screen.snapshot.film.iter();
    let nearest = film.min_by(|a, b| off(a).total_cmp(&off(b))).cloned();
    look_at(nearest, screen, link);
}

/// Returns to the present for what is about it, and says so.
pub fn leave_past(screen: &mut Screen, link: &Link) {
    if link.return_to_present(screen) {
        screen.say("back in the present");
    }
}

/// Shows a frame of the film, or the present.
pub fn look_at(frame: Option<Arc<FilmFrame>>, screen: &mut Screen, link: &Link) {
    if frame.is_none() {
        link.return_to_present(screen);
    } else {
        if screen.past.is_none() {
            screen.say("the map shows the past; panes show the present");
        }
        screen.past.clone_from(&frame);
        link.request(Request::Past(frame));
    }
}

/// Returns why there is no past to look at, if so.
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
