//! Looking back: the film of how distance was learned.

use std::sync::Arc;

use super::App;
use crate::tui::action::Action;
use gdg::train::FilmFrame;
use gdg::viewer::Request;

impl App {
    /// Goes back to the frame before the moment shown, or forth to the one after it; from the last
    /// one to the present.
    pub(super) fn step_through_time(&mut self, forth: bool) {
        let film = self.screen.snapshot.film.clone();
        let shown = self.screen.past.as_ref().map(|frame| frame.updates);
        if let Some(problem) = self.cannot_look_back() {
            return self.say(&problem);
        }
        match (forth, shown) {
            (true, None) => {
                let key = self.screen.keymap.key_of(Action::Back);
                self.say(&format!("this is the present: {key} goes back"));
            }
            (true, Some(shown)) => {
                let next = film.iter().find(|frame| frame.updates > shown).cloned();
                self.look_at(next);
            }
            (false, shown) => {
                match film.iter().rfind(|frame| shown.is_none_or(|shown| frame.updates < shown)) {
                    Some(frame) => self.look_at(Some(frame.clone())),
                    None => self.say("this is the first picture of the film"),
                }
            }
        }
    }

    /// Goes to the frame nearest to a place along the curves.
    pub(super) fn look_at_curves(&mut self, at: f64) {
        if let Some(problem) = self.cannot_look_back() {
            return self.say(&problem);
        }
        let along = |frame: &FilmFrame| {
            (crate::tui::render::curves::along(&self.screen, frame.updates) - at).abs()
        };
        let nearest =
            self.screen.snapshot.film.iter().min_by(|a, b| along(a).total_cmp(&along(b))).cloned();
        self.look_at(nearest);
    }

    /// Returns to the present; returns whether the past was shown.
    pub(super) fn return_to_present(&mut self) -> bool {
        self.in_scene(|_, screen, link| link.return_to_present(screen))
    }

    /// Returns to the present for what is about it, and says so.
    pub(super) fn leave_past(&mut self) {
        if self.return_to_present() {
            self.say("back in the present");
        }
    }

    /// Shows a frame of the film, or the present.
    fn look_at(&mut self, frame: Option<Arc<FilmFrame>>) {
        if frame.is_none() {
            self.return_to_present();
        } else {
            self.screen.past.clone_from(&frame);
            self.link.request(Request::Past(frame));
        }
    }

    /// Returns why there is no past to look at, if so.
    fn cannot_look_back(&self) -> Option<String> {
        if self.screen.tour.is_some() {
            return Some("the tour shows the present: go back in time after it".to_owned());
        }
        let why = if self.screen.snapshot.learns {
            "the film begins with the next picture"
        } else {
            "this method does not learn"
        };
        self.screen.snapshot.film.is_empty().then(|| format!("no film yet: {why}"))
    }
}
