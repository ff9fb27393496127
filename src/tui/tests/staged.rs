//! A run in progress with fixed numbers, since training results differ between machines.

use super::*;
use gdg::bridge::{BridgePoint, EdgeStatus, SearchOutcome};
use gdg::engine::NextEvaluation;
use gdg::train::{Counters, CurvePoint, DistanceError, DistanceScore, Evaluation, Score};
use gdg::viewer::{Candidate, Exploration, Ghost, Graph, Plane, Reach, way_along};

fn score(success: f64) -> Score {
    let by_distance = (1..=6).map(|i| DistanceScore {
        distance_steps: Some(f64::from(5 * i)),
        distance_cm: None,
        tasks: 10,
        success: Some((success + 0.1 - 0.05 * f64::from(i)).clamp(0.0, 1.0)),
        spl: Some(success),
    });
    Score {
        success: Some(success),
        spl: Some(success),
        steps_ratio: Some(1.1),
        by_distance: by_distance.collect(),
    }
}

fn coverage(at: f64) -> f64 {
    0.8 * at.sqrt()
}

pub(super) fn evaluation(at: f64) -> Evaluation {
    Evaluation {
        alone: score(0.6 * at),
        planned: Some(score(at)),
        straight: None,
        error: Some(DistanceError { mape: 0.5 - 0.4 * at, ..DistanceError::default() }),
        bridges: None,
        explored: Some(coverage(at)),
        marked: None,
        scenario: None,
    }
}

/// Returns an app in the middle of a run, with fixed numbers, drawn once at the given size.
pub(super) fn staged_app(width: u16, height: u16) -> Still {
    let mut app = still();
    draw(&mut app, width, height);
    let evaluations = (1..=4).map(|i| (2_500 * i, evaluation(0.25 * i as f64))).collect();
    let search = SearchOutcome {
        state: vec![1.5, 0.5],
        goal: vec![15.5, 1.5],
        rejected: vec![3.5, 3.5, 17.5, 3.5],
        found: Some(BridgePoint { point: vec![10.5, 2.5], gain: 4.0 }),
        budget: 64,
    };
    for updates in [2_500, 5_000, 7_500, 10_000] {
        let mut counters = Counters::default();
        (counters.updates, counters.env_steps, counters.episodes) =
            (updates, 16 * updates, updates / 10);
        let losses = gdg::learn::Losses {
            critic: 100.0 / updates as f32,
            model: 0.002,
            model_steps: 0.0,
            actor: 9.5,
        };
        let snapshot = Snapshot {
            phase: Phase::Running,
            counters,
            limits: Limits { updates: Some(20_000), ..Limits::default() },
            seconds: 12.0,
            seconds_left: Some(12.3),
            rates: (812.0, 13_000.0),
            losses,
            replay: (15_000, 20_000),
            agents: Arc::new(vec![4.5, 3.5, 7.5, 1.5, 14.5, 2.5]),
            trails: Arc::new(vec![vec![3.5, 3.5, 4.0, 3.5, 4.5, 3.5]]),
            frontier_goals: Arc::new(vec![13.5, 1.5]),
            search: Some(Arc::new(search.clone())),
            evaluations: Arc::new(Vec::new()),
            next_evaluation: NextEvaluation::AtUpdate(updates + 1_000),
            curve: {
                let mut curve = app.screen.snapshot.curve.to_vec();
                let coverage = Some(coverage(updates as f64 / 10_000.0) as f32);
                curve.push(CurvePoint {
                    updates,
                    losses: [losses.critic, losses.model, losses.actor],
                    coverage,
                });
                Arc::new(curve)
            },
            ..(*app.screen.snapshot).clone()
        };
        app.on_snapshot(Arc::new(snapshot));
    }
    app.change_snapshot(|snapshot| snapshot.evaluations = Arc::new(evaluations));
    let view = staged_view(&app);
    app.on_view(Arc::new(view));
    app
}

/// Returns the view of the rooms map in [`staged_app`].
pub(super) fn staged_view(app: &Session) -> View {
    let frame = app.screen.layout.map.clone().expect("the map is drawn");
    let field = |i: usize| {
        let (column, row) = (i % frame.raster.pixels.0, i / frame.raster.pixels.0);
        let [left, top, width, height] = frame.raster.window;
        let x = left + (column as f32 + 0.5) / frame.raster.pixels.0 as f32 * width;
        let y = top + (row as f32 + 0.5) / frame.raster.pixels.1 as f32 * height;
        let free = app.maze().map.is_free_at(x, y);
        if free { 2.0 * (x - 19.5).abs().max((y - 4.5).abs()) } else { f32::NAN }
    };
    let candidate =
        |(i, at): (usize, [f32; 2])| Candidate { at: at.to_vec(), degree: i as f32 / 4.0 };
    let candidates = [[2.5, 2.5], [6.5, 1.5], [10.5, 2.5], [14.5, 3.5], [18.5, 1.5]];
    let standings =
        [EdgeStatus::Confirmed, EdgeStatus::Demoted, EdgeStatus::Confirmed, EdgeStatus::Confirmed];
    let edges = (0..).zip(standings).map(|(i, status)| ([i, i + 1], status));
    let values: Vec<f32> = (0..frame.raster.pixels.0 * frame.raster.pixels.1).map(field).collect();
    // Everything except the right end and a single cell.
    let map = &app.maze().map;
    let visited = |i: usize| map.cell(i).x < 15 && map.cell(i) != Cell::new(3, 3);
    let visits: Vec<u32> = (0..map.free().len()).map(|i| u32::from(visited(i))).collect();
    let places = |at: &[[f32; 2]]| at.iter().map(|at| at.to_vec()).collect::<Vec<_>>();
    let stops = [[3.5, 1.9], [6.5, 1.5], [10.5, 2.5], [14.5, 3.5], [19.5, 4.5]];
    View {
        goal: (Some(app.maze().goal.centre().to_vec()), 1),
        kind: Field::Learned,
        farthest: values.iter().copied().filter(|d| d.is_finite()).fold(1.0, f32::max),
        fields: Arc::new(vec![values]),
        planes: Arc::new(vec![Plane::of_maze(frame.raster)]),
        graph: Arc::new(Graph {
            candidates: candidates.into_iter().enumerate().map(candidate).collect(),
            edges: edges.collect(),
        }),
        exploration: Arc::new(Exploration::new(&app.maze().map, &visits)),
        reach: Reach {
            start: vec![0.5, 2.5],
            at: vec![3.5, 1.9],
            trail: places(&[[1.5, 2.5], [2.5, 2.2], [3.5, 1.9]]),
            path: places(&stops[1..]),
            way: places(&way_along(map, &stops)),
            steps: 4,
            shortest: Some(19),
            distances: (15.2, 2.1),
            along: 12.4,
            waypoint: Some(vec![6.5, 1.5]),
            finished: (3, 4),
            ghost: Some(Ghost::new(vec![2.5, 0.5])),
            ..Reach::default()
        },
        ..View::default()
    }
}
