//! A small picture of a trained run: D to one far goal, the plan to it and the path walked.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report};

use gdg::draw::{Picture, Raster, Rgb, WALL, contour_interval, distance_colour};
use gdg::env::{EnvError, PointMaze, Task};
use gdg::learn::{Policy, Scratch};
use gdg::map::Grid;
use gdg::train::{EvaluationJob, TaskWalk, Trainer};

/// Pixels along the longer side, at most.
const MAX_PIXELS: usize = 340;

/// Pixels along a cell's side, at most.
const MAX_PIXELS_PER_CELL: usize = 8;

/// Pixels between two contour lines, on average, at least.
pub const LINE_SPACING: f32 = 30.0;

/// The plan: red; the path walked: white; on dark edges, to stand out from every ground.
const PLAN: Rgb = (255, 70, 50);
const WALKED: Rgb = (255, 255, 255);
const EDGE: Rgb = (20, 20, 30);
const START: Rgb = (86, 180, 233);
const GOAL: Rgb = (230, 159, 0);

/// Draws `trainer`'s run as a PNG file: D to the goal of the map's own task, or else to a cell as
/// far as possible from the start.
///
/// # Errors
/// The learner or the world fails, or the picture cannot be encoded.
pub fn draw(trainer: &Trainer, map: &Arc<Grid>) -> Result<Vec<u8>, Report> {
    let job = trainer.evaluation().into_diagnostic()?;
    let task = PointMaze::new(map.clone(), 0).longest_task();
    let raster = Raster::of_map(map, MAX_PIXELS, MAX_PIXELS_PER_CELL);
    let mut picture = field(map, raster, &task.goal, job.policy());
    paths(&mut picture, raster, &task, &job).into_diagnostic()?;
    picture.to_png("gdg-tui").into_diagnostic()
}

/// Colours the free ground by D to `goal`, light near and dark far, with contour lines.
fn field(map: &Grid, raster: Raster, goal: &[f32], policy: &dyn Policy) -> Picture {
    let (free, positions) = raster.free_ground(map);
    let mut distances = vec![0.0; free.len()];
    policy.distances(
        positions.as_flattened(),
        &goal.repeat(free.len()),
        &mut distances,
        &mut Scratch::default(),
    );
    let mut picture = Picture::new(raster.pixels, WALL);
    let mut field = vec![f32::NAN; raster.len()];
    free.iter().zip(&distances).for_each(|(i, distance)| field[*i] = *distance);
    let farthest =
        distances.iter().copied().filter(|distance| distance.is_finite()).fold(1.0, f32::max);
    for i in free {
        picture.pixels_mut()[i] = distance_colour(colorous::VIRIDIS, field[i] / farthest);
    }
    picture.contours(&field, contour_interval(&field, raster.pixels.0, LINE_SPACING));
    picture
}

/// Draws the plan, the path walked and both ends.
fn paths(
    picture: &mut Picture,
    raster: Raster,
    task: &Task,
    job: &EvaluationJob,
) -> Result<(), EnvError> {
    let scale = raster.pixels.0 as f32 / raster.window[2];
    let at = |position: &[f32]| [position[0] * scale, position[1] * scale];
    let TaskWalk { plan, states, .. } = job.walk(task)?;
    let walked: Vec<[f32; 2]> = states.iter().map(|state| at(state)).collect();
    let start: Vec<[f32; 2]> = walked.first().copied().into_iter().collect();
    let planned: Vec<[f32; 2]> =
        start.iter().copied().chain(plan.iter().map(|stop| at(stop))).collect();
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
    for (position, colour) in [(start.first().copied(), START), (Some(at(&task.goal)), GOAL)] {
        if let Some(position) = position {
            picture.disc(position, radius + 1.0, EDGE);
            picture.disc(position, radius, colour);
        }
    }
    Ok(())
}
