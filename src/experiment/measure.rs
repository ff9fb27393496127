//! Measurements of trained runs besides evaluations: walks, a bridge point with the distances
//! around it, and a small picture of D to one far goal, the plan to it and the path walked.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report, miette};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::plan::JobPlan;
use gdg::bridge::{self, BridgePoint, Candidates, SEARCH_BUDGET, SearchSpace};
use gdg::draw::{Picture, Raster, Rgb, WALL, contour_interval, distance_colour};
use gdg::env::{EnvError, EnvSettings, PointMaze, Restart, Task, TaskSet};
use gdg::learn::{Policy, Scratch};
use gdg::map::{Cell, Grid};
use gdg::train::{EvaluationJob, Trainer};

/// Seed of the tasks that are walked: the same for every run on a map.
const TASK_SEED: u64 = 0;

/// Length of the far tasks that are searched for a bridge point, as a share of the map's diameter,
/// and their number.
const FAR_SHARE: f64 = 0.75;
const MORE_TASKS: usize = 200;

/// Bridge points for the figure are at least this share of D(s,g) from either end.
const MIDDLE_SHARE: f32 = 0.25;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Walks, one per requested distance.
    pub walks: Vec<Walked>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bridge: Option<BridgeTrial>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub random: Option<RandomTasks>,
}

/// Success rate on tasks drawn at random, with planning if the method plans.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RandomTasks {
    pub anywhere: f64,
    /// From anywhere to goals as training draws them, which are near ones with the probability
    /// `near_goals`.
    pub as_in_training: f64,
}

/// One walk. Positions are in cells.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Walked {
    /// The requested distance, in steps; that of the task differs by at most one.
    pub distance: u32,
    /// Fewest steps from start to goal.
    pub shortest: u32,
    pub goal: [f32; 2],
    pub reached: bool,
    /// Waypoints of the plan made at the start, the goal last; none if the method does not plan.
    pub plan: Vec<[f32; 2]>,
    pub path: Vec<[f32; 2]>,
}

/// A search for a bridge point b with D(s,b) + D(b,g) < D(s,g), and the distances around it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BridgeTrial {
    pub direct: f32,
    pub found: Option<BestBridge>,
    /// Tasks searched, the last one with success if a point was found.
    pub searches: usize,
    /// Candidates tried in all these searches.
    pub tried: usize,
    /// D(s, cell) for every cell, row by row; null for walls.
    pub from_start: Vec<Option<f32>>,
    /// The same for D(cell, g).
    pub to_goal: Vec<Option<f32>>,
    pub walk: Walked,
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BestBridge {
    pub point: [f32; 2],
    pub from_start: f32,
    pub to_goal: f32,
}

/// Measures what `plan` asks for; `None` if that is nothing. Measurements that need a map are
/// skipped without one.
pub fn measure(
    plan: &JobPlan,
    trainer: &Trainer,
    map: Option<&Arc<Grid>>,
) -> Result<Option<Measured>, Report> {
    if !plan.measures() {
        return Ok(None);
    }
    let job = trainer.evaluation().into_diagnostic()?.within(plan.max_steps);
    let walks = map.map_or(Ok(Vec::new()), |map| {
        let walk_at = |distance: &u32| {
            let mut rng = ChaCha8Rng::seed_from_u64(TASK_SEED);
            let tasks = PointMaze::new(map.clone(), 0).tasks_at(&[*distance], 1, &mut rng).tasks;
            // The map may have none of this length.
            tasks.first().map(|task| walk(&job, task, *distance))
        };
        plan.walks.iter().filter_map(walk_at).collect()
    });
    let walks: Vec<Walked> = walks.into_diagnostic()?;
    let bridge = map.filter(|_| plan.bridge).map(|map| search(trainer, &job, map)).transpose()?;
    let random = plan.random_tasks.map(|count| random_tasks(trainer, &job, count)).transpose();
    let random = random.into_diagnostic()?;
    Ok(Some(Measured { walks, bridge, random }))
}

fn random_tasks(
    trainer: &Trainer,
    job: &EvaluationJob,
    count: u32,
) -> Result<RandomTasks, EnvError> {
    let settings = &trainer.run().settings.train;
    let mut world = trainer.world().fork(1)?;
    world.configure(&EnvSettings { restart: Restart::Anywhere, ..EnvSettings::default() });
    let mut rng = ChaCha8Rng::seed_from_u64(TASK_SEED);
    let anywhere = TaskSet::random(&*world, count as usize, &mut rng)?;
    let mut training = anywhere.clone();
    for task in &mut training.tasks {
        if rng.random::<f32>() < settings.near_goals
            && let Some(near) = world.near_goal(&task.start, settings.near_goal_steps, &mut rng)?
        {
            task.goal = near;
        }
    }
    let success = |tasks| Ok::<_, EnvError>(job.run(tasks)?.success_rate().unwrap_or(0.0));
    Ok(RandomTasks { anywhere: success(&anywhere)?, as_in_training: success(&training)? })
}

fn walk(job: &EvaluationJob, task: &Task, distance: u32) -> Result<Walked, EnvError> {
    let walked = job.walk(task)?;
    Ok(Walked {
        distance,
        shortest: task.shortest.unwrap_or(0),
        goal: position(&task.goal),
        reached: walked.reached,
        plan: walked.plan.iter().map(|stop| position(stop)).collect(),
        path: walked.states.iter().map(|state| position(state)).collect(),
    })
}

/// Searches as published for a bridge point and shows it with the distances to both ends.
fn search(trainer: &Trainer, job: &EvaluationJob, map: &Arc<Grid>) -> Result<BridgeTrial, Report> {
    let policy = job.policy();
    let (task, bridge, searches, tried) = search_tasks(trainer, policy, map);
    let start = start_of(&task);
    let mut scratch = Scratch::default();
    let mut distance = |from: &[f32], to: &[f32]| {
        let distance = hundredths(policy.distance(from, to, &mut scratch));
        distance.ok_or_else(|| miette!(help = "try another seed", "the distances are not finite"))
    };
    let found = match bridge {
        Some(bridge) => Some(BestBridge {
            point: position(&bridge.point),
            from_start: distance(&start, &bridge.point)?,
            to_goal: distance(&bridge.point, &task.goal)?,
        }),
        None => None,
    };
    let direct = distance(&start, &task.goal)?;
    let cells: Vec<Cell> = map.free_cells().collect();
    let places: Vec<[f32; 2]> = cells.iter().map(|cell| cell.centre()).collect();
    let of_cells = |from: &[f32], to: &[f32]| {
        let mut distances = vec![0.0; cells.len()];
        policy.distances(from, to, &mut distances, &mut Scratch::default());
        let mut all = vec![None; map.free().len()];
        for (cell, distance) in cells.iter().zip(distances) {
            all[map.index(*cell)] = hundredths(distance);
        }
        all
    };
    Ok(BridgeTrial {
        direct,
        found,
        searches,
        tried,
        from_start: of_cells(&start.repeat(cells.len()), places.as_flattened()),
        to_goal: of_cells(places.as_flattened(), &task.goal.repeat(cells.len())),
        walk: walk(job, &task, task.shortest.unwrap_or(0)).into_diagnostic()?,
    })
}

fn start_of(task: &Task) -> Vec<f32> {
    task.start.iter().map(|v| *v as f32).collect()
}

/// Searches for a bridge point on one task after another until there is one: from the map's start
/// to the cell farthest from it, then on far tasks drawn at random. Candidates close to either end
/// are left out: they would show the noise of D rather than a bridge. Returns the task, or the
/// first one if there is no bridge point, how many were searched, and candidates tried in all.
fn search_tasks(
    trainer: &Trainer,
    policy: &dyn Policy,
    map: &Arc<Grid>,
) -> (Task, Option<BridgePoint>, usize, usize) {
    let world = PointMaze::new(map.clone(), 0);
    let mut rng = ChaCha8Rng::seed_from_u64(TASK_SEED);
    let far = (FAR_SHARE * f64::from(world.diameter().steps)).round() as u32;
    let mut tasks = vec![world.longest_task()];
    tasks.extend(world.tasks_at(&[far], MORE_TASKS, &mut rng).tasks);
    let (mut scratch, mut tried) = (Scratch::default(), 0);
    for (i, task) in tasks.iter().enumerate() {
        let start = start_of(task);
        let (states, goals) =
            middle(trainer.candidates(), &start, &task.goal, policy, &mut scratch);
        let outcome = bridge::search(
            &start,
            &task.goal,
            SearchSpace { states: &states, goals: &goals },
            SEARCH_BUDGET,
            policy,
            &mut rng,
            &mut scratch,
        );
        tried += outcome.tried();
        if outcome.found.is_some() {
            return (task.clone(), outcome.found, i + 1, tried);
        }
    }
    let searches = tasks.len();
    (tasks.swap_remove(0), None, searches, tried)
}

/// Returns the candidates, as states and as goals, that are at least [`MIDDLE_SHARE`] of D(s,g)
/// from either end.
fn middle(
    candidates: &Candidates,
    start: &[f32],
    goal: &[f32],
    policy: &dyn Policy,
    scratch: &mut Scratch,
) -> (Vec<f32>, Vec<f32>) {
    let (s, g, all) = (start.len(), goal.len(), candidates.len());
    let least = MIDDLE_SHARE * policy.distance(start, goal, scratch);
    let (mut there, mut on) = (vec![0.0; all], vec![0.0; all]);
    policy.distances(&start.repeat(all), candidates.points(), &mut there, scratch);
    policy.distances(candidates.states(), &goal.repeat(all), &mut on, scratch);
    let kept = (0..all).filter(|i| there[*i] >= least && on[*i] >= least);
    let (mut states, mut goals) = (Vec::new(), Vec::new());
    for i in kept {
        states.extend_from_slice(&candidates.states()[s * i..s * (i + 1)]);
        goals.extend_from_slice(&candidates.points()[g * i..g * (i + 1)]);
    }
    (states, goals)
}

fn position(values: &[f32]) -> [f32; 2] {
    [0, 1].map(|i| values.get(i).copied().and_then(hundredths).unwrap_or(0.0))
}

/// Rounds to hundredths; `None` if the number is not finite.
fn hundredths(value: f32) -> Option<f32> {
    value.is_finite().then(|| (100.0 * value).round() / 100.0)
}

/// Pixels along the longer side of a job's picture, at most.
const MAX_PIXELS: usize = 700;

/// Pixels between two contour lines, on average, at least.
const LINE_SPACING: f32 = 30.0;

/// The plan, and bridge points; the start, and the path walked; the goal: as on the screen. They are on
/// dark edges, to stand out from every ground.
const PLAN: Rgb = (255, 90, 60);
const WALKED: Rgb = (255, 140, 30);
const GOAL: Rgb = (214, 40, 57);
const EDGE: Rgb = (20, 20, 30);

/// Draws `trainer`'s run as a PNG file: D to the goal of the map's own task, or else to a cell as
/// far as possible from the start.
pub fn picture(trainer: &Trainer, map: &Arc<Grid>) -> Result<Vec<u8>, Report> {
    let job = trainer.evaluation().into_diagnostic()?;
    let task = PointMaze::new(map.clone(), 0).longest_task();
    let raster = Raster::of_map(map, MAX_PIXELS);
    let mut picture = field(map, raster, |positions| {
        let mut distances = vec![0.0; positions.len()];
        let goals = task.goal.repeat(positions.len());
        let (positions, policy) = (positions.as_flattened(), job.policy());
        policy.distances(positions, &goals, &mut distances, &mut Scratch::default());
        distances
    });
    let walked = walk(&job, &task, task.shortest.unwrap_or(0)).into_diagnostic()?;
    draw_walk(&mut picture, raster, &walked, None);
    picture.to_png("gdg-tui").into_diagnostic()
}

/// Colours the free ground by the distances at positions, light near and dark far, with contour
/// lines.
pub fn field(
    map: &Grid,
    raster: Raster,
    distances: impl FnOnce(&[[f32; 2]]) -> Vec<f32>,
) -> Picture {
    let (free, positions) = raster.free_ground(map);
    let distances = distances(&positions);
    let finite = || distances.iter().copied().filter(|distance| distance.is_finite());
    let (nearest, farthest) =
        (finite().fold(f32::INFINITY, f32::min), finite().fold(1.0, f32::max));
    let mut picture = Picture::new(raster.pixels, WALL);
    let mut field = vec![f32::NAN; raster.len()];
    for (i, distance) in free.into_iter().zip(distances).filter(|(_, at)| at.is_finite()) {
        let share = (distance - nearest) / (farthest - nearest).max(1e-3);
        picture.pixels_mut()[i] = distance_colour(colorous::VIRIDIS, share);
        field[i] = distance;
    }
    picture.contours(&field, contour_interval(&field, raster.pixels.0, LINE_SPACING));
    picture
}

pub fn draw_walk(picture: &mut Picture, raster: Raster, walk: &Walked, bridge: Option<[f32; 2]>) {
    let scale = raster.pixels.0 as f32 / raster.window[2];
    let at = |position: &[f32; 2]| position.map(|along| along * scale);
    let walked: Vec<[f32; 2]> = walk.path.iter().map(at).collect();
    let start = walked.first().copied();
    let planned: Vec<[f32; 2]> = start.into_iter().chain(walk.plan.iter().map(at)).collect();
    // The path walked is narrower than the plan, which stays visible where it is followed. Widths
    // in pixels.
    let (wide, narrow) = ((0.3 * scale).max(1.0), (0.12 * scale).max(0.5));
    picture.lines(&planned, wide + 0.6, EDGE);
    picture.lines(&planned, wide, PLAN);
    if narrow > 0.7 {
        picture.lines(&walked, narrow + 0.5, EDGE);
    }
    picture.lines(&walked, narrow, WALKED);
    let radius = (0.45 * scale).max(2.5);
    let dots = [(start, WALKED), (Some(at(&walk.goal)), GOAL), (bridge.as_ref().map(at), PLAN)];
    for (position, colour) in dots {
        if let Some(position) = position {
            picture.disc(position, radius + 1.0, EDGE);
            picture.disc(position, radius, colour);
        }
    }
}
