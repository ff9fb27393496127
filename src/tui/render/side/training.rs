//! Training progress: counters, rates, success, and where the time goes.

use ratatui::text::Line;

use crate::tui::action::Action;
use crate::tui::pane_text::{EXPLAINED_WIDTH, Number, clock, explain, fact, number, short};
use crate::tui::render::curves::group_name;
use crate::tui::scene::Scene;
use crate::tui::screen::Screen;
use crate::tui::theme::BOLD;
use gdg::engine::NextEvaluation;
use gdg::env::DistanceUnit;
use gdg::learn::{Losses, TrainingPhase};
use gdg::text::{grouped, sanitized};
use gdg::train::{DistanceScore, Score};

/// The meanings of the numbers, by their names in the pane.
pub const MEANINGS: [(&str, &str); 23] = [
    ("elapsed", "time spent training"),
    ("left", "time until the run reaches its limit"),
    ("updates", "gradient steps so far, and per second"),
    ("data", "what it learns from: agents do not act"),
    ("steps", "steps of all agents so far, and per second"),
    ("episodes", "episodes of all agents so far"),
    ("replay", "transitions stored, of its capacity"),
    ("loss of D", "critic: error of the distance D it learns"),
    ("loss of f", "model f: error of the next state it predicts"),
    ("loss of mu", "actor mu: mean D after its actions"),
    ("success", "walks that arrive, of an evaluation: all, and near to far"),
    ("planned", "with waypoints planned over bridge points"),
    ("alone", "by the actor alone"),
    ("error of D", "mean error of D against the true steps"),
    ("via graph", "the same for D along the bridge graph"),
    ("evaluated", "when success and errors were measured"),
    ("evaluation", "when they are measured again"),
    ("saved", "when its program saved what is shown"),
    ("explored", "visited share of the reachable cells"),
    ("achieved", "the part of the state that the goal is about"),
    ("bridges", "bridge candidates, and edges between them"),
    ("search", "steps gained by the best bridge tried"),
    ("learning", "time spent on updates, and on agents' steps"),
];

/// What a run has done so far, as the pane and comparisons say it: updates and steps.
pub fn counters(screen: &Screen) -> [Number; 2] {
    let (snapshot, counters) = (&screen.snapshot, screen.snapshot.counters);
    // A rate of 0 is one that is not known.
    let rate = |rate: f64| if rate > 0.0 { format!(", {}/s", short(rate)) } else { String::new() };
    let updates = match (snapshot.learns, snapshot.updates()) {
        (true, now) => (short(now as f64), rate(snapshot.rates.0)),
        (false, 0) => ("none".to_owned(), ": random steps".to_owned()),
        (false, before) => (short(before as f64), ", now none".to_owned()),
    };
    let steps = (short(counters.env_steps as f64), rate(snapshot.rates.1));
    [("updates", updates.0, updates.1), ("steps", steps.0, steps.1)]
}

/// What the latest evaluation has found, likewise: success with plans and without, with a bar for
/// each distance, and the error of D.
pub fn scores(screen: &Screen) -> [Number; 3] {
    let found = screen.snapshot.evaluation().map(|(_, evaluation)| evaluation);
    let score = |name, score: Option<&Score>| match score.map(|score| (score, score.success)) {
        Some((score, Some(success))) => {
            (name, format!("{success:.2}"), format!(" {}", success_bars(&score.by_distance)))
        }
        Some((_, None)) => (name, "no tasks".to_owned(), String::new()),
        None => (name, "-".to_owned(), String::new()),
    };
    let error = found.and_then(|found| found.error);
    [
        score("planned", found.and_then(|found| found.planned.as_ref())),
        score("alone", found.map(|found| &found.alone)),
        ("error of D", error.map_or("-".to_owned(), |error| percent(error.mape)), String::new()),
    ]
}

fn percent(mape: f64) -> String {
    format!("{:.0} %", 100.0 * mape)
}

/// Returns the lines that matter first, or all of them.
pub fn lines(screen: &Screen, scene: &Scene, width: usize, all: bool) -> Vec<Line<'static>> {
    let snapshot = &screen.snapshot;
    let mut lines = vec![fact("elapsed", clock(snapshot.seconds))];
    lines.extend(snapshot.seconds_left.map(|seconds| fact("left", clock(seconds))));
    let [updates, steps] = counters(screen);
    lines.push(number(updates));
    // That agents do not act is said first.
    let shown = if all { 3 } else { usize::from(snapshot.data.is_some()) };
    lines.extend(experience(screen, steps).into_iter().take(shown));
    lines.extend(losses(screen, all));
    lines.extend(success(screen, all));
    // Where it seldom moves, agents have to find out how.
    let seldom = snapshot.goal_moved.filter(|share| all || *share < 0.2);
    let moved = |share: f64| fact("achieved", format!("moves in {:.1} % of steps", 100.0 * share));
    lines.extend(seldom.map(moved));
    if all {
        lines.extend(bridges(screen, scene));
        lines.extend(time(screen));
    }
    if width >= EXPLAINED_WIDTH {
        lines.iter_mut().for_each(|line| explain(line, &MEANINGS));
    }
    lines
}

/// Describes what it learns from.
fn experience(screen: &Screen, steps: Number) -> [Line<'static>; 3] {
    let (snapshot, counters) = (&screen.snapshot, screen.snapshot.counters);
    if let Some(data) = &snapshot.data {
        let file = data.file.file_name().unwrap_or_default().to_string_lossy();
        return [
            fact("data", sanitized(&file)),
            fact("steps", format!("{} recorded", grouped(data.transitions as u64))),
            fact("episodes", format!("{} recorded", grouped(data.episodes as u64))),
        ];
    }
    let (used, room) = snapshot.replay;
    [
        number(steps),
        fact("episodes", short(counters.episodes as f64)),
        fact("replay", format!("{} of {}", short(used as f64), short(room as f64))),
    ]
}

fn losses(screen: &Screen, all: bool) -> Vec<Line<'static>> {
    let snapshot = &screen.snapshot;
    if !snapshot.learns {
        return Vec::new();
    }
    if snapshot.counters.updates == 0 {
        let starts = screen.run().settings.train.learning_starts;
        return vec![fact("learning", format!("from step {}", short(starts as f64)))];
    }
    if !all {
        return Vec::new();
    }
    let Losses { critic, model, actor, .. } = snapshot.losses;
    let lines = [
        Losses::known(critic).map(|loss| fact("loss of D", format!("{loss:.4}"))),
        Losses::known(model).map(|loss| fact("loss of f", format!("{loss:.4}"))),
        Losses::known(actor).map(|loss| fact("loss of mu", format!("{loss:.1} steps"))),
    ];
    lines.into_iter().flatten().collect()
}

fn success(screen: &Screen, all: bool) -> Vec<Line<'static>> {
    let found = screen.snapshot.evaluation();
    let title = found.map_or("not evaluated yet".to_owned(), |(_, evaluation)| {
        format!("all  {}", distances(&evaluation.alone.by_distance))
    });
    let mut lines = vec![Line::styled(format!(" {:<11}{title}", "success"), BOLD)];
    lines.extend(scores(screen).into_iter().filter(|(_, value, _)| value != "-").map(number));
    if let Some((updates, evaluation)) = found.filter(|_| all) {
        let graph = evaluation.error.and_then(|error| error.graph);
        lines.extend(graph.map(|graph| fact("via graph", percent(graph.mape))));
        let at = grouped(screen.snapshot.learned(*updates));
        lines.push(fact("evaluated", format!("at update {at}")));
    }
    let how = screen.elsewhere.as_ref().filter(|_| found.is_none());
    lines.extend(how.map(|_| Line::raw(" (--eval-every-updates N)")));
    lines.push(next(screen));
    // Known between evaluations as well.
    let seen = screen.snapshot.coverage();
    let explored = |seen| fact("explored", format!("{:.0} % in reach", 100.0 * seen));
    lines.extend(seen.last().map(|(_, seen)| explored(*seen)));
    lines
}

/// Describes when the next evaluation comes, and which key starts one now; of a run that another
/// program trains, when it was saved.
fn next(screen: &Screen) -> Line<'static> {
    if let Some([_, saved]) = &screen.elsewhere {
        return fact("saved", saved.clone());
    }
    if !screen.snapshot.learns {
        return fact("evaluation", format!("{} now", screen.keymap.key_of(Action::Evaluate)));
    }
    let when = match screen.snapshot.next_evaluation {
        NextEvaluation::Running(_) => {
            let long = screen.evaluating.as_ref();
            let long = long.map_or(" now".to_owned(), |so_far| format!(", {so_far}"));
            return fact("evaluation", format!("running{long}"));
        }
        _ if !screen.snapshot.phase.is_training() => "paused".to_owned(),
        NextEvaluation::InSeconds(seconds) => format!("in {seconds} s"),
        NextEvaluation::AtUpdate(updates) => format!("at {}", short(updates as f64)),
    };
    fact("evaluation", format!("{when}  {} now", screen.keymap.key_of(Action::Evaluate)))
}

/// Returns the title of success by distance: the nearest and the farthest.
fn distances(by_distance: &[DistanceScore]) -> String {
    let unit = match by_distance.iter().find_map(DistanceScore::distance) {
        Some((_, DistanceUnit::Centimetres)) => "cm",
        Some((_, DistanceUnit::Steps)) => "steps",
        None => "tasks",
    };
    let tested = by_distance.iter().enumerate().filter(|(_, d)| d.success.is_some());
    let names: Vec<String> = tested.map(|(i, d)| group_name(d, i, by_distance.len())).collect();
    match &names[..] {
        [near, .., far] => format!("{near}-{far} {unit}"),
        [_] if unit == "tasks" => String::new(),
        _ => format!("{} {unit}", names.concat()),
    }
}

/// Returns one bar per distance that has tasks; even the tallest leaves a gap above.
fn success_bars(by_distance: &[DistanceScore]) -> String {
    const BARS: [char; 8] =
        ['_', '\u{2581}', '\u{2582}', '\u{2583}', '\u{2584}', '\u{2585}', '\u{2586}', '\u{2587}'];
    let scores = by_distance.iter().filter_map(|d| d.success);
    scores.map(|success| BARS[(success * 7.0).round() as usize]).collect()
}

fn bridges(screen: &Screen, scene: &Scene) -> Vec<Line<'static>> {
    if !screen.run().method.plans() {
        return Vec::new();
    }
    let search =
        screen.snapshot.search.as_ref().map_or("none yet".to_owned(), |s| match &s.found {
            // Show gains of less than a step as well.
            Some(bridge) => format!(
                "gains {:.*}, of {}",
                usize::from(bridge.gain < 1.0),
                bridge.gain,
                s.tried()
            ),
            None => format!("none of {} helps", s.tried()),
        });
    let edges = scene.graph().edges.len();
    let candidates = grouped(scene.graph().candidates.len() as u64);
    let bridges = format!("{candidates}, {} edges", short(edges as f64));
    vec![fact("bridges", bridges), fact("search", search)]
}

fn time(screen: &Screen) -> Option<Line<'static>> {
    let spent = |phase| screen.snapshot.profile.spent(phase).as_secs_f64();
    let all: f64 = TrainingPhase::of_trainer().map(spent).sum();
    let exploring = spent(TrainingPhase::Explore) + spent(TrainingPhase::Plans);
    let percent = |seconds: f64| format!("{:.0} %", 100.0 * seconds / all);
    (all > 0.0).then(|| {
        fact("learning", format!("{}, acting {}", percent(all - exploring), percent(exploring)))
    })
}
