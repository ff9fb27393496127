//! Spaces of goals: worlds that the program knows nothing about.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;

use super::*;
use crate::tui::action::Action;
use crate::tui::panes::Pane;
use gdg::bridge::EdgeStatus;
use gdg::env::{EnvError, Environment, PointMaze, Spec};
use gdg::train::DataSource;
use gdg::viewer::{Candidate, Graph, Plane, Reach, View};

/// A maze that does not say that it is one, with a third number in its goals: the sum of the others.
struct Unknown {
    maze: PointMaze,
    spec: Spec,
    states: Vec<f32>,
}

impl Unknown {
    fn new(maze: PointMaze) -> Self {
        let mut spec = maze.spec().clone();
        spec.state_centre.push(spec.state_centre.iter().sum());
        spec.state_half_range.push(spec.state_half_range.iter().sum());
        (spec.change_scale, spec.achieved) = (vec![1.0; 3], vec![0, 1, 2]);
        let mut world = Self { maze, spec, states: Vec::new() };
        world.observe();
        world
    }

    fn observe(&mut self) {
        let sum = |at: &[f32]| [at[0], at[1], at[0] + at[1]];
        self.states = self.maze.states().chunks_exact(2).flat_map(sum).collect();
    }
}

impl Environment for Unknown {
    fn kind(&self) -> &'static str {
        "unknown"
    }

    fn spec(&self) -> &Spec {
        &self.spec
    }

    fn states(&self) -> &[f32] {
        &self.states
    }

    fn restart(&mut self, agent: usize, rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.maze.restart(agent, rng);
        self.observe();
        Ok(())
    }

    fn sample_goal(&self, agent: usize, rng: &mut ChaCha8Rng, goal: &mut [f32]) {
        self.maze.sample_goal(agent, rng, &mut goal[..2]);
        goal[2] = goal[0] + goal[1];
    }

    fn step(&mut self, actions: &[f32], rng: &mut ChaCha8Rng) -> Result<(), EnvError> {
        self.maze.step(actions, rng);
        self.observe();
        Ok(())
    }

    fn fork(&self, agents: usize) -> Result<Box<dyn Environment>, EnvError> {
        let maze = PointMaze::new(self.maze.map().clone(), agents);
        Ok(Box::new(Self::new(maze)))
    }
}

fn world() -> Unknown {
    Unknown::new(PointMaze::new(Arc::new(rooms()), 0))
}

/// Returns an app that does not train, with a made-up view, drawn at the given size.
pub(super) fn staged_app(width: u16, height: u16) -> Still {
    let mut app = still_in(&world(), Method::default());
    draw(&mut app, width, height);
    let place = |x: f32, y: f32| vec![x, y, x + y];
    let goal = place(13.5, 1.5);
    let plane = app.screen.layout.projections[0].plane.clone();
    let view = |plane: Plane| {
        let value = |i: usize| {
            let [right, down] = plane.raster.middle_of(i);
            (right - goal[0]).abs().max((-down - goal[1]).abs())
        };
        let candidate = |at: Vec<f32>| Candidate { at, degree: 0.5 };
        View {
            goal: (Some(goal.clone()), 1),
            fields: Arc::new(vec![(0..plane.raster.len()).map(value).collect()]),
            planes: Arc::new(vec![plane]),
            farthest: 14.0,
            graph: Arc::new(Graph {
                candidates: [place(3.5, 3.5), place(7.5, 2.5), place(12.5, 1.5)]
                    .map(candidate)
                    .to_vec(),
                edges: vec![([0, 1], EdgeStatus::Confirmed), ([1, 2], EdgeStatus::Untried)],
            }),
            reach: Reach {
                start: place(1.5, 3.5),
                at: place(4.5, 3.2),
                path: vec![place(7.5, 2.5), goal.clone()],
                way: vec![place(4.5, 3.2), place(7.5, 2.5), goal.clone()],
                trail: vec![place(3.5, 3.4), place(4.5, 3.2)],
                steps: 3,
                left: 9.1,
                distances: (11.5, 3.5),
                waypoint: Some(place(7.5, 2.5)),
                finished: (3, 4),
                ..Reach::default()
            },
            ..View::default()
        }
    };
    // What is known of the space decides which part is shown.
    app.on_view(Arc::new(view(plane)));
    draw(&mut app, width, height);
    let plane = app.screen.layout.projections[0].plane.clone();
    app.on_view(Arc::new(view(plane)));
    app
}

#[test]
fn a_failure_of_the_environment_is_read_whole_on_a_small_screen() {
    let mut app = staged_app(80, 24);
    let cause = "PointMaze_UMaze-v3: its Python process has ended: killed by signal 9\n  one last \
                 line of the environment, which says what it did before it was killed";
    app.change_snapshot(|snapshot| {
        snapshot.phase = gdg::engine::Phase::Failed(cause.to_owned());
    });
    let shown = shown_by(&mut app, 80, 24);
    let words: Vec<&str> = shown.split(|c: char| c.is_whitespace() || c == '\u{2502}').collect();
    let words = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
    for part in ["killed by signal 9", "what it did before it was killed", "save and quit"] {
        assert!(words.contains(part), "{part:?} in\n{shown}");
    }
}

#[test]
fn a_run_that_learns_from_data_says_so_instead_of_agents() {
    let mut app = staged_app(120, 40);
    let source =
        DataSource { file: "a/walks.npz".into(), checksum: 7, transitions: 1_000_000, episodes: 5 };
    app.change_snapshot(|snapshot| {
        (snapshot.data, snapshot.agents) = (Some(Arc::new(source)), Arc::default());
    });
    app.act(Action::Show(Pane::Training));
    let shown = shown_by(&mut app, 120, 40);
    assert!(shown.contains("walks.npz") && shown.contains("1,000,000 recorded"), "{shown}");
}

#[test]
fn clicks_and_keys_move_the_goal_in_the_components_shown() {
    let mut app = staged_app(120, 40);
    draw(&mut app, 120, 40);
    let shown = app.screen.layout.projections[0].clone();
    let at = shown.frame.character_of([5.0, -3.0]).expect("in view");
    mouse(&mut app, MouseEventKind::Down(MouseButton::Left), at);
    let goal = app.space().goal.clone();
    assert!((goal[0] - 5.0).abs() < 0.2 && (goal[1] - 3.0).abs() < 0.3, "{goal:?}");
    assert_eq!(goal[2], 15.0, "the third component is not shown");
    press(&mut app, KeyCode::Up);
    assert!(app.space().goal[1] > goal[1] && app.space().goal[0] == goal[0], "upwards is more");
    app.act(Action::Projection);
    draw(&mut app, 120, 40);
    press(&mut app, KeyCode::Up);
    assert!(app.space().goal[2] > goal[2], "the third component is shown now");
}

#[test]
fn an_unknown_world_is_trained_and_drawn_at_every_size() {
    let limits = Limits { updates: Some(3), ..Limits::default() };
    let mut app = app_in(&world(), Method::default(), limits, None);
    draw(&mut app, 80, 24);
    let shows_d = |app: &App| {
        let view = &app.space().view;
        !app.space().goal.is_empty() && view.fields.iter().flatten().any(|steps| steps.is_finite())
    };
    wait_until(&mut app, shows_d);
    for (width, height) in [(1, 1), (7, 3), (40, 10), (80, 24), (400, 120)] {
        for keys in ["", "P", "Z", "v", "v", "d", "m", "m", "n", "w"] {
            type_text(&mut app, keys);
            draw(&mut app, width, height);
        }
    }
    let first = app.space().goal.clone();
    type_text(&mut app, "n");
    wait_until(&mut app, |app| app.space().goal != first);
    assert!(app.space().view.reach.start.len() == 3);
}
