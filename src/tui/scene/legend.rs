//! The scale of the colours, the legend, and the pane about the walking agent.

use std::cmp::Ordering;

use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::ground::MAX_SHOWN_ERROR;
use super::overlays::EDGES;
use super::{Drawing, SceneKind};
use crate::tui::action::Action;
use crate::tui::canvas::SHADES;
use crate::tui::characters::{CANDIDATE_MARK, UNVISITED_MARK};
use crate::tui::choices::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::pane_text::{Number, fact, fitted_line, heading, number, short};
use crate::tui::screen::Screen;
use crate::tui::theme::{ColourDepth, DIM, Rgb, Theme, ink};
use gdg::text::{counted, grouped};
use gdg::viewer::{Field, Ghost, Graph};

/// Width of the colour bar in characters, and its width where room is short.
pub const BAR_WIDTH: usize = 12;
pub const SHORT_BAR_WIDTH: usize = 5;

/// The actor stands still after this many steps in one place.
const STANDS_STEPS: u32 = 20;

/// Returns the name of the field that is shown, the values at both ends, and a bar of `bar` characters.
fn scale(scene: &dyn SceneKind, screen: &Screen, bar: usize) -> Line<'static> {
    let (theme, field) = (&screen.theme, scene.shown_field(screen));
    let (name, farthest) = (Span::raw(format!(" {} ", field.name())), scene.farthest(screen));
    let (low, high) = match field {
        Field::Plain => return Line::raw(format!(" {} only ", scene.noun())),
        Field::Error => {
            let most = 100.0 * MAX_SHOWN_ERROR;
            let [short, long] = if bar > SHORT_BAR_WIDTH { [" short", " long"] } else { [""; 2] };
            (format!("-{most:.0} %{short}"), format!("+{most:.0} %{long}"))
        }
        Field::Visits => ("0".to_owned(), short(f64::from(farthest))),
        _ => ("0".to_owned(), format!("{farthest:.0} steps")),
    };
    let mut line = Line::from(vec![name, Span::styled(format!("{low} "), DIM)]);
    if theme.depth == ColourDepth::Mono {
        let shades = SHADES.iter().flat_map(|shade| [*shade; 2]).collect::<String>();
        line.push_span(Span::raw(format!("[{shades}]")));
    } else {
        for i in 0..bar {
            let at = i as f32 / (bar - 1) as f32;
            let rgb = match field {
                Field::Error => theme.error_colour(2.0 * at - 1.0),
                Field::Visits => theme.distance_colour(1.0 - at),
                _ => theme.distance_colour(at),
            };
            line.push_span(Span::styled("\u{2588}", Style::new().fg(theme.colour(rgb))));
        }
    }
    line.push_span(Span::styled(format!(" {high}"), DIM));
    line
}

/// Draws the line below a scene: the scale, with the first of `texts` and the longest bar that fit.
pub fn draw_scale(area: Rect, scene: &dyn SceneKind, on: Drawing, texts: &[String]) {
    let Drawing { frame, screen, .. } = on;
    let bars = || (SHORT_BAR_WIDTH..=BAR_WIDTH).rev();
    let options = texts.iter().flat_map(|text| bars().map(move |bar| (text, bar)));
    let mut lines = options.map(|(text, bar)| {
        let mut line = scale(scene, screen, bar);
        // Without a bar, a blank ends the line.
        let text =
            if line.to_string().ends_with(' ') { text.trim_start_matches(", ") } else { text };
        line.push_span(Span::styled(text.to_owned(), DIM));
        line
    });
    let line = lines.find(|line| line.width() <= usize::from(area.width));
    let line = line.unwrap_or_else(|| scale(scene, screen, SHORT_BAR_WIDTH));
    frame.render_widget(Paragraph::new(fitted_line(line, area.width)), area);
}

/// Whether an action does anything: what is drawn, and what the run has.
pub fn offers(scene: &dyn SceneKind, screen: &Screen, action: Action) -> bool {
    scene.offers(action) && !matches!(action, Action::Toggle(of) if screen.why_not(of).is_some())
}

pub fn overlays(scene: &dyn SceneKind, screen: &Screen) -> impl Iterator<Item = Overlay> {
    Overlay::ALL.into_iter().filter(|of| offers(scene, screen, Action::Toggle(*of)))
}

/// The row of the legend that its overlays begin in.
pub const FIRST_OVERLAY: usize = 1;

/// Returns the legend: a line for each available overlay with its sign, and signs.
pub fn lines(scene: &dyn SceneKind, screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = vec![heading("toggle by key or click")];
    for overlay in overlays(scene, screen) {
        let key = screen.keymap.key_of(Action::Toggle(overlay));
        let (mark, style) =
            if screen.overlays.has(overlay) { ('x', Style::new()) } else { (' ', DIM) };
        let mut line = Line::from(format!(" {key:<2}[{mark}] "));
        line.push_span(Span::styled(overlay.name(), style));
        if let Some((sign, rgb)) = sign_of(overlay, screen) {
            line.extend([Span::raw(" "), sample(screen, sign, rgb)]);
            line.push_span(if overlay == Overlay::Search { " 1 to 2" } else { "" });
        }
        lines.push(line);
    }
    lines.push(heading("signs"));
    lines.extend(scene.signs(screen));
    lines
}

pub fn edge_lines(
    screen: &Screen,
    graph: &Graph,
    meanings: [&'static str; 3],
) -> impl Iterator<Item = Line<'static>> {
    let is_mono = screen.theme.depth == ColourDepth::Mono;
    let kinds = [EDGES[1], EDGES[2], EDGES[0]].into_iter().zip(meanings).zip(screen.theme.edges);
    kinds.map(move |(((status, _, mono), name), rgb)| {
        let text = format!("{} {name}", grouped(graph.count(status) as u64));
        sign(screen, if is_mono { mono } else { '\u{2500}' }, rgb, &text)
    })
}

pub fn sign(screen: &Screen, sign: char, rgb: Rgb, meaning: &str) -> Line<'static> {
    signs(screen, &[(sign, rgb, meaning)])
}

/// Returns signs with their meanings in one line.
pub fn signs(screen: &Screen, all: &[(char, Rgb, &str)]) -> Line<'static> {
    let spans = all.iter().flat_map(|(symbol, rgb, meaning)| {
        [Span::raw(" "), sample(screen, *symbol, *rgb), Span::raw(format!(" {meaning} "))]
    });
    spans.collect()
}

pub fn sample(screen: &Screen, sign: char, rgb: Rgb) -> Span<'static> {
    let Theme { page, wall, .. } = &screen.theme;
    let style = Style::new().fg(screen.theme.colour(rgb));
    // Use the map's wall colour as a ground, since it is darker than a light page.
    let is_faint = page.is_some_and(|(_, ground)| distance(rgb, ground) < FAINT);
    let style = if is_faint { style.bg(screen.theme.colour(*wall)) } else { style };
    Span::styled(sign.to_string(), style)
}

/// Signs closer to the page's colour than this, summed over the channels, get another ground.
const FAINT: u32 = 150;

fn distance((r, g, b): Rgb, other: Rgb) -> u32 {
    [(r, other.0), (g, other.1), (b, other.2)].iter().map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
}

fn sign_of(overlay: Overlay, screen: &Screen) -> Option<(char, Rgb)> {
    let theme = &screen.theme;
    let of_depth =
        |mono: char, other: char| if theme.depth == ColourDepth::Mono { mono } else { other };
    Some(match overlay {
        Overlay::Contours => return None,
        Overlay::Unexplored => (of_depth(UNVISITED_MARK, '\u{2592}'), theme.frontier),
        Overlay::Agents => (of_depth('o', '\u{25a0}'), theme.agent),
        // In black or white, as on any ground.
        Overlay::Candidates => (CANDIDATE_MARK, ink(theme.page.map_or((0, 0, 0), |page| page.1))),
        Overlay::Edges => (of_depth('=', '\u{2500}'), theme.edges[0]),
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (of_depth('+', '\u{25a0}'), theme.path),
        Overlay::Ghost => ('a', theme.ghost()),
    })
}

pub fn contour_text(screen: &Screen, layout: &ScreenLayout) -> String {
    let interval = layout.contour_interval.filter(|_| screen.theme.depth != ColourDepth::Mono);
    interval.map_or_else(String::new, |interval| format!(", a line every {interval:.0}"))
}

/// The meanings of the numbers, by their names in the pane and in comparisons.
pub const MEANINGS: &[(&str, &str)] = &[
    ("from", "where this walk began"),
    ("to G", "where it leads: the goal"),
    ("walking", "steps taken on this walk so far"),
    ("arrived", "steps it took"),
    ("gave up", "steps until then"),
    ("shortest", "true steps from the start to the goal"),
    ("alone", "how the actor alone walks from there: a"),
    ("D to goal", "steps left, as learned"),
    ("along plan", "the same along the plan's waypoints"),
    ("waypoint", "what the agent heads for next"),
    ("D to it", "steps to that, as learned"),
    ("ahead", "waypoints of the plan still to come"),
    ("arrivals", "walks that arrived, of those that ended; in comparisons, races from one start"),
    ("then", "what happens when the agent arrives"),
];

pub fn stands(ghost: &Ghost) -> bool {
    !ghost.arrived && ghost.steps - ghost.stands_since >= STANDS_STEPS
}

/// How @ walks, in the pane and in comparisons: its steps, and those of the shortest path.
pub fn walk(scene: &dyn SceneKind) -> [Number; 2] {
    let reach = &scene.view().reach;
    let state = match reach {
        reach if reach.arrived => "arrived",
        reach if reach.gave_up => "gave up",
        _ => "walking",
    };
    let (name, least) = match (scene.has_true_distances(), reach.shortest) {
        (true, Some(shortest)) => ("shortest", grouped(shortest.into())),
        (true, None) => ("shortest", "no path".to_owned()),
        (false, _) => ("left", scene.format_length(reach.left)),
    };
    [(state, counted(reach.steps.into(), "step"), String::new()), (name, least, String::new())]
}

/// Says how much shorter the plan was than the walk of the actor alone.
fn difference(planned: u32, alone: u32) -> String {
    let steps = counted(planned.abs_diff(alone).into(), "step");
    match planned.cmp(&alone) {
        Ordering::Less => format!("the plan is {steps} shorter"),
        Ordering::Equal => "the plan is as long".to_owned(),
        Ordering::Greater => format!("the plan is {steps} longer"),
    }
}

fn walk_of_actor(ghost: &Ghost) -> String {
    match ghost {
        ghost if ghost.arrived => format!("arrived, {}", counted(ghost.steps.into(), "step")),
        ghost if stands(ghost) => format!("stuck since step {}", ghost.stands_since),
        _ => "on its way".to_owned(),
    }
}

/// Says how plan and actor alone go, in fewer and fewer words; without plans, that the actor stands.
pub fn both_walks(scene: &dyn SceneKind, screen: &Screen) -> Option<Vec<String>> {
    let (reach, plans) = (&scene.view().reach, screen.run().method.plans());
    let ghost = reach.ghost.as_ref().filter(|_| !plans || screen.overlays.has(Overlay::Ghost))?;
    let actor = walk_of_actor(ghost);
    if !plans {
        return stands(ghost).then(|| vec![format!("@ {actor}")]);
    }
    let arrived = format!("arrived, {}", counted(reach.steps.into(), "step"));
    let plan = if reach.arrived { &arrived } else { "on its way" };
    let full = format!("@ planned: {plan}; a, the actor alone: {actor}");
    let both = reach.arrived && ghost.arrived;
    let who = both.then(|| format!("{full}: {}", difference(reach.steps, ghost.steps)));
    let short = format!("@ {plan}; a, the actor alone: {actor}").replace("arrived, ", "");
    let least = short.replace(", the actor alone", "");
    Some(who.into_iter().chain([full, short, least]).collect())
}

/// Returns the lines about the walking agent, the same ones for every method and at any time.
pub fn walk_lines(scene: &dyn SceneKind, screen: &Screen) -> Vec<Line<'static>> {
    let reach = &scene.view().reach;
    let has_path = !scene.has_true_distances() || reach.shortest.is_some();
    // There is no plan without a path, and none is left after arrival.
    let planned = |name, value: String| {
        fact(name, if has_path && !reach.arrived { value } else { "-".to_owned() })
    };
    let mut lines = scene.places([&reach.start, &reach.at, &scene.goal()], screen);
    let failure = reach.failure.iter().flat_map(|failure| failure.lines());
    lines.extend(failure.map(|line| Line::from(format!(" {line}"))));
    lines.extend(walk(scene).map(number));
    let key = |action| screen.keymap.key_of(action);
    let ghost = reach.ghost.as_ref().filter(|_| screen.overlays.has(Overlay::Ghost));
    let toggle = Action::Toggle(Overlay::Ghost);
    let actor = match ghost {
        _ if !offers(scene, screen, toggle) => "-".to_owned(),
        None => format!("{} shows it", key(toggle)),
        Some(ghost) => walk_of_actor(ghost),
    };
    let waypoint = reach.waypoint.as_deref();
    let note = if has_path { "" } else { " (meaningless)" };
    let ahead = match reach.path.len() {
        0 => "actor alone".to_owned(),
        1 => "straight to G".to_owned(),
        stops => counted(stops as u64 - 1, "waypoint"),
    };
    let along = if reach.path.len() > 1 { reach.along } else { f32::NAN };
    let start = if scene.offers(Action::StartHere) {
        key(Action::StartHere) + " or "
    } else {
        String::new()
    };
    lines.extend([
        fact("alone", actor),
        fact("D to goal", format_steps(reach.distances.0) + note),
        planned("along plan", format_steps(along)),
        planned("waypoint", waypoint.map_or("the goal".to_owned(), |at| scene.format_place(at))),
        planned("D to it", format_steps(reach.distances.1)),
        planned("ahead", ahead),
        heading("walks"),
        fact("arrivals", format!("{} of {}", reach.finished.0, reach.finished.1)),
        fact("then", screen.on_arrival.name()),
        Line::default(),
        Line::from(format!(" {} or click: new goal", key(Action::NewGoal))),
        Line::from(format!(" {start}right-click: new start")),
    ]);
    lines
}

fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1}") }
}
