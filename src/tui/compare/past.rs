//! Looking back at what both had learned, at the same place along the axis of the curves.

use std::sync::Arc;

use super::{Comparison, Side};
use crate::tui::app::time;
use gdg::train::FilmFrame;

/// The frames of a side's film, with their places along the axis.
type Frames = Vec<(f64, Arc<FilmFrame>)>;

impl Side {
    /// Returns the update that the map shows.
    pub(super) fn shown_updates(&self) -> u64 {
        let snapshot = &self.app.screen.snapshot;
        let past = self.app.screen.past.as_ref();
        past.map_or(snapshot.updates(), |frame| snapshot.learned(frame.updates))
    }
}

impl Comparison {
    /// Returns whether either side shows its past.
    pub(super) fn is_past(&self) -> bool {
        self.sides.iter().any(|side| side.app.screen.past.is_some())
    }

    /// Returns where a side's frame is along the axis, if it shows its past.
    pub(super) fn past_at(&self, side: &Side) -> Option<f64> {
        let frame = side.app.screen.past.as_ref()?;
        Some(side.pace.at(frame.updates as f64).along(self.axis))
    }

    fn frames(&self, side: &Side) -> Frames {
        let film = side.app.screen.snapshot.film.iter();
        film.map(|frame| (side.pace.at(frame.updates as f64).along(self.axis), frame.clone()))
            .collect()
    }

    /// Goes back to the frame before the moment shown, or forth to the one after it, of the film
    /// that reaches farther along the axis; after its last one, to the present.
    pub(super) fn step_through_films(&mut self, forth: bool) {
        let last = |side: &&Side| self.frames(side).last().map(|(at, _)| *at);
        let [a, b] = self.sides.each_ref();
        let longer = if last(&b) > last(&a) { b } else { a };
        let (frames, shown) = (self.frames(longer), self.past_at(longer));
        if frames.is_empty() {
            return self.notify("no film yet: it begins with the next picture");
        }
        let place = |found: Option<&(f64, Arc<FilmFrame>)>| found.map(|(at, _)| *at);
        let next = match shown {
            None if forth => return self.notify("this is the present"),
            Some(shown) if forth => place(frames.iter().find(|(at, _)| *at > shown)),
            shown => {
                let before = |at: f64| shown.is_none_or(|shown| at < shown);
                let Some(at) = place(frames.iter().rfind(|(at, _)| before(*at))) else {
                    return self.notify("this is the first picture of the films");
                };
                Some(at)
            }
        };
        match next {
            Some(at) => self.look_at(at),
            None => self.return_to_present(),
        }
    }

    /// Shows on each side the frame nearest to a place along the axis.
    pub(super) fn look_at(&mut self, at: f64) {
        let off = |frame: &(f64, Arc<FilmFrame>)| (frame.0 - at).abs();
        let nearest = |side: &Side| {
            let frames = self.frames(side);
            let nearest = frames.into_iter().min_by(|a, b| off(a).total_cmp(&off(b)));
            nearest.map(|(_, frame)| frame)
        };
        let found = self.sides.each_ref().map(nearest);
        for (side, frame) in self.sides.iter_mut().zip(found) {
            side.app.in_scene(|_, screen, link| time::look_at(frame, screen, link));
        }
    }

    /// Shows the present on both sides.
    pub(super) fn return_to_present(&mut self) {
        for side in &mut self.sides {
            side.app.in_scene(|_, screen, link| time::look_at(None, screen, link));
        }
    }
}
