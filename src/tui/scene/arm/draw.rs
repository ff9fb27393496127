//! One projection of the arm and what is around it.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::Line;

use super::shapes::{Sketch, edges};
use super::{ArmState, shown_goal, shows_field};
use crate::tui::canvas::{CANDIDATE_MARK, Canvas, Pen, shade};
use crate::tui::contours::{self, Label};
use crate::tui::glyphs::Glyphs;
use crate::tui::layers::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::projection::{Angle, Projection};
use crate::tui::screen::Screen;
use crate::tui::style::{BOLD, REVERSED};
use crate::tui::theme::{ColourDepth, Rgb, Theme, blend};
use gdg::bridge::EdgeStatus;
use gdg::env::ArmScene;

/// Radii in metres: links (as the arm collides), joints, fingers, waypoints and explorers.
const LINK_RADIUS: f32 = 0.026;
const JOINT_RADIUS: f32 = 0.016;
const FINGER_RADIUS: f32 = 0.007;
const DOT_RADIUS: f32 = 0.008;

/// The most bridge candidates drawn.
const MOST_CANDIDATES: usize = 120;

/// Draws one projection of `layout`; its name is highlighted if it is the chosen one of several.
pub fn draw(
    frame: &mut Frame,
    projection: &Projection,
    scene: &ArmScene,
    arm: &ArmState,
    screen: &Screen,
    layout: &ScreenLayout,
) {
    let mut sketch = Sketch::new(projection);
    let labels = draw_field(&mut sketch, layout.contour_interval, arm, screen);
    let under = |label: &Label, canvas: &Canvas| {
        label.pixels(&projection.frame).map(|i| canvas.colour(i)).collect::<Vec<_>>()
    };
    let labels: Vec<_> =
        labels.into_iter().map(|label| (under(&label, &sketch.canvas), label)).collect();
    draw_surroundings(&mut sketch, scene, &screen.theme);
    if arm.past().is_none() {
        draw_graph(&mut sketch, arm, screen);
    }
    draw_explorers(&mut sketch, arm, screen);
    if arm.past().is_none() {
        draw_plan(&mut sketch, arm, screen);
        draw_arm(&mut sketch, arm, &screen.theme);
    }
    sketch.circle(shown_goal(arm), scene.goal_radius(), screen.theme.goal, '*');
    sketch.canvas.paint(frame.buffer_mut(), &projection.frame, &screen.theme);
    let mut glyphs =
        Glyphs { map_frame: &projection.frame, theme: &screen.theme, buffer: frame.buffer_mut() };
    // Only where nothing else has been drawn since.
    let free = labels.iter().filter(|(before, label)| under(label, &sketch.canvas) == *before);
    free.for_each(|(_, label)| glyphs.label(label));
    draw_symbols(frame, projection, arm, screen);
    let area = projection.frame.area;
    let chosen = layout.projections.len() > 1 && projection.angle == arm.shown.angle;
    let style = if chosen { BOLD.patch(REVERSED) } else { BOLD };
    let style = style
        .fg(screen.theme.colour(screen.theme.cursor))
        .bg(screen.theme.colour(screen.theme.unknown));
    let name = Line::styled(format!(" {} ", title(projection.angle, arm)), style);
    let width = (name.width() as u16).min(area.width);
    frame.render_widget(name, Rect { width, height: 1, ..area });
}

/// Returns the name of a projection and the coordinate of the coloured plane, or the direction.
fn title(angle: Angle, arm: &ArmState) -> String {
    let degrees = |rad: f32| (rad.to_degrees().round() as i32).rem_euclid(360);
    let [x, y, z] = shown_goal(arm).map(|metres| format!("{:.0} cm", 100.0 * metres));
    let name = angle.name();
    match angle {
        Angle::Side => format!("{name} at y {y}"),
        Angle::Front => format!("{name} at x {x}"),
        Angle::Top => format!("{name} at z {z}"),
        Angle::Free => {
            let orbit = arm.shown.orbit;
            format!("{name} {}\u{b0} {}\u{b0}", degrees(orbit.yaw), degrees(orbit.pitch))
        }
    }
}

/// Draws D on the plane through the goal, with contour lines; returns their labels.
fn draw_field(
    sketch: &mut Sketch,
    contour_interval: Option<f32>,
    arm: &ArmState,
    screen: &Screen,
) -> Vec<Label> {
    let (theme, view, canvas) = (&screen.theme, &arm.view, &mut sketch.canvas);
    (0..canvas.len()).for_each(|i| canvas.set(i, Some(theme.unknown), ' '));
    let field = view
        .planes
        .iter()
        .position(|plane| *plane == sketch.projection.plane)
        .map(|n| &view.fields[n]);
    let Some(field) = field.filter(|_| shows_field(arm, screen)) else { return Vec::new() };
    let (farthest, mono) = (arm.farthest(screen), theme.depth == ColourDepth::Mono);
    for (i, value) in field.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let share = value / farthest;
        canvas.set(i, Some(theme.distance_colour(share)), if mono { shade(share) } else { ' ' });
    }
    let Some(interval) = contour_interval else { return Vec::new() };
    let frame = &sketch.projection.frame;
    let goal = frame.raster.pixel_of(sketch.projection.flat(shown_goal(arm))).unwrap_or_default();
    let mut labels = contours::draw(canvas, frame, field, interval, goal, theme);
    // The first row has the projection's name.
    labels.retain(|label| label.area.y > frame.area.y);
    labels
}

/// Draws the table's edges, the region of goals and the wall.
fn draw_surroundings(sketch: &mut Sketch, scene: &ArmScene, theme: &Theme) {
    sketch.lines(
        edges(scene.table()),
        Pen { rgb: blend(theme.wall, theme.cursor, 0.3), share: 1.0, mark: '=' },
    );
    sketch.lines(edges(scene.goals()), Pen { rgb: theme.frontier, share: 0.5, mark: '.' });
    if let Some(wall) = scene.wall() {
        sketch.lines(edges(wall), Pen { rgb: theme.edges[1], share: 0.9, mark: '#' });
    }
}

/// Draws the bridge graph and its latest search.
fn draw_graph(sketch: &mut Sketch, arm: &ArmState, screen: &Screen) {
    let (theme, view) = (&screen.theme, &arm.view);
    if screen.overlays.has(Overlay::Edges) {
        let kinds = [
            (EdgeStatus::Untried, 2, 0.3, '-'),
            (EdgeStatus::Confirmed, 0, 0.6, '='),
            (EdgeStatus::Demoted, 1, 0.9, 'x'),
        ];
        for (kind, colour, share, mark) in kinds {
            let own =
                view.edges.iter().filter(|(_, status)| *status == kind).map(|(ends, _)| *ends);
            sketch.lines(own, Pen { rgb: theme.edges[colour], share, mark });
        }
    }
    if screen.overlays.has(Overlay::Candidates) {
        // Draw only some of them: all together would hide the arm.
        let apart = view.candidates.len().div_ceil(MOST_CANDIDATES).max(1);
        for candidate in view.candidates.iter().step_by(apart) {
            let at = sketch.projection.flat(candidate.at);
            sketch.canvas.faint_dot(
                &sketch.projection.frame,
                at,
                theme.cursor,
                0.25 + 0.4 * candidate.degree,
                Some(CANDIDATE_MARK),
            );
        }
    }
    if let (true, Some(search)) = (screen.overlays.has(Overlay::Search), &screen.snapshot.search) {
        let [accepted, rejected] = theme.search;
        positions(&search.rejected, 3).for_each(|at| sketch.ball(at, DOT_RADIUS, rejected, 'x'));
        if let Some(bridge) = &search.found {
            let stops =
                [&search.state, &bridge.point, &search.goal].map(|numbers| position(numbers));
            sketch.lines(
                stops.windows(2).map(|ends| [ends[0], ends[1]]),
                Pen { rgb: accepted, share: 0.9, mark: '=' },
            );
            sketch.ball(stops[1], DOT_RADIUS, accepted, 'B');
        }
    }
}

/// Draws the grips of exploring agents, and their trails.
fn draw_explorers(sketch: &mut Sketch, arm: &ArmState, screen: &Screen) {
    let (snapshot, rgb) = (&screen.snapshot, screen.theme.frontier);
    if !screen.overlays.has(Overlay::Agents) {
        return;
    }
    if let Some(past) = arm.past() {
        return positions(&past.agents, 3).for_each(|at| sketch.ball(at, DOT_RADIUS, rgb, 'o'));
    }
    let agents = screen.run().settings.train.agents.max(1);
    let size = (snapshot.agents.len() / agents).max(1);
    for trail in snapshot.trails.iter() {
        let stops: Vec<[f32; 3]> = positions(trail, size).collect();
        sketch.lines(
            stops.windows(2).map(|ends| [ends[0], ends[1]]),
            Pen { rgb, share: 0.4, mark: '.' },
        );
    }
    positions(&snapshot.agents, size).for_each(|at| sketch.ball(at, DOT_RADIUS, rgb, 'o'));
}

/// Draws the waypoints ahead, and where the grip has been.
fn draw_plan(sketch: &mut Sketch, arm: &ArmState, screen: &Screen) {
    let (theme, view) = (&screen.theme, &arm.view);
    let reach = &view.reach;
    if screen.overlays.has(Overlay::Path) && reach.path.len() > 1 {
        let path = reach.path.iter().map(|at| position(at));
        let stops: Vec<[f32; 3]> = std::iter::once(view.pose.grip).chain(path).collect();
        sketch.lines(
            stops.windows(2).map(|ends| [ends[0], ends[1]]),
            Pen { rgb: theme.path, share: 1.0, mark: '+' },
        );
        let between = &stops[1..stops.len() - 1];
        between.iter().for_each(|at| sketch.ball(*at, DOT_RADIUS, theme.path, '+'));
    }
    let trail: Vec<[f32; 3]> =
        std::iter::once(&reach.start).chain(&reach.trail).map(|at| position(at)).collect();
    sketch.lines(
        trail.windows(2).map(|ends| [ends[0], ends[1]]),
        Pen { rgb: theme.walker, share: 0.7, mark: ',' },
    );
}

/// Draws the arm itself.
fn draw_arm(sketch: &mut Sketch, arm: &ArmState, theme: &Theme) {
    let pose = &arm.view.pose;
    if pose.grip == [0.0; 3] {
        // The viewer has not published anything yet.
        return;
    }
    let link: Rgb = blend(theme.cursor, theme.unknown, 0.3);
    for (i, ends) in pose.links().enumerate() {
        let share = if i == 0 { 0.5 } else { 0.0 };
        // Thinner towards the hand.
        let radius = LINK_RADIUS * (1.2 - 0.07 * i as f32);
        sketch.rod(ends, radius, blend(link, theme.unknown, share), '#');
    }
    pose.joints.iter().for_each(|at| sketch.ball(*at, JOINT_RADIUS, theme.walker, 'O'));
    pose.fingers.iter().for_each(|finger| sketch.rod(*finger, FINGER_RADIUS, theme.walker, 'v'));
}

fn draw_symbols(frame: &mut Frame, projection: &Projection, arm: &ArmState, screen: &Screen) {
    let (theme, view) = (&screen.theme, &arm.view);
    let mut glyphs = Glyphs { map_frame: &projection.frame, theme, buffer: frame.buffer_mut() };
    let is_past = arm.past().is_some();
    if let Some(followed) = screen.snapshot.followed.as_ref().filter(|_| !is_past) {
        glyphs.symbol(projection.flat(position(&followed.goal)), '\u{2691}', Some(theme.frontier));
        glyphs.letter(projection.flat(position(&followed.state)), 'A', theme.frontier);
    }
    glyphs.letter(projection.flat(shown_goal(arm)), 'G', theme.goal);
    if view.pose.grip != [0.0; 3] && !is_past {
        glyphs.letter(projection.flat(view.pose.grip), '@', theme.walker);
    }
}

/// Returns the first three numbers of a goal or a state.
fn position(numbers: &[f32]) -> [f32; 3] {
    std::array::from_fn(|i| numbers.get(i).copied().unwrap_or_default())
}

/// Returns the positions of states or goals of `size` numbers.
fn positions(numbers: &[f32], size: usize) -> impl Iterator<Item = [f32; 3]> {
    numbers.chunks_exact(size).map(position)
}
