//! A small picture of a trained run: D to one far goal, the plan to it and the path walked.

use std::sync::Arc;

use miette::{IntoDiagnostic, Report};

use gdg::draw::{Picture, Raster, Rgb, contour, contour_interval, contour_lines, distance_colour};
use gdg::env::maze::full_state_at;
use gdg::env::{Episodes, PointMaze, Task};
use gdg::learn::{Policy, Scratch};
use gdg::map::{Cell, Grid, StepSearch, UNREACHABLE};
use gdg::train::{EvaluationJob, TaskWalk, Trainer};

/// Pixels along the longer side, at most.
const MAX_PIXELS: usize = 340;

/// Pixels along a cell's side, at most.
const MAX_PIXELS_PER_CELL: usize = 8;

/// Pixels between two contour lines, on average, at least.
pub const LINE_SPACING: f32 = 30.0;

const WALL: Rgb = (58, 58, 66);
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
/// The learner fails, or the picture cannot be encoded.
pub fn draw(trainer: &Trainer, map: &Arc<Grid>) -> Result<Vec<u8>, Report> {
    let job = trainer.evaluation().into_diagnostic()?;
    let task = far_task(map);
    let raster = raster(map);
    let mut picture = field(map, raster, &task.goal, job.policy());
    paths(&mut picture, raster, &task, &job);
    picture.to_png().into_diagnostic()
}

/// Returns the map's own task, or else one from its first start to the farthest cell.
pub fn far_task(map: &Arc<Grid>) -> Task {
    if let Some(task) = PointMaze::new(map.clone(), 0).default_task() {
        return task;
    }
    let start = map
        .starts()
        .first()
        .copied()
        .or_else(|| map.free_cells().next())
        .unwrap_or(Cell::new(0, 0));
    let mut search = StepSearch::new(map);
    let steps = search
        .steps_from(start)
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, steps)| *steps != UNREACHABLE);
    let (goal, steps) = steps.max_by_key(|(_, steps)| *steps).unwrap_or_default();
    Task {
        start: full_state_at(start.centre()).to_vec(),
        goal: map.cell(goal).centre().to_vec(),
        shortest: Some(steps),
        group: 0,
    }
}

/// Returns the pixels for a map: whole pixels per cell, or the map scaled down where it is larger
/// than the picture.
fn raster(map: &Grid) -> Raster {
    let (width, height) = (map.width(), map.height());
    let longer = width.max(height);
    let pixels = match MAX_PIXELS / longer {
        0 => {
            let scaled = |side: usize| (side * MAX_PIXELS).div_ceil(longer);
            (scaled(width), scaled(height))
        }
        scale => (width * scale.min(MAX_PIXELS_PER_CELL), height * scale.min(MAX_PIXELS_PER_CELL)),
    };
    Raster { window: [0.0, 0.0, width as f32, height as f32], pixels }
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
    let mut field = vec![f32::NAN; raster.pixels.0 * raster.pixels.1];
    free.iter().zip(&distances).for_each(|(i, distance)| field[*i] = *distance);
    let farthest =
        distances.iter().copied().filter(|distance| distance.is_finite()).fold(1.0, f32::max);
    for i in free {
        picture.pixels_mut()[i] = distance_colour(colorous::VIRIDIS, field[i] / farthest);
    }
    let interval = contour_interval(&field, raster.pixels.0, LINE_SPACING);
    for i in
        contour_lines(&field, raster.pixels.0, interval).into_iter().flat_map(|line| line.pixels)
    {
        picture.pixels_mut()[i] = contour(picture.pixels_mut()[i]);
    }
    picture
}

/// Draws the plan, the path walked and both ends.
fn paths(picture: &mut Picture, raster: Raster, task: &Task, job: &EvaluationJob) {
    let scale = raster.pixels.0 as f32 / raster.window[2];
    let at = |position: &[f32]| [position[0] * scale, position[1] * scale];
    let TaskWalk { plan, states, .. } = job.walk(task);
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
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdg::map::parse_map;

    #[test]
    fn pictures_are_small_and_have_whole_pixels_per_cell_where_possible() {
        let pixels = |width, height| raster(&Grid::empty("map", width, height)).pixels;
        assert_eq!(pixels(16, 10), (128, 80));
        assert_eq!(pixels(65, 81), (260, 324));
        assert_eq!(pixels(256, 200), (256, 200));
        assert_eq!(pixels(1500, 750), (340, 170));
    }

    #[test]
    fn the_task_is_the_maps_own_or_leads_to_the_farthest_cell() {
        let task = |text: &str| {
            let task = far_task(&Arc::new(parse_map("map", text.as_bytes()).expect("a map")));
            (task.start, task.goal, task.shortest)
        };
        assert_eq!(task(".S.G.....\n"), (vec![1.5, 0.5], vec![3.5, 0.5], Some(2)));
        assert_eq!(task(".S...#...\n"), (vec![1.5, 0.5], vec![4.5, 0.5], Some(3)));
        assert_eq!(
            task("#S#G\n"),
            (vec![1.5, 0.5], vec![1.5, 0.5], Some(0)),
            "no path leads to the goal"
        );
    }
}
