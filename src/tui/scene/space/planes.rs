//! Draws planes in a space of goals, and an arm; the legend.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::Line;

use super::{SpaceState, space};
use crate::tui::canvas::{self, Canvas, Ink, draw_contours};
use crate::tui::choices::Overlay;
use crate::tui::layout::ScreenLayout;
use crate::tui::pane_text::heading;
use crate::tui::scene::ground::{self, Colours, GroundKind, Look};
use crate::tui::scene::legend::{contour_text, draw_scale, edge_lines, sign};
use crate::tui::scene::overlays::Painter;
use crate::tui::scene::{Drawing, SceneKind};
use crate::tui::screen::Screen;
use crate::tui::theme::{BOLD, ColourDepth, REVERSED, blend};
use crate::tui::viewport::{Angle, Projection, arrange};
use gdg::env::fetch_reach::{Corners, Pose};
use gdg::env::{ArmScene, GoalSpace, WorldScene};

/// Radii in metres: links (as the arm collides), joints and fingers.
const LINK_RADIUS: f32 = 0.026;
const JOINT_RADIUS: f32 = 0.016;
const FINGER_RADIUS: f32 = 0.007;

const CORNERS: usize = 120;

/// What is within this part of the picture of a place that agents have visited counts as visited.
const NEAR: f32 = 24.0;

/// Draws the space into the first area, and the line below it into the second.
pub fn draw([area, info]: [Rect; 2], state: &SpaceState, mut on: Drawing) {
    let Drawing { frame, screen, layout, .. } = &mut on;
    let (mut title, marker) = (None, screen.marker.at(screen.theme.depth));
    match &screen.snapshot.scene {
        WorldScene::Arm(_) => layout.projections = arrange(area, &state.shown, marker),
        WorldScene::Goals(space) => {
            let parts = Layout::vertical([Constraint::Length(1), Constraint::Fill(1)]);
            let [name, area] = parts.areas(area);
            let (spec, count) = (space.spec(), space.spec().goal_dim());
            let axes = state.axes(count);
            let ranges = axes.map(|axis| state.range(axis, space));
            let to_scale = spec.position_scale.is_some() && axes[0] != axes[1];
            let shown = Projection::of_components(area, (axes, count), ranges, to_scale, marker);
            title = shown.as_ref().map(|shown| (name, slice_title(shown, axes, state, space)));
            layout.projections = shown.into_iter().collect();
        }
        // A run in a maze has begun, which is drawn from the next frame on.
        WorldScene::Maze(_) => return,
    }
    layout.contour_interval = contour_interval(state, screen);
    for projection in &layout.projections {
        draw_projection(frame, projection, state, screen, layout);
    }
    if let Some((name, title)) = title {
        frame.render_widget(title, name);
    }
    let texts = [contour_text(screen, layout), String::new()];
    draw_scale(info, state, on, &texts);
}

fn shows_field(state: &SpaceState, screen: &Screen) -> bool {
    state.past().is_some() || state.view.kind == screen.field
}

/// Returns the steps between two contour lines, the same in all projections, if there are any.
fn contour_interval(state: &SpaceState, screen: &Screen) -> Option<f32> {
    let view = &state.view;
    let shown = state.shown_field(screen).is_distance()
        && shows_field(state, screen)
        && screen.overlays.has(Overlay::Contours);
    let fields = view.fields.iter().zip(view.planes.iter());
    let fields: Vec<_> = fields.map(|(field, plane)| (&**field, plane.raster.pixels.0)).collect();
    canvas::contour_interval(&fields, false, None).filter(|_| shown)
}

fn draw_projection(
    frame: &mut Frame,
    projection: &Projection,
    state: &SpaceState,
    screen: &Screen,
    layout: &ScreenLayout,
) {
    let (plane, view, theme) = (&projection.plane, &state.view, screen.theme);
    let (scene, count) = (&screen.snapshot.scene, plane.across.len());
    let place = |at: &[f32]| (at.len() >= count).then(|| plane.flat(&at[..count]));
    let at_state = |at: &[f32]| match scene {
        WorldScene::Goals(space) => {
            let place = || space.spec().achieved(at).collect::<Vec<_>>();
            (at.len() == space.spec().state_dim()).then(|| plane.flat(&place()))
        }
        _ => place(at),
    };
    let agents = screen.run().settings.train.agents.max(1);
    let sizes = [count, screen.snapshot.agents.len() / agents];
    let canvas = Canvas::new(&projection.frame, None);
    let mut painter = Painter { canvas, screen, theme, place: &place, state: &at_state, sizes };
    draw_field(&mut painter, projection, state, layout);
    let (past, goal) = (state.past(), place(&state.shown_goal()));
    if let WorldScene::Arm(arm) = scene {
        draw_surroundings(&mut painter, *arm);
    }
    if past.is_none() {
        painter.edges(&view.graph, true);
        painter.candidates(&view.graph);
        painter.search(<[_]>::to_vec);
    }
    painter.explorers(past, f32::INFINITY, 0.0);
    let reach = &view.reach;
    if past.is_none() {
        if reach.path.len() > 1 {
            let stops = painter.places(&reach.path);
            let way = painter.places(&reach.way);
            painter.plan(&way, &stops[..stops.len().saturating_sub(1)]);
        }
        let trail = painter.places([&reach.start].into_iter().chain(&reach.trail));
        painter.own_trail(&trail, f32::INFINITY);
        if let Some(pose) = &view.pose {
            draw_skeleton(&mut painter, pose);
        }
    }
    let radius = match scene {
        WorldScene::Arm(arm) => arm.goal_radius(),
        _ => space(screen).map_or(0.0, |space| space.spec().goal_radius),
    };
    if let Some([x, y]) = goal {
        let corner = |n: usize| {
            let (sin, cos) = (std::f32::consts::TAU * n as f32 / CORNERS as f32).sin_cos();
            [x + radius * cos, y + plane.stretch * radius * sin]
        };
        let outline: Vec<[f32; 2]> = (0..=CORNERS).map(corner).collect();
        painter.canvas.line(&outline, 0.0, Ink::new(theme.goal, 1.0, '*'));
    }
    painter.letter(goal, 'G', theme.goal, 0.45);
    if past.is_none() {
        painter.letter(place(&reach.at), '@', theme.walker, 0.42);
    }
    painter.canvas.paint(frame.buffer_mut(), &theme);
    painter.canvas.paint_signs(frame.buffer_mut(), &theme);
    if let Some(angle) = projection.angle {
        let area = projection.frame.area;
        let chosen = layout.projections.len() > 1 && angle == state.shown.angle;
        let style = if chosen { BOLD.patch(REVERSED) } else { BOLD };
        let style = style.fg(theme.colour(theme.cursor)).bg(theme.colour(theme.unknown));
        let name = Line::styled(format!(" {} ", angle_title(angle, state)), style);
        let width = (name.width() as u16).min(area.width);
        frame.render_widget(name, Rect { width, height: 1, ..area });
    }
}

/// Returns the name of a projection and the coordinate of the coloured plane, or the direction.
fn angle_title(angle: Angle, state: &SpaceState) -> String {
    let degrees = |rad: f32| (rad.to_degrees().round() as i32).rem_euclid(360);
    let at = |i: usize| state.shown_goal().get(i).map_or(0.0, |metres| 100.0 * metres);
    let name = angle.name();
    match angle {
        Angle::Side => format!("{name} at y {:.0} cm", at(1)),
        Angle::Front => format!("{name} at x {:.0} cm", at(0)),
        Angle::Top => format!("{name} at z {:.0} cm", at(2)),
        Angle::Free => {
            let orbit = state.shown.orbit;
            format!("{name} {}\u{b0} {}\u{b0}", degrees(orbit.yaw), degrees(orbit.pitch))
        }
    }
}

fn slice_title(
    shown: &Projection,
    [across, up]: [usize; 2],
    state: &SpaceState,
    space: &GoalSpace,
) -> Line<'static> {
    let [left, top, width, height] = shown.plane.raster.window;
    let range = |low: f32, high: f32| format!("{} to {}", short(low), short(high));
    let mut text = format!(" {}\u{2192} {}", space.name(across), range(left, left + width));
    if across != up {
        let [low, high] = [-(top + height), -top].map(|at| at / shown.plane.stretch);
        text += &format!("  {}\u{2191} {}", space.name(up), range(low, high));
    }
    for (i, value) in state.goal.iter().enumerate().filter(|(i, _)| ![across, up].contains(i)) {
        text += &format!("  {} {}", space.name(i), short(*value));
    }
    Line::styled(text, BOLD)
}

/// Draws the values on the plane, with contour lines and their labels, and the walls of a maze.
fn draw_field(
    painter: &mut Painter,
    projection: &Projection,
    state: &SpaceState,
    layout: &ScreenLayout,
) {
    let (view, screen, plane) = (&state.view, painter.screen, &projection.plane);
    let columns = plane.raster.pixels.0;
    let found = view.planes.iter().position(|own| own == plane).map(|n| &view.fields[n]);
    let field = found.filter(|_| shows_field(state, screen)).map(|field| (&**field, columns));
    let (theme, farthest) = (painter.theme, state.own_farthest());
    let colours = Colours { theme: &theme, field: state.shown_field(screen), farthest };
    let (scene, near) = (&screen.snapshot.scene, vec![0.0; plane.across.len()]);
    let visited = visited(painter, state);
    let looks = |y: usize, looks: &mut [Look]| {
        for (x, look) in looks.iter_mut().enumerate() {
            let is_wall = matches!(scene, WorldScene::Goals(_))
                && !plane.is_open(y * columns + x, &near, scene);
            let kind =
                [GroundKind::Beyond, GroundKind::Plain][usize::from(visited[y * columns + x])];
            *look = Look { kind, ..Look::plain(f32::from(u8::from(is_wall))) };
        }
    };
    ground::draw(&mut painter.canvas, field, &colours, looks, |_, _| false);
    if let (Some((field, _)), Some(interval)) = (field, layout.contour_interval) {
        let known = |(value, visited): (&f32, &bool)| if *visited { *value } else { f32::NAN };
        let field: Vec<f32> = field.iter().zip(&visited).map(known).collect();
        draw_contours(&mut painter.canvas, (&field, columns), interval, &theme);
    }
}

/// Returns which pixels show places near bridge candidates: agents have been there. All do where nothing is
/// known of that, or it is not to be shown.
fn visited(painter: &Painter, state: &SpaceState) -> Vec<bool> {
    let ((columns, rows), known) = (painter.canvas.raster.pixels, &state.view.graph.candidates);
    let is_hidden = state.is_arm || !painter.shows(Overlay::Unexplored);
    let mut visited = vec![is_hidden || known.is_empty(); columns * rows];
    let reach = columns.max(rows) as f32 / NEAR;
    let end = |at: f32, all: usize| (at.max(0.0) as usize).min(all);
    for at in known.iter().filter_map(|candidate| (painter.place)(&candidate.at)) {
        let [x, y] = painter.canvas.pixel(at);
        for first in (end(y - reach, rows)..end(y + reach, rows)).map(|row| row * columns) {
            visited[first + end(x - reach, columns)..first + end(x + reach, columns)].fill(true);
        }
    }
    visited
}

fn draw_box(painter: &mut Painter, corners: Corners, ink: Ink) {
    let corner = |n: usize| (painter.place)(&[0, 1, 2].map(|i| corners[n >> i & 1][i]));
    let pairs = (0..8).flat_map(|n| (0..3).map(move |i| (n, n | 1 << i))).filter(|(a, b)| a != b);
    let edges: Vec<_> = pairs.filter_map(|(a, b)| Some([corner(a)?, corner(b)?])).collect();
    painter.canvas.lines(edges, 0.0, ink);
}

fn draw_surroundings(painter: &mut Painter, arm: ArmScene) {
    let theme = painter.theme;
    let table = Ink::new(blend(theme.wall, theme.cursor, 0.3), 1.0, '=');
    draw_box(painter, arm.table(), table);
    draw_box(painter, arm.goals(), Ink::new(theme.frontier, 0.5, '.'));
}

fn draw_skeleton(painter: &mut Painter, pose: &Pose) {
    let theme = painter.theme;
    let link = blend(theme.cursor, theme.unknown, 0.3);
    let mut rod = |ends: [[f32; 3]; 2], radius: f32, ink: Ink| {
        let ends = ends.map(|end| (painter.place)(&end).unwrap_or_default());
        let width = painter.canvas.heights(2.0 * radius);
        painter.canvas.lines([ends], width, ink);
    };
    for (i, ends) in pose.links().enumerate() {
        let share = if i == 0 { 0.5 } else { 0.0 };
        // Thinner towards the hand.
        let radius = LINK_RADIUS * (1.2 - 0.07 * i as f32);
        rod(ends, radius, Ink::new(blend(link, theme.unknown, share), 1.0, '#'));
    }
    pose.joints.iter().for_each(|at| rod([*at; 2], JOINT_RADIUS, Ink::new(theme.walker, 1.0, 'O')));
    let finger = Ink::new(theme.walker, 1.0, 'v');
    pose.fingers.iter().for_each(|ends| rod(*ends, FINGER_RADIUS, finger));
}

pub fn legend(state: &SpaceState, screen: &Screen) -> Vec<Line<'static>> {
    let (theme, mono) = (&screen.theme, screen.theme.depth == ColourDepth::Mono);
    let mut lines = Vec::new();
    let of_depth = |of_mono: char, other: char| if mono { of_mono } else { other };
    match &screen.snapshot.scene {
        WorldScene::Arm(_) => {
            let table = blend(theme.wall, theme.cursor, 0.3);
            let signs = [
                ('G', theme.goal, "goal, and 5 cm around it"),
                ('@', theme.walker, "grip of the arm"),
                (of_depth('O', '\u{25cf}'), theme.walker, "joints"),
                (of_depth('.', '\u{2500}'), theme.frontier, "region of goals"),
                (of_depth('=', '\u{2500}'), table, "edge of the table"),
            ];
            lines.extend(signs.map(|(symbol, rgb, meaning)| sign(screen, symbol, rgb, meaning)));
        }
        WorldScene::Goals(space) => {
            let text = format!("goal, and {} around it", short(space.spec().goal_radius));
            lines.push(sign(screen, 'G', theme.goal, &text));
            lines.push(sign(screen, '@', theme.walker, "agent that reaches for it"));
        }
        WorldScene::Maze(_) => {}
    }
    if screen.run().method.plans() {
        lines.push(heading("edges"));
        lines.extend(edge_lines(screen, &state.view.graph, ["walked", "failed", "untried"]));
    }
    lines
}

/// Formats a value with three significant digits.
pub fn short(value: f32) -> String {
    let digits = match value.abs() {
        100.0.. => 0,
        10.0.. => 1,
        _ => 2,
    };
    format!("{value:.digits$}")
}
