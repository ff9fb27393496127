//! The facts about a side, as a column beside its map or as text below it.

use ratatui::style::Style;
use ratatui::text::{Line, Span};

use super::maze_of;
use crate::tui::session::Session;
use crate::tui::style::{BOLD, DIM};
use crate::tui::text::short;

/// Columns of the names in a column of facts.
const NAME_WIDTH: usize = 12;

/// A name and a value.
pub struct Fact {
    name: &'static str,
    value: String,
    style: Style,
    place: Place,
}

/// Facts that begin a new line of text, so that those of both sides line up.
const FIRST: [&str; 2] = ["success", "D error"];

/// How a fact follows the others in text.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    Own,
    /// In brackets, as it explains the fact before it.
    Aside,
    /// The same without its name.
    NamelessAside,
}

impl Fact {
    fn new(name: &'static str, value: String) -> Self {
        Self { name, value, style: Style::new(), place: Place::Own }
    }
}

/// Returns the facts about a side, the most important first; its agent has finished
/// `arrived` of `races` races at the goal.
pub fn facts(session: &Session, arrived: u32, races: u32) -> Vec<Fact> {
    let (snapshot, walk) = (&session.screen.snapshot, &maze_of(session).view.walk);
    let mut facts = vec![
        Fact::new("steps", short(snapshot.counters.env_steps as f64)),
        Fact::new("updates", short(snapshot.counters.updates as f64)),
        Fact {
            place: Place::NamelessAside,
            ..Fact::new("rate", format!("{}/s", short(snapshot.rates.0)))
        },
    ];
    let success = session.screen.success();
    let rate = |rate: f64| format!("{rate:.2}");
    let value = success
        .map_or("-".to_owned(), |s| s.planned.or(s.greedy).map_or("no tasks".to_owned(), rate));
    facts.push(Fact { style: BOLD, ..Fact::new("success", value) });
    let unknown = || "-".to_owned();
    // Unknown values are shown too, so that what follows does not move.
    if session.screen.run().method.plans() {
        let greedy = success.and_then(|s| s.greedy).map_or_else(unknown, rate);
        facts.push(Fact { place: Place::Aside, ..Fact::new("greedy", greedy) });
    }
    facts.push(Fact::new("races", format!("{arrived}/{races}")));
    let latest = snapshot.evaluations.last();
    let error = latest.and_then(|(_, evaluation)| evaluation.distance_error);
    facts.push(Fact::new(
        "D error",
        error.map_or_else(unknown, |error| format!("{:.0} %", 100.0 * error.mape)),
    ));
    let updates = latest.map_or_else(unknown, |(updates, _)| short(*updates as f64));
    facts.push(Fact { place: Place::Aside, ..Fact::new("at update", updates) });
    let state = match walk {
        walk if walk.arrived => "arrived in",
        walk if walk.gave_up => "gave up at",
        _ => "walking",
    };
    facts.push(Fact::new(state, walk.steps.to_string()));
    facts.extend(
        walk.shortest
            .map(|steps| Fact { place: Place::Aside, ..Fact::new("shortest", steps.to_string()) }),
    );
    facts
}

pub fn column(facts: &[Fact]) -> Vec<Line<'static>> {
    let line = |fact: &Fact| {
        let name = format!(" {:<NAME_WIDTH$}", fact.name);
        Line::from(vec![Span::styled(name, DIM), Span::styled(fact.value.clone(), fact.style)])
    };
    facts.iter().map(line).collect()
}

/// Returns the facts one after the other, in lines of at most `width` columns.
pub fn text(facts: &[Fact], width: u16) -> Vec<Line<'static>> {
    let mut lines: Vec<Line> = vec![Line::default()];
    // A fact and what explains it stay together.
    for group in facts.chunk_by(|_, next| next.place != Place::Own) {
        let mut parts = Line::default();
        for fact in group {
            let (name, value) = match fact.place {
                Place::Own => (format!(" {} ", fact.name), fact.value.clone()),
                Place::Aside => (format!(" ({} ", fact.name), format!("{})", fact.value)),
                Place::NamelessAside => (" ".to_owned(), format!("({})", fact.value)),
            };
            parts.push_span(Span::styled(name, DIM));
            parts.push_span(Span::styled(value, fact.style));
        }
        let has_room = |line: &&mut Line| {
            let is_first = FIRST.contains(&group[0].name);
            line.spans.is_empty()
                || !is_first && line.width() + 1 + parts.width() <= usize::from(width)
        };
        match lines.last_mut().filter(has_room) {
            Some(line) if line.spans.is_empty() => *line = parts,
            // A wider gap between facts than within one.
            Some(line) => line.spans.extend(std::iter::once(Span::raw(" ")).chain(parts.spans)),
            None => lines.push(parts),
        }
    }
    lines
}
