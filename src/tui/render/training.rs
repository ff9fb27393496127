//! Training progress: counters, rates, success, and where the time goes.

use ratatui::text::Line;

use super::text::{clock, fact, heading, short};
use crate::learn;
use crate::text::grouped;
use crate::train::{DistanceScore, Score};
use crate::tui::scene;
use crate::tui::screen::Screen;

/// Returns the pane's lines.
pub fn lines(screen: &Screen) -> Vec<Line<'static>> {
    let snapshot = &screen.snapshot;
    let (updates, steps) = snapshot.rates;
    let updates = match (snapshot.learns, snapshot.updates()) {
        (true, now) => format!("{} {}/s", count(screen, now), short(updates)),
        (false, 0) => "none: random steps".to_owned(),
        (false, before) => format!("{}, now none", count(screen, before)),
    };
    let (used, room) = snapshot.replay;
    let mut lines = vec![
        fact("elapsed", clock(snapshot.seconds)),
        fact("updates", updates),
        fact("steps", format!("{} {}/s", count(screen, snapshot.counters.env_steps), short(steps))),
        fact("episodes", count(screen, snapshot.counters.episodes)),
        fact("replay", format!("{} of {}", short(used as f64), short(room as f64))),
        fact("D loss", format!("{:.4}", snapshot.losses.critic)),
        fact("f loss", format!("{:.4}", snapshot.losses.model)),
        fact("mu loss", format!("{:.1} steps", snapshot.losses.actor)),
        heading("success"),
    ];
    lines.splice(1..1, seconds_left(screen).map(|seconds| fact("remaining", clock(seconds))));
    lines.extend(success(screen));
    lines.extend(bridges(screen));
    lines.extend(time(screen));
    lines
}

/// Formats a count: exactly if it stands still.
fn count(screen: &Screen, n: u64) -> String {
    if screen.snapshot.phase.is_training() { short(n as f64) } else { grouped(n) }
}

/// Returns the seconds until the run ends, if known.
fn seconds_left(screen: &Screen) -> Option<f64> {
    let (snapshot, limits) = (&screen.snapshot, &screen.snapshot.limits);
    let updates = limits
        .updates
        .filter(|_| snapshot.rates.0 > 0.0)
        .map(|limit| limit.saturating_sub(snapshot.counters.updates) as f64 / snapshot.rates.0);
    let seconds = limits.seconds.map(|limit| (limit - snapshot.seconds).max(0.0));
    let episodes = limits.episodes.filter(|_| snapshot.counters.episodes > 0 && snapshot.seconds > 0.0).map(|limit| {
        limit.saturating_sub(snapshot.counters.episodes) as f64 * snapshot.seconds / snapshot.counters.episodes as f64
    });
    [updates, seconds, episodes].into_iter().flatten().min_by(f64::total_cmp)
}

fn success(screen: &Screen) -> Vec<Line<'static>> {
    let Some((updates, evaluation)) = screen.snapshot.evaluation() else {
        return vec![fact("evaluated", "not yet")];
    };
    let mut lines = Vec::new();
    let score = |name: &str, score: &Score| match score.success {
        Some(success) => fact(name, format!("{success:.2}  {}", success_bars(&score.by_distance))),
        None => fact(name, "no tasks"),
    };
    lines.extend(evaluation.planned.as_ref().map(|planned| score("planned", planned)));
    lines.push(score("greedy", &evaluation.greedy));
    if let Some(error) = evaluation.distance_error {
        let graph = error.graph.map_or(String::new(), |g| format!(", graph {:.0} %", 100.0 * g.mape));
        lines.push(fact("D error", format!("{:.0} %{graph}", 100.0 * error.mape)));
    }
    let seen = evaluation.coverage.map_or(String::new(), |coverage| format!(", {:.0} % seen", 100.0 * coverage));
    lines.push(fact("at update", format!("{}{seen}", short(screen.snapshot.learned(*updates) as f64))));
    lines
}

/// Returns one bar per distance that has tasks, near to far. Even the tallest bar leaves a gap to the line above.
fn success_bars(by_distance: &[DistanceScore]) -> String {
    const BARS: [char; 8] = [' ', '\u{2581}', '\u{2582}', '\u{2583}', '\u{2584}', '\u{2585}', '\u{2586}', '\u{2587}'];
    by_distance.iter().filter_map(|d| d.success).map(|success| BARS[(success * 7.0).round() as usize]).collect()
}

fn bridges(screen: &Screen) -> Vec<Line<'static>> {
    if !screen.run().method.plans() {
        return Vec::new();
    }
    let search = screen.snapshot.search.as_ref().map_or("none yet".to_owned(), |s| match &s.found {
        Some(bridge) => format!("{} tried, gain {:.0}", s.tried(), bridge.gain),
        None => format!("{} tried, none", s.tried()),
    });
    let (nodes, edges) = scene::graph_size(screen);
    vec![heading("bridges"), fact("nodes", format!("{nodes}, {} edges", short(edges as f64))), fact("search", search)]
}

/// Returns lines on where the time goes.
fn time(screen: &Screen) -> Vec<Line<'static>> {
    use learn::Stage::{
        ActorGradient, ActorStep, CriticModelGradients, CriticModelSteps, Explore, Graph, Sample, Tape,
    };

    let spent = |phase| screen.snapshot.profile.spent(phase).as_secs_f64();
    let all: f64 = learn::Stage::ALL.into_iter().map(spent).sum();
    let share = |phases: &[learn::Stage]| 100.0 * phases.iter().map(|p| spent(*p)).sum::<f64>() / all.max(1e-9);
    let learning = share(&[CriticModelGradients, ActorGradient, Tape]);
    vec![
        heading("time"),
        fact("gradients", format!("{learning:.0} %, steps {:.0} %", share(&[CriticModelSteps, ActorStep]))),
        fact("exploring", format!("{:.0} %, batches {:.0} %", share(&[Explore]), share(&[Sample, Graph]))),
    ]
}
