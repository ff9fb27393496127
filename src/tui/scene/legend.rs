//! The parts of legends and of panes about a followed agent that all scenes share, and the scale of
//! the colours.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::ground::MAX_SHOWN_ERROR;
use crate::tui::action::Action;
use crate::tui::canvas::SHADES;
use crate::tui::characters::{CANDIDATE_MARK, UNVISITED_MARK};
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::screen::Screen;
use crate::tui::style::DIM;
use crate::tui::text::{fact, fitted_line, heading, short};
use crate::tui::theme::{ColourDepth, Rgb, Theme};
use gdg::bridge::EdgeStatus;
use gdg::engine::FollowedAgent;
use gdg::text::counted;
use gdg::viewer::{Field, Graph, Reach};

/// Width of the colour bar in characters, and its width where room is short.
pub const BAR_WIDTH: usize = 12;
pub const SHORT_BAR_WIDTH: usize = 5;

/// Returns the scale of a field's colours with the values at its ends, up to `farthest`, and a bar
/// of `bar` characters; `None` for a field that has no colours.
pub fn scale(theme: &Theme, field: Field, farthest: f32, bar: usize) -> Option<Line<'static>> {
    let name = Span::raw(format!(" {} ", field.name()));
    let (low, high) = match field {
        Field::Plain => return None,
        Field::Error => {
            let most = 100.0 * MAX_SHOWN_ERROR;
            (format!("-{most:.0} % short"), format!("+{most:.0} % long"))
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
    Some(line)
}

/// Draws the line below a scene: the scale, with the first of `texts` and the longest bar that fit.
pub fn draw_scale(
    frame: &mut Frame,
    area: Rect,
    scale: impl Fn(usize) -> Line<'static>,
    texts: &[String],
) {
    let bars = || (SHORT_BAR_WIDTH..=BAR_WIDTH).rev();
    let options = texts.iter().flat_map(|text| bars().map(move |bar| (text, bar)));
    let mut lines = options.map(|(text, bar)| {
        let mut line = scale(bar);
        // Without a bar, a blank ends the line.
        let text =
            if line.to_string().ends_with(' ') { text.trim_start_matches(", ") } else { text };
        line.push_span(Span::styled(text.to_owned(), DIM));
        line
    });
    let line = lines.find(|line| line.width() <= usize::from(area.width));
    let line = line.unwrap_or_else(|| scale(SHORT_BAR_WIDTH));
    frame.render_widget(Paragraph::new(fitted_line(line, area.width)), area);
}

pub fn overlays(offers: impl Fn(Action) -> bool) -> impl Iterator<Item = Overlay> {
    Overlay::ALL.into_iter().filter(move |overlay| offers(Action::Toggle(*overlay)))
}

/// Returns the colour scale, and a line for each available overlay with its sign.
pub fn overlay_lines(
    scale: Line<'static>,
    offers: impl Fn(Action) -> bool,
    screen: &Screen,
) -> Vec<Line<'static>> {
    let mut lines = vec![scale, heading("toggle by key or click")];
    for overlay in overlays(offers) {
        let key = screen.keymap.key_of(Action::Toggle(overlay));
        let shown = screen.overlays.has(overlay);
        let mut line = Line::from(vec![
            Span::raw(format!(" {key:<2}")),
            Span::raw(if shown { "[x] " } else { "[ ] " }),
        ]);
        line.push_span(Span::styled(overlay.name(), if shown { Style::new() } else { DIM }));
        if let Some((sign, rgb)) = sign_of(overlay, screen) {
            line.extend([Span::raw(" "), sample(screen, sign, rgb)]);
        }
        lines.push(line);
    }
    lines
}

/// Returns the numbers of walked, failed and untried edges, each followed by its text in
/// `meanings`.
pub fn edge_lines(
    screen: &Screen,
    graph: &Graph,
    meanings: [&'static str; 3],
) -> impl Iterator<Item = Line<'static>> {
    let kinds =
        [EdgeStatus::Confirmed, EdgeStatus::Demoted, EdgeStatus::Untried].into_iter().zip(meanings);
    kinds.zip(screen.theme.edges).map(move |((status, name), rgb)| {
        sign(screen, '\u{2500}', rgb, &format!("{} {name}", graph.count(status)))
    })
}

pub fn sign(screen: &Screen, sign: char, rgb: Rgb, meaning: &str) -> Line<'static> {
    Line::from(vec![Span::raw(" "), sample(screen, sign, rgb), Span::raw(format!(" {meaning}"))])
}

pub fn sample(screen: &Screen, sign: char, rgb: Rgb) -> Span<'static> {
    let Theme { page, wall, .. } = &screen.theme;
    let style = Style::new().fg(screen.theme.colour(rgb));
    // Use the map's wall colour as a ground, since it is darker than a light page.
    let is_faint = page.is_some_and(|(_, ground)| distance(rgb, ground) < FAINT);
    Span::styled(
        sign.to_string(),
        if is_faint { style.bg(screen.theme.colour(*wall)) } else { style },
    )
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
        Overlay::Directions => ('\u{2192}', theme.cursor),
        Overlay::Unexplored => (of_depth(UNVISITED_MARK, '\u{2592}'), theme.frontier),
        Overlay::Agents => (of_depth('o', '\u{25a0}'), theme.agent),
        Overlay::Candidates => (CANDIDATE_MARK, theme.cursor),
        Overlay::Edges => ('\u{2500}', theme.edges[0]),
        Overlay::Search => ('B', theme.search[0]),
        Overlay::Path => (of_depth('+', '\u{25a0}'), theme.path),
    })
}

/// Describes the contour interval, if contour lines are shown.
pub fn contour_text(screen: &Screen, layout: &ScreenLayout) -> String {
    let interval = layout.contour_interval.filter(|_| screen.theme.depth != ColourDepth::Mono);
    interval.map_or_else(String::new, |interval| format!(", a line every {interval:.0}"))
}

/// The meanings of the numbers, by their names in the pane.
pub const MEANINGS: &[(&str, &str)] = &[
    ("from S", "where this walk began"),
    ("to G", "where it leads: the goal"),
    ("walking", "steps taken on this walk so far"),
    ("arrived", "steps it took; below: walks that arrived"),
    ("shortest", "true steps from the start to the goal"),
    ("D to goal", "steps left, as learned"),
    ("waypoint", "what the agent heads for next"),
    ("target", "what the agent heads for"),
    ("D to it", "steps to that, as learned"),
    ("ahead", "waypoints of the plan still to come"),
    ("then", "what happens when the agent arrives"),
    ("path", "whether it follows a plan"),
];

/// Returns the keys that change what the walking agent does.
pub fn keys(screen: &Screen) -> [Line<'static>; 4] {
    let key = |action| screen.keymap.key_of(action);
    [
        Line::default(),
        Line::from(format!(" {} or click: new goal", key(Action::NewGoal))),
        Line::from(format!(" {} or right-click: new start", key(Action::NewStart))),
        Line::from(format!(" {}: follow an explorer", key(Action::Follow))),
    ]
}

/// Returns what is shown of a followed agent that is not there.
pub fn no_agent(screen: &Screen) -> Vec<Line<'static>> {
    if screen.snapshot.data.is_none() {
        return vec![fact("agent", "...")];
    }
    vec![fact("agents", "do not act:"), Line::from(" the run learns from data")]
}

/// Returns what an exploring agent pursues, with places and distances in the scene's format.
pub fn pursuit(
    screen: &Screen,
    followed: &FollowedAgent,
    format_place: impl Fn(&[f32]) -> String,
    format_steps: impl Fn(f32) -> String,
) -> [Line<'static>; 6] {
    let aim = if followed.aim == followed.goal {
        "the goal".to_owned()
    } else {
        format_place(&followed.aim)
    };
    [
        fact("D to goal", format_steps(followed.distances.1)),
        fact("target", aim),
        fact("D to it", format_steps(followed.distances.0)),
        fact("path", if followed.planned { "through bridges" } else { "actor alone" }),
        Line::default(),
        Line::from(format!(
            " {}: next, {}: back to @",
            screen.keymap.key_of(Action::Follow),
            screen.keymap.key_of(Action::Close)
        )),
    ]
}

pub fn format_steps(distance: f32) -> String {
    if distance.is_nan() { "-".to_owned() } else { format!("{distance:.1} steps") }
}

/// Returns how an agent that reaches for the goal gets on, with places and straight lines in the
/// scene's format. It gives up after `most` steps, if that is known.
pub fn progress(
    screen: &Screen,
    reach: &Reach,
    most: Option<u32>,
    format_place: impl Fn(&[f32]) -> String,
    format_length: impl Fn(f32) -> String,
) -> Vec<Line<'static>> {
    let state = if reach.arrived { "arrived" } else { "reaching" };
    let most = most.filter(|_| !reach.arrived).map_or(String::new(), |most| format!(" of {most}"));
    let mut lines = vec![
        fact(state, format!("{} steps{most}", reach.steps)),
        fact("left", format_length(reach.left)),
        fact("D to goal", format_steps(reach.distances.0)),
    ];
    if screen.run().method.plans() {
        lines.extend([
            fact("waypoint", reach.waypoint.as_deref().map_or("the goal".to_owned(), format_place)),
            fact("D to it", format_steps(reach.distances.1)),
            fact("ahead", counted(reach.path.len().saturating_sub(1) as u64, "waypoint")),
        ]);
    }
    lines.extend([
        heading("reaches"),
        fact("arrived", format!("{} of {}", reach.finished.0, reach.finished.1)),
        fact("then", screen.on_arrival.name()),
    ]);
    lines.extend(keys(screen));
    lines
}
