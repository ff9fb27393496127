//! The line below the map, its legend, and the pane about the followed agent.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{MazeState, offers};
use crate::tui::action::Action;
use crate::tui::layout::ScreenLayout;
use crate::tui::scene::legend::{
    self, SHORT_BAR_WIDTH, contour_text, draw_scale, edge_lines, overlay_lines, sample, sign,
};
use crate::tui::scene::overlays::{FRONTIER_SIGN, MAX_EDGES, TRAIL_MARK};
use crate::tui::screen::Screen;
use crate::tui::text::{fact, fitted_line, heading, short, wrapped};
use crate::tui::theme::{ColourDepth, Rgb};
use gdg::bridge::EdgeStatus;
use gdg::text::counted;

/// Columns that sentences have at least.
const MIN_TEXT_WIDTH: usize = 20;

/// Draws the line below the map: facts about a cell, or what the colours mean.
pub fn draw_info(
    frame: &mut Frame,
    area: Rect,
    maze: &MazeState,
    screen: &Screen,
    layout: &ScreenLayout,
) {
    if maze.inspecting.or(maze.hovered).is_some() {
        let line = cell_facts(usize::from(area.width), maze);
        return frame.render_widget(Paragraph::new(fitted_line(line, area.width)), area);
    }
    let [long, short] = scaled_down_texts(screen, layout);
    let interval = contour_text(screen, layout);
    let texts =
        [[&*interval, &*long], [&interval, &short], [&interval, ""], [&long, ""], [&short, ""]]
            .map(|texts| texts.concat());
    draw_scale(frame, area, |bar| maze.scale(screen, bar), &texts);
}

/// Describes the cell under the cursor or the mouse, with as many facts as fit into `width`: walls
/// and D first.
fn cell_facts(width: usize, maze: &MazeState) -> Line<'static> {
    let Some(cell) = maze.inspecting.or(maze.hovered) else { return Line::default() };
    let place = format!("{},{}", cell.x, cell.y);
    if !maze.map.is_free(cell) {
        return Line::from(format!(" cell {place}: wall"));
    }
    let Some(facts) = maze.view.inspected.filter(|facts| facts.cell == cell) else {
        return Line::from(format!(" cell {place}"));
    };
    let learned = facts.learned;
    let visits = facts
        .visits
        .map_or(String::new(), |visits| format!(", {} visits", short(f64::from(visits))));
    let (what, visits) = match facts.truth {
        // There is no relative error of zero steps.
        Some(0) => (format!("D {learned:.1}, true 0 ({learned:+.1} steps)"), visits),
        Some(truth) => {
            let error = 100.0 * (learned - truth as f32) / truth as f32;
            (format!("D {learned:.1}, true {truth} ({error:+.0} %)"), visits)
        }
        None => (format!("D {learned:.1}, no path to G"), String::new()),
    };
    let texts = [format!(" cell {place}: {what}{visits}"), format!(" {place}: {what}{visits}")]
        .map(Line::from);
    texts
        .into_iter()
        .find(|line| line.width() <= width)
        .unwrap_or_else(|| Line::from(format!(" {place}: {what}")))
}

/// Describes how many cells a dot of the map shows, if several, in a long and a short form.
fn scaled_down_texts(screen: &Screen, layout: &ScreenLayout) -> [String; 2] {
    let cells = layout.map.as_ref().map_or(0.0, |map| match screen.picture_character() {
        Some(character) => 1.0 / (map.scale() * f32::from(character.0)),
        None => map.raster.cells_per_pixel(),
    });
    let short = format!(", 1 dot = {cells:.1} cells");
    let key = screen.keymap.key_of(Action::ZoomIn);
    match cells > 1.01 {
        true if screen.on_paper => [short.clone(), short],
        true => [format!("{short} ({key} zooms in)"), short],
        false => Default::default(),
    }
}

/// Returns the legend: colours, overlays and signs.
pub fn legend_lines(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let mut lines = overlay_lines(maze.scale(screen, SHORT_BAR_WIDTH), offers, screen);
    lines.push(heading("signs"));
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let mut pairs = vec![
        [('G', theme.goal, "goal"), ('S', theme.walker, "start of @")],
        [('@', theme.walker, "walks to G"), ('s', theme.cursor, "g: map's own")],
    ];
    if screen.following.is_some() {
        pairs.push([('A', theme.agent, "followed agent"), ('\u{2691}', theme.agent, "its goal")]);
    }
    lines.extend(pairs.iter().map(|pair| signs(screen, pair)));
    if screen.run().method.plans() {
        let sizes =
            [' ', '\u{b7}', '\u{2022}', '\u{25cf}'].map(|sign| sample(screen, sign, theme.cursor));
        let of_sizes = sizes.into_iter().chain([Span::raw(" larger: more edges")]);
        lines.push(Line::from(of_sizes.collect::<Vec<_>>()));
    }
    if screen.run().method.bridges() {
        lines.push(sign(screen, FRONTIER_SIGN, theme.frontier, "frontier goals of agents"));
    }
    if maze.view.cut_off.contains(&true) {
        lines.push(sign(screen, '\\', theme.cursor, "hatched: no path to G"));
    }
    let trail = (if mono { TRAIL_MARK } else { '\u{2500}' }, theme.walker, "trail of @");
    let frontier = ('\u{2500}', theme.frontier, "frontier");
    let has_edge = !mono && !maze.view.exploration.is_complete(&maze.map);
    lines.push(signs(screen, &[trail, frontier][..=usize::from(has_edge)]));
    if screen.run().method.plans() {
        let graph = &maze.view.graph;
        let tried = graph.count(EdgeStatus::Confirmed) + graph.count(EdgeStatus::Demoted);
        let walked = if tried > MAX_EDGES { "walked, near cursor" } else { "edges walked" };
        lines.extend(edge_lines(screen, graph, [walked, "failed", "untried, not shown"]));
    }
    lines
}

/// Returns signs and their meanings beside each other.
fn signs(screen: &Screen, all: &[(char, Rgb, &str)]) -> Line<'static> {
    let mut line = Line::default();
    for (symbol, rgb, meaning) in all {
        let gap = if line.spans.is_empty() { " " } else { "  " };
        line.extend([
            Span::raw(gap),
            sample(screen, *symbol, *rgb),
            Span::raw(format!(" {meaning}")),
        ]);
    }
    line
}

/// Returns the lines about the followed agent, the walking one or an exploring one, with sentences
/// within `width` columns.
pub fn walk_lines(maze: &MazeState, screen: &Screen, width: usize) -> Vec<Line<'static>> {
    match screen.following {
        Some(_) => explorer(maze, screen),
        None => walker(maze, screen, width),
    }
}

fn format_position(at: &[f32]) -> String {
    format!("{:.1}, {:.1}", at[0], at[1])
}

fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1}") }
}

fn walker(maze: &MazeState, screen: &Screen, width: usize) -> Vec<Line<'static>> {
    let shown = &maze.view.walk;
    let has_path = shown.shortest.is_some();
    let shortest = shown.shortest.map_or("no path".to_owned(), |s| s.to_string());
    let state = if shown.arrived { "arrived" } else { "walking" };
    // There is no plan without a path, and none is left after arrival.
    let is_planned = has_path && !shown.arrived;
    let planned = |name, value: String| fact(name, if is_planned { value } else { "-".to_owned() });
    let mut lines = vec![
        fact("from S", format_position(&shown.start)),
        fact("to G", format_position(&maze.goal.centre())),
        fact(state, counted(u64::from(shown.steps), "step")),
        fact("shortest", shortest),
        fact(
            "D to goal",
            format_steps(shown.distances.0) + if has_path { "" } else { " (meaningless)" },
        ),
        planned(
            "waypoint",
            shown.waypoint.map_or("the goal".to_owned(), |at| format_position(&at)),
        ),
        planned("D to it", format_steps(shown.distances.1)),
    ];
    let plan = bridges(maze, width);
    if plan.is_empty() {
        lines.push(planned("ahead", ahead(maze.view.path.len())));
    }
    lines.extend(plan);
    lines.extend([
        heading("walks"),
        fact("arrived", format!("{} of {}", shown.finished_walks.0, shown.finished_walks.1)),
        fact("then", screen.on_arrival.name()),
    ]);
    lines.extend(legend::keys(screen));
    lines
}

/// Describes a plan of that many stops, the goal included.
fn ahead(stops: usize) -> String {
    match stops {
        0 => "actor alone".to_owned(),
        1 => "straight to G".to_owned(),
        _ => counted(stops as u64 - 1, "waypoint"),
    }
}

/// Says what bridges do for the plan of the walking agent, if there are any ahead, within `width`
/// columns.
fn bridges(maze: &MazeState, width: usize) -> Vec<Line<'static>> {
    let (bridges, walk) = (maze.view.path.len().saturating_sub(1), &maze.view.walk);
    if bridges == 0 || walk.arrived || walk.along.is_nan() {
        return Vec::new();
    }
    let (direct, along) = (walk.distances.0.round(), walk.along.round());
    let effect = if along < direct {
        format!("{:.0} steps shorter", direct - along)
    } else {
        "no shorter, but each hop is short enough to trust".to_owned()
    };
    let text = format!(
        "{}; direct D says {direct:.0}, along bridges {along:.0}: {effect}",
        counted(bridges as u64, "waypoint")
    );
    // A blank on either side.
    let columns = width.saturating_sub(2).max(MIN_TEXT_WIDTH);
    wrapped(&text, columns).into_iter().map(|row| Line::raw(format!(" {row}"))).collect()
}

fn explorer(maze: &MazeState, screen: &Screen) -> Vec<Line<'static>> {
    let Some(followed) = &screen.snapshot.followed else { return legend::no_agent(screen) };
    let mut lines = vec![
        fact("agent", format!("{} of {}", followed.agent, screen.snapshot.agents.len() / 2)),
        fact("from", format_position(&followed.start)),
        fact("at A", format_position(&followed.state)),
        fact("goal \u{2691}", format_position(&followed.goal)),
        fact("steps", format!("{} of {}", followed.steps.0, followed.steps.1)),
        fact("shortest", maze.view.followed_steps.map_or("no path".to_owned(), |s| s.to_string())),
    ];
    lines.extend(legend::pursuit(screen, followed, format_position, format_steps));
    lines
}
